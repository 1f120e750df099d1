"""``eomgen run``: what it reports, writes and plots."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import eomgen
import eomgen as eg
from eomgen.cli.energy import balance_energy
from eomgen.cli.verb_run import _energy_rows

from .conftest import EXAMPLES, Call

MODELS = sorted(EXAMPLES.glob("*.yaml"))
#: Largest change of a coordinate (rad, m) that a run must make where it is less than 1; these stand on springs.
TRAVEL = {"car_axis": 0.15, "kapitza_pendulum": 0.35, "double_wishbone": 0.4, "half_car": 0.06, "gait_leg": 0.6}
TRAVEL["hydraulic_boom"] = 0.35


def test_what_is_printed(call: Call) -> None:
    result = call("run", EXAMPLES / "slider_crank.yaml", "--end", "1")
    assert result.code == 0
    for said in ("degrees of freedom", "operations", "loop residual", "energy", "theta", "pin_x"):
        assert said in result.out
    for stage in ("derive", "compile", "simulate"):
        assert stage in result.err


def test_json(call: Call) -> None:
    run = call("run", EXAMPLES / "slider_crank.yaml", "--end", "1", "--json").json
    assert set(run) == {
        "name", "method", "choice", "system", "report", "operations", "seconds", "integration", "loop_residual",
        "energy", "change_points", "final", "files", "origin", "parameters", "inputs",
    }  # fmt: skip
    assert set(run["seconds"]) >= {"describe", "kinematics", "equations", "compile", "simulate"}
    assert set(run["integration"]) == {"method", "rtol", "atol", "end", "steps", "calls", "jacobians", "options"}
    assert set(run["loop_residual"]) == {
        f"{what}{level}" for what in ("raw", "projected", "correction") for level in ("", "_velocity")
    }
    assert set(run["energy"]) == {"initial", "final", "work", "drift", "power_balance", "jumps"}
    assert set(run["origin"]) == {"model_digest", "target", "versions"}
    assert set(run["origin"]["versions"]) == {"eomgen", "python", "numpy", "compiler"}
    assert run["parameters"]["r"] == 0.1
    assert {"t", "theta", "theta_dot", "s", "pin_x", "speed"} <= set(run["final"])
    assert run["final"]["t"] == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("path", MODELS, ids=lambda p: p.stem)
def test_examples_move_and_keep_their_energy(call: Call, path: Path) -> None:
    run = call("run", path, "--json", "--out", "run.npz").json
    trajectory = eomgen.load_trajectory("run.npz")
    travel = max(np.ptp(trajectory[name]) for name in run["report"]["coordinates"])
    driven = "type: driver" in path.read_text(encoding="utf-8")
    assert travel > TRAVEL.get(path.stem, 1.0)
    assert run["loop_residual"]["projected"] < 1e-10
    balance = run["energy"]["power_balance"]
    assert balance is None if driven else balance < 1e-7


def test_the_integrator_and_its_tolerances_can_be_chosen(call: Call) -> None:
    path = EXAMPLES / "slider_crank.yaml"
    declared = call("run", path, "--end", "0.5", "--json").json
    words = ["--solver", "radau", "--rtol", "1e-4", "--atol", "1e-6"]
    chosen = call("run", path, "--end", "0.5", *words, "--json").json
    assert {key: chosen["integration"][key] for key in ("method", "rtol", "atol")} == {
        "method": "Radau", "rtol": 1e-4, "atol": 1e-6,
    }  # fmt: skip
    assert chosen["integration"]["jacobians"] > 0
    assert declared["integration"]["method"] == "DOP853"
    gap = abs(chosen["final"]["theta"] - declared["final"]["theta"])
    assert 1e-9 < gap < 1e-2  # the tolerance reaches the integrator


def test_out_npz_and_set(call: Call, tmp_path: Path) -> None:
    result = call(
        "run", EXAMPLES / "pendulum.yaml", "--set", "theta=0.1", "--set", "l=2", "--end", "0.5", "--out", "r.npz"
    )
    assert result.code == 0
    trajectory = eomgen.load_trajectory(tmp_path / "r.npz")
    assert trajectory["theta"][0] == pytest.approx(0.1)
    assert trajectory["theta"][-1] == pytest.approx(0.1 * np.cos(np.sqrt(9.81 / 2) * 0.5), rel=5e-3)  # a small swing


def test_out_csv(call: Call, tmp_path: Path) -> None:
    assert call("run", EXAMPLES / "pendulum.yaml", "--end", "0.5", "--out", "r.csv").code == 0
    with (tmp_path / "r.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {"t", "theta", "theta_dot", "x", "y"} <= set(rows[0])
    assert float(rows[0]["theta"]) == -np.pi / 2  # every digit is kept
    assert float(rows[-1]["t"]) == 0.5


def test_plot(call: Call, tmp_path: Path) -> None:
    assert call("run", EXAMPLES / "four_bar.yaml", "--end", "0.7", "--plot", "new/folder/p.png").code == 0
    assert (tmp_path / "new" / "folder" / "p.png").read_bytes().startswith(b"\x89PNG")


def test_another_method_and_partition_give_the_same_motion(call: Call) -> None:
    path = EXAMPLES / "slider_crank.yaml"
    one = call("run", path, "--end", "0.5", "--json").json
    other = call("run", path, "--end", "0.5", "--method", "lagrange", "--independent", "s", "--json").json
    assert other["method"] == "lagrange"
    assert other["report"]["independent"] == ["s"]
    for name, value in one["final"].items():
        assert other["final"][name] == pytest.approx(value, rel=1e-6, abs=1e-7)


def test_a_run_with_c_code_that_has_no_python_twin_tells_that_its_power_balance_is_not_formed(
    call: Call, tmp_path: Path
) -> None:
    (tmp_path / "drag.c").write_text("double drag(double w) { return -0.5*w; }\n", encoding="utf-8")
    model = tmp_path / "model.yaml"
    model.write_text(
        "name: dragged\nfunctions:\n  drag: {type: native, source: drag.c}\n"
        "bodies:\n  bob: {mass: 1, com: [0, -1, 0]}\n"
        "joints:\n  q: {type: revolute, between: [ground, bob]}\n"
        "forces:\n  law: {type: torque, joint: q, value: drag(q_dot)}\n",
        encoding="utf-8",
    )
    words = ["run", model, "--allow-native", "--end", "1", "--set", "q_dot=1"]
    result = call(*words, "--out", "run.csv")
    assert result.code == 0, result.err
    assert "not computed: drag is C code without a Python version" in result.out
    assert (tmp_path / "run.csv").is_file()
    run = call(*words, "--json").json
    assert run["energy"]["power_balance"] is None
    assert abs(run["final"]["q_dot"] - np.exp(-0.5)) < 1e-7  # w' = -w/2 with the inertia m l^2 = 1


def test_the_work_of_an_input_that_changes_over_time_is_counted(call: Call, tmp_path: Path) -> None:
    model = tmp_path / "model.yaml"
    model.write_text(
        'name: pushed\ninputs: {u: {value: 0, signal: "sin(3*t)"}}\nbodies: {b: {mass: 1}}\n'
        "joints: {s: {type: prismatic, between: [ground, b], axis: x}}\n"
        "forces: {f: {type: torque, joint: s, value: u}}\nsimulation: {end: 2}\ninitial: {s_dot: 0}\n",
        encoding="utf-8",
    )
    words = ["run", model, "--target", "numpy"]
    energy = call(*words, "--json").json["energy"]
    speed = (1.0 - np.cos(6.0)) / 3.0  # s' = (1 - cos 3t)/3
    assert abs(energy["work"] - speed**2 / 2.0) < 1e-9
    assert energy["power_balance"] < 1e-8
    out = call(*words).out
    assert "work of forces and inputs" in out
    assert "kept to" not in out


def test_a_run_without_work_keeps_no_steps_between() -> None:
    """A million steps of a motion without dampers and drives fit: only what is reported is kept."""
    from eomgen.cli.energy import counts_work

    bob = {"mass": 1, "com": [0, -0.5, 0]}
    for damping, wanted in ((None, False), (0.1, True)):
        model = eomgen.Model("bob", gravity=(0, -9.81, 0))
        body = model.body("bob", **bob)
        model.revolute("hinge", model.ground, body, coordinate="q")
        if damping is not None:
            model.torsional_damper("d", "hinge", damping=damping)
        assert counts_work(model.derive()) is wanted


def test_what_rests_is_told_as_resting(call: Call, model_file: Callable[[str], Path]) -> None:
    """A leg that falls freely keeps its angle; what the integrator leaves of its rate is not a result."""
    file = model_file(
        "name: falling\ngravity: [0, -9.81, 0]\n"
        "bodies: {hull: {mass: 5}, leg: {mass: 0.1, com: [0.13, 0, 0], inertia: {zz: 0.001}}}\n"
        "joints: {lift: {type: prismatic, between: [ground, hull], axis: y, coordinate: h}, "
        "hip: {type: revolute, between: [hull, leg], coordinate: a}}\n"
        "forces: {spring: {type: joint_spring, joint: hip, stiffness: 40, rest: -0.4}}\n"
        "initial: {a: -0.4}\nsimulation: {end: 0.5}\n"
    )
    lines = call("run", file, "--target", "numpy").out.splitlines()
    assert any(line.split() == ["a_dot", "0", "rad/s"] for line in lines)
    assert any(line.split() == ["h_dot", "-4.905", "m/s"] for line in lines)
    assert any(line.endswith("work of forces and inputs 0 J") or "kept to" in line for line in lines)


def test_the_loss_of_a_plastic_impact_is_told_and_left_out_of_the_balance() -> None:
    """Two wheels that couple lose J_1 J_2 / (J_1 + J_2) / 2 of the square of the slip."""
    m = eg.Model("clutch")
    for name, inertia in (("a", 0.3), ("b", 0.5)):
        m.revolute(name, m.ground, m.body(f"wheel_{name}", mass=1, inertia={"zz": inertia}))
    m.coupling("clutch", equation="a_dot - b_dot", closes="1 - t")
    m.initial(a_dot=4)
    equations = m.derive()
    run = equations.compile(target="numpy").simulate(2.0, dense_output=True)
    found = balance_energy(equations, run)
    assert found is not None
    assert found.jumps == pytest.approx(-0.3 * 0.5 / 0.8 / 2 * 4**2, rel=1e-12)
    assert found.power_balance is not None
    assert found.power_balance < 1e-10
    assert found.drift > 0.5
    told = dict(_energy_rows(found, ()))
    assert told["impacts, resets"] == "added -1.5 J at their instants"
    assert told["power balance"].endswith("impacts and resets left out")
