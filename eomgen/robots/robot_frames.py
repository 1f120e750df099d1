"""Robots, placements in numbers; sums of rigid inertias."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.algebra import Numbers, from_roll_pitch_yaw, roll_pitch_yaw
from ..records import dataclass


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
    return Placement(from_roll_pitch_yaw(rpy, snap), np.array(position, dtype=float))


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
