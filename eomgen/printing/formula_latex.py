r"""Printing, LaTeX: a formula -> LaTeX without dollars, such as ``m_2 l_1 l_2 \cos\theta_2``."""

from __future__ import annotations

from ..base.notation import Notation, literal
from . import formula_tree as tree
from .formula_writer import FormulaWriter

_FUNCTIONS = {
    "sin": r"\sin", "cos": r"\cos", "tan": r"\tan", "asin": r"\arcsin", "acos": r"\arccos", "atan": r"\arctan",
    "sinh": r"\sinh", "cosh": r"\cosh", "tanh": r"\tanh", "exp": r"\exp", "ln": r"\ln", "min": r"\min", "max": r"\max",
    "delta": r"\delta",
}  # fmt: skip
_NEXT_ROW = r" \\ "
_RELATIONS = {"<=": r"\le", ">=": r"\ge", "and": r"\wedge", "or": r"\vee"}


def latex(formula: tree.Formula, names: Notation) -> str:
    """LaTeX of a formula.

    Parameters
    ----------
    formula : Formula
    names : Notation
    """
    return _LatexWriter(names).write(formula)


def fenced(inside: str, left: str = "(", right: str = ")") -> str:
    """In parentheses that grow with what they hold."""
    tall = r"\frac" in inside or r"\begin" in inside
    return rf"\left{left}{inside}\right{right}" if tall else f"{left}{inside}{right}"


class _LatexWriter(FormulaWriter):
    def grouped(self, inside: str) -> str:
        return fenced(inside)

    def number(self, part: tree.NumberPart) -> str:
        return rf"{part.digits} \cdot 10^{{{part.power}}}" if part.power else part.digits

    def name(self, name: str) -> str:
        return self.names.latex(name)

    def letter(self, latex: str) -> str:
        return latex

    def words(self, part: tree.Words) -> str:
        return part.latex

    def product(self, formula: tree.Product) -> str:
        found = ""
        for shown in map(self.factor, formula.factors):
            found += (r" \cdot " if found and shown[0].isdigit() else " " if found else "") + shown
        return found

    def quotient(self, formula: tree.Quotient) -> str:
        return rf"\frac{{{self.write(formula.above)}}}{{{self.write(formula.below)}}}"

    def power(self, formula: tree.Power) -> str:
        exponent, base = self.write(formula.exponent), formula.base
        raised = f"^{{{exponent}}}" if len(exponent) > 1 else f"^{exponent}"
        if isinstance(base, tree.CallOf) and base.function in _FUNCTIONS:
            return self._called(base, raised)
        shown = self.write(base)
        of_abs = isinstance(base, tree.CallOf) and base.function == "abs"
        if not of_abs and (not tree.is_simple(base) or "^" in shown or "'" in shown):
            shown = fenced(shown)
        return f"{shown}{raised}"

    def call(self, formula: tree.CallOf) -> str:
        return self._called(formula)

    def _called(self, formula: tree.CallOf, power: str = "") -> str:
        inside = ", ".join(map(self.write, formula.arguments))
        if formula.function == "sqrt":
            return rf"\sqrt{{{inside}}}"
        if formula.function == "abs":
            return rf"\left|{inside}\right|"
        name = _FUNCTIONS.get(formula.function) or literal(formula.function, "operatorname")
        if len(formula.arguments) == 1 and tree.is_simple(formula.arguments[0]) and formula.function in _FUNCTIONS:
            return f"{name}{power} {inside}"
        return f"{name}{power}{fenced(inside)}"

    def relation(self, formula: tree.Relation) -> str:
        return f" {_RELATIONS.get(formula.sign, formula.sign)} ".join(map(self.write, formula.sides))

    def cases(self, formula: tree.CasesOf) -> str:
        rows = (
            rf"{self.write(value)} & " + (r"\text{otherwise}" if when is None else rf"\text{{if }} {self.write(when)}")
            for value, when in formula.branches
        )
        return rf"\begin{{cases}}{_NEXT_ROW.join(rows)}\end{{cases}}"

    def matrix(self, formula: tree.MatrixOf) -> str:
        rows = (" & ".join(map(self.write, row)) for row in formula.rows)
        return rf"\begin{{bmatrix}}{_NEXT_ROW.join(rows)}\end{{bmatrix}}"
