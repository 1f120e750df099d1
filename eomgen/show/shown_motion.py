"""Stage show, motion: a trajectory -> frames at even times, its loops closed, and the scene over them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..errors import UsageError
from .build_scene import build_scene
from .data import Array
from .scene import Scene

LONGEST = 12.0  #: seconds that an animation lasts, unless a speed is given
SHORTEST = 3.0
FRAMES = 1500  #: at most


class ShownMotion(NamedTuple):
    """Times (k,) of the run at the frames (s), states (n_x, k), inputs (n_u, k) or None, and how fast time goes."""

    t: Array
    x: Array
    u: Array | None
    speed: float
    fps: float


def sample(trajectory: Any, module: Any, slopes: Array | None, fps: float, speed: float | None) -> ShownMotion:
    """Frames of a trajectory at even times.

    Between the steps of the run the dense output serves where it was kept, else a cubic through states and slopes,
    projected onto the constraints.

    Raises
    ------
    UsageError
        A rate or a speed that is not positive, more frames than there may be, or a run without duration.
    """
    for name, value in (("fps", fps), ("speed", speed)):
        if value is not None and not (isinstance(value, int | float) and 0.0 < value < np.inf):
            raise UsageError(f"{name} must be a number greater than 0, not {value!r}")
    t = trajectory.t
    if len(t) < 2:
        raise UsageError("the run has one point only; draw its state with module.draw(x)")
    if t[0] == t[-1]:  # a range of coordinates at one time
        return ShownMotion(t, trajectory.x, None, 1.0, max(fps, len(t) / LONGEST))
    start, end = float(t[0]), float(t[-1])
    span = abs(end - start)
    if speed is None:
        speed = max(span / LONGEST, min(1.0, span / SHORTEST))
    count = int(np.ceil(span / speed * fps)) + 1
    if count > FRAMES:
        raise UsageError(
            f"{count} frames, of which an animation has at most {FRAMES}: give a speed of {span * fps / FRAMES:.3g} or "
            "more, a lower fps, or a shorter run"
        )
    times = np.linspace(start, end, max(count, 2))
    return ShownMotion(times, *_states(trajectory, module, slopes, times), speed, fps)


def _states(trajectory: Any, module: Any, slopes: Array | None, times: Array) -> tuple[Array, Array | None]:
    names = module.layout.u
    if trajectory.has_dense_output:
        dense = trajectory.at(times)
        return dense.x, dense.to_numpy(*names) if names else None
    forward = trajectory.t[-1] > trajectory.t[0]
    order = slice(None) if forward else slice(None, None, -1)
    t, x = trajectory.t[order], trajectory.x[:, order]
    keep = np.concatenate([[True], np.diff(t) > 0.0])
    given = trajectory.to_numpy(*names)[:, order] if names else None
    u = None if given is None else np.array([np.interp(times, t, row) for row in given])
    if slopes is not None:
        from scipy.interpolate import CubicHermiteSpline

        states = CubicHermiteSpline(t[keep], x[:, keep], slopes[:, order][:, keep], axis=1)(times)
    else:
        states = np.array([np.interp(times, t[keep], row[keep]) for row in x])
    if module.n_rows or module.layout.space:
        states = module.project(states, t=times, u=u)
    return states, u


def moving_scene(module: Any, motion: ShownMotion, names: bool | None, axes: bool, trace: Sequence[str]) -> Scene:
    """The scene over all frames."""
    return build_scene(module, motion.x[: module.n_q], motion.t, motion.u, names, axes, trace)
