"""Stage show, pieces: solids and lines in space -> small pieces, the hindmost first, so that each covers what it hides.

This is the painter's algorithm (Newell, Newell and Sancha 1972).  A single depth stands for a piece, so large triangles
and long lines are divided first.  Faces that turn their backs to the eye are left out.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.pictures import NOTHING, SAME
from .colors import color_of, style_of
from .scene import Item, Scene, passed

LONGEST = 2.0  #: edge of a piece (sizes of a symbol), unless there would be too many
FINEST = 80.0  #: pieces along the picture, at most
MOST = 30_000  #: pieces of a picture
FEWER = 1.3  #: factor of the longest edge, until there are no more
#: Sizes of a symbol by which roles are drawn nearer, as if in front of what they lie in.
NEARER = {"shape": 1.0, "wheel": 2.0, "joint": 1.4, "force": 1.6, "pull": 1.6, "trace": 1.6, "arrow": 3.0, "frame": 3.0}
LINE = 4.5  #: and by which lines on wheels are, whose faces would hide them
SEAM = 0.8  #: width of the edges of faces, which closes the seams between them (points)
AMBIENT, DIFFUSE = 0.64, 0.40  #: light on a face: everywhere, and by the angle to the light
LIGHT = (-0.45, 0.6, 1.0)  #: to the right, upwards and towards the eye: where the light comes from


class SeenPieces(NamedTuple):
    """The pieces that are seen, the hindmost first.

    Attributes
    ----------
    corners : (n, 3, 3) array
        In ground axes (m); of a piece of a line the last two are one.
    colors : (n, 3) array
    widths : (n,) array
        Of the edges (points).
    """

    corners: Array
    colors: Array
    widths: Array


class ScenePieces:
    """Pieces of all items of a scene.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene: Scene) -> None:
        from matplotlib.colors import to_rgb

        self.scene = scene
        self._corners = [_corners_of(item) for item in scene.items]
        start = scene.frames[0]
        first = [item.at(start)[corners] for item, corners in zip(scene.items, self._corners, strict=True)]
        longest = max(LONGEST * scene.symbol, float((scene.high - scene.low).max()) / FINEST)
        most = max(MOST, sum(map(len, first)))  # meshes of many triangles are not divided
        while True:
            self._parts = [
                _divided(triangles, item.faces is None, longest)
                for item, triangles in zip(scene.items, first, strict=True)
            ]
            if sum(len(of) for of, _ in self._parts) <= most:
                break
            longest *= FEWER
        colors, widths, nearer, closed, lines = [], [], [], [], []
        for item, (of, _) in zip(scene.items, self._parts, strict=True):
            style, line, n = style_of(item.role), item.faces is None, len(of)
            color = np.array(to_rgb(color_of(item) if line else style.face or color_of(item)))
            alpha = style.alpha if item.role == "wheel" and not line else 1.0
            colors.append(np.tile(1.0 - alpha * (1.0 - color), (n, 1)))
            widths.append(np.full(n, style.width if line else SEAM))
            more = LINE if line and item.role == "wheel" else NEARER.get(item.role, 0.0)
            nearer.append(np.full(n, more * scene.symbol))
            closed.append(np.full(n, not line and item.convex))
            lines.append(np.full(n, line))
        self._colors, self._widths = np.vstack([np.empty((0, 3)), *colors]), np.concatenate([np.empty(0), *widths])
        self._nearer = np.concatenate([np.empty(0), *nearer])
        self._closed, self._lines = (np.concatenate([np.empty(0, bool), *several]) for several in (closed, lines))

    def at(self, frame: int) -> Array:
        """Corners (n, 3, 3) of all pieces in ground axes at a frame; NaN where there is nothing."""
        poses, frames = self.scene.frames[frame], len(self.scene.frames)
        found = [np.empty((0, 3, 3))]
        for item, corners, (of, parts) in zip(self.scene.items, self._corners, self._parts, strict=True):
            points = item.at(poses, frame)
            if item.role == "trace":
                points = points.copy()
                points[len(passed(points, frame, frames)) :] = np.nan
            found.append(parts @ points[corners[of]])
        return np.concatenate(found)

    def seen(self, corners: Array, eye: Array) -> SeenPieces:
        """What an eye sees of the pieces.

        Parameters
        ----------
        corners : (n, 3, 3) array
            Of :meth:`at`.
        eye : (4,) array
            Homogeneous coordinates of the eye: (place, 1), or (direction, 0) of one that is far away.
        """
        middles = corners.mean(axis=1)
        toward = eye[:3] - eye[3] * middles
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), NOTHING)
        facing = np.einsum("ij,ij->i", normals, toward)
        kept = np.isfinite(middles).all(axis=1) & (~self._closed | (facing > 0.0))
        distance = np.linalg.norm(toward, axis=1) if eye[3] else -(middles @ eye[:3])
        order = np.flatnonzero(kept)
        order = order[np.argsort(-(distance - self._nearer)[order], kind="stable")]
        normals = normals * np.where(facing < 0.0, -1.0, 1.0)[:, None]  # the back of an open sheet is lit as its front
        bright = AMBIENT + DIFFUSE * np.clip(normals @ self._light(eye), 0.0, None)
        bright = np.where(self._lines, 1.0, bright)
        colors = np.clip(self._colors * bright[:, None], 0.0, 1.0)
        return SeenPieces(corners[order], colors[order], self._widths[order])

    def _light(self, eye: Array) -> Array:
        """Unit vector towards the light, which moves with the eye."""
        toward = eye[:3] - eye[3] * 0.5 * (self.scene.low + self.scene.high)
        toward = toward / max(float(np.linalg.norm(toward)), NOTHING)
        right = np.cross(self.scene.up, toward)
        if float(np.linalg.norm(right)) < SAME:  # seen from above
            right = np.eye(3)[int(np.argmin(np.abs(toward)))]
        right = right / float(np.linalg.norm(right))
        ways = np.array([right, np.cross(toward, right), toward])
        light: Array = np.array(LIGHT) @ ways / float(np.linalg.norm(LIGHT))
        return light


def eye_of(projection: Array) -> Array:
    """The eye (4,) of a projection (4, 4), in homogeneous coordinates, on the side from which it looks.

    x, y and w of the page are zero there: it is the one point that has no place on the page.
    """
    eye: Array = algebra.svd(projection[[0, 1, 3]], full_matrices=True)[2][3]
    if abs(eye[3]) > SAME * float(np.abs(eye).max()):
        eye /= eye[3]
        return eye
    eye /= float(np.linalg.norm(eye))
    eye[3] = 0.0
    if float(projection[2] @ eye) > 0.0:  # depth grows away from the eye
        eye *= -1.0
    return eye


def _corners_of(item: Item) -> NDArray[np.int64]:
    """Indices (m, 3) of the corners of an item's triangles; of its segments, the second end twice."""
    if item.faces is not None:
        return np.asarray(item.faces)
    k = np.arange(max(len(item.points) - 1, 0))
    return np.column_stack([k, k + 1, k + 1])


def _divided(triangles: Array, line: bool, longest: float) -> tuple[NDArray[np.int64], Array]:
    """Parts of triangles (m, 3, 3) whose edges are not longer: of which one (n,), and weights of its corners (n, 3, 3).

    The longest edge is halved again and again.  Of a line, the second and the third corner stay one.
    """
    of = np.arange(len(triangles))
    parts = np.tile(np.eye(3), (len(triangles), 1, 1))
    while True:
        here = parts @ triangles[of]
        edges = np.linalg.norm(here[:, [1, 2, 0]] - here, axis=2)  # edge k goes from corner k to the next
        cut = np.flatnonzero(edges.max(axis=1, initial=0.0) > longest)
        if not len(cut):
            return of, parts
        k = edges[cut].argmax(axis=1)
        a, b, c = (parts[cut, (k + j) % 3] for j in range(3))
        middle = 0.5 * (a + b)
        one = np.stack([a, middle, middle if line else c], axis=1)
        other = np.stack([middle, b, b if line else c], axis=1)
        parts = np.concatenate([np.delete(parts, cut, axis=0), one, other])
        of = np.concatenate([np.delete(of, cut), of[cut], of[cut]])
