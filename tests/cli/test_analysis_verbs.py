"""The verbs that analyse a model: text, pinned keys of --json, exit codes."""

from __future__ import annotations

import numpy as np
import pytest

from .conftest import EXAMPLES, Call

CRANK = EXAMPLES / "slider_crank.yaml"
PENDULUM = EXAMPLES / "double_pendulum.yaml"
KEYS = {
    "linearise": {
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
    "sensitivity": {"name", "method", "t", "names", "held", "steps", "final", "files"},
}  # fmt: skip


@pytest.mark.parametrize("verb", KEYS)
def test_keys_of_json(call: Call, verb: str) -> None:
    words = ["--end", "0.05", "--by", "r,theta"] if verb == "sensitivity" else []
    result = call(verb, CRANK, "--target", "numpy", "--json", *words)
    assert result.code == 0, result.err
    assert set(result.json) == KEYS[verb]
    assert result.json["name"] == "slider_crank"


def test_linearise(call: Call) -> None:
    rest = ["--set", "theta1=0.2", "--set", "bend=-0.1"]
    found = call("linearise", PENDULUM, "--equilibrium", *rest, "--target", "numpy", "--json").json
    assert found["equilibrium"]
    assert found["states"] == ["theta1", "bend", "theta1_dot", "bend_dot"]
    values = np.array(found["eigenvalues"]) @ [1, 1j]
    np.testing.assert_allclose(np.sort(np.abs(np.linalg.eigvals(np.array(found["A"])))), np.sort(np.abs(values)), 1e-9)
    text = call("linearise", PENDULUM, "--target", "numpy", *rest).out
    assert "no steady motion" in text
    assert "theta1_dot" in text
    full = call("linearise", CRANK, "--full", "--target", "numpy", "--json").json
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


def test_sensitivity(call: Call, tmp_path) -> None:
    words = ("sensitivity", PENDULUM, "--end", "0.2", "--target", "numpy")
    found = call(*words, "--by", "l1", "--by", "theta1", "--out", "by.csv")
    assert found.code == 0, found.err
    assert "wrote by.csv" in found.out
    assert (tmp_path / "by.csv").read_text().startswith("t,d(")
    assert call(*words, "--by", "l9").code == 2
    assert call(*words, "--out", "by.txt").code == 2
