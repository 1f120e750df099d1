"""Printing, text: a formula -> one line of Unicode text, such as ``m₂ l₁ l₂ cos(θ₂)``."""

from __future__ import annotations

from ..notation.notation import Notation
from ..notation.signs import SUPERSCRIPTS
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
)

#: Between factors and within arguments of functions: lines are broken between terms before they are broken there.
TIGHT = "\u00a0"
MINUS = "-"
LONGEST_LINE = 90  #: characters after which a sum goes on in the next line
_RELATIONS = {"<=": "≤", ">=": "≥"}


def text(formula: Formula, names: Notation) -> str:
    """One line of text; factors, and whatever stands in arguments of functions, are ``TIGHT`` apart.

    Parameters
    ----------
    formula : Formula
    names : Notation
    """
    return _TextOf(names).line(formula)


def sums_in_lines(formula: Formula, names: Notation, room: int = LONGEST_LINE) -> list[Formula]:
    """A sum as sums that are at most about ``room`` characters long; anything else alone."""
    if not isinstance(formula, SumOf):
        return [formula]
    lines: list[list[tuple[bool, Formula]]] = [[]]
    used = 0
    for subtracted, term in formula.terms:
        size = len(text(term, names)) + 3
        if used and used + size > room:
            lines.append([])
            used = 0
        lines[-1].append((subtracted, term))
        used += size
    return [SumOf(tuple(line)) for line in lines]


class _TextOf:
    def __init__(self, names: Notation) -> None:
        self.names = names

    def line(self, formula: Formula) -> str:
        match formula:
            case NumberPart():
                return f"{formula.digits}e{formula.power}" if formula.power else formula.digits
            case Name():
                return self.names.text(formula.name)
            case Words():
                return formula.text
            case SumOf():
                return self._sum(formula)
            case Product():
                return self._product(formula.factors)
            case Quotient():
                return f"{self._part(formula.above, products=True)}/{self._part(formula.below)}"
            case Power():
                return self._power(formula)
            case CallOf():
                return self._call(formula.function, formula.arguments)
            case Relation():
                sign = _RELATIONS.get(formula.sign, formula.sign)
                return f" {sign} ".join(map(self.line, formula.sides))
            case CasesOf():
                parts = [
                    f"{self.line(value)} otherwise" if when is None else f"{self.line(value)} if {self.line(when)}"
                    for value, when in formula.branches
                ]
                return f"{{{'; '.join(parts)}}}"
            case MatrixOf():
                return f"[{'; '.join(', '.join(map(self.line, row)) for row in formula.rows)}]"

    def _call(self, function: str, arguments: tuple[Formula, ...]) -> str:
        inside = ", ".join(map(self.line, arguments)).replace(" ", TIGHT)
        if function == "abs":
            return f"|{inside}|"
        return f"√{inside}" if function == "sqrt" and isinstance(arguments[0], Name) else f"{function}({inside})"

    def _sum(self, formula: SumOf) -> str:
        found = ""
        for k, (subtracted, term) in enumerate(formula.terms):
            sign = (MINUS if subtracted else "") if k == 0 else f" {MINUS if subtracted else '+'} "
            found += sign + self._part(term, products=True)
        return found

    def _product(self, factors: tuple[Formula, ...]) -> str:
        """A fraction of numbers stands at the end: ``m l²/3``."""
        first, others = factors[0], factors[1:]
        if isinstance(first, Quotient) and isinstance(first.below, NumberPart) and isinstance(first.above, NumberPart):
            above = others if first.above.digits == "1" else (first.above, *others)
            return f"{self._product(above)}/{first.below.digits}"
        return TIGHT.join(map(self._part, factors))

    def _power(self, formula: Power) -> str:
        exponent = self.line(formula.exponent)
        high = exponent.translate(SUPERSCRIPTS) if exponent.isdecimal() else ""
        base = formula.base
        if high and isinstance(base, CallOf) and base.function not in ("abs", "sqrt"):
            return f"{base.function}{high}({', '.join(map(self.line, base.arguments))})".replace(" ", TIGHT)
        shown = self.line(base)
        plain = isinstance(base, Name | Words) or (isinstance(base, CallOf) and shown.startswith("|"))
        shown = shown if plain and not any(c in shown for c in "^*") else f"({shown})"
        if high:
            return shown + high
        return f"{shown}^{exponent}" if exponent.isalnum() else f"{shown}^({exponent})"

    def _part(self, formula: Formula, products: bool = False) -> str:
        """A formula as a factor; products need parentheses below a fraction's bar only."""
        shown = self.line(formula)
        if is_group(formula) or (isinstance(formula, Product) and not products):
            return f"({shown})"
        return shown
