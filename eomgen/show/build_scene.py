"""A module and states -> a Scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.picture_data import GROUND, PictureData, PlacedFrame, read_picture
from ..base.texts import hint
from ..errors import no_such, not_finite
from .limits import ROUNDED, SAME
from .scene import Item, Label, Scene, attachments, distinct, find_view, frame_items, link_items, placed, symbol_size
from .symbols import element_items, joint_items, wall_items

MARGIN = 0.06  #: of the extent, around the picture
LEAST = 0.4  #: shortest edge over the longest
MANY = 14  #: names more than which are left out unless requested


def build_scene(
    module: Any,
    q: Array,
    t: Array | float = 0.0,
    u: Array | None = None,
    names: bool | None = None,
    axes: bool = False,
    trace: Sequence[str] = (),
    quiet: bool = False,
    like: Scene | None = None,
) -> Scene:
    """The scene of a module over frames.

    Parameters
    ----------
    module : Module
        With the parameters bound that lengths depend on.
    q : (n_q, k) array
        Coordinates of the frames.
    t : float or (k,) array
        Their times (s).
    u : (n_u, k) array, optional
        Inputs over the frames.
    names : bool, optional
        Whether bodies and joints are named; by default where there are few of them.
    axes : bool
        Whether the axes of all bodies are drawn.
    trace : sequence of str
        Markers (``rod.tip``) or bodies, whose ways over the frames are drawn.
    quiet : bool
        Without warnings about meshes that cannot be drawn, where nobody requested a picture.
    like : Scene, optional
        With the view and the size of symbols of another scene.
    """
    data = read_picture(module.metadata, module.p)
    layout = module.layout
    tracked = [
        _tracked(data, module.layout.plain(name)) for name in trace
    ]  # unknown names fail before anything is evaluated
    poses = module.poses(q, t=t, u=u)
    if not np.isfinite(poses).all():
        raise not_finite(
            "the poses of the bodies are not finite at this position; give finite coordinates within the model's reach"
        )
    frames = _with_ground(poses)
    start = np.array(q[:, 0])
    quaternions = [i for i, _ in layout.quaternion_slots]
    view = like.view if like else find_view(lambda at: np.asarray(module.poses(at)), start, quaternions, data.gravity)
    up = _up(data.gravity) if view is None else view[1]
    points = attachments(data)
    symbol, extent = symbol_size(data, points, frames[0])
    symbol = like.symbol if like else symbol
    known = {name: q[k] for k, name in enumerate(layout.q)}
    items = link_items(data, points, symbol, extent, _model_file(module), quiet)
    items += joint_items(data, view, up, symbol, frames, known)
    items += wall_items(data, view, symbol, frames[0])
    items += element_items(data, view, symbol, frames)
    if axes:
        items += frame_items(data, symbol)
    for name, marker in zip(trace, tracked, strict=True):
        way = np.array([placed(now, marker)[1] for now in frames])
        items.append(Item("trace", name, GROUND, way))
    named = len(data.bodies) + len(data.joints) <= MANY if names is None else names
    labels = _labels(data, points) if named else []
    low, high = _bounds(items, frames, view)
    return Scene(data.name, items, labels, view, up, symbol, frames, low, high)


def _tracked(data: PictureData, name: str) -> PlacedFrame:
    """The frame of a marker or a body."""
    if name in data.markers:
        return data.markers[name]
    if name in data.bodies:
        return PlacedFrame(data.bodies.index(name), np.eye(3), np.zeros(3))
    known = [*data.markers, *data.bodies]
    near = hint(name, known, quoted=False) or f"there are {', '.join(known)}"
    raise no_such(f"no marker or body {name!r} to trace; {near}")


def _model_file(module: Any) -> str | None:
    """The file that the model was read from, empty for one that was built in Python; None if that is not known."""
    equations = getattr(module, "equations", None)
    return None if equations is None else equations.kinematics.mechanism.lines.get("", ("", 0))[0]


def _with_ground(poses: Array) -> Array:
    """Poses (n, 4, 4, k) as (k, n + 1, 4, 4), ground last."""
    frames = np.moveaxis(poses, -1, 0)
    ground = np.broadcast_to(np.eye(4), (len(frames), 1, 4, 4))
    return np.concatenate([frames, ground], axis=1)


def _up(gravity: Array) -> Array:
    """Upwards: against gravity where it is along an axis, else z."""
    strength = float(np.linalg.norm(gravity))
    if strength and float(np.abs(gravity).max()) > (1.0 - SAME) * strength:
        up: Array = -gravity / strength
        return np.round(up)
    return np.array([0.0, 0.0, 1.0])


def _labels(data: PictureData, points: list[Array]) -> list[Label]:
    labels: list[Label] = []
    at: dict[tuple[Any, ...], list[str]] = {}
    for joint in data.joints:
        if joint.pieces:  # joints on one pin are named together
            frames = [frame for frame in (joint.P, joint.S) if frame.body != GROUND]
            keys = [(frame.body, *np.round(frame.position, 9).tolist()) for frame in frames]
            at.setdefault(next((key for key in keys if key in at), keys[0]), []).append(joint.name)
    labels += [Label(", ".join(names), key[0], np.array(key[1:]), "joint") for key, names in at.items()]
    for k, name in enumerate(data.bodies):
        if k in data.hidden:
            continue
        places = distinct(points[k], ROUNDED)
        middle = data.com[k] if data.mass[k] > 0.0 or not len(places) else places.mean(axis=0)
        if len(places) >= 2:
            middle = places.mean(axis=0)
        labels.append(Label(name, k, middle, "body"))
    return labels


def _bounds(items: list[Item], frames: Array, view: Array | None) -> tuple[Array, Array]:
    """Corners of the box that holds all items over the frames, with a margin."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    chosen = frames[np.unique(np.linspace(0, len(frames) - 1, 60).astype(int))]
    for item in items:
        for poses in chosen if item.role != "trace" and (item.body != GROUND or item.follow) else chosen[:1]:
            points = item.at(poses)
            points = points[np.isfinite(points).all(axis=1)]
            if view is not None:
                points = points @ view.T
            if len(points):
                low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
    axes = slice(0, 2) if view is not None else slice(0, 3)
    short = np.maximum(LEAST * float((high - low)[axes].max()) - (high - low)[axes], 0.0) / 2  # neither strip nor sheet
    low[axes] -= short
    high[axes] += short
    margin = MARGIN * max(float((high - low).max()), ROUNDED)
    return low - margin, high + margin
