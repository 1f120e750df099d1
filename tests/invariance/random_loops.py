"""Random closed mechanisms: planar ones of spatial joints (with redundant rows), spatial ones, overconstrained ones.

Each is made from places of its joints in ground axes, so that it is assembled where it is made.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from invariance.loop_judge import Array, Body, Joint
from scipy.spatial.transform import Rotation

import eomgen as eg


@dataclass
class Loops:
    """A model and the numbers it was made from."""

    family: str
    model: eg.Model
    bodies: list[Body]
    joints: list[Joint]
    gravity: Array
    size: float
    dof: int | None = None  #: by Gruebler's or the linkage's own rule, where it holds
    names: list[str] = field(default_factory=list)


class _Maker:
    def __init__(self, family: str, seed: int, size: float, planar: bool) -> None:
        self.random, self.size, self.family, self.planar = np.random.default_rng(seed), size, family, planar
        self.gravity = np.array([0.0, -9.81, 0.0]) * size
        self.model = eg.Model(f"loop_{seed}", gravity=tuple(self.gravity.tolist()))
        self.handles: list[eg.Any] = []
        self.turns: list[Array] = []
        self.places: list[Array] = []
        self.bodies: list[Body] = []
        self.joints: list[Joint] = []

    def body(self, at: Array, along: Array) -> int:
        """A body with its origin at a joint and x along the link, as one would write it."""
        r, k = self.random, len(self.bodies)
        x = along / np.linalg.norm(along)
        z = np.array([0.0, 0.0, 1.0]) if self.planar else np.cross(x, r.normal(size=3))
        z = z - (z @ x) * x
        z /= np.linalg.norm(z)
        self.turns.append(np.column_stack([x, np.cross(z, x), z]))
        self.places.append(at)
        points = r.normal(size=(5, 3)) * r.uniform(0.1, 0.4, 3) * self.size
        mass = float(10.0 ** r.uniform(-1, 1))
        inertia = mass * sum(np.eye(3) * (p @ p) - np.outer(p, p) for p in points) / 5
        com = r.uniform(-0.3, 0.3, 3) * self.size
        com = np.array([np.linalg.norm(along) / 2 * self.size, 0, 0]) + 0.2 * com
        if self.planar:
            com[2] = 0.0
            inertia = np.diag(np.diag(inertia))
        self.bodies.append(Body(mass, com, inertia))
        self.handles.append(
            self.model.body(f"b{k}", mass=mass, com=com.tolist(), inertia=[row.tolist() for row in inertia])
        )
        return k

    def joint(self, kind: str, i: int, j: int, at: Array, axis: Array) -> None:
        """A joint at a place with its axis, both in ground; -1 is ground."""
        axis = axis / np.linalg.norm(axis)
        k = int(np.argmin(np.abs(axis)))
        x = np.cross(np.eye(3)[k], axis)
        x /= np.linalg.norm(x)
        frame = np.column_stack([x, np.cross(axis, x), axis])
        points, frames, markers = [], [], []
        for body in (i, j):
            turn = np.eye(3) if body < 0 else self.turns[body]
            origin = np.zeros(3) if body < 0 else self.places[body]
            point, own = turn.T @ (at - origin) * self.size, turn.T @ frame
            handle = self.model.ground if body < 0 else self.handles[body]
            rpy = Rotation.from_matrix(own).as_euler("xyz")
            markers.append(handle.at(*point.tolist(), rpy=tuple(rpy.tolist())))
            points.append(point)
            frames.append(own)
        getattr(self.model, kind)(f"j{len(self.joints)}", *markers)
        self.joints.append(Joint(kind, (i, j), (points[0], points[1]), (frames[0], frames[1])))

    def done(self, dof: int | None) -> Loops:
        made = Loops(self.family, self.model, self.bodies, self.joints, self.gravity, self.size, dof)
        made.names = [f"b{k}" for k in range(len(self.bodies))]
        return made


Z = np.array([0.0, 0.0, 1.0])


def _polygon(r: np.random.Generator, corners: int, jitter: float = 0.25) -> Array:
    """Corners of a polygon in the plane, about 1 in size."""
    angles = 2 * np.pi * (np.arange(corners) + r.uniform(-jitter, jitter, corners)) / corners + r.uniform(0, 6)
    radii = r.uniform(0.7, 1.3, corners)
    return np.column_stack([radii * np.cos(angles), radii * np.sin(angles), np.zeros(corners)])


def n_bar(seed: int, size: float, bars: int = 4, bearings: int = 0) -> Loops:
    """A planar closed chain of revolute joints; ``bearings`` of its pins are held by two joints on one line."""
    m = _Maker(f"{bars}-bar" + (" with second bearings" if bearings else ""), seed, size, True)
    pins = _polygon(m.random, bars)
    links = [m.body(pins[k], pins[(k + 1) % bars] - pins[k]) for k in range(bars - 1)]
    chain = [-1, *links, -1]
    for k in range(bars):
        m.joint("revolute", chain[k], chain[k + 1], pins[k], Z)
        if k < bearings:
            m.joint("revolute", chain[k], chain[k + 1], pins[k] + 0.2 * Z, Z)
    return m.done(bars - 3)


def slider_crank(seed: int, size: float) -> Loops:
    """Crank, rod, slider on a guide at any angle, offset."""
    m = _Maker("slider-crank", seed, size, True)
    pins = _polygon(m.random, 3)
    crank, rod = m.body(pins[0], pins[1] - pins[0]), m.body(pins[1], pins[2] - pins[1])
    slider = m.body(pins[2], Rotation.from_rotvec([0, 0, m.random.uniform(0, 6)]).apply([1.0, 0, 0]))
    m.joint("revolute", -1, crank, pins[0], Z)
    m.joint("revolute", crank, rod, pins[1], Z)
    m.joint("revolute", rod, slider, pins[2], Z)
    m.joint("prismatic", -1, slider, pins[2], m.turns[slider][:, 0])
    return m.done(1)


def six_bar(seed: int, size: float) -> Loops:
    """Watt's six-bar: a four-bar whose coupler drives a second one."""
    m = _Maker("six-bar", seed, size, True)
    pins = _polygon(m.random, 4)
    a, b, c = (m.body(pins[k], pins[k + 1] - pins[k]) for k in range(3))
    extra = pins[1] + m.random.uniform(0.4, 1.0, 3) * [1, 1, 0]
    far = extra + m.random.uniform(0.4, 1.0, 3) * [1, -1, 0]
    base = far + m.random.uniform(0.4, 1.0, 3) * [-1, -1, 0]
    d, e = m.body(extra, far - extra), m.body(far, base - far)
    ends = (
        (-1, a, pins[0]),
        (a, b, pins[1]),
        (b, c, pins[2]),
        (c, -1, pins[3]),
        (b, d, extra),
        (d, e, far),
        (e, -1, base),
    )
    for i, j, at in ends:
        m.joint("revolute", i, j, at, Z)
    return m.done(1)


def _spatial(kinds: str, dof: int) -> Callable[[int, float], Loops]:
    words = {"R": "revolute", "S": "spherical", "C": "cylindrical", "U": "universal", "P": "prismatic"}

    def make(seed: int, size: float) -> Loops:
        m = _Maker(kinds, seed, size, False)
        r, count = m.random, len(kinds)
        pins = _polygon(r, count) + r.uniform(-0.4, 0.4, (count, 3))
        links = [m.body(pins[k], pins[(k + 1) % count] - pins[k]) for k in range(count - 1)]
        chain = [-1, *links, -1]
        for k, kind in enumerate(kinds):
            m.joint(words[kind], chain[k], chain[k + 1], pins[k], r.normal(size=3))
        return m.done(dof)

    return make


def _by_links(family: str, seed: int, size: float, a: list[float], alpha: list[float], angles: list[float]) -> Loops:
    """A closed chain of revolute joints from lengths, twists (Denavit and Hartenberg) and a closed set of angles."""
    m = _Maker(family, seed, size, False)
    place, turn, pins, axes = np.zeros(3), Rotation.random(random_state=seed), [], []
    for length, twist, angle in zip(a, alpha, angles, strict=True):
        pins.append(place)
        axes.append(turn.apply(Z))
        turn = turn * Rotation.from_euler("z", angle)
        place = place + turn.apply([length, 0, 0])
        turn = turn * Rotation.from_euler("x", twist)
    assert np.linalg.norm(place) < 1e-12
    links = [m.body(pins[k], pins[(k + 1) % len(a)] - pins[k]) for k in range(len(a) - 1)]
    chain = [-1, *links, -1]
    for k in range(len(a)):
        m.joint("revolute", chain[k], chain[k + 1], pins[k], axes[k])
    return m.done(1)


def bennett(seed: int, size: float) -> Loops:
    """Bennett's linkage: four revolute joints in space, a / sin alpha = b / sin beta."""
    r = np.random.default_rng(seed)
    alpha, beta = r.uniform(0.5, 1.2), r.uniform(1.3, 2.0)
    a, b = np.sin(alpha), np.sin(beta)
    first = r.uniform(0.7, 2.2)
    # tan(t1/2) tan(t2/2) = sin((beta + alpha)/2) / sin((beta - alpha)/2); opposite angles are equal and opposite
    second = 2 * np.arctan(np.sin((beta + alpha) / 2) / np.sin((beta - alpha) / 2) / np.tan(first / 2))
    angles = [first, second, -first, -second]
    return _by_links("Bennett", seed, size, [a, b, a, b], [alpha, beta, alpha, beta], angles)


def bricard(seed: int, size: float) -> Loops:
    """Bricard's threefold-symmetric linkage: six equal links, twists alpha and -alpha (Chen, You and Tarnai, 2005)."""
    r = np.random.default_rng(seed)
    alpha = r.uniform(1.7, 2.0)
    first = r.uniform(0.3, 1.2)
    # closure: cos^2 a + sin^2 a (cos t + cos p) + (1 + cos^2 a) cos t cos p - 2 cos a sin t sin p = 0
    c, s = np.cos(alpha), np.sin(alpha)
    # linear in cos p and sin p: A cos p + B sin p + D = 0
    A = s * s + (1 + c * c) * np.cos(first)
    B = -2 * c * np.sin(first)
    D = c * c + s * s * np.cos(first)
    second = np.arctan2(B, A) + np.arccos(np.clip(-D / np.hypot(A, B), -1, 1))
    return _by_links("Bricard", seed, size, [1.0] * 6, [alpha, -alpha] * 3, [first, second] * 3)


#: Family -> what makes one of a seed and a size.
FAMILIES: dict[str, Callable[[int, float], Loops]] = {
    "four-bar": lambda seed, size: n_bar(seed, size, 4),
    "four-bar, second bearings": lambda seed, size: n_bar(seed, size, 4, 2),
    "five-bar": lambda seed, size: n_bar(seed, size, 5),
    "slider-crank": slider_crank,
    "six-bar": six_bar,
    "RSSR": _spatial("RSSR", 2),
    "RSCR": _spatial("RSCR", 1),
    "RCCC": _spatial("RCCC", 1),
    "RUSR": _spatial("RUSR", 1),
    "Bennett": bennett,
    "Bricard": bricard,
}


def random_loops(number: int) -> Loops:
    """One of the families, of a size from a millimetre to a kilometre."""
    family = list(FAMILIES)[number % len(FAMILIES)]
    size = (1.0, 1.0, 1e-3, 1e3, 1.0, 0.03)[(number // len(FAMILIES)) % 6]
    return FAMILIES[family](number, size)
