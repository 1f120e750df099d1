"""A bare Lagrangian that depends on time, on inputs, with dissipation and gyroscopic terms: closed forms."""

from typing import Any

import judges
import models
import numpy as np
import pytest
import sympy
import sympy as sp
from refusals import refuses

import eomgen as eg

OF_LAGRANGIANS = ("lagrange", "hamilton", "augmented")
STATES = [(0.3, -1.1, 0.4), (-2.0, 0.7, 1.3)]


@pytest.mark.parametrize("method", OF_LAGRANGIANS)
def test_a_pendulum_whose_support_swings(method: str) -> None:
    """The support is at a sin(w t): l theta'' = -g sin(theta) + a w^2 sin(w t) cos(theta) (Landau, sec. 5)."""
    speed = "(l*th_dot*cos(th) + a*w*cos(w*t))**2 + (l*th_dot*sin(th))**2"
    values = {"m": 1.3, "l": 0.7, "a": 0.4, "w": 3.0, "g": 9.81}
    model = eg.Model.from_lagrangian("support", f"m*({speed})/2 + m*g*l*cos(th)", ["th"], parameters=values)
    mod = model.compile(method=method, target="numpy")
    for th, rate, t in STATES:
        push = 0.4 * 9.0 * np.sin(3.0 * t) * np.cos(th)
        expected = (-9.81 * np.sin(th) + push) / 0.7
        assert mod.rhs(t, np.array([th, rate])) == pytest.approx([rate, expected], rel=1e-12)
        forces = mod.inverse_dynamics(np.array([th]), np.array([rate]), np.array([expected]), t=t)
        assert forces == pytest.approx([0.0], abs=1e-12)


@pytest.mark.quick
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
    model = eg.Model.from_lagrangian("reel", "l**2*th_dot**2/2", ["th"], inputs={"l": 1.0})
    mod = model.compile(method=method, target="numpy")
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


def in_rotating_axes() -> tuple[eg.Model, sympy.Expr, list[sympy.Symbol], dict[str, float]]:
    """A charge on a spring in rotating axes and in a magnetic field: terms linear in the velocities of both kinds."""
    x, y, x_dot, y_dot, m, b, w, k = sympy.symbols("x y x_dot y_dot m b w k")
    L = m * ((x_dot - w * y) ** 2 + (y_dot + w * x) ** 2) / 2 - k * (x**2 + y**2) / 2 + b * (x * y_dot - y * x_dot) / 2
    values = {"m": 1.3, "b": 2.0, "w": 0.7, "k": 5.0}
    return eg.Model.from_lagrangian("charge", L, [x, y], parameters=values), L, [x_dot, y_dot], values


@pytest.mark.parametrize("method", ["lagrange", "hamilton", "augmented"])
def test_terms_linear_in_the_velocities_are_no_energy(method: str) -> None:
    """T + V is v . dL/dv - L, which is kept; p is dL/dv all the same."""
    model, L, rates, values = in_rotating_axes()
    eqs = model.derive(method)
    momenta = [L.diff(rate) for rate in rates]
    assert [sympy.simplify(p - q) for p, q in zip(eqs.momenta, momenta, strict=True)] == [0, 0]
    assert sympy.simplify(eqs.lagrangian - L) == 0
    mod = eqs.compile(target="numpy")
    run = mod.simulate((0, 3), initial={"x": 0.3, "y": 0.2, "x_dot": 0.5, "y_dot": 0.4}, rtol=1e-10, atol=1e-12)
    energy = sum(v * p for v, p in zip(rates, momenta, strict=True)) - L
    start = dict(zip(mod.x_names, run.x[:, 0], strict=True)) | values
    assert run["energy"][0] == pytest.approx(float(energy.subs(start)), rel=1e-14)
    assert run["T"][0] == pytest.approx(1.3 * 0.41 / 2, rel=1e-14)
    assert np.ptp(run["energy"]) < 1e-8
    explanation = eqs.explain()
    assert "of second degree in the velocities" in explanation.markdown
    assert explanation.difference < 1e-12
    if method == "hamilton":
        z = mod.canonical.of(run.x[:, 0])
        assert z[2:] == pytest.approx([float(p.subs(start)) for p in momenta])
        assert mod.canonical.hamiltonian(z) == pytest.approx(run["energy"][0])
        p_values = dict(zip(map(str, eqs.momentum_symbols), z[2:], strict=True))
        assert float(eqs.hamiltonian.subs(start | p_values)) == pytest.approx(run["energy"][0])


# -- The embedded system that is shown in SymPy ------------------------------------------------------------------------
R, L, CRANK, SLIDER = 0.2, 0.5, 0.03, 1.4


def advance(angle: float) -> float:
    """ds/dtheta of s = r cos(theta) + sqrt(l^2 - r^2 sin^2(theta))."""
    return float(-R * np.sin(angle) - R**2 * np.sin(2 * angle) / (2 * np.sqrt(L**2 - (R * np.sin(angle)) ** 2)))


@pytest.mark.parametrize("method", ["embedding", "lagrange", "recursive"])
@pytest.mark.parametrize("angle", [0.8, 2.5])
def test_one_equation_in_the_crank_angle(method: str, angle: float) -> None:
    """(J + m s'^2) theta'' = tau - m s' s'' theta'^2, s' and s'' derivatives by theta."""
    m = eg.Model("press", gravity=(0, 0, 0))
    crank, rod = m.body("crank", mass=0, inertia={"zz": CRANK}), m.body("rod", mass=0)
    slider = m.body("slider", mass=SLIDER)
    models.join_slider_crank(m, (crank, rod, slider), R, L, "theta phi s")
    m.torque("motor", "A", m.input("tau", 0.7))
    m.guess = {"theta": angle, "phi": -1.2 * angle, "s": 0.6}
    equations = m.derive(method, independent=["theta"])
    rate = 3.0
    module = equations.compile(target="numpy")
    x = module.x0({"theta": angle, "theta_dot": rate})
    values = dict(zip((*module.x_names, "tau"), (*x, 0.7), strict=True))
    mass, force = (
        float(matrix[0].subs({s: values[s.name] for s in matrix.free_symbols}))
        for matrix in (equations.mass_matrix, equations.force)
    )
    slope, d = advance(angle), 1e-5
    bend = (advance(angle + d) - advance(angle - d)) / (2 * d)
    assert mass == pytest.approx(CRANK + SLIDER * slope**2, rel=1e-11)
    assert force == pytest.approx(0.7 - SLIDER * slope * bend * rate**2, rel=1e-8)


# -- nonholonomic constraints of a bare Lagrangian ---------------------------------------------------------------------
t = sp.Symbol("t")


def functions(names: str) -> list[Any]:
    return [sp.Function(name)(t) for name in names.split()]


def knife_edge(constraints: Any = None) -> eg.Model:
    """A skate on an inclined plane (Neimark and Fufaev, 1972): it cannot move sideways."""
    x, y, phi = functions("x y phi")
    m, J, w = sp.symbols("m J w")  # w: m g sin(slope), down x
    L = m * (x.diff(t) ** 2 + y.diff(t) ** 2) / 2 + J * phi.diff(t) ** 2 / 2 + w * x
    row = x.diff(t) * sp.sin(phi) - y.diff(t) * sp.cos(phi)
    rows = [row] if constraints is None else constraints(x, y, phi)
    values = {m: 2.0, J: 0.3, w: 2.0 * 9.81 * 0.5}
    return eg.Model.from_lagrangian("skate", L, [x, y, phi], constraints=rows, parameters=values)


def test_knife_edge_follows_its_cycloid() -> None:
    """Closed form: from rest with spin W, x = a sin(W t)^2 / (2 W^2), y = a (W t - sin(2 W t) / 2) / (2 W^2)."""
    module = knife_edge().compile(target="numpy")
    assert (module.n_dof, module.n_c, module.constraints(np.zeros(3)).shape) == (2, 1, (0,))
    a, W = 9.81 * 0.5, 1.7
    traj = module.simulate(5.0, initial={"phi_dot": W}, rtol=1e-12, atol=1e-13)
    angle = W * traj.t
    np.testing.assert_allclose(traj["phi"], angle, atol=1e-11)
    np.testing.assert_allclose(traj["x"], a * np.sin(angle) ** 2 / (2 * W**2), atol=1e-9)
    np.testing.assert_allclose(traj["y"], a * (angle - np.sin(2 * angle) / 2) / (2 * W**2), atol=1e-9)
    assert traj.energy_drift < 1e-10
    assert traj.residuals.velocity < 1e-12


def test_holonomic_and_nonholonomic_rows_together_and_driven() -> None:
    """A skate whose centre is also led along a moving circle; sideways speed prescribed: both levels, both with t."""

    def rows(x: Any, y: Any, phi: Any) -> list[Any]:
        return [x.diff(t) * sp.sin(phi) - y.diff(t) * sp.cos(phi) - sp.Rational(1, 10) * sp.cos(t),
                x**2 + y**2 - (1 + sp.sin(t) / 5) ** 2]  # fmt: skip

    module = knife_edge(rows).compile(target="numpy")
    assert (module.n_dof, module.constraints(np.zeros(3), rows="all").shape) == (1, (1,))
    assert module.metadata["constraint_labels"] == ["constraint_2", "constraint_1"]
    x0 = module.x0(x=0.6, phi=1.2, phi_dot=0.4, t=0.5)
    assert x0[2] == 1.2
    traj = module.simulate((0.5, 2.0), initial=x0, rtol=1e-11, atol=1e-12)
    x, y, phi = traj.x[:3]
    sideways = traj["x_dot"] * np.sin(phi) - traj["y_dot"] * np.cos(phi)
    np.testing.assert_allclose(sideways, 0.1 * np.cos(traj.t), atol=1e-11)
    np.testing.assert_allclose(x**2 + y**2, (1 + np.sin(traj.t) / 5) ** 2, atol=1e-11)
    state = module.project(traj.x[:, 3], t=0.7)
    J = module.jacobian(0.7, state)
    np.testing.assert_allclose(J, judges.differences(module, state, 1e-6, 0.7), atol=1e-6 * np.abs(J).max())
    refuses("EG-UNSUPPORTED nonholonomic", getattr, module, "minimal")


def test_dependent_velocities_given_too_are_an_error() -> None:
    module = knife_edge().compile(target="numpy")
    refuses("EG-CONTRADICTION y_dot 0.5 x_dot phi_dot", module.x0, x_dot=1.0, y_dot=0.5, phi_dot=0.0)


@pytest.mark.parametrize(
    ("text", "fault"),
    [("x_dot**2 - y_dot", "EG-EXPRESSION"), ("sin(x_dot)", "EG-EXPRESSION"), ("x_ddot", "EG-REFERENCE 'x_ddot'"),
     ("x == y", "EG-EXPRESSION comparison")],
)  # fmt: skip
def test_other_constraints_are_refused_by_name(text: str, fault: str) -> None:
    model = eg.Model.from_lagrangian("s", "x_dot**2 + y_dot**2", ["x", "y"], constraints=[text])
    refuses(f"{fault} lagrangian.constraints[0]:", model.derive)
