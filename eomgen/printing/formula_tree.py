"""Printing, tree: what a printed formula is made of, whatever it is printed in."""

from __future__ import annotations

from typing import NamedTuple


class NumberPart(NamedTuple):
    """A number without a sign, as it is printed; ``power`` is the power of ten after it."""

    digits: str
    power: str = ""


class Name(NamedTuple):
    """A name of the model or of an intermediate."""

    name: str


class Letter(NamedTuple):
    r"""A symbol of a display that no name of the model stands for, in LaTeX: ``M_{12}``, ``B^T``."""

    latex: str


class SumOf(NamedTuple):
    """Terms, each with whether it is subtracted."""

    terms: tuple[tuple[bool, Formula], ...]


class Product(NamedTuple):
    """Factors side by side."""

    factors: tuple[Formula, ...]


class Quotient(NamedTuple):
    """One over the other."""

    above: Formula
    below: Formula


class Power(NamedTuple):
    """A base and its exponent."""

    base: Formula
    exponent: Formula


class CallOf(NamedTuple):
    """A function of arguments: ``sin``, ``sqrt``, ``abs``, ``min``, ..."""

    function: str
    arguments: tuple[Formula, ...]


class Relation(NamedTuple):
    """Formulas with signs between them: < > <= >= = and or."""

    sign: str
    sides: tuple[Formula, ...]


class CasesOf(NamedTuple):
    """Values and the conditions under which they hold; the last may hold otherwise."""

    branches: tuple[tuple[Formula, Formula | None], ...]


class MatrixOf(NamedTuple):
    """Formulas in rows."""

    rows: tuple[tuple[Formula, ...], ...]


class Words(NamedTuple):
    """What no other part is for, as SymPy writes it: in text and in LaTeX."""

    text: str
    latex: str


Formula = (
    NumberPart | Name | Letter | SumOf | Product | Quotient | Power | CallOf | Relation | CasesOf | MatrixOf | Words
)


def times(formula: Formula, factor: Formula) -> Formula:
    """A formula with one more factor, within its fraction: of ``3 m/2`` and ``s``, ``3 m s/2``, which reads one way."""
    match formula:
        case Quotient():
            return formula._replace(above=times(formula.above, factor))
        case Product():
            return Product((*formula.factors, factor))
        case NumberPart("1", ""):
            return factor
        case _:
            return Product((formula, factor))


def is_group(formula: Formula) -> bool:
    """Whether a formula needs parentheses to be one factor."""
    return isinstance(formula, SumOf | Relation)


def is_number(formula: Formula) -> bool:
    """Whether a formula is a number without a sign."""
    return isinstance(formula, NumberPart)


def is_simple(formula: Formula) -> bool:
    """Whether a formula is one symbol."""
    return isinstance(formula, Name | Letter) or (isinstance(formula, NumberPart) and not formula.power)
