"""Stage numeric: scaled constraint Jacobian -> dependent and independent coordinates, and what the first follow from.

Gaussian elimination with complete pivoting: the columns of the pivots are the dependent coordinates, rows without
a pivot are redundant here.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array, Indices
from ..base.limits.constraints import CHOSEN as STRICT
from ..base.limits.constraints import PREFERENCE
from ..base.limits.constraints import STATE as RANK
from ..errors import PartitionError


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
    """Split the coordinates.

    Parameters
    ----------
    J : (m, n) array
        Scaled Jacobian.
    rank : int
        Number of dependent coordinates, fixed for a mechanism.
    independent : sequence of int
        Preferred independent columns; the other columns are preferred as dependent.
    strict : bool
        Take exactly this set or fail.

    Returns
    -------
    Partition

    Raises
    ------
    PartitionError
        Fewer than `rank` good pivots: below STATE of the largest entry, or CHOSEN if `strict`.
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
