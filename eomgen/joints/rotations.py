"""Joints: elementary rotations and Euler-angle sequences as expressions (Shabana, Computational Dynamics, ch. 7)."""

from __future__ import annotations

from collections.abc import Sequence

from ..graph import vectors as vec
from ..graph.core import Expr, Graph, cos, sin
from ..graph.vectors import Mat3, Vec3

AXES = {"x": 0, "y": 1, "z": 2}


def unit(graph: Graph, axis: int) -> Vec3:
    """The unit vector of axis 0, 1 or 2."""
    o, i = graph.zero, graph.one
    return ((i, o, o), (o, i, o), (o, o, i))[axis]


def about(graph: Graph, axis: int, angle: Expr) -> Mat3:
    """Rotation by ``angle`` about axis 0, 1 or 2; takes turned axes to the original ones."""
    o, i = graph.zero, graph.one
    c, s = cos(angle), sin(angle)
    if axis == 0:
        return ((i, o, o), (o, c, -s), (o, s, c))
    if axis == 1:
        return ((c, o, s), (o, i, o), (-s, o, c))
    return ((c, -s, o), (s, c, o), (o, o, i))


def euler(graph: Graph, sequence: str, angles: Sequence[Expr]) -> Mat3:
    """R = R_a(q1) R_b(q2) R_c(q3), intrinsic: each turn is about an axis of the frame the one before made."""
    result = about(graph, AXES[sequence[0]], angles[0])
    for letter, angle in zip(sequence[1:], angles[1:], strict=True):
        result = vec.product(result, about(graph, AXES[letter], angle))
    return result


def euler_rates(graph: Graph, sequence: str, angles: Sequence[Expr]) -> list[Vec3]:
    """Columns g_k with omega = sum g_k q_k' in the turned axes (Shabana, ch. 7: omega-bar = G-bar theta')."""
    columns = []
    for k, letter in enumerate(sequence):
        column = unit(graph, AXES[letter])
        for later, angle in zip(sequence[k + 1 :], angles[k + 1 :], strict=True):
            column = vec.transpose_times(about(graph, AXES[later], angle), column)
        columns.append(column)
    return columns


def euler_angles(graph: Graph, sequence: str, rotation: Mat3) -> list[Expr]:
    """The angles of a rotation matrix; the middle one in [-pi/2, pi/2] (three different axes) or [0, pi]."""
    i, j, k = (AXES[letter] for letter in sequence)
    atan2 = graph.apply
    if i != k:
        sign = 1.0 if (i, j, k) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0
        first = atan2("atan2", -sign * rotation[j][k], rotation[k][k])
        second = atan2("asin", _clamp(graph, sign * rotation[i][k]))
        third = atan2("atan2", -sign * rotation[i][j], rotation[i][i])
        return [first, second, third]
    other = 3 - i - j
    sign = 1.0 if (i, j, other) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0
    first = atan2("atan2", rotation[j][i], -sign * rotation[other][i])
    second = atan2("acos", _clamp(graph, rotation[i][i]))
    third = atan2("atan2", rotation[i][j], sign * rotation[i][other])
    return [first, second, third]


def _clamp(graph: Graph, x: Expr) -> Expr:
    return graph.apply("max", graph.apply("min", x, 1.0), -1.0)
