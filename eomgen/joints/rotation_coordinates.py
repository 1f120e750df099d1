"""Joints: rotations, Euler angles and Euler parameters as expressions (Shabana, Computational Dynamics, ch. 7)."""

from __future__ import annotations

from collections.abc import Sequence

from ..graph import vectors as vec
from ..graph.core import Expr, Graph, atan2, sqrt
from ..graph.vectors import Mat3, Vec3
from ..rotations.euler import AXES, elementary


def unit(graph: Graph, axis: int) -> Vec3:
    """The unit vector of axis 0, 1 or 2."""
    o, i = graph.zero, graph.one
    return ((i, o, o), (o, i, o), (o, o, i))[axis]


def about(graph: Graph, axis: int, angle: Expr) -> Mat3:
    """Rotation by ``angle`` about axis 0, 1 or 2; takes turned axes to the original ones."""
    return vec.matrix(graph, elementary(axis, angle))


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
    """The angles of a rotation matrix; the middle one in [-pi/2, pi/2] (three different axes) or [0, pi].

    Sine and cosine of the middle angle give it, so that value and rate stay right near the singular angles, where one
    of the two alone loses half the digits.
    """
    i, j, k = (AXES[letter] for letter in sequence)
    if i != k:
        sign = 1.0 if (i, j, k) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0
        upper, lower = rotation[j][k], rotation[k][k]
        first = atan2(-sign * upper, lower)
        second = atan2(sign * rotation[i][k], sqrt(upper * upper + lower * lower))
        third = atan2(-sign * rotation[i][j], rotation[i][i])
        return [first, second, third]
    other = 3 - i - j
    sign = 1.0 if (i, j, other) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0
    upper, lower = rotation[j][i], rotation[other][i]
    first = atan2(upper, -sign * lower)
    second = atan2(sqrt(upper * upper + lower * lower), rotation[i][i])
    third = atan2(rotation[i][j], sign * rotation[i][other])
    return [first, second, third]


def parameter_rotation(graph: Graph, e: Sequence[Expr]) -> Mat3:
    """Rotation of Euler parameters e0 (scalar) .. e3 of any length but zero: R = 1 + 2 (e0 e~ + e~ e~) / |e|^2."""
    e0, e1, e2, e3 = e
    s = 2.0 / (e0 * e0 + e1 * e1 + e2 * e2 + e3 * e3)
    s1, s2, s3 = s * e1, s * e2, s * e3
    w1, w2, w3 = s1 * e0, s2 * e0, s3 * e0
    xx, yy, zz, xy, xz, yz = s1 * e1, s2 * e2, s3 * e3, s1 * e2, s1 * e3, s2 * e3
    i = graph.one
    return (
        (i - (yy + zz), xy - w3, xz + w2),
        (xy + w3, i - (xx + zz), yz - w1),
        (xz - w2, yz + w1, i - (xx + yy)),
    )


def parameter_rates(e: Sequence[Expr], w: Sequence[Expr]) -> list[Expr]:
    """e' = E-bar^T w / 2 with w in the turned axes (Shabana, ch. 7: omega-bar = 2 E-bar theta'); keeps |e|."""
    e0, e1, e2, e3 = e
    h1, h2, h3 = (0.5 * x for x in w)
    return [
        -(e1 * h1 + e2 * h2 + e3 * h3),
        e0 * h1 - e3 * h2 + e2 * h3,
        e3 * h1 + e0 * h2 - e1 * h3,
        e1 * h2 - e2 * h1 + e0 * h3,
    ]


def parameters_of(graph: Graph, rotation: Mat3) -> list[Expr]:
    """Unit Euler parameters of a rotation matrix with e0 >= 0, from its largest one (Shepperd, 1978, J. Guidance 1)."""
    r = rotation
    skew = (r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1])
    trace = r[0][0] + r[1][1] + r[2][2]
    squares = [1.0 + trace, *(1.0 + 2.0 * r[k][k] - trace for k in range(3))]  # 4 e_k^2
    ways = []
    for k, square in enumerate(squares):
        root = graph.apply("sqrt", graph.apply("max", square, 0.5))  # the largest is at least 1
        half = 0.5 / root
        if k == 0:
            way = [0.5 * root, *(half * x for x in skew)]
        else:
            way = [half * skew[k - 1], *(half * (r[k - 1][j] + r[j][k - 1]) for j in range(3))]
            way[k] = 0.5 * root
            sign = graph.apply("select", graph.apply("lt", way[0], 0.0), -1.0, 1.0)
            way = [sign * x for x in way]
        ways.append(way)
    result, best = ways[0], squares[0]
    for way, square in zip(ways[1:], squares[1:], strict=True):
        larger = graph.apply("lt", best, square)
        result = [graph.apply("select", larger, x, y) for x, y in zip(way, result, strict=True)]
        best = graph.apply("max", best, square)
    return result
