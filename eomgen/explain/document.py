"""Stage explain, the document: headings, sentences, formulas, tables and pictures, as every writer takes them.

Texts hold names of the model between backquotes and short formulas between dollars: ``the angle $\\theta$ of `rod` ``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, NamedTuple

from ..base.texts import visible
from ..records import dataclass

_PARTS = re.compile(r"(\$[^$]+\$|`[^`]+`)")


class Span(NamedTuple):
    """A piece of a text: ``kind`` is 'text', 'name' or 'math'."""

    kind: str
    text: str


def spans(text: str) -> Iterator[Span]:
    """The pieces of a text."""
    for part in _PARTS.split(visible(text)):
        if part[:1] == "$" and len(part) > 2:
            yield Span("math", part[1:-1])
        elif part[:1] == "`" and len(part) > 2:
            yield Span("name", part[1:-1])
        elif part:
            yield Span("text", part)


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
    """A heading and what stands below it; sections of ``level`` 2 belong to the one of level 1 before."""

    title: str
    pieces: tuple[Piece, ...]
    level: int = 1
