"""Stage show, animate: a trajectory -> a GIF, MP4 or PNG frames through matplotlib, or a page or widget through k3d."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ..errors import UsageError
from ..files.path_names import as_path
from ..files.writing import whole_file
from ..notation.labels import label
from ..notation.notation import Notation
from ..texts import shown
from .film_frames import DPI, Frames
from .scene import Scene
from .shown_motion import ShownMotion, States, moving_scene, sample, with_arrows, with_fine_traces
from .writers import WRITERS, kind_of, require_kind


class ShownColumn(NamedTuple):
    """A column of the run that is drawn along: its name as it is printed and unit, its values over what goes on."""

    label: str
    over: Any
    values: Any


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
    forces: Sequence[str] | str | bool = False,
    names: bool | None = None,
    axes: bool = False,
    dpi: float = DPI,
) -> Any:
    """See :meth:`eomgen.runtime.trajectory.Trajectory.animate`."""
    if file is not None:
        require_kind(as_path("file", file))
    trace = (trace,) if isinstance(trace, str) else tuple(trace)
    plot = (plot,) if isinstance(plot, str) else tuple(plot)
    forces = (forces,) if isinstance(forces, str) else forces
    if not isinstance(forces, bool | list | tuple):
        raise UsageError(f"forces must be True, a joint or a list of joints, not {shown(forces)}")
    columns = {name: trajectory[name] for name in plot}  # unknown names fail before anything is drawn
    motion = sample(trajectory, states, fps, speed)
    scene = moving_scene(module, motion, names, axes, trace)
    if trace and motion.t[0] != motion.t[-1]:
        scene = with_fine_traces(scene, module, motion, states, trace)
    if forces:
        scene = with_arrows(scene, module, motion, forces)
    still = motion.t[0] == motion.t[-1]
    over = motion.over if still else trajectory.t
    printed, units = Notation.of(trajectory.metadata).mathtext, trajectory.units
    curves = [ShownColumn(label(printed(n), units.get(n, "")), over, values) for n, values in columns.items()]
    return write(file, scene, motion, curves, dpi)


def write(
    file: Path | str | None,
    scene: Scene,
    motion: ShownMotion,
    curves: Sequence[ShownColumn] = (),
    dpi: float = DPI,
) -> Any:
    """Write an animation as its ending says; without a file, something that a notebook shows."""
    path = None if file is None else as_path("file", file)
    kind = "" if path is None else kind_of(path)
    if path is None or kind == ".html":
        from .browser import page
        from .player import InlinePage

        text = page(scene, motion, curves)
        if path is None:
            return InlinePage(text)
        with whole_file(path) as handle:
            handle.write(text.encode())
        return path
    WRITERS[kind](path, Frames.of(scene, motion, curves, dpi))
    return path
