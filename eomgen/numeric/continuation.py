"""Stage numeric: a curve of positions and a point on it -> points further along, without ever leaving the branch.

Predictor and corrector with step control (Allgower and Georg, Introduction to Numerical Continuation Methods, ch. 2
and 6).  A step counts only if position and direction come out near to what the points before foretold: near a singular
position another branch is near too, but runs in another direction.  A singular position itself is leapt over, to the
point behind it that continues the motion smoothly, if there is one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base.algebra import Array
from ..base.limits.analyses import BLOCKED, UNJUDGED
from .curves import OFF, TURNED, Point, predict
from .projection import largest

if TYPE_CHECKING:
    from .curves import PositionCurve

FIRST = 0.1  #: scaled motion in the first step
LONG = 0.35  #: scaled motion aimed at in one step
JUMP = 0.5  #: largest scaled motion in one step
FEWEST = 50  #: steps of a continuation over time
STEPS = 200_000  #: of one continuation


class Continuation:
    """Follows one curve.

    Parameters
    ----------
    curve : PositionCurve
    start : (n_q,) array
        Position at s = 0.
    extent : float, optional
        Length in s of the whole range that the curve is a piece of: the pieces of a range to and fro need no shorter
        steps than one way over all of it.
    fewest : int
        Steps at least, however still it stands, so that short driver pulses are not skipped.
    """

    def __init__(self, curve: PositionCurve, start: Array, extent: float = 0.0, fewest: int = FEWEST) -> None:
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
                found = self._leap(here)
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

    def forward(self, here: Point, h: float, s: float) -> Point | None:
        """One step, None if it fails or is not a smooth continuation."""
        bend = self._bend(here)
        ahead = predict(self.scales, here, bend, h)
        if not largest(self.scales.distance(ahead, here.q)) <= JUMP:
            return None
        found = self.curve.solve(s, ahead)
        if found is None:
            return None
        off = largest(self.scales.distance(found.q, ahead))
        move = largest(self.scales.distance(found.q, here.q))
        turned = h * largest((found.tangent.rate - here.tangent.rate - h * bend) / self.scales.q)
        worst = largest(np.array([off / max(OFF * move, UNJUDGED), turned / max(TURNED * move, UNJUDGED)]))
        if not (worst <= 1.0 and move <= JUMP):
            return None
        if h >= 0.999 * self.step:
            self.step = h * (2.0 if worst < 0.1 else 1.4 if worst < 0.4 else 1.0)
        return found

    def _leap(self, here: Point) -> Point | None:
        """The point behind a singular position."""
        from .leaps import leap

        return leap(self.curve, self.points, here)

    def _bend(self, here: Point) -> Array:
        """Second derivative along s, from the point before."""
        before = self.points[max(len(self.points) - 2, 0)]
        change, gap = here.tangent.rate - before.tangent.rate, here.s - before.s
        return change / gap if gap > 0.0 else np.zeros_like(change)
