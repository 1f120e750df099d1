"""Headings, sentences, formulas, tables and pictures, as every writer takes them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from ..base.records import dataclass
from ..base.texts import visible
from ..expr.printing import Formulas, given_mathml, latex, latex_lines, mathml, mathml_lines, number, text
from ..expr.printing.formula import ROUNDED, Formula, MatrixOf
from ..reading.printed import order_of

# -- parts of a document -----------------------------------------------------------------------------------------------

# Texts hold names of the model between backquotes and short formulas between dollars: ``the angle $\theta$ of `rod` ``.


_PARTS = re.compile(r"(\$[^$]+\$|`[^`]+`)")


def written(text: str, math: Callable[[str], str], name: Callable[[str], str], plain: Callable[[str], str]) -> str:
    """A text whose formulas, names and other pieces are written so."""
    found = ""
    for part in _PARTS.split(visible(text)):
        if part[:1] == "$" and len(part) > 2:
            found += math(part[1:-1])
        elif part[:1] == "`" and len(part) > 2:
            found += name(part[1:-1])
        else:
            found += plain(part)
    return found


class PutIn(NamedTuple):
    """An expression with numbers in the places of its symbols, as a hand would write it before it calculates."""

    expression: Any
    numbers: dict[str, float]


@dataclass(frozen=True)
class Sentence:
    """A paragraph."""

    text: str


@dataclass(frozen=True)
class FormulaLine:
    """Sides with signs of equality between them, each LaTeX, a SymPy expression or matrix, a number, or PutIn."""

    sides: tuple[Any, ...]


@dataclass(frozen=True)
class Table:
    """Rows of texts under a head."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class DrawnPicture:
    """A picture in the bytes of a PNG file, ``width`` in dots of a page."""

    png: bytes
    width: int
    words: str


@dataclass(frozen=True)
class Folded:
    """Pieces that a page shows when it is asked to; ``title`` is always seen."""

    title: str
    pieces: tuple[Piece, ...]


Piece = Sentence | FormulaLine | Table | DrawnPicture | Folded


@dataclass(frozen=True)
class Section:
    """A heading and what stands below it; sections of ``level`` 2 belong to the one of level 1 before.

    A page shows what is ``folded``, with what belongs to it, when it is asked to.
    """

    title: str
    pieces: tuple[Piece, ...]
    level: int = 1
    folded: bool = False


# -- sides of formulas -------------------------------------------------------------------------------------------------


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
        return [side] if isinstance(side, str) else latex_lines(self._tree(side), self.names)

    def mathml_lines(self, side: Any) -> list[str]:
        """The same in MathML."""
        return [given_mathml(side)] if isinstance(side, str) else mathml_lines(self._tree(side), self.names)

    def is_short(self, formula: FormulaLine) -> bool:
        """Whether all sides go into one line."""
        trees = [self._tree(side) for side in formula.sides if not isinstance(side, str)]
        return all(not isinstance(x, MatrixOf) and len(text(x, self.names)) <= SHORT for x in trees)

    def _tree(self, side: Any) -> Formula:
        if isinstance(side, float | int):
            return number(side)
        if isinstance(side, PutIn):
            return Formulas(self._formula.order, side.numbers, ROUNDED)(side.expression)
        return self._formula(side)
