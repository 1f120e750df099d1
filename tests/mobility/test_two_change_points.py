"""Two parallelograms in a row, one crank pin a little off: the second swings round while the first passes its own.

The first moves as with the couplings bend = -theta, psi = theta, whose constraints never lose rank: a judge that knows
no change point of it.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import eomgen as eg

START = {"theta": 1.0, "theta_dot": -5.0}


@cache
def compiled(coupled: bool, target: str = "cython") -> Any:
    m = eg.Model(f"two_rows_{'coupled' if coupled else 'hinged'}", gravity=(0, -9.81, 0))
    m.parameter("off", 1e-3)
    a, b, c, d, e = (m.body(name, mass=1, com=(0.5, 0, 0), inertia={"zz": 1 / 12}) for name in "abcde")
    m.revolute("A", m.ground, a, coordinate="theta")
    m.revolute("B", a.at(1, 0, 0), b, coordinate="bend")
    m.revolute("D", m.ground.at(1, 0, 0), c, coordinate="psi")
    if coupled:
        m.coupling("first", coordinates={"bend": 1, "theta": 1})
        m.coupling("second", coordinates={"psi": 1, "theta": -1})
    else:
        m.revolute("C", b.at(1, 0, 0), c.at(1, 0, 0))
    m.revolute("E", c.at("1 + off", 0, 0), d, coordinate="fold")
    m.revolute("F", m.ground.at(2, 0, 0), e, coordinate="phi")
    m.revolute("G", d.at(1, 0, 0), e.at(1, 0, 0))
    m.guess(theta=1.0, bend=-1, psi=1, fold=-1, phi=1)
    return m.compile(target=target, independent=["theta"])


@pytest.mark.parametrize("target", ["cython", "numpy"])
@pytest.mark.parametrize("off", [1e-3, 1e-4])
def test_accelerations_while_the_second_loop_swings_round(off: float, target: str) -> None:
    """Off by 5 % while noise was judged by the swing, a thousand times as fast as the loop at its change point."""
    judge, mod = (compiled(coupled, target).bind({"off": off}) for coupled in (True, False))
    run = compiled(True).bind({"off": off}).simulate(0.277, START, method="DOP853", rtol=1e-11, atol=1e-12)
    for angle in (1e-3, 3e-4, 1e-4):
        x = judge.project(run.x[:, int(np.argmin(np.abs(run["theta"] - angle)))])
        expected = judge.rhs(0.0, x)
        assert judge.x_names == mod.x_names
        assert np.abs(mod.rhs(0.0, x) - expected)[5:].max() <= 1e-9 * np.abs(expected[5:]).max()


@pytest.mark.parametrize("off", [1e-2, 3e-4, 0.0])
def test_freedoms_at_the_change_point_are_those_of_the_loop_that_lies_flat(off: float) -> None:
    """The smallest singular value of the second loop is about 0.6 times the offset there."""
    run = compiled(False).bind({"off": off}).simulate(0.29, START, method="DOP853", rtol=1e-6, atol=1e-8)
    assert run["theta"][-1] < 0.0
    (point,) = run.change_points
    assert abs(point.coordinates["theta"]) <= 1e-5
    assert point.degrees_of_freedom == (2 if off else 3)


@pytest.mark.parametrize(("end", "passed"), [(0.1739, 0), (0.174, 0), (0.17401, 1), (0.1741, 1)])
def test_only_what_was_crossed_is_told(end: float, passed: int) -> None:
    """The coupled mechanism passes it at 0.174005 s."""
    run = compiled(False).bind({"off": 0.0}).simulate(end, START, method="DOP853", rtol=1e-9, atol=1e-11)
    assert int(run["theta"][-1] < 0.0) == passed
    assert len(run.change_points) == passed


def test_a_run_that_starts_at_a_change_point_has_not_passed_it() -> None:
    mod = compiled(False).bind({"off": 0.0})
    x = np.zeros(mod.n_x)
    x[[mod.x_names.index(f"{name}_dot") for name in ("theta", "psi", "phi")]] = 2.0
    x[[mod.x_names.index(f"{name}_dot") for name in ("bend", "fold")]] = -2.0
    run = mod.simulate(0.1, x, rtol=1e-9, atol=1e-11)
    assert run["theta"][-1] > 0.05
    assert np.abs(run["theta"] - run["phi"]).max() <= 1e-7
    assert run.change_points == []
