"""Stage emit: the pieces of long functions -> further C files of about the same length, when there are many."""

from __future__ import annotations

from collections.abc import Sequence

from ..program import Program
from .c_text import Printed

#: Pieces that take more text than this (bytes) go into files of their own, of about this length each.
LENGTH = 150_000


def part_names(printed: Sequence[Printed]) -> list[str]:
    """Names of all pieces, to declare them."""
    return [name for p in printed for name, _ in p.pieces]


def distribute(program: Program, printed: Sequence[Printed]) -> list[list[str]]:
    """The texts of the pieces by file; none if the model is small enough for one file."""
    texts = [text for p in printed for _, text in p.pieces]
    total = sum(map(len, texts))
    if total <= LENGTH:
        return []
    files = -(-total // LENGTH)
    share = total / files
    parts: list[list[str]] = [[] for _ in range(files)]
    done = 0
    for text in texts:
        parts[min(int(done / share), files - 1)].append(text)
        done += len(text)
    return [part for part in parts if part]
