"""x / |x| becomes a sign wherever x divides what stands above, and the value stays the same for x != 0."""

from __future__ import annotations

import math
import random
from typing import Any

import pytest
import sympy
from sympy.abc import A, B, a, b, c, s

from eomgen.graph.core import Graph
from eomgen.graph.evaluate import evaluate
from eomgen.graph.sympy_lower import lower as lower_by
from eomgen.notation import Notation
from eomgen.printing import Formulas, Order, text
from eomgen.reading.written import write
from eomgen.simplify import WHOLE, simplify

sin, cos, size = sympy.sin, sympy.cos, sympy.Abs
HALF = sympy.Rational(1, 2)


def lower(graph: Graph, expression: Any) -> Any:
    return lower_by(graph, expression, lambda x: graph.symbol(x.name) if x.is_Symbol else None)


def short(expression: Any) -> Any:
    form = simplify([lower(Graph(), expression)], sizes=WHOLE)
    assert form is not None
    return form.sympy()[1][0]


def printed(expression: Any) -> str:
    """As a display shows it, in text."""
    (found,) = write([lower(Graph(), expression)]).expressions
    return text(Formulas(Order({}))(found), Notation(())).replace("\u00a0", " ")


CASES = {
    "a sgn(cos(A)) sin(A)": a * sin(A) * cos(A) / size(cos(A)),
    "a (b - s - c sgn(b - s))": a * (size(b - s) - c) * (b - s) / size(b - s),
    "a (b - s - c sgn(b - s)) ": -a * (size(b - s) - c) * (s - b) / size(b - s),
    "5 - 10 s + sgn(s - 1/2)": (HALF - s) * (10 * size(s - HALF) - 1) / size(s - HALF),
    "b |a|": a**2 * b / size(a),
    "b/(a |a|)": a * b / size(a) ** 3,
    "c sgn(a cos(A))": c * a * cos(A) / size(a * cos(A)),
    "c/|a - b|": c / size(a - b),
    "(a + c)/|a - b|": (a + c) / size(a - b),
    "sgn(a) sgn(b)": a * b / (size(a) * size(b)),
    "cos(A + B) sgn(a - b)": (a - b) * (cos(A) * cos(B) - sin(A) * sin(B)) / size(a - b),
}


@pytest.mark.parametrize("wanted", CASES)
def test_as_by_hand(wanted: str) -> None:
    given = CASES[wanted]
    assert printed(given) == wanted.strip()
    found, draw = short(given), random.Random(5)
    for _ in range(10):
        values = {x: draw.choice((-1, 1)) * draw.uniform(0.2, 3.0) for x in (a, b, c, s, A, B)}
        assert math.isclose(float(found.subs(values)), float(given.subs(values)), rel_tol=1e-11, abs_tol=1e-11)


def test_no_value_is_made_where_there_is_none() -> None:
    assert short(a * (b - s) / size(b - s)).subs({b: 1, s: 1}) is sympy.nan
    assert short(a * sympy.sign(s)).subs({s: 0}) == 0  # a sign that the model itself has


def test_a_derivative_is_one_of_magnitudes() -> None:
    (found,) = write([lower(Graph(), a * (b - s) / size(b - s))]).expressions
    slope = sympy.diff(found, s)
    assert not slope.has(sympy.Derivative)
    assert sympy.simplify(slope) == 0


def test_random_products() -> None:
    draw = random.Random(11)
    parts = [a, b - s, cos(A), s - HALF, a + 2 * b]
    for _ in range(60):
        graph = Graph()
        terms = []
        for _ in range(draw.randint(1, 3)):
            term: Any = draw.choice([1, 2, -3, HALF])
            for part in draw.sample(parts, 3):
                term *= part ** draw.randint(0, 2) * size(draw.choice([part, -part, 2 * part])) ** draw.randint(-3, 1)
            terms.append(term)
        node = lower(graph, sum(terms))
        form = simplify([node], sizes=WHOLE)
        assert form is not None
        values = {str(x): draw.choice((-1, 1)) * draw.uniform(0.3, 2.0) for x in (a, b, c, s, A, B)}
        (wanted,) = evaluate([node], values)
        found = float(form.sympy()[1][0].subs(values))
        assert math.isclose(found, float(wanted), rel_tol=1e-9, abs_tol=1e-9)
