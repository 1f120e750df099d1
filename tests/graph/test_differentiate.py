import math
import time

import numpy as np
import pytest
import sympy
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from eomgen.graph import Graph, count, evaluate, gradient, jacobian, jvp, symbols_of, vjp
from eomgen.graph.differentiate import _forward_jacobian, _reverse_jacobian
from eomgen.operations import OPERATIONS

X, Y = sympy.symbols("x y", real=True)
# operation -> SymPy function and a point inside its domain
SMOOTH = {
    "sqrt": (sympy.sqrt, 0.7), "exp": (sympy.exp, 0.7), "log": (sympy.log, 0.7), "sin": (sympy.sin, 0.7),
    "cos": (sympy.cos, 0.7), "tan": (sympy.tan, 0.7), "asin": (sympy.asin, 0.7), "acos": (sympy.acos, 0.7),
    "atan": (sympy.atan, -2.7), "sinh": (sympy.sinh, 0.7), "cosh": (sympy.cosh, -0.7), "tanh": (sympy.tanh, 0.7),
    "asinh": (sympy.asinh, -1.3), "acosh": (sympy.acosh, 1.4), "atanh": (sympy.atanh, 0.6),
    "abs": (sympy.Abs, -0.7), "neg": (lambda a: -a, 0.7),
}  # fmt: skip
BINARY = {
    "add": lambda a, b: a + b, "sub": lambda a, b: a - b, "mul": lambda a, b: a * b, "div": lambda a, b: a / b,
    "pow": lambda a, b: a**b, "atan2": sympy.atan2,
    "hypot": lambda a, b: sympy.sqrt(a**2 + b**2), "min": sympy.Min, "max": sympy.Max, "absorb": lambda a, b: a * b,
}  # fmt: skip


FLAT = ("sign", "lt", "le", "eq", "not", "and", "or")


def test_every_operation_has_a_derivative():
    assert {*SMOOTH, *BINARY, *FLAT, "select"} == set(OPERATIONS)
    for name, row in OPERATIONS.items():
        assert len(row.slopes) == (0 if name in (*FLAT, "min", "max", "select") else row.arity)
        assert len(row.rates) == (0 if name in FLAT else row.arity)
        assert (row.choice is not None) == (name in ("min", "max", "select"))


@pytest.mark.parametrize("operation", SMOOTH)
def test_functions_of_one_operand_agree_with_sympy(operation):
    theirs, at = SMOOTH[operation]
    g = Graph()
    x = g.symbol("x")
    f = g.apply(operation, x * x * x)
    expected = float(theirs(X**3).diff(X).subs(X, sympy.Rational(at)).evalf(30))
    forward, reverse = jvp([f], {x: g.one}), gradient(f, [x])
    assert evaluate([*forward, *reverse], {"x": at}) == pytest.approx([expected] * 2, rel=1e-13)


@pytest.mark.parametrize("operation", BINARY)
@pytest.mark.parametrize(
    "inner", [(X, Y), (X * Y, sympy.Integer(2)), (sympy.Integer(3), X + Y), (X * Y, X), (Y, X * Y)]
)
def test_functions_of_two_operands_agree_with_sympy(operation, inner):
    g = Graph()
    x, y = g.symbol("x"), g.symbol("y")
    ours = {X: x, Y: y, X * Y: x * y, X + Y: x + y, sympy.Integer(2): 2, sympy.Integer(3): 3}
    f = g.apply(operation, *(ours[e] for e in inner))
    expr = BINARY[operation](*inner)
    point = {X: sympy.Rational(7, 10), Y: sympy.Rational(13, 10)}
    expected = [float(expr.diff(v).subs(point).evalf(30)) for v in (X, Y)]
    values = {"x": 0.7, "y": 1.3}
    assert evaluate(gradient(f, [x, y]), values) == pytest.approx(expected, rel=1e-13)
    columns = [jvp([f], {v: g.one})[0] for v in (x, y)]
    assert evaluate(columns, values) == pytest.approx(expected, rel=1e-13)


def test_flat_operations_have_slope_zero():
    g = Graph()
    x, y = g.symbol("x"), g.symbol("y")
    for operation in FLAT:
        f = g.apply(operation, x) if operation in ("sign", "not") else g.apply(operation, x, y)
        assert jvp([f], {x: g.one}) == [g.zero]
        assert gradient(f, [x, y]) == [g.zero, g.zero]
        assert jacobian([f], [x, y]) == {}


def test_a_branch_not_taken_does_not_leak():
    """sqrt has an infinite slope at 0; reverse accumulation would multiply it by a zero weight."""
    g = Graph()
    x = g.symbol("x")
    root = g.apply("sqrt", x)
    for f in (
        3 * g.apply("select", g.apply("lt", g.zero, x), root, 2 * x) * (x + 1),
        3 * g.apply("max", -root, 2 * x + 1) * (x - 1) / 2,
    ):
        expected = {"x": 0.0}
        values = evaluate([*gradient(f, [x]), *jvp([f], {x: g.one}), *jacobian([f], [x]).values()], expected)
        assert all(map(math.isfinite, values))
        assert values == pytest.approx([values[0]] * 3)
    nested = g.apply("select", g.apply("lt", g.zero, x), g.apply("min", root, g.apply("log", x)), x * x * 5 + x)
    assert evaluate(gradient(nested * 2, [x]), {"x": 0.0}) == [2.0]


def test_weights_seeds_and_repeated_symbols():
    g = Graph()
    x, y, a, b = (g.symbol(n) for n in "xyab")
    f = [x * y, x + y * y, x * y]
    assert jvp(f, {x: a, y: b}) == [a * y + x * b, a + 2 * (y * b), a * y + x * b]
    assert jvp(f, {x: g.zero}) == [g.zero] * 3
    assert jvp([a], {x: b}) == [g.zero]
    pulled = vjp(f, [a, b, a], [x, y])
    values = {"x": 0.3, "y": 0.7, "a": 1.1, "b": -0.6}
    assert evaluate(pulled, values) == pytest.approx([2.2 * 0.7 - 0.6, 2.2 * 0.3 - 0.6 * 1.4])
    assert jacobian([x * y], [x, x]) == {(0, 0): y, (0, 1): y}
    assert gradient(x, [x, y]) == [g.one, g.zero]
    assert jacobian([x, g.one, y], [x, y]) == {(0, 0): g.one, (2, 1): g.one}
    assert jvp([], {}) == [] == vjp([], [], [])
    assert jacobian([], []) == {}


def test_wrong_requests_are_refused():
    g = Graph()
    x = g.symbol("x")
    with pytest.raises(ValueError, match="with respect to symbols"):
        jvp([x], {x * 2: g.one})
    with pytest.raises(ValueError, match="with respect to symbols"):
        jacobian([x], [g.one])
    with pytest.raises(ValueError, match="1 outputs need as many weights"):
        vjp([x], [], [x])
    with pytest.raises(ValueError, match="different graphs"):
        jvp([x], {Graph().symbol("x"): g.one})


def test_the_jacobian_holds_only_what_is_not_zero():
    g = Graph()
    x = [g.symbol(f"x{k}") for k in range(30)]
    outputs = [g.apply("sin", x[k]) * x[k + 1] + 5 for k in range(29)] + [x[0] - x[0] + 1]
    assert list(jacobian(outputs, x)) == [(k, j) for k in range(29) for j in (k, k + 1)]


def test_the_jacobian_takes_the_cheaper_direction():
    def work(rows, columns):
        g = Graph()
        x = [g.symbol(f"x{k}") for k in range(columns)]
        y = g.zero
        for s in x:
            y = g.apply("sin", y * s + s)
        outputs = [g.apply("cos", y * (k + 2)) for k in range(rows)]
        made = len(g.nodes)
        jacobian(outputs, x)
        return (len(g.nodes) - made) / made

    assert work(1, 60) < 3
    assert work(60, 1) < 3


def test_reverse_work_does_not_grow_with_the_number_of_symbols():
    g = Graph()
    x = [g.symbol(f"x{k}") for k in range(200)]
    y = g.one
    for s in x:
        y = y * g.apply("sin", s) + g.apply("sqrt", y * y + s) / (2 + s)
    assert count(gradient(y, x)).total < 5 * count([y]).total


def test_deep_chains_need_no_recursion_and_little_time():
    g = Graph()
    x = y = g.symbol("x")
    for _ in range(30_000):
        y = g.apply("sin", y) * 0.9 + x
    started, before = time.perf_counter(), len(g.nodes)
    forward, reverse = jvp([y], {x: g.one})[0], gradient(y, [x])[0]
    per_node = (time.perf_counter() - started) / (len(g.nodes) - before)
    a, b = evaluate([forward, reverse], {"x": 0.4})
    assert a == pytest.approx(b, rel=1e-10)
    assert per_node < 20e-6  # about 2e-6 on a quiet machine


@given(data=st.data())
@settings(max_examples=60, deadline=None, derandomize=True)
def test_gradients_agree_with_sympy(data, twins):
    twin = data.draw(twins(size=7))
    g = twin.graph
    ours = evaluate(gradient(twin.expr, twin.symbols), twin.point)
    assume(all(map(math.isfinite, ours)) and max(map(abs, ours)) < 1e8)
    theirs = [twin.sympy_value(twin.sympy_expr.diff(s)) for s in twin.sympy_symbols]
    assert ours == pytest.approx(theirs, rel=1e-8, abs=1e-8)
    forward = [jvp([twin.expr], {s: g.one})[0] for s in twin.symbols]
    assert evaluate(forward, twin.point) == pytest.approx(theirs, rel=1e-8, abs=1e-8)


@given(data=st.data())
@settings(max_examples=60, deadline=None, derandomize=True)
def test_all_ways_to_a_jacobian_agree(data, twins):
    """Forward, reverse, directional and weighted derivatives, and central differences, on several outputs at once."""
    twin = data.draw(twins(size=14))
    g, x = twin.graph, twin.symbols
    rows = [twin.expr, twin.expr * x[0] + x[2], g.apply("sin", twin.expr), x[1] * x[1]]
    roots = [r.id for r in rows]
    values = evaluate(rows, twin.point)
    assume(all(map(math.isfinite, values)) and max(map(abs, values)) < 1e4)

    def dense(entries):
        matrix = np.zeros((len(rows), len(x)))
        if entries:
            matrix[tuple(np.array(list(entries)).T)] = evaluate(
                [type(x[0])(g, e) if isinstance(e, int) else e for e in entries.values()], twin.point
            )
        return matrix

    matrix = dense(jacobian(rows, x))
    assume(np.isfinite(matrix).all() and np.abs(matrix).max() < 1e4)
    scale = 1e-9 * (1 + np.abs(matrix).max())
    np.testing.assert_allclose(dense(_forward_jacobian(g, roots, x)), matrix, atol=scale)
    weights = [g.symbol(f"w{k}") for k in range(len(rows))]
    w = {f"w{k}": 0.3 * k - 0.4 for k in range(len(rows))}
    pulled = evaluate(vjp(rows, weights, x), twin.point | w)
    np.testing.assert_allclose(pulled, np.array(list(w.values())) @ matrix, atol=10 * scale)
    pushed = evaluate(jvp(rows, dict(zip(x, weights[:3], strict=True))), twin.point | w)
    np.testing.assert_allclose(pushed, matrix @ np.array(list(w.values()))[:3], atol=10 * scale)
    if not any(node[0] in ("min", "max", "select") for node in g.nodes):
        np.testing.assert_allclose(dense(_reverse_jacobian(g, roots, x)), matrix, atol=scale)
    assert symbols_of(rows) <= {"x", "y", "z"}


@given(data=st.data())
@settings(max_examples=40, deadline=None, derandomize=True)
def test_gradients_agree_with_differences(data, twins):
    smooth = tuple(
        n for n in ("add", "sub", "mul", "div", "sqrt", "exp", "log", "sin", "atan2", "pow", "inverse", "tanh")
    )
    twin = data.draw(twins(smooth, 8))
    h = 1e-5
    ours = evaluate(gradient(twin.expr, twin.symbols), twin.point)
    assume(max(map(abs, ours)) < 1e2)
    for name, slope in zip(twin.point, ours, strict=True):
        steps = twin.point[name] + h * np.array([-2.0, -1.0, 1.0, 2.0])
        values = np.broadcast_to(evaluate([twin.expr], {**twin.point, name: steps})[0], 4)
        assume(np.abs(values).max() < 1e2)
        fourth_order = values @ np.array([1.0, -8.0, 8.0, -1.0]) / (12 * h)
        assert slope == pytest.approx(fourth_order, rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("exponent", [1.5, 2.5, 4.5, 1.3])
@pytest.mark.parametrize("stiffness", ["k", 3.0])
def test_powers_of_a_depth_are_flat_where_it_is_zero(exponent: float, stiffness: str | float) -> None:
    """Contact laws k max(d, 0)^n: their slope is 0 at and before contact, not 0 times infinity."""
    g = Graph()
    d = g.symbol("d")
    k = g.symbol("k") if isinstance(stiffness, str) else g.constant(stiffness)
    force = k * g.apply("max", d, g.constant(0.0)) ** exponent
    for slope in (*gradient(force, [d]), *jvp([force], {d: g.one}), jacobian([force, d], [d])[0, 0]):
        assert [evaluate([slope], {"d": x, "k": 3.0})[0] for x in (-1.0, 0.0)] == [0.0, 0.0]
        for x in (1e-6, 0.7, 4.0):
            expected = 3.0 * exponent * x ** (exponent - 1)
            assert evaluate([slope], {"d": x, "k": 3.0})[0] == pytest.approx(expected, rel=1e-14)
