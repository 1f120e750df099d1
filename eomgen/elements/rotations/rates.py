"""Rotations, rates: parameters and their rates <-> angular velocity, in body and in ground axes.

omega = G p' in ground axes and omega-bar = G-bar p' in body axes (Shabana, Computational Dynamics, sec. 7.3 to 7.7);
rotation vectors after Shuster, J. Astronaut. Sci. 41 (1993), sec. on kinematics.
"""

from __future__ import annotations

from typing import Any

from .euler import axes_of, elementary
from .scalars import Scalar, combine, cos, dot, entries, shaped, sin, sqrt, times, transpose, where_less

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
    return shaped(combine(1 - factor * square, -sign * _half(square), factor, v))


def angular_velocity(kind: str, values: Any, rates: Any, axes: str = "body", sequence: str = "xyz") -> Any:
    """Angular velocity (3,) (rad/s) in body or ground axes from rotation parameters and their rates."""
    matrix = velocity_matrix(kind, values, axes, sequence)
    listed = matrix.tolist() if hasattr(matrix, "tolist") else matrix
    given = entries(rates, len(listed[0]), "rates")
    return shaped([dot(row, given) for row in listed])


def _half(like: Scalar) -> Scalar:
    return (like * 0 + 1) / 2  # exact in symbols


def _sign(axes: str) -> int:
    if axes not in ("body", "ground"):
        raise ValueError(f"axes {axes!r} are not known; allowed: body, ground")
    return -1 if axes == "body" else 1


def _three(kind: str, values: Any) -> list[Scalar]:
    if kind not in PARAMETERS:
        raise ValueError(f"no rotation parameters {kind!r}; known: {', '.join(PARAMETERS)}")
    return entries(values, 3, kind)


def _euler(values: Any, sign: int, sequence: str) -> Rows:
    """Columns: the axis of each turn, carried through the later turns (body) or the earlier ones (ground)."""
    turns = [elementary(a, q) for a, q in zip(axes_of(sequence), entries(values, 3, "Euler angles"), strict=True)]
    columns = []
    for n, axis in enumerate(axes_of(sequence)):
        column: Rows = [[int(k == axis)] for k in range(3)]
        for turn in turns[n + 1 :] if sign < 0 else reversed(turns[:n]):
            column = times(transpose(turn) if sign < 0 else turn, column)
        columns.append([x for (x,) in column])
    return transpose(columns)


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
