"""Nodes that are the same function: found where they are, and only there."""

from __future__ import annotations

import numpy as np
import pytest

from eomgen.graph.core import Expr, Graph, cos, sin, sqrt
from eomgen.graph.count import count
from eomgen.graph.evaluate import evaluate
from eomgen.graph.substitute import symbols_of
from eomgen.simplify import joined_nodes


def symbols(names: str) -> tuple[Graph, list[Expr]]:
    graph = Graph()
    return graph, [graph.symbol(name) for name in names.split()]


def joined(x: Expr) -> Expr:
    (found,), _ = joined_nodes([x])
    return found


def test_a_rotation_with_itself_is_one() -> None:
    _, (a, b, c) = symbols("a b c")
    first = [cos(a) * cos(b) - sin(a) * sin(b) * sin(c), sin(a) * cos(b) + cos(a) * sin(b) * sin(c), -cos(c) * sin(b)]
    second = [-cos(c) * sin(a), cos(a) * cos(c), sin(c)]
    assert joined(first[0] * first[0] + first[1] * first[1] + first[2] * first[2]).value == 1.0
    assert joined(sum((x * y for x, y in zip(first, second, strict=True)), 0 * a)).value == 0.0


def test_what_does_not_depend_on_an_angle_is_written_without_it() -> None:
    _, (a, b) = symbols("a b")
    x = sin(a) * sin(a + b) + cos(a) * cos(a + b)
    found = joined(3.0 * x * b)
    assert symbols_of([found]) == {"b"}
    assert evaluate([found], {"b": 0.7})[0] == pytest.approx(3 * 0.7 * np.cos(0.7), rel=1e-14)


def test_euler_parameters_have_length_one() -> None:
    _, e = symbols("e0 e1 e2 e3")
    square = e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3]
    (found,), _ = joined_nodes([e[1] / square], (), [("e0", "e1", "e2", "e3")])
    assert count([found]).total == 0
    assert count([joined(e[1] / square)]).total > 0


@pytest.mark.parametrize("operation", ["exp", "tanh", "abs", "max"])
def test_what_is_lost_in_rounding_or_true_in_places_stays(operation: str) -> None:
    """tanh(50 x)^2 is 1 at most numbers and exp(-50) beside 1 is nothing, and yet they are no constants."""
    graph, (x,) = symbols("x")
    y = graph.apply(operation, 50.0 * x, *([0.0] if operation == "max" else []))
    for given in (y * y, 1.0 + graph.apply("exp", -50.0 - y), y - 50.0 * x, sqrt(x * x) - x):
        found = joined(given)
        assert symbols_of([found]) == {"x"}
        for at in (0.004, -0.004):
            assert evaluate([found], {"x": at})[0] == pytest.approx(evaluate([given], {"x": at})[0], rel=1e-13)


def test_inside_of_such_operations_too() -> None:
    graph, (a, x) = symbols("a x")
    inner = sin(a) * sin(a) + cos(a) * cos(a)
    found = joined(graph.apply("exp", inner * x) * inner)
    assert symbols_of([found]) == {"x"}


def test_names_stand_only_after_what_they_stand_for() -> None:
    graph, (a, b, c) = symbols("a b c")
    u, w = graph.symbol("u"), graph.symbol("w")
    given = [("u", a * b + a * c), ("w", a * (b + c) * u)]
    (found,), left = joined_nodes([u * w + a * (b + c)], given)
    assert [name for name, _ in left] == ["u", "w"]
    assert symbols_of([left[0][1]]) == {"a", "b", "c"}
    assert "w" not in symbols_of([left[1][1]])
    values = {"a": 1.3, "b": 0.4, "c": -2.1}
    for name, x in left:
        values[name] = float(evaluate([x], values)[0])
    wanted = {"a": 1.3, "b": 0.4, "c": -2.1, "u": 1.3 * (0.4 - 2.1)}
    wanted["w"] = float(evaluate([given[1][1]], wanted)[0])
    assert evaluate([found], values)[0] == pytest.approx(evaluate([u * w + a * (b + c)], wanted)[0], rel=1e-14)


@pytest.mark.parametrize("seed", range(8))
def test_values_stay(seed: int) -> None:
    graph, names = symbols("a b c d")
    random = np.random.default_rng(seed)
    pool: list[Expr] = [*names, graph.constant(2.0)]
    for _ in range(60):
        x, y = (pool[k] for k in random.integers(0, len(pool), 2))
        kind = random.choice(["add", "sub", "mul", "div", "sin", "cos", "neg", "abs", "tanh"])
        pool.append(graph.apply(kind, x, y) if kind in ("add", "sub", "mul", "div") else graph.apply(kind, x))
    found, _ = joined_nodes(pool[-10:])
    for _ in range(5):
        values = dict(zip("abcd", map(float, random.uniform(0.1, 1.5, 4)), strict=True))
        for x, y in zip(evaluate(found, values), evaluate(pool[-10:], values), strict=True):
            assert x == pytest.approx(y, rel=1e-9, abs=1e-11, nan_ok=True)
