"""Stage show, arrows: a moving Scene -> the same with arrows of the forces of joints, springs and dampers."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.pictures import NOTHING, SAME, STEP
from ..base.picture_data import GROUND, PlacedFrame, read_picture
from ..errors import no_such
from .scene import Item, Scene, placed
from .shown_motion import ShownMotion

ARROW = 0.2  #: length of the longest arrow, of the picture's diagonal
HEAD = 0.22  #: of an arrow's length
BEFORE = 3.0  #: distance of arrows in front of a planar mechanism, in sizes of a symbol

#: What an arrow belongs to, the frame in whose origin it begins, and its force over the frames (k, 3), ground axes (N).
Pull = tuple[str, PlacedFrame, Array]


def with_arrows(scene: Scene, module: Any, motion: ShownMotion, wanted: Sequence[str] | bool) -> Scene:
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
                raise no_such(
                    f"no joint, spring or damper {name!r} whose force is to be shown; there are {', '.join(known)}"
                )

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


def _of_elements(elements: Sequence[dict[str, Any]], scene: Scene, module: Any, motion: ShownMotion) -> list[Pull]:
    """Forces of springs and dampers on the bodies at their ends."""
    rates = module.rhs(motion.t, motion.x, u=motion.u)[: module.n_q]
    q, step = motion.x[: module.n_q], STEP / max(float(np.abs(rates).max(initial=0.0)), 1.0)
    sides = []
    for way in (step, -step):
        poses = np.moveaxis(module.poses(q + way * rates, t=motion.t, u=motion.u), -1, 0)
        sides.append(np.concatenate([poses, scene.frames[:, -1:]], axis=1))
    found: list[Pull] = []
    for one in elements:
        stops = [frame for frame, _, _ in one["stops"]]
        length = _lengths(stops, scene.frames)
        rate = (_lengths(stops, sides[0]) - _lengths(stops, sides[1])) / (2.0 * step)
        force = one["points"](length, rate)[:, 0]
        for end, other in ((stops[-1], stops[-2]), (stops[0], stops[1])):
            if end.body != GROUND:
                away = _places(end, scene.frames) - _places(other, scene.frames)
                size = np.linalg.norm(away, axis=1)
                found.append((one["name"], end, away * (force / np.maximum(size, NOTHING))[:, None]))
    return found


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
    across = np.cross(ways, np.eye(3)[0] if view is None else view[2])
    length = np.linalg.norm(ways, axis=1, keepdims=True)
    size = np.linalg.norm(across, axis=1, keepdims=True)
    across = np.where(size > SAME * length, across * length / np.maximum(size, NOTHING), np.roll(ways, 1, axis=1))
    tips = tails + ways
    left, right = (tips - HEAD * (ways + side * 0.6 * across) for side in (1.0, -1.0))
    return np.stack([tails, tips, left, tips, right], axis=1)
