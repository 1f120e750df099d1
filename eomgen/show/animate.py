"""Stage show, animate: a trajectory -> a GIF or MP4 through matplotlib, or a page or widget through k3d."""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ..errors import MissingDependencyError, UsageError
from ..files.path_names import as_path
from ..files.writing import whole_file
from ..limits.pictures import ROUNDED
from .draw import new_artist
from .flat import figure_size
from .optional import matplotlib
from .scene import Scene
from .shown_motion import ShownMotion, States, moving_scene, sample

DPI = 80  #: of the frames
COLORS = 64  #: of a GIF


def animate(
    trajectory: Any,
    module: Any,
    file: Path | str | None = None,
    *,
    states: States,
    fps: float = 25.0,
    speed: float | None = None,
    trace: Sequence[str] | str = (),
    plot: Sequence[str] | str = (),
    names: bool | None = None,
    axes: bool = False,
    dpi: float = DPI,
) -> Any:
    """See :meth:`eomgen.runtime.trajectory.Trajectory.animate`."""
    path = None if file is None else as_path("file", file)
    kind = "" if path is None else path.suffix.lower()
    if path is not None:
        require_kind(path)
    trace = (trace,) if isinstance(trace, str) else tuple(trace)
    plot = (plot,) if isinstance(plot, str) else tuple(plot)
    columns = {name: trajectory[name] for name in plot}  # unknown names fail before anything is drawn
    if columns and kind not in WRITERS:
        raise UsageError(f"plot= stands in animations of matplotlib: {', '.join(WRITERS)}; leave it out")
    motion = sample(trajectory, states, fps, speed)
    scene = moving_scene(module, motion, names, axes, trace)
    if path is None or kind == ".html":
        from .browser import page, scene_plot

        if path is None:
            return scene_plot(scene, motion)
        with whole_file(path) as handle:
            handle.write(page(scene, motion).encode())
        return path
    WRITERS[kind](path, Frames(scene, motion, trajectory, columns, dpi))
    return path


def require_kind(path: Path) -> None:
    """Refuse an ending that says no kind of animation, and a kind whose library is missing, before any work.

    Raises
    ------
    UsageError, MissingDependencyError
    """
    kind = path.suffix.lower()
    if kind not in (*WRITERS, ".html"):
        raise UsageError(f"{path}: the ending says what kind of animation; there are {', '.join(WRITERS)}, .html")
    if kind == ".html":
        from .optional import k3d

        k3d("an animation as a page")
        return
    matplotlib("figure", "an animation")
    if kind == ".mp4" and not matplotlib("animation", "an animation").writers.is_available("ffmpeg"):
        raise MissingDependencyError(
            "an animation as .mp4 needs ffmpeg (Debian: apt install ffmpeg); .gif needs nothing more"
        )


class Frames:
    """Pictures of a scene over time, one after the other on one figure."""

    def __init__(self, scene: Scene, motion: ShownMotion, trajectory: Any, columns: dict[str, Any], dpi: float) -> None:
        figures = matplotlib("figure", "an animation")
        agg = matplotlib("backends.backend_agg", "an animation")
        self.scene, self.motion = scene, motion
        width, height = figure_size(scene) if scene.view is not None else (6.4, 5.6)
        below = 1.7 if columns else 0.0
        self.figure = figures.Figure(figsize=(width, height + below), dpi=dpi, layout="constrained")
        self.canvas = agg.FigureCanvasAgg(self.figure)
        grid = self.figure.add_gridspec(2 if columns else 1, 1, height_ratios=[height, below] if columns else [1])
        spatial = {} if scene.view is not None else {"projection": "3d"}
        self.artist = new_artist(scene, None, self.figure.add_subplot(grid[0], **spatial))
        self.title = self.artist.ax.set_title("", fontsize=10, parse_math=False, family="monospace")
        self.cursor: Any = None
        if columns:
            below_ax = self.figure.add_subplot(grid[1])
            for name, values in columns.items():
                unit = trajectory.units.get(name, "")
                below_ax.plot(trajectory.t, values, linewidth=1.1, label=f"{name} ({unit})" if unit else name)
            below_ax.legend(fontsize=7, loc="upper right")
            below_ax.set_xlabel("t (s)", fontsize=8)
            below_ax.tick_params(labelsize=7)
            below_ax.grid(alpha=0.3)
            self.cursor = below_ax.axvline(motion.t[0], color="0.3", linewidth=1.0)
        self._show(0)
        self.canvas.draw()
        self.figure.set_layout_engine("none")  # the axes stay where they are

    def __len__(self) -> int:
        return len(self.motion.t)

    def _show(self, k: int) -> None:
        self.artist.show(k)
        speed = self.motion.speed
        slow = "" if abs(speed - 1.0) < ROUNDED else f"  x{speed:.2g}"
        self.title.set_text(f"{self.scene.name}  t = {self.motion.t[k]:.2f} s{slow}")
        if self.cursor is not None:
            self.cursor.set_xdata([self.motion.t[k]] * 2)

    def image(self, k: int) -> Any:
        """Frame k as an array (height, width, 3) of bytes."""
        self._show(k)
        self.canvas.draw()
        return np.asarray(self.canvas.buffer_rgba())[..., :3].copy()


def _write_gif(path: Path, frames: Frames) -> None:
    from PIL import Image

    images = [Image.fromarray(frames.image(k)) for k in range(len(frames))]
    palette = images[0].quantize(COLORS)
    reduced = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    # a GIF counts hundredths of a second; pillow joins equal frames, which keeps the time
    duration = max(20, round(100.0 / frames.motion.fps) * 10)
    buffer = io.BytesIO()
    reduced[0].save(
        buffer, format="GIF", save_all=True, append_images=reduced[1:], duration=duration, loop=0, optimize=False
    )
    with whole_file(path) as handle:
        handle.write(buffer.getvalue())


def _write_mp4(path: Path, frames: Frames) -> None:
    writer = matplotlib("animation", "an animation").FFMpegWriter(fps=frames.motion.fps)
    with TemporaryDirectory() as folder:
        part = os.path.join(folder, "part.mp4")
        with writer.saving(frames.figure, part, frames.figure.dpi):
            for k in range(len(frames)):
                frames._show(k)
                writer.grab_frame()
        data = Path(part).read_bytes()
    with whole_file(path) as handle:
        handle.write(data)


#: Endings of files that matplotlib makes.
WRITERS: dict[str, Callable[[Path, Frames], None]] = {".gif": _write_gif, ".mp4": _write_mp4}
