"""Headings, sentences, formulas, tables and pictures, as every writer takes them."""

from __future__ import annotations

import re
from collections.abc import Callable

from ..base.records import dataclass
from ..base.texts import visible
from ..expr.printing.formula import Formula

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


@dataclass(frozen=True)
class Sentence:
    """A paragraph."""

    text: str


@dataclass(frozen=True)
class FormulaLine:
    """Sides with signs of equality between them."""

    sides: tuple[Formula, ...]


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
