"""Magnitudes in shown formulas: SymPy can differentiate them, and they print as |x|."""

from __future__ import annotations

import math
from typing import Any

import pytest
import sympy

import eomgen as eg


def sprung() -> Any:
    m = eg.Model("sprung")
    for name, value in {"k": 3.0, "l0": 0.2, "a": 0.1}.items():
        m.parameter(name, value)
    block = m.body("block", mass=1.0)
    m.prismatic("rail", m.ground, block, axis="x", coordinate="s")
    m.spring("k1", m.ground.at("a", 0, 0), block, stiffness="k", length="l0")
    return m.derive()


@pytest.mark.parametrize("s", [0.7, -1.3])
def test_the_potential_of_a_spring_has_a_derivative_which_is_its_force(s: float) -> None:
    equations = sprung()
    symbol = sympy.Symbol("s")
    slope = sympy.diff(equations.V, symbol)
    assert not slope.has(sympy.Derivative)
    values = {"k": 3.0, "l0": 0.2, "a": 0.1, "s": s}
    assert float(slope.subs(values)) == pytest.approx(3 * (abs(s - 0.1) - 0.2) * math.copysign(1, s - 0.1))
    assert float(equations.force[0].subs(values)) == pytest.approx(-float(slope.subs(values)))


def test_it_prints_as_a_magnitude() -> None:
    from eomgen.printing import Formulas, text
    from eomgen.reading.printed_equations import order_of

    equations = sprung()
    shown = text(Formulas(order_of(equations))(equations.V), equations.notation)
    assert "|a - s|" in shown.replace("\u00a0", " ")
    assert "sgn(s - a)" in str(equations)
    assert "no value at x = 0" in str(equations)
    assert "no value at x = 0" in equations._repr_html_()


def test_mass_matrix_and_force_are_formed_together() -> None:
    equations = sprung()
    formed, _ = equations.as_formed("force").formed()
    assert len(formed) == 2
    assert equations.as_formed("force").flat == [*equations.mass_matrix, *equations.force]
