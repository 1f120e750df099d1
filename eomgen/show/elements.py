"""Stage show, elements: springs, dampers, cylinders and ropes, spirals at joints, wheels and gears."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.pictures import NOTHING, ROUNDED, SAME
from ..base.picture_data import GROUND, PictureData, PlacedFrame
from .cam_curves import contour_items, lift_items
from .joints import GAP, move_frame
from .scene import Item, attached, disc, placed

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
        across, _ = _across(np.array([0.0, 0.0, 1.0]), None if view is None else view @ placed(poses, frames[0])[0])
        near = [z for z in element["walls"] if abs(z) <= FAR * symbol] or [0.0]
        lines = [np.array([[0.0, 0.0, z] + side * WALL * symbol * across for side in (1.0, -1.0)]) for z in near]
        return [Item("force", name, frames[0].body, move_frame(frames[0], _broken(lines)))]
    if len(frames) < 2 or (element.get("joint") is not None and not element["along"]):
        return []
    if not element["along"]:
        follow = _rope(element["stops"])
        return [Item("force", name, GROUND, follow(poses), None, follow)]
    shape = _broken([np.asarray(line) for line in element["along"]])

    def points_at(now: Array) -> Array:
        a, b = placed(now, frames[0])[1], placed(now, frames[-1])[1]
        way = b - a
        length = float(np.linalg.norm(way))
        along = way / length if length > 0.0 else placed(now, frames[0])[0][:, 2]
        across, other = _across(along, view)
        base = a + aside * across
        sides = symbol * (shape[:, 1:2] * across + shape[:, 2:3] * other)
        moved: Array = base + shape[:, :1] * way + sides
        if aside:  # short legs to where the element is held
            moved = np.vstack([a, base, GAP, moved, GAP, b + aside * across, b])
        return moved

    return [Item("force", name, GROUND, points_at(poses), None, points_at)]


def _pull(element: dict[str, Any], view: Array | None, symbol: float, poses: Array) -> list[Item]:
    """An arrow of a given force, whose head is where it acts, or a round one about the axis of a given torque."""
    marker, way = element["marker"], np.array(element["way"], dtype=float)
    size = float(np.linalg.norm(way))
    if size == 0.0 or not np.isfinite(size):
        return []
    shape = _broken([np.asarray(line) for line in element["lines"]])

    def points_at(now: Array) -> Array:
        rotation, place = placed(now, marker)
        along = (rotation @ way if element["own"] else way) / size
        across, other = _across(along, view)
        if element["turns"]:  # counterclockwise, seen against the axis
            return np.asarray(place + symbol * (shape[:, :1] * other + shape[:, 1:2] * np.cross(along, other)))
        return np.asarray(place + symbol * (LONG * (shape[:, :1] - 1.0) * along + shape[:, 1:2] * across))

    return [Item("pull", element["name"], GROUND, points_at(poses), None, points_at)]


def _across(along: Array, view: Array | None) -> tuple[Array, Array]:
    """Two unit vectors across a direction, the first on the page."""
    other = np.eye(3)[int(np.argmin(np.abs(along)))] if view is None else view[2]
    across = np.cross(other, along)
    length = float(np.linalg.norm(across))
    if length < ROUNDED:  # seen end on
        other = view[0] if view is not None else np.eye(3)[0]
        across = np.cross(other, along)
        length = float(np.linalg.norm(across))
    across = across / length
    return across, np.cross(along, across)


def _broken(lines: Sequence[Array]) -> Array:
    """Several lines in one, with gaps."""
    parts = []
    for line in lines:
        width = np.zeros((len(line), 3))
        width[:, : line.shape[1]] = line
        parts += [width, GAP]
    return np.vstack(parts[:-1])


def _rope(stops: Sequence[tuple[PlacedFrame, float | None, int | None]]) -> Callable[[Array], Array]:
    """A line over markers and round cylinders; 25 points a cylinder, wound where it is touched."""

    def points(poses: Array) -> Array:
        places = [placed(poses, frame)[1] for frame, _, _ in stops]
        found = [places[0][None]]
        for k in range(1, len(stops)):
            frame, radius, sense = stops[k]
            if radius is None or k + 1 == len(stops):
                found.append(places[k][None])
            else:
                found.append(_wound(poses, frame, float(radius), int(sense or 1), places[k - 1], places[k + 1]))
        return np.vstack(found)

    return points


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
    across = np.array([np.sqrt(far[0] ** 2 - r * r), r * angle, np.sqrt(far[1] ** 2 - r * r)])
    direct = q[:2] - p[:2]
    closest = abs(p[0] * q[1] - p[1] * q[0]) / max(float(np.hypot(*direct)), NOTHING)
    ahead = -p[:2] @ direct > 0.0 and q[:2] @ direct > 0.0
    left = sense * (p[0] * q[1] - p[1] * q[0]) > 0.0
    if (angle > np.pi and not (ahead and closest < r)) or (not left and not (ahead and closest < r) and angle > np.pi):
        return straight
    angles = begin + sense * angle * part[:, 0]
    steps = (across[0] + across[1] * part[:, 0]) / across.sum()
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
        follow = _belt(a.P, b.P, r_a, r_b, ratio < 0.0)
        items.append(Item("force", element["name"], GROUND, follow(poses), None, follow))
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


def _belt(first: PlacedFrame, second: PlacedFrame, r_a: float, r_b: float, opened: bool) -> Callable[[Array], Array]:
    """The two straight spans of a belt, which cross where the pulleys turn opposite ways."""

    def points(poses: Array) -> Array:
        (turn, a), (_, b) = placed(poses, first), placed(poses, second)
        along = b - a
        distance = float(np.linalg.norm(along))
        along = along / distance
        across = np.cross(turn[:, 2], along)
        lean = np.arccos(np.clip((r_a - r_b if opened else r_a + r_b) / distance, -1.0, 1.0))
        found = []
        for side in (1.0, -1.0):
            normal = np.cos(lean) * along + side * np.sin(lean) * across
            found += [a + r_a * normal, b + (r_b if opened else -r_b) * normal, GAP[0]]
        return np.array(found[:-1])

    return points
