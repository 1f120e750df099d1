import math

import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from eomgen.graph import Graph, evaluate
from eomgen.graph.sympy_lower import lower
from eomgen.graph.sympy_raise import inlined_size, raise_inline, raise_named
from eomgen.operations import OPERATIONS

X, Y = sympy.symbols("x y", real=True)
R = sympy.Rational


def real(name):
    return sympy.Symbol(name, real=True)


@pytest.fixture
def g():
    return Graph()


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (0.5, R(1, 2)),
        (1 / 12, R(1, 12)),
        (-1 / 3, R(-1, 3)),
        (9.81, R(981, 100)),
        (210e9, sympy.Integer(210000000000)),
        (math.pi, sympy.pi),
        (-math.pi / 2, -sympy.pi / 2),
        (2 * math.pi, 2 * sympy.pi),
        (math.radians(30), sympy.pi / 6),
        (0.1234567, sympy.Float(0.1234567)),
        (1e300, sympy.Float(1e300)),
        (5e-324, sympy.Float(5e-324)),
        (0.0, sympy.Integer(0)),
    ],
)
def test_numbers_come_back_exact(g, value, expected):
    (number,) = raise_inline([g.constant(value)])
    assert number == expected
    assert type(number) is type(expected)
    assert lower(g, number, lambda s: None).value == value


@given(value=st.floats(allow_nan=False, allow_infinity=False) | st.fractions(max_denominator=1000).map(float))
@settings(max_examples=300, deadline=None, derandomize=True)
def test_every_double_survives_the_way_there_and_back(value):
    g = Graph()
    (number,) = raise_inline([g.constant(value)])
    assert lower(g, number, lambda s: None).value == value


def test_expressions_read_as_written(g):
    x, y = g.symbol("x"), g.symbol("y")
    assert raise_inline([x * x * y / 2 - g.apply("sin", x) / y, 3 ** g.apply("abs", x)], real) == [
        X**2 * Y / 2 - sympy.sin(X) / Y,
        3 ** sympy.Abs(X),
    ]
    time = sympy.Symbol("t")
    q = sympy.Function("q")(time)
    assert raise_inline([x + 1], {"x": q}.__getitem__) == [q + 1]
    assert raise_inline([]) == []
    assert raise_named([]) == ([], [])


def test_conditions_read_as_conditions_and_count_as_numbers(g):
    x, y = g.symbol("x"), g.symbol("y")
    less, equal = g.apply("lt", x, y), g.apply("eq", x, y)
    both = g.apply("and", less, g.apply("not", g.apply("le", x, g.zero)))
    exprs = [
        g.apply("select", both, x, y),
        less * x,
        g.apply("select", x, y, 1),
        g.apply("or", equal, x),
        g.apply("eq", less, equal),
    ]
    raised = raise_inline(exprs, real)
    assert raised[0] == sympy.Piecewise((X, (X < Y) & (X > 0)), (Y, True))
    assert raised[1] == X * sympy.Piecewise((1, X < Y), (0, True))
    for values in ({"x": 0.5, "y": 1.0}, {"x": 0.0, "y": 0.0}, {"x": 1.0, "y": 0.0}, {"x": -1.0, "y": 3.0}):
        again = [lower(g, r, lambda s: g.symbol(s.name)) for r in raised]
        assert evaluate(again, values) == evaluate(exprs, values)
        theirs = [float(r.subs({X: values["x"], Y: values["y"]})) for r in raised]
        assert theirs == evaluate(exprs, values)


def test_sizes_are_those_written_out(g):
    x = y = g.symbol("x")
    assert inlined_size([x]) == inlined_size([]) == 0
    assert inlined_size([x * x + 1, x * x]) == 3
    for _ in range(100):
        y = y * y + 1
    assert inlined_size([y]) == 10**9
    with pytest.raises(ValueError, match="raise_named"):
        raise_inline([y])


def test_names_for_what_is_shared(g):
    x, y, z0 = (g.symbol(n) for n in ("x", "y", "z0"))
    s = g.apply("sin", x + y)
    named, exprs = raise_named([s * s + z0, s, -s], real)
    z1 = real("z1")  # z0 is taken
    assert named == [(z1, sympy.sin(X + Y))]
    assert exprs == [z1**2 + real("z0"), z1, -z1]


def test_long_expressions_are_cut(g):
    x = y = g.symbol("x")
    for _ in range(150):
        y = g.apply("sin", y + x) * 1.25
    named, (last,) = raise_named([y], real, prefix="a")
    assert len(named) >= 5
    assert max(sympy.count_ops(e) for _, e in named) <= 100
    values = {X: 0.3}
    for name, expr in named:
        values[name] = float(expr.subs(values))
    assert float(last.subs(values)) == pytest.approx(evaluate([y], {"x": 0.3})[0], rel=1e-12)


def test_every_operation_can_be_raised(g):
    x, y = g.symbol("x"), g.symbol("y")
    operands = [x, y, x + y]
    given = {"acosh": [x + 1.0]}  # within its domain
    exprs = [g.apply(op, *given.get(op, operands)[: OPERATIONS[op].arity]) for op in OPERATIONS]
    values = {"x": 0.7, "y": 0.3}
    raised = raise_inline(exprs, real)
    exact = {X: R(values["x"]), Y: R(values["y"])}
    theirs = [float(sympy.Piecewise((r, True)).subs(exact).evalf(30)) for r in raised]
    assert theirs == pytest.approx(evaluate(exprs, values), rel=1e-14)


def error_bound(expr, values):
    """Bound of the rounding error of a value: SymPy may reorder any sum or product, each in its own way."""
    g = expr.graph
    ids = [i for i in range(expr.id + 1) if g.nodes[i][0] not in ("const", "sym")]
    parts = evaluate([type(expr)(g, i) for i in ids], values)
    return 1e-13 * (1 + sum(map(abs, parts))) * len(ids)


@given(data=st.data())
@settings(max_examples=80, deadline=None, derandomize=True)
def test_there_and_back_keeps_the_value(data, twins):
    twin = data.draw(twins(size=10))
    g, expr = twin.graph, twin.expr
    value = evaluate([expr], twin.point)[0]
    bound = error_bound(expr, twin.point) if expr.node[0] not in ("const", "sym") else 0.0
    (raised,) = raise_inline([expr], real)
    again = lower(g, raised, lambda s: g.symbol(s.name))
    assert evaluate([again], twin.point)[0] == pytest.approx(value, rel=1e-14, abs=bound)
    named, (last,) = raise_named([expr], real, limit=4)
    meaning = {}
    for name, part in named:
        meaning[name] = lower(g, part, lambda s: meaning[s] if s in meaning else g.symbol(s.name))
    again = lower(g, last, lambda s: meaning[s] if s in meaning else g.symbol(s.name))
    assert evaluate([again], twin.point)[0] == pytest.approx(value, rel=1e-14, abs=bound)


@given(data=st.data())
@settings(max_examples=60, deadline=None, derandomize=True)
def test_benign_expressions_come_back_to_the_last_digits(data, twins):
    """Without cancellation, reordering costs at most a few units in the last place."""
    twin = data.draw(twins(("mul", "div", "third", "square", "inverse", "sqrt", "atan", "tanh", "log"), 10))
    g, expr = twin.graph, twin.expr
    point = {n: abs(v) + 0.25 for n, v in twin.point.items()}
    (raised,) = raise_inline([expr], real)
    again = lower(g, raised, lambda s: g.symbol(s.name))
    ours, back = evaluate([expr, again], point)
    assert math.isclose(ours, back, rel_tol=64 * 2.0**-52)
