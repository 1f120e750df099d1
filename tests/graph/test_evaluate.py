import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eomgen.errors import UsageError
from eomgen.graph import Graph, compile_evaluator, evaluate
from eomgen.operations import OPERATIONS

EDGES = (0.0, -0.0, 1.0, -1.0, 0.5, 2.0, -2.5, 1e-320, 1e308, -1e308, 710.0, math.inf, -math.inf, math.nan)
UNARY = {
    "neg": np.negative, "sqrt": np.sqrt, "exp": np.exp, "log": np.log, "sin": np.sin, "cos": np.cos, "tan": np.tan,
    "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "sinh": np.sinh, "cosh": np.cosh, "tanh": np.tanh,
    "asinh": np.arcsinh, "acosh": np.arccosh, "atanh": np.arctanh, "abs": np.abs, "sign": np.sign,
    "not": lambda a: 1.0 * (a == 0),
}  # fmt: skip
BINARY = {
    "add": np.add, "sub": np.subtract, "mul": np.multiply, "div": np.divide, "pow": np.power, "atan2": np.arctan2,
    "hypot": np.hypot, "absorb": lambda a, b: np.where(a * a == 0.0, 0.0, a * b),
    "min": np.minimum, "max": np.maximum, "lt": np.less, "le": np.less_equal, "eq": np.equal,
    "and": np.logical_and, "or": np.logical_or,
}  # fmt: skip


def test_every_operation_has_its_judge():
    assert {*UNARY, *BINARY, "select"} == set(OPERATIONS)


@pytest.mark.parametrize("operation", [*UNARY, *BINARY])
def test_each_operation_is_numpys_on_numbers_and_on_arrays_without_a_warning(operation):
    g = Graph()
    x, y = g.symbol("x"), g.symbol("y")
    if operation in UNARY:
        expr, grid = g.apply(operation, x), np.array(EDGES)
        with np.errstate(all="ignore"):
            expected = UNARY[operation](grid)
        arrays = {"x": grid}
        points = [{"x": v} for v in EDGES]
    else:
        a, b = (m.ravel() for m in np.meshgrid(EDGES, EDGES))
        expr = g.apply(operation, x, y)
        with np.errstate(all="ignore"):
            left, right = (a, b) if expr.node[1] == x.id else (b, a)  # operands of commutative operations are sorted
            expected = BINARY[operation](left, right).astype(float)
        arrays = {"x": a, "y": b}
        points = [{"x": float(u), "y": float(v)} for u, v in zip(a, b, strict=True)]
    np.testing.assert_allclose(evaluate([expr], arrays)[0], expected, rtol=1e-14)
    run = compile_evaluator([expr], ["x", "y"] if operation in BINARY else ["x"])
    numbers = [run(p)[0] for p in points]
    assert all(type(v) is float for v in numbers)
    np.testing.assert_allclose(numbers, expected, rtol=1e-14)


def test_select_hides_what_the_other_branch_does():
    g = Graph()
    x = g.symbol("x")
    safe = g.apply("select", g.apply("lt", g.zero, x), g.apply("log", x), g.one / x)
    assert evaluate([safe], {"x": 0.0}) == [math.inf]
    assert evaluate([safe], {"x": -2.0}) == [-0.5]
    np.testing.assert_allclose(evaluate([safe], {"x": np.array([-2.0, 1.0, 2.0])})[0], [-0.5, 0, math.log(2)])


def test_arrays_broadcast_and_constants_stay_numbers():
    g = Graph()
    x, y = g.symbol("x"), g.symbol("y")
    column, row = np.arange(3.0)[:, None], np.arange(4)  # integers become doubles
    out = evaluate([x * y + 1, g.constant(2.5), x, y * y], {"x": column, "y": row, "unused": "ignored"})
    np.testing.assert_array_equal(out[0], column * row + 1)
    assert out[1] == 2.5
    assert isinstance(out[1], float)
    np.testing.assert_array_equal(out[2], column)
    assert out[3].dtype == np.float64
    assert evaluate([], {}) == []


def test_evaluators_take_mappings_sequences_and_arrays_again_and_again():
    g = Graph()
    x, y = g.symbol("x"), g.symbol("y")
    run = compile_evaluator([x - y, x], ["y", "x"])
    assert run([1.0, 3.0]) == [2.0, 3.0]
    assert run(np.array([1, 3])) == [2.0, 3.0]
    assert run({"x": 3, "y": np.float64(1)}) == [2.0, 3.0]
    two = run(np.array([[1.0, 2.0], [3.0, 5.0]]))  # rows are values
    np.testing.assert_array_equal(two[0], [2.0, 3.0])
    given = np.array([1.0, 2.0])
    run([given, 0.0])
    np.testing.assert_array_equal(given, [1.0, 2.0])


def test_missing_and_superfluous_values_are_named():
    g = Graph()
    x, y = g.symbol("x"), g.symbol("y")
    with pytest.raises(UsageError, match="no value for x, y"):
        evaluate([x + y], {"z": 1.0})
    with pytest.raises(UsageError, match="no value for y"):
        compile_evaluator([x + y], ["x"])
    run = compile_evaluator([x + y], ["x", "y", "z"])
    with pytest.raises(UsageError, match="no value for y"):
        run({"x": 1.0})
    assert run({"x": 1.0, "y": 2.0}) == [3.0]  # z is not needed
    with pytest.raises(UsageError, match="3 values expected, not 2"):
        run([1.0, 2.0])


def test_a_deep_chain_needs_no_recursion():
    g = Graph()
    x = y = g.symbol("x")
    for _ in range(50_000):
        y = g.apply("sin", y + 1.0)
    value = 0.3
    for _ in range(50_000):
        value = math.sin(value + 1.0)
    assert evaluate([y], {"x": 0.3}) == [value]
    assert x != y


@given(data=st.data())
@settings(max_examples=60, deadline=None, derandomize=True)
def test_values_agree_with_sympy(data, twins):
    twin = data.draw(twins())
    expected = twin.sympy_value(twin.sympy_expr)
    assert evaluate([twin.expr], twin.point)[0] == pytest.approx(expected, rel=1e-9, abs=1e-9)
