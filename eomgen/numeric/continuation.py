"""Stage numeric: a curve of positions and a point on it -> points further along, without ever leaving the branch.

Predictor and corrector with step control (Allgower and Georg, Introduction to Numerical Continuation Methods, ch. 2
and 6).  A step counts only if position and direction come out near to what the points before foretold: near a singular
position another branch is near too, but runs in another direction.  A singular position itself is leapt over, to the
point behind it that continues the motion smoothly, if there is one.
"""

from __future__ import annotations

from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np

from ..limits.motions import BLOCKED, LEAPS, UNJUDGED
from .projection import largest
from .scales import Array, Scales

FIRST = 0.1  #: scaled motion in the first step
LONG = 0.35  #: scaled motion aimed at in one step
JUMP = 0.5  #: largest scaled motion in one step
OFF = 0.1  #: largest part of a step by which a position may miss its prediction
TURNED = 0.3  #: the same of a direction
FEWEST = 50  #: steps of a continuation over time
STEPS = 200_000  #: of one continuation
ASTRAY = 0.02  #: scaled distance of a position from its interpolation that may mean another branch


class Tangent(NamedTuple):
    """The direction of the motion at one point, and how well it is determined."""

    rate: Array  #: (n_v,) dq/ds as velocities
    quality: float = 1.0  #: smallest over largest singular value of K: 0 at a singular position
    sign: float = 1.0  #: of the determinant of as many independent rows of K as there are columns
    free: Array = np.empty(0)  #: (n_v,) scaled motion that K restrains least
    rows: Array = np.empty(0)  #: (n_c + k,) rows of K that hold that motion least


class Point(NamedTuple):
    """One point of a continuation; s is the curve's parameter."""

    s: float
    q: Array
    tangent: Tangent  #: along s


class Curve(Protocol):
    """Positions that depend on one parameter s."""

    @property
    def scales(self) -> Scales:
        """The scales of positions."""

    def tangent(self, s: float, q: Array) -> Tangent:
        """The direction at a position."""

    def solve(self, s: float, guess: Array) -> Point | None:
        """The point next to a guess; None if Newton's iteration finds none."""


C = TypeVar("C", bound=Curve)


class Continuation(Generic[C]):
    """Follows one curve.

    Parameters
    ----------
    curve : Curve
    start : (n_q,) array
        Position at s = 0.
    extent : float, optional
        Length in s of the whole range that the curve is a piece of: the pieces of a range to and fro need no shorter
        steps than one way over all of it.
    fewest : int
        Steps at least, however still it stands, so that short driver pulses are not skipped.
    """

    def __init__(self, curve: C, start: Array, extent: float = 0.0, fewest: int = FEWEST) -> None:
        self.curve, self.scales, self.extent, self.fewest = curve, curve.scales, extent, fewest
        self.points = [Point(0.0, start, curve.tangent(0.0, start))]
        self.leaps: list[tuple[Point, Point]] = []
        self.blocked = False
        rate = largest(self.points[0].tangent.rate / self.scales.q)
        self.step = FIRST / rate if rate > 0.0 else 1.0

    def to(self, end: float, known: float = 0.0, steps: int = STEPS) -> bool:
        """Go on until s = end, or beyond if a leap ends there; returns False where the way is blocked before.

        Up to s = ``known`` the way was followed before and is smooth, so that only the motion limits the steps.
        """
        for _ in range(steps):
            here = self.points[-1]
            left = end - here.s
            if left <= 0.0:
                return True
            longest = max(end / self.fewest, self.extent / self.fewest, known - here.s)
            rate = largest(here.tangent.rate / self.scales.q)
            self.step = min(self.step, longest, LONG / rate if rate > 0.0 else longest)
            h = left if self.step >= left else min(self.step, 0.5 * left)
            found = self.forward(here, h, end if h == left else here.s + h)
            if found is None:
                self.step = 0.5 * h
                if self.step > BLOCKED * max(1.0, abs(here.s)):
                    continue
                found = self.leap(here)
                if found is None:
                    self.blocked = True
                    return False
                self.leaps.append((here, found))
                self.step = found.s - here.s
            self.points.append(found)
        return self.points[-1].s >= end

    def reach(self, end: float, steps: int = STEPS) -> Point | None:
        """The point at s = end, found between its ends where a leap goes on; None where the way is blocked before."""
        if not self.to(end, steps=steps):
            return None
        last = self.points[-1]
        if last.s == end:
            return last
        before = self.leaps[-1][0]
        part = (end - before.s) / (last.s - before.s)
        return self.curve.solve(end, self.scales.move(before.q, part * self.scales.distance(last.q, before.q)))

    def between(self, s: Array) -> Array:
        """Cubic interpolation (n_q, k) between the points of the continuation."""
        points, scales = self.points, self.scales
        if len(points) == 1:
            return np.repeat(points[0].q[:, None], len(s), axis=1)
        nodes = np.array([p.s for p in points])
        values = np.array([p.q for p in points]).T
        slopes = np.array([scales.rates(p.q, p.tangent.rate) for p in points]).T
        k = np.clip(np.searchsorted(nodes, s), 1, len(points) - 1)
        width = nodes[k] - nodes[k - 1]
        x = np.clip((s - nodes[k - 1]) / width, 0.0, 1.0)
        q0, q1 = values[:, k - 1], values[:, k]
        d0, d1 = slopes[:, k - 1] * width, slopes[:, k] * width
        result: Array = q0 + x * (d0 + x * (3 * (q1 - q0) - 2 * d0 - d1 + x * (2 * (q0 - q1) + d0 + d1)))
        for i, _ in scales.space.quaternion_slots if scales.space is not None else ():
            result[i : i + 4] /= np.sqrt((result[i : i + 4] ** 2).sum(axis=0))
        return result

    def forward(self, here: Point, h: float, s: float) -> Point | None:
        """One step, None if it fails or is not a smooth continuation."""
        bend = self._bend(here)
        ahead = self._predict(here, bend, h)
        if not largest(self.scales.distance(ahead, here.q)) <= JUMP:
            return None
        found = self.curve.solve(s, ahead)
        if found is None:
            return None
        off = largest(self.scales.distance(found.q, ahead))
        move = largest(self.scales.distance(found.q, here.q))
        turned = h * largest((found.tangent.rate - here.tangent.rate - h * bend) / self.scales.q)
        if not (off <= max(OFF * move, UNJUDGED) and turned <= max(TURNED * move, UNJUDGED) and move <= JUMP):
            return None
        worst = max(off / max(OFF * move, UNJUDGED), turned / max(TURNED * move, UNJUDGED))
        if h >= 0.999 * self.step:
            self.step = h * (2.0 if worst < 0.1 else 1.4 if worst < 0.4 else 1.0)
        return found

    def _bend(self, here: Point) -> Array:
        """Second derivative along s, from the point before."""
        if len(self.points) < 2 or self.points[-2].s >= here.s:
            return np.zeros_like(here.tangent.rate)
        before = self.points[-2]
        return (here.tangent.rate - before.tangent.rate) / (here.s - before.s)

    def _predict(self, here: Point, bend: Array, h: float) -> Array:
        return self.scales.move(here.q, (here.tangent.rate + 0.5 * h * bend) * h / self.scales.q)

    def leap(self, here: Point) -> Point | None:
        """A point behind a singular position that continues the motion smoothly; None if there is none."""
        for size in LEAPS:
            near = self._behind(here, size)
            if near is None:
                continue
            rate = largest(near.tangent.rate / self.scales.q)
            gap = here.s - near.s
            s = here.s + gap
            other = self._behind(here, 2.0 * size)
            bend = np.zeros_like(near.tangent.rate)
            if other is not None and near.s > other.s:
                bend = (near.tangent.rate - other.tangent.rate) / (near.s - other.s)
            ahead = self._predict(near, bend, 2.0 * gap)
            found = self.curve.solve(s, ahead)
            if found is None or rate == 0.0:
                continue
            move = largest(self.scales.distance(found.q, near.q))
            off = largest(self.scales.distance(found.q, ahead))
            turned = 2.0 * gap * largest((found.tangent.rate - near.tangent.rate - 2.0 * gap * bend) / self.scales.q)
            if off <= OFF * move and turned <= TURNED * move and move <= 10.0 * size:
                return found
        return None

    def _behind(self, here: Point, size: float) -> Point | None:
        """The last point passed whose scaled distance is at least ``size``, brought to about that distance."""
        for point in reversed(self.points):
            distance = largest(self.scales.distance(here.q, point.q))
            if distance >= size:
                part = size / distance
                s = here.s - part * (here.s - point.s)
                guess = self.scales.move(here.q, part * self.scales.distance(point.q, here.q))
                return self.curve.solve(s, guess) or point
        return None
