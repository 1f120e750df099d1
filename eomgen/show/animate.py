"""Stage show, animate: a trajectory -> a GIF, MP4 or PNG frames through matplotlib, or a page or widget through k3d."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ..base.files import as_path, whole_file
from ..base.notation import Notation
from ..base.texts import shown
from ..errors import ill_typed, off_range
from .film_frames import DPI, MOST_DOTS, Frames
from .force_arrows import with_arrows
from .player import InlineFilm, InlinePage
from .scene import Scene
from .shown_motion import ShownMotion, States, moving_scene, sample, with_fine_traces
from .unit_panels import ShownColumn
from .writers import FILMS, WRITERS, kind_of, require_target


def animate(
    trajectory: Any,
    module: Any,
    file: Path | str | None = None,
    *,
    states: States,
    columns: Callable[[tuple[str, ...]], tuple[Any, dict[str, Any]]],
    format: str | None = None,
    fps: float = 25.0,
    speed: float | None = None,
    trace: Sequence[str] | str = (),
    plot: Sequence[str] | str = (),
    forces: Sequence[str] | str | bool = False,
    names: bool | None = None,
    axes: bool = False,
    dpi: float = DPI,
) -> Any:
    """See :meth:`eomgen.runtime.trajectory.Trajectory.animate`."""
    require_target(file, format)
    trace = (trace,) if isinstance(trace, str) else tuple(trace)
    plot = (plot,) if isinstance(plot, str) else tuple(plot)
    forces = (forces,) if isinstance(forces, str) else forces
    if not isinstance(forces, bool | list | tuple):
        raise ill_typed(
            f"forces must be True, the name of a joint, spring or damper, or a list of names, not {shown(forces)}"
        )
    for name in plot:  # unknown names fail before anything is drawn
        trajectory[name]
    motion = sample(trajectory, states, fps, speed)
    scene = moving_scene(module, motion, names, axes, trace)
    if trace and motion.t[0] != motion.t[-1]:
        scene = with_fine_traces(scene, module, motion, states, trace)
    if forces:
        scene = with_arrows(scene, module, motion, forces)
    still = motion.t[0] == motion.t[-1]
    times, values = columns(plot) if plot else (trajectory.t, {})
    over = motion.over if still else times
    printed, units = Notation.of(trajectory.metadata).mathtext, trajectory.units
    curves = [ShownColumn(printed(n), units.get(n, ""), over, row) for n, row in values.items()]
    return write(file, scene, motion, curves, dpi, format)


def write(
    file: Path | str | None,
    scene: Scene,
    motion: ShownMotion,
    curves: Sequence[ShownColumn] = (),
    dpi: float = DPI,
    format: str | None = None,
) -> Any:
    """Write an animation as its ending says; without a file, something that a notebook shows."""
    if isinstance(dpi, bool) or not isinstance(dpi, int | float) or not 1.0 <= dpi <= MOST_DOTS:
        raise off_range(f"dpi must be a number from 1 to {MOST_DOTS:g}, not {shown(dpi)}")
    if format in FILMS:
        return InlineFilm(FILMS[format](Frames.of(scene, motion, curves, dpi)), format)
    path = None if file is None else as_path("file", file)
    kind = "" if path is None else kind_of(path)
    if path is None or kind == ".html":
        from .browser import page

        text = page(scene, motion, curves)
        if path is None:
            return InlinePage(text)
        with whole_file(path) as handle:
            handle.write(text.encode())
        return path
    WRITERS[kind](path, Frames.of(scene, motion, curves, dpi))
    return path
