"""A bare Lagrangian that depends on time, and one with dissipation: closed forms of the accelerations."""

from __future__ import annotations

import numpy as np
import pytest

import eomgen as eg
from eomgen.pipeline import OF_LAGRANGIANS

STATES = [(0.3, -1.1, 0.4), (-2.0, 0.7, 1.3)]


@pytest.mark.parametrize("method", OF_LAGRANGIANS)
def test_a_pendulum_whose_support_swings(method: str) -> None:
    """The support is at a sin(w t): l theta'' = -g sin(theta) + a w^2 sin(w t) cos(theta) (Landau, sec. 5)."""
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


@pytest.mark.parametrize("method", OF_LAGRANGIANS)
def test_a_length_that_an_input_prescribes(method: str) -> None:
    """(l^2 theta')' = 0 on a turntable with l = 1 + t: theta' = theta'(0) / l^2, so theta'(1) = 1/4."""
    mod = eg.Model.from_lagrangian("reel", "l**2*th_dot**2/2", ["th"], inputs={"l": 1.0}).compile(
        method=method, target="numpy"
    )
    assert mod.u_names == ("l", "l_dot")
    assert mod.rhs(0.0, np.array([0.0, 3.0]), u=[2.0, 0.5]) == pytest.approx([3.0, -2 * 0.5 / 2.0 * 3.0], rel=1e-13)
    run = mod.simulate(1.0, {"th": 0.0, "th_dot": 1.0}, inputs={"l": "1 + t"}, rtol=1e-10, atol=1e-12)
    assert run["th_dot"][-1] == pytest.approx(0.25, rel=1e-8)


@pytest.mark.parametrize("method", OF_LAGRANGIANS)
def test_a_constraint_that_an_input_moves(method: str) -> None:
    """A bead on a rod through the origin that is turned by a(t): r'' = r a'^2 - g sin(a) (Goldstein, sec. 1.6)."""
    mod = eg.Model.from_lagrangian(
        "rod", "(x_dot**2 + y_dot**2)/2 - g*y", ["x", "y"], constraints=["x*sin(a) - y*cos(a)"],
        parameters={"g": 9.81}, inputs={"a": 0.4},
    ).compile(method=method, target="numpy")  # fmt: skip
    assert mod.u_names == ("a", "a_dot", "a_ddot")
    a, rate, bend, r, slide = 0.4, 0.7, -1.1, 1.3, 0.5
    along, across = np.array([np.cos(a), np.sin(a)]), np.array([-np.sin(a), np.cos(a)])
    x = np.concatenate([r * along, slide * along + r * rate * across])
    expected = (-9.81 * np.sin(a)) * along + (2 * slide * rate + r * bend) * across
    assert mod.rhs(0.0, x, u=[a, rate, bend])[2:] == pytest.approx(expected, rel=1e-11)
