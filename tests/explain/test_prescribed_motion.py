"""The worked solution where no degree of freedom is left: constraints and the forces of drivers are compared."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import sympy

import eomgen as eg
from eomgen.explain.document import FormulaLine, Table
from eomgen.reading.writes_quantities import WritesQuantities

EXAMPLES = Path(__file__).parents[2] / "examples"
DRIVEN = ["driven_slider_crank", "v_twin", "jansen_leg", "chebyshev", "hoecken"]
OF_CONSTRAINTS = {"constraints", "velocity_constraints", "constraint_jacobian", "gamma"}


def arm() -> eg.Model:
    """A rod with a given angle, in the field of gravity."""
    m = eg.Model("arm", gravity=(0, "-g", 0))
    for name, value in {"g": 9.81, "m": 2.0, "l": 0.6, "omega": 1.5, "alpha": 0.8}.items():
        m.parameter(name, value)
    rod = m.body("rod", mass="m", com=("l/2", 0, 0), inertia={"zz": "m*l**2/12"})
    m.revolute("A", m.ground, rod, coordinate="theta")
    m.driver("drive", "theta", "omega*t + alpha*t**2/2")
    return m


def compared(equations: Any) -> dict[str, float]:
    (table,) = (piece for piece in equations.explain().sections[-1].pieces if isinstance(piece, Table))
    return {name.strip("`"): float(value) for name, value in table.rows}


def test_the_torque_of_a_driver_is_that_of_the_closed_form() -> None:
    """m l^2/3 alpha + m g l/2 cos(theta), from the M and f that are shown."""
    equations = arm().derive()
    section = next(s for s in equations.explain().sections if s.title == "Equations of motion")
    M, f = (piece.sides[1] for piece in section.pieces if isinstance(piece, FormulaLine))
    m, l, g, theta = sympy.symbols("m l g theta")
    assert sympy.simplify(M - m * l**2 / 3) == 0
    assert sympy.simplify(f + m * g * l / 2 * sympy.cos(theta)) == 0
    found = compared(equations)
    assert {*OF_CONSTRAINTS, "multipliers", "forces of the constraints", "poses[rod]", "velocities"} <= set(found)
    assert max(found.values()) <= 1e-10


@pytest.mark.parametrize("name", DRIVEN)
@pytest.mark.parametrize("method", ["embedding", "newton_euler"])
def test_constraints_of_driven_examples_are_compared(name: str, method: str) -> None:
    found = compared(eg.load(EXAMPLES / f"{name}.yaml").derive(method))
    assert set(found) >= OF_CONSTRAINTS
    assert max(found.values()) <= 1e-10


@pytest.mark.parametrize(
    ("wrong", "key"), [("constraints", "constraints"), ("gamma", "gamma"), ("tree_system", "forces of the constraints")]
)
def test_a_wrong_formula_is_found(wrong: str, key: str, monkeypatch: pytest.MonkeyPatch) -> None:
    write = WritesQuantities._write

    def slip(self: Any, name: str, *args: Any) -> list[Any]:
        flat = write(self, name, *args)
        if name == wrong:
            k = max(range(len(flat)), key=lambda i: len(str(flat[i])))
            flat[k] = flat[k] * 1.01 + sympy.Rational(1, 1000)
        return flat

    monkeypatch.setattr(WritesQuantities, "_write", slip)
    assert compared(arm().derive())[key] > 1e-7
