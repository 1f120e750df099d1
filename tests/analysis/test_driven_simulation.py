"""simulate of a mechanism that drivers move entirely: the same as integrating it, with all that simulate offers."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import models
import numpy as np
import pytest

import eomgen as eg
from eomgen.generation import generate

EXAMPLE = models.EXAMPLES / "driven_slider_crank.yaml"


@pytest.fixture(scope="module")
def mod() -> eg.Module:
    return eg.load(EXAMPLE).compile()


def test_solving_and_integrating_agree(mod: eg.Module) -> None:
    t = np.linspace(0, 0.7, 29)  # a turn and more
    solved = mod.simulate(0.7, t_eval=t)
    integrated = mod.simulate(0.7, t_eval=t, method="DOP853", rtol=1e-11, atol=1e-12)
    assert (solved.metadata["method"], integrated.metadata["method"]) == ("kinematic", "DOP853")
    assert solved.nfev == 0
    for name in ("theta", "bend", "s", "s_dot", "s_ddot", "C", "M_x", "slider_acceleration"):
        np.testing.assert_allclose(solved[name], integrated[name], rtol=1e-8, atol=1e-8)
    assert solved.residuals.position < 1e-14


def test_what_simulate_offers_is_there(mod: eg.Module, tmp_path: Path) -> None:
    run = mod.simulate()
    assert run.t[0] == 0.0
    assert run.t[-1] == pytest.approx(0.2 * np.pi)
    assert np.diff(run.t).min() > 0
    assert len(run) >= 201
    np.testing.assert_allclose(run.at([0.1, 0.2])["theta"], [1.0, 2.0], atol=1e-14)
    loaded = eg.load_trajectory(run.save(tmp_path / "run"))
    np.testing.assert_array_equal(loaded["s_ddot"], run["s_ddot"])
    np.testing.assert_array_equal(run.energies, 0.0)
    back = mod.simulate((5.0, 3.0), t_eval=[5.0, 4.5, 3.0])
    np.testing.assert_allclose(back["theta"], [50, 45, 30])
    other = mod.simulate(1.0, parameters={"omega": 3.0})
    assert other["theta"][-1] == pytest.approx(3.0)


def test_events_are_located(mod: eg.Module) -> None:
    """The slider passes 0.3: from cos(theta) = (r^2 + s^2 - l^2) / (2 r s)."""
    s = 0.3
    angle = np.arccos((0.01 + s**2 - 0.09) / (2 * 0.1 * s))
    passing = [(angle + 0.0) / 10, (2 * np.pi - angle) / 10, (2 * np.pi + angle) / 10]

    def event(t: float, x: np.ndarray) -> float:
        return float(x[2] - s)

    run = mod.simulate((0, 0.8), events=event)
    np.testing.assert_allclose(run.t_events[0], passing, atol=1e-13)
    assert run.x_events[0].shape == (6, 3)
    event.direction, event.terminal = 1, True
    run = mod.simulate((0, 0.8), events=[event])
    assert (run.status, len(run.t_events[0])) == (1, 1)
    assert run.t[-1] == pytest.approx(passing[1], abs=1e-13)
    assert run["s"][-1] == pytest.approx(s, abs=1e-13)


def test_what_it_refuses(mod: eg.Module) -> None:
    with pytest.raises(eg.AssemblyError, match="theta = 0.5"):
        mod.simulate(1.0, initial={"theta": 0.5})
    with pytest.raises(eg.UsageError, match="has no option 'lband'"):
        mod.simulate(1.0, lband=1)
    pendulum = eg.load(models.EXAMPLES / "pendulum.yaml").compile(target="numpy")
    with pytest.raises(eg.UsageError, match="'kinematic' is for mechanisms without degrees of freedom"):
        pendulum.simulate(1.0, method="kinematic")


def test_inputs_are_recorded(mod: eg.Module) -> None:
    m = eg.load(EXAMPLE)
    m.input("F", 2.0)
    run = m.compile(target="numpy").simulate(0.5, inputs={"F": ([0, 0.5], [0, 1])}, t_eval=[0, 0.25, 0.5])
    np.testing.assert_allclose(run["F"], [0, 0.5, 1])


ALONE = """
import sys
class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("eomgen", "sympy", "scipy"):
            raise ImportError(name)
sys.meta_path.insert(0, Refuse())
import numpy as np
import driven_slider_crank as mod
run = mod.simulate(1.0, t_eval=[0, 0.5, 1.0])
again = mod.kinematic_analysis(t=[0, 0.5, 1.0])
assert (again.q == run.q).all() and mod.motion_range("t", within=(0, 1)).upper == 1
theta = run["theta"]
assert np.abs(run["s"] - 0.1 * np.cos(theta) - np.sqrt(0.09 - 0.01 * np.sin(theta) ** 2)).max() < 1e-14
"""


def test_an_exported_package_needs_numpy_alone(tmp_path: Path) -> None:

    generate(eg.load(EXAMPLE), tmp_path, target="numpy")
    result = subprocess.run([sys.executable, "-c", ALONE], cwd=tmp_path, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
