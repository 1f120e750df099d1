"""Stage show, motion: a trajectory -> frames at even times, its loops closed, and the scene over them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..base.algebra import Array
from ..base.limits.pictures import ROUNDED
from ..base.notation import TIME, Notation, label
from ..errors import cannot, off_range, too_large
from .build_scene import build_scene
from .scene import Scene

LONGEST = 12.0  #: seconds that an animation lasts, unless a speed is given
SHORTEST = 3.0
FRAMES = 1500  #: at most
POINTS = 400  #: of the way of a marker, at least

#: Times (k,) -> states (n_x, k) and inputs (n_u, k) or None.
States = Callable[[Array], tuple[Array, Array | None]]


class ShownMotion(NamedTuple):
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
    words : list of str
        What is written above each frame: its time, or the coordinate that is led.
    over : (k,) array
        Time, or the coordinate that is led where time stands still.
    across : str
        How the latter is printed at an axis.
    """

    t: Array
    x: Array
    u: Array | None
    speed: float
    fps: float
    words: list[str]
    over: Array
    across: str = TIME

    @property
    def pace(self) -> str:
        """What is written beside the time of a film that runs slower or faster than the mechanism."""
        return "" if abs(self.speed - 1.0) < ROUNDED else f"  x{self.speed:.2g}"

    @property
    def clock(self) -> Array:
        """Seconds of the animation at each frame."""
        return np.arange(len(self.t)) / self.fps if self.t[0] == self.t[-1] else np.abs(self.t - self.t[0]) / self.speed


def sample(trajectory: Any, states: States, fps: float, speed: float | None) -> ShownMotion:
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
        led = trajectory.metadata.get("led") or trajectory.x_names[:1]
        over, unit = trajectory[led[0]], trajectory.units.get(led[0], "")
        said = [f"{led[0]} = {value:.3f} {unit}" for value in over]
        across = label(Notation.of(trajectory.metadata).mathtext(led[0]), unit)
        return ShownMotion(t, trajectory.x, None, 1.0, max(fps, len(t) / LONGEST), said, over, across)
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
    return ShownMotion(times, *states(times), speed, fps, [f"t = {now:.{digits}f} s" for now in times], times)


def moving_scene(module: Any, motion: ShownMotion, names: bool | None, axes: bool, trace: Sequence[str]) -> Scene:
    """The scene over all frames."""
    return build_scene(module, motion.x[: module.n_q], motion.t, motion.u, names, axes, trace)


def with_fine_traces(scene: Scene, module: Any, motion: ShownMotion, states: States, trace: Sequence[str]) -> Scene:
    """The scene with the ways of markers through several points a frame, so that they look round at any rate."""
    finer = int(np.ceil(POINTS / (len(motion.t) - 1)))
    times = np.linspace(motion.t[0], motion.t[-1], finer * (len(motion.t) - 1) + 1)
    x, u = states(times)
    fine = build_scene(module, x[: module.n_q], times, u, False, False, trace)
    ways = [item for item in fine.items if item.role == "trace"]
    rest = [item for item in scene.items if item.role != "trace"]
    low, high = np.minimum(scene.low, fine.low), np.maximum(scene.high, fine.high)
    return scene._replace(items=[*rest, *ways], low=low, high=high)
