"""Stage runtime: velocities at a change point -> those of a motion that goes on; those not given, from its branches.

Where rank is lost, C_q v + C_t = 0 lets through mixtures of the velocities of several branches, which no motion has.
One has accelerations too: with L^T C_q = 0, the rates of C_q v + C_t at constant v, b(v), must fulfil L^T b(v) = 0.
These equations are quadratic in v, and each branch is a solution: the tangent cone of the constraints.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ..base import algebra
from ..base.algebra import Array, Indices
from ..base.limits.constraints import ACCEPTED, BRANCH_STEP, COUPLED, GONE, ONE_BRANCH, PASSED
from ..errors import AssemblyError
from ..numeric.closure import ClosureSystem
from ..numeric.projection import largest
from ..numeric.row_chains import parts
from .failure import place
from .kernels import Kernels

STARTS = 60  #: from which the branches are looked for
ROUNDS = 40  #: of Newton's method from each


def where_lost(system: ClosureSystem, q: Array) -> Array:
    """The position where rank is lost beside a closed q, which by itself tells it to the root of its residual only.

    With L and R of the directions lost, L^T J R = 0 is linear in the distance from there.
    """
    moves = np.flatnonzero(system.free)
    if not len(moves):
        return q
    least, best = largest(system.evaluate(q)[0]), q
    for _ in range(2):
        J = system.evaluate(best)[1][:, moves]
        U, sizes, V = algebra.svd(J)
        kept = int(np.count_nonzero(sizes > PASSED * sizes[0]))
        L, R = U[:, kept:], np.zeros((len(system.free), len(moves) - kept))
        R[moves] = V[kept:].T
        if not (L.size and R.size):
            break

        def left(y: Array, q: Array = best, L: Array = L, R: Array = R) -> Array:
            return (L.T @ system.evaluate(system.scales.move(q, R @ y))[1] @ R).ravel()

        steps = BRANCH_STEP * np.eye(R.shape[1])
        slopes = np.array([left(y) - left(-y) for y in steps]).T / (2.0 * BRANCH_STEP)
        P, heard, Q = algebra.svd(slopes)
        k = int(np.count_nonzero(heard > COUPLED))
        y = -Q[:k].T @ ((P[:, :k].T @ left(np.zeros(len(steps)))) / heard[:k])
        trial = system.scales.move(best, R @ y)
        size = largest(system.evaluate(trial)[0])
        if not (size <= least and largest(y) <= PASSED):
            break
        least, best = size, trial
    return best


def on_branches(
    kernels: Kernels, t: float, q: Array, J: Array, given: Mapping[str, Sequence[Array]], v: Array
) -> Array:
    """The velocities (n,) or (n, m) of the only branch that has the given ones, or AssemblyError; see StartBranch."""
    if v.ndim > 1:
        return np.array([on_branches(kernels, t, q, J, given, column) for column in v.T]).T
    for part in _parts(kernels, J, given):
        v = StartBranch(kernels, t, q, J, given, part).complete(v)
    return v


def _parts(kernels: Kernels, J: Array, given: Mapping[str, Sequence[Array]]) -> Iterator[tuple[Indices, Indices]]:
    """Rows and velocities of loops that are connected, by given velocities too."""
    known = kernels.layout.scales.known
    held = [row != 0.0 for gradients in given.values() for row in gradients]
    pattern = np.array([*(np.ones(J.shape, dtype=bool) if known is None else known), *held])
    for levels in parts(pattern):
        rows = np.concatenate([level.rows for level in levels])
        if len(rows := np.sort(rows[rows < len(J)])):
            yield rows, np.sort(np.concatenate([level.columns for level in levels]))


class StartBranch:
    """The branches at one position where rank is lost, of loops each of which is connected with the others.

    Others may be as fast as they like: speeds are those of the coordinates that the lost rows know.

    Parameters
    ----------
    kernels : Kernels
    t : float
    q : (n_q,) array
        A closed position.
    J : (n_c, n_v) array
        The scaled C_q there.
    given : mapping of str to sequence of (n_v,) arrays
        Names of the velocities given, and their scaled gradients.
    part : pair of arrays of int
        The rows of these loops, and their velocities.
    """

    def __init__(
        self,
        kernels: Kernels,
        t: float,
        q: Array,
        J: Array,
        given: Mapping[str, Sequence[Array]],
        part: tuple[Indices, Indices],
    ) -> None:
        self.kernels, self.t, self.q, self.names = kernels, t, q, list(given)
        self.layout = kernels.layout
        self.scales = self.layout.scales
        (m, n), (rows, columns) = J.shape, part
        U, sizes, V = algebra.svd(J[np.ix_(rows, columns)])
        kept = int(np.count_nonzero(sizes > GONE * sizes[0]))
        self.lost, free = np.zeros((m, len(rows) - kept)), np.zeros((n, len(columns) - kept))
        self.lost[rows], free[columns] = U[:, kept:], V[kept:].T
        held = np.array([row for gradients in given.values() for row in gradients])
        if len(held):
            _, sizes, V = algebra.svd(held @ free)
            free = free @ V[int(np.count_nonzero(sizes > GONE)) :].T
        self.free, self.columns = free, columns

    def bends(self, v: Array, speed: float) -> Array:
        """L^T b(v) (k,) over the square of a speed, of scaled velocities v."""
        h = BRANCH_STEP / speed
        ends = []
        for side in (h, -h):
            x = np.concatenate([self.scales.move(self.q, side * v), v * self.scales.q])
            ends.append(self.kernels.velocity_constraints.every(x, t=self.t + side) / self.scales.c)
        return np.asarray(self.lost.T @ (ends[0] - ends[1]) / (2.0 * h * speed**2))

    def complete(self, v: Array) -> Array:
        """The velocities (n,) of the only branch that has the given ones.

        Raises
        ------
        AssemblyError
            No branch has them, or several.
        """
        heard = np.abs(self.lost).max(axis=1, initial=0.0) > GONE
        speed = float(self.scales.row_speeds(v)[heard].max(initial=0.0))
        if not speed > ACCEPTED * self.scales.speed(v):
            return v  # at rest nothing decides the branch
        d = np.zeros(len(v))
        d[self.columns] = (v / self.scales.q)[self.columns]
        here = self.bends(d, speed)
        slopes = self._slopes(d, speed)
        undecided = self._heard(slopes)
        if not undecided.shape[1] and np.abs(here).max(initial=0.0) <= ONE_BRANCH:
            return v
        found = self._roots(d, undecided * speed, speed, here)
        if not found and self.free.size:  # midway between branches slopes vanish
            ways = np.random.default_rng(2).normal(size=(2, self.free.shape[1]))
            slopes = np.vstack([slopes, *(self._slopes(d + speed * self.free @ way, speed) for way in ways)])
            undecided = self._heard(slopes)
            found = self._roots(d, undecided * speed, speed, here)
        found = [v + w * self.scales.q for w in found]
        if len(found) != 1:
            faults = slopes[: len(here)] @ (self.free.T @ undecided) if undecided.shape[1] else here
            raise self._refusal(v, faults, undecided, found)
        return found[0]

    def _slopes(self, d: Array, speed: float) -> Array:
        """How L^T b changes along the free directions, (k, f)."""
        steps = [speed * w for w in self.free.T]
        up, down = (np.array([self.bends(d + side * w, speed) for w in steps]) for side in (1.0, -1.0))
        return np.asarray(0.5 * (up - down).reshape(len(steps), self.lost.shape[1]).T)

    def _heard(self, slopes: Array) -> Array:
        """The free directions (n, u) that slopes see."""
        if not slopes.size:
            return np.empty((len(self.free), 0))
        _, sizes, V = algebra.svd(slopes)
        return np.asarray(self.free @ V[: int(np.count_nonzero(sizes > COUPLED))].T)

    def _roots(self, d: Array, W: Array, speed: float, here: Array) -> list[Array]:
        """What W y leads from d to branches; quadratic in y, so that their coefficients are differences."""
        k = W.shape[1]
        if not k:
            return []
        unit = np.eye(k)

        def value(y: Array) -> Array:
            return self.bends(d + W @ y, speed)

        up, down = (np.array([value(side * e) for e in unit]) for side in (1.0, -1.0))
        K = 0.5 * (up - down).T
        H = np.empty((len(here), k, k))
        for i in range(k):
            H[:, i, i] = 0.5 * (up[i] + down[i]) - here
            for j in range(i):
                both = value(unit[i] + unit[j]) - up[i] - up[j] + here
                H[:, i, j] = H[:, j, i] = 0.5 * both
        random, found = np.random.default_rng(1), list[Array]()
        for n in range(STARTS):
            y = random.normal(size=k) * (0.0, 1.0, 3.0)[min(n, 1 + n % 2)]
            for _ in range(ROUNDS):
                F = here + K @ y + (H @ y) @ y
                y = y - algebra.pinv(K + 2.0 * H @ y, rcond=GONE) @ F
            size = 1.0 + float(np.abs(y).max())
            if not np.abs(here + K @ y + (H @ y) @ y).max() <= ONE_BRANCH * size**2:
                continue
            way = W @ y
            if all(np.abs(way - other).max() > COUPLED * speed * size for other in found):
                found.append(way)
        return found

    def _refusal(self, v: Array, faults: Array, undecided: Array, found: list[Array]) -> AssemblyError:
        layout = self.layout
        rows = np.abs(self.lost @ faults.reshape(len(faults), -1)).max(axis=1)
        labels = [layout.constraint_labels[i] for i in np.flatnonzero(rows > 0.1 * rows.max())]
        where = f"the mechanism is at a change point of {', '.join(labels[:6])}{place(layout.q, self.q)}"
        if not undecided.shape[1]:
            shown = ", ".join(f"{n} = {x:.6g}" for n, x in zip(layout.v, v, strict=True) if n in self.names)
            return AssemblyError(
                f"{where}, and no motion goes on with the given velocities {shown or 'there'}; give those of one "
                "branch, or start a little beside this position",
                code="EG-UNDETERMINED",
            )
        wanted, left = list[str](), undecided.copy()
        size = np.abs(undecided).max(axis=1)
        for _ in range(undecided.shape[1]):
            i = int(np.argmax(np.linalg.norm(left, axis=1) >= 0.5 * np.linalg.norm(left, axis=1).max()))
            wanted.append(layout.v[i])
            row = left[i] / np.linalg.norm(left[i])
            left = left - np.outer(left @ row, row)
            left[size == 0.0] = 0.0
        shown = " or ".join(
            "(" + ", ".join(f"{n} = {x[layout.v.index(n)]:.6g}" for n in wanted) + ")" for x in found[:4]
        ) + (" or ..." if len(found) > 4 else "")
        several = f"branches found have {shown}" if found else "no branch was found that has them"
        return AssemblyError(
            f"{where}, where the given velocities do not tell its branches apart: {several}; give "
            f"{' and '.join(wanted)} too, or start a little beside this position",
            code="EG-UNDETERMINED",
        )
