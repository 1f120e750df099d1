"""Analysis: an iterate -> where the mechanism comes to rest in a very viscous fluid, without inertia.

Implicit Euler steps of q' = v'(q) (pseudo-transient continuation: C. T. Kelley, D. E. Keyes, SIAM J. Numer. Anal. 35
(1998), 508-523), along the forces in the metric of the masses and so down the potential where there is one.  Each is
solved by Newton's iteration and is as long as that contracts, so that stiff directions that curve are followed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.analyses import CLOSE
from ..base.limits.numbers import EPS
from .newton import CONTRACTS, LONGEST

if TYPE_CHECKING:
    from .search import Search, SearchPoint

STEPS = 400  #: at most
TRIES = 60  #: of a step, each with a quarter of the time
CORRECTIONS = 5  #: of a step, at most


def creep(search: Search, point: SearchPoint) -> tuple[SearchPoint, int, bool]:
    """An iterate near which it rests, the number of steps, and False: Newton's iteration has the last word."""
    rate = None
    for step in range(STEPS):
        here = _Flow.at(search, point)
        if here is None:
            return point, step, False
        size = float(np.linalg.norm(here.drive))
        if size == 0.0 or not np.isfinite(size):
            return point, step, False
        rate = size / LONGEST if rate is None else rate
        there, contraction = None, 1.0
        for _ in range(TRIES):
            change = here.implicit(rate, here.drive)
            longest = np.inf if change is None else search.longest(here.basis @ change)
            if change is not None and longest <= LONGEST:
                there, contraction = _corrected(search, point, rate, here.basis @ change)
                if there is not None:
                    break
            rate = 4.0 * max(rate, EPS * here.slope)
        if there is None:
            return point, step, False
        point = there
        if longest <= CLOSE or (rate <= CLOSE**2 * here.slope and contraction < 0.1):
            return point, step + 1, False
        rate *= 0.1 if contraction < 0.1 else 0.3 if contraction < 0.25 else 1.0
    return point, STEPS, False


class _Flow(NamedTuple):
    """What drives the tree at an iterate, along directions of the constraints."""

    basis: Array  #: (n_v, n)
    drive: Array  #: (n,)
    A: Array  #: (n, n) its derivative
    M: Array  #: (n, n) metric
    slope: float  #: size of A

    @classmethod
    def at(cls, search: Search, point: SearchPoint) -> _Flow | None:
        """None where there is none."""
        linear = search.linearize(point)
        if linear.flow is None:
            return None
        basis = linear.moved
        A = basis.T @ linear.flow
        drive = basis.T @ search.drive(point.here)
        return cls(basis, drive, A, search.metric(point, basis), float(np.linalg.norm(A)))

    def implicit(self, rate: float, drive: Array) -> Array | None:
        """(rate - A)^-1 drive; None where that does not lead down a potential."""
        shifted = rate * np.eye(len(self.A)) - self.A
        return np.asarray(algebra.solve(shifted, drive)) if _definite(self.M @ shifted) else None


def _corrected(
    search: Search, start: SearchPoint, rate: float, displacement: Array
) -> tuple[SearchPoint | None, float]:
    """The iterate an implicit step away, None where Newton's iteration does not contract; its first contraction."""
    before, first, point = float(np.linalg.norm(displacement)), 1.0, start
    for k in range(CORRECTIONS):
        there = search.step(point, displacement, np.zeros(0))
        if there is None:
            return None, 1.0
        if k and np.linalg.norm(displacement) <= 0.1 * before:  # what is left is for the next step
            return there, first
        point, before = there, float(np.linalg.norm(displacement))
        here = _Flow.at(search, point)
        assert here is not None
        moved = here.basis.T @ search.distance(point, start)
        change = algebra.lstsq(rate * np.eye(len(here.A)) - here.A, here.drive - rate * moved, rcond=None)
        displacement = here.basis @ change
        size = float(np.linalg.norm(displacement))
        if not size <= CONTRACTS * before:
            return None, 1.0
        first = size / before if k == 0 else first
    return None, 1.0


def _definite(A: Array) -> bool:
    """Whether the symmetric part is positive definite."""
    try:
        np.linalg.cholesky(0.5 * (A + A.T))
    except np.linalg.LinAlgError:
        return False
    return True
