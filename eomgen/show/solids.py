"""Kinds, sizes and files of meshes -> vertices (n, 3) and triangles (m, 3)."""

from __future__ import annotations

import io
import os
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base import algebra
from ..base.algebra import Array
from ..base.files import as_name, beside, open_plain
from ..base.limits.numbers import MESH
from ..base.texts import quote, visible
from ..errors import UsageError, bad_data, bad_file, too_large
from .limits import NOTHING, SAME

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
        result = ConvexHull(points)
    except QhullError:
        return None
    used = np.unique(result.simplices)
    place = np.zeros(len(points), dtype=np.int64)
    place[used] = np.arange(len(used))
    faces = place[result.simplices]
    vertices = points[used]
    normals = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    inward = (normals * result.equations[:, :3]).sum(axis=1) < 0.0
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
        result: list[Array] = []
        for p in several:
            while len(result) > 1 and _turn(result[-2], result[-1], p) <= 0.0:
                result.pop()
            result.append(p)
        return result[:-1]

    return np.array(chain(order) + chain(order[::-1]))


def _turn(a: Array, b: Array, c: Array) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


# -- files of meshes ---------------------------------------------------------------------------------------------------


TRIANGLES = 4000  #: of one mesh in a picture, at most; matplotlib draws them one by one
CELLS = (160, 120, 80, 56, 40, 28, 20, 14, 10)  #: along the longest edge, within which vertices are joined
PACKAGE = "package://"
_UNIT = re.compile(rb"<unit\b[^>]*\bmeter\s*=\s*[\"']([-+0-9.eE]+)")
_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)")


def mesh_of(shape: Mapping[str, Any], body: str, model_file: str | None, quiet: bool = False) -> Mesh | None:
    """The mesh of a shape in metres, axes of its frame; None, with a warning unless ``quiet``, if it cannot be drawn.

    Parameters
    ----------
    shape : mapping
        With ``file`` and ``sizes``, the scale along each axis.
    body : str
    model_file : str or None
        A mesh lies in the folder of this file or below; empty for a model that was built in Python, None if not known.
    """
    try:
        vertices, faces = read_mesh(_located(as_name("file", shape["file"]), model_file))
    except (UsageError, OSError) as error:
        why = visible(str(error.strerror if isinstance(error, OSError) else error), lines=False)
        if not quiet:
            warnings.warn(f"the mesh {quote(shape['file'])} of {body} is not drawn: {why}", stacklevel=2)
        return None
    scale = np.asarray(shape["sizes"], dtype=float)
    return vertices * scale, faces if scale.prod() > 0.0 else faces[:, ::-1]


def _located(file: str, model_file: str | None) -> str:
    if model_file is None:
        raise bad_file("the module was not made from a model here, so the folder of the file is not known")
    if file.startswith(PACKAGE):  # of a robot: the folder of the package is that of its file
        file = file.removeprefix(PACKAGE).partition("/")[2]
    return beside(model_file, file) if model_file else file


def read_mesh(path: str) -> Mesh:
    """Vertices (n, 3) and triangles (m, 3) of a file, in its units and axes (DAE in metres), thinned out to TRIANGLES.

    Raises
    ------
    UsageError
        Another kind of file, too large, or one that cannot be read as its ending says.
    OSError
        There is no such file.
    """
    ending = os.path.splitext(path)[1].lower()
    if ending not in READERS:
        raise bad_file(f"{ending or 'no ending'}: STL, OBJ and DAE files can be drawn")
    status = os.stat(path)
    if status.st_size > MESH:
        raise too_large(f"it has {status.st_size:,} bytes; at most {MESH:,}")
    return _read(os.path.abspath(path), ending, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=64)
def _read(path: str, ending: str, _changed: int, _size: int) -> Mesh:
    with open_plain(path) as file:
        data = file.read(MESH + 1)
    try:
        vertices, faces = READERS[ending](data)
    except UsageError:
        raise
    except (ValueError, IndexError, OverflowError):
        raise bad_file(f"it cannot be read as a file {ending}") from None
    if not len(faces) or not np.isfinite(vertices).all():
        raise bad_data("it holds no triangles, or vertices that are not finite")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise bad_data("its triangles name vertices that it does not have")
    return thinned(vertices, faces)


def _read_stl(data: bytes) -> Mesh:
    """Binary: 80 bytes, the number of triangles, 50 bytes for each; else as text."""
    count = int(np.frombuffer(data[80:84], "<u4")[0]) if len(data) >= 84 else 0
    if count and len(data) == 84 + 50 * count:
        row = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
        corners = np.frombuffer(data, row, count, 84)["corners"].astype(float).reshape(-1, 3)
    else:
        corners = np.array([[float(x) for x in result] for result in _VERTEX.findall(data)]).reshape(-1, 3)
    return corners, np.arange(len(corners) // 3 * 3).reshape(-1, 3)


def _read_obj(data: bytes) -> Mesh:
    """Lines ``v x y z`` and ``f a b c ...``, whose vertices count from 1, or from the last one backwards."""
    vertices: list[list[float]] = []
    faces: list[tuple[int, int, int]] = []
    for line in data.splitlines():
        word, *rest = line.split() or [b""]
        if word == b"v":
            vertices.append([float(x) for x in rest[:3]])
        elif word == b"f":
            raw = [int(one.partition(b"/")[0]) for one in rest]
            corners = [k - 1 if k > 0 else len(vertices) + k for k in raw]
            faces += [(corners[0], b, c) for b, c in pairwise(corners[1:])]
    return np.array(vertices).reshape(-1, 3), np.array(faces, dtype=np.int64).reshape(-1, 3)


def _read_dae(data: bytes) -> Mesh:
    """All geometry of a COLLADA scene, in metres; its ``up_axis`` is left as it is, as robots' viewers do."""
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise UsageError("it declares a document type or an entity, which is never expanded", code="EG-REFUSED")
    try:
        import collada  # noqa: F401  # by which trimesh reads them
        import trimesh
    except ImportError:
        raise UsageError(
            "files .dae need trimesh and pycollada: pip install 'eomgen[mesh]'", code="EG-PACKAGE-MISSING"
        ) from None
    try:
        mesh: Any = trimesh.load(io.BytesIO(data), file_type="dae", force="mesh")
    except Exception as error:  # pycollada raises errors of many kinds
        raise ValueError(str(error)) from None
    unit = _UNIT.search(data)
    vertices = np.asarray(mesh.vertices, dtype=float) * (float(unit[1]) if unit else 1.0)
    return vertices, np.asarray(mesh.faces, dtype=np.int64)


def thinned(vertices: Array, faces: Triangles) -> Mesh:
    """The same surface with at most TRIANGLES where the coarsest cells give so few; vertices of one cell are joined."""
    vertices, faces = _joined(vertices, faces, vertices)
    low, size = vertices.min(axis=0), max(float(np.ptp(vertices, axis=0).max()), NOTHING)
    made = vertices, faces
    for cells in CELLS:
        if len(made[1]) <= TRIANGLES:
            break
        made = _joined(vertices, faces, np.round((vertices - low) / size * cells))
    return made


def _joined(vertices: Array, faces: Triangles, keys: Array) -> Mesh:
    """Vertices of one key become their mean; triangles that have lost a corner, or are there twice, go."""
    _, place, counts = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    place = place.reshape(-1)
    means = np.zeros((len(counts), 3))
    np.add.at(means, place, vertices)
    corners = place[faces]
    whole = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    _, first = np.unique(np.sort(corners[whole], axis=1), axis=0, return_index=True)
    return means / counts[:, None], corners[whole][np.sort(first)]


READERS: dict[str, Callable[[bytes], Mesh]] = {".stl": _read_stl, ".obj": _read_obj, ".dae": _read_dae}
