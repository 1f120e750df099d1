"""Stage numeric: a state next to a change point -> what holds there, from closed states on both sides of it.

Where the branch of a motion crosses another one, C_q loses rank.  Beside it, at a smallest singular value s, C is known
to eps, hence the position to eps / s, velocities to V eps / s^2 and accelerations to V^2 eps / s^3: no solution at the
state itself knows more, by whatever pivots.  The branch, however, runs smoothly through.  So a curve is laid on it
through the state, along the motion, and what is wanted is interpolated from five pairs of its points on either side (J.
Stoer, R. Bulirsch, *Introduction to Numerical Analysis*, section 2.1).  Their first pair is REACH = 0.1 away, where the
noise of accelerations is 1e-13 to 1e-12 V^2; interpolation errs by (5!)^2 / 10! REACH^10 = 4e-13 of a tenth derivative.

The distance of a point from the state, in the coordinates of a tangent basis T that stays the same, is linear in the
parameter of the curve.  The closed points nearest to a straight line would not do: near the crossing their place along
the branch has a pole.

The result is taken where it is better than the solution at the state: the crossing lies near the middle of the points,
the interpolated position is closed (a mechanism that only comes near a change point swings round there, and is not),
and the differences between the results of two to five pairs foretell a smaller error.
"""

from __future__ import annotations

from collections.abc import Callable
from math import factorial
from typing import NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array, Indices
from ..base.limits.crossings import (
    ARRIVED,
    CLOSED,
    ENOUGH,
    GOOD,
    MIDDLE,
    NOISE,
    REACH,
    ROUNDS,
    SHORTEST,
    SLANT,
    STILL,
    WEAKEST,
)
from ..errors import EvaluationError
from .partitions import Partition, partition
from .projection import correct_position, largest, within
from .scales import Position, Scales

PAIRS = 5

#: of both points of the pair at k reaches, for the value in the middle by the first 2, 3, 4 and 5 pairs
WEIGHTS = np.array([
    [(-1.0) ** (k + 1) * factorial(n) ** 2 / (factorial(n - k) * factorial(n + k)) if k <= n else 0.0
     for k in range(1, PAIRS + 1)]
    for n in range(PAIRS - 3, PAIRS + 1)
])  # fmt: skip


class Around(NamedTuple):
    """A state, and what the model says about the configurations around it."""

    position: Callable[[float], Position]  #: t -> (q -> C, C_q)
    scales: Scales
    rank: int
    independent: Indices
    t: float
    q: Array
    v: Array
    timed: bool  #: whether constraints depend on time, which then goes on along the curve

    @property
    def speed(self) -> float:
        """The largest scaled velocity."""
        return self.scales.speed(self.v)

    @property
    def direction(self) -> Array:
        """The scaled velocities (n,) at unit speed, those of first-order states 0."""
        d = self.v / self.scales.q / self.speed
        if self.scales.space is not None:
            d[len(d) - self.scales.space.n_states :] = 0.0
        return d

    def close(self, t: float, q: Array) -> tuple[Array, Array]:
        """The nearest closed position, and the scaled Jacobian there."""
        q, C_q = correct_position(self.position(t), q, self.scales)
        return self.normalised(q), self.scales.jacobian(C_q)

    def normalised(self, q: Array) -> Array:
        """q with Euler parameters of length 1, on which q' depends."""
        return q if self.scales.space is None else self.scales.space.normalised(q)

    def split(self, J: Array) -> Partition:
        """The partition of the coordinates."""
        return partition(J, self.rank, self.independent, sizes=self.scales.row_sizes(J))

    def away(self, q: Array) -> Array:
        """The scaled step from the state, smooth in q."""
        space, change = self.scales.space, q - self.q
        return (change if space is None else space.velocities(self.q, change)) / self.scales.q


class ClosedCurve:
    """Closed points on either side of a state, whose distance from it, as T sees it, is linear.

    Raises
    ------
    EvaluationError
        There is no such curve.
    """

    def __init__(self, around: Around, reach: float) -> None:
        self.around, self.reach = around, reach
        self.time_per_length = 1.0 / around.speed if around.timed else 0.0
        d = around.direction
        _, J = around.close(self.time(1), around.scales.move(around.q, reach * d))
        there = around.split(J)
        self.T, self.pivots = there.B, [there.weakest]
        self.inverse = algebra.pinv(self.T)
        self.heading = self.inverse @ d
        if self.T.shape[1]:
            size = largest(self.T @ self.heading)
            if not size > SLANT:
                raise EvaluationError("the motion does not follow the branch")
            self.heading /= size
            d = self.T @ self.heading
        self.direction = d
        self.points: dict[int, Array] = {0: around.normalised(around.q)}

    def time(self, k: int) -> float:
        """Time at the point k reaches ahead."""
        return self.around.t + k * self.reach * self.time_per_length

    def find(self, k: int) -> Array:
        """The point k reaches ahead, behind if k < 0, those before it being known."""
        around, points, side = self.around, self.points, 1 if k > 0 else -1
        match abs(k):
            case 1:
                q = around.scales.move(around.q, k * self.reach * self.direction)
            case 2:
                q = 2.0 * points[side] - points[0]
            case _:
                q = 3.0 * (points[k - side] - points[k - 2 * side]) + points[k - 3 * side]
        left = 0.0
        for _ in range(ROUNDS):
            q, J = around.close(self.time(k), q)
            r = k * self.reach * self.heading - self.inverse @ around.away(q)
            left = largest(r)
            if left <= ARRIVED:
                break
            q = around.scales.move(q, self.T @ r)
        if not left <= ENOUGH:
            raise EvaluationError("no point of the curve was found")
        if k == -1:
            self.pivots.append(around.split(J).weakest)
        points[k] = q
        return q


def across(around: Around, evaluate: Callable[[float, Array, Array], Array], here: float) -> Array | None:
    """What holds at a state next to a change point.

    Parameters
    ----------
    around : Around
    evaluate : callable
        (t, q, v) -> [q, v, q', a, anything], flat, of the closed state nearest to (q, v).
    here : float
        Weakest pivot at the state, 0 where rank is lost.

    Returns
    -------
    array or None
        As from ``evaluate``, at the state; None where the solution at the state itself is no worse.
    """
    speed, best, least = around.speed, None, np.inf
    if not speed > STILL:
        return None
    reach = REACH
    while reach >= SHORTEST and not least <= GOOD * speed**2:
        try:
            found, error = _interpolate(around, evaluate, here, reach)
        except EvaluationError:
            error = np.inf
        if error < least:
            best, least = found, error
        reach *= 0.5
    return best if least * max(here, WEAKEST) ** 3 <= NOISE * speed**2 else None


def _interpolate(
    around: Around, evaluate: Callable[[float, Array, Array], Array], here: float, reach: float
) -> tuple[Array, float]:
    """The value in the middle, and its error in accelerations."""
    scales, n_q, n = around.scales, len(around.q), len(around.v)
    curve, pairs = ClosedCurve(around, reach), []
    for k in range(1, PAIRS + 1):
        ahead, behind = curve.find(k), curve.find(-k)
        if k == 1 and not sum(curve.pivots) >= MIDDLE * here:
            return np.empty(0), np.inf
        pairs.append(evaluate(curve.time(k), ahead, around.v) + evaluate(curve.time(-k), behind, around.v))
    values = WEIGHTS @ np.array(pairs)
    q = values[-1][:n_q]
    C, C_q = around.position(around.t)(q)
    e = scales.residual(C)
    if not within(e, CLOSED, scales.rounding(q, scales.jacobian(C_q[: len(e)]))):
        return np.empty(0), np.inf
    steps = np.diff(values, axis=0)
    v, a = steps[:, n_q : n_q + n], steps[:, 2 * n_q + n : 2 * (n_q + n)]
    sizes = [max(largest(dv / scales.q) * around.speed, largest(da / scales.q)) for dv, da in zip(v, a, strict=True)]
    return values[-1], foretell(*sizes)


def foretell(first: float, second: float, last: float) -> float:
    """The error of the last of four results, from their differences: they fall by one factor, but for chance."""
    if not last:
        return 0.0
    factor = min(1.0, max(a / b if b else 1.0 for a, b in ((second, first), (last, second))))
    return max(last * factor, second * factor**2)
