"""Scenes of rigid contact."""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from models import IN_C

import eomgen as eg

G = 9.81
SHAPES: dict[str, dict[str, Any]] = {
    "circle": {"shape": "circle", "radius": 0.1},
    "box": {"shape": "box", "size": (0.2, 0.14)},
    "triangle": {"shape": "polygon", "points": ((0.12, 0.01), (-0.1, 0.1), (-0.08, -0.1))},
    "segment": {"shape": "segment", "length": 0.3, "radius": 0.03},
}


def rigid(**law: Any) -> dict[str, Any]:
    return {"normal_law": "rigid", **law}


def on_floor(
    shape: Mapping[str, Any],
    law: Mapping[str, float],
    slope: float = 0.0,
    inertia: float = 0.005,
    target: str = "cython",
) -> Any:
    """A body of 1 kg in the plane on a floor along x that falls towards +x by an angle."""
    values = {"friction": 0.0, "restitution": 0.0, **law, "slope": slope, "inertia": inertia}
    return floor_of(tuple(shape.items()), target).bind(values)


@cache
def floor_of(shape: tuple[tuple[str, Any], ...], target: str) -> Any:
    """The same for any law, slope and inertia, which are parameters: one build for a shape."""
    m = eg.Model("on_floor", gravity=(f"{G}*sin(slope)", f"-{G}*cos(slope)", 0))
    for name, value in (("friction", 0.3), ("restitution", 0.0), ("slope", 0.0), ("inertia", 0.005)):
        m.parameter(name, value)
    body = m.body("b", mass=1.0, inertia={"zz": "inertia"})
    m.planar("j", m.ground, body)
    law = rigid(friction="friction", restitution="restitution")
    m.contacts("c", {**dict(shape), "on": body}, {"shape": "half_plane", "on": m.ground}, law)
    return m.compile(target=target, **(IN_C if target == "cython" else {}))


def pile(kinds: Sequence[str]) -> eg.Model:
    """Bodies of several shapes among themselves, between two walls on a floor."""
    m = eg.Model("pile", gravity=(0, -G, 0))
    m.parameter("mu", 0.3), m.parameter("e", 0.0)
    shapes = []
    for k, kind in enumerate(kinds):
        body = m.body(f"b{k}", mass=1.0 + 0.2 * k, inertia={"zz": 0.01})
        m.planar(f"j{k}", m.ground, body)
        shapes.append({**SHAPES[kind], "on": body})
    m.contacts("among", shapes, law=rigid(friction="mu", restitution="e"))
    turned = [m.ground.at(x, 0, 0, rpy=(0, 0, x / abs(x) * np.pi / 2)) for x in (-0.6, 0.6)]
    sides = {"shape": "half_plane", "on": [m.ground, *turned]}
    m.contacts("walls", shapes, sides, rigid(friction="mu", restitution="e"))
    return m


def thrown(rng: np.random.Generator, count: int) -> dict[str, float]:
    """Initial values of a pile, apart from each other and fast."""
    start: dict[str, float] = {}
    for k in range(count):
        start |= {f"j{k}_x": -0.4 + 0.4 * (k % 3), f"j{k}_y": 0.25 + 0.4 * (k // 3), f"j{k}_3": rng.uniform(-3, 3)}
        start |= {
            f"j{k}_x_dot": rng.uniform(-2, 2),
            f"j{k}_y_dot": rng.uniform(-2, 2),
            f"j{k}_3_dot": rng.uniform(-9, 9),
        }
    return start
