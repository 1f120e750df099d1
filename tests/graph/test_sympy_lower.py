import math
import subprocess
import sys

import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy.physics.mechanics import dynamicsymbols

from eomgen.errors import EomgenError
from eomgen.graph import Graph, count, evaluate
from eomgen.graph.sympy_lower import LoweringError, lower

x, y, z = sympy.symbols("x y z")
t = dynamicsymbols._t
q = dynamicsymbols("q")
HALF = sympy.Rational(1, 2)


def resolver(g, *names):
    return lambda s: g.symbol(s.name) if isinstance(s, sympy.Symbol) and s.name in names else None


def lowered(expr, **values):
    """Value of a SymPy expression through the graph."""
    g = Graph()
    return evaluate([lower(g, expr, resolver(g, *values))], values)[0]


EXPRESSIONS = [
    sympy.Integer(7),
    sympy.Rational(-1, 12),
    sympy.Float("0.1", 50),
    sympy.pi,
    sympy.E,
    sympy.GoldenRatio,
    sympy.EulerGamma,
    x + y + 3,
    x - y / 3,
    2 * x * y**2 / (3 * z),
    -x * y,
    x**-1,
    x**-3,
    x**7,
    x ** sympy.Rational(3, 2),
    1 / sympy.sqrt(x),
    x**y,
    x ** sympy.Rational(1, 3),
    sympy.sqrt(2) * x,
    sympy.exp(-x) / (1 + y),
    (x + y) ** 2 / (x * y * z) * (x - z) ** -2,
    sympy.sin(x),
    sympy.cos(x),
    sympy.tan(x),
    sympy.asin(x / 9),
    sympy.acos(x / 9),
    sympy.atan(x),
    sympy.atan2(y, -x),
    sympy.sinh(x),
    sympy.cosh(x),
    sympy.tanh(x),
    sympy.exp(x),
    sympy.log(x),
    sympy.log(x, 10),
    sympy.sqrt(x * y),
    sympy.sec(x),
    sympy.csc(x),
    sympy.cot(x),
    sympy.sech(x),
    sympy.csch(x),
    sympy.coth(x),
    sympy.Abs(x - 2 * y),
    sympy.sign(x - y),
    sympy.Min(x, y, z),
    sympy.Max(x, y, z, 1),
    sympy.Min(x, sympy.Max(y, 2)),
    sympy.Heaviside(x - y),
    sympy.Heaviside(y - x),
    sympy.Heaviside(x - y, 1),
    sympy.Piecewise((x, x < y), (y, x < 2 * y), (z, True)),
    sympy.Piecewise((x, x > y), (y, True)),
    sympy.Piecewise((1, (x < y) & ((x > 0) | ~(y < z))), (2, sympy.Eq(x, y)), (3, sympy.Ne(x, y)), (0, True)),
    sympy.Piecewise((1, sympy.Xor(x < y, y < z)), (2, True)),
    sympy.Piecewise((1, sympy.ITE(x < y, x > z, y < z)), (2, True)),
    sympy.Piecewise((1, sympy.Implies(x < y, y < z, evaluate=False)), (2, True)),
    sympy.besselj(0, 1) * x,
    sympy.gamma(sympy.Rational(1, 3)) + x,
    sympy.re(x) + sympy.im(x) + sympy.conjugate(y),
    sympy.Subs(sympy.Derivative(sympy.sin(z), z), z, x * y),
    sympy.Derivative(x**3 * y, x),
]


@pytest.mark.parametrize("expr", EXPRESSIONS, ids=str)
@pytest.mark.parametrize("point", [(0.7, 1.3, 0.4), (2.5, 2.0, 3.5)])
def test_values_agree_with_sympy(expr, point):
    values = dict(zip("xyz", point, strict=True))
    exact = expr.doit().subs({s: sympy.Rational(v) for s, v in zip((x, y, z), point, strict=True)})
    assert lowered(expr, **values) == pytest.approx(float(exact.evalf(30)), rel=1e-14)


@pytest.mark.parametrize(
    ("number", "double"),
    [
        (sympy.Float("0.1", 50), 0.1),
        (sympy.Float("0.1", 15), 0.1),
        (
            sympy.Float("1.00000000000000011102230246251565404236316680908203126", 60),
            1.0000000000000002,
        ),  # ties upwards
        (sympy.Float("1e-400", 20), 0.0),
        (sympy.Float("-2.5e-300", 20), -2.5e-300),
        (sympy.Rational(1, 3), 1 / 3),
        (sympy.Integer(10) ** 22 + 1, 1e22),
        (sympy.pi, math.pi),
        (sympy.E, math.e),
    ],
)
def test_numbers_become_the_nearest_double(number, double):
    assert lower(Graph(), number, lambda s: None).value == double


def test_python_numbers_pass():
    g = Graph()
    assert lower(g, 3, lambda s: None).value == 3.0
    assert lower(g, 0.1, lambda s: None).value == 0.1


def test_heaviside_at_its_step():
    assert lowered(sympy.Heaviside(x), x=0.0) == 0.5
    assert lowered(sympy.Heaviside(x, sympy.Rational(1, 4)), x=0.0) == 0.25
    assert lowered(sympy.Heaviside(x, 0), x=0.0) == 0.0


def test_operations_are_few():
    g = Graph()

    def operations(expr):
        return count([lower(g, expr, resolver(g, "x", "y", "z"))])

    cube = operations(x**3)
    assert (cube.multiplications, cube.functions) == (2, {})
    fraction = operations(2 * x / (y * z))
    assert (fraction.divisions, fraction.multiplications) == (1, 2)
    assert operations(-x - y).total == 1
    assert operations(sympy.sqrt(x) + 1 / sympy.sqrt(x)).functions == {"sqrt": 1}


def test_functions_of_time_and_their_derivatives_are_resolved():
    g = Graph()
    table = {q: g.symbol("q"), q.diff(t): g.symbol("q_dot"), q.diff(t, 2): g.symbol("q_ddot")}
    expr = sympy.sin(q) * q.diff(t, 2) + q.diff(t) ** 2 + sympy.Derivative(q**2, t)
    values = {"q": 0.3, "q_dot": -1.2, "q_ddot": 2.0}
    expected = math.sin(0.3) * 2.0 + 1.44 - 2 * 0.3 * 1.2
    assert evaluate([lower(g, expr, table.get)], values) == [pytest.approx(expected, rel=1e-15)]
    with pytest.raises(LoweringError) as caught:
        lower(g, q.diff(t, 3) + q, table.get)
    assert caught.value.unresolved == (q.diff(t, 3),)


def test_own_functions_can_be_resolved():
    g = Graph()
    spline = sympy.Function("spline")
    result = lower(g, 2 * spline(x), lambda s: g.symbol("s") if isinstance(s, spline) else None)
    assert result == 2 * g.symbol("s")


def test_all_unknown_symbols_are_named_at_once():
    g = Graph()
    f = sympy.Function("f")
    with pytest.raises(LoweringError) as caught:
        lower(g, x * z + sympy.sin(y) + f(z), resolver(g, "x"), allowed=["x", "mass"])
    assert set(caught.value.unresolved) == {y, z, f(z)}
    assert "unknown names f(z), y, z; known are mass, x" in caught.value.reason
    assert isinstance(caught.value, EomgenError)


@pytest.mark.parametrize(
    ("expr", "at", "words"),
    [
        (sympy.I * x, sympy.I, "complex"),
        (sympy.sqrt(-2) * x, sympy.I, "complex"),
        (x + sympy.oo, sympy.oo, "infinities"),
        (sympy.nan, sympy.nan, "infinities"),
        (sympy.zoo, sympy.zoo, "complex"),
        (sympy.gamma(x), sympy.gamma(x), "gamma cannot be translated"),
        (sympy.floor(x), sympy.floor(x), "floor cannot be translated"),
        (sympy.Integral(sympy.sin(x**x), x), sympy.Integral(sympy.sin(x**x), x), "Integral cannot be translated"),
        (sympy.Integer(10) ** 400, sympy.Integer(10) ** 400, "too large"),
        (sympy.Float("1e400"), sympy.Float("1e400"), "too large"),
        (sympy.Piecewise((x, x < 1), (2 * x, x < 3)), None, "last piece .2.x if x < 3. leaves"),
        (sympy.Matrix([x]), sympy.Matrix([x]), "a SymPy scalar"),
        (sympy.MatrixSymbol("A", 2, 2), sympy.MatrixSymbol("A", 2, 2), "MatrixSymbol cannot be translated"),
        ("x + 1", "x + 1", "a SymPy scalar is expected, not str"),
    ],
    ids=str,
)
def test_what_has_no_meaning_is_refused(expr, at, words):
    g = Graph()
    with pytest.raises(LoweringError, match=words) as caught:
        lower(g, expr, resolver(g, "x"))
    assert caught.value.expression == (expr if at is None else at)


def test_deep_expressions_need_no_recursion():
    expr = x
    for _ in range(20_000):
        expr = sympy.Pow(sympy.Add(expr, y, evaluate=False), 1, evaluate=False)
        hash(expr)
    g = Graph()
    result = lower(g, expr, resolver(g, "x", "y"))
    assert evaluate([result], {"x": 1.0, "y": 0.5}) == [10_001.0]


def test_shared_parts_are_visited_once():
    expr = x
    for _ in range(200):  # 2^200 terms written out
        expr = sympy.Add(sympy.Mul(expr, expr, evaluate=False), expr, evaluate=False)
    g = Graph()
    assert count([lower(g, expr, resolver(g, "x"))]).total == 400


def test_big_expressions_agree_with_sympy():
    symbols = sympy.symbols("x y z u v")
    expr = sympy.expand((sum(symbols) + sympy.sin(x) + sympy.Rational(1, 3)) ** 6).diff(x)  # 462 terms and more
    values = {s.name: 0.1 + 0.17 * k for k, s in enumerate(symbols)}
    exact = expr.subs({s: sympy.Rational(values[s.name]) for s in symbols}).evalf(30)
    assert lowered(expr, **values) == pytest.approx(float(exact), rel=1e-13)


@given(data=st.data())
@settings(max_examples=80, deadline=None, derandomize=True)
def test_random_expressions_agree_with_sympy(data, twins):
    twin = data.draw(twins(size=12))
    expected = twin.sympy_value(twin.sympy_expr)
    assert lowered(twin.sympy_expr, **twin.point) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_the_graph_does_not_load_sympy():
    code = "import sys, eomgen.graph; sys.exit('sympy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
