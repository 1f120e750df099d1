"""Robots, placements in numbers: rotations, roll-pitch-yaw and quaternions; sums of rigid inertias."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..limits.rounding import QUARTER
from ..records import dataclass
from ..rotations.scalars import cosine_and_sine, matrix_from_roll_pitch_yaw

Numbers = Sequence[float]


@dataclass(frozen=True)
class Placement:
    """A frame in another: ``rotation`` (3, 3) takes its axes to the other's, ``position`` (3,) is in those (m)."""

    rotation: np.ndarray
    position: np.ndarray

    def __matmul__(self, inner: Placement) -> Placement:
        """A frame in this one, seen from outside."""
        return Placement(self.rotation @ inner.rotation, self.position + self.rotation @ inner.position)

    def inverse(self) -> Placement:
        """The outer frame in this one."""
        return Placement(self.rotation.T, -(self.rotation.T @ self.position))

    @property
    def is_identity(self) -> bool:
        """Nothing is turned or moved, to the last bit."""
        return bool(np.array_equal(self.rotation, np.eye(3)) and not self.position.any())

    def reference(self, body: str) -> str | dict[str, object]:
        """This frame in a body, as a model file writes a marker."""
        placed = self.placed()
        return {"body": body, **placed} if placed else body

    def placed(self) -> dict[str, object]:
        """``at`` and ``rpy``, what is zero left out."""
        result: dict[str, object] = {}
        if self.position.any():
            result["at"] = numbers(self.position)
        if not np.array_equal(self.rotation, np.eye(3)):
            result["rpy"] = numbers(roll_pitch_yaw(self.rotation))
        return result


IDENTITY = Placement(np.eye(3), np.zeros(3))


def numbers(values: np.ndarray | Numbers) -> list[float]:
    """Plain floats; minus zero becomes zero."""
    return [float(x) + 0.0 for x in values]


def moved(position: np.ndarray | Numbers) -> Placement:
    """A frame that is moved only."""
    return Placement(np.eye(3), np.array(position, dtype=float))


def placed(position: Numbers, rpy: Numbers, snap: float) -> Placement:
    """A frame at a position, turned about fixed axes by roll, pitch and yaw.

    Angles within ``snap`` (rad) of a multiple of pi/2 are taken as that multiple, whose cosine and sine are exact.
    """
    return Placement(np.array(matrix_from_roll_pitch_yaw(rpy, snap)), np.array(position, dtype=float))


def roll_pitch_yaw(R: np.ndarray) -> np.ndarray:
    """Fixed-axis angles of a rotation matrix, good to rounding at any pitch.

    The yaw is read first and the roll from what it leaves, so that an uncertain yaw near pitch = +-pi/2 does no harm
    (the order of Eigen's Euler angles).
    """
    across = math.hypot(R[0, 0], R[1, 0])
    pitch = math.atan2(-R[2, 0], across)
    yaw = math.atan2(R[1, 0], R[0, 0]) if across > 0 else 0.0
    c, s = cosine_and_sine(yaw)
    roll = math.atan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return np.array([roll, pitch, yaw])


def from_quaternion(w: float, x: float, y: float, z: float) -> np.ndarray:
    """Rotation matrix of a quaternion of any length, scalar part first."""
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


def about(axis: Numbers, angle: float) -> np.ndarray:
    """Rotation by an angle about a unit axis (Rodrigues' formula)."""
    if angle == 0.0:
        return np.eye(3)
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    c, s = cosine_and_sine(angle)
    turned: np.ndarray = np.eye(3) + s * K + (1 - c) * (K @ K)
    return turned


@dataclass(frozen=True)
class Inertia:
    """Mass (kg), centre of mass (m) and inertia about it (kg m^2) in some frame."""

    mass: float
    com: np.ndarray
    tensor: np.ndarray

    def seen(self, frame: Placement) -> Inertia:
        """The same from outside ``frame``."""
        R = frame.rotation
        if np.array_equal(R, np.eye(3)):
            return Inertia(self.mass, self.com + frame.position, self.tensor)
        tensor = R @ self.tensor @ R.T
        return Inertia(self.mass, frame.position + R @ self.com, (tensor + tensor.T) / 2)

    @property
    def is_nothing(self) -> bool:
        """Neither mass nor inertia."""
        return self.mass == 0.0 and not self.tensor.any()


NOTHING = Inertia(0.0, np.zeros(3), np.zeros((3, 3)))


def sum_inertias(parts: Sequence[Inertia]) -> Inertia:
    """Rigid bodies welded together; all in the same frame (Steiner's theorem)."""
    parts = [part for part in parts if not part.is_nothing]
    if len(parts) <= 1:
        return parts[0] if parts else NOTHING
    mass = sum(part.mass for part in parts)
    com = sum((part.mass * part.com for part in parts), np.zeros(3)) / mass if mass else parts[0].com
    tensor = np.zeros((3, 3))
    for part in parts:
        d = part.com - com
        tensor += part.tensor + part.mass * ((d @ d) * np.eye(3) - np.outer(d, d))
    return Inertia(mass, com, tensor)
