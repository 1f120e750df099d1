"""Random expressions: each recipe is built twice, in a graph and (independently) in SymPy."""

from dataclasses import dataclass

import pytest
import sympy
from hypothesis import strategies as st

from eomgen.graph import Expr, Graph

HALF = sympy.Rational(1, 2)
NAMES = ("x", "y", "z")

# operation -> (number of operands, graph version, SymPy version); domains are kept by construction
RECIPES = {
    "add": (2, lambda g, a, b: a + b, lambda a, b: a + b),
    "sub": (2, lambda g, a, b: a - b, lambda a, b: a - b),
    "mul": (2, lambda g, a, b: a * b, lambda a, b: a * b),
    "div": (2, lambda g, a, b: a / (b * b + 0.5), lambda a, b: a / (b**2 + HALF)),
    "neg": (1, lambda g, a: -a, lambda a: -a),
    "scale": (1, lambda g, a: a * 0.75 - 3.0, lambda a: a * sympy.Rational(3, 4) - 3),
    "third": (1, lambda g, a: a / 3, lambda a: a / 3),
    "square": (1, lambda g, a: a**2, lambda a: a**2),
    "inverse": (1, lambda g, a: (a**2 + 1.25) ** -1.5, lambda a: (a**2 + 5 * HALF**2) ** (-3 * HALF)),
    "sqrt": (1, lambda g, a: (a * a + 0.25) ** 0.5, lambda a: sympy.sqrt(a**2 + sympy.Rational(1, 4))),
    "exp": (1, lambda g, a: g.apply("exp", g.apply("sin", a)), lambda a: sympy.exp(sympy.sin(a))),
    "log": (1, lambda g, a: g.apply("log", a * a + 1), lambda a: sympy.log(a**2 + 1)),
    "sin": (1, lambda g, a: g.apply("sin", a), sympy.sin),
    "cos": (1, lambda g, a: g.apply("cos", a), sympy.cos),
    "tan": (1, lambda g, a: g.apply("tan", g.apply("sin", a)), lambda a: sympy.tan(sympy.sin(a))),
    "asin": (1, lambda g, a: g.apply("asin", g.apply("tanh", a) * 0.5), lambda a: sympy.asin(sympy.tanh(a) / 2)),
    "acos": (1, lambda g, a: g.apply("acos", g.apply("cos", a) * 0.5), lambda a: sympy.acos(sympy.cos(a) / 2)),
    "atan": (1, lambda g, a: g.apply("atan", a), sympy.atan),
    "sinh": (1, lambda g, a: g.apply("sinh", g.apply("sin", a)), lambda a: sympy.sinh(sympy.sin(a))),
    "cosh": (1, lambda g, a: g.apply("cosh", g.apply("sin", a)), lambda a: sympy.cosh(sympy.sin(a))),
    "tanh": (1, lambda g, a: g.apply("tanh", a), sympy.tanh),
    "atan2": (2, lambda g, a, b: g.apply("atan2", a, b * b + 0.5), lambda a, b: sympy.atan2(a, b**2 + HALF)),
    "pow": (
        2,
        lambda g, a, b: (g.apply("sin", a) + 2) ** g.apply("cos", b),
        lambda a, b: (sympy.sin(a) + 2) ** sympy.cos(b),
    ),
    "abs": (1, lambda g, a: g.apply("abs", a), sympy.Abs),
    "sign": (1, lambda g, a: g.apply("sign", a), sympy.sign),
    "min": (2, lambda g, a, b: g.apply("min", a, b), sympy.Min),
    "max": (2, lambda g, a, b: g.apply("max", a, b), sympy.Max),
    "select": (
        3,
        lambda g, a, b, c: g.apply("select", g.apply("lt", a, b), b, c),
        lambda a, b, c: sympy.Piecewise((b, a < b), (c, True)),
    ),
    "logic": (
        3,
        lambda g, a, b, c: g.apply("select", g.apply("and", g.apply("le", a, b), g.apply("le", b, c)), a, c),
        lambda a, b, c: sympy.Piecewise((a, sympy.And(a <= b, c >= b)), (c, True)),
    ),
}


@dataclass
class Twin:
    """One random expression in a graph and in SymPy, with a point at which to look at it."""

    graph: Graph
    symbols: list[Expr]
    expr: Expr
    sympy_symbols: list[sympy.Symbol]
    sympy_expr: sympy.Expr
    point: dict[str, float]

    def sympy_value(self, expr: sympy.Expr) -> float:
        return float(expr.subs(self.sympy_point).evalf(40))

    @property
    def sympy_point(self) -> dict[sympy.Symbol, sympy.Rational]:
        return {s: sympy.Rational(self.point[s.name]) for s in self.sympy_symbols}


@st.composite
def _twins(draw: st.DrawFn, operations: tuple[str, ...] = tuple(RECIPES), size: int = 9) -> Twin:
    graph = Graph()
    symbols = [graph.symbol(n) for n in NAMES]
    sympy_symbols = [sympy.Symbol(n, real=True) for n in NAMES]
    pool = list(zip(symbols, sympy_symbols, strict=True))
    for _ in range(draw(st.integers(1, size))):
        arity, ours, theirs = RECIPES[draw(st.sampled_from(operations))]
        picked = [pool[draw(st.integers(0, len(pool) - 1))] for _ in range(arity)]
        pool.append((ours(graph, *(p[0] for p in picked)), theirs(*(p[1] for p in picked))))
    # odd numbers, so that no two parts are equal by chance where min, max and select have a kink
    point = {n: draw(st.integers(-6, 6)) * 0.3173 + 0.0711 * k + 0.0137 for k, n in enumerate(NAMES)}
    return Twin(graph, symbols, graph.lift(pool[-1][0]), sympy_symbols, sympy.Add(pool[-1][1], 0), point)


@pytest.fixture(scope="session")
def twins():
    """Strategy of Twin; call it with the operations to use."""
    return _twins
