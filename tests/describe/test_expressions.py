"""Texts of expressions: the meaning is Python's, and nothing but arithmetic is let in."""

from __future__ import annotations

import ast
import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from eomgen.describe.expressions import DEPTH, LENGTH, names_in, parse
from eomgen.describe.marker_quantities import MarkerQuantity
from eomgen.errors import ExpressionError
from eomgen.graph import Graph, evaluate

NAMES = {"a": 1.25, "b": -0.75, "c": 2.5, "theta_dot": 0.3, "t": 0.625}


def value(text: str, names: dict[str, float] = NAMES) -> float:
    graph = Graph()
    return float(evaluate([parse(text, graph, graph.symbol)], names)[0])


def refusal(text: str) -> ExpressionError | None:
    """Why a text is refused; None if it is an expression."""
    graph = Graph()
    try:
        parse(text, graph, graph.symbol)
    except ExpressionError as error:
        return error
    return None


def fault(text: str) -> ExpressionError:
    graph = Graph()
    with pytest.raises(ExpressionError) as caught:
        parse(text, graph, graph.symbol)
    return caught.value


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("-a**2", -(1.25**2)),
        ("2**3**2", 512.0),
        ("a - b - c", 1.25 + 0.75 - 2.5),
        ("a / c * b", 1.25 / 2.5 * -0.75),
        ("1 if a < b else 3", 3.0),
        ("b < a < c", 1.0),
        ("not a < b and c != 0", 1.0),
        ("a == 1.25 or 1 / (a - a + 1) > 5", 1.0),
        ("where(a >= 1.25, c, b)", 2.5),
        ("min(a, b, c) + max(a, b, c)", 1.75),
        ("heaviside(a) + heaviside(b) + heaviside(0)", 1.5),
        ("sign(b) * abs(b)", -0.75),
        ("atan2(1, -1)", math.atan2(1, -1)),
        ("sqrt(c) + exp(b) + log(a)", math.sqrt(2.5) + math.exp(-0.75) + math.log(1.25)),
        ("cos(pi) + theta_dot", -0.7),
        ("  a\n  + 1_000e-3", 2.25),
        ("0x10 + 1e2", 116.0),
    ],
)
def test_meaning(text: str, expected: float) -> None:
    assert value(text) == pytest.approx(expected, rel=1e-15)


@dataclass(frozen=True)
class Tree:
    """Python's own syntax tree, and its value worked out beside it."""

    node: ast.expr
    compute: Callable[[dict[str, float]], float]


def _number(x: float) -> Tree:
    return Tree(ast.Constant(x), lambda names: float(x))


def _name(n: str) -> Tree:
    return Tree(ast.Name(n), lambda names: names[n])


BINARY: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: lambda x, y: x + y,
    ast.Sub: lambda x, y: x - y,
    ast.Mult: lambda x, y: x * y,
    ast.Div: lambda x, y: x / y,
}
COMPARE: dict[type[ast.cmpop], Callable[[float, float], bool]] = {
    ast.Lt: lambda x, y: x < y,
    ast.LtE: lambda x, y: x <= y,
    ast.Gt: lambda x, y: x > y,
    ast.GtE: lambda x, y: x >= y,
    ast.Eq: lambda x, y: x == y,
    ast.NotEq: lambda x, y: x != y,
}
CALLS: dict[str, Callable[[float], float]] = {
    f.__name__: f
    for f in (
        *(math.sin, math.cos, math.tan, math.asin, math.acos, math.atan, math.sinh, math.cosh, math.tanh),
        *(math.asinh, math.acosh, math.atanh),
    )
} | {"exp": math.exp, "log": math.log, "sqrt": math.sqrt, "abs": abs}


def _binary(parts: tuple[type[ast.operator], Tree, Tree]) -> Tree:
    kind, x, y = parts
    return Tree(ast.BinOp(x.node, kind(), y.node), lambda n: BINARY[kind](x.compute(n), y.compute(n)))


def _power(parts: tuple[Tree, int]) -> Tree:
    x, k = parts
    return Tree(ast.BinOp(x.node, ast.Pow(), ast.Constant(k)), lambda n: x.compute(n) ** k)


def _negative(x: Tree) -> Tree:
    return Tree(ast.UnaryOp(ast.USub(), x.node), lambda n: -x.compute(n))


def _call(parts: tuple[str, Tree]) -> Tree:
    f, x = parts
    return Tree(ast.Call(ast.Name(f), [x.node], []), lambda n: CALLS[f](x.compute(n)))


def _compare(parts: tuple[type[ast.cmpop], Tree, Tree]) -> Tree:
    kind, x, y = parts
    return Tree(ast.Compare(x.node, [kind()], [y.node]), lambda n: float(COMPARE[kind](x.compute(n), y.compute(n))))


def _either(parts: tuple[Tree, Tree, Tree]) -> Tree:
    c, x, y = parts
    return Tree(ast.IfExp(c.node, x.node, y.node), lambda n: x.compute(n) if c.compute(n) else y.compute(n))


leaves = st.sampled_from(sorted(NAMES)).map(_name) | st.sampled_from([0.5, 1, 2, 3, 0.125, 7, 10.0]).map(_number)
trees = st.recursive(
    leaves,
    lambda inner: (
        st.tuples(st.sampled_from(list(BINARY)), inner, inner).map(_binary)
        | st.tuples(inner, st.integers(0, 4)).map(_power)
        | inner.map(_negative)
        | st.tuples(st.sampled_from(list(CALLS)), inner).map(_call)
        | st.tuples(st.sampled_from(list(COMPARE)), inner, inner).map(_compare)
        | st.tuples(inner, inner, inner).map(_either)
    ),
    max_leaves=12,
)


@settings(max_examples=300, deadline=None)
@given(trees)
def test_arithmetic_is_pythons(tree: Tree) -> None:
    """Python prints the tree with its own precedence, and computes it with its own floats."""
    try:
        expected = tree.compute(NAMES)
        nearby = [tree.compute({k: x * (1 + s) for k, x in NAMES.items()}) for s in (1e-9, -1e-9)]
    except (ArithmeticError, ValueError):
        assume(False)
    assume(math.isfinite(expected) and abs(expected) < 1e9)
    assume(all(abs(x - expected) <= 1e-6 * (1 + abs(expected)) for x in nearby))  # roundings do not decide it
    text = ast.unparse(ast.Expression(tree.node))
    refused = refusal(text)
    if refused:  # both branches of a conditional are read, Python takes one
        assert "division by zero" in refused.message or "not a finite" in refused.message
        return
    assert value(text) == pytest.approx(expected, rel=1e-6, abs=1e-6), text


@settings(max_examples=300, deadline=None)
@given(st.text("ab(),.+-*/<>=!0123456789 eisfnotlambdx_:'\"[]{}^%@#", max_size=40))
def test_any_text_is_read_or_refused(text: str) -> None:
    """Whatever the text, the outcome is an expression or an ExpressionError that says where."""
    refused = refusal(text)
    assert refused is None or 1 <= refused.column <= len(text) + 1


HOSTILE = [
    "__import__('os').system('touch {canary}')",
    "open('{canary}', 'w')",
    "().__class__.__bases__[0].__subclasses__()",
    "a.__class__",
    "a.b.c",
    "a[0]",
    "[a for a in (1, 2)]",
    "(a for a in b)",
    "{a: b}",
    "{a, b}",
    "lambda: a",
    "(lambda: a)()",
    "(a := 3)",
    "f'{a}'",
    "'a' * 9",
    "b'a'",
    "*a",
    "a, b",
    "await a",
    "yield a",
    "yield from a",
    "print(a)",
    "exec(a)",
    "globals()",
    "getattr(a, b)",
    "sin(x=a)",
    "sin(*a)",
    "sin(**a)",
    "sin(a)(b)",
    "sin",
    "9**9**9",
    "9**9**9**9**9",
    "2**1001",
    "1e400",
    "1" * 3000,
    "1j",
    "True",
    "None",
    "...",
    "a % b",
    "a // b",
    "a @ b",
    "a ^ b",
    "a & b",
    "a | b",
    "~a",
    "a << b",
    "a is b",
    "a in b",
    "a if b",
    "a = b",
    "a; b",
    "import os",
    "del a",
    "return a",
    "a # b",
    "a \\ b",
    "\u03b8 + 1",
    "a + \u200b1",
    "",
    "   ",
    "1/0",
    "a/(b - b)",
    "log(0)",
    "sqrt(-1)",
    "(-8)**(1/3)",
    "1e308*10",
    "sin()",
    "min(a)",
    "where(a, b)",
    "x(a)",
    "(" * 300 + "a" + ")" * 300,
    "-" * 3000 + "a",
    "not " * 900 + "a",
    "sin(" * 100 + "a" + ")" * 100,
    "a**" * 500 + "a",
    "a+" * 1990 + "a",
    "a" * (LENGTH + 1),
]

_watching: list[str] | None = None


def _watch(event: str, _arguments: object) -> None:
    if _watching is not None and event in ("exec", "open", "os.system", "subprocess.Popen", "import", "os.exec"):
        _watching.append(event)


@pytest.fixture(scope="module", autouse=True)
def _audit() -> None:
    sys.addaudithook(_watch)


@contextmanager
def watched() -> Iterator[list[str]]:
    """What the interpreter executes, opens or imports meanwhile."""
    global _watching
    _watching = seen = []
    try:
        yield seen
    finally:
        _watching = None


@pytest.mark.parametrize("text", HOSTILE, ids=lambda text: text[:24])
def test_hostile_text_is_refused_and_nothing_runs(text: str, tmp_path: Path) -> None:
    canary = tmp_path / "canary"
    text = text.replace("{canary}", str(canary))
    fault("a +")  # whatever the first refusal imports is loaded by now
    with watched() as seen:
        error = fault(text)
    assert seen == []
    assert not canary.exists()
    assert error.message
    assert 1 <= error.column <= len(text) + 1


@pytest.mark.parametrize(
    ("text", "column", "words"),
    [
        ("a + b^2", 6, "write ** for powers"),
        ("a + foo(b)", 5, "unknown function 'foo'"),
        ("2*sine(a)", 3, "did you mean 'sin'?"),
        ("a + (b, c)", 5, "one expression"),
        ("a + x(rod.tip)", 5, "in outputs, events and the laws of force elements"),
        ("1 + cos(a, b)", 5, "takes 1 argument, not 2"),
        ("a +", 4, "not a valid expression"),
    ],
)
def test_faults_say_where_and_what_is_allowed(text: str, column: int, words: str) -> None:
    error = fault(text)
    assert error.column == column
    assert words in str(error)
    assert repr(text) in str(error)


def test_markers_only_where_they_can_be_located() -> None:
    graph = Graph()
    seen = []

    def locate(quantity: MarkerQuantity):
        seen.append(quantity)
        return graph.symbol(str(quantity))

    parse("vx(rod.tip) + z(slider) - x", graph, graph.symbol, locate)
    assert seen == [MarkerQuantity("vx", "rod.tip"), MarkerQuantity("z", "slider")]
    for text in ("x(rod.tip.end)", "x(1)", "x()", "x(a, b)", "x(sin(a))", "rod.tip", "x(a, at=b)", "sin(a, in=b)"):
        with pytest.raises(ExpressionError):
            parse(text, graph, graph.symbol, locate)


def test_long_sums_are_not_deep() -> None:
    assert value("+".join(["a"] * 500)) == 625.0
    assert value("(" * (DEPTH - 5) + "a" + ")" * (DEPTH - 5)) == 1.25


def test_names_in() -> None:
    assert names_in("m*l**2*theta_dot**2/2 + pi*m") == ["m", "l", "theta_dot"]
    assert names_in("m +") == []
