"""Joints: the elementary loop-closure conditions that joint types are made of (Shabana, ch. 7: basic constraints)."""

from __future__ import annotations

from ..graph.vectors import Mat3, Vec3
from ..rotations.euler import AXES
from .joint import Closure


def along(position: Vec3, letters: str) -> list[Closure]:
    """The components of S's origin along these axes of P vanish."""
    return [Closure(f"r_{letter}", position[AXES[letter]], "length") for letter in letters]


def parallel_axes(rotation: Mat3) -> list[Closure]:
    """The z axes are parallel: z_S . x_P = z_S . y_P = 0."""
    return [
        Closure("z.x", rotation[0][2], "angle"),
        Closure("z.y", rotation[1][2], "angle"),
    ]


def same_orientation(rotation: Mat3) -> list[Closure]:
    """All axes are parallel: z_S . x_P = z_S . y_P = x_S . y_P = 0."""
    return [*parallel_axes(rotation), Closure("x.y", rotation[1][0], "angle")]
