"""Quantities that are shown against SymPy's LagrangesMethod, whose Lagrangians are written here by hand.

Both sides are in dynamicsymbols of the same names, and are equal to 25 digits at rational states.
"""

from functools import cache
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
import sympy as sp
from shown_numbers import METHODS, number
from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols

import eomgen as eg

EXAMPLES = Path(__file__).parents[2] / "examples"
t = dynamicsymbols._t


def same(ours: Any, theirs: Any) -> None:
    """Equal at rational values of every symbol and function of time, to 25 digits."""
    ours, theirs = (sp.Matrix([x]) if not isinstance(x, sp.MatrixBase) else sp.Matrix(x) for x in (ours, theirs))
    assert ours.shape == theirs.shape
    kinds = (sp.Derivative, sp.core.function.AppliedUndef, sp.Symbol)
    parts = sorted({part for matrix in (ours, theirs) for part in matrix.atoms(*kinds)} - {t}, key=str)
    values = {part: sp.Rational(37 * (k + 3) % 89 + 11, 53) for k, part in enumerate(parts)}
    for a, b in zip(ours, theirs, strict=True):  # derivatives are met before what they are of
        assert abs(sp.N(a.xreplace(values) - b.xreplace(values), 30)) < sp.Float("1e-25")


def method_of(L: Any, q: list[Any], **more: Any) -> LagrangesMethod:
    method = LagrangesMethod(L, q, **more)
    method.form_lagranges_equations()
    return method


def double_pendulum() -> tuple[Any, Any, Any, list[Any]]:
    """Angles from the vertical and from the first rod; point masses."""
    m = eg.Model("double_pendulum", gravity=(0, "-g", 0))
    for name in ("g", "l1", "l2", "m1", "m2"):
        m.parameter(name)
    upper, lower = m.body("upper", mass="m1", com=(0, "-l1", 0)), m.body("lower", mass="m2", com=(0, "-l2", 0))
    m.revolute("A", m.ground, upper, coordinate="theta")
    m.revolute("B", upper.at(0, "-l1", 0), lower, coordinate="bend")
    g, l1, l2, m1, m2 = sp.symbols("g l1 l2 m1 m2")
    theta, bend = dynamicsymbols("theta bend")
    x1, y1 = l1 * sp.sin(theta), -l1 * sp.cos(theta)
    x2, y2 = x1 + l2 * sp.sin(theta + bend), y1 - l2 * sp.cos(theta + bend)
    T = (m1 * (x1.diff(t) ** 2 + y1.diff(t) ** 2) + m2 * (x2.diff(t) ** 2 + y2.diff(t) ** 2)) / 2
    return m, T, m1 * g * y1 + m2 * g * y2, [theta, bend]


def cart_pendulum() -> tuple[Any, Any, Any, list[Any]]:
    """A cart with a pendulum of inertia J."""
    m = eg.Model("cart", gravity=(0, "-g", 0))
    for name in ("g", "l", "m_c", "m_p", "J", "c"):
        m.parameter(name)
    m.input("push")
    cart = m.body("cart", mass="m_c")
    rod = m.body("rod", mass="m_p", com=(0, "-l", 0), inertia={"zz": "J"})
    m.prismatic("rail", m.ground, cart, axis="x", coordinate="s")
    m.revolute("pin", cart, rod, coordinate="phi")
    m.torque("drag", "rail", "-c*s_dot")
    m.torque("motor", "rail", "push")
    g, l, m_c, m_p, J = sp.symbols("g l m_c m_p J")
    s, phi = dynamicsymbols("s phi")
    x, y = s + l * sp.sin(phi), -l * sp.cos(phi)
    T = (m_c * s.diff(t) ** 2 + m_p * (x.diff(t) ** 2 + y.diff(t) ** 2) + J * phi.diff(t) ** 2) / 2
    return m, T, m_p * g * y, [s, phi]


def spherical_pendulum() -> tuple[Any, Any, Any, list[Any]]:
    """Azimuth about z, then the angle from the downward vertical."""
    m = eg.Model("spherical", gravity=(0, 0, "-g"))
    for name in ("g", "l", "m"):
        m.parameter(name)
    fork, bob = m.body("fork", mass=0), m.body("bob", mass="m", com=(0, 0, "-l"))
    m.revolute("azimuth", m.ground, fork, axis="z", coordinate="phi")
    m.revolute("tilt", fork, bob, axis="y", coordinate="theta")
    g, l, mass = sp.symbols("g l m")
    phi, theta = dynamicsymbols("phi theta")
    place = [-l * sp.sin(theta) * sp.cos(phi), -l * sp.sin(theta) * sp.sin(phi), -l * sp.cos(theta)]
    T = mass * sum(x.diff(t) ** 2 for x in place) / 2
    return m, T, mass * g * place[2], [phi, theta]


TREES = {f.__name__: f for f in (double_pendulum, cart_pendulum, spherical_pendulum)}


@cache
def solved(name: str) -> tuple[Any, Any, Any, Any]:
    """Mass matrix and forcing of SymPy, its forcing without V, the slopes of V."""
    _, T, V, q = TREES[name]()
    theirs, alone = method_of(T - V, q), method_of(T, q)
    return theirs.mass_matrix, theirs.forcing, alone.forcing, sp.Matrix([V.diff(x) for x in q])


@pytest.mark.parametrize("method", [name for name in METHODS if name not in ("augmented", "amalgamated")])
@pytest.mark.parametrize("name", TREES)
def test_open_chains(name: str, method: str) -> None:
    m, T, V, q = TREES[name]()
    equations = m.derive(method).with_dynamicsymbols()
    assert equations.q == tuple(q)
    rates, accelerations = [x.diff(t) for x in q], [x.diff(t, 2) for x in q]
    assert equations.v == tuple(rates)
    mass, forcing, centrifugal, slope = solved(name)
    same(equations.T, T)
    same(equations.V, V)
    same(equations.lagrangian, T - V)
    same(equations.mass_matrix, mass)
    more = sp.zeros(2, 1)
    if name == "cart_pendulum":
        drag, motor = sp.Matrix([-sp.Symbol("c") * rates[0], 0]), sp.Matrix([dynamicsymbols("push"), 0])
        same(equations.generalized_forces["drag"], drag)
        same(equations.generalized_forces["motor"], motor)
        more = drag + motor
    same(equations.force, forcing + more)
    same(equations.quadratic_velocity, centrifugal)
    same(equations.generalized_forces["gravity"], -slope)
    same(equations.generalized_forces, more - slope)
    momenta = sp.Matrix([T.diff(x) for x in rates])
    same(equations.momenta, momenta)
    if method == "gibbs_appell":
        found = sp.Matrix([equations.gibbs_function.diff(a) for a in accelerations])
        same(found, mass * sp.Matrix(accelerations) - centrifugal)
    if method == "hamilton":
        same(equations.hamiltonian.subs(dict(zip(equations.momentum_symbols, momenta, strict=True))), T + V)
        same(equations.momentum_rates, sp.Matrix([(T - V).diff(x) for x in q]) + more)


def slider_crank() -> tuple[Any, Any, list[Any], list[Any]]:
    """A light crank with a mass at its pin, a uniform rod, a slider; angles of crank and rod from x, and s."""
    m = eg.Model("press", gravity=(0, "-g", 0))
    for name, value in {"g": 9.81, "r": 0.1, "l": 0.35, "m_c": 1.0, "m_r": 0.8, "m_s": 0.5}.items():
        m.parameter(name, value)
    m.input("tau")
    crank = m.body("crank", mass="m_c", com=("r", 0, 0))
    rod = m.body("rod", mass="m_r", com=("l/2", 0, 0), inertia={"zz": "m_r*l**2/12"})
    slider = m.body("slider", mass="m_s")
    models.join_slider_crank(m, (crank, rod, slider), "r", "l", "theta beta s")
    m.torque("motor", "A", "tau")
    m.independent("theta")
    m.initial(theta=0.3)
    m.guess(s=0.4)
    g, r, l, m_c, m_r, m_s = sp.symbols("g r l m_c m_r m_s")
    theta, beta, s = dynamicsymbols("theta beta s")
    pin = sp.Matrix([r * sp.cos(theta), r * sp.sin(theta)])
    along = sp.Matrix([sp.cos(theta + beta), sp.sin(theta + beta)])
    centre, end = pin + l / 2 * along, pin + l * along
    T = m_c * (pin.diff(t).dot(pin.diff(t))) / 2 + m_r * (centre.diff(t).dot(centre.diff(t))) / 2
    T += m_r * l**2 / 24 * (theta + beta).diff(t) ** 2 + m_s * s.diff(t) ** 2 / 2
    return m, T - m_c * g * pin[1] - m_r * g * centre[1], [theta, beta, s], [s - end[0], -end[1]]


def test_a_loop_with_multipliers() -> None:
    m, L, q, holonomic = slider_crank()
    equations = m.derive("augmented").with_dynamicsymbols()
    assert equations.q == tuple(q)
    theirs = method_of(L, q, hol_coneqs=holonomic)
    block = equations.block_system
    n, tau = len(q), dynamicsymbols("tau")
    same(block.matrix[:n, :n], theirs.mass_matrix[:, :n])
    same(block.right[:n, 0], theirs.forcing + sp.Matrix([tau, 0, 0]))
    same(equations.constraints, sp.Matrix(holonomic))
    C_q = sp.Matrix(holonomic).jacobian(q)
    same(equations.constraint_jacobian, C_q)
    same(block.matrix[n:, :n], C_q)
    same(block.matrix[:n, n:], C_q.T)
    rates, still = [x.diff(t) for x in q], dict.fromkeys((x.diff(t, 2) for x in q), 0)
    gamma = sp.Matrix(holonomic).diff(t, 2).subs(still)
    same(equations.gamma, gamma)
    same(block.right[n:, 0], -gamma)
    B = equations.velocity_transformation
    same(C_q * B, sp.zeros(2, 1))
    same(B[0], sp.Integer(1))
    same(C_q * equations.acceleration_offset, -gamma)
    same(equations.mass_matrix, B.T * theirs.mass_matrix[:, :n] * B)
    same(equations.generalized_forces["motor"], sp.Matrix([tau]))
    potential = (L.subs(dict.fromkeys(rates, 0))).doit()
    same(equations.generalized_forces["gravity"], B.T * sp.Matrix([potential.diff(x) for x in q]))
    same(equations.poses["slider"][0, 3], q[2])
    same(equations.velocities["rod"].angular[2], rates[0] + rates[1])


def test_a_rolling_disc() -> None:
    """Yaw about z, lean about x, spin about the axle y; the centre is at height r cos(lean)."""
    equations = eg.load(EXAMPLES / "rolling_disc.yaml").derive("augmented").with_dynamicsymbols()
    g, mass, r = sp.symbols("g m r")
    x, y, z, yaw, lean, spin = q = dynamicsymbols("x y z yaw lean spin")
    assert equations.q == tuple(q)
    omega = [  # in axes that yaw and lean with the disc
        lean.diff(t),
        spin.diff(t) + yaw.diff(t) * sp.sin(lean),
        yaw.diff(t) * sp.cos(lean),
    ]
    T = mass * sum(p.diff(t) ** 2 for p in (x, y, z)) / 2
    T += mass * r**2 * (omega[0] ** 2 / 4 + omega[1] ** 2 / 2 + omega[2] ** 2 / 4) / 2
    same(equations.T, T)
    same(equations.V, mass * g * z)
    rates = [p.diff(t) for p in q]
    mass_matrix = sp.hessian(T, rates)
    same(equations.block_system.matrix[:6, :6], mass_matrix)
    axle = [-sp.sin(yaw) * sp.cos(lean), sp.cos(yaw) * sp.cos(lean), sp.sin(lean)]
    turning = lean.diff(t) * sp.Matrix([sp.cos(yaw), sp.sin(yaw), 0]) + spin.diff(t) * sp.Matrix(axle)
    turning += yaw.diff(t) * sp.Matrix([0, 0, 1])
    arm = r * sp.Matrix([-sp.sin(yaw) * sp.sin(lean), sp.cos(yaw) * sp.sin(lean), -sp.cos(lean)])  # to the contact
    slip = sp.Matrix([x, y, z]).diff(t) + turning.cross(arm)
    plain = eg.load(EXAMPLES / "rolling_disc.yaml").derive("augmented")
    values = {str(symbol): 0.3 + 0.17 * k for k, symbol in enumerate((*plain.q, *plain.v, *plain.parameters))}
    B, M = number(plain, "velocity_transformation", values), number(plain, "mass_matrix", values)
    here = {rate: values[str(symbol)] for rate, symbol in zip((*rates, *q), (*plain.v, *plain.q), strict=True)}
    here |= {symbol: values[str(symbol)] for symbol in plain.parameters}
    held, full = (np.array(matrix.xreplace(here), dtype=float) for matrix in (slip.jacobian(rates), mass_matrix))
    np.testing.assert_allclose(held @ B, 0.0, atol=1e-14)
    np.testing.assert_allclose(M, B.T @ full @ B, atol=1e-14)
