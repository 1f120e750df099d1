"""Bounds of rounding and identities, against 50 digits (mpmath) and against expressions whose zeros are known."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

from eomgen.graph.core import Expr, Graph, atan2, cos, sin, sqrt
from eomgen.graph.rounding_bounds import settled_rotation, settled_vector, terms_of, vanishing, with_bounds
from eomgen.graph.vectors import product, transpose
from eomgen.limits.rounding import EPS, ROUNDED

ANGLES = [0.3, -0.8, 1.1]


def turn(graph: Graph, angles: list[Expr]) -> tuple[tuple[Expr, ...], ...]:
    """Rz Ry Rx of expressions."""
    (a, b, c), o, i = angles, graph.zero, graph.one
    x = ((i, o, o), (o, cos(a), -sin(a)), (o, sin(a), cos(a)))
    y = ((cos(b), o, sin(b)), (o, i, o), (-sin(b), o, cos(b)))
    z = ((cos(c), -sin(c), o), (sin(c), cos(c), o), (o, o, i))
    return product(z, product(y, x))


def test_identities_vanish_and_what_is_small_does_not() -> None:
    g = Graph()
    x, y = g.symbol("x"), g.symbol("y")
    R = turn(g, [g.symbol(n) for n in "abc"])
    unit = product(R, transpose(R))
    zero = [
        sin(x) * sin(x) + cos(x) * cos(x) - 1.0,
        (x + y) * (x + y) - x * x - 2.0 * x * y - y * y,
        sin(x + y) - sin(x) * cos(y) - cos(x) * sin(y),
        x * 0.1 + x * 0.2 - x * 0.3,
        unit[0][1],
        unit[2][2] - 1.0,
    ]
    assert all(vanishing(zero))
    other = [
        x,
        x * 1e-30,
        (sin(x) - sin(y)) * 1e-12,  # a loop of a picometre
        sin(x) * 1e-9 + sin(y) * sin(y) + cos(y) * cos(y) - 1.0,  # beside terms a thousand million times as large
        g.constant(1e-40),
    ]
    assert not any(vanishing(other))


def test_a_term_lost_in_large_numbers_that_cancel_is_seen_in_its_slope() -> None:
    """(x + 1e8)^2 - 1e16 - 2e8 x - y is x^2 - y, whatever rounding leaves of its value."""
    g = Graph()
    x, y = g.symbol("x"), g.symbol("y")
    row = (x + 1e8) * (x + 1e8) - 1e16 - x * 2e8 - y
    assert vanishing([row, row + y - x * x]) == [False, True]


def test_what_vanishes_in_a_part_of_its_domain_is_kept() -> None:
    g = Graph()
    x = g.symbol("x")
    part = [
        g.apply("max", x - 10.0, 0.0),
        g.apply("abs", x) - x,
        sqrt(x * x + 0.0) - x,
        atan2(sin(x), cos(x)) - x,
        g.apply("select", g.apply("lt", x, 5.0), 0.0, x),
    ]
    assert not any(vanishing(part))


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_bounds_hold_and_are_not_far_above(scale: float) -> None:
    """Products of turns by numbers that cancel: the error in 50 digits is within the bound, and not a thousandth."""
    rng = np.random.default_rng(3)
    worst, least = 0.0, math.inf
    for _ in range(50):
        g = Graph()
        names = [f"a{k}" for k in range(9)]
        R = [turn(g, [g.symbol(n) for n in names[3 * k : 3 * k + 3]]) for k in range(3)]
        whole = product(product(R[0], R[1]), R[2])
        entry = (whole[0][0] * whole[1][0] + whole[0][1] * whole[1][1] + whole[0][2] * whole[1][2]) * scale  # rows: 0
        values = {n: float(v) for n, v in zip(names, rng.uniform(-3, 3, 9), strict=True)}
        (value,), (bound,) = with_bounds([entry], values)
        error = abs(value)  # the truth is 0
        assert error <= EPS * bound
        worst, least = max(worst, error / (EPS * bound)), min(least, bound / scale)
    assert worst > 1e-3
    assert least > 1.0


def test_bounds_of_functions_hold() -> None:
    g = Graph()
    x, y = g.symbol("x"), g.symbol("y")
    near = (x * x + y * y) - 1.0  # known to about eps, at a point where it is 1e-9
    outputs = [
        sin(near),
        g.apply("exp", near) - 1.0,
        atan2(near, x),
        sqrt(near + 1.0),
        near / (near + 2.0),
        near * near,
    ]
    values = {"x": 0.6, "y": math.sqrt(0.64 + 1e-9)}
    found, bounds = with_bounds(outputs, values)
    with mpmath.workdps(50):
        a, b = mpmath.mpf(values["x"]), mpmath.mpf(values["y"])
        n = a * a + b * b - 1
        exact = [mpmath.sin(n), mpmath.exp(n) - 1, mpmath.atan2(n, a), mpmath.sqrt(n + 1), n / (n + 2), n * n]
        for k, truth in enumerate(exact):
            assert abs(mpmath.mpf(float(found[k])) - truth) <= EPS * bounds[k]
    assert bounds[0] == pytest.approx(3.0, rel=0.2)
    assert bounds[5] < 1e-7  # |near| e + e |near|, not e^2


def test_a_root_of_nothing_has_no_bound() -> None:
    g = Graph()
    x = g.symbol("x")
    assert with_bounds([sqrt(x - x * 1.0 + (x * 0.1 + x * 0.2 - x * 0.3))], {"x": 1.0})[1][0] > 1e6


def test_turned_numbers_settle_on_zeros_and_ones() -> None:
    g = Graph()
    numbers = turn(g, [g.constant(a) for a in ANGLES])
    back = settled_rotation(product(transpose(numbers), numbers))
    assert [[x.value for x in row] for row in back] == np.eye(3).tolist()
    small = settled_rotation(turn(g, [g.zero, g.zero, g.constant(1e-7)]))
    assert small[1][0].value == pytest.approx(1e-7)  # a small turn is none of rounding
    assert small[0][0].value == math.cos(1e-7)


def test_a_small_component_beside_a_large_one_stays() -> None:
    g = Graph()
    v = settled_vector((g.constant(1e-9), g.constant(1e-16), g.symbol("x")), 1.0)
    assert [c.value for c in v] == [1e-9, 0.0, None]
    assert ROUNDED < 2e-14


def test_terms_of_a_sum_of_products() -> None:
    g = Graph()
    a, b, c = (g.symbol(n) for n in "abc")
    values = {"a": 0.3, "b": -0.2, "c": -4.0}
    (found,) = with_bounds([terms_of((a + b) * c - a / c)], values)[0]
    assert found == pytest.approx((0.3 + 0.2) * 4.0 + 0.3 / 4.0)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("quarters", [1, 2, 3, 4, -2])
def test_quarter_and_half_turns_are_exact_and_keep_their_signs(axis: int, quarters: int) -> None:
    """cos(pi/2) is 6e-17 in double precision: such entries of a constant turn are exactly 0, 1 and -1."""
    graph = Graph()
    c, s = math.cos(quarters * math.pi / 2), math.sin(quarters * math.pi / 2)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    numbers = np.eye(3)
    numbers[i, i], numbers[j, j], numbers[i, j], numbers[j, i] = c, c, -s, s
    turned = settled_rotation(tuple(tuple(map(graph.constant, row)) for row in numbers.tolist()))
    assert [[x.value for x in row] for row in turned] == np.round(numbers).tolist()


@pytest.mark.parametrize("n", [10, 60, 500])
def test_long_products_of_rotations_are_told_from_nothing(n: int) -> None:
    """A constraint row of a chain of 400 links counted as rounding: bounds that add up grow with each rotation."""
    graph = Graph()
    zero, one = graph.zero, graph.one
    total = ((one, zero, zero), (zero, one, zero), (zero, zero, one))
    for k in range(n):
        c, s = cos(graph.symbol(f"q{k}")), sin(graph.symbol(f"q{k}"))
        about_z, about_y = (
            ((c, -s, zero), (s, c, zero), (zero, zero, one)),
            ((c, zero, s), (zero, one, zero), (-s, zero, c)),
        )
        turn = about_z if k % 3 else about_y
        total = product(total, turn)
    unit = product(total, transpose(total))
    assert vanishing([*total[0], *total[1], *total[2]]) == [False] * 9
    identities = [unit[i][j] - (1.0 if i == j else 0.0) for i in range(3) for j in range(3)]
    assert vanishing(identities) == [True] * 9
