"""Texts as people type them: each refusal says in plain words what to write."""

from __future__ import annotations

import pytest

import eomgen as eg
from eomgen.describe.expressions import parse
from eomgen.describe.typing_slips import find_slip
from eomgen.errors import ExpressionError
from eomgen.graph.core import Graph

#: What is typed -> what the message must say, and the column it points at.
SLIPS = {
    "2pi*A": ("a multiplication sign is missing", 2, "write 2*pi"),
    "2a": ("a multiplication sign is missing", 2, "write 2*a"),
    "2(a + b)": ("a multiplication sign is missing", 2, "write 2*("),
    "(a + b)(2)": ("a multiplication sign is missing", 8, "write * between ) and ("),
    "2 pi": ("a multiplication sign is missing", 3, "write 2*pi"),
    "3 mm": ("a number with a unit is not an expression", 3, "write 0.003, the number in m, or 3*mm if mm is a name"),
    "5 N*m": ("a number with a unit is not an expression", 3, "write 5, the number in N*m"),
    "5 kg": ("a number with a unit is not an expression", 3, "write 5, the number in kg"),
    "0.5m": ("a number with a unit is not an expression", 4, "write 0.5, the number in m, or 0.5*m"),
    "9.81 m/s^2": ("a number with a unit is not an expression", 6, "write 9.81, the number in m/s^2"),
    "30 rpm": ("a number with a unit is not an expression", 4, "write 3.14159265359, the number in rad/s"),
    "10 %": ("a number with a unit is not an expression", 4, "write 0.1"),
    "30°": ("a number with a unit is not an expression", 3, "write deg(30)"),
    "30 deg": ("a number with a unit is not an expression", 4, "write deg(30)"),
    "sin(30°)": ("'°' is not allowed", 7, "write deg(30)"),
    "deg 30": ("'deg' is a function", 1, "write deg(30)"),
    "sin a": ("'sin' is a function", 1, "write sin(a)"),
    "1,5": ("a comma is not a decimal point", 2, "write 1.5"),
    "2,5*a": ("a comma is not a decimal point", 2, "write 2.5"),
    "2e3.5": ("the power of ten behind e must be a whole number", 1, "write 2*10**3.5"),
    "1 000": ("a number has no spaces", 1, "write 1000"),
    "1.5.2": ("a number has one decimal point", 1, "leave one"),
    "a^2": ("'^' is not allowed", 2, "write ** for powers"),
    "a²": ("'²' is not allowed", 2, "write **2"),
    "a·b": ("'·' is not allowed", 2, "write *"),
    "\u22123": ("is not allowed", 1, "write -"),
    "√2": ("'√' is not allowed", 1, "write sqrt(...)"),
    "π/2": ("'π' is not allowed", 1, "write pi"),
    "µ*a": ("is not allowed", 1, "names have the letters a to z"),
    "|a|": ("'|' is not allowed", 1, "write abs(a)"),
    "a b": ("an operator is missing between 'a' and 'b'", 3, "write a*b"),
    "a**": ("nothing follows '**'", 4, "write what comes after it"),
    "a = 2": ("this is a statement", 3, "write only what stands on the right"),
    "a//b": ("the operator // is not allowed", 1, "write / for a quotient"),
    "ln(a)": ("unknown function 'ln'", 1, "did you mean 'log'"),
    "arctan(a)": ("unknown function 'arctan'", 1, "did you mean 'atan'"),
    "2*(a": ("'(' was never closed", 3, "close the bracket"),
}


def refused(text: str) -> ExpressionError:
    graph = Graph()
    with pytest.raises(ExpressionError) as caught:
        parse(text, graph, graph.symbol)
    return caught.value


@pytest.mark.parametrize("text", SLIPS)
def test_a_slip_is_told_with_what_to_write(text: str) -> None:
    message, column, remedy = SLIPS[text]
    error = refused(text)
    assert message in error.message
    assert error.column == column
    assert remedy in error.remedy


@pytest.mark.parametrize("text", ["PI", "Pi", "e", "inf"])
def test_constants_of_other_programs_are_told(text: str) -> None:
    m = eg.Model("m")
    m.revolute("A", m.ground, m.body("b", mass=text, inertia=(1, 1, 1)))
    wanted = {"e": r"write exp\(1\)", "inf": "numbers are finite"}.get(text, "write pi")
    with pytest.raises(eg.ModelError, match=f"unknown name '{text}'.*{wanted}"):
        m.check()


def test_a_name_of_the_model_may_be_called_so() -> None:
    graph = Graph()
    for text in ("e*2", "m + mm", "deg(30)", "min(1,2)", "atan2(1, 2)", "1e-3*kg", "a if b else 3"):
        parse(text, graph, graph.symbol)


@pytest.mark.parametrize("text", ["[1,2]", "1.2E+-3", "not", "a if", "f(1,2", "$", "a ** ** b"])
def test_what_is_no_slip_of_the_table_keeps_its_message(text: str) -> None:
    slip = find_slip(text)
    assert slip is None or "comma" not in slip.message
    assert slip is None or "multiplication" not in slip.message
    assert refused(text).remedy


def test_units_of_the_message_are_those_of_a_parameter() -> None:
    """The number that the message names is what ``{value: 3, unit: ...}`` makes of it."""
    for text, unit in (("3 mm", "mm"), ("3 rpm", "rpm"), ("3 kN*m", "kN*m"), ("3 km/h", "km/h")):
        m = eg.Model("m")
        m.parameter("a", 3, unit=unit)
        m.revolute("A", m.ground, m.body("b", mass=1, inertia=(1, 1, 1)))
        value = m.compile(target="numpy").p[0]
        assert float(refused(text).remedy.split()[1].rstrip(",")) == pytest.approx(value, rel=1e-10)


def test_long_texts_are_not_searched() -> None:
    """A search of so many digits would take minutes."""
    assert find_slip("1" * 100_000) is None
