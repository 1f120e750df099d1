"""A trajectory -> scenes at even times, and pictures of them one after the other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..base.algebra import Array
from ..base.texts import TIME, label
from ..errors import cannot, off_range, too_large
from ..expr.notation import Notation
from .axes import figure_size
from .build_scene import build_scene
from .draw import matplotlib, new_artist
from .limits import ROUNDED
from .scene import Scene

# -- scenes at even times ----------------------------------------------------------------------------------------------


LONGEST = 12.0  #: seconds that an animation lasts, unless a speed is given
SHORTEST = 3.0
FRAMES = 1500  #: at most
POINTS = 400  #: of the way of a marker, at least

#: Times (k,) -> states (n_x, k) and inputs (n_u, k) or None.
States = Callable[[Array], tuple[Array, Array | None]]


class MotionFrames(NamedTuple):
    """Frames of a motion.

    Attributes
    ----------
    t : (k,) array
        Times of the run (s).
    x, u : (n_x, k), (n_u, k) arrays
        States, inputs (None without any).
    speed : float
        Seconds of the run in one of the animation.
    fps : float
    captions : list of str
        What is written above each frame: its time, or the coordinate that is led.
    over : (k,) array
        Time, or the coordinate that is led where time stands still.
    x_label : str
        How the latter is printed at an axis.
    """

    t: Array
    x: Array
    u: Array | None
    speed: float
    fps: float
    captions: list[str]
    over: Array
    x_label: str = TIME

    @property
    def pace(self) -> str:
        """What is written beside the time of a film that runs slower or faster than the mechanism."""
        return "" if abs(self.speed - 1.0) < ROUNDED else f"  x{self.speed:.2g}"

    @property
    def clock(self) -> Array:
        """Seconds of the animation at each frame."""
        return np.arange(len(self.t)) / self.fps if self.t[0] == self.t[-1] else np.abs(self.t - self.t[0]) / self.speed


def sample(trajectory: Any, states: States, fps: float, speed: float | None) -> MotionFrames:
    """Frames of a trajectory at even times, of the states that the runtime gives there.

    Raises
    ------
    UsageError
        A rate or a speed that is not positive, more frames than there may be, or a run without duration.
    """
    for name, value in (("fps", fps), ("speed", speed)):
        if value is not None and not (isinstance(value, int | float) and 0.0 < value < np.inf):
            raise off_range(f"{name} must be a number greater than 0, not {value!r}")
    t = trajectory.t
    if len(t) < 2:
        raise cannot("the run has only one point, so there is no motion to show; draw its state with module.draw(x)")
    if t[0] == t[-1]:  # a range of coordinates at one time
        prescribed = trajectory.metadata.get("led") or trajectory.x_names[:1]
        over, unit = trajectory[prescribed[0]], trajectory.units.get(prescribed[0], "")
        said = [f"{prescribed[0]} = {value:.3f} {unit}" for value in over]
        abscissa = label(Notation.of(trajectory.metadata).mathtext(prescribed[0]), unit)
        return MotionFrames(t, trajectory.x, None, 1.0, max(fps, len(t) / LONGEST), said, over, abscissa)
    start, end = float(t[0]), float(t[-1])
    span = abs(end - start)
    if speed is None:
        speed = max(span / LONGEST, min(1.0, span / SHORTEST))
    count = int(np.ceil(span / speed * fps)) + 1
    if count > FRAMES:
        raise too_large(
            f"the animation would have {count} frames, and {FRAMES} is the most; give a speed of "
            f"{span * fps / FRAMES:.3g} or more, a lower fps, or a shorter run"
        )
    times = np.linspace(start, end, max(count, 2))
    digits = max(2, 2 - int(np.floor(np.log10(span))))
    return MotionFrames(times, *states(times), speed, fps, [f"t = {now:.{digits}f} s" for now in times], times)


def moving_scene(module: Any, motion: MotionFrames, names: bool | None, axes: bool, trace: Sequence[str]) -> Scene:
    """The scene over all frames."""
    return build_scene(module, motion.x[: module.n_q], motion.t, motion.u, names, axes, trace)


def with_fine_traces(scene: Scene, module: Any, motion: MotionFrames, states: States, trace: Sequence[str]) -> Scene:
    """The scene with the ways of markers through several points a frame, so that they look round at any rate."""
    finer = int(np.ceil(POINTS / (len(motion.t) - 1)))
    times = np.linspace(motion.t[0], motion.t[-1], finer * (len(motion.t) - 1) + 1)
    x, u = states(times)
    fine = build_scene(module, x[: module.n_q], times, u, False, False, trace)
    ways = [item for item in fine.items if item.role == "trace"]
    rest = [item for item in scene.items if item.role != "trace"]
    low, high = np.minimum(scene.low, fine.low), np.maximum(scene.high, fine.high)
    return scene._replace(items=[*rest, *ways], low=low, high=high)


# -- panels of columns -------------------------------------------------------------------------------------------------


class FrameColumn(NamedTuple):
    """A column of the run that is drawn along: its name as it is printed, its unit, its values over what goes on."""

    name: str
    unit: str
    over: Array
    values: Array
    plain: str = ""  #: its name as it is typed


def by_unit(curves: Sequence[FrameColumn]) -> list[list[FrameColumn]]:
    """Columns in groups of one unit, in the order in which they come."""
    groups: dict[str, list[FrameColumn]] = {}
    for curve in curves:
        groups.setdefault(curve.unit, []).append(curve)
    return list(groups.values())


def draw_curves(axes: Sequence[Any], panels: Sequence[Sequence[FrameColumn]], motion: MotionFrames) -> None:
    """Columns over time, or over what is led; each panel on its own axes, one above the other."""
    for ax, panel in zip(axes, panels, strict=True):
        for curve in panel:
            ax.plot(curve.over, curve.values, linewidth=1.1, label=label(curve.name, curve.unit))
        ax.legend(fontsize=7, loc="upper left", bbox_to_anchor=(1.0, 1.05), frameon=False)
        ax.tick_params(labelsize=7, labelbottom=ax is axes[-1])
        ax.grid(alpha=0.3)
        if len(axes) > 1:
            ax.set_ylabel(label("", panel[0].unit), fontsize=8)
            ax.sharex(axes[0])
    axes[-1].set_xlabel(motion.x_label, fontsize=8)


# -- pictures ----------------------------------------------------------------------------------------------------------


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
    motion : MotionFrames
    """

    def __init__(self, figure: Any, motion: MotionFrames) -> None:
        agg = matplotlib("backends.backend_agg", "an animation")
        self.figure, self.motion = figure, motion
        self.canvas = agg.FigureCanvasAgg(figure)
        self.updates: list[Callable[[int], None]] = []
        self.titles: list[Any] = []

    @classmethod
    def of(cls, scene: Scene, motion: MotionFrames, curves: Sequence[FrameColumn] = (), dpi: float = DPI) -> Frames:
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
        letters = len(f"{scene.name}  {motion.captions[0]}{motion.pace}   {scene.note}")
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
            above.set_text(title.replace("{}", self.motion.captions[k] + self.motion.pace))

        self.updates.append(update)
        self.titles.append(above)

    def add_curves(self, axes: Sequence[Any], panels: Sequence[Sequence[FrameColumn]]) -> None:
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
            labels = [getattr(ax, f"{k}axis").label for k in ("xyz" if hasattr(ax, "zaxis") else "xy")]
            for text in (*ax.texts, *legend, ax.title, *labels):
                text.set_fontsize(larger * text.get_fontsize())
        self.canvas.draw()
        self.figure.set_layout_engine("none")
        wide = self.canvas.get_width_height()[0]
        for title in self.titles:  # a narrow picture cuts nothing off
            box = title.get_window_extent(self.canvas.get_renderer())
            width = min(box.x0 + box.x1, 2 * wide - box.x0 - box.x1) - TITLE_MARGIN
            title.set_fontsize(max(title.get_fontsize() * min(1.0, width / max(box.width, 1.0)), LEAST_TITLE))

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
