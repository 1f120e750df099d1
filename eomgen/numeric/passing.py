"""Stage numeric: a state next to a change point -> what holds there, from states of the same motion on both sides.

Where a branch of motion crosses another one, C_q loses rank, and next to it, at a smallest singular value s, what C says
to eps is the position to eps / s, the velocity to eps / s^2 and the acceleration to eps / s^3.  The branch itself runs
smoothly through.  So a curve is laid on the branch through the state, along its motion, and what is wanted is
interpolated from PAIRS pairs of states on it at distances REACH, 2 REACH, ... on either side (Stoer and Bulirsch,
Introduction to Numerical Analysis, sec. 2.1).  At REACH the noise is eps / REACH^3 = 1e-13; the interpolation errs by
0.004 REACH^10 of a tenth derivative.

The points of the curve are closed, and their distance from the state, seen along a fixed tangent basis T, is linear in
the curve's parameter.  The nearest closed points to a straight line would not do: near the crossing their
place along the branch has a pole.
"""

from __future__ import annotations

from collections.abc import Callable
from math import factorial

import numpy as np

from ..errors import EvaluationError
from .partitions import Partition, partition
from .projection import correct_position, largest, within
from .scales import Array, GivenRates, Indices, Position, Scales

NEAR = 0.04  #: smallest pivot, relative to the largest entry of J, from which on a crossing is looked for
REACH = 0.1  #: scaled motion to the first points on either side
PAIRS = 5
SHORTEST = 0.01  #: least reach tried
CENTRED = 2.5  #: the pivot at the first points is this many times that here: the crossing is within 0.4 REACH
CLOSED = 1e-12  #: scaled residual of the interpolated position; more, and the branch does not run through
NOISE = 1e-15  #: of C: a direct solution has NOISE V^2 / pivot^3 for velocities V
STILL = 1e-9  #: scaled velocity that shows no direction
STEPS = 30  #: of the iteration for a point of the curve
EXACT = 1e-14  #: scaled distance along the curve to which it goes

#: of both points of the pair at k reaches, for the value in the middle by the first 3, 4 and 5 pairs
WEIGHTS = np.array([
    [(-1) ** (k + 1) * factorial(n) ** 2 / (factorial(n - k) * factorial(n + k)) if k <= n else 0.0
     for k in range(1, PAIRS + 1)]
    for n in (PAIRS - 2, PAIRS - 1, PAIRS)
])  # fmt: skip


def across(
    evaluate: Callable[[float, Array, Array], Array],
    position: Callable[[float], Position],
    t: float,
    q: Array,
    v: Array,
    scales: Scales,
    split: Callable[[Array], Partition],
    here: float,
    judged: slice,
    given: GivenRates | None = None,
    moving: bool = False,
) -> Array | None:
    speed = largest(v / scales.q)
    if not speed > STILL:
        return None
    d = v / scales.q / speed
    reach = REACH
    while reach >= SHORTEST:
        try:
            found = _interpolate(evaluate, position, t, q, v, scales, split, here, judged, given, 1.0 / speed if moving else 0.0, d, reach, speed)
        except EvaluationError:
            found = None
        if found is not None:
            return found
        reach *= 0.5
    return None


def _interpolate(evaluate, position, t, q, v, scales, split, here, judged, given, pace, d, reach, speed):
    def move(q, dz):
        return scales.move(q, dz) if given is None else given.move(q, scales.q * dz)

    def away(p):
        if given is None and scales.space is None:
            return (p - q) / scales.q
        return (scales.space.velocities(q, p - q)) / scales.q

    def close(at, guess):
        return correct_position(position(at), guess, scales, given)

    p, C_q = close(t + reach * pace, move(q, reach * d))
    there = split(scales.jacobian(C_q))
    T = there.B
    f = T.shape[1]
    if f:
        inverse = np.linalg.inv(T.T @ T) @ T.T
        y = inverse @ d
        size = largest(T @ y)
        if not size > 1e-3:
            return None
        y /= size
        d = T @ y
    pivots, columns = [], []
    points = {0: q}
    for k in range(1, PAIRS + 1):
        pair = []
        for sign in (1, -1):
            at = t + sign * k * reach * pace
            # extrapolate
            if k == 1:
                p = move(q, sign * reach * d)
            elif k == 2 :
                p = 2*points[sign] - q
            else:
                p = 3 * points[sign * (k - 1)] - 3 * points[sign * (k - 2)] + points[sign * (k - 3)]
            for _ in range(STEPS):
                p, C_q = close(at, p)
                if not f:
                    break
                r = sign * k * reach * y - inverse @ away(p)
                if largest(r) <= EXACT:
                    break
                p = move(p, T @ r)
            else:
                if largest(r)>1e-12: return None
            points[sign * k] = p
            if k == 1:
                pivots.append(split(scales.jacobian(C_q)).weakest)
            pair.append(evaluate(at, p, v))
        if k == 1 and not sum(pivots) >= 2 * CENTRED * here:
            return None
        columns.append(pair[0] + pair[1])
    values = WEIGHTS @ np.array(columns)
    _p = values[2][: len(q)]
    C, C_q = position(t)(_p)
    e = scales.residual(C)
    if not within(e, CLOSED, scales.rounding(_p, scales.jacobian(C_q[: len(e)]))):
        return None
    d43, d54 = largest(values[1][judged] - values[0][judged]), largest(values[2][judged] - values[1][judged])
    error = d54 * min(1.0, d54 / d43 if d43 else 1.0)
    if not error <= NOISE * speed**2 / max(here,1e-6)**3:
        return None
    return values[2]
