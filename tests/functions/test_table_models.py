"""Mechanisms driven by tables: closed forms, energy, Jacobians, closed loops."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from scipy.interpolate import CubicSpline
from scipy.special import ellipj

import eomgen as eg


def test_a_table_of_a_cubic_spring_swings_as_duffings_closed_form() -> None:
    """x'' + x + x^3 = 0 from rest at A: x = A cn(w t, m), w^2 = 1 + A^2, m = A^2 / (2 w^2)."""
    grid = np.linspace(-3.0, 3.0, 13)  # a not-a-knot spline reproduces a cubic
    m = eg.Model("duffing")
    pull = m.table("pull", grid, grid + grid**3)
    m.prismatic("s", m.ground, m.body("b", mass=2.0), axis="x")
    m.actuator("spring", "s", -2.0 * pull(m.coordinate("s")))
    run = m.compile().simulate((0, 20), initial={"s": 2.0}, rtol=1e-11, atol=1e-13, t_eval=np.linspace(0, 20, 101))
    w = np.sqrt(5.0)
    expected = 2.0 * ellipj(w * run.t, 4.0 / (2.0 * 5.0))[1]
    assert np.ptp(expected) > 3.9
    assert np.max(np.abs(run["s"] - expected)) < 1e-8


@pytest.mark.parametrize("kind", ["cubic", "monotone"])
def test_jacobian_of_a_table_driven_force(kind: str) -> None:
    x, y = np.linspace(-2, 2, 9), np.array([-3.0, -2.5, -1, -0.5, 0, 0.2, 1.5, 2, 4])
    m = eg.Model("bumper")
    m.table("law", x, y, kind=kind)
    m.table("map", x, x, np.outer(y, y**2))
    m.prismatic("s", m.ground, m.body("b", mass=2.0), axis="x")
    m.actuator("spring", "s", "-law(s) - map(s*s, s_dot + t)")
    for target in ("cython", "numpy"):
        module = m.compile(target=target)
        for state in ([0.3, -0.8], [1.1, 0.4], [-3.0, 2.5]):
            z = np.array(state)
            steps = 1e-6 * np.eye(2)
            central = np.array([(module.rhs(0.1, z + h) - module.rhs(0.1, z - h)) / 2e-6 for h in steps]).T
            assert np.max(np.abs(module.jacobian(0.1, z) - central)) < 1e-6 * max(1.0, np.abs(central).max())


def follower() -> tuple[eg.Model, np.ndarray, np.ndarray]:
    """A cam of inertia 2 turns and lifts a follower of mass 3 by a periodic table of its angle."""
    angle = np.linspace(0.0, 2 * np.pi, 37)
    lift = 0.2 + 0.05 * np.exp(np.cos(angle))
    lift[-1] = lift[0]
    theta, s, theta_dot, s_dot = sympy.symbols("theta s theta_dot s_dot")
    L = theta_dot**2 + sympy.Rational(3, 2) * s_dot**2 - 3 * 9.81 * s
    m = eg.Model.from_lagrangian("cam", L, [theta, s], constraints=[s - sympy.Function("profile")(theta)])
    m.table("profile", angle, lift, kind="periodic")
    m.initial(theta=1.0, theta_dot=8.0)
    m.independent("theta")
    return m, angle, lift


def test_a_follower_on_a_periodic_table_keeps_its_energy_and_its_cam() -> None:
    m, angle, lift = follower()
    module = m.compile()
    run = module.simulate((0, 3), rtol=1e-10, atol=1e-12)
    spline = CubicSpline(angle, lift, bc_type="periodic")
    assert run["theta"][-1] > 15  # several turns
    assert np.max(np.abs(run["s"] - spline(run["theta"]))) < 1e-12
    assert np.max(np.abs(run["s_dot"] - spline(run["theta"], 1) * run["theta_dot"])) < 1e-11
    T = run["theta_dot"] ** 2 + 1.5 * run["s_dot"] ** 2
    energy = T + 3 * 9.81 * run["s"]
    assert np.max(np.abs(energy - energy[0])) < 1e-7 * T.max()


def test_accelerations_of_the_follower_are_those_of_the_reduced_equation() -> None:
    """(2 + 3 s'^2) theta'' + 3 s' s'' theta'^2 + 3 g s' = 0, with SciPy's spline s(theta)."""
    m, angle, lift = follower()
    spline = CubicSpline(angle, lift, bc_type="periodic")
    compiled, numpy = m.compile(), m.compile(target="numpy")
    for theta in (0.3, 2.0, 4.5, -7.7, 40.0):
        x = compiled.x0(theta=theta, theta_dot=5.0)
        names = compiled.x_names
        a, b, c = (float(spline(theta, k)) for k in (1, 2, 0))
        acceleration = -(3 * a * b * 25.0 + 3 * 9.81 * a) / (2 + 3 * a * a)
        found = dict(zip(names, compiled.rhs(0, x), strict=True))
        assert x[names.index("s")] == pytest.approx(c, abs=1e-12)
        assert found["theta_dot"] == pytest.approx(acceleration, rel=1e-9)
        assert np.allclose(numpy.rhs(0, x), compiled.rhs(0, x), rtol=1e-11, atol=1e-11)
        steps = 1e-6 * np.eye(4)
        central = np.array([(compiled.rhs(0, x + h) - compiled.rhs(0, x - h)) / 2e-6 for h in steps]).T
        assert np.max(np.abs(compiled.jacobian(0, x) - central)) < 1e-5 * np.abs(central).max()


@pytest.mark.parametrize("method", ["embedding", "lagrange"])
def test_tables_may_stand_in_masses_and_loops(method: str) -> None:
    """A four-bar whose coupler mass comes from a table of a parameter and which a table drives."""
    m = eg.Model("driven", gravity=(0, -9.81, 0))
    grid = np.linspace(0, 2, 9)
    wear = m.parameter("wear", 0.7)
    m.table("mass_of", grid, 1 + grid**2)
    m.table("drive", grid, np.sin(grid), extrapolation="constant")
    bars = [m.body(n, mass=f"mass_of(wear)*{k}", com=(l / 2, 0, 0), inertia={"zz": 0.1}) for n, l, k in
            (("a", 0.5, 1), ("b", 1.2, 2), ("c", 0.9, 1))]  # fmt: skip
    m.revolute("A", m.ground, bars[0], coordinate="theta")
    m.revolute("B", bars[0].at(0.5, 0, 0), bars[1])
    m.revolute("C", m.ground.at(1, 0, 0), bars[2])
    m.revolute("D", bars[1].at(1.2, 0, 0), bars[2].at(0.9, 0, 0))
    m.torque("motor", "A", "drive(t)*mass_of(wear) - 0.1*theta_dot")
    m.initial(theta=1.0)
    m.guess(B=-0.5, C=1.5)
    numbers = eg.Model("driven", gravity=(0, -9.81, 0))
    assert wear.name == "wear"
    bars = [numbers.body(n, mass=1.49 * k, com=(l / 2, 0, 0), inertia={"zz": 0.1}) for n, l, k in
            (("a", 0.5, 1), ("b", 1.2, 2), ("c", 0.9, 1))]  # fmt: skip
    numbers.revolute("A", numbers.ground, bars[0], coordinate="theta")
    numbers.revolute("B", bars[0].at(0.5, 0, 0), bars[1])
    numbers.revolute("C", numbers.ground.at(1, 0, 0), bars[2])
    numbers.revolute("D", bars[1].at(1.2, 0, 0), bars[2].at(0.9, 0, 0))
    drive = float(CubicSpline(grid, np.sin(grid))(0.35))
    numbers.torque("motor", "A", f"{1.49 * drive!r} - 0.1*theta_dot")
    numbers.initial(theta=1.0)
    numbers.guess(B=-0.5, C=1.5)
    one, other = m.compile(method), numbers.compile(method)
    x = other.x0(theta=1.0, theta_dot=2.0)
    assert one.x_names == other.x_names
    assert np.allclose(one.rhs(0.35, x), other.rhs(0.35, x), rtol=1e-10, atol=1e-10)
