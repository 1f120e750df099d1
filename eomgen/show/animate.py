"""A trajectory or a mode -> a GIF, MP4 or PNG frames, or a page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.files import as_path, whole_file
from ..base.picture_data import GROUND, PlacedFrame, read_picture
from ..base.texts import quote
from ..errors import EvaluationError, ill_typed, no_such, off_range
from ..expr.notation import Notation
from .build_scene import build_scene
from .draw import matplotlib
from .frames import DPI, MOST_DOTS, FrameColumn, Frames, MotionFrames, States, moving_scene, sample, with_fine_traces
from .limits import NOTHING, SAME, STEP
from .page import InlinePage, page_html
from .scene import Item, Scene, attachments, placed
from .writers import FILMS, WRITERS, InlineFilm, gif_bytes, kind_of, require_target

# -- arrows of forces --------------------------------------------------------------------------------------------------


ARROW = 0.2  #: length of the longest arrow, of the picture's diagonal
HEAD = 0.22  #: of an arrow's length
BEFORE = 3.0  #: distance of arrows in front of a planar mechanism, in sizes of a symbol

#: What an arrow belongs to, the frame in whose origin it begins, and its force over the frames (k, 3), ground axes (N).
Pull = tuple[str, PlacedFrame, Array]


def with_arrows(scene: Scene, module: Any, motion: MotionFrames, wanted: Sequence[str] | bool) -> Scene:
    """The scene with arrows over the frames, of all joints, springs and dampers or of those named.

    Of a joint it is the force that it exerts on its successor, of a spring or damper the force on each body at its
    ends.

    Raises
    ------
    UsageError
        An unknown joint, spring or damper.
    """
    data = read_picture(module.metadata, module.p)
    joints = module.joint_names
    straight = [one for one in data.elements if one["kind"] == "lines" and "points" in one]
    elements = [one for one in straight if all(radius is None for _, radius, _ in one["stops"])]
    if not isinstance(wanted, bool):
        known = [*joints, *(one["name"] for one in elements)]
        for name in wanted:
            if name not in known:
                raise no_such(f"no joint, spring or damper {name!r} with a force to draw; there are {', '.join(known)}")

    def chosen(name: str) -> bool:
        return wanted is True or (not isinstance(wanted, bool) and name in wanted)

    frames = {joint.name: joint.S for joint in data.joints}
    pulls: list[Pull] = []
    if any(map(chosen, joints)):
        reactions = module.reactions(motion.t, motion.x, u=motion.u)[:, :3]
        pulls += [(name, frames[name], reactions[k].T) for k, name in enumerate(joints) if chosen(name)]
    elements = [one for one in elements if chosen(one["name"])]
    if elements:
        pulls += _of_elements(elements, scene, module, motion)
    return _drawn(scene, [(name, frame, np.where(np.isfinite(force), force, 0.0)) for name, frame, force in pulls])


def _of_elements(elements: Sequence[dict[str, Any]], scene: Scene, module: Any, motion: MotionFrames) -> list[Pull]:
    """Forces of springs and dampers on the bodies at their ends."""
    rates = module.rhs(motion.t, motion.x, u=motion.u)[: module.n_q]
    q, step = motion.x[: module.n_q], STEP / max(float(np.abs(rates).max(initial=0.0)), 1.0)
    sides = []
    for way in (step, -step):
        poses = np.moveaxis(module.poses(q + way * rates, t=motion.t, u=motion.u), -1, 0)
        sides.append(np.concatenate([poses, scene.frames[:, -1:]], axis=1))
    result: list[Pull] = []
    for one in elements:
        stops = [frame for frame, _, _ in one["stops"]]
        length = _lengths(stops, scene.frames)
        rate = (_lengths(stops, sides[0]) - _lengths(stops, sides[1])) / (2.0 * step)
        force = one["points"](length, rate)[:, 0]
        for end, other in ((stops[-1], stops[-2]), (stops[0], stops[1])):
            if end.body != GROUND:
                away = _places(end, scene.frames) - _places(other, scene.frames)
                size = np.linalg.norm(away, axis=1)
                result.append((one["name"], end, away * (force / np.maximum(size, NOTHING))[:, None]))
    return result


def _places(frame: PlacedFrame, frames: Array) -> Array:
    return np.array([placed(poses, frame)[1] for poses in frames])


def _lengths(stops: Sequence[PlacedFrame], frames: Array) -> Array:
    """Length of the way from stop to stop over the frames (m)."""
    places = [_places(stop, frames) for stop in stops]
    every = [np.linalg.norm(b - a, axis=1) for a, b in pairwise(places)]
    return np.asarray(np.sum(every, axis=0))


def _drawn(scene: Scene, pulls: Sequence[Pull]) -> Scene:
    """The scene with the arrows, all of one scale, the longest of which is told."""
    longest = max((float(np.linalg.norm(force, axis=1).max(initial=0.0)) for _, _, force in pulls), default=0.0)
    if longest == 0.0:
        return scene
    reach = ARROW * float(np.linalg.norm(scene.high - scene.low))
    items, paths = list(scene.items), []
    for name, frame, force in pulls:
        lines = arrows(_places(frame, scene.frames), force * reach / longest, scene.view)
        if scene.view is not None:  # in front of the links
            lines = lines + BEFORE * scene.symbol * scene.view[2]
        paths.append(lines.reshape(-1, 3))
        items.append(Item("arrow", name, GROUND, lines[0], path=lines))
    every = np.concatenate(paths)
    every = every if scene.view is None else every @ scene.view.T
    low, high = np.minimum(scene.low, every.min(axis=0)), np.maximum(scene.high, every.max(axis=0))
    return scene._replace(items=items, low=low, high=high, note=f"longest arrow {longest:.4g} N")


def arrows(tails: Array, ways: Array, view: Array | None) -> Array:
    """Lines (k, 5, 3) that look like arrows from tails (k, 3) along ways (k, 3)."""
    sides = np.cross(ways, np.eye(3)[0] if view is None else view[2])
    length = np.linalg.norm(ways, axis=1, keepdims=True)
    size = np.linalg.norm(sides, axis=1, keepdims=True)
    sides = np.where(size > SAME * length, sides * length / np.maximum(size, NOTHING), np.roll(ways, 1, axis=1))
    tips = tails + ways
    left, right = (tips - HEAD * (ways + side * 0.6 * sides) for side in (1.0, -1.0))
    return np.stack([tails, tips, left, tips, right], axis=1)


# -- animations --------------------------------------------------------------------------------------------------------


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
            f"forces must be True, the name of a joint, spring or damper, or a list of names, not {quote(forces)}"
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
    curves = [FrameColumn(printed(n), units.get(n, ""), over, row, n) for n, row in values.items()]
    return write(module, file, scene, motion, curves, dpi, format)


def write(
    module: Any,
    file: Path | str | None,
    scene: Scene,
    motion: MotionFrames,
    curves: Sequence[FrameColumn] = (),
    dpi: float = DPI,
    format: str | None = None,
) -> Any:
    """Write an animation as its ending says; without a file, something that a notebook shows."""
    if isinstance(dpi, bool) or not isinstance(dpi, int | float) or not 1.0 <= dpi <= MOST_DOTS:
        raise off_range(f"dpi must be a number from 1 to {MOST_DOTS:g}, not {quote(dpi)}")
    if format in FILMS:
        return InlineFilm(FILMS[format](Frames.of(scene, motion, curves, dpi)), format)
    path = None if file is None else as_path("file", file)
    kind = "" if path is None else kind_of(path)
    if path is None or kind == ".html":
        text = page_html(module, scene, motion, curves)
        if path is None:
            return InlinePage(text)
        with whole_file(path) as handle:
            handle.write(text.encode())
        return path
    WRITERS[kind](path, Frames.of(scene, motion, curves, dpi))
    return path


# -- mode shapes -------------------------------------------------------------------------------------------------------


PERIOD = 2.0  #: seconds in which a mode is shown
FPS = 12.0  #: of the pictures in a notebook
SWING = 0.15  #: of the extent: the largest displacement of a point that is shown
TURN = 0.5  #: the largest angle by which a body turns (rad)
TRIES = 6  #: halvings of a swing that the loops do not allow
CELL = 3.0  #: edge of a picture in a row (inch)


def swing(module: Any, x: Array, direction: Array, count: int) -> Array:
    """States (n_x, count) over one period of a mode about x, its loops closed."""
    n = module.n_q
    size = amplitude(module, x[:n], direction)
    turns = np.sin(2.0 * np.pi * np.arange(count) / count)
    for _ in range(TRIES):
        q = x[:n, None] + size * direction[:, None] * turns
        states = np.concatenate([q, np.zeros((module.layout.n_v, count))])
        try:
            return np.asarray(module.project(states)) if module.n_rows or module.layout.space else states
        except EvaluationError:
            size *= 0.5
    return np.repeat(x[:, None], count, axis=1)


def amplitude(module: Any, q: Array, direction: Array) -> float:
    """The factor of a displacement with which no point moves and no body turns more than is well seen."""
    data = read_picture(module.metadata, module.p)
    top = max(float(np.abs(direction).max()), np.finfo(float).tiny)
    step = STEP / top
    before, after = module.poses(q), module.poses(q + step * direction)
    points = attachments(data)
    moved, places = 0.0, []
    for k in range(len(data.bodies)):
        outline = np.array([*points[k], data.com[k]])
        here, there = (pose[k, :3, :3] @ outline.T + pose[k, :3, 3:] for pose in (before, after))
        moved = max(moved, float(np.linalg.norm(there - here, axis=0).max()) / step)
        places.append(here.T)
    every = np.vstack([*places, *([np.array(points[-1])] if len(points[-1]) else [])])
    extent = float(np.linalg.norm(np.ptp(every, axis=0)))
    turned = float(np.abs(after[:, :3, :3] - before[:, :3, :3]).max()) / step
    limits = [SWING * extent / moved] if extent > 0.0 and moved > 0.0 else []
    limits += [TURN / turned] if turned > 0.0 else []
    return min(limits, default=1.0 / top)


def mode_scene(module: Any, x: Array, shape: tuple[Array, str], count: int, **look: Any) -> tuple[Scene, MotionFrames]:
    """The scene of a mode, a direction and what is written above it, over one period."""
    direction, title = shape
    states = swing(module, x, direction, count)
    t = PERIOD * np.arange(count) / count
    scene = build_scene(module, states[: module.n_q], 0.0, **look)
    return scene, MotionFrames(t, states, None, 1.0, count / PERIOD, [title] * count, t)


def animate_mode(
    module: Any,
    x: Array,
    shape: tuple[Array, str],
    file: Path | str | None,
    *,
    format: str | None = None,
    fps: float = 25.0,
    names: bool | None = None,
    axes: bool = False,
    trace: Sequence[str] | str = (),
    dpi: float = DPI,
) -> Any:
    """See :meth:`eomgen.analysis.modes.Modes.animate`."""
    require_target(file, format)
    look = {"names": names, "axes": axes, "trace": (trace,) if isinstance(trace, str) else tuple(trace)}
    scene, motion = mode_scene(module, x, shape, max(2, round(fps * PERIOD)), **look)
    return write(module, file, scene, motion, dpi=dpi, format=format)


def swinging_gif(module: Any, x: Array, shapes: Sequence[tuple[Array, str]]) -> bytes:
    """Several modes side by side, as a GIF."""
    figures = matplotlib("figure", "a picture")
    count = round(FPS * PERIOD)
    made = [mode_scene(module, x, shape, count, names=False, quiet=True) for shape in shapes]
    figure = figures.Figure(figsize=(CELL * len(made), CELL + 0.3), dpi=72, layout="constrained")
    frames = Frames(figure, made[0][1])
    for k, ((scene, _), (_, title)) in enumerate(zip(made, shapes, strict=True)):
        spatial = {} if scene.view is not None else {"projection": "3d"}
        ax = figure.add_subplot(1, len(made), k + 1, **spatial)
        frames.add_scene(scene, ax, title)
        ax.set(xlabel="", ylabel="", **({} if scene.view is not None else {"zlabel": ""}))
        ax.tick_params(labelbottom=False, labelleft=False)
    frames.settle()
    return gif_bytes(frames)
