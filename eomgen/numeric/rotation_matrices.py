"""Stage numeric: roll, pitch and yaw, quaternions, axes with angles -> rotation matrices, zeros and ones exact."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..base.limits.numbers import QUARTER
from .scales import Array

Numbers = Sequence[float]


def quarter_turns(angle: float, snap: float = 0.0) -> tuple[float, float] | None:
    """Exact cosine and sine of an angle (rad) within ``snap``, or rounding, of a multiple of pi/2; None of others."""
    quarter = round(angle / (math.pi / 2))
    if abs(angle - quarter * (math.pi / 2)) <= max(snap, QUARTER * max(1, abs(quarter))):
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarter % 4]
    return None


def cosine_and_sine(angle: float, snap: float = 0.0) -> tuple[float, float]:
    """cos and sin, exact 0 and +-1 within ``snap`` of a multiple of pi/2."""
    return quarter_turns(angle, snap) or (math.cos(angle), math.sin(angle))


def from_roll_pitch_yaw(rpy: Numbers, snap: float = 0.0) -> Array:
    """R (3, 3) turned about fixed axes by roll, pitch and yaw (rad); angles as for :func:`quarter_turns`."""
    (cr, sr), (cp, sp), (cy, sy) = (cosine_and_sine(angle, snap) for angle in rpy)
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


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
