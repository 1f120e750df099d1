"""Stage show, hollow plates: closed lines of contact shapes that turn both ways -> plates of that outline."""

from __future__ import annotations

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.pictures import SAME
from ..base.picture_data import PictureData
from .solids import Mesh

CORNERS = 4  #: fewest of an outline that turns both ways


def hollow_lines(data: PictureData, body: int) -> list[Array]:
    """Closed lines (n, 3) in a plane of a body, in its axes, which are not those around their convex hull."""
    found = []
    for element in data.elements:
        stops = [stop for stop, _, _ in element.get("stops", ())]
        if element["kind"] != "lines" or len(stops) <= CORNERS or any(stop.body != body for stop in stops):
            continue
        points = np.array([stop.position for stop in stops])
        near = SAME * max(float(np.ptp(points, axis=0).max()), SAME)
        if np.abs(points[0] - points[-1]).max() > near:
            continue
        points = points[np.abs(points - np.roll(points, 1, axis=0)).max(axis=1) > near]
        flat = _in_plane(points) if len(points) >= CORNERS else None
        if flat is not None and (_turns(flat[0]) < -near * near).any():
            found.append(points)
    return found


def hollow_plate(points: Array, half: float) -> Mesh:
    """A plate within a closed line in a plane, of which ``half`` of the thickness lies on each side."""
    flat = _in_plane(points)
    assert flat is not None
    corners, axes, middle = flat
    n, cap = len(corners), _triangles(corners)
    ring = np.arange(n)
    after = np.roll(ring, -1)
    sides = np.vstack([np.column_stack([ring, after, ring + n]), np.column_stack([after, after + n, ring + n])])
    vertices = np.vstack([np.column_stack([corners, np.full(n, height)]) for height in (-half, half)])
    return vertices @ axes + middle, np.vstack([cap[:, ::-1], cap + n, sides])


def _in_plane(points: Array) -> tuple[Array, Array, Array] | None:
    """Counterclockwise corners (n, 2) in axes of the plane, the axes as rows and their origin; None out of a plane."""
    middle = points.mean(axis=0)
    _, sizes, axes = algebra.svd(points - middle)
    if sizes[2] > SAME * sizes[0]:
        return None
    axes[2] = np.cross(axes[0], axes[1])
    corners = (points - middle) @ axes[:2].T
    x, y = corners.T
    if float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) < 0.0:
        axes[1:] *= -1.0
        corners[:, 1] *= -1.0
    return corners, axes, middle


def _turns(corners: Array) -> Array:
    """Cross products of the edges before and after each corner."""
    before, after = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    turns: Array = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return turns


def _triangles(corners: Array) -> np.ndarray:
    """Triangles (n - 2, 3) that fill a counterclockwise outline, cut off one by one (Meisters, 1975)."""
    left, found = list(range(len(corners))), list[tuple[int, int, int]]()
    k = tried = 0
    while len(left) > 3:
        a, b, c = (left[(k + step) % len(left)] for step in (-1, 0, 1))
        rest = corners[[i for i in left if i not in (a, b, c)]]
        turns = [_side(corners[p], corners[q], rest) for p, q in ((a, b), (b, c), (c, a))]
        empty = not np.all([turn >= 0.0 for turn in turns], axis=0).any()
        if tried > len(left) or (_side(corners[a], corners[b], corners[c : c + 1])[0] >= 0.0 and empty):
            found.append((a, b, c))
            left.pop(k % len(left))
            tried = 0
        else:
            tried += 1
            k += 1
        k %= len(left)
    return np.array([*found, tuple(left)])


def _side(p: Array, q: Array, points: Array) -> Array:
    """Positive where points lie to the left of the line from p to q."""
    side: Array = (q[0] - p[0]) * (points[:, 1] - p[1]) - (q[1] - p[1]) * (points[:, 0] - p[0])
    return side
