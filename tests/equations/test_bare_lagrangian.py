"""A bare Lagrangian that depends on time, and one with dissipation: closed forms of the accelerations."""

from __future__ import annotations

import numpy as np
import pytest

import eomgen as eg
from eomgen.pipeline import OF_LAGRANGIANS

STATES = [(0.3, -1.1, 0.4), (-2.0, 0.7, 1.3)]


@pytest.mark.parametrize("method", OF_LAGRANGIANS)
def test_a_pendulum_whose_support_swings(method: str) -> None:
    """The support is at a sin(w t): l theta'' = -g sin(theta) + a w^2 sin(w t) cos(theta) (Landau, Lifshitz, sec. 5)."""
    speed = "(l*th_dot*cos(th) + a*w*cos(w*t))**2 + (l*th_dot*sin(th))**2"
    values = {"m": 1.3, "l": 0.7, "a": 0.4, "w": 3.0, "g": 9.81}
    mod = eg.Model.from_lagrangian(
        "support", f"m*({speed})/2 + m*g*l*cos(th)", ["th"], parameters=values
    ).compile(method=method, target="numpy")  # fmt: skip
    for th, rate, t in STATES:
        push = 0.4 * 9.0 * np.sin(3.0 * t) * np.cos(th)
        expected = (-9.81 * np.sin(th) + push) / 0.7
        assert mod.rhs(t, np.array([th, rate])) == pytest.approx([rate, expected], rel=1e-12)
        forces = mod.inverse_dynamics(np.array([th]), np.array([rate]), np.array([expected]), t=t)
        assert forces == pytest.approx([0.0], abs=1e-12)


@pytest.mark.parametrize("method", OF_LAGRANGIANS)
def test_a_mass_that_grows(method: str) -> None:
    """d/dt (m v) = -k x with m = m0 (1 + r t): v' = -(k x + m0 r v) / m."""
    values = {"m0": 2.0, "r": 0.3, "k": 5.0}
    mod = eg.Model.from_lagrangian("growing", "m0*(1 + r*t)*x_dot**2/2 - k*x**2/2", ["x"], parameters=values).compile(
        method=method, target="numpy"
    )
    for x, v, t in STATES:
        expected = -(5.0 * x + 0.6 * v) / (2.0 * (1.0 + 0.3 * t))
        assert mod.rhs(t, np.array([x, v])) == pytest.approx([v, expected], rel=1e-12)


@pytest.mark.parametrize("method", OF_LAGRANGIANS)
def test_dissipation_brakes(method: str) -> None:
    """Rayleigh's function c (v - w)^2 / 2 of two masses brakes their relative motion (Goldstein, sec. 1.5)."""
    mod = eg.Model.from_lagrangian(
        "brake", "m*v_dot**2/2 + n*w_dot**2/2", ["v", "w"], ["push", 0], dissipation="c*(v_dot - w_dot)**2/2",
        parameters={"m": 2.0, "n": 0.5, "c": 0.8, "push": 1.5},
    ).compile(method=method, target="numpy")  # fmt: skip
    x = np.array([0.0, 0.0, 1.2, -0.4])
    assert mod.rhs(0.0, x)[2:] == pytest.approx([(1.5 - 0.8 * 1.6) / 2.0, 0.8 * 1.6 / 0.5], rel=1e-12)
