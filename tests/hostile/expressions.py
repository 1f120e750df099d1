"""Hostile texts where an expression is expected."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from eomgen.describe.expressions import parse
from eomgen.describe.marker_quantities import ElementQuantity, MarkerQuantity
from eomgen.describe.names import OF_ELEMENTS, QUANTITIES, function_words
from eomgen.errors import ExpressionError
from eomgen.graph.core import Expr, Graph
from eomgen.graph.differentiate import jacobian
from eomgen.graph.functions import Function

from .kind import trimmed
from .words import NUMBERS, TEXTS

NAMES = ("a", "b", "q", "q_dot", "t", "pi", "m_r", "x1", "unknown", "e", "E", "I", "j", "nan", "inf", "oo", "None")
OPERATORS = ("+", "-", "*", "/", "**", "<", "<=", ">", ">=", "==", "!=", " and ", " or ")
FOREIGN = ("//", "%", "@", "<<", ">>", "&", "|", "^", " is ", " in ", " not in ", ":=", "=", ",", ";", "->", "...", "!")
WRAPS = (
    "lambda: {}",
    "[{}]",
    "{{{}}}",
    "({},)",
    "({}).real",
    "[{} for a in b]",
    "({} for a in b)",
    "f'{{{}}}'",
    "await {}",
    "yield {}",
    "*{}",
    "{}[0]",
    "{}()",
    "{}(a=1)",
    "not {}",
    "~{}",
    "{}#",
    "import {}",
    "{}\n",
    "\n{}",
    "\t{}",
    "{}\\\n",
    "print({})",
    "eval('{}')",
    "{}.__class__",
    "{}:{}",
    "{} if {}",
    "x({})",
    "diff({}, 1)",
    "diff(f({}), {})",
    "-{}",
)
CALLED = (*function_words(), *QUANTITIES, *OF_ELEMENTS, "f", "g", "foo", "open", "exec", "gamma", "Sum", "sympify")
MARKERS = ("rod", "rod.tip", "com", "ground", "rod.tip.x", "1", "a b", "")


class Expressions:
    """Texts from a grammar of expressions, most of them broken somewhere."""

    name = "expressions"
    programs: frozenset[str] = frozenset()
    unjudged: tuple[type[Warning], ...] = ()

    def prepare(self, folder: Path) -> None:
        """Nothing."""

    def make(self, r: random.Random) -> str:
        text = expression(r, r.choice((1, 2, 2, 3, 3, 4, 6)))
        for _ in range(r.choice((0, 0, 0, 1, 1, 3))):
            text = disturbed(text, r)
        return text

    def build(self, case: Any) -> Any:
        return case

    def run(self, case: Any, folder: Path) -> str:
        graph = Graph()
        graph.declare(Function("f", 1, None))
        graph.declare(Function("g", 2, None))
        value = parse(case, graph, lambda name: known(graph, name), lambda of: located(graph, of))
        if value.value is None:
            jacobian([value], [graph.symbol("a"), graph.symbol("q")])
        return "fine"

    def smaller(self, case: Any) -> Iterator[str]:
        return trimmed(case)


def known(graph: Graph, name: str) -> Expr:
    if name.startswith("unknown"):
        raise ExpressionError(f"unknown name {name!r}")
    return graph.symbol(name)


def located(graph: Graph, quantity: MarkerQuantity | ElementQuantity) -> Expr:
    if isinstance(quantity, MarkerQuantity) and not set(quantity.markers) <= set(MARKERS):
        raise ExpressionError(f"no body {quantity.marker!r}")
    if isinstance(quantity, ElementQuantity) and quantity.element.startswith("unknown"):
        raise ExpressionError(f"no force element {quantity.element!r}")
    return graph.symbol(str(quantity))


def expression(r: random.Random, depth: int) -> str:
    """An expression of the grammar, with things that are none of it."""
    if depth <= 0:
        k = r.random()
        if k < 0.55:
            return r.choice(NAMES)
        return number(r) if k < 0.97 else r.choice(TEXTS)
    k = r.random()
    inner = lambda: expression(r, depth - 1 - r.randrange(2))  # noqa: E731
    if k < 0.40:
        operator = r.choice(OPERATORS if r.random() < 0.97 else FOREIGN)
        return f"{inner()}{operator}{inner()}" if r.random() < 0.5 else f"({inner()}){operator}({inner()})"
    if k < 0.72:
        name = r.choice(CALLED)
        if name in QUANTITIES and r.random() < 0.8:
            return f"{name}({seen(r)})"
        if name in OF_ELEMENTS and r.random() < 0.8:
            return f"{name}({r.choice(NAMES)})"
        least = function_words().get(name, (1, 1))[0]
        count = least if r.random() < 0.93 else r.choice((0, 1, 2, 3, 65))
        if name == "diff" and r.random() < 0.7:
            return f"diff(f({inner()}), {r.choice((0, 1, 2, 3, 4, -1, 'a', 1.0, 'True', 10**30))})"
        return f"{name}({', '.join(inner() for _ in range(count))})"
    if k < 0.80:
        return f"({inner()} if {inner()} else {inner()})"
    if k < 0.88:
        return f"-{inner()}" if r.random() < 0.7 else f"not {inner()}"
    if k < 0.92:
        return r.choice(WRAPS).replace("{}", inner())
    if k < 0.935:
        return long(r)
    return f"({inner()})"


def seen(r: random.Random) -> str:
    """One marker, or two, or one as others see it."""
    markers = [r.choice(MARKERS) for _ in range(r.choice((1, 1, 1, 2, 3)))]
    keys = [f"{r.choice(('from', 'in', 'at', ''))}={r.choice(MARKERS)}" for _ in range(r.choice((0, 0, 0, 1, 2)))]
    return ", ".join(markers + keys)


def number(r: random.Random) -> str:
    k = r.randrange(5)
    if k == 0:
        return str(r.randint(-9, 99))
    if k == 1:
        return repr(r.uniform(-10, 10))
    if k == 2:
        return f"{r.choice(('', '-'))}{r.randint(0, 10)}e{r.randint(-330, 330)}"
    return r.choice(NUMBERS)


def long(r: random.Random) -> str:
    """Long, deep or both: what the bounds are for."""
    n = r.choice((10, 59, 60, 61, 100, 900, 1999, 4000, 20000))
    one = r.choice(("a", "1", "1.5", "q"))
    return r.choice(
        (
            "(" * n + one + ")" * n,
            "-" * n + one,
            "not " * n + one,
            "+".join([one] * n),
            "*".join([one] * n),
            "**".join([one] * n),
            "/".join([one] * n),
            "sin(" * n + one + ")" * n,
            "<".join([one] * n),
            " and ".join([one] * n),
            one * n,
            f"max({','.join([one] * n)})",
            f"{one} if {one} else " * n + one,
            "(" * n,
            "[" * n,
            "a." * n + "b",
            "9" * n,
            "1e" + "9" * n,
            "0." + "0" * n + "1",
            "\n" * n + one,
            " " * n + one,
            f"f({'f(' * n}{one}{')' * n})",
            f"({one}+" * n + one + ")" * n,
            f"{one}-(" * n + one + ")" * n,
            f"{one}**({one}+" * n + one + ")" * n,
        )
    )


def disturbed(text: str, r: random.Random) -> str:
    """One place of a text changed."""
    k, at = r.randrange(6), r.randrange(len(text) + 1)
    if k == 0:
        return text[:at] + r.choice("()+-*/.,e9 _\\\"'\n\té\x00#[]{}:;=<>!&|^%@~`?$\u2028\ud800\U0001f600") + text[at:]
    if k == 1:
        return text[:at] + text[at + r.choice((1, 1, 2, 5)) :]
    if k == 2:
        return text[:at] + r.choice(TEXTS) + text[at:]
    if k == 3:
        return text[:at] + chr(r.choice((r.randrange(32), r.randrange(128, 0x3000), r.randrange(0x110000)))) + text[at:]
    if k == 4:
        return f"({text}){r.choice(OPERATORS)}{r.choice(NUMBERS)}"
    return text[:at] + text


KIND = Expressions()
