"""Stage show, frames: scenes over time -> pictures of one figure, one after the other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .draw import new_artist
from .flat import figure_size
from .optional import matplotlib
from .scene import Scene
from .shown_motion import ShownMotion
from .unit_panels import ShownColumn, by_unit, draw_curves

DPI = 80  #: of the frames
READABLE = 90.0  #: dots in an inch, below which letters are drawn larger, so that they can be read
LETTER = 0.0836  #: width of a letter of a title (inch)
TITLE_MARGIN = 4.0  #: beside a title (dots)
LEAST_TITLE = 4.5  #: size of its letters (points)
MOST_DOTS = 1200.0  #: in an inch
TICKS = 8.0  #: size of the numbers at axes (points)
BELOW = 1.7  #: height of a plot below (inch)
SPACE = (6.4, 5.6)  #: of a spatial mechanism (inch)


class Frames:
    """Pictures over time on one figure.

    Parameters
    ----------
    figure : matplotlib Figure
    motion : ShownMotion
    """

    def __init__(self, figure: Any, motion: ShownMotion) -> None:
        agg = matplotlib("backends.backend_agg", "an animation")
        self.figure, self.motion = figure, motion
        self.canvas = agg.FigureCanvasAgg(figure)
        self.updates: list[Callable[[int], None]] = []
        self.titles: list[Any] = []

    @classmethod
    def of(cls, scene: Scene, motion: ShownMotion, curves: Sequence[ShownColumn] = (), dpi: float = DPI) -> Frames:
        """One scene, and curves below it."""
        width, height = figure_size(scene) if scene.view is not None else SPACE
        panels = by_unit(curves)
        below = [BELOW] * len(panels)
        figure = matplotlib("figure", "an animation").Figure(
            (width, height + sum(below)), dpi=dpi, layout="constrained"
        )
        grid = figure.add_gridspec(1 + len(panels), 1, height_ratios=[height, *below])
        spatial = {} if scene.view is not None else {"projection": "3d"}
        frames = cls(figure, motion)
        letters = len(f"{scene.name}  {motion.words[0]}{motion.pace}   {scene.note}")
        note = f"{'   ' if LETTER * letters < width else chr(10)}{scene.note}" if scene.note else ""
        frames.add_scene(scene, figure.add_subplot(grid[0], **spatial), f"{scene.name}  {{}}{note}")
        if panels:
            frames.add_curves([figure.add_subplot(grid[1 + k]) for k in range(len(panels))], panels)
        frames.settle()
        return frames

    def add_scene(self, scene: Scene, ax: Any, title: str) -> None:
        """Draw a scene on axes; ``{}`` in the title is what is said of the frame."""
        artist = new_artist(scene, None, ax)
        above = ax.set_title("", fontsize=10, parse_math=False, family="monospace")

        def update(k: int) -> None:
            artist.show(k)
            above.set_text(title.replace("{}", self.motion.words[k] + self.motion.pace))

        self.updates.append(update)
        self.titles.append(above)

    def add_curves(self, axes: Sequence[Any], panels: Sequence[Sequence[ShownColumn]]) -> None:
        """Draw curves, one axes for each unit, with a line where the frame is."""
        draw_curves(axes, panels, self.motion)
        cursors = [ax.axvline(self.motion.over[0], color="0.3", linewidth=1.0) for ax in axes]

        def update(k: int) -> None:
            for cursor in cursors:
                cursor.set_xdata([self.motion.over[k]] * 2)

        self.updates.append(update)

    def settle(self) -> None:
        """Find the places of all axes, which then stay where they are, and letters that can be read."""
        self.show(0)
        larger = max(1.0, READABLE / self.figure.dpi)
        for ax in self.figure.axes:
            ax.tick_params(labelsize=larger * TICKS)
            legend = [] if ax.get_legend() is None else ax.get_legend().get_texts()
            for text in (*ax.texts, *legend, ax.title, ax.xaxis.label, ax.yaxis.label):
                text.set_fontsize(larger * text.get_fontsize())
        self.canvas.draw()
        self.figure.set_layout_engine("none")
        wide = self.canvas.get_width_height()[0]
        for title in self.titles:  # a narrow picture cuts nothing off
            box = title.get_window_extent(self.canvas.get_renderer())
            room = min(box.x0 + box.x1, 2 * wide - box.x0 - box.x1) - TITLE_MARGIN
            title.set_fontsize(max(title.get_fontsize() * min(1.0, room / max(box.width, 1.0)), LEAST_TITLE))

    def __len__(self) -> int:
        return len(self.motion.t)

    def show(self, k: int) -> None:
        """Move everything to frame k."""
        for update in self.updates:
            update(k)

    def image(self, k: int) -> Any:
        """Frame k as an array (height, width, 3) of bytes."""
        self.show(k)
        self.canvas.draw()
        return np.asarray(self.canvas.buffer_rgba())[..., :3].copy()
