"""Stage show, motion: a trajectory -> frames at even times, its loops closed, and the scene over them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..errors import UsageError
from ..limits.pictures import NOTHING, ROUNDED, SAME
from ..notation.labels import TIME, label
from ..notation.notation import Notation
from .build_scene import build_scene
from .data import GROUND, Array, read_picture
from .scene import Item, Scene, placed

LONGEST = 12.0  #: seconds that an animation lasts, unless a speed is given
SHORTEST = 3.0
FRAMES = 1500  #: at most
POINTS = 400  #: of the way of a marker, at least
ARROW = 0.2  #: length of the longest arrow, of the picture's diagonal
HEAD = 0.22  #: of an arrow's length
BEFORE = 3.0  #: distance of arrows in front of a planar mechanism, in sizes of a symbol

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
        What is written above each frame.
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
            raise UsageError(f"{name} must be a number greater than 0, not {value!r}")
    t = trajectory.t
    if len(t) < 2:
        raise UsageError("the run has one point only; draw its state with module.draw(x)")
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
        raise UsageError(
            f"{count} frames, of which an animation has at most {FRAMES}: give a speed of {span * fps / FRAMES:.3g} or "
            "more, a lower fps, or a shorter run"
        )
    times = np.linspace(start, end, max(count, 2))
    slow = "" if abs(speed - 1.0) < ROUNDED else f"  x{speed:.2g}"
    digits = max(2, 2 - int(np.floor(np.log10(span))))
    return ShownMotion(times, *states(times), speed, fps, [f"t = {now:.{digits}f} s{slow}" for now in times], times)


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


def with_arrows(scene: Scene, module: Any, motion: ShownMotion, joints: Sequence[str] | bool) -> Scene:
    """The scene with an arrow at each joint: the force that it exerts on its successor, over the frames.

    Raises
    ------
    UsageError
        An unknown joint, or a model without joints.
    """
    known = module.joint_names
    if not isinstance(joints, bool):
        for name in joints:
            if name not in known:
                raise UsageError(f"no joint {name!r} whose force is to be shown; there are {', '.join(known)}")
    chosen = [k for k, name in enumerate(known) if joints is True or (joints and name in joints)]
    forces = module.reactions(motion.t, motion.x, u=motion.u)[chosen, :3]
    forces = np.where(np.isfinite(forces), forces, 0.0)
    longest = float(np.linalg.norm(forces, axis=1).max(initial=0.0))
    if longest == 0.0:
        return scene
    reach = ARROW * float(np.linalg.norm(scene.high - scene.low))
    data = read_picture(module.metadata, module.p)
    frames = {joint.name: joint.S for joint in data.joints}
    items, paths = list(scene.items), []
    for force, k in zip(forces, chosen, strict=True):
        tails = np.array([placed(poses, frames[known[k]])[1] for poses in scene.frames])
        lines = arrows(tails, force.T * reach / longest, scene.view)
        if scene.view is not None:  # in front of the links
            lines = lines + BEFORE * scene.symbol * scene.view[2]
        paths.append(lines.reshape(-1, 3))
        items.append(Item("arrow", known[k], GROUND, lines[0], path=lines))
    every = np.concatenate(paths)
    every = every if scene.view is None else every @ scene.view.T
    low, high = np.minimum(scene.low, every.min(axis=0)), np.maximum(scene.high, every.max(axis=0))
    return scene._replace(items=items, low=low, high=high, note=f"longest arrow {longest:.4g} N")


def arrows(tails: Array, ways: Array, view: Array | None) -> Array:
    """Lines (k, 5, 3) that look like arrows from tails (k, 3) along ways (k, 3)."""
    across = np.cross(ways, np.eye(3)[0] if view is None else view[2])
    length = np.linalg.norm(ways, axis=1, keepdims=True)
    size = np.linalg.norm(across, axis=1, keepdims=True)
    across = np.where(size > SAME * length, across * length / np.maximum(size, NOTHING), np.roll(ways, 1, axis=1))
    tips = tails + ways
    left, right = (tips - HEAD * (ways + side * 0.6 * across) for side in (1.0, -1.0))
    return np.stack([tails, tips, left, tips, right], axis=1)
