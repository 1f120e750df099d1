"""The verbs that analyse a model: text, pinned keys of --json, exit codes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from .conftest import EXAMPLES, Call

CRANK = EXAMPLES / "slider_crank.yaml"
PENDULUM = EXAMPLES / "double_pendulum.yaml"
KEYS = {
    "linearize": {
        "name", "method", "t", "x", "states", "inputs", "outputs", "A", "B", "C", "D", "mass", "damping", "stiffness",
        "drift", "velocities", "positions", "equilibrium", "steady", "eigenvalues", "stability",
    },
    "modes": {
        "name", "method", "t", "coordinates", "stability", "names", "squares", "frequencies", "hertz", "shapes",
        "rigid", "diverging", "damped",
    },
    "equilibrium": {
        "name", "method", "t", "coordinates", "unknowns", "supports", "forces", "steps", "eigenvalues", "stability",
    },
    "reactions": {
        "name", "method", "t", "end", "joints", "components", "reactions", "undetermined", "constraints",
        "multipliers", "files",
    },
    "inverse": {
        "name", "method", "t", "forces", "accelerations", "constraints", "multipliers", "joints", "reactions",
    },
    "impact": {
        "name", "method", "t", "names", "impulses", "energy_lost", "x", "rates_before", "rates_after", "constraints",
        "constraint_impulses",
    },
    "consistent": {"name", "method", "t", "x", "rough", "change"},
    "sensitivity": {"name", "method", "t", "names", "held", "steps", "final", "events", "files"},
}  # fmt: skip


@pytest.mark.parametrize("verb", KEYS)
def test_keys_of_json(call: Call, verb: str) -> None:
    words = {"sensitivity": ["--end", "0.05", "--by", "r,theta"], "impact": ["--stop", "s"]}.get(verb, [])
    result = call(verb, CRANK, "--target", "numpy", "--json", *words)
    assert result.code == 0, result.err
    assert set(result.json) == KEYS[verb] | {"origin"}
    assert result.json["name"] == "slider_crank"


def test_linearize(call: Call) -> None:
    rest = ["--set", "theta1=0.2", "--set", "bend=-0.1"]
    found = call("linearize", PENDULUM, "--equilibrium", *rest, "--target", "numpy", "--json").json
    assert found["equilibrium"]
    assert found["states"] == ["theta1", "bend", "theta1_dot", "bend_dot"]
    values = np.array(found["eigenvalues"]) @ [1, 1j]
    np.testing.assert_allclose(np.sort(np.abs(np.linalg.eigvals(np.array(found["A"])))), np.sort(np.abs(values)), 1e-9)
    text = call("linearize", PENDULUM, "--target", "numpy", *rest).out
    assert "no steady motion" in text
    assert "theta1_dot" in text
    full = call("linearize", CRANK, "--full", "--target", "numpy", "--json").json
    assert len(full["A"]) == 6
    assert full["mass"] is None


def test_modes(call: Call) -> None:
    found = call("modes", PENDULUM, "--set", "theta1=0.1", "--target", "numpy")
    assert "rad/s" in found.out
    assert "Equilibrium of double_pendulum" in found.out


def test_equilibrium(call: Call) -> None:
    words = ("equilibrium", CRANK, "--target", "numpy", "--json")
    found = call(*words, "--hold", "theta=0.4", "--unknown", "tau").json
    assert found["coordinates"]["theta"] == 0.4
    assert set(found["unknowns"]) == {"tau"}
    assert "--hold theta=: write name=value" in call(*words, "--hold", "theta=").err
    held = call(*words, "--set", "theta=0.4", "--hold", "theta").json
    assert held["supports"]["theta"] == pytest.approx(found["unknowns"]["tau"], rel=1e-9)
    falls = call("equilibrium", EXAMPLES / "spherical_pendulum.yaml", "--hold", "nothing", "--target", "numpy")
    assert falls.code == 2
    assert "no coordinate 'nothing'" in falls.err


def test_no_equilibrium(call: Call, model_file) -> None:
    path = model_file(
        "name: fall\ngravity: [0, -9.81, 0]\nbodies: {b: {mass: 1}}\n"
        "joints: {s: {type: prismatic, between: [ground, b], axis: y}}\n"
    )
    result = call("equilibrium", path, "--target", "numpy")
    assert result.code == 1
    assert "no equilibrium of 'fall' found from this guess: the generalized force along s is still -9.81" in result.err


def test_consistent(call: Call) -> None:
    words = ("consistent", CRANK, "--target", "numpy", "--json")
    rough = ("--set", "theta=0.3", "--set", "B=-0.2", "--set", "s=0.4", "--set", "theta_dot=5")
    held = call(*words, *rough, "--hold", "theta").json
    assert held["x"]["theta"] == held["rough"]["theta"] == 0.3
    theta, B, s = (held["x"][name] for name in ("theta", "B", "s"))
    # r sin theta + l sin(theta + B) = 0 and s = r cos theta + l cos(theta + B) with r = 0.1, l = 0.35
    assert abs(0.1 * np.sin(theta) + 0.35 * np.sin(theta + B)) < 1e-12
    assert abs(s - 0.1 * np.cos(theta) - 0.35 * np.cos(theta + B)) < 1e-12
    light, heavy = (abs(call(*words, *rough, "--weight", f"s={w}").json["change"]["s"]) for w in ("1e-4", "1e4"))
    assert heavy < 0.1 * light
    assert call("consistent", CRANK, "--weight", "s", "--target", "numpy").code == 2
    assert "the names of a rough state are" in call("consistent", CRANK, "--set", "C=1", "--target", "numpy").err


def test_sensitivity(call: Call, tmp_path) -> None:
    words = ("sensitivity", PENDULUM, "--end", "0.2", "--target", "numpy")
    found = call(*words, "--by", "l1", "--by", "theta1", "--out", "by.csv")
    assert found.code == 0, found.err
    assert "wrote by.csv" in found.out
    assert (tmp_path / "by.csv").read_text().startswith("t,d(")
    assert call(*words, "--by", "l9").code == 2
    assert call(*words, "--out", "by.txt").code == 2


def test_reactions(call: Call, tmp_path: Path) -> None:
    found = call("reactions", CRANK, "--target", "numpy", "--json").json
    assert found["joints"] == ["A", "B", "C", "D"]
    assert np.array(found["undetermined"])[:, 2:5].all()
    text = call("reactions", CRANK, "--target", "numpy").out
    assert "0*" in text
    assert "the constraints are redundant" in text
    out = tmp_path / "r.csv"
    peaks = call("reactions", CRANK, "--target", "numpy", "--end", "0.1", "--out", out, "--json").json
    table = np.genfromtxt(out, delimiter=",", names=True, deletechars="")
    assert peaks["files"] == [str(out)]
    np.testing.assert_allclose(np.abs(table["A.Fx"]).max(), abs(peaks["reactions"][0][0]), rtol=1e-12)
    np.testing.assert_allclose(table["A.Fx"][0], found["reactions"][0][0], rtol=1e-9)
    archive = tmp_path / "r.npz"
    assert call("reactions", CRANK, "--target", "numpy", "--end", "0.1", "--out", archive).code == 0
    np.testing.assert_allclose(np.load(archive)["reactions"][0], table["A.Fx"])
    assert call("reactions", CRANK, "--target", "numpy", "--out", out).code == 2


def test_inverse(call: Call) -> None:
    words = ("inverse", CRANK, "--target", "numpy", "--json", "--accelerate", "theta=3")
    found = call(*words).json
    other = call(*words, "--actuated", "tau").json
    assert abs(found["accelerations"]["theta_ddot"] - 3.0) < 1e-12
    declared = call("linearize", CRANK, "--target", "numpy", "--json").json["inputs"]
    assert declared == ["tau"]
    assert set(other["forces"]) == {"tau"}
    np.testing.assert_allclose(other["reactions"], found["reactions"], atol=1e-9)
    assert "N m" in call("inverse", CRANK, "--target", "numpy").out
    failed = call("inverse", CRANK, "--target", "numpy", "--actuated", "thet")
    assert failed.code == 2
    assert "did you mean 'theta'" in failed.err


def test_impact(call: Call) -> None:
    words = ("impact", CRANK, "--target", "numpy", "--gap")
    found = call(*words, "s=0.5", "--closed", "--json", "--set", "theta=0.3").json
    np.testing.assert_allclose(found["rates_after"][0], -0.5 * found["rates_before"][0], rtol=1e-9)
    assert found["energy_lost"] > 0.0
    assert "energy lost" in call("impact", CRANK, "--target", "numpy", "--stop", "s").out
    for option, message in (
        ([], "give --gap NAME=RESTITUTION for what closes, or --stop NAME"),
        (["--gap", "s"], "--gap s: write name=value, for example --gap s=0.5"),
        (["--gap", "s=abc"], "--gap s=abc: 'abc' is not a number"),
        (["--gap", "ss=0.5"], "--gap: no coordinate or output 'ss'"),
        (["--gap", "s=2"], "--gap: the restitution of s must be between 0 and 1"),
        (["--stop", "q"], "--stop: no coordinate or output 'q'"),
        (["--gap", "s=0.5"], "(open); an impact needs a gap of 0"),
        (["--gap", "s=0.5", "--slip", "s"], "--slip: 's' is not NAME=MU:SPEED"),
        (["--gap", "s=0.5", "--slip", "s=0.3:vv"], "--slip: no coordinate or output 'vv' for the sliding of s"),
        (["--gap", "s=0.5", "--slip", "s=0.3:theta", "--stop", "s"], "give --slip or --stop, not both"),
    ):
        result = call("impact", CRANK, "--target", "numpy", *option)
        assert result.code == 2
        assert message in " ".join(result.err.split())


def test_impact_with_friction(call: Call, tmp_path: Path) -> None:
    """A ball that slides all along its bounce loses mu (1 + e) of its speed."""
    file = tmp_path / "ball.yaml"
    file.write_text(
        "name: ball\nbodies: {b: {mass: 2, inertia: {zz: 1}}}\njoints: {fly: {type: planar, between: [ground, b]}}\n"
        "outputs: {gap: y(b), slide: vx(b)}\ninitial: {fly_x_dot: 1, fly_y_dot: -0.5}\n",
        encoding="utf-8",
    )
    words = ("impact", file, "--target", "numpy", "--gap", "gap=0.4", "--slip", "gap=0.3:slide")
    found = call(*words, "--json").json
    np.testing.assert_allclose(found["friction"]["gap"], [-0.3 * 1.4 * 0.5 * 2])
    np.testing.assert_allclose(found["sliding_after"]["gap"], [1 - 0.3 * 1.4 * 0.5])
    assert "friction of gap  impulse -0.42, sliding 1 -> 0.79" in call(*words).out
