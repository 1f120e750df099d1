"""A Scene -> matplotlib axes, flat or in three dimensions, true to scale, with names."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations, pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base import algebra
from ..base.algebra import Array
from .limits import NOTHING, SAME, SEEN
from .scene import Item, Scene, color_of, page_axes, passed, style_of
from .solids import outline

# -- views of assembly modes -------------------------------------------------------------------------------------------


ELEVATION, AZIMUTH = 22.0, -58.0  #: of the eye (degrees), from the axis that runs to the right
ELEVATIONS = (10.0, ELEVATION, 35.0, 50.0, 65.0)  #: that are tried
AZIMUTHS = 24
SOLID = ("shape", "link", "block", "joint")  #: roles of which the points are compared
GOOD = 0.7  #: part of the best view's difference with which the usual view is kept
MOST_VIEWS = 3  #: coordinates in a title


def default_view(scene: Scene) -> tuple[float, float]:
    """Elevation and azimuth of the eye (degrees) before a spatial mechanism."""
    vertical, right = page_axes(scene.up)
    # matplotlib counts azimuths from the axis after the vertical one
    return ELEVATION, AZIMUTH if right == (vertical + 1) % 3 else 90.0 + AZIMUTH


def toward_eye(scene: Scene, elevation: float, azimuth: float) -> Array:
    """Unit vector (3,) from a mechanism to the eye, in ground axes."""
    vertical, right = page_axes(scene.up)
    e, a = np.radians([elevation, azimuth])
    toward = np.empty(3)
    toward[[(vertical + 1) % 3, (vertical + 2) % 3, vertical]] = np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)
    if scene.up[vertical] < 0.0:  # these axes are turned round
        toward[[vertical, 3 - vertical - right]] *= -1.0
    return toward


def telling_view(scenes: Sequence[Scene]) -> tuple[float, float]:
    """Elevation and azimuth from which the branches that look most alike differ most; the usual one if it is as good.

    Two branches differ by the mean distance between the same points of their drawings, seen from far away, as a part of
    that in space.  Those that differ in angles alone and have all bodies in one place look alike from everywhere.
    """
    default = default_view(scenes[0])
    if len(scenes) < 2:
        return default
    moving = [
        np.vstack([s.frames[0, :, :3, 3], *(item.at(s.frames[0]) for item in s.items if item.role in SOLID)])
        for s in scenes
    ]
    if len({len(points) for points in moving}) > 1:
        return default
    size = float(np.ptp(moving[0], axis=0).max())
    apart = [(one - other, _mean(one - other)) for one, other in combinations(moving, 2)]
    apart = [(way, far) for way, far in apart if far > SEEN * size]
    if not apart:
        return default

    def difference(view: tuple[float, float]) -> float:
        n = toward_eye(scenes[0], *view)
        return min(_mean(way - np.outer(way @ n, n)) / far for way, far in apart)

    best = max(((e, default[1] + 360.0 * k / AZIMUTHS) for e in ELEVATIONS for k in range(AZIMUTHS)), key=difference)
    return default if difference(default) >= GOOD * difference(best) else best


def _mean(ways: Array) -> float:
    return float(np.linalg.norm(ways, axis=1).mean())


def telling_values(names: Sequence[str], positions: Sequence[Array]) -> list[str]:
    """Of each position, the values of the coordinates that differ most between all, as a line of a title."""
    every = np.array(positions)
    spread = np.ptp(every, axis=0) / np.maximum(np.abs(every).max(axis=0), NOTHING)
    chosen = [k for k in np.argsort(-spread, kind="stable")[:MOST_VIEWS] if spread[k] > SEEN]
    return [", ".join(f"{names[k]} = {q[k]:.3g}" for k in sorted(chosen)) for q in every]


# -- places of labels --------------------------------------------------------------------------------------------------


NAMES = "0.25"  #: colour of names of joints
SIZE = 8.0  #: of the font
NAME_STYLE: dict[str, Any] = {
    "ha": "center",
    "va": "center",
    "fontsize": SIZE,
    "bbox": {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.7},
}

WIDE, TALL = 0.62, 1.2  #: of a letter and a line, in sizes of the font
EDGE = 0.3  #: of the ground of a name, left and right, or above and below, together
DIRECTIONS = 16
DISTANCES = (5.0, 9.0, 14.0, 20.0, 28.0, 38.0)  #: from the point to the edge of the name (points of type)
EVERY = 2.0  #: distance of the dots that stand for a line (points of type)
FAR = 0.1  #: what a point of type away costs, in dots that are covered
ON_A_NAME = 40.0  #: what it costs to cover another name
OUTSIDE = 40.0  #: and to stand outside of the axes


def name_offsets(scene: Scene, ax: Any, page: Callable[[Array], Array]) -> list[Array]:
    """Offsets (2,) in points of type from what is named in the first frame to the middles of the names.

    Parameters
    ----------
    scene : Scene
    ax : matplotlib Axes
        With its limits.
    page : callable
        Points (n, 3) in ground axes -> (n, 2) in data of the axes.
    """
    scale = 72.0 / ax.figure.dpi

    def typed(points: Array) -> Array:
        there: Array = ax.transData.transform(page(points)) * scale
        return there

    low, high = ax.transAxes.transform([(0.0, 0.0), (1.0, 1.0)]) * scale
    return offsets_within(scene, typed, low, high)


def offsets_within(scene: Scene, typed: Callable[[Array], Array], low: Array, high: Array) -> list[Array]:
    """The same where points (n, 3) in ground axes are at ``typed`` (n, 2), between low and high (points of type)."""
    if not scene.labels:
        return []
    poses, drawn = scene.frames[0], []
    for item in scene.items:
        if item.role != "trace":
            points = typed(item.at(poses))
            drawn.append(dots(points if item.faces is None else _closed(outline(points))))
    named = [typed(label.at(poses)[None])[0] for label in scene.labels]
    return places(named, [label.text for label in scene.labels], SIZE, np.vstack(drawn), low, high)


def _closed(corners: Array) -> Array:
    return np.vstack([corners, corners[:1]])


def dots(line: Array) -> Array:
    """Dots (m, 2) along a line (n, 2), broken at NaN, at most EVERY apart."""
    result = [np.empty((0, 2))]
    for a, b in pairwise(line):
        if np.isfinite(a).all() and np.isfinite(b).all():
            count = int(np.ceil(float(np.hypot(*(b - a))) / EVERY)) + 1
            result.append(a + np.linspace(0.0, 1.0, count)[:, None] * (b - a))
    return np.vstack(result)


def places(
    points: Sequence[Array], texts: Sequence[str], size: float, drawn: Array, low: Array, high: Array
) -> list[Array]:
    """Offsets (2,) from each point to the middle of its name, where it covers the least of the drawing.

    All lengths are in points of type on the page.

    Parameters
    ----------
    points : sequence of (2,) arrays
        What is named.
    texts : sequence of str
    size : float
        Of the font.
    drawn : (m, 2) array
        Dots of the drawing.
    low, high : (2,) arrays
        Corners of the axes.
    """
    turns = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    ways = np.tile(np.column_stack([np.cos(turns), np.sin(turns)]), (len(DISTANCES), 1))
    distances = np.repeat(DISTANCES, DIRECTIONS)
    taken, result = np.empty((0, 4)), []  # middles and halves of the names that have a place
    for point, text in zip(points, texts, strict=True):
        lines = text.split("\n")
        half = 0.5 * size * np.array([WIDE * max(map(len, lines)) + EDGE, TALL * len(lines) + EDGE])
        offsets = ways * (distances[:, None] + half)
        middles = (point + offsets)[:, None]
        near = drawn[(np.abs(drawn - point) < DISTANCES[-1] + 2.0 * half + 1.0).all(axis=1)]
        cost = FAR * distances + (np.abs(near - middles) < half + 1.0).all(axis=2).sum(axis=1)
        cost += ON_A_NAME * (np.abs(taken[:, :2] - middles) < half + taken[:, 2:]).all(axis=2).sum(axis=1)
        cost += OUTSIDE * ((middles - half < low) | (middles + half > high)).any(axis=(1, 2))
        result.append(offsets[cost.argmin()])
        taken = np.vstack([taken, [*(point + result[-1]), *half]])
    return result


# -- pieces in space, hindmost first -----------------------------------------------------------------------------------

# This is the painter's algorithm (Newell, Newell and Sancha 1972). A single depth stands for a piece, so large
# triangles and long lines are divided first. Faces that turn their backs to the eye are left out.


LONGEST = 2.0  #: edge of a piece (sizes of a symbol), unless there would be too many
FINEST = 80.0  #: pieces along the picture, at most
MOST_PIECES = 30_000  #: pieces of a picture
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
        most = max(MOST_PIECES, sum(map(len, first)))  # meshes of many triangles are not divided
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
        result = [np.empty((0, 3, 3))]
        for item, corners, (of, parts) in zip(self.scene.items, self._corners, self._parts, strict=True):
            points = item.at(poses, frame)
            if item.role == "trace":
                points = points.copy()
                points[len(passed(points, frame, frames)) :] = np.nan
            result.append(parts @ points[corners[of]])
        return np.concatenate(result)

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


# -- planar mechanisms -------------------------------------------------------------------------------------------------


SPACE = 7.0  #: largest edge of a figure of its own (inch)
LEAST = 2.8


def figure_size(scene: Scene) -> tuple[float, float]:
    """Width and height of a figure with the proportions of the mechanism (inch)."""
    width, height = scene.high[:2] - scene.low[:2]
    scale = SPACE / max(width, height)
    return max(LEAST, scale * width) + 0.6, max(LEAST, scale * height) + 0.6


class Flat:
    """Artists of a scene on axes, which :meth:`show` moves to a frame.

    Parameters
    ----------
    scene : Scene
        With a view.
    ax : matplotlib Axes
    """

    def __init__(self, scene: Scene, ax: Any) -> None:
        from matplotlib.collections import PolyCollection
        from matplotlib.colors import to_rgb
        from matplotlib.patches import Polygon

        assert scene.view is not None
        self.scene, self.ax = scene, ax
        limits = joined_limits(ax, "xy", [(scene.low[k], scene.high[k]) for k in (0, 1)])
        self.artists: list[tuple[Item, Any]] = []
        for item in sorted(scene.items, key=lambda item: item.layer):
            style, depth = style_of(item.role), 2 + item.layer
            color = color_of(item)
            if item.faces is None:
                line = ax.plot([], [], color=color, linewidth=style.width, zorder=depth, solid_capstyle="round")[0]
                self.artists.append((item, line))
            elif not item.convex:
                tint = 1.0 - style.alpha * (1.0 - np.array(to_rgb(color)))  # in place of layers that shine through
                triangles = PolyCollection([], closed=True, zorder=depth, facecolor=tint, edgecolor=tint, linewidth=0.4)
                ax.add_collection(triangles, autolim=False)
                self.artists.append((item, triangles))
            else:
                patch = Polygon(np.zeros((3, 2)), closed=True, zorder=depth, linewidth=style.width)
                patch.set(facecolor=style.face or color, edgecolor=style.edge or color, alpha=style.alpha)
                ax.add_patch(patch)
                self.artists.append((item, patch))
        ax.set_aspect("equal", adjustable="box")
        ax.set(xlim=limits[0], ylim=limits[1])
        right, up = (_axis_name(scene.view[k]) for k in (0, 1))
        ax.set_xlabel(ax.get_xlabel() or f"{right} (m)")
        ax.set_ylabel(ax.get_ylabel() or f"{up} (m)")
        ax.tick_params(labelsize=8)
        ax.set_axisbelow(True)
        ax.grid(alpha=0.25)
        self.labels = self._names()

    def _names(self) -> list[Any]:
        """Names on a light ground beside what they name, clear of the drawing of the first frame."""
        scene, ax = self.scene, self.ax
        ax.apply_aspect()
        return [
            ax.annotate(
                label.text,
                (0, 0),
                xytext=tuple(offset),
                textcoords="offset points",
                **NAME_STYLE,
                color=NAMES if label.role == "joint" else color_of(label),
                zorder=20,
                parse_math=False,
                annotation_clip=True,
            )
            for label, offset in zip(scene.labels, name_offsets(scene, ax, self.page), strict=True)
        ]

    def page(self, points: Array) -> Array:
        """Points (n, 2) on the page."""
        assert self.scene.view is not None
        flat: Array = points @ self.scene.view[:2].T
        return flat

    def show(self, frame: int) -> None:
        """Move everything to a frame."""
        poses = self.scene.frames[frame]
        for item, artist in self.artists:
            points = self.page(item.at(poses, frame))
            if item.faces is not None and not item.convex:
                artist.set_verts(points[item.faces])
            elif item.faces is not None:
                artist.set_xy(outline(points))
            else:
                if item.role == "trace":
                    points = passed(points, frame, len(self.scene.frames))
                artist.set_data(points[:, 0], points[:, 1])
        for label, text in zip(self.scene.labels, self.labels, strict=True):
            text.xy = tuple(self.page(label.at(poses)[None])[0])


def joined_limits(ax: Any, axes: str, limits: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Limits that a picture needs, wide enough for what is on the axes already and turned round where theirs are."""
    result = []
    for name, limit in zip(axes, limits, strict=True):
        theirs = (
            getattr(ax, f"get_{name}lim")() if ax.has_data() or not getattr(ax, f"get_autoscale{name}_on")() else limit
        )
        low, high = min(*limit, *theirs), max(*limit, *theirs)
        turned = limit[0] > limit[1] or theirs[0] > theirs[1]
        result.append((high, low) if turned else (low, high))
    return result


def _axis_name(direction: Array) -> str:
    """x, y, z, with a sign where it runs backwards; a page that lies askew has no names."""
    k = int(np.argmax(np.abs(direction)))
    if abs(direction[k]) < 1.0 - SAME:
        return "right" if k == 0 else "up"
    return ("" if direction[k] > 0.0 else "-") + "xyz"[k]


# -- spatial mechanisms ------------------------------------------------------------------------------------------------


ZOOM = 0.88  #: leaves room for the names of the axes
IN_FRONT = 1e6  #: place of names over solids, of which each has a place of its own


def piece_collection(pieces: ScenePieces, ax: Any) -> Any:
    """A collection of matplotlib that draws pieces as the eye of axes sees them; ``move`` gives it their corners.

    The class stands here because its base is an optional library's.
    """
    from matplotlib.collections import PolyCollection
    from mpl_toolkits.mplot3d.proj3d import proj_transform

    class PieceCollection(PolyCollection):
        def move(self, corners: Array) -> None:
            self.corners = corners
            self.stale = True

        def do_3d_projection(self) -> float:
            """Project what is seen; the depth of it all, by which matplotlib orders collections."""
            projection = ax.get_proj()
            front = pieces.seen(self.corners, eye_of(projection))
            x, y, z = proj_transform(*front.corners.reshape(-1, 3).T, projection)
            corners: Any = np.column_stack([x, y]).reshape(-1, 3, 2)
            colors: Any = front.colors
            widths: Any = front.widths
            self.set(verts=corners, facecolor=colors, edgecolor=colors, linewidth=widths)
            return float(np.min(z, initial=np.inf))

    return PieceCollection([], capstyle="round", joinstyle="round")


class Axes3DPicture:
    """Artists of a scene on axes in space, which :meth:`show` moves to a frame.

    Parameters
    ----------
    scene : Scene
    ax : matplotlib Axes3D
    view : (float, float), optional
        Elevation and azimuth of the eye (degrees).
    """

    def __init__(self, scene: Scene, ax: Any, view: tuple[float, float] | None = None) -> None:
        self.scene, self.ax = scene, ax
        vertical, right = page_axes(scene.up)
        depth = 3 - vertical - right
        limits = [(scene.low[k], scene.high[k]) for k in range(3)]
        if scene.up[vertical] < 0.0:  # two axes are turned round, so that right hands stay right
            for k in (vertical, depth):
                limits[k] = limits[k][::-1]
        limits = joined_limits(ax, "xyz", limits)
        self.pieces = ScenePieces(scene)
        self.drawn = piece_collection(self.pieces, ax)
        ax.add_collection(self.drawn, autolim=False)
        elevation, azimuth = view or default_view(scene)
        ax.view_init(elevation, azimuth, vertical_axis="xyz"[vertical])  # first: the shape of the box is set for it
        ax.set(xlim=limits[0], ylim=limits[1], zlim=limits[2])
        lengths = np.abs(np.diff(limits)[:, 0])
        ax.set_box_aspect(lengths, zoom=ZOOM)
        ax.set_xlabel("x (m)", fontsize=8)
        ax.set_ylabel("y (m)", fontsize=8)
        ax.set_zlabel("z (m)", fontsize=8)
        ax.tick_params(labelsize=7)
        for axis, length in zip((ax.xaxis, ax.yaxis, ax.zaxis), lengths, strict=True):  # as dense on short axes
            axis.get_major_locator().set_params(nbins=max(2, round(5 * length / lengths.max())))
        self.labels = self._names()

    def _names(self) -> list[Any]:
        """Names on a light ground beside what they name, clear of the drawing as it is seen at first."""
        from matplotlib.transforms import offset_copy
        from mpl_toolkits.mplot3d.proj3d import proj_transform

        scene, ax = self.scene, self.ax
        ax.apply_aspect()
        matrix = ax.get_proj()

        def page(points: Array) -> Array:
            return np.column_stack(proj_transform(*points.T, matrix)[:2])

        made = []
        for label, offset in zip(scene.labels, name_offsets(scene, ax, page), strict=True):
            color = NAMES if label.role == "joint" else color_of(label)
            text = ax.text(
                *label.at(scene.frames[0]), label.text, **NAME_STYLE, color=color, parse_math=False, zorder=IN_FRONT
            )
            text.set_transform(offset_copy(ax.transData, ax.figure, x=offset[0], y=offset[1], units="points"))
            made.append(text)
        return made

    def show(self, frame: int) -> None:
        """Move everything to a frame."""
        self.drawn.move(self.pieces.at(frame))
        for label, text in zip(self.scene.labels, self.labels, strict=True):
            text.set_position_3d(label.at(self.scene.frames[frame]))
