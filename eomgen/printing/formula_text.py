"""Printing, text: a formula -> one line of Unicode text, such as ``m₂ l₁ l₂ cos(θ₂)``."""

from __future__ import annotations

from ..base.latex import SUPERSCRIPTS, read_latex, text_form
from ..base.notation import Notation
from . import formula_tree as tree
from .formula_writer import FormulaWriter

#: Between factors and within arguments of functions: lines are broken between terms before they are broken there.
TIGHT = "\u00a0"
_RELATIONS = {"<=": "≤", ">=": "≥"}


def text(formula: tree.Formula, names: Notation) -> str:
    """One line of text; factors, and whatever stands in arguments of functions, are ``TIGHT`` apart.

    Parameters
    ----------
    formula : Formula
    names : Notation
    """
    return _TextWriter(names).write(formula)


class _TextWriter(FormulaWriter):
    def grouped(self, inside: str) -> str:
        return f"({inside})"

    def number(self, part: tree.NumberPart) -> str:
        return f"{part.digits}e{part.power}" if part.power else part.digits

    def name(self, name: str) -> str:
        return self.names.text(name)

    def letter(self, latex: str) -> str:
        return text_form(read_latex(latex))

    def words(self, part: tree.Words) -> str:
        return part.text

    def product(self, formula: tree.Product) -> str:
        """A fraction of numbers stands at the end: ``m l²/3``."""
        first, others = formula.factors[0], formula.factors[1:]
        if not (isinstance(first, tree.Quotient) and tree.is_number(first.above) and tree.is_number(first.below)):
            return TIGHT.join(map(self._atom, formula.factors))
        above = others if first.above == tree.NumberPart("1") else (first.above, *others)
        return f"{self.product(tree.Product(above))}/{self.write(first.below)}"

    def quotient(self, formula: tree.Quotient) -> str:
        return f"{self.factor(formula.above)}/{self._atom(formula.below)}"

    def _atom(self, formula: tree.Formula) -> str:
        """A formula in a place where a product needs parentheses too."""
        return f"({self.write(formula)})" if isinstance(formula, tree.Product) else self.factor(formula)

    def power(self, formula: tree.Power) -> str:
        exponent, base = self.write(formula.exponent), formula.base
        high = exponent.translate(SUPERSCRIPTS) if exponent.isdecimal() else ""
        of_call = isinstance(base, tree.CallOf)
        if high and isinstance(base, tree.CallOf) and base.function not in ("abs", "sqrt"):
            return f"{base.function}{high}({self._inside(base)})"
        shown = self.write(base)
        plain = isinstance(base, tree.Name | tree.Words) or (of_call and shown.startswith("|"))
        shown = shown if plain and not any(c in shown for c in "^*") else f"({shown})"
        if high:
            return shown + high
        return f"{shown}^{exponent}" if exponent.isalnum() else f"{shown}^({exponent})"

    def call(self, formula: tree.CallOf) -> str:
        inside, function = self._inside(formula), formula.function
        if function == "abs":
            return f"|{inside}|"
        rooted = function == "sqrt" and isinstance(formula.arguments[0], tree.Name)
        return f"√{inside}" if rooted else f"{function}({inside})"

    def _inside(self, formula: tree.CallOf) -> str:
        """Arguments, in which lines are broken last."""
        return ", ".join(map(self.write, formula.arguments)).replace(" ", TIGHT)

    def relation(self, formula: tree.Relation) -> str:
        return f" {_RELATIONS.get(formula.sign, formula.sign)} ".join(map(self.write, formula.sides))

    def cases(self, formula: tree.CasesOf) -> str:
        parts = (
            f"{self.write(value)} otherwise" if when is None else f"{self.write(value)} if {self.write(when)}"
            for value, when in formula.branches
        )
        return f"{{{'; '.join(parts)}}}"

    def matrix(self, formula: tree.MatrixOf) -> str:
        return f"[{'; '.join(', '.join(map(self.write, row)) for row in formula.rows)}]"
