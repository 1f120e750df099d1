"""Hostile texts where an expression is expected: the output of a small model, which is checked and at times compiled."""

import random
from pathlib import Path
from typing import Any

from attack.runner import Kind
from attack.words import NUMBERS, TEXTS

import eomgen as eg

NAMES = (*"a b q q_dot t pi m_r x1".split() * 4, *"unknown e E I j nan inf oo None".split())
OPERATORS = ("+", "-", "*", "/", "**", "<", "<=", ">", ">=", "==", "!=", " and ", " or ")
FOREIGN = ("//", "%", "@", "<<", ">>", "&", "|", "^", " is ", " in ", " not in ", ":=", "=", ",", ";", "->", "...", "!")
WRAPS = (
    "lambda: {}", "[{}]", "{{{}}}", "({},)", "({}).real", "[{} for a in b]", "({} for a in b)", "f'{{{}}}'", "await {}",
    "yield {}", "*{}", "{}[0]", "{}()", "{}(a=1)", "not {}", "~{}", "{}#", "import {}", "{}\n", "\n{}", "\t{}", "{}\\\n",
    "print({})", "eval('{}')", "{}.__class__", "{}:{}", "{} if {}", "x({})", "diff({}, 1)", "diff(f({}), {})", "-{}",
)  # fmt: skip
#: Functions of expressions, with how many arguments; quantities of markers and of elements; what is none of these.
FUNCTIONS = {
    **dict.fromkeys(
        "sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh exp log sqrt abs sign heaviside f".split(), 1
    ),
    **dict.fromkeys("atan2 hypot min max diff".split(), 2),
    "where": 3,
}
QUANTITIES = (
    "x y z vx vy vz ax ay az wx wy wz wx_body wz_dot angle angle_rate distance distance_rate inertia_xy".split()
)
OF_ELEMENTS = "force length rate power".split()
CALLED = (*FUNCTIONS, *QUANTITIES, *OF_ELEMENTS, "foo", "open", "exec", "gamma", "Sum", "sympify")
MARKERS = ("rod", "rod.tip", "com", "ground", "rod.tip.x", "1", "a b", "")


class Expressions(Kind):
    """Texts from a grammar of expressions, most of them broken somewhere."""

    name = "expressions"

    def prepare(self, folder: Path) -> None:
        self.run("a*q*f(q) + 1 - force(k)*x(rod.tip) > b", folder)

    def make(self, r: random.Random) -> str:
        text = expression(r, r.choice((1, 2, 2, 3, 3, 4, 6)))
        for _ in range(r.choice((0, 0, 0, 1, 1, 3))):
            text = disturbed(text, r)
        return text

    def run(self, case: Any, folder: Path) -> str:
        m = eg.Model("held")
        for k, name in enumerate(("a", "b", "m_r", "x1")):
            m.parameter(name, k + 1.0)
        m.table("f", [0, 1, 2], [0, 1, 0], kind="cubic")
        rod = m.body("rod", mass=1, com=(0, 1, 0))
        rod.marker("tip", at=(0, 2, 0))
        m.revolute("hinge", m.ground, rod, coordinate="q")
        m.spring("k", m.ground.at(0, 3, 0), "rod.tip", stiffness=2)
        m.output("given", case)
        m.mechanism()
        if len(case) % 50 == 1:
            m.compile(target="numpy", kernels=["outputs"])
        return "fine"


def expression(r: random.Random, depth: int) -> str:
    """An expression of the grammar, with things that are none of it."""
    k = r.random()
    if depth <= 0:
        if k < 0.55:
            return r.choice(NAMES)
        return number(r) if k < 0.97 else r.choice(TEXTS)

    def inner() -> str:
        return expression(r, depth - 1 - r.randrange(2))

    if k < 0.40:
        operator = r.choice(OPERATORS if r.random() < 0.97 else FOREIGN)
        return f"{inner()}{operator}{inner()}" if r.random() < 0.5 else f"({inner()}){operator}({inner()})"
    if k < 0.72:
        name = r.choice(CALLED)
        if name in QUANTITIES and r.random() < 0.8:
            return f"{name}({seen(r)})"
        if name in OF_ELEMENTS and r.random() < 0.8:
            return f"{name}({r.choice((*NAMES, 'k', 'k', 'k'))})"
        if name == "diff" and r.random() < 0.7:
            return f"diff(f({inner()}), {r.choice((0, 1, 2, 3, 4, -1, 'a', 1.0, 'True', 10**30))})"
        count = FUNCTIONS.get(name, 1) if r.random() < 0.93 else r.choice((0, 1, 2, 3, 65))
        return f"{name}({', '.join(inner() for _ in range(count))})"
    if k < 0.80:
        return f"({inner()} if {inner()} else {inner()})"
    if k < 0.88:
        return f"-{inner()}" if r.random() < 0.7 else f"not {inner()}"
    if k < 0.92:
        return r.choice(WRAPS).replace("{}", inner())
    return long(r) if k < 0.935 else f"({inner()})"


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
    n, one = r.choice((10, 59, 60, 61, 100, 900, 1999, 4000, 20000)), r.choice(("a", "1", "1.5", "q"))
    before, between, after = r.choice(
        (
            ("(", "", ")"), ("-", "", ""), ("not ", "", ""), ("sin(", "", ")"), (f"f({one}+", "", ")"), ("(", "", ""), ("[", "", ""),
            (f"{one} if {one} else ", "", ""), ("a.", "", ""), ("\n", "", ""), (" ", "", ""), (f"{one}-(", "", ")"),
            (f"{one}**({one}+", "", ")"), ("9", "", ""), ("", "+", ""), ("", "*", ""), ("", "**", ""), ("", "/", ""), ("", "<", ""),
            ("", " and ", ""), ("", ",", ""),
        )
    )  # fmt: skip
    text = between.join([one] * n) if between else before * n + one + after * n
    return f"max({text})" if between == "," else f"1e{text}" if before == "9" and r.random() < 0.5 else text


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


KINDS = {"expressions": Expressions()}
