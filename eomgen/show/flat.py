"""Stage show, flat: a Scene of a planar mechanism -> matplotlib axes, true to scale."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.pictures import SAME
from .colors import color_of, style_of
from .label_places import NAME_STYLE, NAMES, name_offsets
from .scene import Item, Scene, passed
from .solids import outline

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
    found = []
    for name, own in zip(axes, limits, strict=True):
        theirs = (
            getattr(ax, f"get_{name}lim")() if ax.has_data() or not getattr(ax, f"get_autoscale{name}_on")() else own
        )
        low, high = min(*own, *theirs), max(*own, *theirs)
        turned = own[0] > own[1] or theirs[0] > theirs[1]
        found.append((high, low) if turned else (low, high))
    return found


def _axis_name(direction: Array) -> str:
    """x, y, z, with a sign where it runs backwards; a page that lies askew has no names."""
    k = int(np.argmax(np.abs(direction)))
    if abs(direction[k]) < 1.0 - SAME:
        return "right" if k == 0 else "up"
    return ("" if direction[k] > 0.0 else "-") + "xyz"[k]
