"""Numbers of an element -> whether they are allowed, and what is said if not; for declared values and for late ones.

A body is possible where its pseudo-inertia matrix is positive semidefinite: mass not negative, principal moments not
negative and none above the sum of the other two (Wensing, Kim, Slotine, IEEE Robotics and Automation Letters 3,
2018).

A rule takes its numbers, a row each (rows over the points where a formula is looked at), and what belongs to the place.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from operator import index
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..errors import off_range
from . import algebra
from .algebra import Array
from .limits.numbers import (
    CLOSING,
    COMPUTED,
    DIGITS,
    EDGE,
    LAW,
    MOMENT,
    PERPENDICULAR,
    ROUNDED,
    SHARP,
    TENSOR,
    TRIANGLE,
    ZERO,
)
from .texts import quote

# -- one number in a range ---------------------------------------------------------------------------------------------


class Flaw(NamedTuple):
    """What is wrong with numbers of an element."""

    key: str  #: what is at fault, behind the path of the place: ``[2]``, ``.tip_radius`` or nothing
    message: str
    remedy: str


class Allowed(NamedTuple):
    """Numbers from ``low`` to ``high``, None where there is no bound; a bound itself may be excluded."""

    low: float | None = None
    high: float | None = None
    above: bool = False  #: whether ``low`` is excluded
    below: bool = False  #: whether ``high`` is excluded

    def has(self, x: Any) -> Any:
        """Whether a number, or each of an array, is allowed."""
        over = x == x if self.low is None else x > self.low if self.above else x >= self.low
        under = x == x if self.high is None else x < self.high if self.below else x <= self.high
        return over & under


POSITIVE = Allowed(0.0, above=True)
NOT_NEGATIVE = Allowed(0.0)
RANGE = "range"  #: the rule of one number in a range


def judge_range(values: Any, low: Any, high: Any, above: bool, below: bool, remedy: str, message: str) -> list[Flaw]:
    """The rule of one number, for which ``{:g}`` stands in the message; that it is so great by default."""
    number = float(values[0])
    if Allowed(low, high, above, below).has(number):
        return []
    return [Flaw("", (message or "is {:g}").format(number), remedy)]


# -- whole numbers -----------------------------------------------------------------------------------------------------


MOST = 10**15  #: all whole numbers up to here are doubles, and their products with sizes of models no infinities


def read_count(what: str, raw: Any, least: int = 0, most: int | None = None) -> int:
    """A whole number within limits."""
    result = as_count(raw)
    if result is None or result < least or result > (MOST if most is None else most):
        endless = most is None and (result is None or result < least)
        limits = f"of at least {least}" if endless else f"from {least} to {MOST if most is None else most}"
        raise off_range(f"{what} must be a whole number {limits}, not {quote(raw)}")
    return result


def as_count(raw: Any) -> int | None:
    """A whole number of Python, NumPy or SymPy; None if it is none, as True and 2.0 are."""
    if isinstance(raw, (bool, float)):
        return None
    try:
        return index(raw)
    except Exception:  # of an object's own __index__ too
        return None


# -- outlines and profiles ---------------------------------------------------------------------------------------------


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
    result = sense_of_outline(list(zip(numbers[::2], numbers[1::2], strict=True)), convex)
    if isinstance(result, Flaw):
        return [result]
    if result == sense:
        return []
    orders = {1: "counterclockwise", -1: "clockwise"}
    message = f"runs {orders[result]}, and {orders[sense]} at the declared values"
    return [Flaw("", message, f"give corners that run {orders[sense]}")]


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


# -- mass and inertia of a rigid body ----------------------------------------------------------------------------------


#: What may be done about a body or a motion without a possible inertia, by the word of ``check_inertia``.
CHECKS = ("error", "note", "off")


SWITCH = "or accept it with check_inertia: note (an option of load too, and --check-inertia)"
SHIFTED = f"give a moment of at least m d^2 about a point at the distance d, {SWITCH}"
NEGATIVE = (
    "check the signs of the products (xy, xz, yz are entries of the tensor: minus the integral of x y dm) and the "
    f"point that the inertia is about, {SWITCH}"
)
EXCESS = (
    "no rigid body has such moments; check the units (kg m^2) and the point (the centre of mass, unless about gives "
    f"another), {SWITCH}"
)


def word_of_check(value: object) -> str | None:
    """The word that a value of ``check_inertia`` means, true being ``error`` and false ``off``; None for no such."""
    if isinstance(value, bool):
        return "error" if value else "off"
    return value if isinstance(value, str) and value in CHECKS else None


@np.errstate(over="ignore", invalid="ignore")
def longest_within(bodies: Iterable[Sequence[ArrayLike]]) -> float:
    """The longest distance (m) between two points of one body, wherever the frames of bodies lie.

    Points are those of each body in its frame: its centre of mass and its joints.  It is 0 where no body has two points
    that differ by more than their rounding.
    """
    longest = 0.0
    for points in bodies:
        places = np.asarray(points, dtype=float).reshape(-1, 3)
        size = float(np.abs(places).max(initial=0.0))
        places = places / (size or 1.0)  # squares of what is large overflow
        for k, place in enumerate(places):
            apart = float(np.linalg.norm(places[k + 1 :] - place, axis=1).max(initial=0.0))
            longest = max(longest, apart * size if apart > ROUNDED else 0.0)
    return longest


@np.errstate(over="ignore", invalid="ignore")
def inertia_scales(masses: Sequence[float], tensors: Sequence[ArrayLike], length: float) -> list[float]:
    """m l^2 (kg m^2) of each body, which what rounding leaves of its inertia is judged by.

    A body without mass counts with the largest of all, a mechanism without mass by its largest moment.  The length is
    that of :func:`longest_within`: the programs that compute inertias shift them over such distances.  If it is 0, the
    largest radius of gyration takes its place.
    """
    heaviest = max((abs(m) for m in masses), default=0.0)
    if heaviest == 0.0:
        return [max((float(np.abs(tensor).max()) for tensor in tensors), default=0.0)] * len(masses)
    sizes = [abs(m) or heaviest for m in masses]
    square = length * length or max(abs(float(np.trace(tensor))) / m for m, tensor in zip(sizes, tensors, strict=True))
    return [m * square for m in sizes]


def fault_of_inertia(
    tensor: ArrayLike, plane: Sequence[float] | None = None, scale: float = 0.0
) -> tuple[str, str] | None:
    """The message and remedy for a tensor about the centre of mass that no distribution of mass has; None for others.

    In a plane, whose axis is given, only the moment about it is judged.  Moments below the rounding of the scale, m l^2
    of :func:`inertia_scales`, say nothing.  Two moments that are 0 pass: one moment alone is that of a body that moves
    in a plane.
    """
    full = np.asarray(tensor, dtype=float).reshape(3, 3)
    largest = float(np.abs(full).max())
    if not math.isfinite(largest):
        return "has an entry that is not finite", "give finite numbers, whose products are finite too"
    unit = 2.0 ** (math.frexp(largest)[1] - 1)  # a power of two: exact, and no sum of entries overflows
    full, computed = full / unit, COMPUTED * (scale / unit)
    if plane is not None:
        n = np.asarray(plane, dtype=float)
        moment, size = float(n @ full @ n), float(np.abs(full).max())
        if moment < -max(DIGITS * size, computed):
            return f"the moment about the centre of mass is {moment * unit:.6g}", SHIFTED
        return None
    a, b, c = algebra.eigvalsh(full).tolist()
    size = max(abs(a), abs(c))
    if a < -max(DIGITS * size, computed):
        return f"has a negative principal moment {a * unit:.6g}", NEGATIVE
    if b > max(MOMENT * size, computed) and c > (1 + TRIANGLE) * (a + b) + computed:
        listed = ", ".join(f"{moment * unit:.6g}" for moment in (a, b, c))
        return f"principal moments {listed}: one exceeds the sum of the others", EXCESS
    return None


# -- the rules of several numbers --------------------------------------------------------------------------------------


#: Normals at which a support is looked at: 7 degrees apart.
NORMALS = 800
CORRECT_TURN = (
    "make value and slope at 2 pi equal to those at 0, with pieces or a table of kind periodic; give periodic: false "
    "for a cam that stays within one turn"
)


def _limits(values: Any, message: str, remedy: str) -> list[Flaw]:
    """Two numbers, of which the first must not exceed the second; the message has both."""
    first, second = (float(x) for x in values)
    return [] if first <= second else [Flaw("", message.format(first, second), remedy)]


def _below(values: Any, message: str, remedy: str) -> list[Flaw]:
    """Two numbers, of which the first must be less than the second; message and remedy may have both."""
    first, second = (float(x) for x in values)
    return [] if first < second else [Flaw("", message.format(first, second), remedy.format(first, second))]


def _not_zero(values: Any, message: str, remedy: str) -> list[Flaw]:
    return [Flaw("", message, remedy)] if float(values[0]) == 0.0 else []


def _wheels(values: Any, names: Sequence[str]) -> list[Flaw]:
    """Sizes of wheels of a planetary set, by their names."""
    size = dict(zip(names, (float(x) for x in values), strict=True))
    if {"sun", "ring"} <= size.keys() and size["ring"] <= size["sun"]:
        message = f"ring {size['ring']:g} is not larger than sun {size['sun']:g}"
        return [Flaw("", message, "the sun must be smaller than the ring")]
    if len(size) == 3 and abs(size["ring"] - size["sun"] - 2 * size["planet"]) > TENSOR * size["ring"]:
        message = f"ring {size['ring']:g} is not sun {size['sun']:g} + 2 planet {size['planet']:g}"
        return [Flaw("", message, "the sizes must fit (ring = sun + 2 planet); leave one of them out")]
    return []


def _rotation(values: Any) -> list[Flaw]:
    """Nine entries of a matrix, row by row."""
    turn = np.array(values, dtype=float).reshape(3, 3)
    if np.abs(turn @ turn.T - np.eye(3)).max() <= PERPENDICULAR and np.linalg.det(turn) > 0.0:
        return []
    remedy = "its columns must be three axes of length 1 at right angles, right-handed"
    return [Flaw("", "is not a rotation matrix", remedy)]


def judge_bodies(values: Any, bodies: Sequence[Sequence[Any]]) -> list[Flaw]:
    """Masses and inertias of all bodies, numbers that are not known being NaN.

    Values are of each body its mass, the nine entries of its tensor about the centre of mass, the axis of the one
    moment that was given if there is one, and the points whose distances tell its size; bodies have a name, whether
    there is an axis, the number of points, and whether it is judged.
    """
    numbers, at = np.array(values, dtype=float), 0
    masses, tensors, points = list[float](), list[Array](), list[list[Array]]()
    axes = list[Array | None]()
    for _, has_axis, count, _ in bodies:
        ends = np.cumsum([at, 1, 9, 3 * has_axis, 3 * count])
        mass, tensor, axis, central = (numbers[a:b] for a, b in itertools.pairwise(ends.tolist()))
        masses.append(float(mass[0]))
        tensors.append(tensor.reshape(3, 3))
        axes.append(axis if len(axis) else None)
        points.append([p for p in central.reshape(-1, 3) if np.isfinite(p).all()])
        at = int(ends[-1])
    known = [np.isfinite(tensor).all() for tensor in tensors]
    scales = inertia_scales(
        [mass if math.isfinite(mass) else 0.0 for mass in masses],
        [tensor if complete else np.zeros((3, 3)) for tensor, complete in zip(tensors, known, strict=True)],
        longest_within(points),
    )
    result: list[Flaw] = []
    for (name, _, _, judged), tensor, complete, line, scale in zip(bodies, tensors, known, axes, scales, strict=True):
        if judged and complete:
            plane = None if line is None or not np.isfinite(line).all() else line.tolist()
            if fault := fault_of_inertia(tensor, plane, scale):
                result.append(Flaw(f".{name}.inertia", *fault))
    return result


def turn_points() -> Array:
    """Angles at which the profile of a cam is looked at (1, 102), the two ends of its turn first."""
    return np.concatenate([[EDGE, math.tau - EDGE], np.linspace(EDGE, math.tau - EDGE, 100)])[None]


def judge_turn(values: Any) -> list[Flaw]:
    """A profile and its slope over a turn, at :func:`turn_points`: what it is elsewhere is judged elsewhere."""
    result = np.asarray(values, dtype=float)
    if not np.isfinite(result).all():
        return []
    rounding = LAW * float(np.abs(result[0]).max())
    for what, f, size in (("value", result[0], np.ptp(result[0])), ("slope", result[1], np.abs(result[1]).max())):
        first, last = (0.0 if abs(x) < ZERO * size else float(x) for x in f[:2])
        if abs(last - first) > CLOSING * float(size) + rounding:
            message = f"does not close after a turn: its {what} is {first:.6g} at theta = 0 and {last:.6g} at 2 pi"
            return [Flaw("", message, CORRECT_TURN)]
    return []


def spread_normals(count: int = NORMALS) -> Array:
    """Unit vectors (3, count) spread over the sphere on a spiral, none of them along an axis."""
    k = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * k / count, math.pi * (1.0 + math.sqrt(5.0)) * k
    radius = np.sqrt(1.0 - z * z)
    return np.array([radius * np.cos(turn), radius * np.sin(turn), z])


def judge_support(values: Any) -> list[Flaw]:
    """A support, its slopes and second derivatives (13, count) at :func:`spread_normals`: whether it is convex."""
    normals, result = spread_normals(), np.asarray(values, dtype=float)
    usable = np.isfinite(result).all(axis=0)  # a formula such as that of a disc has no curvature at its poles
    normals, result = normals[:, usable], result[:, usable]
    if not usable.any():
        message = "is not a number, or has no slopes, whatever the normal is"
        return [Flaw("", message, "give the distance in metres")]
    radii = radii_of_curvature(normals, result)
    size = np.abs(result[:4]).sum(axis=0).max()
    least, most = radii[0].argmin(), radii[1].argmin()
    hollow = radii[0, least] < -SHARP * size
    if not hollow and radii[1, most] > SHARP * size:
        return []
    if hollow:
        what = f"is not of a convex body: its radius of curvature is {radii[0, least]:.3g}"
    else:
        what = "is of a body with a corner: both radii of curvature are 0"
    at = ", ".join(f"{x:.3g}" for x in normals[:, least if hollow else most])
    remedy = (
        "give how far from the marker the plane lies that touches a smooth convex body with the normal [nx, ny, nz]"
    )
    return [Flaw("", f"{what} where the outward normal is [{at}]", remedy)]


def radii_of_curvature(normals: Array, contour: Array) -> Array:
    """The smaller and the larger radius (2, count), of values, slopes and second derivatives (13, count)."""
    n, (f, slopes, bends) = normals.T, (contour[0], contour[1:4].T, contour[4:].T.reshape(-1, 3, 3))
    flat = np.eye(3) - n[:, :, None] * n[:, None, :]
    bent = flat @ bends @ flat + (f - (slopes * n).sum(axis=1))[:, None, None] * flat
    twice, trace = (bent * bent).sum(axis=(1, 2)), np.trace(bent, axis1=1, axis2=2)
    apart = np.sqrt(np.maximum(0.0, 2.0 * twice - trace * trace))  # the third eigenvalue, along n, is 0
    return np.array([trace - apart, trace + apart]) / 2.0


BELOW, BODIES, LIMITS, NOT_ZERO, OUTLINE, RISING = "below", "bodies", "limits", "not zero", "outline", "rising"
ROTATION, SPROCKET, SUPPORT, TURN, WHEELS = "rotation", "sprocket", "support", "turn", "wheels"
#: Name of a rule -> what judges numbers by it.
RULES: Mapping[str, Callable[..., list[Flaw]]] = {
    RANGE: judge_range,
    BELOW: _below,
    BODIES: judge_bodies,
    LIMITS: _limits,
    NOT_ZERO: _not_zero,
    OUTLINE: judge_outline,
    RISING: judge_rising,
    ROTATION: _rotation,
    SPROCKET: judge_sprocket,
    SUPPORT: judge_support,
    TURN: judge_turn,
    WHEELS: _wheels,
}
#: The points (n, count) of the local names of rules that look at a formula in many places.
POINTS: Mapping[str, Callable[[], Array]] = {SUPPORT: spread_normals, TURN: turn_points}


def surely_right(rule: str, values: Array, data: Sequence[Any]) -> Any:
    """Whether numbers (n, k) of k sets of parameters keep a rule, a flag each; False where that takes a closer look."""
    if rule == RANGE:
        return Allowed(*data[:4]).has(values[0])
    if rule == LIMITS:
        return values[0] <= values[1]
    if rule == NOT_ZERO:
        return values[0] != 0.0
    if rule in (RISING, BELOW):
        return values[0] < values[1]
    if rule == BODIES:
        return _possible_bodies(values, *data)
    return np.zeros(values.shape[-1], dtype=bool)


@np.errstate(all="ignore")
def _possible_bodies(values: Array, bodies: Sequence[Sequence[Any]]) -> Any:
    """Whether inertias pass :func:`fault_of_inertia` whatever the sizes of the bodies are, of k sets each."""
    at, right = 0, np.isfinite(values).all(axis=0)
    values = np.where(right, values, 0.0)
    for _, has_axis, count, judged in bodies:
        tensor, n = values[at + 1 : at + 10].T.reshape(-1, 3, 3), values[at + 10 : at + 13].T
        at += 10 + 3 * (has_axis + count)
        if judged and has_axis:
            moment = (n[:, None, :] @ tensor @ n[:, :, None])[:, 0, 0]
            right &= moment >= -DIGITS * np.abs(tensor).max(axis=(1, 2))
        elif judged:
            a, b, c = algebra.eigvalsh(tensor).T
            size = np.maximum(np.abs(a), np.abs(c))
            right &= (a >= -DIGITS * size) & ((b <= MOMENT * size) | (c <= (1 + TRIANGLE) * (a + b)))
    return right
