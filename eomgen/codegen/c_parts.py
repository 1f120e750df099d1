"""the pieces of long functions -> further C files of about the same length, when there are many."""

from __future__ import annotations

from collections.abc import Sequence

from .c_text import Printed
from .program import Program

#: Pieces that take more text than this (bytes) go into files of their own, of about this length each.
LENGTH = 150_000


def distribute(program: Program, printed: Sequence[Printed]) -> list[list[tuple[str, str]]]:
    """The pieces, name and text, by file; none if the model is small enough for one file."""
    pieces = [piece for p in printed for piece in p.pieces]
    total = sum(len(text) for _, text in pieces)
    if total <= LENGTH:
        return []
    files = -(-total // LENGTH)
    share = total / files
    parts: list[list[tuple[str, str]]] = [[] for _ in range(files)]
    done = 0
    for name, text in pieces:
        parts[min(int(done / share), files - 1)].append((name, text))
        done += len(text)
    return [part for part in parts if part]
