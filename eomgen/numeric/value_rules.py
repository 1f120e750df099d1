"""Numeric: numbers of an element -> what of them is not allowed; the rules, for declared values and for late ones.

A rule takes its numbers, a row each (rows over the points where a formula is looked at), and what belongs to the place.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ..base.limits.numbers import CLOSING, EDGE, LAW, PERPENDICULAR, SHARP, TENSOR, ZERO
from .outline_rules import judge_outline, judge_rising, judge_sprocket
from .rigid_inertia import fault_of_inertia, inertia_scales, longest_within
from .space import Array
from .value_ranges import RANGE, Allowed, Flaw, judge_range

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

    Parameters
    ----------
    values : sequence of float
        Of each body its mass, the nine entries of its tensor about the centre of mass, the axis of the one moment that
        was given if there is one, and the points whose distances tell its size.
    bodies : sequence of (name, whether there is an axis, number of points, whether it is judged)
    """
    numbers, at = np.array(values, dtype=float), 0
    masses, tensors, points = list[float](), list[Array](), list[list[Array]]()
    axes = list[Array | None]()
    for _, has_axis, count, _ in bodies:
        ends = np.cumsum([at, 1, 9, 3 * has_axis, 3 * count])
        mass, tensor, axis, own = (numbers[a:b] for a, b in itertools.pairwise(ends.tolist()))
        masses.append(float(mass[0]))
        tensors.append(tensor.reshape(3, 3))
        axes.append(axis if len(axis) else None)
        points.append([p for p in own.reshape(-1, 3) if np.isfinite(p).all()])
        at = int(ends[-1])
    known = [np.isfinite(tensor).all() for tensor in tensors]
    scales = inertia_scales(
        [mass if math.isfinite(mass) else 0.0 for mass in masses],
        [tensor if told else np.zeros((3, 3)) for tensor, told in zip(tensors, known, strict=True)],
        longest_within(points),
    )
    found: list[Flaw] = []
    for (name, _, _, judged), tensor, told, line, scale in zip(bodies, tensors, known, axes, scales, strict=True):
        if judged and told:
            plane = None if line is None or not np.isfinite(line).all() else line.tolist()
            if fault := fault_of_inertia(tensor, plane, scale):
                found.append(Flaw(f".{name}.inertia", *fault))
    return found


def turn_points() -> Array:
    """Angles at which the profile of a cam is looked at (1, 102), the two ends of its turn first."""
    return np.concatenate([[EDGE, math.tau - EDGE], np.linspace(EDGE, math.tau - EDGE, 100)])[None]


def judge_turn(values: Any) -> list[Flaw]:
    """A profile and its slope over a turn, at :func:`turn_points`: what it is elsewhere is judged elsewhere."""
    found = np.asarray(values, dtype=float)
    if not np.isfinite(found).all():
        return []
    rounding = LAW * float(np.abs(found[0]).max())
    for what, f, size in (("value", found[0], np.ptp(found[0])), ("slope", found[1], np.abs(found[1]).max())):
        first, last = (0.0 if abs(x) < ZERO * size else float(x) for x in f[:2])
        if abs(last - first) > CLOSING * float(size) + rounding:
            message = f"does not close after a turn: its {what} is {first:.6g} at theta = 0 and {last:.6g} at 2 pi"
            return [Flaw("", message, CORRECT_TURN)]
    return []


def spread_normals(count: int = NORMALS) -> Array:
    """Unit vectors (3, count) spread over the sphere on a spiral, none of them along an axis."""
    k = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * k / count, math.pi * (1.0 + math.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z * z)
    return np.array([across * np.cos(turn), across * np.sin(turn), z])


def judge_support(values: Any) -> list[Flaw]:
    """A support, its slopes and second derivatives (13, count) at :func:`spread_normals`: whether it is convex."""
    normals, found = spread_normals(), np.asarray(values, dtype=float)
    usable = np.isfinite(found).all(axis=0)  # a formula such as that of a disc has no curvature at its poles
    normals, found = normals[:, usable], found[:, usable]
    if not usable.any():
        message = "is not a number, or has no slopes, whatever the normal is"
        return [Flaw("", message, "give the distance in metres")]
    radii = radii_of_curvature(normals, found)
    size = np.abs(found[:4]).sum(axis=0).max()
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


def radii_of_curvature(normals: Array, found: Array) -> Array:
    """The smaller and the larger radius (2, count), of values, slopes and second derivatives (13, count)."""
    n, (f, slopes, bends) = normals.T, (found[0], found[1:4].T, found[4:].T.reshape(-1, 3, 3))
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
    return np.zeros(values.shape[-1], dtype=bool)
