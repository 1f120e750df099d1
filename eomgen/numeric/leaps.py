"""Stage numeric: points of a curve up to a singular position -> one behind it that goes on smoothly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.limits.analyses import LEAPS
from .curves import OFF, TURNED, Point, PositionCurve, predict
from .projection import largest


def leap(curve: PositionCurve, points: Sequence[Point], here: Point) -> Point | None:
    """A point behind a singular position that continues the motion smoothly; None if there is none."""
    scales = curve.scales
    for size in LEAPS:
        near = _behind(curve, points, here, size)
        if near is None:
            continue
        rate = largest(near.tangent.rate / scales.q)
        gap = here.s - near.s
        s = here.s + gap
        other = _behind(curve, points, here, 2.0 * size)
        bend = np.zeros_like(near.tangent.rate)
        if other is not None and near.s > other.s:
            bend = (near.tangent.rate - other.tangent.rate) / (near.s - other.s)
        ahead = predict(scales, near, bend, 2.0 * gap)
        found = curve.solve(s, ahead)
        if found is None or rate == 0.0:
            continue
        move = largest(scales.distance(found.q, near.q))
        off = largest(scales.distance(found.q, ahead))
        turned = 2.0 * gap * largest((found.tangent.rate - near.tangent.rate - 2.0 * gap * bend) / scales.q)
        if off <= OFF * move and turned <= TURNED * move and move <= 10.0 * size:
            return found
    return None


def _behind(curve: PositionCurve, points: Sequence[Point], here: Point, size: float) -> Point | None:
    """The last point passed whose scaled distance is at least ``size``, brought to about that distance."""
    scales = curve.scales
    for point in reversed(points):
        distance = largest(scales.distance(here.q, point.q))
        if distance >= size:
            part = size / distance
            s = here.s - part * (here.s - point.s)
            guess = scales.move(here.q, part * scales.distance(point.q, here.q))
            return curve.solve(s, guess) or point
    return None
