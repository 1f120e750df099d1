"""Which columns the rows of a matrix hold -> its block triangular form.

Duff, Erisman and Reid, *Direct Methods for Sparse Matrices* (2nd ed. 2017), chapter 6: rows are matched with columns,
and the strong components (Tarjan 1972) of what then depends on what are the blocks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple


class DiagonalBlock(NamedTuple):
    """Rows that determine as many columns once those of earlier blocks are known."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


def match(rows: Sequence[Mapping[int, object]]) -> dict[int, int] | None:
    """The row of each column where every row has a column of its own; None if there is no such pairing."""
    row_of: dict[int, int] = {}
    column_of: dict[int, int] = {}

    def place(start: int) -> bool:
        came: dict[int, int] = {}  # column -> row it was reached from
        waiting = [start]
        while waiting:
            i = waiting.pop()
            for k in rows[i]:
                if k in came:
                    continue
                came[k] = i
                if k in row_of:
                    waiting.append(row_of[k])
                    continue
                while True:  # every row on the way moves one column on
                    row = came[k]
                    previous = column_of.get(row, -1)
                    row_of[k], column_of[row] = row, k
                    if row == start:
                        return True
                    k = previous
        return False

    return row_of if all(place(i) for i in range(len(rows))) else None


def diagonal_blocks(rows: Sequence[Mapping[int, object]]) -> list[DiagonalBlock] | None:
    """The blocks of a matrix with as many rows as columns; None if it is singular whatever its numbers are."""
    row_of = match(rows)
    if row_of is None:
        return None
    column_of = {i: k for k, i in row_of.items()}
    needs = {i: [row_of[k] for k in rows[i] if k in row_of and row_of[k] != i] for i in range(len(rows))}
    index: dict[int, int] = {}
    low: dict[int, int] = {}
    stack: list[int] = []
    found: list[DiagonalBlock] = []
    for root in range(len(rows)):
        if root in index:
            continue
        work = [(root, iter(needs[root]))]
        index[root] = low[root] = len(index)
        stack.append(root)
        while work:
            i, rest = work[-1]
            step = next(rest, None)
            if step is not None:
                if step not in index:
                    index[step] = low[step] = len(index)
                    stack.append(step)
                    work.append((step, iter(needs[step])))
                elif step in stack:
                    low[i] = min(low[i], index[step])
                continue
            work.pop()
            if work:
                low[work[-1][0]] = min(low[work[-1][0]], low[i])
            if low[i] == index[i]:
                cut = stack.index(i)
                members = sorted(stack[cut:])
                del stack[cut:]
                found.append(DiagonalBlock(tuple(members), tuple(sorted(column_of[j] for j in members))))
    return found
