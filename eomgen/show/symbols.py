"""What joints, springs, dampers, cylinders, ropes, wheels, gears and cams look like."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.picture_data import GROUND, JointData, PictureData, PlacedFrame
from .limits import NOTHING, ROUNDED, SAME
from .scene import BAR, Item, _is_block, attached, attachments, disc, placed, symbol_mesh
from .solids import Mesh, cone, turned

# -- joints ------------------------------------------------------------------------------------------------------------


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
            items.append(_rod_between(joint, joint.name, GROUND, BAR * symbol, (0.0, 1.0), frames[0]))  # without mass
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
            along = np.cross(view[2], away)
            reach = 2.2 * symbol
            items.append(_hatching(element["name"], here - reach * along, here + reach * along, away, symbol))
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


@dataclass(frozen=True)
class Stretched:
    """Points along the way between two places that move: rows of the part of the way, and of lengths across it (m)."""

    start: PlacedFrame
    end: PlacedFrame
    shape: Array  #: (n, 3)
    view: Array | None

    def __call__(self, poses: Array) -> Array:
        (turn, a), (_, b) = placed(poses, self.start), placed(poses, self.end)
        way = b - a
        length = float(np.linalg.norm(way))
        side, other = _normals(way / length if length > 0.0 else turn[:, 2], self.view)
        points: Array = a + self.shape @ np.array([way, side, other])
        return points


@dataclass(frozen=True)
class Shifted:
    """Points (n, 3) around a place that moves, which do not turn (m, ground axes)."""

    frame: PlacedFrame
    shape: Array

    def __call__(self, poses: Array) -> Array:
        return placed(poses, self.frame)[1] + self.shape


def _rod_between(
    joint: JointData, name: str, body: int, radius: float, part: tuple[float, float], poses: Array
) -> Item:
    """A round bar over a part of the way from P to S."""
    vertices, faces = turned((1.0, 1.0), (0.0, 1.0), 12)
    shape = np.column_stack([part[0] + (part[1] - part[0]) * vertices[:, 2], radius * vertices[:, :2]])
    follow = Stretched(joint.P, joint.S, shape, None)
    return Item("link", name, body, follow(poses), faces, follow)


def _telescope(joint: JointData, symbol: float, poses: Array) -> list[Item]:
    """A cylinder on P and its rod on S."""
    parts = ((1.1, (0.0, 0.6), joint.P.body), (0.5, (0.5, 1.0), joint.S.body))
    return [_rod_between(joint, joint.name, body, radius * symbol, part, poses) for radius, part, body in parts]


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


# -- curves of cams ----------------------------------------------------------------------------------------------------


TURNS = ("revolute", "continuous")
BEYOND = 25.0  #: how far the curve of a cam that slides is drawn beyond its way, at least, in sizes of a symbol
WIDE = 0.75  #: half of a flat face, in the largest radius of its cam


def lift_items(data: PictureData, element: dict[str, Any], symbol: float, frames: Array) -> list[Item]:
    """The curve that a point of the follower describes on the cam: its origin where it slides, its end where it turns.

    A cam that turns is shown over one turn, one that slides as far as it moves over the frames (k, n, 4, 4).
    """
    a, b = data.joints[element["a"]], data.joints[element["b"]]
    if a.P.body != b.P.body or not all(one.type in (*TURNS, "prismatic") for one in (a, b)):
        return []
    way = _slid(a, symbol, frames) if a.slides else np.linspace(0.0, 2.0 * np.pi, 361) + float(element["phase"])
    s = element["points"](way - float(element["phase"]))[:, 0]
    (turn, center), (guide, start) = placed(frames[0], a.P), placed(frames[0], b.P)
    if b.slides:
        places = start + np.outer(s, guide[:, 2])
    else:
        end = _end(data, b)
        if end is None:
            return []
        places = start + _turned(np.tile(end, (len(s), 1)), s) @ guide.T
    points = (places - center) @ turn  # in axes of the cam's P, then of its S
    points = points - np.outer(way, [0.0, 0.0, 1.0]) if a.slides else _turned(points, -way)
    return [Item("wheel", element["name"], a.S.body, move_frame(a.S, points))]


def _slid(joint: JointData, symbol: float, frames: Array) -> Array:
    """Values of the coordinate of a slide over the frames, and beyond."""
    result = []
    for poses in frames:
        turn, origin = placed(poses, joint.P)
        result.append(float(turn[:, 2] @ (placed(poses, joint.S)[1] - origin)))
    more = max(0.3 * (max(result) - min(result)), BEYOND * symbol)
    return np.linspace(min(result) - more, max(result) + more, 361)


def _turned(points: Array, angles: Array) -> Array:
    """Points (n, 3), each turned about z by its angle."""
    c, s, (x, y, z) = np.cos(angles), np.sin(angles), points.T
    return np.column_stack([c * x - s * y, s * x + c * y, z])


def _end(data: PictureData, joint: JointData) -> Array | None:
    """The point of a body that is farthest from its joint's axis, in axes of the joint's S; None of a mere axis."""
    k = joint.S.body
    if k == GROUND:
        return None
    every = np.vstack([attachments(data)[k], data.com[k : k + 1] if data.mass[k] > 0.0 else np.empty((0, 3))])
    local = (every - joint.S.position) @ joint.S.rotation
    reach = np.hypot(local[:, 0], local[:, 1])
    far = int(np.argmax(reach))
    return local[far] if reach[far] > SAME else None


def contour_items(element: dict[str, Any], poses: Array) -> list[Item]:
    """A contour on its cam, and the flat face that touches it."""
    marker, name = element["marker"], element["name"]
    points = element["points"](np.linspace(element["low"], element["high"], 145))
    items = [Item("wheel", name, marker.body, move_frame(marker, points))]
    if element.get("face"):
        face = element["stops"][0][0]
        (turn, center), (rotation, place) = placed(poses, marker), placed(poses, face)
        along = np.cross(turn[:, 2], rotation[:, 2])
        half = WIDE * float(np.linalg.norm(points, axis=1).max())
        middle = float((center - place) @ along)
        ends = np.array([min(0.0, middle - half), max(0.0, middle + half)])
        line = (place + np.outer(ends, along) - poses[face.body, :3, 3]) @ poses[face.body, :3, :3]
        items.append(Item("wheel", name, face.body, line))
    return items


# -- force elements, wheels and gears ----------------------------------------------------------------------------------


TEETH = 24  #: of a pinion
RACK = 14  #: those of its rack that are drawn
WALL = 2.0  #: half the width of a stop, in sizes of a symbol
FAR = 75.0  #: and the distance beyond which one is not drawn: the picture is about 50 wide
LONG = 7.0  #: length of the arrow of a given force, in sizes of a symbol
BESIDE = 2.4  #: distance of elements between the same points, in sizes of a symbol


def element_items(data: PictureData, view: Array | None, symbol: float, frames: Array) -> list[Item]:
    """Items of all force elements and constraints that are to be seen, over frames (k, n_bodies + 1, 4, 4)."""
    items: list[Item] = []
    poses = frames[0]
    ways = [_ends(data, one) for one in data.elements]
    counts = Counter(way for way in ways if way is not None)
    met: Counter[Any] = Counter()
    for element, way in zip(data.elements, ways, strict=True):
        kind, name = element["kind"], element["name"]
        if kind == "lines":
            aside = 0.0
            if way is not None and counts[way] > 1:
                aside = BESIDE * symbol * (met[way] - 0.5 * (counts[way] - 1))
                met[way] += 1
            items += _lines(data, element, view, symbol, aside, poses)
        elif kind == "pull":
            items += _pull(element, view, symbol, poses)
        elif kind == "wheel":
            items += _wheel(name, element["marker"], float(element["radius"]), symbol)
        elif kind == "circles":
            items += _circles(data, element, symbol, poses)
        elif kind == "rack":
            items += _rack(data, element, symbol, poses)
        elif kind == "lift":
            items += lift_items(data, element, symbol, frames)
        elif kind == "contour":
            items += contour_items(element, poses)
    return items


def _frames(data: PictureData, element: dict[str, Any]) -> list[PlacedFrame]:
    """Where lines begin and end: markers, or those of the joint whose coordinate is meant."""
    stops = [stop for stop, _, _ in element.get("stops", ())]
    if stops or element.get("joint") is None:
        return stops
    joint = data.joints[element["joint"]]
    return [joint.P, joint.S]


def _ends(data: PictureData, element: dict[str, Any]) -> tuple[Any, ...] | None:
    """What tells the ends of lines along a way, so that those of the same ends stand side by side."""
    if element["kind"] != "lines" or not element["along"]:
        return None
    frames = _frames(data, element)
    if len(frames) < 2:
        return None
    return tuple(sorted((f.body, *np.round(f.position, 9).tolist()) for f in (frames[0], frames[-1])))


def _turns(data: PictureData, element: dict[str, Any]) -> bool:
    """Whether lines go about an angle."""
    if element.get("joint") is not None:
        joint = data.joints[element["joint"]]
        return not joint.slides or joint.type not in ("prismatic",)
    return len(element["stops"]) == 1


def _lines(
    data: PictureData, element: dict[str, Any], view: Array | None, symbol: float, aside: float, poses: Array
) -> list[Item]:
    name, frames = element["name"], _frames(data, element)
    if _turns(data, element):
        if not frames or not element["about"]:
            return []
        lines = [np.column_stack([symbol * np.asarray(line), np.zeros(len(line))]) for line in element["about"]]
        points = move_frame(frames[0], _broken(lines))
        return [Item("force", name, frames[0].body, points)]
    if element.get("walls"):
        lateral, _ = _normals(np.array([0.0, 0.0, 1.0]), None if view is None else view @ placed(poses, frames[0])[0])
        near = [z for z in element["walls"] if abs(z) <= FAR * symbol] or [0.0]
        lines = [np.array([[0.0, 0.0, z] + side * WALL * symbol * lateral for side in (1.0, -1.0)]) for z in near]
        return [Item("force", name, frames[0].body, move_frame(frames[0], _broken(lines)))]
    if len(frames) < 2 or (element.get("joint") is not None and not element["along"]):
        return []
    if not element["along"]:
        rope = Rope(element["stops"])
        return [Item("force", name, GROUND, rope(poses), None, rope)]
    shape = _broken([np.asarray(line) for line in element["along"]]) * [1.0, symbol, symbol] + [0.0, aside, 0.0]
    if aside:  # short legs to where the element is held
        ends = np.array([[0.0, 0.0, 0.0], [0.0, aside, 0.0], GAP[0], [1.0, aside, 0.0], [1.0, 0.0, 0.0]])
        shape = np.vstack([ends[:3], shape, ends[2:]])
    follow = Stretched(frames[0], frames[-1], shape, view)
    return [Item("force", name, GROUND, follow(poses), None, follow)]


def _pull(element: dict[str, Any], view: Array | None, symbol: float, poses: Array) -> list[Item]:
    """An arrow of a given force, whose head is where it acts, or a round one about the axis of a given torque."""
    marker, way = element["marker"], np.array(element["way"], dtype=float)
    size = float(np.linalg.norm(way))
    if size == 0.0 or not np.isfinite(size):
        return []
    shape = _broken([np.asarray(line) for line in element["lines"]])

    rotation, place = placed(poses, marker)
    along = (rotation @ way if element["own"] else way) / size
    side, other = _normals(along, view)
    if element["turns"]:  # counterclockwise, seen against the axis
        points = symbol * (shape[:, :1] * other + shape[:, 1:2] * np.cross(along, other))
    else:
        points = symbol * (LONG * (shape[:, :1] - 1.0) * along + shape[:, 1:2] * side)
    if element["own"]:  # it turns with its marker
        return [Item("pull", element["name"], marker.body, move_frame(marker, points @ rotation))]
    return [Item("pull", element["name"], GROUND, place + points, None, Shifted(marker, points))]


def _normals(along: Array, view: Array | None) -> tuple[Array, Array]:
    """Two unit vectors across a direction, the first on the page."""
    other = np.eye(3)[int(np.argmin(np.abs(along)))] if view is None else view[2]
    side = np.cross(other, along)
    length = float(np.linalg.norm(side))
    if length < ROUNDED:  # seen end on
        other = view[0] if view is not None else np.eye(3)[0]
        side = np.cross(other, along)
        length = float(np.linalg.norm(side))
    side = side / length
    return side, np.cross(along, side)


def _broken(lines: Sequence[Array]) -> Array:
    """Several lines in one, with gaps."""
    parts = []
    for line in lines:
        width = np.zeros((len(line), 3))
        width[:, : line.shape[1]] = line
        parts += [width, GAP]
    return np.vstack(parts[:-1])


@dataclass(frozen=True)
class Rope:
    """A line over markers and round cylinders; 25 points a cylinder, wound where it is touched."""

    stops: Sequence[tuple[PlacedFrame, float | None, int | None]]

    def __call__(self, poses: Array) -> Array:
        places = [placed(poses, frame)[1] for frame, _, _ in self.stops]
        result = [places[0][None]]
        for k, (frame, radius, sense) in enumerate(self.stops[1:], 1):
            if radius is None or k + 1 == len(self.stops):
                result.append(places[k][None])
            else:
                result.append(_wound(poses, frame, float(radius), int(sense or 1), places[k - 1], places[k + 1]))
        return np.vstack(result)


def _wound(poses: Array, frame: PlacedFrame, r: float, sense: int, a: Array, b: Array) -> Array:
    """Points where a taut string from a to b lies on a cylinder; on the straight line if it does not touch."""
    turn, center = placed(poses, frame)
    p, q = turn.T @ (a - center), turn.T @ (b - center)
    far = [float(np.hypot(*one[:2])) for one in (p, q)]
    part = np.linspace(0.0, 1.0, 25)[:, None]
    straight: Array = a + part * (b - a)
    if min(far) <= r:
        return straight
    begin = np.arctan2(p[1], p[0]) + sense * np.arccos(r / far[0])
    end = np.arctan2(q[1], q[0]) - sense * np.arccos(r / far[1])
    angle = sense * (end - begin) % (2 * np.pi)
    spans = np.array([np.sqrt(far[0] ** 2 - r * r), r * angle, np.sqrt(far[1] ** 2 - r * r)])
    direct = q[:2] - p[:2]
    closest = abs(p[0] * q[1] - p[1] * q[0]) / max(float(np.hypot(*direct)), NOTHING)
    ahead = -p[:2] @ direct > 0.0 and q[:2] @ direct > 0.0
    left = sense * (p[0] * q[1] - p[1] * q[0]) > 0.0
    if (angle > np.pi and not (ahead and closest < r)) or (not left and not (ahead and closest < r) and angle > np.pi):
        return straight
    angles = begin + sense * angle * part[:, 0]
    steps = (spans[0] + spans[1] * part[:, 0]) / spans.sum()
    local = np.column_stack([r * np.cos(angles), r * np.sin(angles), p[2] + (q[2] - p[2]) * steps])
    wound: Array = local @ turn.T + center
    return wound


def _wheel(name: str, marker: PlacedFrame, radius: float, symbol: float) -> list[Item]:
    """A wheel with two spokes, so that its turning is seen."""
    radius = abs(radius)
    items = [Item("wheel", name, marker.body, *attached(marker, disc(radius, min(symbol, 0.3 * radius))))]
    spokes = np.array([[-radius, 0, 0], [radius, 0, 0], [np.nan] * 3, [0, -radius, 0], [0, radius, 0]])
    items.append(Item("wheel", name, marker.body, move_frame(marker, spokes)))
    return items


def _circles(data: PictureData, element: dict[str, Any], symbol: float, poses: Array) -> list[Item]:
    """Pitch circles of two wheels whose axes are d apart: d = r_a + r_b outside, |r_a - r_b| inside.

    Pulleys whose radii are not given have 0.3 d at most.
    """
    fixed = element["a"] is None  # then the wheel is part of what carries the joint beside
    a, b = data.joints[element["beside" if fixed else "a"]], data.joints[element["b"]]
    (turn, here), (_, there) = placed(poses, a.P), placed(poses, b.P)
    apart = there - here
    distance = float(np.linalg.norm(apart - (apart @ turn[:, 2]) * turn[:, 2]))
    ratio = float(element["ratio"])
    if distance == 0.0 or abs(ratio) in (0.0, 1.0 if ratio < 0.0 and not element["belt"] else 0.0):
        return []
    if element["belt"]:
        r_a = float(element["radius"]) or 0.3 * distance / max(1.0, abs(ratio))
    else:
        r_a = distance / (1.0 + ratio) if ratio > 0.0 else distance / abs(1.0 - abs(ratio))
    r_b = abs(ratio) * r_a
    carrier = a.P.body
    items = []
    for joint, radius in ((a, r_a), (b, r_b)):
        wheel = joint.P if joint is a and fixed else joint.S if joint.P.body == carrier else joint.P
        items += _wheel(element["name"], wheel, radius, symbol)
    if element["belt"]:
        pose = poses[carrier]
        spans = (_belt(poses, a.P, b.P, r_a, r_b, ratio < 0.0) - pose[:3, 3]) @ pose[:3, :3]
        items.append(Item("force", element["name"], carrier, spans))
    return items


def _rack(data: PictureData, element: dict[str, Any], symbol: float, poses: Array) -> list[Item]:
    """A pinion with its pitch circle, and a rack whose pitch line touches it where both move alike."""
    a, b, radius = data.joints[element["a"]], data.joints[element["b"]], float(element["radius"])
    (turn, center), (guide, _) = placed(poses, a.P), placed(poses, b.P)
    n, d = turn[:, 2], guide[:, 2]
    if radius == 0.0 or abs(float(n @ d)) > SAME or a.P.body != b.P.body:
        return []
    # n x e = d of the unit vector e to the pitch point, where the pinion's speed is radius times its rate along d
    out = np.sign(radius) * np.cross(d, n)
    tooth = 2.0 * np.pi * abs(radius) / TEETH
    steps = np.arange(-RACK // 2, RACK // 2 + 1)
    heights = np.where(steps % 2 == 0, 0.25, -0.25) * tooth
    line = center + abs(radius) * out + np.outer(steps * tooth, d) + np.outer(heights, out)
    back = center + (abs(radius) + tooth) * out + np.outer(steps[[-1, 0, 0]] * tooth, d)
    back[-1] = line[0]
    pose = poses[b.S.body]
    points = (np.vstack([line, back]) - pose[:3, 3]) @ pose[:3, :3]
    rack = Item("wheel", element["name"], b.S.body, points)
    return [*_wheel(element["name"], a.S, radius, symbol), rack]


def _belt(poses: Array, first: PlacedFrame, second: PlacedFrame, r_a: float, r_b: float, opened: bool) -> Array:
    """The two straight spans of a belt, which cross where the pulleys turn opposite ways."""
    (turn, a), (_, b) = placed(poses, first), placed(poses, second)
    along = b - a
    distance = float(np.linalg.norm(along))
    along = along / distance
    lateral = np.cross(turn[:, 2], along)
    lean = np.arccos(np.clip((r_a - r_b if opened else r_a + r_b) / distance, -1.0, 1.0))
    result = []
    for side in (1.0, -1.0):
        normal = np.cos(lean) * along + side * np.sin(lean) * lateral
        result += [a + r_a * normal, b + (r_b if opened else -r_b) * normal, GAP[0]]
    return np.array(result[:-1])
