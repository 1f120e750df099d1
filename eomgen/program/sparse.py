"""Stage program: sparse matrices on the graph -> straight-line factors and solutions that know every zero.

The order of elimination is chosen by minimum degree (Tinney and Walker 1967), so that loops that are coupled in a row
cost the same each, however many there are.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from heapq import heapify, heappop, heappush
from typing import TypeVar

from ..graph.core import Expr
from ..records import dataclass

Row = dict[int, Expr]  #: column -> entry; zeros left out
Alike = TypeVar("Alike")
FEW = 6  #: rows or terms that are not worth parts of their own


def rows_of(matrix: Sequence[Sequence[Expr]]) -> list[Row]:
    """The entries of a dense matrix that are not identically zero."""
    zero = matrix[0][0].graph.zero.id if matrix and matrix[0] else 0
    return [{k: x for k, x in enumerate(row) if x.id != zero} for row in matrix]


def transpose(rows: Sequence[Mapping[int, Expr]], n: int) -> list[Row]:
    """The columns of a matrix with n of them, as rows."""
    result: list[Row] = [{} for _ in range(n)]
    for i, row in enumerate(rows):
        for k, x in row.items():
            result[k][i] = x
    return result


def dot(a: Mapping[int, Expr], b: Mapping[int, Expr]) -> Expr | None:
    """The sum of products of what both have; None if that is nothing."""
    total: Expr | None = None
    for k, x in a.items():
        if k in b:
            total = x * b[k] if total is None else total + x * b[k]
    return None if total is None or total.is_zero else total


def in_parts(alike: Sequence[Alike], x: Sequence[Expr]) -> Iterable[Alike]:
    """Rows or terms that are treated alike; many of them as parts of the graph of x, whose code is written once."""
    return x[0].graph.marked(alike) if len(alike) > FEW else alike


def times(rows: Sequence[Mapping[int, Expr]], x: Sequence[Expr]) -> list[Expr]:
    """The product of a matrix and a dense vector."""
    result = []
    for row in in_parts(rows, x):
        total = x[0].graph.zero if x else None
        for k, entry in in_parts(list(row.items()), x):
            total = entry * x[k] if total is None or total.is_zero else total + entry * x[k]
        assert total is not None
        result.append(total)
    return result


def gram(rows: Sequence[Mapping[int, Expr]]) -> list[Row]:
    """Both triangles of A A^T."""
    touching: dict[int, list[int]] = {}
    for i, row in enumerate(rows):
        for k in row:
            touching.setdefault(k, []).append(i)
    result: list[Row] = [{} for _ in rows]
    for i, row in enumerate(rows):
        for j in sorted({j for k in row for j in touching[k] if j <= i}):
            entry = dot(row, rows[j])
            if entry is not None:
                result[i][j] = result[j][i] = entry
    return result


def minimum_degree(pattern: Sequence[Mapping[int, object]]) -> list[int]:
    """An order of elimination with little fill of a symmetric pattern; the first of equals."""
    near = [set(row) - {i} for i, row in enumerate(pattern)]
    waiting = [(len(others), i) for i, others in enumerate(near)]
    heapify(waiting)
    gone = [False] * len(near)
    order = []
    while waiting:
        degree, i = heappop(waiting)
        if gone[i] or degree != len(near[i]):  # noted again since, with another degree
            continue
        order.append(i)
        gone[i] = True
        for k in near[i]:
            near[k] |= near[i]
            near[k] -= {i, k}
            heappush(waiting, (len(near[k]), k))
    return order


def fill(pattern: Sequence[Mapping[int, object]]) -> int:
    """About how many multiplications the factor of a symmetric pattern takes."""
    near = [set(row) - {i} for i, row in enumerate(pattern)]
    total = 0
    for i in minimum_degree(pattern):
        total += len(near[i]) * (len(near[i]) + 3) // 2
        for k in near[i]:
            near[k] |= near[i]
            near[k] -= {i, k}
    return total


@dataclass(frozen=True)
class SparseFactor:
    """P A P^T = L D L^T: ``columns[i]`` holds column i of L below its pivot, in the original indices."""

    order: tuple[int, ...]
    columns: tuple[Row, ...]
    pivots: tuple[Expr, ...]  #: by index
    reciprocals: tuple[Expr, ...]
    term: Expr | None = None  #: what A has on its diagonal beyond the matrix that is meant

    def settle(self, right: Sequence[Expr], passes: int) -> list[Expr]:
        """The sum of the z of so many passes, each for what the last one left: (A - t I) z = right leaves t z."""
        z = total = self.solve(right)
        for _ in range(passes - 1):
            term = self.term
            assert term is not None
            z = self.solve([term * x for x in in_parts(z, z)])
            total = [a + b for a, b in in_parts(list(zip(total, z, strict=True)), z)]
        return total

    def solve(self, right: Sequence[Expr]) -> list[Expr]:
        """x with A x = right."""
        x = list(right)
        for i in self.order:
            if not x[i].is_zero:
                for k, ratio in self.columns[i].items():
                    x[k] = x[k] - ratio * x[i]
        for i in reversed(self.order):
            total = x[i] * self.reciprocals[i]
            for k, ratio in self.columns[i].items():
                if not x[k].is_zero:
                    total = total - ratio * x[k]
            x[i] = total
        return x


def factorize(matrix: Sequence[Mapping[int, Expr]], term: Expr | None = None) -> SparseFactor:
    """Factor a symmetric positive definite matrix given by both triangles, without square roots.

    ``term`` is what its diagonal has beyond the matrix that is meant; see :meth:`SparseFactor.settle`.
    """
    work = [dict(row) for row in matrix]
    order = minimum_degree(matrix)
    columns: list[Row] = [{} for _ in work]
    pivots = [row[i] for i, row in enumerate(work)]
    reciprocals = list(pivots)
    for i in order:
        pivot = pivots[i] = work[i].pop(i)
        inverse = reciprocals[i] = 1.0 / pivot
        below = sorted(work[i])
        for k in below:
            columns[i][k] = work[i][k] * inverse
            del work[k][i]
        for a, k in enumerate(below):
            for j in below[: a + 1]:
                change = columns[i][k] * work[i][j]
                work[k][j] = work[j][k] = work[k][j] - change if j in work[k] else -change
    return SparseFactor(tuple(order), tuple(columns), tuple(pivots), tuple(reciprocals), term)
