"""A closed outline and a point in the plane -> the piece that holds the nearest point of the outline.

The law of what is deep inside an outline reads the numbers of this piece alone, so that its text is the same for any
number of pieces.  It is found here by loops, and in C by those of ``templates/c/pairs_shapes.c.j2``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .pair_sums import POSE

#: Numbers of a piece: its origin and the direction of its x axis, half of its chord, its curvature.
PIECE = 6
#: Numbers that the law reads: those of a piece, whether its first corner is nearest, whether its law counts.
CHOSEN = PIECE + 2

Law = Callable[[Sequence[Any]], Sequence[Any]]


def nearest(law: Law, count: int, rates: bool = False) -> Law:
    """The law of an outline of so many pieces with another shape, from that of the numbers of its nearest piece.

    It counts where the centre of the other shape is deeper inside than the last size of the outline.  So what is apart
    does not meet there first: the function is marked as ``inner`` for those who look for that.

    Parameters
    ----------
    law : callable
        Of the numbers of the piece, of the second shape, and all else.
    count : int
    rates : bool, optional
        Whether the rates of all these numbers follow them.
    """
    end = POSE + PIECE * count + 1

    def chosen(numbers: Sequence[Any]) -> Sequence[Any]:
        half = len(numbers) // 2 if rates else len(numbers)
        found: list[Any] = []
        choice: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        for start in range(0, len(numbers), half):
            given = numbers[start : start + half]
            shape = np.stack(np.broadcast_arrays(*given[:end], given[end])[:-1])
            choice = choice or _choose(np.asarray(shape, dtype=float), given[end : end + 3], count)
            piece, *flags = choice
            pieces = shape[POSE:-1].reshape(count, PIECE, *shape.shape[1:])
            index = piece.reshape(1, 1, *piece.shape)
            kept = np.take_along_axis(pieces, np.broadcast_to(index, (1, *pieces.shape[1:])), axis=0)[0]
            found += [*shape[:POSE], *kept, *(np.where(flag, float(not start), 0.0) for flag in flags), *given[end:]]
        return law(found)

    chosen.inner = True  # type: ignore[attr-defined]
    return chosen


def _choose(shape: np.ndarray, place: Sequence[Any], count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The piece that is nearest to a point, whether its first corner is, and whether the point is deep inside."""
    R = shape[3:12].reshape(3, 3, *shape.shape[1:])
    reach = np.stack(np.broadcast_arrays(*(np.asarray(x, dtype=float) for x in place), shape[0])[:3]) - shape[:3]
    x, y = ((R[:, i] * reach).sum(axis=0) for i in range(2))
    px, py, c, s, half, bend = shape[POSE:-1].reshape(count, PIECE, *shape.shape[1:]).swapaxes(0, 1)
    sine = bend * half
    cosine = np.sqrt(np.maximum(0.0, 1.0 - sine * sine))
    rise = half * sine / (1.0 + cosine)
    u, v = c * (x - px) + s * (y - py), c * (y - py) - s * (x - px)
    over = (v - rise) * sine
    beside = np.minimum((half + u) * cosine, (half - u) * cosine) - over
    gap = (2.0 * v - bend * (u * u + v * v)) / (1.0 + np.hypot(bend * u, 1.0 - bend * v))
    feet = np.where(beside >= 0.0, np.abs(gap), np.inf)
    wx, wy = c * (u + half) - s * (v - rise), s * (u + half) + c * (v - rise)  # from the first corner
    corners = np.hypot(wx, wy)
    nx, ny = c * sine - s * cosine, s * sine + c * cosine  # normals at both ends
    mx, my = -c * sine - s * cosine, c * cosine - s * sine
    side = wx * (nx + np.roll(mx, 1, axis=0)) + wy * (ny + np.roll(my, 1, axis=0))
    foot, corner = feet.argmin(axis=0), corners.argmin(axis=0)
    at_corner = _at(corners, corner) < _at(feet, foot)
    outside = np.where(at_corner, _at(side, corner), _at(gap, foot))
    distance = np.minimum(_at(corners, corner), _at(feet, foot))
    return np.where(at_corner, corner, foot), at_corner, (outside < 0.0) & (distance > shape[-1])


def _at(values: np.ndarray, number: np.ndarray) -> np.ndarray:
    """Entries of the first axis by a number for each pair."""
    return np.asarray(np.take_along_axis(values, number[None], axis=0)[0])
