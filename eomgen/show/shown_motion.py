"""Stage show, motion: a trajectory -> frames at even times, its loops closed, and the scene over them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..errors import UsageError
from .build_scene import build_scene
from .data import Array
from .scene import Scene

LONGEST = 12.0  #: seconds that an animation lasts, unless a speed is given
SHORTEST = 3.0
FRAMES = 1500  #: at most

#: Times (k,) -> states (n_x, k) and inputs (n_u, k) or None.
States = Callable[[Array], tuple[Array, Array | None]]


class ShownMotion(NamedTuple):
    """Times (k,) of the run at the frames (s), states (n_x, k), inputs (n_u, k) or None, and how fast time goes."""

    t: Array
    x: Array
    u: Array | None
    speed: float
    fps: float


def sample(trajectory: Any, states: States, fps: float, speed: float | None) -> ShownMotion:
    """Frames of a trajectory at even times, of the states that the runtime gives there.

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
    return ShownMotion(times, *states(times), speed, fps)


def moving_scene(module: Any, motion: ShownMotion, names: bool | None, axes: bool, trace: Sequence[str]) -> Scene:
    """The scene over all frames."""
    return build_scene(module, motion.x[: module.n_q], motion.t, motion.u, names, axes, trace)
