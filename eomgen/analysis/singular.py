"""Analysis: followed paths -> the singular positions on them: where they are, which coordinates and joints cause them.

At a singular position a motion is possible while the led coordinates (and the drivers) stand still.  Either the branch
goes on through it, beside others (a change point: the sign of det K changes), or the led coordinates turn back there (a
stop: a dead centre of theirs, the end of the mechanism's reach).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..base.algebra import Array
from ..base.limits.analyses import BLOCKED, EXTREME, LEAPS, SINGULAR, UNJUDGED
from ..numeric.curves import Point, Tangent
from ..numeric.projection import largest
from ..numeric.roots import SECTIONS, carry_out, find_root, search_least
from .change_point_interpolant import ChangePointInterpolant, build_interpolant
from .driven_coordinates import DrivenContinuation, DrivenCoordinates

LOW = 0.03  #: quality below which a minimum is looked into
SHARE = 0.2  #: of the largest part, from which a coordinate or row is named
NARROW = 0.02  #: scaled motion to which a change of sign is narrowed by steps


class Singular(NamedTuple):
    """A singular position.

    Attributes
    ----------
    kind : {'change point', 'stop'}
    t : float
        Time (s).
    values : dict
        Led coordinate -> its value there.
    q : (n_q,) array
    moving : tuple of str
        Coordinates that can move while the led ones stand still.
    joints : tuple of str
        Joints and constraints whose equations do not hold that motion.
    """

    kind: str
    t: float
    values: Mapping[str, float]
    q: Array
    moving: tuple[str, ...]
    joints: tuple[str, ...]

    def __str__(self) -> str:
        place = ", ".join([f"{name} = {value:.9g}" for name, value in self.values.items()] or [f"t = {self.t:.9g} s"])
        if self.kind == "stop":
            what = f"{', '.join(self.values) or 'the drivers'} can go no further"
        else:
            what = "the motion may branch"
        joints = f" (joints {', '.join(self.joints)})" if self.joints else ""
        return f"{self.kind} at {place}: {what}; {', '.join(self.moving)} can still move{joints}"


def name_singular(driven: DrivenCoordinates, kind: str, t: float, q: Array, tangent: Tangent) -> Singular:
    """Put names to a singular position."""
    layout = driven.layout
    free = np.abs(tangent.free)
    moving = tuple(layout.velocity_labels[i] for i in np.flatnonzero(free >= SHARE * free.max()))
    held = np.abs(tangent.rows[: layout.n_c])
    labels = [layout.constraint_labels[i] for i in np.flatnonzero(held >= SHARE * np.abs(tangent.rows).max())]
    joints = tuple(dict.fromkeys(label.partition(".")[0] for label in labels))
    values = dict(zip(driven.led, driven.led_values(q, t).tolist(), strict=True))
    return Singular(kind, t, values, q, moving, joints)


def cross(continuation: DrivenContinuation, before: Point, after: Point) -> tuple[ChangePointInterpolant, float] | None:
    """The interpolant over a change of sign between two points, and where det K = 0 on it; None if there is none."""
    path, driven, scales = continuation.curve, continuation.curve.driven, continuation.scales
    for _ in range(60):
        if largest(scales.distance(after.q, before.q)) <= NARROW:
            break
        middle = 0.5 * (before.s + after.s)
        found = path.solve(middle, ChangePointInterpolant([before, after], scales).at(middle)[0])
        if found is None or found.tangent.quality < SINGULAR:
            break
        before, after = (found, after) if found.tangent.sign == before.tangent.sign else (before, found)
    rough = ChangePointInterpolant([before, after], scales)
    middle = _root(continuation, rough, before.s, after.s)
    interpolant = build_interpolant(continuation, before, after, middle)
    if interpolant is None:
        return None
    low, high = interpolant.supports[1].s, interpolant.supports[2].s
    middle = _root(continuation, interpolant, low, high)
    t = path.at(middle)[0]
    quality = driven.tangent(t, interpolant.at(middle)[0], 0.0, path.y1).quality
    return (interpolant, middle) if quality < SINGULAR else None


def _root(continuation: DrivenContinuation, interpolant: ChangePointInterpolant, low: float, high: float) -> float:
    """Where det K changes its sign on an interpolant; where it does not, the nearest to singular."""

    def value(s: float) -> float:
        return continuation.curve.driven.determinant(continuation.curve.at(s)[0], interpolant.at(s)[0])

    f_low, f_high = value(low), value(high)
    if not f_low * f_high < 0.0:
        return _worst(continuation, interpolant, low, high)
    return find_root(value, low, high, f_low, f_high)


def _worst(continuation: DrivenContinuation, interpolant: ChangePointInterpolant, low: float, high: float) -> float:
    """Where an interpolant is nearest to singular, by golden section."""

    def quality(s: float) -> float:
        return continuation.curve.tangent(s, interpolant.at(s)[0]).quality

    middle = 0.5 * (low + high)
    width = (high - low) * 0.6**SECTIONS
    return carry_out(search_least(low, middle, high, quality(middle), width), quality)[1]


def find_stop(continuation: DrivenContinuation, last: Point) -> tuple[float, Point]:
    """The stop of a blocked continuation, s and the position there, to full precision where one coordinate is led.

    There the path is followed by the coordinate that still moves, w: s(w) has its extreme at the stop.
    """
    path, driven, scales = continuation.curve, continuation.curve.driven, continuation.scales
    y1, t1 = path.y1, path.t1
    tangent = last.tangent
    if t1 or np.count_nonzero(y1) != 1:
        return last.s, last
    k = int(np.flatnonzero(y1)[0])
    free = tangent.free
    order = [int(i) for i in np.argsort(-np.abs(free)) if driven.layout.velocity_labels[i] in driven.layout.q]
    for i in order[:1]:
        name = driven.layout.velocity_labels[i]
        if name in driven.led:
            break
        led = (*driven.led[:k], name, *driven.led[k + 1 :])
        other = DrivenCoordinates(driven.module, led)
        t = path.t
        q = last.q
        for _ in range(30):  # dy/dw = 0 by secant steps, w the scaled value of the free coordinate
            y = other.led_values(q, t)
            step = _to_extreme(other, driven, k, t, q)
            if step is None or not abs(step) < 1.0:
                return last.s, last
            y[k] += step * other.led_scales[k]
            found = other.position(t, y, scales.move(q, step * _along(other, k, t, q)))
            if found is None:
                return last.s, last
            q = found
            if abs(step) < BLOCKED:
                break
        s = float((driven.led_values(q, t)[k] - path.y[k]) / y1[k])
        if abs(s - last.s) * abs(y1[k]) / driven.led_scales[k] < UNJUDGED:
            return s, Point(s, q, driven.tangent(t, q, 0.0, y1))
    return last.s, last


def _along(other: DrivenCoordinates, k: int, t: float, q: Array) -> Array:
    unit = np.zeros(len(other.led))
    unit[k] = other.led_scales[k]
    return other.tangent(t, q, 0.0, unit).rate / other.scales.q


def _to_extreme(other: DrivenCoordinates, driven: DrivenCoordinates, k: int, t: float, q: Array) -> float | None:
    """Newton's step in w to where dy_k/dw = 0, by a central difference of dy_k/dw."""
    h = EXTREME

    def slope(q: Array) -> float:
        row = driven.matrix(q, t)[driven.layout.n_c + k]
        return float(row @ _along(other, k, t, q))

    y = other.led_values(q, t)
    slopes = []
    for part in (-h, h):
        ahead = np.array(y)
        ahead[k] += part * other.led_scales[k]
        found = other.position(t, ahead, other.scales.move(q, part * _along(other, k, t, q)))
        if found is None:
            return None
        slopes.append(slope(found))
    curvature = (slopes[1] - slopes[0]) / (2.0 * h)
    return -slope(q) / curvature if curvature else None


def touch(continuation: DrivenContinuation, before: Point, after: Point) -> tuple[ChangePointInterpolant, float] | None:
    """As :func:`cross` where the quality has a minimum between two points, and det K need not change its sign."""
    path, driven, scales = continuation.curve, continuation.curve.driven, continuation.scales
    for _ in range(60):
        if largest(scales.distance(after.q, before.q)) <= NARROW:
            break
        rough = ChangePointInterpolant([before, after], scales)
        third = (after.s - before.s) / 3.0
        found = [path.solve(s, rough.at(s)[0]) for s in (before.s + third, after.s - third)]
        one, other = found
        if one is None or other is None or min(one.tangent.quality, other.tangent.quality) < SINGULAR:
            break
        before, after = (before, other) if one.tangent.quality < other.tangent.quality else (one, after)
    interpolant = build_interpolant(continuation, before, after, 0.5 * (before.s + after.s))
    if interpolant is None:
        return None
    middle = _worst(continuation, interpolant, interpolant.supports[1].s, interpolant.supports[2].s)
    t = path.at(middle)[0]
    quality = driven.tangent(t, interpolant.at(middle)[0], 0.0, path.y1).quality
    return (interpolant, middle) if quality < SINGULAR else None


def find_change_points(
    continuation: DrivenContinuation,
) -> tuple[list[tuple[ChangePointInterpolant, float]], list[Singular]]:
    """Interpolants over the change points of a continuation, and the change points themselves, in order."""
    path = continuation.curve
    leapt = {id(before) for before, _ in continuation.leaps}
    points = continuation.points
    crossings: list[tuple[ChangePointInterpolant, float]] = []
    for k in range(len(points) - 1):
        before, after = points[k], points[k + 1]
        here = None
        if id(before) in leapt or before.tangent.sign != after.tangent.sign:
            here = cross(continuation, _good(points, before, after) if id(before) in leapt else before, after)
        elif k + 2 < len(points) and _dips(points[k : k + 3]):
            here = touch(continuation, before, points[k + 2])
        if here is not None:
            crossings.append(here)
    found = []
    for interpolant, middle in crossings:
        q = interpolant.at(middle)[0]
        found.append(name_singular(path.driven, "change point", path.at(middle)[0], q, path.tangent(middle, q)))
    return crossings, found


def _dips(points: Sequence[Point]) -> bool:
    """Whether the quality has a low minimum at the second of three points, without a change of sign."""
    first, middle, last = (p.tangent for p in points)
    low = middle.quality < LOW and middle.quality < first.quality and middle.quality <= last.quality
    return low and first.sign == middle.sign == last.sign


def _good(points: Sequence[Point], before: Point, after: Point) -> Point:
    """The last point before a leap that is not too near to the singular position."""
    width = after.s - before.s
    return next(
        (p for p in reversed(points) if p.s <= before.s - 0.5 * width and p.tangent.quality > 0.01 * LEAPS[0]),
        points[0],
    )
