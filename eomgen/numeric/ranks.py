"""Stage numeric: scaled constraint Jacobian -> rank, redundant rows, how good independent coordinates are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array, Indices
from ..base.limits.constraints import PREFERENCE, UNMOVED
from ..base.limits.constraints import STRUCTURE as TOLERANCE


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


def independent_rows(J: Array, rank: int) -> Indices:
    """`rank` rows that span the row space, in ascending order.

    Earlier rows are preferred: a row is skipped only when the best remaining one is a hundred times farther from the
    span of the chosen ones.
    """
    if rank == len(J):
        return np.arange(rank, dtype=np.intp)
    work, distance = np.array(J), np.linalg.norm(J, axis=1)
    chosen: list[int] = []
    for _ in range(rank):
        chosen.append(int(np.flatnonzero(distance >= PREFERENCE * distance.max())[0]))
        direction = work[chosen[-1]] / distance[chosen[-1]]
        moved = np.flatnonzero(along := work @ direction)  # few, where each loop has coordinates of its own
        work[moved] -= np.outer(along[moved], direction)
        distance[moved] = np.linalg.norm(work[moved], axis=1)
        distance[chosen] = 0.0
    return np.array(sorted(chosen), dtype=np.intp)


def redundant_rows(J: Array, rank: int, labels: Sequence[str]) -> list[str]:
    """Labels of the rows that follow from the others at this configuration."""
    kept = set(independent_rows(J, rank).tolist())
    return [label for row, label in enumerate(labels) if row not in kept]


def conditioning(J: Array, independent: Sequence[int] | Indices, size: float | None = None) -> float:
    """How well a set of independent coordinates moves the mechanism: 1 is perfect, 0 not at all.

    The smallest singular value of J_d divided by the largest of J, where d are the other columns; ``size`` is that
    largest one, where it is known already.
    """
    n = J.shape[1]
    dependent = np.delete(np.arange(n), np.asarray(independent, dtype=np.intp))
    if not dependent.size:
        return 1.0
    values = algebra.singular_values(J[:, dependent])
    if len(values) < len(dependent):
        return 0.0
    size = algebra.norm2(J) if size is None else size
    return float(values[len(dependent) - 1] / size) if size else 0.0
