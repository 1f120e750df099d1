"""Formulas in text, read back by a reader of their own in both usual ways, have the value of the SymPy expression."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from shown_numbers import LONG, evaluate, random_state, state_values
from sweeps import part_of

import eomgen as eg
from eomgen.notation import Notation
from eomgen.printing import Formulas, Order, latex, mathml, text
from eomgen.printing.formula_text import TIGHT
from eomgen.printing.formula_tree import CallOf, Name, NumberPart, Product, Quotient, SumOf, times
from eomgen.reading.equations_text import _wrapped
from eomgen.reading.printed_equations import PrintedEquations, plain

EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = sorted(path.stem for path in EXAMPLES.glob("*.yaml"))
HIGH = "⁰¹²³⁴⁵⁶⁷⁸⁹"
FUNCTIONS = {name: getattr(math, name) for name in ("sin", "cos", "tan", "atan2", "hypot", "sqrt", "exp", "tanh")}
FUNCTIONS |= {
    "ln": math.log,
    "sign": lambda x: math.copysign(1.0, x),
    "sgn": lambda x: x / abs(x),
    "min": min,
    "max": max,
}


class Reader:
    """Values of texts; ``together`` says that factors side by side come before a bar: a b/c d is (a b)/(c d).

    Otherwise signs are taken from left to right: ((a b)/c) d.
    """

    def __init__(self, values: Mapping[str, float], together: bool) -> None:
        names = "|".join(map(re.escape, sorted(values, key=len, reverse=True)))
        self.token = re.compile(rf" |\d+\.?\d*(?:e[+-]?\d+)?|(?:{'|'.join(FUNCTIONS)})(?=[{HIGH}]*\()|{names}|.")
        self.values, self.together = values, together

    def __call__(self, text: str) -> float:
        self.left = self.token.findall(plain(text))[::-1]
        found = self.sum("")
        assert not self.left
        return found

    def peek(self) -> str:
        return self.left[-1] if self.left else ""

    def sum(self, end: str) -> float:
        sign = -1.0 if self.peek() == "-" else 1.0
        if sign < 0:
            self.left.pop()
        total = sign * self.product()
        while self.left[-3:] and self.left[-1] == " " and self.left[-2] in "+-" and self.left[-3] == " ":
            sign = 1.0 if self.left[-2] == "+" else -1.0
            del self.left[-3:]
            total += sign * self.product()
        if end:
            assert self.left.pop() == end
        return total

    def product(self) -> float:
        groups = [self.factor()]
        value = groups[0]
        while self.peek() == "/" or (self.peek() == " " and self.left[-2:-1] not in (["+"], ["-"])):
            mark, factor = self.left.pop(), self.factor()
            value = value / factor if mark == "/" else value * factor
            if mark == "/":
                groups.append(factor)
            else:
                groups[-1] *= factor
        return groups[0] / math.prod(groups[1:]) if self.together else value

    def factor(self) -> float:
        token = self.left.pop()
        if token in FUNCTIONS:
            power = self.power()
            assert self.left.pop() == "("
            arguments = [self.sum("")]
            while self.peek() == ",":
                del self.left[-2:]
                arguments.append(self.sum(""))
            assert self.left.pop() == ")"
            return float(FUNCTIONS[token](*arguments) ** power)
        if token in "(|√":
            value = self.factor() ** 0.5 if token == "√" else self.sum(")" if token == "(" else "|")
            value = abs(value) if token == "|" else value
        else:
            value = self.values[token] if token in self.values else float(token)
        return float(value ** self.power())

    def power(self) -> float:
        if self.peek() == "^":
            self.left.pop()
            return self.factor()
        digits = ""
        while self.peek() and self.peek() in HIGH:
            digits += str(HIGH.index(self.left.pop()))
        return float(digits or 1)


@pytest.mark.parametrize("name", part_of(NAMES, lambda name: name not in LONG))
def test_every_line_has_one_value(name: str) -> None:
    equations = eg.load(EXAMPLES / f"{name}.yaml").derive()
    module: Any = equations.compile("numpy")
    values = state_values(module, random_state(module, 3), 0.0)
    printed = PrintedEquations(equations)
    named = printed.named
    shown = equations.tree_system[:4] if printed.of_loops else (equations.mass_matrix, equations.force)
    entries = [x for matrix in shown for x in matrix]
    whole = [*(x for _, x in named), *entries]
    wanted = evaluate(named, whole, values)
    values |= {str(symbol): x for (symbol, _), x in zip(named, wanted, strict=False)}
    known = {printed.names.text(key): x for key, x in values.items()} | {"π": math.pi}
    assert len(known) == len(values) + 1
    lines = [printed.text(x) for _, x in printed.intermediates]
    lines += [printed.text(printed.formula(x)) for x in entries]
    for together in (True, False):
        found = np.array([Reader(known, together)(line) for line in lines if "{" not in line])
        expected = np.array([x for line, x in zip(lines, wanted, strict=True) if "{" not in line])
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max(initial=1.0))
    joined = "\n".join(line for shown in lines for line in _wrapped("x = ", shown, 80))
    assert max(map(len, joined.splitlines()), default=0) <= 80


m, s = Name("m"), Name("s_ddot")
LEFT = {
    "s''": NumberPart("1"),
    "m s''": m,
    "3 m s''/2": Product((Quotient(NumberPart("3"), NumberPart("2")), m)),
    "m s''/12": Product((Quotient(NumberPart("1"), NumberPart("12")), m)),
    "3 s''/2": Quotient(NumberPart("3"), NumberPart("2")),
    "s''/2": Quotient(NumberPart("1"), NumberPart("2")),
    "m s''/k": Quotient(m, Name("k")),
    "(m + k) s''/(2 m)": Quotient(SumOf(((False, m), (False, Name("k")))), Product((NumberPart("2"), m))),
    "(m + k) s''": SumOf(((False, m), (False, Name("k")))),
    "(-m) s''": SumOf(((True, m),)),
}


@pytest.mark.parametrize("shown", LEFT)
def test_a_factor_stands_within_the_fraction(shown: str) -> None:
    assert plain(text(times(LEFT[shown], s), Notation())) == shown


def test_an_equation_with_a_fraction_in_front() -> None:
    """A hoop that rolls without slip, or a cylinder of inertia m r^2/2 on a rack: 3 m/2 of the mass."""
    model = eg.Model("roller")
    model.parameter("m")
    model.prismatic("rail", model.ground, model.body("block", mass="3*m/2"), axis="x", coordinate="s")
    model.actuator("pull", "rail", "F")
    model.input("F")
    assert "  3 m s''/2 = F" in str(model.derive()).splitlines()


def lines_of(shown: str, columns: int) -> list[str]:
    return list(_wrapped("f = ", shown, columns))


def test_lines_end_outside_of_arguments() -> None:
    names = Notation()
    angle = SumOf(tuple((False, Name(f"{word}_angle")) for word in ("first", "second", "third")))
    factors = (Name("long_mass"), Name("gravity"), CallOf("sin", (angle,)), CallOf("abs", (angle,)))
    shown = text(SumOf(((False, Product(factors)), (False, Product(factors)))), names)
    for columns in range(52, 100):
        lines = lines_of(shown, columns)
        assert max(map(len, lines)) <= columns
        assert all(line.count("(") == line.count(")") and line.count("|") % 2 == 0 for line in lines), lines
        assert " ".join(" ".join(lines).split()) == f"f = {plain(shown)}"
    assert any(line.count("(") != line.count(")") for line in lines_of(shown, 30))  # the argument alone is longer


def test_parentheses_are_broken_before_arguments() -> None:
    argument = f"sin(a{TIGHT}+{TIGHT}b)"
    lines = lines_of(f"m{TIGHT}({argument} + {argument} + {argument} + {argument})", 34)
    assert all("sin(" not in line or "sin(a + b)" in line for line in lines)
    assert all(line.count("sin(") == line.count("sin(a + b)") for line in lines)


@pytest.mark.parametrize(
    ("number", "shown"),
    [
        ("981/100", "9.81"),
        ("-1/250", "-0.004"),
        ("3/4", "3/4"),
        ("7/20", "7/20"),
        ("1/25", "0.04"),
        ("1/3", "1/3"),
        ("1/75", "1/75"),
        ("123456789012345678/25", "123456789012345678/25"),
    ],
)
def test_fractions_of_decimals_are_decimals(number: str, shown: str) -> None:
    x = sympy.Rational(number)
    tree = Formulas(Order({}))(x)
    assert text(tree, Notation()) == shown
    assert "nan" not in latex(tree, Notation()) + mathml(tree, Notation())
    if "." in shown:
        assert sympy.Rational(shown) == x
