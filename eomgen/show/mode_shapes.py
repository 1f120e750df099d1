"""Stage show, mode shapes: displacements about an equilibrium -> a swinging mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.pictures import STEP
from ..base.picture_data import read_picture
from ..errors import EvaluationError
from .animate import write
from .build_scene import build_scene
from .film_frames import DPI, Frames
from .optional import matplotlib
from .scene import Scene, attachments
from .shown_motion import ShownMotion
from .writers import gif_bytes, require_target

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
        own = np.array([*points[k], data.com[k]])
        here, there = (pose[k, :3, :3] @ own.T + pose[k, :3, 3:] for pose in (before, after))
        moved = max(moved, float(np.linalg.norm(there - here, axis=0).max()) / step)
        places.append(here.T)
    every = np.vstack([*places, *([np.array(points[-1])] if len(points[-1]) else [])])
    extent = float(np.linalg.norm(np.ptp(every, axis=0)))
    turned = float(np.abs(after[:, :3, :3] - before[:, :3, :3]).max()) / step
    limits = [SWING * extent / moved] if extent > 0.0 and moved > 0.0 else []
    limits += [TURN / turned] if turned > 0.0 else []
    return min(limits, default=1.0 / top)


def mode_scene(module: Any, x: Array, shape: tuple[Array, str], count: int, **look: Any) -> tuple[Scene, ShownMotion]:
    """The scene of a mode, a direction and what is written above it, over one period."""
    direction, title = shape
    states = swing(module, x, direction, count)
    t = PERIOD * np.arange(count) / count
    scene = build_scene(module, states[: module.n_q], 0.0, **look)
    return scene, ShownMotion(t, states, None, 1.0, count / PERIOD, [title] * count, t)


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
    return write(file, scene, motion, dpi=dpi, format=format)


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
