"""Stage explain, printing: sides of formulas -> LaTeX and MathML, in the order and notation of the display."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ..printing import Formulas, given_mathml, latex, mathml, number, sums_in_lines, text
from ..printing.formula_mathml import sum_line
from ..printing.formula_of import ROUNDED
from ..printing.formula_tree import Formula, MatrixOf, SumOf
from ..reading.printed_equations import order_of
from .document import FormulaLine, PutIn

SHORT = 32  #: characters of a side that leaves room for another one in its line


class Printer:
    """LaTeX and MathML of the sides of formulas of equations."""

    def __init__(self, equations: Any) -> None:
        self.names = equations.notation
        self._formula = Formulas(order_of(equations), digits=ROUNDED)

    def meet(self, names: Iterable[str]) -> None:
        """Keep names of intermediates apart from those of the model, as they are printed."""
        self.names = self.names.with_names(names)

    def latex(self, side: Any) -> str:
        """LaTeX of a side, without dollars."""
        return side if isinstance(side, str) else latex(self._tree(side), self.names)

    def mathml(self, side: Any) -> str:
        """Elements of MathML of a side, without ``<math>``."""
        return given_mathml(side) if isinstance(side, str) else mathml(self._tree(side), self.names)

    def latex_lines(self, side: Any) -> list[str]:
        """LaTeX of a side; a long sum in parts to be written below each other, each with its sign."""
        if isinstance(side, str):
            return [side]
        return [_plus(k, x, "+ ") + latex(x, self.names) for k, x in enumerate(self._lines(side))]

    def mathml_lines(self, side: Any) -> list[str]:
        """The same in MathML."""
        if isinstance(side, str):
            return [given_mathml(side)]
        return [sum_line(x, self.names, first=k == 0) for k, x in enumerate(self._lines(side))]

    def is_short(self, formula: FormulaLine) -> bool:
        """Whether all sides go into one line."""
        trees = [self._tree(side) for side in formula.sides if not isinstance(side, str)]
        return all(not isinstance(x, MatrixOf) and len(text(x, self.names)) <= SHORT for x in trees)

    def _lines(self, side: Any) -> list[Formula]:
        return sums_in_lines(self._tree(side), self.names)

    def _tree(self, side: Any) -> Formula:
        if isinstance(side, float | int):
            return number(side)
        if isinstance(side, PutIn):
            return Formulas(self._formula.order, side.numbers, ROUNDED)(side.expression)
        return self._formula(side)


def _plus(k: int, line: Formula, sign: str) -> str:
    """The sign before a line that goes on with a sum."""
    return sign if k and isinstance(line, SumOf) and not line.terms[0][0] else ""
