"""Scenes of contact between groups in the plane and in space, their geometry in NumPy, and judges of their energy."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

import eomgen as eg

LAW = {"stiffness": 2e4, "dissipation": 0.2, "friction": 0.3, "smoothing": 0.01}
STIFF = 2e4
ELASTIC = {"stiffness": STIFF}
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


def momenta(masses: np.ndarray, inertias: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, float]:
    """Of bodies in the plane, and about the origin, of columns of states; and a measure of what takes part."""
    n = len(masses)
    q, v = x[: 3 * n].reshape(n, 3, -1), x[3 * n :].reshape(n, 3, -1)
    p = masses[:, None, None] * v[:, :2]
    spin = q[:, 0] * p[:, 1] - q[:, 1] * p[:, 0] + inertias[:, None] * v[:, 2]
    return np.vstack([p.sum(axis=0), spin.sum(axis=0)]), float(np.abs(p).max() + np.abs(spin).max())


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


def rectangle(wide: float, high: float) -> list[tuple[float, float]]:
    """Corners of a box."""
    return [(-wide / 2, -high / 2), (wide / 2, -high / 2), (wide / 2, high / 2), (-wide / 2, high / 2)]


def regular(count: int, radius: float) -> list[tuple[float, float]]:
    """Corners on a circle."""
    return [(radius * np.cos(t), radius * np.sin(t)) for t in 2 * np.pi * np.arange(count) / count]


def facing(first: np.ndarray, second: np.ndarray) -> list[tuple[float, float]]:
    """How deep two convex outlines are in each other at both contact points, and the part of the law that counts there.

    Heights of both edges along the mean of their normals, as functions of the place across it.
    """

    def edges(corners: np.ndarray) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        ends = zip(corners, np.roll(corners, -1, axis=0), strict=True)
        return [(p, q, np.array([(q - p)[1], (p - q)[0]]) / np.linalg.norm(q - p)) for p, q in ends]

    sides = [edges(first), edges(second)]
    overlaps = [[max(n @ (p - c) for c, _, _ in sides[1 - k]) for p, _, n in sides[k]] for k in (0, 1)]
    k = int(np.argmin([min(one) for one in overlaps]))
    i = int(np.argmin(overlaps[k]))
    own = sides[k][i]
    j = int(np.argmin([n @ own[2] for _, _, n in sides[1 - k]]))
    other = sides[1 - k][j]
    least = overlaps[k][i]
    following = min(overlaps[k][:i] + overlaps[k][i + 1 :] + overlaps[1 - k][:j] + overlaps[1 - k][j + 1 :])
    normal = own[2] - other[2]
    cosine = np.linalg.norm(normal) / 2
    normal /= np.linalg.norm(normal)
    across = np.array([normal[1], -normal[0]])
    spans = [sorted((across @ one[0], across @ one[1])) for one in (own, other)]
    low, high = max(spans[0][0], spans[1][0]), min(spans[0][1], spans[1][1])
    if least <= 0.0 and low >= high:
        return [(-1e100, 1.0)]

    def height(one: tuple[np.ndarray, np.ndarray, np.ndarray], x: float) -> float:
        (x0, x1), (y0, y1) = (across @ one[0], across @ one[1]), (normal @ one[0], normal @ one[1])
        return float(y0 + (y1 - y0) * (x - x0) / (x1 - x0))

    ends = [cosine * (height(own, x) - height(other, x)) for x in (low, high)]
    if least <= 0.0:
        return [(depth, 1.0) for depth in ends]
    both = ((sides[k], i), (sides[1 - k], j))
    bends = [side[n][2] @ side[(n + 1) % len(side)][2] for side, m in both for n in (m - 1, m)]
    limit = np.arccos(max(bends)) / 2  # half the angle to the nearest neighbour
    turned = np.linalg.norm(own[2] + other[2]) / (2 * np.sin(limit / 2))
    part = np.clip((1 - turned**2) / 0.75, 0, 1)
    return [(least, 1.0), (min(*ends, following - least), float(part**2 * (3 - 2 * part)))]


def witnesses(first: str, second: str, q1: Sequence[float], q2: Sequence[float]) -> list[tuple[float, float]]:
    """Depths of all places of contact, and the part of the law that counts there."""
    if {first, second} <= {"box", "polygon"}:
        return facing(placed(q1, corners_of(first)), placed(q2, corners_of(second)))
    return [(depth, 1.0) for depth in depths(first, second, q1, q2)]


def depths(first: str, second: str, q1: Sequence[float], q2: Sequence[float]) -> list[float]:
    """How deep the round parts of two shapes are in the other shape, or how deep two polygons are in each other."""
    if {first, second} <= {"box", "polygon"}:
        return [depth for depth, _ in witnesses(first, second, q1, q2)]
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


class Record(NamedTuple):
    """Two shapes that are near each other: kinds, normal from the first to the second, depth, middle of the overlap."""

    kinds: tuple[str, str]
    normal: np.ndarray
    depth: float
    middle: np.ndarray


def near(mod: eg.Module, q: np.ndarray) -> list[Record]:
    """What the module lists of its contacts, with the shape of the first body as the first."""
    count, *numbers = mod.kernels.near_pairs(q)
    labels = [text.split(" on ") for _, text in mod.info.contact_shapes]
    found = []
    for row in np.reshape(numbers, (-1, 14))[: int(count)]:
        (one, _), (other, body) = (labels[int(k)] for k in row[:2])
        swapped = body.startswith("b0")
        kinds = (other, one) if swapped else (one, other)
        found.append(Record(kinds, -row[2:5] if swapped else row[2:5], row[5], row[6:9]))
    return found


# -- curves of profiles and outlines, by their descriptions; SciPy finds the nearest point -----------------------------


class Piece(NamedTuple):
    """A circular arc or a straight line between two points, by its direction at the first."""

    start: np.ndarray
    reach: np.ndarray
    way: np.ndarray

    def at(self, s: Any) -> tuple[np.ndarray, np.ndarray]:
        """Points and directions at parts of the length: rows."""
        s = np.asarray(s, dtype=float)
        turn = np.arctan2(cross(self.way, self.reach), self.way @ self.reach)
        size = np.linalg.norm(self.reach) * s * np.sinc(s * turn / np.pi) / np.sinc(turn / np.pi)
        return self.start + size[..., None] * turned_by(self.way, s * turn), turned_by(self.way, 2.0 * s * turn)


def cross(a: np.ndarray, b: np.ndarray) -> Any:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def turned_by(way: np.ndarray, angle: Any) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * way[0] - s * way[1], s * way[0] + c * way[1]], axis=-1)


def straight(points: Sequence[Any]) -> list[Piece]:
    ends = np.asarray(points, dtype=float)
    return [Piece(a, b - a, (b - a) / np.linalg.norm(b - a)) for a, b in pairwise(ends)]


def smooth(points: Sequence[Any], closed: bool) -> list[Piece]:
    """Biarcs of equal tangents, along the circles through three points; straight lines beyond open ends."""
    p = np.asarray(points, dtype=float)
    p = np.concatenate([p[-1:], p, p[:2]]) if closed else p
    ways = []
    for a, b, c in zip(p, p[1:], p[2:], strict=False):
        centre = np.linalg.solve(2.0 * np.array([b - a, c - b]), [b @ b - a @ a, c @ c - b @ b])
        out = turned_by(b - centre, np.pi / 2) / np.linalg.norm(b - centre)
        ways.append(out * np.sign(out @ (c - a)))
    if closed:
        p = p[1:-1]
    else:
        mirrored = [
            2.0 * (way @ v) / (v @ v) * v - way for way, v in ((ways[0], p[1] - p[0]), (ways[-1], p[-1] - p[-2]))
        ]
        ways = [mirrored[0], *ways, mirrored[1]]
    result = []
    for (a, b), (s, t) in zip(pairwise(p), pairwise(ways), strict=True):
        v, bend = b - a, 2.0 * (1.0 - s @ t)
        d = max(np.roots([bend, 2.0 * v @ (s + t), -v @ v]).real)
        joint = 0.5 * (a + b + d * (s - t))
        back = Piece(b, joint - b, -t)
        result += [Piece(a, joint - a, s), Piece(joint, b - joint, -back.at(1.0)[1])]
    rays = (
        () if closed else (Piece(p[0] - 9.0 * ways[0], 9.0 * ways[0], ways[0]), Piece(p[-1], 9.0 * ways[-1], ways[-1]))
    )
    return [*rays[:1], *result, *rays[1:]]


def nearest_on(pieces: Sequence[Piece], c: np.ndarray, closed: bool) -> tuple[float, np.ndarray]:
    """The signed distance of a point from a curve that has its solid to the right, and the nearest point."""
    best: tuple[float, int, float] = (np.inf, 0, 0.0)
    grid = np.linspace(0.0, 1.0, 33)
    for k, piece in enumerate(pieces):
        points, ways = piece.at(grid)
        slopes = ((points - c) * ways).sum(axis=1)
        feet = [0.0, 1.0]
        for i in np.flatnonzero((slopes[:-1] < 0.0) & (slopes[1:] > 0.0)):
            feet.append(
                brentq(lambda s, p=piece: float((p.at(s)[0] - c) @ p.at(s)[1]), grid[i], grid[i + 1], xtol=1e-16)
            )
        best = min(best, *((float(np.linalg.norm(piece.at(s)[0] - c)), k, s) for s in feet))
    distance, k, s = best
    point, way = pieces[k].at(s)
    other = k + (1 if s == 1.0 else -1 if s == 0.0 else 0)
    if closed or 0 <= other < len(pieces):  # at a corner the sum of both directions tells the side
        way = way + pieces[other % len(pieces)].at(1.0 if other < k else 0.0)[1] * (other != k)
    return distance * (1.0 if cross(way, c - point) > 0.0 else -1.0), point


def check_nearest(
    mod: eg.Module,
    q: np.ndarray,
    radius: float,
    pieces: Sequence[Piece],
    c: np.ndarray,
    closed: bool,
    turn: float = 0.0,
) -> float:
    """The deepest place of a circle about a point of the axes of a curve, which are turned: gap, normal and middle."""
    gap, _ = nearest_on(pieces, c, closed)
    corner = min(float(np.linalg.norm(piece.start - c)) for piece in pieces)
    limit = max(1e-9, 4.0 * corner) if corner < 3e-8 else 1e-9  # where pieces share a circle
    one = max(near(mod, q), key=lambda record: record.depth)
    assert abs(one.depth - radius + gap) < limit
    normal, arm = (turned_by(x, -turn) for x in (-one.normal[:2], one.middle[:2] - q[:2]))
    assert abs(np.linalg.norm(normal) - 1.0) < 1e-12
    assert abs(nearest_on(pieces, c - gap * normal, closed)[0]) < limit
    assert np.abs(arm + (radius - 0.5 * one.depth) * normal).max() < 1e-9
    return gap


# -- a ball shot at a fixed shape: it flies on a known parabola, so that geometry alone says whether it touches --------
#: Depth, relative to the thinner of the two, from which on the ball has to be turned.
GRAZING = 0.02


class Shot(NamedTuple):
    """A ball and what it is shot at: parameters of the model, first velocities, seconds of flight."""

    parameters: dict[str, float]
    start: dict[str, float]
    end: float
    depth: float  #: of the parabola at most, relative to the thinner of the two; negative where it passes by


def shot_model(kind: str) -> eg.Model:
    """A ball in the plane and a fixed shape."""
    m = eg.Model(f"shot_at_{kind}", gravity=(0, "-g", 0))
    for name, value in (("g", 9.81), ("r", 0.05), ("size", 0.5), ("thin", 0.001), ("k", 1e6)):
        m.parameter(name, value)
    for name in ("wx", "wy", "wa"):
        m.parameter(name, 0.0)
    ball = m.body("ball", mass=1.0, inertia={"zz": "0.4*r**2"})
    m.planar("j", m.ground, ball)
    at = m.ground.at("wx", "wy", 0, rpy=(0, 0, "wa"))
    shapes: dict[str, dict[str, Any]] = {
        "circle": {"radius": "size/2"},
        "segment": {"length": "size", "radius": "thin/2"},
        "polygon": {"points": [("size/2", 0), (0, "thin/2"), ("-size/2", 0), (0, "-thin/2")]},
    }
    law = {"stiffness": "k", "exponent": 1.5}
    m.contacts("wall", {"shape": "circle", "on": ball, "radius": "r"}, {"shape": kind, "on": at, **shapes[kind]}, law)
    return m


def shot(rng: np.random.Generator, kind: str) -> Shot:
    """A random one, aimed at the shape or beside it; stiff enough that the ball comes back."""
    r, size = 0.5 * 10 ** rng.uniform(-3, 0), 10 ** rng.uniform(-3, 0)
    thin = size * (1.0 if kind == "circle" else 10 ** rng.uniform(-2, -0.3))
    speed, g = 10 ** rng.uniform(-1, np.log10(50)), float(rng.choice((0.0, 9.81)))
    distance, way = 10 ** rng.uniform(-0.5, 1) + r + size, rng.uniform(-np.pi, np.pi)
    place = distance * np.array([np.cos(way), np.sin(way)])
    aside = rng.uniform(-0.7, 0.7) * (r + 0.5 * size) * np.array([-np.sin(way), np.cos(way)])
    time = distance / speed
    velocity = (place + aside) / time + np.array([0.0, 0.5 * g * time])
    fastest, soft = float(np.hypot(*velocity) + 2.0 * g * time), 0.2 * min(2.0 * r, r + 0.5 * thin)
    k = max(1e3, 1.25 * fastest**2 / soft**2.5)  # k d^2.5 / 2.5 is the energy at 0.2 of the thickness
    parameters = {"g": g, "r": r, "size": size, "thin": thin, "k": k, "wa": rng.uniform(-3, 3)}
    parameters |= {"wx": float(place[0]), "wy": float(place[1])}
    t = np.linspace(0.0, 1.5 * time, 400_001)
    x, y = velocity[0] * t, velocity[1] * t - 0.5 * g * t * t
    deepest = float((r - gaps(kind, parameters, x, y)).max())
    start = {"j_x_dot": float(velocity[0]), "j_y_dot": float(velocity[1]), "j_3_dot": rng.uniform(-20, 20)}
    return Shot(parameters, start, 1.5 * time, deepest / min(2.0 * r, thin))


def gaps(kind: str, p: dict[str, float], x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Distances of points from the shape, negative inside."""
    c, s = np.cos(p["wa"]), np.sin(p["wa"])
    u, v = np.abs(c * (x - p["wx"]) + s * (y - p["wy"])), np.abs(c * (y - p["wy"]) - s * (x - p["wx"]))
    half, thin = 0.5 * p["size"], 0.5 * p["thin"]
    if kind == "circle":
        return np.asarray(np.hypot(u, v) - half)
    if kind == "segment":
        return np.asarray(np.hypot(np.maximum(u - half, 0.0), v) - thin)
    length = np.hypot(half, thin)  # a quarter of a rhombus
    along = np.clip(((half - u) * half + v * thin) / length**2, 0.0, 1.0)
    outside = np.hypot(u - half + along * half, v - along * thin)
    return np.where(u / half + v / thin < 1.0, -outside, outside)


def turned(module: Any, one: Shot, method: str) -> float:
    """How much the ball was turned, relative to its speed."""
    run = module.bind(p=one.parameters).simulate((0, one.end), initial=one.start, method=method)
    end = np.array([run["j_x_dot"][-1], run["j_y_dot"][-1]])
    free = np.array([one.start["j_x_dot"], one.start["j_y_dot"] - one.parameters["g"] * one.end])
    speed = max(np.hypot(one.start["j_x_dot"], one.start["j_y_dot"]), np.hypot(*free))
    return float(np.hypot(*(end - free)) / speed)


# -- Free bodies in space ----------------------------------------------------------------------------------------------
def flying(count: int, gravity: Any = (0, 0, 0)) -> tuple[eg.Model, list[Any]]:
    m = eg.Model("flying", gravity=gravity)
    bodies = [m.body(f"b{k}", mass=1.0 + k, inertia=(0.01, 0.012, 0.015)) for k in range(count)]
    for k, body in enumerate(bodies):
        m.free(f"j{k}", m.ground, body, rotation="euler_parameters")
    return m, bodies


def state(mod: Any, places: Any, turns: Any) -> np.ndarray:
    """A state at rest with bodies at places, turned."""
    found = np.zeros(mod.n_x)
    for k, (place, turn) in enumerate(zip(places, turns, strict=True)):
        x, y, z, w = turn.as_quat()
        own = [i for i, name in enumerate(mod.q_names) if name.startswith(f"j{k}_")]
        found[own] = [*place, w, x, y, z]
    return found


def moved(mod: Any, x: np.ndarray, k: int, h: float) -> np.ndarray:
    """The state after the velocity of one number has acted for a short time."""
    v = np.zeros(mod.n_v)
    v[k] = 1.0
    speeds = np.concatenate([x[: mod.n_q], v])
    rate = mod.rhs(0.0, speeds)[: mod.n_q]
    return np.asarray(mod.project(np.concatenate([x[: mod.n_q] + h * rate, np.zeros(mod.n_v)])))


def check_slopes(mod: Any, x: np.ndarray) -> None:
    """The generalized forces are minus the slopes of the energy along the velocities."""
    h = 1e-6
    sides = [moved(mod, x, k, way * h) for way in (1, -1) for k in range(mod.n_v)]
    slopes = np.subtract(*mod.energy(np.array(sides).T)[1].reshape(2, -1)) / (2 * h)
    force = -mod.bias(0.0, x)
    np.testing.assert_allclose(force, np.negative(slopes), rtol=2e-4, atol=2e-4 * np.abs(force).max())


def depth_of(mod: Any, x: np.ndarray) -> float:
    return float((mod.energy(x)[1] * 2.5 / STIFF) ** 0.4)
