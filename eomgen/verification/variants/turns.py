"""Stage verification, turns: rotation matrices, roll-pitch-yaw and Euler parameters in numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np


def random_turn(random: Any) -> Any:
    """A turn of any angle about any axis."""
    quaternion = random.normal(size=4)
    return matrix_of(quaternion / np.linalg.norm(quaternion))


def matrix_of(e: Any) -> Any:
    """The rotation of Euler parameters, e0 first."""
    a, b, c, d = e
    return np.array(
        [
            [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
            [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
            [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
        ]
    )


def rpy_of(turn: Any) -> list[float]:
    """Roll, pitch, yaw of a rotation."""
    pitch = np.arctan2(-turn[2, 0], np.hypot(turn[0, 0], turn[1, 0]))
    if np.hypot(turn[0, 0], turn[1, 0]) < 1e-9:  # only the difference of roll and yaw is known: yaw is 0
        return [float(np.arctan2(-turn[1, 2], turn[1, 1])), float(pitch), 0.0]
    return [float(np.arctan2(turn[2, 1], turn[2, 2])), float(pitch), float(np.arctan2(turn[1, 0], turn[0, 0]))]


def turn_of(rpy: Sequence[float]) -> Any:
    """The rotation of roll, pitch, yaw, right angles exact."""
    (cr, sr), (cp, sp), (cy, sy) = (_circle(angle) for angle in rpy)
    x, y, z = ([[1, 0, 0], [0, cr, -sr], [0, sr, cr]], [[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]],
               [[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])  # fmt: skip
    return np.array(z, dtype=float) @ np.array(y, dtype=float) @ np.array(x, dtype=float)


def _circle(angle: float) -> tuple[float, float]:
    quarter = round(angle / (np.pi / 2))
    if abs(angle - quarter * np.pi / 2) <= 1e-15 * max(1, abs(quarter)):
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarter % 4]
    return float(np.cos(angle)), float(np.sin(angle))
