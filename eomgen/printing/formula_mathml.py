"""Printing, MathML: a formula -> presentation MathML, which browsers show without a script or a network."""

from __future__ import annotations

from ..base.notation import Notation
from ..base.texts import html_text
from . import formula_tree as tree
from .formula_writer import FormulaWriter
from .given_latex import given_mathml

_FUNCTIONS = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "delta": "δ"}
_RELATIONS = {"<=": "≤", ">=": "≥", "and": "\u2227", "or": "\u2228"}
MINUS_SIGN = "\u2212"
MINUS = f"<mo>{MINUS_SIGN}</mo>"
TALL = ("<mfrac", "<mtable", "<msqrt")  #: what is higher than a line
_THIN = "<mspace width='0.17em'/>"


def mathml(formula: tree.Formula, names: Notation) -> str:
    """Elements of MathML, without ``<math>``.

    Parameters
    ----------
    formula : Formula
    names : Notation
    """
    return _MathMLWriter(names).write(formula)


def sum_line(formula: tree.Formula, names: Notation, first: bool) -> str:
    """A line of a sum; the sign with which a further line begins is spaced as it is between terms."""
    shown = mathml(formula, names)
    if first or not isinstance(formula, tree.SumOf):
        return shown
    sign = MINUS_SIGN if formula.terms[0][0] else "+"
    return f"<mo form='infix'>{sign}</mo>{shown.replace(MINUS, '', 1) if formula.terms[0][0] else shown}"


def row(*parts: str) -> str:
    """Elements side by side, as one."""
    return f"<mrow>{''.join(parts)}</mrow>"


def fenced(inside: str, left: str = "(", right: str = ")") -> str:
    """In parentheses that grow with what they hold; in a line of text they are those of the font."""
    grows = "" if any(tag in inside for tag in TALL) else " stretchy='false'"
    return row(f"<mo{grows}>{left}</mo>", inside, f"<mo{grows}>{right}</mo>")


def table(rows: list[list[str]], style: str = "") -> str:
    """Cells in rows, each a formula in the size of the text."""
    look = f" style='{style}'" if style else ""
    cells = ("".join(f"<mtd style='padding:0.25em 0.6em'>{cell}</mtd>" for cell in one) for one in rows)
    return f"<mtable displaystyle='true'{look}>{''.join(f'<mtr>{one}</mtr>' for one in cells)}</mtable>"


class _MathMLWriter(FormulaWriter):
    minus, plus, negative = MINUS, "<mo>+</mo>", MINUS

    def grouped(self, inside: str) -> str:
        return fenced(inside)

    def number(self, part: tree.NumberPart) -> str:
        digits = f"<mn>{part.digits}</mn>"
        if not part.power:
            return digits
        return row(digits, f"<mo>·</mo><msup><mn>10</mn><mn>{part.power.replace('-', MINUS_SIGN)}</mn></msup>")

    def name(self, name: str) -> str:
        return self.names.mathml(name)

    def letter(self, latex: str) -> str:
        return given_mathml(latex)

    def words(self, part: tree.Words) -> str:
        return f"<mtext>{html_text(part.text)}</mtext>"

    def sum(self, formula: tree.SumOf) -> str:
        return row(super().sum(formula))

    def product(self, formula: tree.Product) -> str:
        """Factors side by side; a point before one that begins with a digit."""
        found: list[str] = []
        for shown in map(self.factor, formula.factors):
            begins = shown.removeprefix("<mrow>").removeprefix("<msup>").startswith("<mn>")
            found += [("<mo>·</mo>" if begins else _THIN) if found else "", shown]
        return row(*found)

    def quotient(self, formula: tree.Quotient) -> str:
        return f"<mfrac>{row(self.write(formula.above))}{row(self.write(formula.below))}</mfrac>"

    def power(self, formula: tree.Power) -> str:
        exponent, base = self.write(formula.exponent), formula.base
        if isinstance(base, tree.CallOf) and base.function not in ("sqrt", "abs"):
            return self._called(base, exponent)
        shown = self.write(base)
        if not tree.is_simple(base):
            shown = fenced(shown)
        if shown.startswith("<msub>"):  # one element: the exponent stands above the subscript
            return f"<msubsup>{shown.removeprefix('<msub>').removesuffix('</msub>')}{exponent}</msubsup>"
        if shown.startswith(("<msup>", "<msubsup>")):
            shown = fenced(shown)
        return f"<msup>{shown}{exponent}</msup>"

    def call(self, formula: tree.CallOf) -> str:
        return self._called(formula)

    def _called(self, formula: tree.CallOf, power: str = "") -> str:
        arguments = "<mo>,</mo>".join(map(self.write, formula.arguments))
        if formula.function == "sqrt":
            return f"<msqrt>{arguments}</msqrt>"
        if formula.function == "abs":
            return fenced(arguments, "|", "|")
        name = f"<mi>{html_text(_FUNCTIONS.get(formula.function, formula.function))}</mi>"
        name = f"<msup>{name}{power}</msup>" if power else name
        if len(formula.arguments) == 1 and tree.is_simple(formula.arguments[0]):
            return row(name, _THIN, arguments)
        return row(name, fenced(arguments))

    def relation(self, formula: tree.Relation) -> str:
        sign = html_text(_RELATIONS.get(formula.sign, formula.sign))
        return row(f"<mo>{sign}</mo>".join(map(self.write, formula.sides)))

    def cases(self, formula: tree.CasesOf) -> str:
        rows = []
        for value, when in formula.branches:
            held = "<mtext>otherwise</mtext>" if when is None else row("<mtext>if </mtext>", self.write(when))
            rows.append([self.write(value), held])
        return row("<mo>{</mo>", table(rows, "text-align:left"))

    def matrix(self, formula: tree.MatrixOf) -> str:
        body = table([list(map(self.write, one)) for one in formula.rows])
        return f"<mrow class='matrix'><mo>[</mo>{body}<mo>]</mo></mrow>"
