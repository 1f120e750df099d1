"""Stage show, solids: kinds and sizes -> vertices (n, 3) and triangles (m, 3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.pictures import SAME

Triangles = NDArray[np.int64]
Mesh = tuple[Array, Triangles]

AROUND = 20  #: corners of a circle
ROUND = 48  #: those of the circles of a body's own shapes, which may be as large as the picture

LATITUDES = np.linspace(-np.pi / 2, np.pi / 2, 11)[1:-1]  #: of the circles of a ball (rad)


def box(size: Sequence[float]) -> Mesh:
    """A box about its centre, of edges (3,)."""
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return 0.5 * signs * np.asarray(size, dtype=float), np.array(faces)


def turned(radii: Sequence[float], heights: Sequence[float], around: int = AROUND) -> Mesh:
    """A solid of revolution about z: circles of radii at heights, from below to above, closed at both ends."""
    angles = 2.0 * np.pi * np.arange(around) / around
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    return closed([(r * circle, z) for r, z in zip(radii, heights, strict=True)])


def closed(rings: Sequence[tuple[Array, float]]) -> Mesh:
    """A solid of rings of as many points (n, 2) each and their heights, from below to above, closed at both ends."""
    around = len(rings[0][0])
    layers = [np.column_stack([ring, np.full(around, z)]) for ring, z in rings]
    ends = np.array([layers[0].mean(axis=0), layers[-1].mean(axis=0)])
    vertices = np.vstack([*layers, ends])
    low, high = len(vertices) - 2, len(vertices) - 1
    faces = []
    for i in range(around):
        j = (i + 1) % around
        faces.append((low, j, i))
        for k in range(len(rings) - 1):
            a, b, c, d = k * around + i, k * around + j, (k + 1) * around + i, (k + 1) * around + j
            faces += [(a, b, d), (a, d, c)]
        top = (len(rings) - 1) * around
        faces.append((high, top + i, top + j))
    return vertices, np.array(faces)


def cylinder(radius: float, length: float, around: int = AROUND) -> Mesh:
    """A cylinder about z and its middle."""
    return turned((radius, radius), (-length / 2, length / 2), around)


def sphere(radius: float) -> Mesh:
    """A sphere about its centre."""
    return turned(list(radius * np.cos(LATITUDES)), list(radius * np.sin(LATITUDES)))


def capsule(radius: float, length: float) -> Mesh:
    """A cylinder about z with half spheres at its ends; ``length`` is that of the cylinder."""
    way = np.linspace(0.0, np.pi / 2, 6)[:-1]
    upper = [(radius * np.cos(a), length / 2 + radius * np.sin(a)) for a in way]
    rings = [(r, -z) for r, z in reversed(upper)] + upper
    return turned([r for r, _ in rings], [z for _, z in rings])


def cone(radius: float, length: float) -> Mesh:
    """A cone about z; its base at the origin."""
    return turned((radius, 0.0), (0.0, length))


def solid(kind: str, sizes: Sequence[float], thin: float, around: int = AROUND) -> Mesh | None:
    """The mesh of a shape by its kind; None where there is none.

    ``thin`` (m) is the radius of what has none, ``around`` the number of corners of a cylinder's circles.
    """
    if kind == "box":
        return box(sizes)
    if kind in ("cylinder", "tube"):
        return cylinder(sizes[0], sizes[1], around)
    if kind == "sphere":
        return sphere(sizes[0])
    if kind == "capsule":
        return capsule(sizes[0], sizes[1])
    if kind == "cone":
        return cone(sizes[0], sizes[1])
    if kind == "rod":
        return cylinder(thin, sizes[0])
    if kind == "ellipsoid":
        vertices, faces = sphere(1.0)
        return vertices * np.asarray(sizes), faces
    return None


def hull(points: Array) -> Mesh | None:
    """The convex hull of points (n, 3); None where they lie in a plane."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        found = ConvexHull(points)
    except QhullError:
        return None
    used = np.unique(found.simplices)
    place = np.zeros(len(points), dtype=np.int64)
    place[used] = np.arange(len(used))
    faces = place[found.simplices]
    vertices = points[used]
    normals = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    inward = (normals * found.equations[:, :3]).sum(axis=1) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return vertices, faces


def rounded(points: Array, radius: float) -> Mesh | None:
    """The hull of balls about points (n, 3): a bar between two, a plate with round corners over three."""
    middle = points.mean(axis=0)
    _, sizes, axes = algebra.svd(points - middle)
    if len(sizes) == 3 and sizes[2] > SAME * sizes[0]:
        ball = sphere(radius)[0]
        return hull((points[:, None] + ball[None]).reshape(-1, 3))
    axes[2] = np.cross(axes[0], axes[1])
    vertices, faces = plate(outline((points - middle) @ axes[:2].T), radius)
    return vertices @ axes + middle, faces


def plate(corners: Array, radius: float) -> Mesh:
    """The hull of balls about the corners (n, 2) of a convex polygon in the plane z = 0, in order."""
    edges = np.roll(corners, -1, axis=0) - corners
    normals = np.arctan2(-edges[:, 0], edges[:, 1])
    rims, ways = [], []
    for corner, before, turn in zip(corners, np.roll(normals, 1), normals - np.roll(normals, 1), strict=True):
        turn %= 2.0 * np.pi
        angles = before + np.linspace(0.0, turn, 2 + int(AROUND * turn / (2.0 * np.pi)))
        ways.append(np.column_stack([np.cos(angles), np.sin(angles)]))
        rims.append(np.tile(corner, (len(angles), 1)))
    rim, way = np.vstack(rims), np.vstack(ways)
    return closed([(rim + radius * np.cos(a) * way, radius * np.sin(a)) for a in LATITUDES])


def outline(points: Array) -> Array:
    """Corners (m, 2) of the convex hull of points (n, 2), in order (Andrew's monotone chain)."""
    order = np.unique(points.round(12), axis=0)
    if len(order) < 3:
        return order

    def chain(several: Array) -> list[Array]:
        found: list[Array] = []
        for p in several:
            while len(found) > 1 and _turn(found[-2], found[-1], p) <= 0.0:
                found.pop()
            found.append(p)
        return found[:-1]

    return np.array(chain(order) + chain(order[::-1]))


def _turn(a: Array, b: Array, c: Array) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
