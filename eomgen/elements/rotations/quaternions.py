"""Rotations, Euler parameters e = (cos a/2, n sin a/2), scalar first, of unit length: their algebra and conversions.

Sources: Shabana, Computational Dynamics (3rd ed. 2010), sec. 7.5 to 7.7 (Euler parameters, Rodrigues parameters);
Shuster, A survey of attitude representations, J. Astronaut. Sci. 41 (1993).
"""

from __future__ import annotations

from typing import Any

from ...base.limits.numbers import TINY
from .scalars import Scalar, atan2, combine, cos, dot, entries, require_rotation, rows, shaped, sin, sqrt, where_less

SMALL = 1e-4  #: squares below which series replace quotients 0/0; the terms left out are below rounding


def multiply_quaternions(a: Any, b: Any) -> Any:
    """The product a b: first turned by b, then by a, both in the fixed axes; R(a b) = R(a) R(b)."""
    a0, *u = entries(a, 4, "a quaternion")
    b0, *v = entries(b, 4, "a quaternion")
    cross = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
    return shaped([a0 * b0 - dot(u, v), *(a0 * v[k] + b0 * u[k] + cross[k] for k in range(3))])


def conjugate_quaternion(e: Any) -> Any:
    """The inverse rotation of unit Euler parameters: (e0, -e1, -e2, -e3)."""
    e0, *v = entries(e, 4, "a quaternion")
    return shaped([e0, *(-x for x in v)])


def normalize_quaternion(e: Any) -> Any:
    """``e / |e|``."""
    listed = entries(e, 4, "a quaternion")
    size = sqrt(dot(listed, listed))
    return shaped([x / size for x in listed])


def turn_vector(e: Any, vector: Any) -> Any:
    """R(e) times a vector (3,)."""
    r = entries(vector, 3, "a vector")
    return shaped([dot(row, r) for row in rows(matrix_from_euler_parameters(e))])


def matrix_from_euler_parameters(e: Any) -> Any:
    """R = (2 e0^2 - 1) I + 2 e0 skew(e) + 2 e e^T of unit Euler parameters (Shabana, sec. 7.5)."""
    e0, *v = entries(e, 4, "Euler parameters")
    return shaped(combine(2 * e0 * e0 - 1, 2 * e0, 2, v))


def euler_parameters_from_matrix(rotation: Any) -> Any:
    """Euler parameters with e0 >= 0 of a rotation matrix, exact at half turns too.

    The matrix 4 e e^T is linear in R; its row with the largest diagonal entry is normalized (Shepperd, J. Guid. Control
    1 (1978) 223).

    Raises
    ------
    ValueError
        Numbers that are no rotation: the message gives the determinant.
    """
    R = rows(rotation)
    require_rotation(R)
    trace = R[0][0] + R[1][1] + R[2][2]
    w = (R[2][1] - R[1][2], R[0][2] - R[2][0], R[1][0] - R[0][1])
    outer = [[1 + trace, *w]]
    for k in range(3):
        outer.append([w[k], *(R[k][j] + R[j][k] if j != k else 1 + 2 * R[k][k] - trace for j in range(3))])
    best, size = outer[0], outer[0][0]
    for k in range(1, 4):
        best = [where_less(size, outer[k][k], new, old) for new, old in zip(outer[k], best, strict=True)]
        size = where_less(size, outer[k][k], outer[k][k], size)
    length = sqrt(dot(best, best))
    sign = where_less(best[0], 0, -1, 1)
    return shaped([sign * x / length for x in best])


def euler_parameters_from_axis_angle(axis: Any, angle: Scalar) -> Any:
    """(cos a/2, n sin a/2) of a unit axis (3,) and an angle (rad)."""
    n = entries(axis, 3, "an axis")
    s = sin(angle / 2)
    return shaped([cos(angle / 2), *(s * x for x in n)])


def matrix_from_axis_angle(axis: Any, angle: Scalar) -> Any:
    """Rodrigues' formula R = cos a I + sin a skew(n) + (1 - cos a) n n^T of a unit axis (Shabana, sec. 7.4)."""
    n = entries(axis, 3, "an axis")
    c = cos(angle)
    return shaped(combine(c, sin(angle), 1 - c, n))


def axis_angle_from_matrix(rotation: Any) -> tuple[Any, Scalar]:
    """Unit axis (3,) and angle in [0, pi]; for no rotation the axis is x."""
    e0, *v = entries(euler_parameters_from_matrix(rotation), 4, "")
    square = dot(v, v)
    none = TINY
    size = sqrt(where_less(square, none, 1, square))
    axis = [where_less(square, none, float(k == 0), v[k] / size) for k in range(3)]
    return shaped(axis), 2 * atan2(where_less(square, none, 0, size), e0)


def euler_parameters_from_rotation_vector(vector: Any) -> Any:
    """Of the vector (3,) along the axis whose length is the angle; smooth at zero."""
    v = entries(vector, 3, "a rotation vector")
    square = dot(v, v)
    angle = sqrt(where_less(square, SMALL, 1, square))  # kept away from 0, where the other branch is taken
    series = (1 - square / 24 + square * square / 1920) / 2
    factor = where_less(square, SMALL, series, sin(angle / 2) / angle)
    first = where_less(square, SMALL, 1 - square / 8 + square * square / 384, cos(angle / 2))
    return shaped([first, *(factor * x for x in v)])


def rotation_vector_from_euler_parameters(e: Any) -> Any:
    """The rotation vector, of length at most pi; e and -e give the same."""
    listed = entries(e, 4, "Euler parameters")
    sign = where_less(listed[0], 0, -1, 1)
    e0, *v = (sign * x for x in listed)
    square = dot(v, v)
    size = sqrt(where_less(square, SMALL, 1, square))
    near = where_less(square, SMALL, e0, 1)
    ratio = square / (near * near)
    series = 2 / near * (1 - ratio / 3 + ratio * ratio / 5 - ratio * ratio * ratio / 7)
    factor = where_less(square, SMALL, series, 2 * atan2(size, e0) / size)
    return shaped([factor * x for x in v])


def matrix_from_rotation_vector(vector: Any) -> Any:
    """The exponential of skew(v): R for a rotation vector (3,)."""
    return matrix_from_euler_parameters(euler_parameters_from_rotation_vector(vector))


def rotation_vector_from_matrix(rotation: Any) -> Any:
    """The logarithm of R: axis times angle, of length at most pi."""
    return rotation_vector_from_euler_parameters(euler_parameters_from_matrix(rotation))


def rodrigues_from_euler_parameters(e: Any) -> Any:
    """Rodrigues parameters n tan a/2 (3,); raises ZeroDivisionError for half turns, which they do not know."""
    e0, *v = entries(e, 4, "Euler parameters")
    return shaped([x / e0 for x in v])


def euler_parameters_from_rodrigues(parameters: Any) -> Any:
    """Euler parameters of Rodrigues parameters n tan a/2."""
    g = entries(parameters, 3, "Rodrigues parameters")
    first = 1 / sqrt(1 + dot(g, g))
    return shaped([first, *(first * x for x in g)])


def modified_rodrigues_from_euler_parameters(e: Any) -> Any:
    """Modified Rodrigues parameters n tan a/4 (3,), of length at most 1."""
    listed = entries(e, 4, "Euler parameters")
    sign = where_less(listed[0], 0, -1, 1)
    e0, *v = (sign * x for x in listed)
    return shaped([x / (1 + e0) for x in v])


def euler_parameters_from_modified_rodrigues(parameters: Any) -> Any:
    """Euler parameters of modified Rodrigues parameters n tan a/4."""
    s = entries(parameters, 3, "modified Rodrigues parameters")
    square = dot(s, s)
    return shaped([(1 - square) / (1 + square), *(2 * x / (1 + square) for x in s)])
