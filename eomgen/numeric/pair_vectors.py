"""Stage numeric: poses and vectors of many shapes at once -> parts, products; axes behind the first two are states."""

from __future__ import annotations

from typing import Any

import numpy as np


def dot(a: np.ndarray, b: np.ndarray) -> Any:
    """Products of vectors (n, 3, ...)."""
    return (a * b).sum(axis=1)


def parts(poses: np.ndarray) -> tuple[Any, Any, Any, Any]:
    """Position, rotation, velocity and angular velocity of poses (n, POSE, ...)."""
    rotation = poses[:, 3:12].reshape(len(poses), 3, 3, *poses.shape[2:])
    return poses[:, 0:3], rotation, poses[:, 12:15], poses[:, 15:18]


def times(m: Any, a: Any) -> Any:
    """Matrices (n, 3, 3, ...) times vectors (n, 3, ...)."""
    return m[:, :, 0] * a[:, None, 0] + m[:, :, 1] * a[:, None, 1] + m[:, :, 2] * a[:, None, 2]


def product(m: Any, n: Any) -> Any:
    """Products of matrices (n, 3, 3, ...)."""
    return m[:, :, 0, None] * n[:, None, 0] + m[:, :, 1, None] * n[:, None, 1] + m[:, :, 2, None] * n[:, None, 2]


def flat(m: np.ndarray) -> np.ndarray:
    """Matrices (n, 3, 3, ...) as rows of nine numbers."""
    return m.reshape(len(m), 9, *m.shape[3:])


def cross(a: Any, b: Any) -> np.ndarray:
    """Cross products of vectors whose first axis is x, y, z."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def across(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of vectors (n, 3, ...)."""
    return cross(a.swapaxes(0, 1), b.swapaxes(0, 1)).swapaxes(0, 1)
