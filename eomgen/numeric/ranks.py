"""Stage numeric: scaled constraint Jacobians at several configurations -> rank, redundant rows, good coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import comb
from typing import NamedTuple

import numpy as np

from ..limits.constraints import PREFERENCE, UNMOVED
from ..limits.constraints import STRUCTURE as TOLERANCE
from . import algebra
from .scales import Array, Indices

#: At most so many sets of coordinates are compared one by one, where that takes at most so many singular values.
ENUMERATED, DECOMPOSED = 500, 20_000


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


def choose_independent(jacobians: Sequence[Array], rank: int, prefer: Sequence[int] = ()) -> Indices:
    """The independent coordinates that stay best conditioned over several configurations.

    Parameters
    ----------
    jacobians : sequence of (m, n) arrays
        Scaled Jacobians at assembled configurations.
    rank : int
        Rank of the constraints.
    prefer : sequence of int
        Columns to choose first where the worst conditioning stays within a factor of 100 of the best possible.

    Returns
    -------
    (n - rank,) array of int
        Columns in ascending order.
    """
    n = jacobians[0].shape[1]
    size = n - rank
    order = list(dict.fromkeys([*prefer, *range(n)]))  # earlier wins among equals

    largest = [algebra.norm2(J) for J in jacobians]

    def worst(columns: Sequence[int]) -> float:
        return min(conditioning(J, columns, most) for J, most in zip(jacobians, largest, strict=True))

    if comb(n, size) <= min(ENUMERATED, DECOMPOSED // n):
        sets: list[tuple[int, ...]] = list(combinations(order, size))
    else:
        sets = list(dict.fromkeys(_eliminate(J, rank, order) for J in jacobians))
        if len(prefer) >= size:
            sets.append(tuple(order[:size]))
    scores = [worst(columns) for columns in sets]
    limit = max(scores)
    favoured = set(prefer)
    good = [(s, c) for s, c in zip(scores, sets, strict=True) if s >= PREFERENCE * limit]
    most = max(len(favoured.intersection(c)) for _, c in good)
    best = max((s for s, c in good if len(favoured.intersection(c)) == most), default=limit)
    for score, columns in good:
        if len(favoured.intersection(columns)) == most and score >= 0.999999 * best:
            return np.array(sorted(columns), dtype=np.intp)
    return np.array(sorted(sets[int(np.argmax(scores))]), dtype=np.intp)


def _eliminate(J: Array, rank: int, order: Sequence[int]) -> tuple[int, ...]:
    """Independent columns by pivoting, so that the front of `order` stays independent.

    Few dependent columns are found from the back of `order` by elimination in J; few independent ones from its front,
    by elimination in the motions that J allows.
    """
    if len(order) - rank < rank:
        motions = algebra.svd(J)[2][rank:]
        found = _pivots(motions, len(order) - rank, list(order))
        return tuple(c for c in order if c in found)
    dependent = _pivots(J, rank, list(reversed(order)))
    return tuple(c for c in order if c not in dependent)


def _pivots(rows: Array, count: int, order: Sequence[int]) -> set[int]:
    """Columns that span the column space: each the first in `order` that is not much nearer to the span than others."""
    work, chosen = np.array(rows), set[int]()
    places = np.array(order, dtype=np.intp)
    for _ in range(count):
        length = np.linalg.norm(work, axis=0)
        length[list(chosen)] = 0.0
        column = int(places[np.flatnonzero(length[places] >= 0.3 * length.max())[0]])
        if column in chosen:  # nothing is left to choose by
            column = next(c for c in order if c not in chosen)
        chosen.add(column)
        direction = work[:, column] / (length[column] or 1.0)
        work -= np.outer(direction, direction @ work)
    return chosen
