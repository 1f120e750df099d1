"""Stage show, space: a Scene of a spatial mechanism -> matplotlib axes in three dimensions, all of one scale."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..limits.pictures import NOTHING
from .colors import color_of, style_of
from .data import Array
from .flat import joined_limits
from .label_places import NAME_STYLE, NAMES, name_offsets
from .plane import page_axes
from .scene import Item, Scene, passed
from .solids import Triangles

ELEVATION, AZIMUTH = 22.0, -58.0  #: of the eye (degrees), from the axis that runs to the right
ZOOM = 0.88  #: leaves room for the names of the axes
IN_FRONT = 1e6  #: place of names over solids, of which each has a place of its own


class Axes3DPicture:
    """Artists of a scene on axes in space, which :meth:`show` moves to a frame.

    Parameters
    ----------
    scene : Scene
    ax : matplotlib Axes3D
    """

    def __init__(self, scene: Scene, ax: Any) -> None:
        from matplotlib.colors import to_rgb
        from mpl_toolkits.mplot3d.art3d import Poly3DCollection

        self.scene, self.ax = scene, ax
        vertical, right = page_axes(scene.up)
        depth = 3 - vertical - right
        limits = [(scene.low[k], scene.high[k]) for k in range(3)]
        if scene.up[vertical] < 0.0:  # two axes are turned round, so that right hands stay right
            for k in (vertical, depth):
                limits[k] = limits[k][::-1]
        limits = joined_limits(ax, "xyz", limits)
        self.artists: list[tuple[Item, Any, Triangles | None]] = []
        light = np.array([0.4, -0.5, 0.77])
        for item in scene.items:
            style, color = style_of(item.role), color_of(item)
            if item.faces is None:
                line = ax.plot([], [], [], color=color, linewidth=style.width)[0]
                self.artists.append((item, line, None))
                continue
            corners = item.at(scene.frames[0])[item.faces]
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), NOTHING)
            bright = 0.62 + 0.38 * np.clip(normals @ light, -0.4, 1.0)
            base = np.array(to_rgb(style.face or color))
            faces = np.clip(base * bright[:, None], 0.0, 1.0)
            alpha = style.alpha if item.role in ("shape", "wheel") else 1.0
            collection = Poly3DCollection(corners, facecolors=np.column_stack([faces, np.full(len(faces), alpha)]))
            collection.set_edgecolor("none")
            ax.add_collection3d(collection)
            self.artists.append((item, collection, item.faces))
        # matplotlib counts azimuths from the axis after the vertical one
        azimuth = AZIMUTH if right == (vertical + 1) % 3 else 90.0 + AZIMUTH
        ax.view_init(ELEVATION, azimuth, vertical_axis="xyz"[vertical])  # first: the shape of the box is set for it
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
        poses = self.scene.frames[frame]
        for item, artist, faces in self.artists:
            points = item.at(poses, frame)
            if faces is not None:
                artist.set_verts(points[faces])
            else:
                if item.role == "trace":
                    points = passed(points, frame, len(self.scene.frames))
                artist.set_data_3d(*points.T)
        for label, text in zip(self.scene.labels, self.labels, strict=True):
            text.set_position_3d(label.at(poses))
