"""Steps of one size that a model declares, from Python, a file and the command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import eomgen as eg
from eomgen.cli.command import eomgen

FILE = """
name: swing
bodies: {bob: {mass: 1.0, com: [0, -1, 0]}}
gravity: [0, -9.81, 0]
joints: {q: {type: revolute, between: [ground, bob]}}
initial: {q: 1.0}
simulation: {end: 1, method: RK4, step: 0.01}
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("steps") / "swing.yaml"
    path.write_text(FILE)
    return path


@pytest.fixture(scope="module")
def swing(path: Path) -> Any:
    return eg.load(path).compile()


def by_hand(mod: Any, x: np.ndarray, h: float, n: int) -> np.ndarray:
    """Kutta's classical formula."""
    for _ in range(n):
        a = mod.rhs(0.0, x)
        b = mod.rhs(0.0, x + h / 2 * a)
        c = mod.rhs(0.0, x + h / 2 * b)
        x = x + h / 6 * (a + 2 * b + 2 * c + mod.rhs(0.0, x + h * c))
    return x


def test_a_run_takes_the_declared_steps(swing: Any) -> None:
    run = swing.simulate()
    np.testing.assert_allclose(run.t, np.linspace(0, 1, 101), atol=1e-12)
    np.testing.assert_allclose(run.x[:, -1], by_hand(swing, swing.x0(), 0.01, 100), rtol=1e-12)
    assert len(swing.simulate(step=0.1).t) == 11
    assert len(swing.simulate(method="RK4").t) == 101
    assert len(swing.simulate(method="RK45", rtol=1e-3).t) < 50
    many = swing.simulate_many(initial={"q": [1.0, 0.5]})
    np.testing.assert_allclose(many.x[:, 0], run.x[:, -1], rtol=1e-12)


def test_a_file_says_the_same(path: Path, tmp_path: Path) -> None:
    model = eg.load(path)
    assert model.simulation == {"end": 1, "method": "RK4", "step": 0.01}
    model.save(tmp_path / "again.yaml")
    assert eg.load(tmp_path / "again.yaml").simulation == model.simulation


@pytest.mark.parametrize("settings", [{"method": "RK4"}, {"step": 0.1}, {"method": "RK45", "step": 0.1}])
def test_method_and_step_belong_together(path: Path, settings: dict[str, Any]) -> None:
    model = eg.load(path)
    model.simulation = settings
    with pytest.raises(eg.ModelError, match=r"simulation\.step: only methods RK4 and moreau take steps of one size"):
        model.mechanism()


def run(*words: str) -> Any:
    result = CliRunner().invoke(eomgen, ["run", *words, "--json"])
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def test_the_command_line_takes_them(path: Path) -> None:
    declared, given = run(str(path)), run(str(path), "--solver", "rk4", "--step", "0.01")
    assert declared["final"] == given["final"]
    other = run(str(path), "--solver", "DOP853")
    assert other["final"] != declared["final"]
    assert other["final"]["q"] == pytest.approx(declared["final"]["q"], abs=1e-7)
    assert run(str(path), "--step", "0.02")["final"] != declared["final"]
    refused = CliRunner().invoke(eomgen, ["run", str(path), "--solver", "RK45", "--step", "0.1"])
    assert refused.exit_code == 2
    assert "RK4" in refused.output
