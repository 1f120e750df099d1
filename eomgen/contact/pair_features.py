"""Two polygons, or an outline and a point, in the plane -> the edges, corners and pieces that matter to their contact.

The law of a pair reads the few numbers of these (:mod:`~eomgen.contact.polygons` says why those of edges), so that its
text is the same for any number of corners or pieces.  They are found here by loops, and in C by those of
``native/eomgen_pairs.h``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from .pair_sums import POSE

EDGE = 5  #: numbers of an edge of a polygon: its first corner, its outward normal, its length
#: Numbers of an edge that matters: both corners, its normal, those of the edge before and of the next.
FACING = 10
#: Numbers of the first polygon that the law reads: the edge that faces the other, the corner of the least overlap, that
#: of the next, corner and normal of the edge of the next, whether an edge of the second has the least, and the next.
FIRST = FACING + 10
#: The same of the second, without the last two, and how far its corners are from its marker.
OTHER = FACING + 9

#: Numbers of a piece: its origin and the direction of its x axis, half of its chord, its curvature.
PIECE = 6
#: Numbers that the law reads: those of a piece, whether its first corner is nearest, whether its law counts.
CHOSEN = PIECE + 2

Law = Callable[[Sequence[Any]], Sequence[Any]]


# -- edges and corners of polygons -------------------------------------------------------------------------------------


class _Choice(NamedTuple):
    """Numbers of edges and corners, each an array of pairs."""

    edges: tuple[Any, Any]
    corners: tuple[Any, Any]
    next_edges: tuple[Any, Any]
    next_corners: tuple[Any, Any]
    of_second: Any
    next_of_second: Any


def facing(law: Law, corners: tuple[int, int], rates: bool = False) -> Law:
    """The law of a pair of polygons with so many corners, from that of the numbers that matter.

    Parameters
    ----------
    law : callable
        Of the numbers of the first shape, of the second, and all else.
    corners : tuple of two int
    rates : bool, optional
        Whether the rates of all these numbers follow them.
    """
    middle = POSE + EDGE * corners[0]
    end = middle + POSE + EDGE * corners[1]

    def chosen(numbers: Sequence[Any]) -> Sequence[Any]:
        half = len(numbers) // 2 if rates else len(numbers)
        result: list[Any] = []
        choice: _Choice | None = None
        for start in range(0, len(numbers), half):
            raw = numbers[start : start + half]
            first, second = _array(raw[:middle]), _array(raw[middle:end])
            choice = choice or _choose_edges(first, second, corners)
            result += [*_kept(first, choice, 0, start > 0), *_kept(second, choice, 1, start > 0), *raw[end:]]
        return law(result)

    return chosen


def _array(columns: Sequence[Any]) -> np.ndarray:
    """Numbers of a shape (n, ...)."""
    return np.stack(np.broadcast_arrays(*columns))


def _points(shape: np.ndarray, at: int) -> np.ndarray:
    """Corners (at = 0) or normals (2) of a polygon (n, 2, ...)."""
    sizes = shape[POSE:].reshape(-1, EDGE, *shape.shape[1:])
    return np.asarray(sizes[:, at : at + 2], dtype=float)


def _overlaps(normals: np.ndarray, starts: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For each edge how deep the deepest of some corners is below it, and which that is."""
    reach = starts[:, None] - corners[None]
    depths = normals[:, None, 0] * reach[:, :, 0] + normals[:, None, 1] * reach[:, :, 1]
    return depths.max(axis=1), depths.argmax(axis=1)


def _choose_edges(first: np.ndarray, second: np.ndarray, corners: tuple[int, int]) -> _Choice:
    """Which edges face each other, and which corners are deepest."""
    a, b = np.asarray(first[:POSE], dtype=float), np.asarray(second[:POSE], dtype=float)
    R, S = a[3:12].reshape(3, 3, *a.shape[1:]), b[3:12].reshape(3, 3, *b.shape[1:])
    reach = b[0:3] - a[0:3]
    x, y = ((R[:, i] * reach).sum(axis=0) for i in range(2))
    (xx, xy), (yx, yy) = ([(R[:, i] * S[:, k]).sum(axis=0) for k in range(2)] for i in range(2))
    points, axes = _points(first, 0), _points(first, 2)
    px, py = _points(second, 0).swapaxes(0, 1)
    nx, ny = _points(second, 2).swapaxes(0, 1)
    others = np.stack([x + xx * px + xy * py, y + yx * px + yy * py], axis=1)
    normals = np.stack([yy * nx - yx * ny, xx * ny - xy * nx], axis=1)
    (depths_a, deepest_b), (depths_b, deepest_a) = (
        _overlaps(axes, points, others),
        _overlaps(normals, others, points),
    )
    least_a, least_b = depths_a.argmin(axis=0), depths_b.argmin(axis=0)
    of_second = _at(depths_b, least_b) < _at(depths_a, least_a)
    facing_a = (axes * _at(normals, least_b)[None]).sum(axis=1).argmin(axis=0)
    facing_b = (normals * _at(axes, least_a)[None]).sum(axis=1).argmin(axis=0)
    edge_a, edge_b = np.where(of_second, facing_a, least_a), np.where(of_second, least_b, facing_b)
    rest_a, rest_b = (
        np.where(np.arange(n).reshape(-1, *([1] * edge.ndim)) == edge, np.inf, depths)
        for n, edge, depths in zip(corners, (edge_a, edge_b), (depths_a, depths_b), strict=True)
    )
    next_a, next_b = rest_a.argmin(axis=0), rest_b.argmin(axis=0)
    return _Choice(
        (edge_a, edge_b),
        (_at(deepest_a, least_b), _at(deepest_b, least_a)),
        (next_a, next_b),
        (_at(deepest_a, next_b), _at(deepest_b, next_a)),
        of_second,
        _at(rest_b, next_b) < _at(rest_a, next_a),
    )


def _at(values: np.ndarray, number: np.ndarray) -> np.ndarray:
    """Entries of the first axis by a number for each pair, whose axes are the last."""
    index = number.reshape(1, *([1] * (values.ndim - 1 - number.ndim)), *number.shape)
    return np.asarray(np.take_along_axis(values, np.broadcast_to(index, (1, *values.shape[1:])), axis=0)[0])


def _kept(shape: np.ndarray, choice: _Choice, which: int, rates: bool) -> list[Any]:
    """The pose of a polygon and the numbers that matter, or the rates of these."""
    sizes = shape[POSE:].reshape(-1, EDGE, *shape.shape[1:])
    count = len(sizes)

    def of(number: np.ndarray, at: int) -> list[Any]:
        return list(_at(sizes[:, at : at + 2], number))

    edge, next_edge = choice.edges[which], choice.next_edges[which]
    result = [*of(edge, 0), *of((edge + 1) % count, 0), *of(edge, 2), *of((edge - 1) % count, 2)]
    result += [*of((edge + 1) % count, 2), *of(choice.corners[which], 0), *of(choice.next_corners[which], 0)]
    result += [*of(next_edge, 0), *of(next_edge, 2)]
    if which == 0:
        flags = (choice.of_second, choice.next_of_second)
        result += [np.zeros(x.shape) if rates else np.where(x, 1.0, 0.0) for x in flags]
    else:
        reach = sizes[:, 0] * sizes[:, 0] + sizes[:, 1] * sizes[:, 1]
        result.append(np.zeros(edge.shape) if rates else np.sqrt(np.asarray(reach, dtype=float).max(axis=0)))
    return [*shape[:POSE], *result]


# -- pieces of outlines ------------------------------------------------------------------------------------------------


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
        result: list[Any] = []
        choice: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        for start in range(0, len(numbers), half):
            raw = numbers[start : start + half]
            shape = np.stack(np.broadcast_arrays(*raw[:end], raw[end])[:-1])
            choice = choice or _nearest_piece(np.asarray(shape, dtype=float), raw[end : end + 3], count)
            piece, *flags = choice
            kept = _at(shape[POSE:-1].reshape(count, PIECE, *shape.shape[1:]), piece)
            result += [*shape[:POSE], *kept, *(np.where(flag, float(not start), 0.0) for flag in flags), *raw[end:]]
        return law(result)

    chosen.inner = True  # type: ignore[attr-defined]
    return chosen


def _nearest_piece(shape: np.ndarray, place: Sequence[Any], count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
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
