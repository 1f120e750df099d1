"""Stage show, joints: the symbols of joints, their rails and cylinders, and the hatching where they stand on ground."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..base.algebra import Array
from ..base.limits.pictures import SAME
from ..base.picture_data import GROUND, JointData, PictureData, PlacedFrame
from .scene import BAR, Item, _is_block, attached, placed, symbol_mesh
from .solids import Mesh, cone, turned

GAP = np.full((1, 3), np.nan)


def joint_items(
    data: PictureData, view: Array | None, up: Array, symbol: float, frames: Array, q: dict[str, Array]
) -> list[Item]:
    """Items of all joints over the frames (k, n_bodies + 1, 4, 4); q has coordinates (k,) by name."""
    items: list[Item] = []
    for joint in data.joints:
        fixed = joint.P if joint.P.body == GROUND else joint.S if joint.S.body == GROUND else None
        block = joint.slides and _is_block(data, joint, symbol)
        if joint.slides and not block:
            items += _telescope(joint, symbol, frames[0])
        else:
            if block:
                items += _rail(joint, view, up, symbol, frames)
            elif fixed is not None and joint.pieces and joint.guide is None:
                items += _support(joint.name, fixed, view, up, symbol)
            for shape, sizes, axis, on in joint.pieces:
                frame = joint.P if on == "P" else joint.S
                mesh = attached(frame, symbol_mesh(shape, sizes, axis, symbol))
                items.append(Item("block" if block else "joint", joint.name, frame.body, *mesh))
        if joint.bar:
            items.append(_bar(joint, symbol, frames[0]))
        if joint.guide is not None:
            items += _guide(joint, symbol, q)
    return items


def _rail(joint: JointData, view: Array | None, up: Array, symbol: float, frames: Array) -> list[Item]:
    """The straight line on which S slides, as long as the way of S over the frames."""
    P, S = joint.P, joint.S
    if P.body != GROUND and S.body == GROUND:  # the rail is what stands
        P, S = S, P
    heights = []
    for poses in frames:
        turn, origin = placed(poses, P)
        heights.append(float(turn[:, 2] @ (placed(poses, S)[1] - origin)))
    low, high = min(heights) - 5.0 * symbol, max(heights) + 5.0 * symbol
    if P.body != GROUND:
        low, high = min(low, 0.0), max(high, 0.0)
    axis = P.rotation[:, 2]
    line = np.array([P.position + low * axis, P.position + high * axis])
    if P.body != GROUND or view is None:
        items = [Item("rail", joint.name, P.body, *_rod(line, 0.35 * symbol))]
        if P.body == GROUND:
            ends = [_cube(end, symbol) for end in line]
            items += [Item("hatch", joint.name, GROUND, *end) for end in ends]
        return items
    normal = view[2]
    down = np.cross(normal, axis)
    down /= np.linalg.norm(down)
    if down @ up > SAME or (abs(float(down @ up)) <= SAME and down @ view[0] > 0.0):
        down = -down
    shifted = line + 1.1 * symbol * down
    return [_hatching(joint.name, shifted[0], shifted[1], down, symbol)]


def _hatching(name: str, start: Array, end: Array, down: Array, symbol: float) -> Item:
    """A line with short strokes on the side of the ground."""
    along = end - start
    length = float(np.linalg.norm(along))
    along = along / length
    lines = [np.array([start, end])]
    for s in np.arange(0.5 * symbol, length, 0.9 * symbol):
        foot = start + s * along
        lines += [GAP, np.array([foot, foot + 0.8 * symbol * (down - along)])]
    return Item("hatch", name, GROUND, np.vstack(lines))


def _support(name: str, frame: PlacedFrame, view: Array | None, up: Array, symbol: float) -> list[Item]:
    """A bearing on ground: a triangle over hatching; in space a cone."""
    origin = frame.position
    if view is None:
        vertices, faces = cone(2.0 * symbol, 2.6 * symbol)
        turn = _upright(up)
        return [Item("hatch", name, GROUND, (vertices - [0, 0, 2.6 * symbol]) @ turn.T + origin, faces)]
    right = view[0]
    corners = np.array(
        [origin, origin - 2.4 * symbol * up - 1.5 * symbol * right, origin - 2.4 * symbol * up + 1.5 * symbol * right]
    )
    foot = origin - 2.4 * symbol * up
    hatch = _hatching(name, foot - 2.4 * symbol * right, foot + 2.4 * symbol * right, -up, symbol)
    return [Item("hatch", name, GROUND, corners[[0, 1, 2, 0]]), hatch]


def wall_items(data: PictureData, view: Array | None, symbol: float, poses: Array) -> list[Item]:
    """Hatching where force elements are held by ground."""
    items: list[Item] = []
    bearings = [f.position for j in data.joints if j.pieces and not j.slides for f in (j.P, j.S) if f.body == GROUND]
    for element in data.elements:
        stops = element.get("stops", ())
        if len(stops) < 2 or (view is None and all(stop.body == GROUND for stop, _, _ in stops)):
            continue  # or it is ground itself, whose lines would be cubes at every end
        for (stop, _, _), (other, _, _) in ((stops[0], stops[1]), (stops[-1], stops[-2])):
            here = stop.position
            if stop.body != GROUND or any(np.abs(here - b).max() < symbol for b in bearings):
                continue
            bearings.append(here)
            away = here - placed(poses, other)[1]
            if view is None:
                items.append(Item("hatch", element["name"], GROUND, *_cube(here, symbol)))
                continue
            away = away - (away @ view[2]) * view[2]
            length = float(np.linalg.norm(away))
            away = -view[1] if length == 0.0 else away / length
            across = np.cross(view[2], away)
            reach = 2.2 * symbol
            items.append(_hatching(element["name"], here - reach * across, here + reach * across, away, symbol))
    return items


def _cube(center: Array, symbol: float) -> Mesh:
    from .solids import box

    vertices, faces = box((1.6 * symbol,) * 3)
    return vertices + center, faces


def _upright(up: Array) -> Array:
    """A rotation that brings z upwards."""
    other = np.eye(3)[int(np.argmin(np.abs(up)))]
    x = np.cross(other, up)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(up, x), up])


def _rod(line: Array, radius: float) -> Mesh:
    """A round bar along a line (2, 3)."""
    along = line[1] - line[0]
    length = float(np.linalg.norm(along))
    vertices, faces = turned((radius, radius), (0.0, length), 12)
    return vertices @ _upright(along / length).T + line[0], faces


def between(
    start: Callable[[Array], Array], end: Callable[[Array], Array], radius: float, part: tuple[float, float]
) -> Callable[[Array], Array]:
    """Vertices of a round bar over a part of the way between two points that move."""

    def points(poses: Array) -> Array:
        a, b = start(poses), end(poses)
        along = b - a
        if float(np.linalg.norm(along)) < radius:
            along = np.array([0.0, 0.0, radius])
        return _rod(np.array([a + part[0] * along, a + part[1] * along]), radius)[0]

    return points


def _origin(frame: PlacedFrame) -> Callable[[Array], Array]:
    return lambda poses: placed(poses, frame)[1]


def _telescope(joint: JointData, symbol: float, poses: Array) -> list[Item]:
    """A cylinder on P and its rod on S."""
    items = []
    for radius, part, body in ((1.1, (0.0, 0.6), joint.P.body), (0.5, (0.5, 1.0), joint.S.body)):
        follow = between(_origin(joint.P), _origin(joint.S), radius * symbol, part)
        points = follow(poses)
        faces = turned((1.0, 1.0), (0.0, 1.0), 12)[1]
        items.append(Item("link", joint.name, body, points, faces, follow))
    return items


def _bar(joint: JointData, symbol: float, poses: Array) -> Item:
    """A rod without mass."""
    follow = between(_origin(joint.P), _origin(joint.S), BAR * symbol, (0.0, 1.0))
    return Item("link", joint.name, GROUND, follow(poses), turned((1.0, 1.0), (0.0, 1.0), 12)[1], follow)


def _guide(joint: JointData, symbol: float, q: dict[str, Array]) -> list[Item]:
    """The curve, or a net of the surface, on which S is led; about as far as it goes over the frames."""
    assert joint.guide is not None
    spans = []
    for name in joint.coordinates[: joint.running]:
        low, high = float(q[name].min()), float(q[name].max())
        more = max(0.3 * (high - low), 1.0)
        spans.append(np.linspace(low - more, high + more, 121))
    if joint.running == 1:
        lines = [joint.guide(spans[0])]
    else:
        u, v = spans
        lines = [joint.guide(np.full_like(v, x), v) for x in u[::20]] + [
            joint.guide(u, np.full_like(u, x)) for x in v[::20]
        ]
    points = np.vstack([part for line in lines for part in (move_frame(joint.P, line), GAP)])
    return [Item("rail", joint.name, joint.P.body, points)]


def move_frame(frame: PlacedFrame, points: Array) -> Array:
    """Points of a frame in axes of its body."""
    moved: Array = points @ frame.rotation.T + frame.position
    return moved
