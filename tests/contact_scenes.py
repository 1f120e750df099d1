"""Scenes of contact between groups, and their geometry in NumPy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import eomgen as eg

LAW = {"stiffness": 2e4, "dissipation": 0.2, "friction": 0.3, "smoothing": 0.01}
ELASTIC = {"stiffness": 2e4}
TRIANGLE = ((0.12, 0.01), (-0.1, 0.1), (-0.08, -0.1))
#: Shapes in the plane, in body axes.
PLANAR: dict[str, dict[str, Any]] = {
    "circle": {"shape": "circle", "radius": 0.1},
    "box": {"shape": "box", "size": (0.2, 0.14)},
    "polygon": {"shape": "polygon", "points": TRIANGLE},
    "segment": {"shape": "segment", "length": 0.3, "radius": 0.03},
}


def planar(name: str, count: int, gravity: Any = (0, -9.81, 0)) -> tuple[eg.Model, list[Any]]:
    """A model of bodies that move in the plane."""
    m = eg.Model(name, gravity=gravity)
    bodies = [m.body(f"b{k}", mass=1.0 + 0.2 * k, inertia={"zz": 0.01 + 0.001 * k}) for k in range(count)]
    for k, body in enumerate(bodies):
        m.planar(f"j{k}", m.ground, body)
    return m, bodies


def on(shape: Mapping[str, Any], body: Any) -> dict[str, Any]:
    """A shape on a marker."""
    return {**shape, "on": body}


def placed(q: Sequence[float], points: Any) -> np.ndarray:
    """Points of a body at x, y, angle."""
    c, s = np.cos(q[2]), np.sin(q[2])
    return np.asarray(points, dtype=float) @ np.array([[c, s], [-s, c]]) + np.asarray(q[:2])


def to_segment(p: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
    """The distance of a point from a segment."""
    along = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return float(np.linalg.norm(p - a - along * (b - a)))


def to_polygon(p: np.ndarray, corners: np.ndarray) -> float:
    """The distance of a point from a convex outline, negative inside."""
    edges = list(zip(corners, np.roll(corners, -1, axis=0), strict=True))
    inside = all((b - a)[0] * (p - a)[1] - (b - a)[1] * (p - a)[0] > 0 for a, b in edges)
    distance = min(to_segment(p, a, b) for a, b in edges)
    return -distance if inside else distance


def corners_of(kind: str) -> np.ndarray:
    """Corners of a box or polygon, or the ends of a segment."""
    if kind == "box":
        x, y = (0.5 * size for size in PLANAR["box"]["size"])
        return np.array([(-x, -y), (x, -y), (x, y), (-x, y)])
    return np.array(TRIANGLE) if kind == "polygon" else np.array([(-0.15, 0.0), (0.15, 0.0)])


def depths(first: str, second: str, q1: Sequence[float], q2: Sequence[float]) -> list[float]:
    """How deep the round parts of two shapes are in the other shape."""
    found = []
    for (a, qa), (b, qb) in (((first, q1), (second, q2)), ((second, q2), (first, q1))):
        if a == "circle" == b:
            return [0.2 - float(np.linalg.norm(np.subtract(q1[:2], q2[:2])))]
        if a == "circle":
            continue
        radius = {"circle": 0.1, "segment": 0.03}.get(b, 0.0)
        points = [np.asarray(qb[:2])] if b == "circle" else placed(qb, corners_of(b))
        outline = placed(qa, corners_of(a))
        for p in points:
            gap = to_segment(p, *outline) - 0.03 if a == "segment" else to_polygon(p, outline)
            found.append(radius - gap)
    return found
