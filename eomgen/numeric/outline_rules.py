"""Numeric: points of outlines and profiles, sizes of sprockets -> what no contact shape can have, or nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from .value_ranges import Flaw

Point = tuple[float, float]


def judge_rising(values: Any) -> list[Flaw]:
    """The rule of x of two neighbouring points of a profile."""
    left, right = (float(x) for x in values)
    if left < right:
        return []
    message = f"has x = {right:g} after x = {left:g}: the profile turns back or crosses itself"
    return [Flaw("", message, "give the points from left to right, each x once")]


def judge_outline(values: Any, convex: bool, sense: int) -> list[Flaw]:
    """The rule of x and y of all corners, which run counterclockwise (1) or clockwise (-1) at the declared values."""
    numbers = [float(x) for x in values]
    found = sense_of_outline(list(zip(numbers[::2], numbers[1::2], strict=True)), convex)
    if isinstance(found, Flaw):
        return [found]
    if found == sense:
        return []
    words = {1: "counterclockwise", -1: "clockwise"}
    message = f"runs {words[found]}, and {words[sense]} at the declared values"
    return [Flaw("", message, f"give corners that run {words[sense]}")]


def sense_of_outline(points: Sequence[Point], convex: bool) -> int | Flaw:
    """1 where an outline runs counterclockwise, -1 where clockwise; what is wrong with it where something is."""
    n, turns, total = len(points), set[bool](), 0.0
    for k in range(n):
        (x0, y0), (x1, y1), (x2, y2) = points[k - 1], points[k], points[(k + 1) % n]
        a, b = (x1 - x0, y1 - y0), (x2 - x1, y2 - y1)
        cross, along = a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]
        if cross == 0 and (convex or along <= 0):
            return Flaw(f"[{k}]", "lies on a line with the corners beside it, or on one of them", "leave it out")
        turns.add(cross > 0)
        total += math.atan2(cross, along)
    if crossing := _crossing(points):
        message = f"the edges that begin at corners {crossing[0]} and {crossing[1]} cross each other"
        return Flaw("", message, "give the corners in their order around the outline")
    if convex and len(turns) > 1:
        return Flaw("", "is not convex", "give it as shape outline, which need not be")
    return 1 if total > 0 else -1


def _crossing(points: Sequence[Point]) -> tuple[int, int] | None:
    """The first two edges of an outline that cross."""
    n = len(points)

    def side(p: Point, q: Point, r: Point) -> float:
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    for i in range(n):
        p, q = points[i], points[(i + 1) % n]
        for j in range(i + 2, n - (i == 0)):
            r, s = points[j], points[(j + 1) % n]
            if side(p, q, r) * side(p, q, s) < 0 and side(r, s, p) * side(r, s, q) < 0:
                return i, j
    return None


def judge_sprocket(values: Any, teeth: int) -> list[Flaw]:
    """The rule of pitch, radius of the seats, radius of the tips (m) and angle of a seat (rad)."""
    pitch, seat, tip, angle = (float(x) for x in values)
    if not 0.0 < angle < math.pi:
        return [Flaw(".seat_angle", f"is {angle:g} rad", "give more than 0 and less than pi, such as 130 deg")]
    if min(pitch, seat, tip) <= 0.0:
        return []  # told by the ranges of each
    if 2.0 * seat >= pitch:
        return [
            Flaw(".seat", f"is {seat:g}, so that seats overlap", f"give less than half of the pitch, {0.5 * pitch:g}")
        ]
    reach = pitch / (2.0 * math.sin(math.pi / teeth))
    c, s = math.cos(0.5 * angle), math.sin(0.5 * angle)
    x, y = reach - seat * c, seat * s
    if seat >= reach:
        return [Flaw(".seat", f"is {seat:g}, which reaches the axis", f"give less than the pitch radius, {reach:g}")]
    if math.hypot(x, y) >= tip:
        message = f"is {tip:g}, inside the ends of the seats"
        return [Flaw(".tip_radius", message, f"give more than {math.hypot(x, y):g}")]
    along = x * s + y * c
    flank = math.sqrt(along * along + tip * tip - x * x - y * y) - along
    if math.atan2(y + flank * c, x + flank * s) >= math.pi / teeth:
        # the flanks of neighbouring seats meet on the line between them, at the angle pi / teeth
        a, b = math.cos(math.pi / teeth), math.sin(math.pi / teeth)
        run = (x * b - y * a) / (c * a - s * b)
        most = math.hypot(x + run * s, y + run * c)
        return [Flaw(".tip_radius", f"is {tip:g}, beyond the points of the teeth", f"give less than {most:g}")]
    return []
