"""The state of the line-by-line part: it moves, and what rounding leaves of zero is told as 0."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
import sympy

import eomgen as eg
from eomgen.explain.author import Author
from eomgen.explain.document import Folded, FormulaLine
from eomgen.explain.shown_values import (
    is_rounding,
    known_values,
    moving_state,
    state_values,
    told_state,
    value_of,
)

EXAMPLES = Path(__file__).parents[2] / "examples"
x, y, z = sympy.symbols("x y z")


def section(equations: Any) -> tuple[str, dict[str, Any]]:
    """The sentence before the numbers, and the value of each left side."""
    (found,) = [s for s in equations.explain().sections if s.title.startswith("Numbers")]
    pieces = [p for piece in found.pieces for p in (piece.pieces if isinstance(piece, Folded) else [piece])]
    return found.pieces[0].text, {p.sides[0]: p.sides[-1] for p in pieces if isinstance(p, FormulaLine)}


def test_a_model_at_rest_is_told_in_motion() -> None:
    """Two point masses at the ends of rods of 1 m, horizontal: the second moves at 1 + (1 + 1) m/s."""
    told, lines = section(eg.load(EXAMPLES / "double_pendulum.yaml").derive())
    assert "velocities are 1" in told
    assert lines["T"] == pytest.approx(0.5 * 1.0**2 + 0.5 * 3.0**2)
    assert lines["V"] == 0.0  # both at the height of the pivot
    assert lines[r"(\mathbf{R}_{\mathrm{upper}})_{1,1}"] == 0.0  # cos(pi / 2)
    assert lines[r"(\boldsymbol{\alpha}_{\mathrm{lower}})_{3}"] == 0.0
    # with both rods in line, horizontal, turning at 1 and 1 rad/s: M a = f of the textbook's M and f
    assert lines[r"\ddot{\theta}_1"] == pytest.approx(-9.81)
    assert lines[r"\ddot{\mathrm{bend}}"] == pytest.approx(9.81)


def test_a_loop_at_rest_moves_consistently() -> None:
    """A slider-crank whose crank starts along the rod: theta' = 1 gives bend' = -1 - r/l and a slider at rest."""
    m = eg.Model("crank_drive", gravity=(0, "-g", 0))
    for name, value in {"g": 9.81, "r": 0.1, "l": 0.4}.items():
        m.parameter(name, value)
    crank = m.body("crank", mass=1, com=("r/2", 0, 0), inertia={"zz": 0.01})
    rod = m.body("rod", mass=1, com=("l/2", 0, 0), inertia={"zz": 0.01})
    slider = m.body("slider", mass=1)
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at("r", 0, 0), rod, coordinate="bend")
    m.revolute("C", rod.at("l", 0, 0), slider)
    m.prismatic("D", m.ground, slider, axis="x", coordinate="s")
    m.initial(theta=0.0)
    told, lines = section(m.derive(independent=["theta"]))
    assert "velocities are 1" in told
    assert lines[r"(\boldsymbol{\omega}_{\mathrm{rod}})_{3}"] == pytest.approx(-0.25)
    assert lines.get(r"(\mathbf{v}_{\mathrm{slider}})_{1}", 0.0) == 0.0
    moving, _ = section(m.derive(independent=["theta"]).with_parameters(r=0.2))
    assert "velocities are 1" in moving
    m.initial(theta=0.3, theta_dot=2.0)
    assert "The declared initial state" in section(m.derive(independent=["theta"]))[0]


@pytest.mark.parametrize("name", ["satellite", "hydraulic_boom", "quadrotor_load", "car_axis", "kapitza_pendulum"])
def test_states_of_each_kind_have_numbers(name: str) -> None:
    """Euler parameters, first-order states, inputs, motions over time: every symbol has a finite number."""
    equations = eg.load(EXAMPLES / f"{name}.yaml").derive()
    module = equations.compile("numpy")
    x, _ = moving_state(module, Author(equations, True).independent_velocities)
    exact, told = state_values(module, x, 0.0), told_state(module, x)
    assert told.keys() == exact.keys()
    largest = max(map(abs, exact.values()))
    for symbol, value in told.items():
        assert math.isfinite(value)
        assert value == exact[symbol] or (value == 0.0 and abs(exact[symbol]) < 1e-12 * largest)


@pytest.mark.parametrize(
    ("expression", "values", "rounding"),
    [
        (sympy.cos(x), {"x": math.pi / 2}, True),
        (sympy.cos(x), {"x": math.pi / 2 + 1e-9}, False),
        (x + y, {"x": -9.81, "y": 9.81 + 2e-15}, True),
        (x - y, {"x": 1.0, "y": 1.0 - 1e-10}, False),
        (x * y, {"x": 1e-12, "y": 1e-9}, False),  # small, and known to all digits
        (x * sympy.sin(y) + z * x, {"x": 1e6, "y": math.pi, "z": 0.0}, True),
        (sympy.sin(x) ** 2 + sympy.cos(x) ** 2 - y, {"x": 0.7, "y": 1.0 - 1e-15}, True),
    ],
)
def test_what_rounding_leaves_is_told_from_small_values(expression: Any, values: Any, rounding: bool) -> None:
    value = float(value_of(expression, known_values([], values)))
    assert value != 0.0
    assert is_rounding(expression, value, [], values) is rounding
