"""Printing, MathML: a formula -> presentation MathML, which browsers show without a script or a network."""

from __future__ import annotations

from ..notation.notation import Notation
from ..texts import html_text
from .formula_tree import (
    CallOf,
    CasesOf,
    Formula,
    MatrixOf,
    Name,
    NumberPart,
    Power,
    Product,
    Quotient,
    Relation,
    SumOf,
    Words,
    is_group,
    is_simple,
)

_FUNCTIONS = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "delta": "δ"}
_RELATIONS = {"<=": "≤", ">=": "≥", "and": "\u2227", "or": "\u2228"}
MINUS_SIGN = "\u2212"
MINUS = f"<mo>{MINUS_SIGN}</mo>"
_THIN = "<mspace width='0.17em'/>"


def mathml(formula: Formula, names: Notation) -> str:
    """Elements of MathML, without ``<math>``.

    Parameters
    ----------
    formula : Formula
    names : Notation
    """
    return _MathML(names).element(formula)


def row(*parts: str) -> str:
    """Elements side by side, as one."""
    return f"<mrow>{''.join(parts)}</mrow>"


def fenced(inside: str, left: str = "(", right: str = ")") -> str:
    """In parentheses that grow with what they hold."""
    return row(f"<mo>{left}</mo>", inside, f"<mo>{right}</mo>")


def table(rows: list[list[str]], style: str = "") -> str:
    """Cells in rows, each a formula in the size of the text."""
    look = f" style='{style}'" if style else ""
    cells = ("".join(f"<mtd style='padding:0.25em 0.6em'>{cell}</mtd>" for cell in one) for one in rows)
    return f"<mtable displaystyle='true'{look}>{''.join(f'<mtr>{one}</mtr>' for one in cells)}</mtable>"


class _MathML:
    def __init__(self, names: Notation) -> None:
        self.names = names

    def element(self, formula: Formula) -> str:
        match formula:
            case NumberPart():
                if formula.power:
                    ten = f"<msup><mn>10</mn><mn>{formula.power.replace('-', MINUS_SIGN)}</mn></msup>"
                    return row(f"<mn>{formula.digits}</mn><mo>·</mo>", ten)
                return f"<mn>{formula.digits}</mn>"
            case Name():
                return self.names.mathml(formula.name)
            case Words():
                return f"<mtext>{html_text(formula.text)}</mtext>"
            case SumOf():
                return self._sum(formula)
            case Product():
                return self._product(formula)
            case Quotient():
                return f"<mfrac>{row(self.element(formula.above))}{row(self.element(formula.below))}</mfrac>"
            case Power():
                return self._power(formula)
            case CallOf():
                return self._call(formula, "")
            case Relation():
                sign = html_text(_RELATIONS.get(formula.sign, formula.sign))
                return row(f"<mo>{sign}</mo>".join(map(self.element, formula.sides)))
            case CasesOf():
                rows = [
                    [self.element(value), "<mtext>otherwise</mtext>" if when is None
                     else row("<mtext>if </mtext>", self.element(when))]
                    for value, when in formula.branches
                ]  # fmt: skip
                return row("<mo>{</mo>", table(rows, "text-align:left"))
            case MatrixOf():
                body = table([list(map(self.element, one)) for one in formula.rows])
                return f"<mrow class='matrix'><mo>[</mo>{body}<mo>]</mo></mrow>"

    def _sum(self, formula: SumOf) -> str:
        parts = []
        for k, (subtracted, term) in enumerate(formula.terms):
            sign = MINUS if subtracted else "<mo>+</mo>"
            parts += [sign] * (subtracted or k > 0) + [self._factor(term)]
        return row(*parts)

    def _product(self, formula: Product) -> str:
        """Factors side by side; a point before one that begins with a digit."""
        found: list[str] = []
        for shown in map(self._factor, formula.factors):
            begins = shown.removeprefix("<mrow>").removeprefix("<msup>").startswith("<mn>")
            found += [("<mo>·</mo>" if begins else _THIN) if found else "", shown]
        return row(*found)

    def _factor(self, formula: Formula) -> str:
        shown = self.element(formula)
        return fenced(shown) if is_group(formula) else shown

    def _power(self, formula: Power) -> str:
        exponent, base = self.element(formula.exponent), formula.base
        if isinstance(base, CallOf) and base.function not in ("sqrt", "abs"):
            return self._call(base, exponent)
        shown = self.element(base)
        if not is_simple(base):
            shown = fenced(shown)
        if shown.startswith("<msub>"):  # one element: the exponent stands above the subscript
            return f"<msubsup>{shown.removeprefix('<msub>').removesuffix('</msub>')}{exponent}</msubsup>"
        if shown.startswith(("<msup>", "<msubsup>")):
            shown = fenced(shown)
        return f"<msup>{shown}{exponent}</msup>"

    def _call(self, formula: CallOf, power: str) -> str:
        arguments = "<mo>,</mo>".join(map(self.element, formula.arguments))
        if formula.function == "sqrt":
            return f"<msqrt>{arguments}</msqrt>"
        if formula.function == "abs":
            return fenced(arguments, "|", "|")
        name = f"<mi>{html_text(_FUNCTIONS.get(formula.function, formula.function))}</mi>"
        name = f"<msup>{name}{power}</msup>" if power else name
        if len(formula.arguments) == 1 and is_simple(formula.arguments[0]):
            return row(name, _THIN, arguments)
        return row(name, fenced(arguments))
