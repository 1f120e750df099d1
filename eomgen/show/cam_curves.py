"""Stage show, cams: laws of lift and contours -> the curves on the cam, and the flat faces that touch them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.pictures import SAME
from ..base.picture_data import GROUND, JointData, PictureData
from .joints import move_frame
from .scene import Item, attachments, placed

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
    found = []
    for poses in frames:
        turn, origin = placed(poses, joint.P)
        found.append(float(turn[:, 2] @ (placed(poses, joint.S)[1] - origin)))
    more = max(0.3 * (max(found) - min(found)), BEYOND * symbol)
    return np.linspace(min(found) - more, max(found) + more, 361)


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
    own = (every - joint.S.position) @ joint.S.rotation
    reach = np.hypot(own[:, 0], own[:, 1])
    far = int(np.argmax(reach))
    return own[far] if reach[far] > SAME else None


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
