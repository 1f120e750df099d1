"""Texts of expressions: the meaning is Python's, slips of typing are told, and nothing but arithmetic is let in."""

import ast
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from model_files import load
from refusals import refused, refuses

import eomgen as eg

NAMES = {"a": 1.25, "b": -0.75, "c": 2.5, "theta_dot": 0.3, "t": 0.625}


def model(texts: Sequence[Any]) -> eg.Model:
    """A wheel whose outputs are expressions of these names."""
    m = eg.Model("m")
    for name in "abc":
        m.parameter(name, NAMES[name])
    m.revolute("theta", m.ground, m.body("wheel", mass=1, inertia={"zz": 1}))
    for k, text in enumerate(texts):
        m.output(f"out{k}", text)
    return m


def values(texts: Sequence[Any]) -> list[float]:
    module = model(texts).compile(target="numpy", kernels=["outputs"])
    return [float(x) for x in module.outputs(NAMES["t"], [0.0, NAMES["theta_dot"]])]


def faults(texts: Sequence[str]) -> list[Any]:
    """What is wrong with each text; None if it is an expression."""
    try:
        model(texts).check()
    except eg.ModelError as error:
        told = {p.path: p for p in error.problems}
        return [told.get(f"outputs.out{k}.expression") for k in range(len(texts))]
    return [None] * len(texts)


def column(problem: Any) -> int:
    return int(problem.message.rpartition(" in column ")[2].split()[0])


MEANING = {
    "-a**2": -(1.25**2),
    "2**3**2": 512.0,
    "a - b - c": 1.25 + 0.75 - 2.5,
    "a / c * b": 1.25 / 2.5 * -0.75,
    "1 if a < b else 3": 3.0,
    "b < a < c": 1.0,
    "b < c < a": 0.0,  # not "or"
    "not a < b and c != 0": 1.0,
    "a == 1.25 or 1 / (a - a + 1) > 5": 1.0,
    "where(a >= 1.25, c, b)": 2.5,
    "min(a, b, c) + max(a, b, c)": 1.75,
    "heaviside(a) + heaviside(b) + heaviside(0)": 1.5,
    "sign(b) * abs(b)": -0.75,
    "atan2(1, -1)": math.atan2(1, -1),
    "sqrt(c) + exp(b) + log(a)": math.sqrt(2.5) + math.exp(-0.75) + math.log(1.25),
    "cos(pi) + theta_dot": -0.7,
    "  a\n  + 1_000e-3": 2.25,
    "0x10 + 1e2": 116.0,
    "deg(30)": math.pi / 6,
    "+".join(["a"] * 500): 625.0,
    "(" * 55 + "a" + ")" * 55: 1.25,
}


@pytest.mark.quick
def test_meaning() -> None:
    assert values(list(MEANING)) == pytest.approx(list(MEANING.values()), rel=1e-14)


a, b = sympy.symbols("a b")
OF_SYMPY = {
    a**2 / 3 - sympy.sqrt(a) * sympy.pi: 1.25**2 / 3 - math.sqrt(1.25) * math.pi,
    sympy.Max(a, b, 1) + sympy.Min(a, -b): 2.0,
    sympy.Abs(b) * sympy.sign(b) + sympy.Heaviside(a - b): 0.25,
    sympy.Piecewise((a, sympy.And(a > 2, b < 1)), (b, sympy.Or(sympy.Eq(a, 1), ~(b >= 2))), (3, True)): -0.75,
    sympy.E + sympy.log(a) + sympy.atan2(b, a) + sympy.tanh(a) ** -2: (
        math.e + math.log(1.25) + math.atan2(-0.75, 1.25) + math.tanh(1.25) ** -2
    ),
    sympy.Float(0.1) + sympy.Float(1e-30) * a: 0.1,
}


def test_expressions_of_sympy_are_written_as_texts(tmp_path: Path) -> None:
    assert values(list(OF_SYMPY)) == pytest.approx(list(OF_SYMPY.values()), rel=1e-14)
    again = load(tmp_path, model(list(OF_SYMPY)).to_yaml()).compile(target="numpy", kernels=["outputs"])
    assert again.outputs(0.0, [0.0, 0.0]) == pytest.approx(list(OF_SYMPY.values()), rel=1e-14)
    for wrong in (sympy.gamma(a), sympy.Integral(a, a), sympy.Piecewise((a, a > 0)), sympy.I * a, sympy.oo):
        with pytest.raises((eg.UsageError, eg.ModelError)):
            model([wrong]).to_yaml()
    long = sympy.expand((a + b) ** 60) + sympy.gamma(a)
    with refused("EG-UNSUPPORTED gamma") as caught:
        model([long]).to_yaml()
    assert len(str(caught.value)) < 400


# -- Python's arithmetic ----------------------------------------------------------------------------------------------
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


def expected(tree: Tree) -> float | None:
    """Its value by Python; None where there is none, or where roundings decide it."""
    try:
        found = tree.compute(NAMES)
        nearby = [tree.compute({k: x * (1 + s) for k, x in NAMES.items()}) for s in (1e-9, -1e-9)]
    except (ArithmeticError, ValueError):
        return None
    sure = math.isfinite(found) and abs(found) < 1e9
    return found if sure and all(abs(x - found) <= 1e-6 * (1 + abs(found)) for x in nearby) else None


@settings(max_examples=10, deadline=None)
@given(st.lists(trees, min_size=30, max_size=30))
def test_arithmetic_is_pythons(drawn: list[Tree]) -> None:
    """Python prints the trees with its own precedence, and computes them with its own floats."""
    wanted = {ast.unparse(ast.Expression(tree.node)): x for tree in drawn if (x := expected(tree)) is not None}
    for text, fault in zip(wanted, faults(list(wanted)), strict=True):
        if fault:  # both branches of a conditional are read, Python takes one
            assert "division by zero" in fault.message or "not a finite" in fault.message
            wanted = {other: x for other, x in wanted.items() if other != text}
    assert values(list(wanted)) == pytest.approx(list(wanted.values()), rel=1e-6, abs=1e-6)


@settings(max_examples=10, deadline=None)
@given(st.lists(st.text("ab(),.+-*/<>=!0123456789 eisfnotlambdx_:'\"[]{}^%@#", max_size=40), min_size=30, max_size=30))
def test_any_text_is_read_or_refused(texts: list[str]) -> None:
    """Whatever the text, the outcome is an expression or a fault that says where."""
    for text, fault in zip(texts, faults(texts), strict=True):
        assert fault is None or "column" not in fault.message or 1 <= column(fault) <= len(text) + 1


# -- what is refused --------------------------------------------------------------------------------------------------
HOSTILE = [
    "__import__('os').system('touch {canary}')", "open('{canary}', 'w')",
    "().__class__.__bases__[0].__subclasses__()", "a.__class__", "a[0]", "[a for a in (1, 2)]", "(a for a in b)",
    "{a: b}", "lambda: a", "(a := 3)", "f'{a}'", "'a' * 9", "*a", "a, b", "await a", "yield a", "print(a)", "exec(a)",
    "getattr(a, b)", "sin(x=a)", "sin(**a)", "sin(a)(b)", "sin", "9**9**9", "2**1001", "1e400", "1" * 3000, "1j",
    "True", "None", "...", "a % b", "a ^ b", "a & b", "~a", "a << b", "a is b", "a in b", "a if b", "a = b", "a; b",
    "import os", "a # b", "a \\ b", "\u03b8 + 1", "a + \u200b1", "", "1/0", "a/(b - b)", "log(0)", "sqrt(-1)",
    "(-8)**(1/3)", "1e308*10", "sin()", "min(a)", "where(a, b)", "(" * 300 + "a" + ")" * 300, "-" * 3000 + "a",
    "not " * 900 + "a", "sin(" * 100 + "a" + ")" * 100, "a**" * 500 + "a", "a+" * 1990 + "a", "a" * 4001,
]  # fmt: skip

_watching: list[str] | None = None


def _watch(event: str, _arguments: object) -> None:
    if _watching is not None and event in ("exec", "open", "os.system", "subprocess.Popen", "import", "os.exec"):
        _watching.append(event)


@contextmanager
def watched() -> Iterator[list[str]]:
    """What the interpreter executes, opens or imports meanwhile."""
    global _watching
    _watching = seen = []
    try:
        yield seen
    finally:
        _watching = None


def test_hostile_text_is_refused_and_nothing_runs(tmp_path: Path) -> None:
    sys.addaudithook(_watch)
    canary = tmp_path / "canary"
    texts = [text.replace("{canary}", str(canary)) for text in HOSTILE]
    wrong = model(texts)
    faults(["a +"])  # whatever the first refusal imports is loaded by now
    with watched() as seen, pytest.raises(eg.ModelError) as caught:
        wrong.check()
    assert seen == []
    assert not canary.exists()
    told = {p.path: p for p in caught.value.problems}
    missed = [text[:40] for k, text in enumerate(texts) if f"outputs.out{k}.expression" not in told]
    assert missed == []
    assert all(p.message for p in told.values())


#: What is typed -> the column that the message points at, and what it says to write.
SLIPS = {
    "2pi*A": (1, "* / ** between"), "2(a + b)": (1, "* / ** between"), "(a + b)(2)": (1, "* / ** between"),
    "3 mm": (3, "no units"), "5 N*m": (3, "no units"), "0.5m": (3, "no units"), "9.81 m/s^2": (9, "** for powers"),
    "10 %": (4, "remainder"), "30°": (3, "deg(30)"), "sin(30°)": (7, "deg(30)"), "deg 30": (5, "functions"),
    "1,5": (1, "such as 1.5"), "2,5*a": (1, "such as 1.5"), "2e3.5": (4, "numbers"), "1 000": (3, "numbers"),
    "1.5.2": (4, "numbers"), "a^2": (2, "**"), "a²": (2, "**"), "\u22123": (1, "+ -"), "√2": (1, "sqrt"),
    "µ*a": (1, "names"), "|a|": (1, "abs(a)"), "a b": (3, "between"), "a**": (4, "**"), "a = 2": (1, "comparisons"),
    "a//b": (1, "/ for"), "arctan(a)": (1, "'atan'"), "2*(a": (3, "bracket"),
}  # fmt: skip


@pytest.mark.quick
def test_a_slip_is_reported_with_what_to_write() -> None:
    for text, fault in zip(SLIPS, faults(list(SLIPS)), strict=True):
        place, remedy = SLIPS[text]
        assert (fault.code, column(fault)) == ("EG-EXPRESSION", place), text
        assert remedy in fault.remedy, text
    assert "did you mean 'pi'?" in faults(["PI"])[0].remedy


def test_markers_only_where_they_can_be_located() -> None:
    assert values(["x(wheel) + vx(wheel) + ax(wheel)"]) == [0.0]
    for text in ("x(wheel.rim.end)", "x(1)", "x()", "x(a, b)", "x(sin(a))", "wheel.rim", "x(a, at=b)", "sin(a, in=b)"):
        assert faults([text])[0] is not None, text
    m = model([])
    m.body("other", mass="x(wheel)")
    refuses("EG-EXPRESSION bodies.other.mass", m.check)
