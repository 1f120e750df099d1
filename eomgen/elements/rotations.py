"""Rotations: matrices, Euler angles and parameters, Rodrigues parameters, rotation vectors, quaternions, their rates.

Every function takes numbers, SymPy expressions or graph expressions, as sequences, arrays or matrices, and answers
in kind: NumPy arrays, SymPy matrices, or tuples of graph expressions.  A rotation matrix takes body to ground axes;
quaternions and Euler parameters have the scalar first; angles are in radians.

Numbers and graph expressions are right everywhere, at no rotation and half turns too.  SymPy answers with the general
form, as textbooks do: it assumes e0 > 0 and an angle that is not 0, and may give angles a full turn off.

>>> from eomgen import rotations
>>> rotations.euler_angles_from_matrix("xyz", [[0, -1, 0], [1, 0, 0], [0, 0, 1]]).round(6) + 0
array([0.      , 0.      , 1.570796])
"""

from __future__ import annotations

import math
from typing import Any

from ..base.limits.numbers import TINY
from .scalars import (
    Scalar,
    atan2,
    axes_of,
    axes_of_turns,
    combine,
    cos,
    dot,
    entries,
    require_rotation,
    rows,
    shaped,
    sin,
    sqrt,
    transpose,
    turned,
    where_less,
)

__all__ = [
    "PARAMETERS",
    "angular_velocity",
    "axis_angle_from_matrix",
    "conjugate_quaternion",
    "euler_angles_from_euler_parameters",
    "euler_angles_from_matrix",
    "euler_parameters_from_axis_angle",
    "euler_parameters_from_euler_angles",
    "euler_parameters_from_matrix",
    "euler_parameters_from_modified_rodrigues",
    "euler_parameters_from_rodrigues",
    "euler_parameters_from_rotation_vector",
    "matrix_from_axis_angle",
    "matrix_from_euler_angles",
    "matrix_from_euler_parameters",
    "matrix_from_rotation_vector",
    "modified_rodrigues_from_euler_parameters",
    "multiply_quaternions",
    "normalize_quaternion",
    "rate_matrix",
    "rodrigues_from_euler_parameters",
    "rotation_vector_from_euler_parameters",
    "rotation_vector_from_matrix",
    "turn_vector",
    "velocity_matrix",
]

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


# -- Euler angles in any of the 12 sequences: intrinsic, R = R_a(q1) R_b(q2) R_c(q3) -----------------------------------


def matrix_from_euler_angles(sequence: str, angles: Any) -> Any:
    """The rotation matrix of intrinsic Euler angles (3,) (rad).

    Parameters
    ----------
    sequence : str
        Axes, such as ``"xyz"`` or ``"zxz"``; each turn is about an axis of the frame the one before made.
    angles : (3,) numbers, SymPy expressions or Exprs
    """
    return shaped(turned(axes_of(sequence), entries(angles, 3, "Euler angles")))


def euler_parameters_from_euler_angles(sequence: str, angles: Any) -> Any:
    """Euler parameters of intrinsic Euler angles (rad)."""
    result: Any = [1, 0, 0, 0]
    for axis, angle in zip(axes_of(sequence), entries(angles, 3, "Euler angles"), strict=True):
        turn = [cos(angle / 2), 0, 0, 0]
        turn[1 + axis] = sin(angle / 2)
        result = multiply_quaternions(result, turn)
    return result


def euler_angles_from_euler_parameters(sequence: str, e: Any) -> Any:
    """Intrinsic Euler angles in [-pi, pi]; the middle one in [-pi/2, pi/2] (three different axes) or [0, pi].

    Half sum and half difference of the outer angles are found apart, so that the matrix of the angles is right to
    rounding at the singular middle angles too (Bernardes and Viollet, PLoS ONE 17 (2022) e0276302).
    """
    i, j, k = axes_of(sequence)
    listed = entries(e, 4, "Euler parameters")
    scalar, v = listed[0], listed[1:]
    other = 3 - i - j
    sign = 1 if (j - i) % 3 == 1 else -1
    first, middle, last = v[i], v[j], sign * v[other]
    proper = i == k
    if not proper:  # a quarter turn more about the middle axis makes it a sequence i j i
        scalar, first, middle, last = scalar - middle, first - last, middle + scalar, last + first
    tilt = 2 * atan2(sqrt(middle * middle + last * last), sqrt(scalar * scalar + first * first))
    total, difference = atan2(first, scalar), atan2(last, middle)
    one, three = _wrap(total + difference), _wrap(total - difference)
    if proper:
        return shaped([one, tilt, three])
    return shaped([one, tilt - math.pi / 2, -sign * three])


def _wrap(angle: Scalar) -> Scalar:
    high = where_less(math.pi, angle, angle - 2 * math.pi, angle)
    return where_less(angle, -math.pi, angle + 2 * math.pi, high)


def euler_angles_from_matrix(sequence: str, rotation: Any) -> Any:
    """Intrinsic Euler angles of a rotation matrix; see :func:`euler_angles_from_euler_parameters`."""
    return euler_angles_from_euler_parameters(sequence, euler_parameters_from_matrix(rotation))


# -- rates -------------------------------------------------------------------------------------------------------------


PARAMETERS = ("euler_angles", "euler_parameters", "rotation_vector", "rodrigues", "modified_rodrigues")
Rows = list[list[Scalar]]
NEAR = 0.01  #: square of an angle below which series replace quotients 0/0


def velocity_matrix(kind: str, values: Any, axes: str = "body", sequence: str = "xyz") -> Any:
    """The matrix that takes rates of rotation parameters to the angular velocity.

    Parameters
    ----------
    kind : str
        One of :data:`PARAMETERS`.
    values : (3,) or (4,)
        The parameters.
    axes : str
        ``"body"`` for G-bar, ``"ground"`` for G.
    sequence : str
        Of Euler angles.

    Returns
    -------
    (3, 3) or, for Euler parameters, (3, 4)
    """
    sign = _sign(axes)
    if kind == "euler_angles":
        return shaped(_euler(values, sign, sequence))
    if kind == "euler_parameters":
        return shaped([[2 * x for x in row] for row in _quaternion(values, sign)])
    v = _three(kind, values)
    square = dot(v, v)
    if kind == "rodrigues":
        factor = 2 / (1 + square)
        return shaped(combine(factor, sign * factor, 0, v))
    if kind == "modified_rodrigues":
        factor = 4 / ((1 + square) * (1 + square))
        return shaped(combine(factor * (1 - square), 2 * sign * factor, 2 * factor, v))
    _, second, third = _coefficients(square)
    # I + sign c2 [v] + c3 [v]^2, with [v]^2 = v v^T - v.v I
    return shaped(combine(1 - third * square, sign * second, third, v))


def rate_matrix(kind: str, values: Any, axes: str = "body", sequence: str = "xyz") -> Any:
    """The matrix that takes the angular velocity to the rates of rotation parameters; see :func:`velocity_matrix`.

    Returns
    -------
    (3, 3) or, for Euler parameters, (4, 3)
        Euler angles have none where the first and last axes are in line.
    """
    sign = _sign(axes)
    if kind == "euler_angles":
        return shaped(_inverse(_euler(values, sign, sequence)))
    if kind == "euler_parameters":
        return shaped([[x / 2 for x in row] for row in transpose(_quaternion(values, sign))])
    v = _three(kind, values)
    square = dot(v, v)
    if kind == "rodrigues":
        return shaped([[x / 2 for x in row] for row in combine(1, -sign, 1, v)])
    if kind == "modified_rodrigues":
        return shaped([[x / 4 for x in row] for row in combine(1 - square, -2 * sign, 2, v)])
    near = where_less(square, NEAR, 1, square)
    first, second, _ = _coefficients(near)
    series = (1 + square / 60 + square * square / 2520 + square * square * square / 100800) / 12
    factor = where_less(square, NEAR, series, (1 - first / (2 * second)) / near)
    return shaped(combine(1 - factor * square, -sign * ((square * 0 + 1) / 2), factor, v))


def angular_velocity(kind: str, values: Any, rates: Any, axes: str = "body", sequence: str = "xyz") -> Any:
    """Angular velocity (3,) (rad/s) in body or ground axes from rotation parameters and their rates."""
    matrix = velocity_matrix(kind, values, axes, sequence)
    listed = matrix.tolist() if hasattr(matrix, "tolist") else matrix
    raw = entries(rates, len(listed[0]), "rates")
    return shaped([dot(row, raw) for row in listed])


def _sign(axes: str) -> int:
    if axes not in ("body", "ground"):
        raise ValueError(f"axes {axes!r} are not known; allowed: body, ground")
    return -1 if axes == "body" else 1


def _three(kind: str, values: Any) -> list[Scalar]:
    if kind not in PARAMETERS:
        raise ValueError(f"no rotation parameters {kind!r}; known: {', '.join(PARAMETERS)}")
    return entries(values, 3, kind)


def _euler(values: Any, sign: int, sequence: str) -> Rows:
    """Columns: the axis of each turn."""
    return transpose(axes_of_turns(axes_of(sequence), entries(values, 3, "Euler angles"), sign))


def _quaternion(values: Any, sign: int) -> Rows:
    """E (ground) or E-bar (body)."""
    a, b, c, d = entries(values, 4, "Euler parameters")
    if sign > 0:
        return [[-b, a, -d, c], [-c, d, a, -b], [-d, -c, b, a]]
    return [[-b, a, d, -c], [-c, -d, a, b], [-d, c, -b, a]]


def _coefficients(square: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """sin a / a, (1 - cos a) / a^2 and (a - sin a) / a^3 of a^2."""
    s = square
    near = where_less(s, NEAR, 1, s)
    a = sqrt(near)
    series = (
        1 - s / 6 * (1 - s / 20 * (1 - s / 42 * (1 - s / 72))),
        (1 - s / 12 * (1 - s / 30 * (1 - s / 56 * (1 - s / 90)))) / 2,
        (1 - s / 20 * (1 - s / 42 * (1 - s / 72 * (1 - s / 110)))) / 6,
    )
    exact = (sin(a) / a, (1 - cos(a)) / near, (a - sin(a)) / (near * a))
    first, second, third = (where_less(s, NEAR, x, y) for x, y in zip(series, exact, strict=True))
    return first, second, third


def _inverse(m: Rows) -> Rows:
    """Inverse of a 3 x 3 matrix by cofactors."""
    cofactors = [
        [
            m[(i + 1) % 3][(j + 1) % 3] * m[(i + 2) % 3][(j + 2) % 3]
            - m[(i + 1) % 3][(j + 2) % 3] * m[(i + 2) % 3][(j + 1) % 3]
            for j in range(3)
        ]
        for i in range(3)
    ]
    determinant = dot(m[0], cofactors[0])
    return [[x / determinant for x in row] for row in transpose(cofactors)]
