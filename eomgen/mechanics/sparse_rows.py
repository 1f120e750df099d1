"""Scaled constraint Jacobian -> rank, redundant rows, independent coordinates, in work that grows with the nonzeros."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import combinations
from math import comb
from typing import NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array, Indices, Level, parts, rank
from ..base.limits.constraints import PREFERENCE, STRUCTURE, UNMOVED

# -- rows and columns of one matrix ------------------------------------------------------------------------------------


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


# -- chains of rows ----------------------------------------------------------------------------------------------------

# Rows that share no coordinate, nor are connected through others, make parts of their own, whose singular values are
# together those of the whole.  The rows of a part are met breadth first from one of its ends: those of a level hold
# coordinates of this level and of the next alone.  Along the levels the rows are turned into each other by orthogonal
# matrices of the size of a level, which leave singular values as they are (C. L. Lawson and R. J. Hanson, Solving Least
# Squares Problems, 1974, chapter 27).
#
# The rank found so is proven: what was kept has no singular value near the tolerance, because the inverse of the
# triangle is bounded, and what was dropped has none, because its length is.  Where neither can be said, singular values
# of the part decide, or of the whole where one of them may be on either side; of small matrices they decide at once.


SMALL = 20_000  #: entries up to which all singular values of a matrix are found at once
CLEAR = 2.0  #: factor between the tolerance and the bounds of what is kept and what is dropped


class ChainStep(NamedTuple):
    """One level turned: Q^T of the coordinates that are open and of those that are new."""

    turn: Array  #: Q (c, c), its first columns what the rows of the level hold
    sizes: Array  #: (r,) singular values kept
    coupling: Array  #: (r, rows of the next level) what those have along the same directions
    rest: Array  #: (c - r, c - r) orthogonal: its last columns are directions that no further row has
    new: Indices


class Chain:
    """The levels of one part turned one after the other; singular values of a level not above ``least`` are dropped."""

    def __init__(self, J: Array, levels: Sequence[Level], least: float) -> None:
        self.start, self.steps, self.rank, self.dropped = levels[0].columns, list[ChainStep](), 0, 0.0
        self.size = sum(len(level.columns) for level in levels)
        none = np.empty(0, dtype=np.intp)
        front = J[np.ix_(levels[0].rows, levels[0].columns)].T
        for (rows, _), (following, new) in zip(levels, [*levels[1:], Level(none, none)], strict=True):
            turn, sizes, mixed = _svd(np.vstack([front, J[np.ix_(rows, new)].T]))
            if self.steps:  # in the combinations of rows that the level is turned into
                before = self.steps[-1]
                self.steps[-1] = before._replace(coupling=before.coupling @ mixed[: np.count_nonzero(sizes > least)].T)
            kept = int(np.count_nonzero(sizes > least))
            self.rank, self.dropped = self.rank + kept, self.dropped + float((sizes[kept:] ** 2).sum())
            more = turn[len(front) :].T @ J[np.ix_(following, new)].T
            rest, front = _qr(more[kept:])
            self.steps.append(ChainStep(turn, sizes[:kept], more[:kept], rest, new))
            front = front[: len(following)]

    @property
    def inverse_square(self) -> float:
        """Sum of the squares of the entries of the inverse of what was kept, at least 1 / s^2 of its least s."""
        total, after = 0.0, np.empty((0, 0))
        for _, sizes, coupling, _, _ in reversed(self.steps):
            after = (np.eye(len(sizes)) + coupling @ after @ coupling.T) / np.outer(sizes, sizes)
            total += float(np.trace(after))
        return total

    def motions(self, n: int) -> Array:
        """Orthonormal directions (n - r, n) along which no row changes."""
        result, open_ = np.zeros((n, self.size - self.rank)), np.empty((0, 0))
        for turn, sizes, _, rest, new in reversed(self.steps):
            width = open_.shape[1] + len(rest) - len(open_)
            ahead = np.zeros((len(rest), width))
            ahead[: len(open_), : open_.shape[1]] = open_
            ahead[len(open_) :, open_.shape[1] :] = np.eye(len(rest) - len(open_))
            open_ = turn[:, len(sizes) :] @ (rest @ ahead)
            here = len(turn) - len(new)
            result[new, :width], open_ = open_[here:], open_[:here]
        result[self.start, : open_.shape[1]] = open_
        return result.T


class Decomposed:
    """A part whose levels do not tell its rank, by its singular values."""

    def __init__(self, J: Array, levels: Sequence[Level], most: float) -> None:
        self.columns = np.concatenate([level.columns for level in levels])
        rows = np.concatenate([level.rows for level in levels])
        _, self.sizes, self._turned = algebra.svd(J[np.ix_(rows, self.columns)])
        self.rank = int(np.count_nonzero(self.sizes > most))

    def motions(self, n: int) -> Array:
        """As of Chain."""
        result = np.zeros((len(self.columns) - self.rank, n))
        result[:, self.columns] = self._turned[self.rank :]
        return result


def _svd(A: Array) -> tuple[Array, Array, Array]:
    return algebra.svd(A) if A.size else (np.eye(len(A)), np.empty(0), np.eye(A.shape[1]))


def _qr(A: Array) -> tuple[Array, Array]:
    """Q (c, c) and the triangle; none where all directions are in further rows."""
    return algebra.qr(A, mode="complete") if len(A) > A.shape[1] > 0 else (np.eye(len(A)), A)


class SparseRows:
    """A scaled Jacobian J (m, n) of finite entries, by parts."""

    def __init__(self, J: Array, tolerance: float = STRUCTURE) -> None:
        self.J, self.tolerance = J, tolerance

    @cached_property
    def _parts(self) -> list[list[Level]]:
        m, n = self.J.shape
        return (
            parts(self.J)
            if self.J.size > SMALL
            else [[Level(np.arange(m, dtype=np.intp), np.arange(n, dtype=np.intp))]]
        )

    @cached_property
    def _entries(self) -> list[Chain | Decomposed]:
        """Of each part its rank; none where some singular value may be on either side of the tolerance."""
        if self.J.size <= SMALL:
            return []
        size = np.abs(self.J)
        # the largest singular value is between these
        most = float(np.sqrt(size.sum(axis=0).max(initial=0.0) * size.sum(axis=1).max(initial=0.0)))
        some = float(np.sqrt((self.J * self.J).sum(axis=1).max(initial=0.0)))
        most, least = (max(self.tolerance * x, UNMOVED) for x in (most, some))
        entries: list[Chain | Decomposed] = []
        for levels in self._parts:
            with np.errstate(all="ignore"):
                chain = Chain(self.J, levels, least)
                kept = chain.inverse_square * (CLEAR * most) ** 2 < 1.0
            if kept and chain.dropped * CLEAR**2 < least**2:
                entries.append(chain)
                continue
            part = Decomposed(self.J, levels, most)
            if ((part.sizes > least) & (part.sizes <= most)).any():
                return []
            entries.append(part)
        return entries

    @cached_property
    def rank(self) -> int:
        """As :func:`~eomgen.base.algebra.rank` counts it."""
        return sum(part.rank for part in self._entries) if self._entries else rank(self.J, self.tolerance).rank

    def motions(self, rank: int) -> Array:
        """Orthonormal directions (n - rank, n) along which the rows change least: not at all, if it is their rank."""
        if not self._entries or rank != self.rank:
            return algebra.svd(self.J)[2][rank:]
        return np.vstack([part.motions(self.J.shape[1]) for part in self._entries])

    @cached_property
    def _places(self) -> list[tuple[Indices, Indices]]:
        """Rows and columns of each part."""
        joined = [zip(*levels, strict=True) for levels in self._parts]
        return [(np.sort(np.concatenate(rows)), np.sort(np.concatenate(columns))) for rows, columns in joined]

    @cached_property
    def largest(self) -> float:
        """The largest singular value."""
        return max((algebra.norm2(self.J[np.ix_(*place)]) for place in self._places if len(place[0])), default=0.0)

    def conditioning(self, independent: Sequence[int] | Indices) -> float:
        """How well a set of independent coordinates moves the mechanism: 1 is perfect, 0 not at all.

        The smallest singular value of J_d divided by the largest of J, where d are the other columns.
        """
        chosen, least = np.zeros(self.J.shape[1], dtype=bool), np.inf
        chosen[np.asarray(independent, dtype=np.intp)] = True
        if chosen.all():
            return 1.0
        for rows, columns in self._places:
            dependent = columns[~chosen[columns]]
            if len(dependent) > len(rows):
                return 0.0
            if len(dependent):
                least = min(least, float(algebra.singular_values(self.J[np.ix_(rows, dependent)])[-1]))
        return least / self.largest if self.largest else 0.0


# -- independent columns -----------------------------------------------------------------------------------------------


#: At most so many sets of coordinates are compared one by one, where that takes at most so many singular values.
ENUMERATED, DECOMPOSED = 500, 20_000


def choose_independent(jacobians: Sequence[SparseRows], rank: int, prefer: Sequence[int] = ()) -> Indices:
    """The n - rank independent columns, ascending, that stay best conditioned at several assembled configurations.

    Those to ``prefer`` come first where the worst conditioning stays within a factor of 100 of the best possible.
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
        result = _pivots(rows.motions(rank), len(order) - rank, list(order))
        return tuple(c for c in order if c in result)
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
        support = np.flatnonzero(direction)
        work[np.ix_(support, moved)] -= np.outer(direction[support], along[moved])
    return chosen


# -- block triangular form ---------------------------------------------------------------------------------------------

# Duff, Erisman and Reid, *Direct Methods for Sparse Matrices* (2nd ed. 2017), chapter 6: rows are matched with columns,
# and the strong components (Tarjan 1972) of what then depends on what are the blocks.


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
    result: list[DiagonalBlock] = []
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
                result.append(DiagonalBlock(tuple(members), tuple(sorted(column_of[j] for j in members))))
    return result
