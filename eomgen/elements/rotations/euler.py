"""Rotations, Euler angles in any of the 12 sequences: intrinsic, R = R_a(q1) R_b(q2) R_c(q3)."""

from __future__ import annotations

import math
from typing import Any

from .quaternions import euler_parameters_from_matrix, multiply_quaternions
from .scalars import Scalar, about, atan2, cos, entries, shaped, sin, sqrt, times, where_less

AXES = {"x": 0, "y": 1, "z": 2}


def axes_of(sequence: str) -> tuple[int, int, int]:
    """Indices of the three axes; raises ValueError for anything but one of the 12 sequences."""
    if len(sequence) != 3 or not set(sequence) <= set("xyz") or sequence[1] in (sequence[0], sequence[2]):
        raise ValueError(
            f"{sequence!r} is not a sequence of Euler angles; give three axes like 'xyz' or 'zxz', neighbours different"
        )
    i, j, k = (AXES[letter] for letter in sequence)
    return i, j, k


def elementary(axis: int, angle: Scalar) -> list[list[Scalar]]:
    """Rotation about axis 0, 1 or 2."""
    return about(axis, cos(angle), sin(angle))


def matrix_from_euler_angles(sequence: str, angles: Any) -> Any:
    """The rotation matrix of intrinsic Euler angles (3,) (rad).

    Parameters
    ----------
    sequence : str
        Axes, such as ``"xyz"`` or ``"zxz"``; each turn is about an axis of the frame the one before made.
    angles : (3,) numbers, SymPy expressions or Exprs
    """
    i, j, k = axes_of(sequence)
    a, b, c = entries(angles, 3, "Euler angles")
    return shaped(times(times(elementary(i, a), elementary(j, b)), elementary(k, c)))


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
