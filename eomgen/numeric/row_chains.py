"""Stage numeric: a large scaled Jacobian, most of it zero -> its rank and motions, in work that grows with its rows.

Rows that share no coordinate, nor are connected through others, make parts of their own, whose singular values are
together those of the whole.  The rows of a part are met breadth first from one of its ends: those of a level hold
coordinates of this level and of the next alone.  Along the levels the rows are turned into each other by orthogonal
matrices of the size of a level, which leave singular values as they are (C. L. Lawson and R. J. Hanson, Solving Least
Squares Problems, 1974, chapter 27).

The rank found so is proven: what was kept has no singular value near the tolerance, because the inverse of the
triangle is bounded, and what was dropped has none, because its length is.  Where neither can be said, singular values
of the part decide, or of the whole where one of them may be on either side; of small matrices they decide at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array, Indices
from ..base.limits.constraints import STRUCTURE, UNMOVED
from .ranks import rank

SMALL = 20_000  #: entries up to which all singular values of a matrix are found at once
WIDTH = 16  #: rows of a level at least: smaller ones are joined
CLEAR = 2.0  #: factor between the tolerance and the bounds of what is kept and what is dropped


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
    held, found = [x.tolist() for x in of_rows], [x.tolist() for x in of_columns]
    open_columns, result = np.ones(n, dtype=bool), list[list[Level]]()
    for k in range(n):
        if not open_columns[k]:
            continue
        levels = _levels(k, held, found)
        if len(levels) > 1:  # from the coordinate of fewest rows among those farthest away
            far = next(level for level in reversed(levels) if level[1])[1]
            levels = _levels(min(far, key=lambda j: (len(found[j]), j)), held, found)
        for _, own in levels:
            open_columns[own] = False
        result.append([Level(np.array(a, dtype=np.intp), np.array(b, dtype=np.intp)) for a, b in _joined(levels)])
    return result


def _levels(start: int, held: Sequence[list[int]], found: Sequence[list[int]]) -> list[tuple[list[int], list[int]]]:
    """Rows and new columns of each level, from one column."""
    level, seen, known, levels = [start], {start}, set[int](), []
    while level:
        rows = sorted({i for j in level for i in found[j]} - known)
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


class ChainStep(NamedTuple):
    """One level turned: Q^T of the coordinates that are open and of those that are new."""

    turn: Array  #: Q (c, c), its first columns what the rows of the level hold
    sizes: Array  #: (r,) singular values kept
    coupling: Array  #: (r, rows of the next level) what those have along the same directions
    rest: Array  #: (c - r, c - r) orthogonal: its last columns are directions that no further row has
    new: Indices


class Chain:
    """The levels of one part turned one after the other.

    Parameters
    ----------
    J : (m, n) array
    levels : sequence of Level
    least : float
        Singular values of a level that are not above it are dropped.
    """

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
        found, open_ = np.zeros((n, self.size - self.rank)), np.empty((0, 0))
        for turn, sizes, _, rest, new in reversed(self.steps):
            width = open_.shape[1] + len(rest) - len(open_)
            ahead = np.zeros((len(rest), width))
            ahead[: len(open_), : open_.shape[1]] = open_
            ahead[len(open_) :, open_.shape[1] :] = np.eye(len(rest) - len(open_))
            open_ = turn[:, len(sizes) :] @ (rest @ ahead)
            here = len(turn) - len(new)
            found[new, :width], open_ = open_[here:], open_[:here]
        found[self.start, : open_.shape[1]] = open_
        return found.T


class Decomposed:
    """A part whose levels do not tell its rank, by its singular values."""

    def __init__(self, J: Array, levels: Sequence[Level], most: float) -> None:
        self.columns = np.concatenate([level.columns for level in levels])
        rows = np.concatenate([level.rows for level in levels])
        _, self.sizes, self._turned = algebra.svd(J[np.ix_(rows, self.columns)])
        self.rank = int(np.count_nonzero(self.sizes > most))

    def motions(self, n: int) -> Array:
        """As of Chain."""
        found = np.zeros((len(self.columns) - self.rank, n))
        found[:, self.columns] = self._turned[self.rank :]
        return found


def _svd(A: Array) -> tuple[Array, Array, Array]:
    return algebra.svd(A) if A.size else (np.eye(len(A)), np.empty(0), np.eye(A.shape[1]))


def _qr(A: Array) -> tuple[Array, Array]:
    """Q (c, c) and the triangle; none where all directions are in further rows."""
    return algebra.qr(A, complete=True) if len(A) > A.shape[1] > 0 else (np.eye(len(A)), A)


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
    def _told(self) -> list[Chain | Decomposed]:
        """Of each part its rank; none where some singular value may be on either side of the tolerance."""
        if self.J.size <= SMALL:
            return []
        size = np.abs(self.J)
        # the largest singular value is between these
        most = float(np.sqrt(size.sum(axis=0).max(initial=0.0) * size.sum(axis=1).max(initial=0.0)))
        some = float(np.sqrt((self.J * self.J).sum(axis=1).max(initial=0.0)))
        most, least = (max(self.tolerance * x, UNMOVED) for x in (most, some))
        told: list[Chain | Decomposed] = []
        for levels in self._parts:
            with np.errstate(all="ignore"):
                chain = Chain(self.J, levels, least)
                kept = chain.inverse_square * (CLEAR * most) ** 2 < 1.0
            if kept and chain.dropped * CLEAR**2 < least**2:
                told.append(chain)
                continue
            part = Decomposed(self.J, levels, most)
            if ((part.sizes > least) & (part.sizes <= most)).any():
                return []
            told.append(part)
        return told

    @cached_property
    def rank(self) -> int:
        """As :func:`~.ranks.rank` counts it."""
        return sum(part.rank for part in self._told) if self._told else rank(self.J, self.tolerance).rank

    def motions(self, rank: int) -> Array:
        """Orthonormal directions (n - rank, n) along which the rows change least: not at all, if it is their rank."""
        if not self._told or rank != self.rank:
            return algebra.svd(self.J)[2][rank:]
        return np.vstack([part.motions(self.J.shape[1]) for part in self._told])

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
        """As :func:`~.ranks.conditioning` finds it."""
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
