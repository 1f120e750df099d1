r"""Printing, LaTeX: a formula -> LaTeX without dollars, such as ``m_2 l_1 l_2 \cos\theta_2``."""

from __future__ import annotations

from ..notation.latex_of_names import literal
from ..notation.notation import Notation
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

_FUNCTIONS = {
    "sin": r"\sin", "cos": r"\cos", "tan": r"\tan", "asin": r"\arcsin", "acos": r"\arccos", "atan": r"\arctan",
    "sinh": r"\sinh", "cosh": r"\cosh", "tanh": r"\tanh", "exp": r"\exp", "ln": r"\ln", "min": r"\min", "max": r"\max",
    "delta": r"\delta",
}  # fmt: skip
_RELATIONS = {"<=": r"\le", ">=": r"\ge", "and": r"\wedge", "or": r"\vee"}


def latex(formula: Formula, names: Notation) -> str:
    """LaTeX of a formula.

    Parameters
    ----------
    formula : Formula
    names : Notation
    """
    return _Latex(names).line(formula)


def fenced(inside: str, left: str = "(", right: str = ")") -> str:
    """In parentheses that grow with what they hold."""
    tall = r"\frac" in inside or r"\begin" in inside
    return rf"\left{left}{inside}\right{right}" if tall else f"{left}{inside}{right}"


class _Latex:
    def __init__(self, names: Notation) -> None:
        self.names = names

    def line(self, formula: Formula) -> str:
        match formula:
            case NumberPart():
                return rf"{formula.digits} \cdot 10^{{{formula.power}}}" if formula.power else formula.digits
            case Name():
                return self.names.latex(formula.name)
            case Words():
                return formula.latex
            case SumOf():
                return self._sum(formula)
            case Product():
                return self._product(formula)
            case Quotient():
                return rf"\frac{{{self.line(formula.above)}}}{{{self.line(formula.below)}}}"
            case Power():
                return self._power(formula)
            case CallOf():
                return self._call(formula, "")
            case Relation():
                sign = _RELATIONS.get(formula.sign, formula.sign)
                return f" {sign} ".join(map(self.line, formula.sides))
            case CasesOf():
                rows = [
                    rf"{self.line(value)} & \text{{otherwise}}" if when is None
                    else rf"{self.line(value)} & \text{{if }} {self.line(when)}"
                    for value, when in formula.branches
                ]  # fmt: skip
                body = r" \\ ".join(rows)
                return rf"\begin{{cases}}{body}\end{{cases}}"
            case MatrixOf():
                body = r" \\ ".join(" & ".join(map(self.line, row)) for row in formula.rows)
                return rf"\begin{{bmatrix}}{body}\end{{bmatrix}}"

    def _sum(self, formula: SumOf) -> str:
        found = ""
        for k, (subtracted, term) in enumerate(formula.terms):
            sign = ("-" if subtracted else "") if k == 0 else (" - " if subtracted else " + ")
            found += sign + self._factor(term)
        return found

    def _product(self, formula: Product) -> str:
        found = ""
        for factor in formula.factors:
            shown = self._factor(factor)
            found += (r" \cdot " if found and shown[0].isdigit() else " " if found else "") + shown
        return found

    def _factor(self, formula: Formula) -> str:
        shown = self.line(formula)
        return fenced(shown) if is_group(formula) else shown

    def _power(self, formula: Power) -> str:
        exponent = self.line(formula.exponent)
        base = formula.base
        if isinstance(base, CallOf) and base.function in _FUNCTIONS:
            return self._call(base, f"^{{{exponent}}}" if len(exponent) > 1 else f"^{exponent}")
        shown = self.line(base)
        if isinstance(base, CallOf) and base.function == "abs":
            return f"{shown}^{{{exponent}}}" if len(exponent) > 1 else f"{shown}^{exponent}"
        if not is_simple(base) or "^" in shown or "'" in shown:
            shown = fenced(shown)
        return f"{shown}^{{{exponent}}}" if len(exponent) > 1 else f"{shown}^{exponent}"

    def _call(self, formula: CallOf, power: str) -> str:
        inside = ", ".join(map(self.line, formula.arguments))
        if formula.function == "sqrt":
            return rf"\sqrt{{{inside}}}"
        if formula.function == "abs":
            return rf"\left|{inside}\right|"
        name = _FUNCTIONS.get(formula.function) or literal(formula.function, "operatorname")
        if len(formula.arguments) == 1 and is_simple(formula.arguments[0]) and formula.function in _FUNCTIONS:
            return f"{name}{power} {inside}"
        return f"{name}{power}{fenced(inside)}"
