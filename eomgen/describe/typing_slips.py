"""A text that is no expression, as a person types it -> what is wrong with it and what to write.

Only looked at once a text has been refused: nothing here decides what an expression is.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from .names import function_words
from .units import COMMON, UnitError, read_unit

_NUMBER = r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_WORD = r"[A-Za-z_][A-Za-z0-9_]*"
#: A number with a unit: ``150 mm``, ``5cm``, ``30°``.
_WITH_UNIT = re.compile(rf"\s*(-?{_NUMBER})\s*(°|%|[A-Za-zµμ°][A-Za-z0-9µμ°*/^²³· -]*)\s*")
_UNIT_WORD = re.compile(r"[A-Za-zµμ°%]+")
_DEGREES = ("deg", "degree", "degrees", "°")
_DEGREE_SIGN = re.compile(rf"({_NUMBER}|{_WORD})\s*°")
_HALF_EXPONENT = re.compile(r"(?<![\w.])([0-9.]+)[eE]([+-]?[0-9]*\.[0-9]+)")
_COMMA = re.compile(r"(?<![\w.(,])([0-9]+),([0-9]+)(?![\w.,])")
_GROUPED = re.compile(r"(?<![\w.])[0-9]{1,3}(?: [0-9]{3})+(?![\w])")
_POINTS = re.compile(r"(?<![\w.])[0-9]+\.[0-9]+\.[0-9.]*")
_TIMES = re.compile(rf"(?<![\w.])({_NUMBER})\s*({_WORD}|\()|(\))\s*({_WORD}|[0-9(])")
_CALL = re.compile(rf"(?<!\w)({_WORD})\s+(-?{_NUMBER}|{_WORD})")
_BESIDE = re.compile(rf"({_WORD}|{_NUMBER})\s+({_WORD}|{_NUMBER})")
_LACKS = re.compile(r"(\*\*|//|[-+*/<>=.,])\s*$")
_BARS = re.compile(r"\|([^|]+)\|")
_ASSIGNED = re.compile(r"[^=<>!:]=(?!=)")
LONGEST = 400  #: characters of a text that people type
_KEYWORDS = frozenset(("and", "or", "not", "if", "else", "is", "in"))
#: Signs of a keyboard or a formula -> what to write.
SIGNS = {
    "^": "** for powers", "\u00b2": "**2", "\u00b3": "**3", "\u00b7": "*", "\u00d7": "*", "\u22c5": "*", "\u00f7": "/",
    "\u2212": "-", "\u2013": "-", "\u221a": "sqrt(...)", "\u03c0": "pi", "\u2264": "<=", "\u2265": ">=", "\u2260": "!=",
    "\u00bd": "1/2", "\u00bc": "1/4", "\u00b0": "deg(...)",
}  # fmt: skip
_GREEK = re.compile(r"[\u0370-\u03ffµ]")
_SUPERSCRIPT = re.compile(r"[⁰¹⁴⁵⁶⁷⁸⁹⁻⁺]")


class Typed(NamedTuple):
    """What is wrong with a text, its column from 1, and what to write."""

    message: str
    column: int
    remedy: str


def find_slip(text: str) -> Typed | None:
    """The first slip of the table that the text has; None if it looks like none of them, or is longer than people type.

    Searches take the square of the length.
    """
    if len(text) > LONGEST:
        return None
    return next((slip for slip in (look(text) for look in _LOOKS) if slip is not None), None)


def _unit(text: str) -> Typed | None:
    found = _WITH_UNIT.fullmatch(text)
    if found is None:
        return None
    number, unit = found[1], found[2].strip()
    words = _UNIT_WORD.findall(unit)
    if not words or any(word not in COMMON and word not in (*_DEGREES, "%") for word in words):
        return None
    if unit.lower() in _DEGREES:
        remedy = f"write deg({number})"
    elif unit == "%":
        remedy = f"write {float(number) / 100.0:.12g}"
    else:
        remedy = f"write {_in_si(number, unit)}"
        if re.fullmatch(_WORD, unit):
            remedy += f", or {number}*{unit} if {unit} is a name of the model"
        remedy += "; the value of a parameter may have a unit beside it: {value: ..., unit: ...}"
    return Typed("a number with a unit is not an expression", found.start(2) + 1, remedy)


def _in_si(number: str, unit: str) -> str:
    try:
        read = read_unit(unit)
    except (UnitError, ImportError):
        return "the number in SI units"
    return f"{float(number) * read.size:.12g}, the number in {read.si or 'SI units'}"


def _degrees(text: str) -> Typed | None:
    found = _DEGREE_SIGN.search(text)
    return found and Typed("'°' is not allowed in an expression", found.end(), f"write deg({found[1]})")


def _exponent(text: str) -> Typed | None:
    found = _HALF_EXPONENT.search(text)
    remedy = "" if found is None else f"write {found[1]}*10**{found[2].removeprefix('+')}"
    return found and Typed("the power of ten behind e must be a whole number", found.start() + 1, remedy)


def _comma(text: str) -> Typed | None:
    found = _COMMA.search(text)
    if found is None:
        return None
    before = text[: found.start()]
    if before.count("(") > before.count(")") or "[" in before:
        return None  # arguments of a function, or a list
    return Typed("a comma is not a decimal point", found.start(2), f"write {found[1]}.{found[2]}")


def _grouped(text: str) -> Typed | None:
    found = _GROUPED.search(text)
    remedy = "" if found is None else f"write {found[0].replace(' ', '')}"
    return found and Typed("a number has no spaces", found.start() + 1, remedy)


def _points(text: str) -> Typed | None:
    found = _POINTS.search(text)
    return found and Typed("a number has one decimal point", found.start() + 1, f"{found[0]!r} has several; leave one")


def _applied(text: str) -> Typed | None:
    """A function without brackets: ``sin 30``."""
    for found in _CALL.finditer(text):
        if found[1] in function_words() and found[2] not in _KEYWORDS:
            return Typed(f"{found[1]!r} is a function", found.start() + 1, f"write {found[1]}({found[2]})")
    return None


def _times(text: str) -> Typed | None:
    """A product without its sign: ``2pi``, ``2(a + b)``, ``(a)(b)``, ``a b``."""
    for found in _TIMES.finditer(text):
        first, second = found[1] or found[3], found[2] or found[4]
        power = second in ("e", "E") and text[found.end() : found.end() + 1] in ("+", "-")
        if second not in _KEYWORDS and not power:
            remedy = f"write * between ) and {second}" if found[3] else f"write {first}*{second}"
            return Typed("a multiplication sign is missing", found.end() - len(second) + 1, remedy)
    for found in _BESIDE.finditer(text):
        if not {found[1], found[2]} & _KEYWORDS:
            remedy = f"write {found[1]}*{found[2]} if a product is meant; allowed are + - * / ** and comparisons"
            message = f"not a valid expression: an operator is missing between {found[1]!r} and {found[2]!r}"
            return Typed(message, found.start(2) + 1, remedy)
    return None


def _ends(text: str) -> Typed | None:
    found = _LACKS.search(text)
    return found and Typed(
        f"not a valid expression: nothing follows {found[1]!r}", len(text.rstrip()) + 1, "write what comes after it"
    )


def _bars(text: str) -> Typed | None:
    found = _BARS.search(text)
    return found and Typed("'|' is not allowed in an expression", found.start() + 1, f"write abs({found[1].strip()})")


def _assigned(text: str) -> Typed | None:
    found = _ASSIGNED.search(text)
    remedy = "write only what stands on the right; == compares"
    return found and Typed("this is a statement, not an expression", found.start() + 2, remedy)


def _sign(text: str) -> Typed | None:
    for k, sign in enumerate(text, 1):
        message = f"{sign!r} is not allowed in an expression"
        if sign in SIGNS:
            return Typed(message, k, f"write {SIGNS[sign]}")
        if _SUPERSCRIPT.match(sign):
            return Typed(message, k, "write ** for powers; the inverse of tan is atan")
        if _GREEK.match(sign):
            return Typed(message, k, "names have the letters a to z and A to Z, digits and _: mu, omega")
    return None


_LOOKS = (_unit, _degrees, _exponent, _comma, _grouped, _points, _bars, _sign, _applied, _times, _ends, _assigned)
