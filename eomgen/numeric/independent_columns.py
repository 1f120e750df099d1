"""Stage numeric: scaled Jacobians at several configurations -> the coordinates that are well chosen as independent."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import comb

import numpy as np

from ..base.algebra import Array, Indices
from ..base.limits.constraints import PREFERENCE
from .row_chains import SparseRows

#: At most so many sets of coordinates are compared one by one, where that takes at most so many singular values.
ENUMERATED, DECOMPOSED = 500, 20_000


def choose_independent(jacobians: Sequence[SparseRows], rank: int, prefer: Sequence[int] = ()) -> Indices:
    """The independent coordinates that stay best conditioned over several configurations.

    Parameters
    ----------
    jacobians : sequence of SparseRows
        Scaled Jacobians (m, n) at assembled configurations.
    rank : int
        Rank of the constraints.
    prefer : sequence of int
        Columns to choose first where the worst conditioning stays within a factor of 100 of the best possible.

    Returns
    -------
    (n - rank,) array of int
        Columns in ascending order.
    """
    n = jacobians[0].J.shape[1]
    size = n - rank
    order = list(dict.fromkeys([*prefer, *range(n)]))  # earlier wins among equals
    if comb(n, size) <= min(ENUMERATED, DECOMPOSED // n):
        sets: list[tuple[int, ...]] = list(combinations(order, size))
    else:
        sets = list(dict.fromkeys(_eliminate(x, rank, order) for x in jacobians))
        if len(prefer) >= size:
            sets.append(tuple(order[:size]))
    if len(sets) == 1:
        return np.array(sorted(sets[0]), dtype=np.intp)
    scores = [min(x.conditioning(columns) for x in jacobians) for columns in sets]
    limit = max(scores)
    favoured = set(prefer)
    good = [(s, c) for s, c in zip(scores, sets, strict=True) if s >= PREFERENCE * limit]
    most = max(len(favoured.intersection(c)) for _, c in good)
    best = max((s for s, c in good if len(favoured.intersection(c)) == most), default=limit)
    for score, columns in good:
        if len(favoured.intersection(columns)) == most and score >= 0.999999 * best:
            return np.array(sorted(columns), dtype=np.intp)
    return np.array(sorted(sets[int(np.argmax(scores))]), dtype=np.intp)


def _eliminate(rows: SparseRows, rank: int, order: Sequence[int]) -> tuple[int, ...]:
    """Independent columns by pivoting, so that the front of `order` stays independent.

    Few dependent columns are found from the back of `order` by elimination in the rows; few independent ones from its
    front, by elimination in the motions that the rows allow.
    """
    if len(order) - rank < rank:
        found = _pivots(rows.motions(rank), len(order) - rank, list(order))
        return tuple(c for c in order if c in found)
    dependent = _pivots(rows.J, rank, list(reversed(order)))
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
        moved = np.flatnonzero(along := direction @ work)  # few, where each loop has coordinates of its own
        held = np.flatnonzero(direction)
        work[np.ix_(held, moved)] -= np.outer(direction[held], along[moved])
    return chosen
