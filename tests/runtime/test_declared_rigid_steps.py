"""Method moreau with its step in a model file and on the command line, and where it is refused by name."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import eomgen as eg
from eomgen.cli.command import eomgen
from eomgen.errors import UnavailableError, UsageError

FILE = """
name: slid
gravity: [0, -9.81, 0]
bodies: {crate: {mass: 20.0, inertia: {zz: 0.8}}}
joints: {j: {type: planar, between: [ground, crate]}}
contacts:
  floor:
    first: [{shape: box, on: crate, size: [0.6, 0.4]}]
    second: [{shape: half_plane, on: ground}]
    LAW
    friction: 0.25
initial: {j_y: 0.2, j_x_dot: 1.0}
simulation: {end: 0.2, method: moreau, step: 2e-3}
"""
RIGID, SOFT = "normal_law: rigid", "stiffness: 1e7\n    smoothing: 1e-3"
SPEED = 1.0 - 0.25 * 9.81 * 0.2  #: of a block that slides, after 0.2 s


def written(folder: Path, law: str, old: str = "", new: str = "") -> Path:
    path = folder / "slid.yaml"
    text = FILE.replace("LAW", law)
    assert old in text
    path.write_text(text.replace(old, new) if old else text)
    return path


def called(*words: str) -> Any:
    return CliRunner().invoke(eomgen, [*words])


@pytest.mark.parametrize("law", [RIGID, SOFT])
def test_a_run_takes_method_and_step_of_the_file(law: str, tmp_path: Path) -> None:
    model = eg.load(written(tmp_path, law))
    assert model.simulation == {"end": 0.2, "method": "moreau", "step": 2e-3}
    mod = model.compile()
    run = mod.simulate()
    assert (run.metadata["method"], len(run.t)) == ("moreau", 101)
    assert run["j_x_dot"][-1] == pytest.approx(SPEED, abs=1e-9)
    assert len(mod.simulate(step=1e-2).t) == len(mod.simulate(method="moreau", step=1e-2).t) == 21
    assert len(mod.simulate(method="moreau").t) == 101
    model.save(tmp_path / "again.yaml")
    assert eg.load(tmp_path / "again.yaml").simulation == model.simulation


def test_another_method_does_not_take_the_step(tmp_path: Path) -> None:
    mod = eg.load(written(tmp_path, SOFT)).compile()
    with pytest.raises(UsageError, match="method RK4 needs step="):
        mod.simulate(method="RK4")
    run = mod.simulate(method="Radau", rtol=1e-6)
    assert run.metadata["method"] == "Radau"
    assert run["j_x_dot"][-1] == pytest.approx(SPEED, abs=2e-2)  # it sinks in first, with less friction


def test_what_runs_integrators_alone_refuses_the_method(tmp_path: Path) -> None:
    mod = eg.load(written(tmp_path, SOFT)).compile()
    x = mod.x0()
    with pytest.raises(UnavailableError, match="simulate_many has no method moreau"):
        mod.simulate_many(initial={"j_x_dot": [1.0, 2.0]})
    with pytest.raises(UnavailableError, match="integrator has no method moreau"):
        mod.integrator()
    assert mod.simulate_many(initial={"j_x_dot": [1.0, 2.0]}, method="RK45", rtol=1e-4).x.shape == (6, 2)
    assert mod.integrator(method="RK45")(0.0, x, 0.01).shape == (6,)


def test_the_command_line_reads_the_file(tmp_path: Path) -> None:
    path = str(written(tmp_path, RIGID))
    told = called("run", path, "--json")
    assert told.exit_code == 0, told.output
    found = json.loads(told.stdout)
    integration = found["integration"]
    assert (integration["method"], integration["steps"]) == ("moreau", 100)
    assert integration["options"]["step"] == 2e-3
    assert integration["contact"]["missed_steps"] == 0
    assert integration["contact"]["contacts"] == 2
    assert found["final"]["j_x_dot"] == pytest.approx(SPEED, abs=1e-9)
    assert found["energy"]["work"] is None  # of contacts that exert impulses
    lines = called("run", path).stdout
    assert "moreau, 100 steps of 0.002 s" in lines
    assert "0 steps miss the tolerance" in lines


def test_options_of_the_command_line(tmp_path: Path) -> None:
    path = written(tmp_path, RIGID, ", method: moreau, step: 2e-3")
    for solver in ("moreau", "Moreau"):
        words = ("run", str(path), "--solver", solver, "--step", "1e-3", "--json", "--plot", str(tmp_path / "a.png"))
        told = called(*words)
        assert told.exit_code == 0, told.output
        found = json.loads(told.stdout)
        assert found["integration"]["steps"] == 200
        np.testing.assert_allclose(found["final"]["j_x_dot"], SPEED, atol=1e-9)
    for options, expected in (
        ((), "run with --solver moreau and --step"),
        (("--solver", "moreau"), "method moreau needs --step"),
        (("--solver", "moreau", "--step", "1e-3", "--rtol", "1e-3"), "no option of method moreau 'rtol'"),
        (("--solver", "moreau", "--step", "1e-3", "--checkpoint", str(tmp_path / "kept")), "checkpoint"),
    ):
        told = called("run", str(path), *options)
        assert told.exit_code == 2, told.output
        assert expected in told.stderr
    told = called("ensemble", str(path), "--solver", "moreau", "--step", "1e-3", "--vary", "j_y=0.3:0.5")
    assert told.exit_code != 0
    assert "simulate_many is not available for models with rigid contacts" in told.stderr


@pytest.mark.parametrize(
    ("old", "new"), [(", step: 2e-3", ""), ("method: moreau, ", ""), ("moreau", "RK45"), ("step: 2e-3", "step: -1")]
)
def test_method_and_step_belong_together(old: str, new: str, tmp_path: Path) -> None:
    told = called("check", str(written(tmp_path, RIGID, old, new)))
    assert told.exit_code == 1
    assert "simulation.step" in told.output
