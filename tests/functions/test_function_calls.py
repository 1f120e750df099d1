"""Calls of declared functions on the graph: values, chain rule, counts, hoisting, SymPy both ways, texts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy

import eomgen as eg
from eomgen.describe.expressions import parse
from eomgen.errors import ExpressionError, ModelError
from eomgen.graph import Expr, Graph, count, evaluate, gradient, jacobian, jvp, substitute
from eomgen.graph.functions import Function
from eomgen.graph.sympy_lower import LoweringError, lower
from eomgen.graph.sympy_raise import raise_inline, raise_named
from eomgen.numeric.user_functions import Twin, difference_step

TEXTS = [
    "f(x)",
    "f(2*x + y)*h(x, y)",
    "h(x*y, x)",
    "h(x, x) + f(f(x))",
    "w(x, y, x*y, x, 2) - f(x)**2",
    "sin(f(x))*exp(-h(y, f(x)))",
    "max(f(x), h(x, y))",
    "diff(f(x*y), 1) + diff(h(x, y), 1, 1)",
]


@pytest.fixture
def graph() -> Graph:
    """A graph that knows f, h and w by formulas of their own."""
    a, b, c, d, e = symbols = sympy.symbols("a b c d e")
    g = Graph()
    g.declare(declared("f", (a,), a**3 - 2 * a))
    g.declare(declared("h", (a, b), sympy.sin(a) * b**2 + a * b))
    g.declare(declared("w", symbols, a * b * c + d**2 * e + a * a * d))
    return g


def declared(name: str, symbols: tuple[Any, ...], formula: Any) -> Function:
    orders = [o for o in np.ndindex(*[4] * len(symbols)) if sum(o) <= 3]
    functions = {
        o: sympy.lambdify(
            symbols,
            formula.diff(*[(s, k) for s, k in zip(symbols, o, strict=True) if k]) if any(o) else formula,
            "math",
        )
        for o in orders
    }
    return Function(name, len(symbols), Twin(functions))


def written_out(text: str) -> Any:
    """The same expression as a formula of SymPy."""
    x, y = sympy.symbols("x y")
    u, v = sympy.symbols("u v")
    f = sympy.Lambda(u, u**3 - 2 * u)
    h = sympy.Lambda((u, v), sympy.sin(u) * v**2 + u * v)
    known = {
        "f(x)": f(x),
        "f(2*x + y)*h(x, y)": f(2 * x + y) * h(x, y),
        "h(x*y, x)": h(x * y, x),
        "h(x, x) + f(f(x))": h(x, x) + f(f(x)),
        "w(x, y, x*y, x, 2) - f(x)**2": x * y * x * y + 2 * x**2 + x**3 - f(x) ** 2,
        "sin(f(x))*exp(-h(y, f(x)))": sympy.sin(f(x)) * sympy.exp(-h(y, f(x))),
        "max(f(x), h(x, y))": sympy.Max(f(x), h(x, y)),
        "diff(f(x*y), 1) + diff(h(x, y), 1, 1)": 3 * (x * y) ** 2 - 2 + sympy.cos(x) * 2 * y + 1,
    }
    return known[text]


@pytest.mark.parametrize("text", TEXTS)
def test_values_and_derivatives_follow_the_chain_rule(graph: Graph, text: str) -> None:
    x, y = graph.symbol("x"), graph.symbol("y")
    e = parse(text, graph, graph.symbol)
    formula = written_out(text)
    at = {"x": 0.83, "y": -0.47}
    wrt = sympy.symbols("x y")
    slopes = gradient(e, [x, y])
    expected = [formula, *(formula.diff(s) for s in wrt)]
    assert np.allclose(evaluate([e, *slopes], at), [float(p.subs(at)) for p in expected], rtol=1e-13, atol=1e-13)
    second = [v for s in slopes for v in jvp([s], {x: graph.one, y: graph.constant(2.0)})]
    expected = [formula.diff(s, wrt[0]) + 2 * formula.diff(s, wrt[1]) for s in wrt]
    if "max" not in text:
        assert np.allclose(evaluate(second, at), [float(p.subs(at)) for p in expected], rtol=1e-12, atol=1e-12)
    assert {k: v.id for k, v in jacobian([e], [x, y]).items()}.keys() <= {(0, 0), (0, 1)}


@pytest.mark.parametrize("text", TEXTS)
def test_arrays_give_what_scalars_give(graph: Graph, text: str) -> None:
    e = parse(text, graph, graph.symbol)
    x, y = np.linspace(-1, 2, 7), 0.4
    (many,) = evaluate([e], {"x": x, "y": y})
    assert np.allclose(many, [evaluate([e], {"x": v, "y": y})[0] for v in x], rtol=1e-14)


@pytest.mark.parametrize("text", TEXTS)
def test_sympy_and_back(graph: Graph, text: str) -> None:
    x, y = graph.symbol("x"), graph.symbol("y")
    e = parse(text, graph, graph.symbol)
    slopes = gradient(e, [x, y])
    wanted = [e, *slopes, *gradient(slopes[0], [x, y])] if "max" not in text else [e, *slopes]
    at = {"x": 0.83, "y": -0.47}

    def resolve(part: Any) -> Expr | None:
        return graph.symbol(part.name) if part.is_Symbol else None

    back = [lower(graph, part, resolve) for part in raise_inline(wanted)]
    assert np.allclose(evaluate(back, at), evaluate(wanted, at), rtol=1e-12, atol=1e-12)
    named, parts = raise_named(wanted)
    assert all(sympy.latex(part) for part in (*parts, *(value for _, value in named)))
    ours = lower(graph, raise_inline([e])[0].diff(sympy.Symbol("x")), resolve)  # differentiated by SymPy
    if "max" not in text:
        assert np.allclose(evaluate([ours], at), evaluate([slopes[0]], at), rtol=1e-12, atol=1e-12)


def test_mixed_derivatives_at_one_point_are_told_apart(graph: Graph) -> None:
    x = graph.symbol("x")
    calls = [Expr(graph, graph.call(graph.functions["h"], o, [x.id, x.id])) for o in ((1, 2), (2, 1), (1, 1), (2, 0))]
    back = [lower(graph, part, lambda s: x if s.is_Symbol else None) for part in raise_inline(calls)]
    assert back == calls


def test_calls_are_counted_apart_and_shared(graph: Graph) -> None:
    x = graph.symbol("x")
    found = count([parse("f(x) + 2*f(x)", graph, graph.symbol), *gradient(parse("f(x)", graph, graph.symbol), [x])])
    assert found.functions == {"f(0)": 1, "f(1)": 1}
    assert found.multiplications == 1
    assert found.additions == 1


def test_arguments_are_substituted(graph: Graph) -> None:
    e = parse("h(x, y + 1)", graph, graph.symbol)
    (moved,) = substitute([e], {graph.symbol("x"): graph.constant(2.0)})
    assert moved == parse("h(2, y + 1)", graph, graph.symbol)


def test_differences_are_as_good_as_documented() -> None:
    twin = Twin({(0,): np.sin})
    x = np.linspace(-3, 3, 50)
    assert np.max(np.abs(twin(x, 1) - np.cos(x))) < 1e-9
    assert np.max(np.abs(twin(x, 2) + np.sin(x))) < 1e-7
    assert np.max(np.abs(Twin({(0,): np.sin, (1,): np.cos})(x, 2) + np.sin(x))) < 1e-9
    assert difference_step(1) == pytest.approx(6.06e-6, rel=1e-3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("f(x, y)", "f\\(\\) takes 1 argument, not 2"),
        ("h(x)", "h\\(\\) takes 2 arguments, not 1"),
        ("g(x)", "unknown function 'g'"),
        ("f", "'f' is a function"),
        ("f(x).real", "a dot can be used only for markers"),
        ("f(x=1)", "takes no keywords"),
        ("f(*x)", "'\\*' cannot be used"),
        ("diff(x, 1)", "takes a call of a declared function"),
        ("diff(sin(x), 1)", "takes a call of a declared function"),
        ("diff(h(x, y), 1)", "takes 2 order"),
        ("diff(f(x), 4)", "allowed: 0, 1, 2, 3"),
        ("diff(f(x), -1)", "takes 1 order"),
        ("diff(f(x), y)", "takes 1 order"),
        ("diff(f(x), True)", "takes 1 order"),
    ],
)
def test_calls_that_do_not_fit_are_refused(graph: Graph, text: str, message: str) -> None:
    with pytest.raises(ExpressionError, match=message):
        parse(text, graph, graph.symbol)


def test_sympy_calls_that_do_not_fit_are_refused(graph: Graph) -> None:
    x = sympy.Symbol("x")
    for wrong in (sympy.Function("f")(x, x), sympy.Function("g")(x)):
        with pytest.raises(LoweringError):
            lower(graph, wrong, lambda s: graph.symbol(s.name) if s.is_Symbol else None)


def test_calls_of_parameters_only_are_made_once() -> None:
    m = eg.Model("hoisting")
    stiffness = m.table("stiffness", [0, 1, 2, 3], [5.0, 7.0, 4.0, 4.5])
    m.prismatic("s", m.ground, m.body("b", mass=m.parameter("mass", 1.5)), axis="x")
    m.actuator("spring", "s", -stiffness(m.parameter("wear", 0.4)) * m.coordinate("s"))
    module = m.compile(target="numpy")
    operations = module.metadata["operations"]
    assert operations["precompute"]["functions"] == {"stiffness(0)": 1}
    assert operations["rhs"]["functions"] == {}
    assert module.bind(p={"wear": 3.0}).rhs(0.0, [1.0, 0.0])[1] == pytest.approx(-3.0)


def test_names_of_functions_belong_to_the_one_namespace() -> None:
    m = eg.Model("clash")
    m.parameter("f", 1.0)
    m.table("f", [0, 1], [0, 1])
    m.table("sin", [0, 1], [0, 1])
    m.table("vx", [0, 1], [0, 1])
    m.table("s", [0, 1], [0, 1])
    m.prismatic("s", m.ground, m.body("b", mass="f"), axis="x")
    with pytest.raises(ModelError) as caught:
        m.mechanism()
    text = str(caught.value)
    assert "functions.f: the name 'f' is already used by the parameter at parameters.f" in text
    assert "functions.sin: 'sin' is a built-in function" in text
    assert "functions.vx: 'vx' is a built-in name for the motion of a marker" in text
    assert "joints.s: the name 's' is already used by the function at functions.s" in text
    assert len(caught.value.problems) == 4


def test_a_lagrangian_calls_functions_too() -> None:
    q = sympy.Symbol("q")
    m = eg.Model.from_lagrangian("well", "q_dot**2/2 - V(q, k)", [q])
    grid = np.linspace(-2, 2, 21)
    m.table("V", grid, grid, np.outer(grid**3, grid))
    m.parameters["k"]
    m._description.sections["parameters"][0].values["value"] = 1.5
    module = m.compile(target="numpy")
    assert module.rhs(0.0, [0.7, 0.0])[1] == pytest.approx(-3 * 0.7**2 * 1.5, rel=1e-12)
