"""Scaled constraint Jacobian -> rank, connected parts of its rows, coordinates split in two at one position."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ..errors import PartitionError
from . import algebra
from .algebra import Array, Indices
from .limits.constraints import CHOSEN as STRICT
from .limits.constraints import PREFERENCE, UNMOVED
from .limits.constraints import STATE as RANK
from .limits.constraints import STRUCTURE as TOLERANCE

# -- ranks -------------------------------------------------------------------------------------------------------------


class Rank(NamedTuple):
    """Rank of a scaled Jacobian, and how clearly it is decided."""

    rank: int
    kept: float  #: smallest singular value counted, relative to the largest
    dropped: float  #: largest singular value not counted, relative to the largest

    @property
    def clear(self) -> bool:
        """Whether the decision is far from the tolerance on both sides (a factor of 100)."""
        return self.kept > 100.0 * TOLERANCE and self.dropped < 0.01 * TOLERANCE


def rank(J: Array, tolerance: float = TOLERANCE) -> Rank:
    """Numerical rank of a scaled Jacobian J (m, n) by its singular values."""
    values = algebra.singular_values(J) if J.size else np.empty(0)
    if not values.size or values[0] == 0.0:
        return Rank(0, 1.0, 0.0)
    relative = values / values[0]
    # rows may all be rounding of their terms: there is a least length, too
    count = int(np.count_nonzero((relative > tolerance) & (values > UNMOVED)))
    if not count:
        return Rank(0, 1.0, 0.0)
    return Rank(count, float(relative[count - 1]), float(relative[count]) if count < len(relative) else 0.0)


# -- connected parts of the pattern of a matrix ------------------------------------------------------------------------


WIDTH = 16  #: rows of a level at least: smaller ones are joined


class Level(NamedTuple):
    """Rows, and the coordinates that no level before has."""

    rows: Indices
    columns: Indices


def parts(J: Array) -> list[list[Level]]:
    """The connected parts of the pattern of J (m, n), each as levels; a coordinate that no row holds is a part."""
    m, n = J.shape
    rows, columns = np.nonzero(J)
    of_rows = np.split(columns, np.searchsorted(rows, np.arange(1, m)))
    order = np.argsort(columns, kind="stable")
    of_columns = np.split(rows[order], np.searchsorted(columns[order], np.arange(1, n)))
    held, collected = [x.tolist() for x in of_rows], [x.tolist() for x in of_columns]
    open_columns, result = np.ones(n, dtype=bool), list[list[Level]]()
    for k in range(n):
        if not open_columns[k]:
            continue
        levels = _levels(k, held, collected)
        if len(levels) > 1:  # from the coordinate of fewest rows among those farthest away
            far = next(level for level in reversed(levels) if level[1])[1]
            levels = _levels(min(far, key=lambda j: (len(collected[j]), j)), held, collected)
        for _, own in levels:
            open_columns[own] = False
        result.append([Level(np.array(a, dtype=np.intp), np.array(b, dtype=np.intp)) for a, b in _joined(levels)])
    return result


def _levels(start: int, held: Sequence[list[int]], result: Sequence[list[int]]) -> list[tuple[list[int], list[int]]]:
    """Rows and new columns of each level, from one column."""
    level, seen, known, levels = [start], {start}, set[int](), []
    while level:
        rows = sorted({i for j in level for i in result[j]} - known)
        known.update(rows)
        levels.append((rows, level))
        level = sorted({j for i in rows for j in held[i]} - seen)
        seen.update(level)
    return levels


def _joined(levels: Sequence[tuple[list[int], list[int]]]) -> Iterator[tuple[list[int], list[int]]]:
    rows: list[int] = []
    columns: list[int] = []
    for more, further in levels:
        rows, columns = rows + more, columns + further
        if len(rows) >= WIDTH:
            yield rows, columns
            rows, columns = [], []
    if columns:
        yield rows, columns


# -- partitions --------------------------------------------------------------------------------------------------------

# Gaussian elimination with complete pivoting: the columns of the pivots are the dependent coordinates, rows without
# a pivot are redundant here.


class Partition(NamedTuple):
    """The coordinates of one configuration split in two; all quantities scaled."""

    dependent: Indices  #: (r,) columns
    independent: Indices  #: (n - r,) columns, the preferred ones first and in their order
    rows: Indices  #: (r,) rows that determine the dependent coordinates; the others are redundant here
    inverse: Array  #: (r, r) inverse of J[rows, dependent]
    B: Array  #: (n, n - r) velocity transformation: v = B v_i (+ b_t), J B = 0

    def particular(self, y: Array) -> Array:
        """The x (n,) or (n, k) with J x = y on the pivot rows and x = 0 for the independent coordinates."""
        x = np.zeros((len(self.B), *y.shape[1:]))
        x[self.dependent] = self.inverse @ y[self.rows]
        return x


def partition(J: Array, rank: int, independent: Sequence[int] | Indices, strict: bool = False) -> Partition:
    """Split the coordinates of a scaled Jacobian J (m, n) of a rank, fixed for a mechanism.

    The columns ``independent`` are preferred as such, the others as dependent; ``strict`` takes exactly this set or
    fails.
    """
    n = J.shape[1]
    preferred = np.ones(n, dtype=bool)
    preferred[np.asarray(independent, dtype=np.intp)] = False
    columns = np.flatnonzero(preferred)
    work = J.take(columns, axis=1) if strict else np.array(J)
    size = float(np.abs(J).max()) if J.size else 0.0
    rows = np.empty(rank, dtype=np.intp)
    dependent = np.empty(rank, dtype=np.intp)
    for step in range(rank):
        magnitude = np.abs(work)  # zero in the rows and columns of the pivots before
        row, column, best = _best(magnitude if strict else magnitude.take(columns, axis=1))
        if not strict:
            column = int(columns[column]) if best > 0.0 else column
            row_any, column_any, best_any = _best(magnitude)
            if not best >= PREFERENCE * best_any or best == 0.0:
                row, column, best = row_any, column_any, best_any
        if not best > (STRICT if strict else RANK) * size:
            raise PartitionError(
                "the chosen independent coordinates cannot move the mechanism here (it is at a dead centre): "
                f"{step} of {rank} others follow from them; choose other independent coordinates"
                if strict
                else f"the constraints have rank {step} here and {rank} elsewhere"
            )
        rows[step], dependent[step] = row, columns[column] if strict else column
        work -= work[:, column, None] * (work[row] / work[row, column])
        work[row] = 0.0
    chosen = set(dependent.tolist())
    order = [i for i in map(int, independent) if i not in chosen]
    kept = np.array(order + sorted(set(range(n)) - chosen - set(order)), dtype=np.intp)
    inverse: Array = np.asarray(algebra.inv(J[rows[:, None], dependent]), dtype=np.float64)
    B = np.zeros((n, n - rank))
    B[kept, np.arange(n - rank)] = 1.0
    B[dependent] = -inverse @ J[rows[:, None], kept]
    return Partition(dependent, kept, rows, inverse, B)


def _best(magnitude: Array) -> tuple[int, int, float]:
    if not magnitude.size:
        return 0, 0, 0.0
    row, column = divmod(int(magnitude.argmax()), magnitude.shape[1])
    return row, column, float(magnitude[row, column])
