"""Stage show, space: a Scene of a spatial mechanism -> matplotlib axes in three dimensions, all of one scale."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.algebra import Array
from .branch_views import usual_view
from .colors import color_of
from .flat import joined_limits
from .label_places import NAME_STYLE, NAMES, name_offsets
from .plane import page_axes
from .scene import Scene
from .scene_pieces import ScenePieces, eye_of

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
            shown = pieces.seen(self.corners, eye_of(projection))
            x, y, z = proj_transform(*shown.corners.reshape(-1, 3).T, projection)
            corners: Any = np.column_stack([x, y]).reshape(-1, 3, 2)
            colors: Any = shown.colors
            widths: Any = shown.widths
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
        elevation, azimuth = view or usual_view(scene)
        ax.view_init(elevation, azimuth, vertical_axis="xyz"[vertical])  # first: the shape of the box is set for it
        ax.set(xlim=limits[0], ylim=limits[1], zlim=limits[2])
        ax.set_box_aspect(np.abs(np.diff(limits)[:, 0]), zoom=ZOOM)
        ax.set_xlabel("x (m)", fontsize=8)
        ax.set_ylabel("y (m)", fontsize=8)
        ax.set_zlabel("z (m)", fontsize=8)
        ax.tick_params(labelsize=7)
        ax.locator_params(nbins=5)
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
