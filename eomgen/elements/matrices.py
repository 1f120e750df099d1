"""Rotation matrices of numbers, in which zeros and ones are exact: from angles, axes, quaternions."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..base.algebra import Array
from ..base.limits.numbers import QUARTER
from .scalars import about as turned
from .scalars import cosine_and_sine

Numbers = Sequence[float]


def from_roll_pitch_yaw(rpy: Numbers, snap: float = 0.0) -> Array:
    """R (3, 3) turned about fixed axes by roll, pitch and yaw (rad); angles as for :func:`~.scalars.quarter_turns`."""
    about_axes = [np.array(turned(axis, *cosine_and_sine(angle, snap)), dtype=float) for axis, angle in enumerate(rpy)]
    return np.asarray(about_axes[2] @ about_axes[1] @ about_axes[0])


def roll_pitch_yaw(R: Array) -> Array:
    """Fixed-axis angles (3,) of a rotation matrix, good to rounding at any pitch.

    The yaw is read first and the roll from what it leaves, so that an uncertain yaw near pitch = +-pi/2 does no harm
    (the order of Eigen's Euler angles).
    """
    across = math.hypot(R[0, 0], R[1, 0])
    pitch = math.atan2(-R[2, 0], across)
    yaw = math.atan2(R[1, 0], R[0, 0]) if across > 0 else 0.0
    c, s = cosine_and_sine(yaw)
    roll = math.atan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return np.array([roll, pitch, yaw])


def from_quaternion(w: float, x: float, y: float, z: float) -> Array:
    """R (3, 3) of a quaternion of any length, scalar part first."""
    size = w * w + x * x + y * y + z * z
    s = 2.0 / size
    matrix = np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
            [s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)],
            [s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)],
        ]
    )
    nearest = np.round(matrix)
    return nearest if np.abs(matrix - nearest).max() < QUARTER else matrix


def about(axis: Numbers, angle: float) -> Array:
    """R (3, 3) of an angle about a unit axis (Rodrigues' formula)."""
    if angle == 0.0:
        return np.eye(3)
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    c, s = cosine_and_sine(angle)
    return np.asarray(np.eye(3) + s * K + (1 - c) * (K @ K))
