"""Systems whose equations fit on a slide do so here: by every method and for every choice of coordinates."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from shown_numbers import evaluate, random_state, state_values

import eomgen as eg
from eomgen.equations import METHODS
from eomgen.reading.written import needed

EXAMPLES = Path(__file__).parents[2] / "examples"


def free_body() -> Any:
    m = eg.Model("free", gravity=(0, 0, "-g"))
    for name, value in {"g": 9.81, "m": 2.0, "A": 0.1, "B": 0.2, "C": 0.25}.items():
        m.parameter(name, value)
    m.free("j", m.ground, m.body("rigid", mass="m", inertia=("A", "B", "C")), rotation="euler_parameters")
    return m


def scissors() -> Any:
    """Two equal bars pinned in the middle, one end on a fixed pin, one on a slider."""
    m = eg.Model("scissors", gravity=(0, "-g", 0))
    for name, value in {"g": 9.81, "l": 1.0, "m": 2.0, "m_s": 0.5}.items():
        m.parameter(name, value)
    a, b = (m.body(name, mass="m", com=("l/2", 0, 0), inertia={"zz": "m*l**2/12"}) for name in "ab")
    slider = m.body("slider", mass="m_s")
    m.revolute("O", m.ground, a, coordinate="alpha")
    m.prismatic("rail", m.ground, slider, axis="x", coordinate="x")
    m.revolute("S", slider, b, coordinate="beta")
    m.revolute("C", a.at("l/2", 0, 0), b.at("l/2", 0, 0))
    m.initial = {"alpha": 0.6, "x": math.cos(0.6), "beta": math.pi - 0.6}
    return m


def compared(equations: Any) -> None:
    """M and f of the display against the module."""
    module = equations.compile(target="numpy")
    x = random_state(module, 3)
    values, free = state_values(module, x, 0.0), list(module.layout.metadata["independent"])
    M = module.embedded_mass_matrix(x[: module.n_q])
    wanted = [*M.ravel(), *(M @ module.rhs(0.0, x)[module.n_q :][free])]
    shown = evaluate(equations.intermediates, [*equations.mass_matrix, *equations.force], values)
    assert shown == pytest.approx(wanted, rel=1e-11, abs=1e-11 * abs(M).max())


@pytest.mark.parametrize("method", METHODS)
def test_a_free_body_in_euler_parameters_obeys_newton_and_euler(method: str) -> None:
    m, g, A, B, C, x, y, z = sympy.symbols("m g A B C j_wx j_wy j_wz")
    equations = free_body().derive(method)
    assert equations.intermediates == []
    assert equations.mass_matrix == sympy.diag(m, m, m, A, B, C)
    gyroscopic = [(B - C) * y * z, (C - A) * z * x, (A - B) * x * y]
    assert (equations.force - sympy.Matrix([0, 0, -m * g, *gyroscopic])).expand() == sympy.zeros(6, 1)
    compared(equations)


def test_energies_of_a_free_body_are_short() -> None:
    m, A, B, C, x, y, z, u, v, w = sympy.symbols("m A B C j_wx j_wy j_wz j_x_dot j_y_dot j_z_dot")
    kinetic = (m * (u**2 + v**2 + w**2) + A * x**2 + B * y**2 + C * z**2) / 2
    for method in ("hamilton", "gibbs_appell", "embedding"):
        equations = free_body().derive(method)
        assert (equations.T - kinetic).expand() == 0
        assert list(equations.momenta) == [m * u, m * v, m * w, A * x, B * y, C * z]
    hamilton = free_body().derive("hamilton")
    assert hamilton.written("hamiltonian")[0] == []
    assert hamilton.written("momentum_rates")[0] == []
    assert free_body().derive("gibbs_appell").written("gibbs_function")[0] == []


@pytest.mark.parametrize("method", METHODS)
def test_the_rolling_disc_has_three_equations(method: str) -> None:
    """J. I. Neimark, N. A. Fufaev, Dynamics of Nonholonomic Systems: in lean, its sine and the rates alone."""
    equations = eg.load(EXAMPLES / "rolling_disc.yaml").derive(method)
    assert equations.intermediates == []
    m, r, lean = sympy.symbols("m r lean")
    s = sympy.sin(lean)
    wanted = [[1 + 5 * s**2, 0, 6 * s], [0, 5, 0], [6 * s, 0, 6]]
    assert (equations.mass_matrix - m * r**2 / 4 * sympy.Matrix(wanted)).expand() == sympy.zeros(3, 3)
    assert {x.name for x in equations.force.free_symbols} == {"m", "r", "g", "lean", "yaw_dot", "lean_dot", "spin_dot"}
    assert sum(sympy.count_ops(x) for x in equations.force) <= 52
    compared(equations)


@pytest.mark.parametrize("independent", ["alpha", "beta", "x"])
@pytest.mark.parametrize("method", METHODS)
def test_scissors_are_as_short_in_each_coordinate(method: str, independent: str) -> None:
    equations = scissors().derive(method, independent=[independent])
    assert equations.intermediates == []
    assert sum(sympy.count_ops(x) for x in [*equations.mass_matrix, *equations.force]) <= 51
    compared(equations)


def test_a_satellite_names_its_rotation() -> None:
    equations = eg.load(EXAMPLES / "satellite.yaml").derive()
    named = [str(name) for name, _ in equations.intermediates]
    assert {f"R_{i}{j}" for i in "123" for j in "123"} <= {*named}
    assert not any("flight_e" in str(x) for x in equations.mass_matrix)
    assert len(named) <= 60
    compared(equations)


@pytest.mark.parametrize("n", [6, 9])
def test_a_chain_has_no_names_for_sums_of_angles(n: int) -> None:
    """Sums that stand in sines and cosines are joined there, and M in numbers is that of the module."""
    m = eg.Model("chain", gravity=(0, -9.81, 0))
    last: Any = m.ground
    for k in range(1, n + 1):
        rod = m.body(f"rod{k}", mass=1.0, com=(0, -0.5, 0), inertia={"zz": 1 / 12})
        m.revolute(f"q{k}", last, rod)
        last = rod.at(0, -1, 0)
    equations = m.derive("embedding")
    named, mass = equations.written("mass_matrix")
    angles = {f"q{k}" for k in range(1, n + 1)}
    for _, x in named:
        assert not (x.is_Add and {str(a) for a in x.args} <= angles)
    q = np.linspace(0.3, 1.1, n)
    values: dict[Any, float] = dict(zip((sympy.Symbol(f"q{k}") for k in range(1, n + 1)), q.tolist(), strict=True))
    for symbol, x in needed(named, mass):  # those of the forces are told with them
        values[symbol] = float(x.subs(values))
    shown = np.array(mass.subs(values), dtype=float)
    np.testing.assert_allclose(shown, equations.compile(target="numpy").mass_matrix(q), rtol=1e-12)
