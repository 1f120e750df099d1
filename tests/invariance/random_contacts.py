"""Random scenes of contacts between groups: free bodies of all shapes; laws of the normal force, friction and soil."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

import eomgen as eg

PLANE, SPACE = "plane", "space"
FRICTIONS = ("none", "coulomb", "stribeck", "brown_mcphee", "lugre")
NORMALS = ("hunt_crossley", "restitution", "hertz", "linear", "moduli")
#: What a scene is made of, in turn: where, and the law; soil lies in the plane.
FAMILIES = (
    *((PLANE, friction) for friction in FRICTIONS),
    *((SPACE, friction) for friction in FRICTIONS),
    (PLANE, "plates on soil"),
    (PLANE, "wheels on soil"),
)


@dataclass
class Scene:
    """A model of free bodies without gravity, and what is known of them."""

    model: eg.Model
    family: tuple[str, str]
    masses: np.ndarray
    inertias: np.ndarray  #: principal ones; about z alone in the plane
    remembers: bool  #: whether its force gives back what it took without a known energy
    told: str
    bristles: bool = False  #: whether half the square of its states is energy


def _polygon(random: np.random.Generator, size: float) -> list[tuple[float, float]]:
    """A convex one."""
    angles = np.sort(random.uniform(0, 2 * np.pi / 3, 3) + 2 * np.pi / 3 * np.arange(3))
    return [(float(size * np.cos(a)), float(size * np.sin(a))) for a in angles]


def _in_plane(random: np.random.Generator, body: Any) -> dict[str, Any]:
    size = float(random.uniform(0.08, 0.2))
    kinds: tuple[dict[str, Any], ...] = (
        {"shape": "circle", "radius": size},
        {"shape": "segment", "length": 3 * size, "radius": 0.3 * size},
        {"shape": "box", "size": (2 * size, float(random.uniform(1.0, 2.0)) * size)},
        {"shape": "polygon", "points": _polygon(random, size)},
        {"shape": "outline", "points": [(-size, -size), (size, -size), (0.2 * size, 0.1 * size), (0, size)]},
        {"shape": "smooth_outline", "points": _polygon(random, size)},
        {"shape": "sprocket", "teeth": 7, "pitch": size, "seat": 0.2 * size, "tip_radius": 1.4 * size},
    )
    return {**kinds[int(random.integers(len(kinds)))], "on": body}


def _ground(random: np.random.Generator, body: Any) -> dict[str, Any]:
    points = [[x, float(random.uniform(-0.05, 0.05))] for x in (-1.0, -0.3, 0.2, 1.0)]
    kinds: tuple[dict[str, Any], ...] = (
        {"shape": "half_plane"},
        {"shape": "profile", "points": points, "depth": 0.5},
        {"shape": "smooth_profile", "points": points, "depth": 0.5},
    )
    return {**kinds[int(random.integers(len(kinds)))], "on": body}


def _in_space(random: np.random.Generator, body: Any, on_ground: bool, curved: bool) -> dict[str, Any]:
    size = float(random.uniform(0.08, 0.2))
    kinds: list[dict[str, Any]] = [{"shape": "sphere", "radius": size}]
    if not curved:
        kinds.append({"shape": "capsule", "length": 2 * size, "radius": 0.5 * size})
    if on_ground and not curved:
        kinds += [
            {"shape": "ellipsoid", "semi_axes": (size, 0.8 * size, 1.3 * size)},
            {"shape": "cuboid", "size": (2 * size, size, 1.5 * size)},
        ]
    return {**kinds[int(random.integers(len(kinds)))], "on": body}


def _normal(random: np.random.Generator, curved: bool) -> dict[str, Any]:
    kind = "moduli" if curved else NORMALS[int(random.integers(4))]
    stiffness = float(10 ** random.uniform(3, 5))
    return {
        "hunt_crossley": {"stiffness": stiffness, "exponent": float(random.uniform(1, 2)), "dissipation": 0.4},
        "restitution": {
            "stiffness": stiffness, "restitution": float(random.uniform(0.2, 0.95)), "velocity": 0.5,
            "formula": ("hunt_crossley", "lankarani", "flores")[int(random.integers(3))],
        },
        "hertz": {"stiffness": stiffness, "normal_law": "hertz", "dissipation": 0.2},
        "linear": {"stiffness": stiffness, "normal_law": "linear", "damping": float(random.uniform(0, 50))},
        "moduli": {"normal_law": "hertz", "moduli": [1e6, 2e5], "poisson": [0.3, 0.4], "dissipation": 0.2},
    }[kind]  # fmt: skip


def _friction(random: np.random.Generator, kind: str) -> dict[str, Any]:
    mu = float(random.uniform(0.1, 0.9))
    return {
        "none": {},
        "coulomb": {"friction": mu, "smoothing": 1e-2, "viscous_friction": float(random.uniform(0, 0.1))},
        "stribeck": {"friction": mu, "static_friction": 1.4 * mu, "stribeck": 0.05, "smoothing": 1e-2},
        "brown_mcphee": {
            "friction": mu, "static_friction": 1.3 * mu, "transition": 1e-2, "friction_law": "brown_mcphee",
        },
        "lugre": {
            "friction": mu, "friction_law": "lugre", "bristle_stiffness": 300.0, "bristle_damping": 2.0,
            "static_friction": float(random.uniform(1.0, 2.0)) * mu, "stribeck": 0.05,
        },
    }[kind]  # fmt: skip


def random_contacts(number: int) -> Scene:
    """Scene of a number; the same for each run."""
    where, what = family = FAMILIES[number % len(FAMILIES)]
    random = np.random.default_rng([number, 17])
    count = int(random.integers(2, 5))
    m = eg.Model(f"scene{number}", gravity=(0, 0, 0))
    masses, inertias = random.uniform(0.5, 3.0, count), random.uniform(0.01, 0.015, (count, 3))
    bodies = []
    for k in range(count):
        moments = {"zz": float(inertias[k, 2])} if where == PLANE else tuple(float(x) for x in inertias[k])
        bodies.append(m.body(f"b{k}", mass=float(masses[k]), inertia=moments))
        if where == PLANE:
            m.planar(f"j{k}", m.ground, bodies[k])
        else:
            m.free(f"j{k}", m.ground, bodies[k], rotation="euler_parameters")
    flat, grounded = where == PLANE, bool(random.random() < 0.6)
    if "soil" in what:
        law = {
            "soil": "own", "sinkage_exponent": float(random.uniform(0.3, 1.5)), "cohesive_modulus": 1e3,
            "frictional_modulus": float(10 ** random.uniform(3.5, 5)), "cohesion": float(random.uniform(0, 500)),
            "friction_angle": float(random.uniform(0, 0.6)), "shear_modulus": 0.01,
        }  # fmt: skip
        if "plates" in what:
            shapes = [
                {"shape": "plate", "on": b, "length": 0.3, "width": 0.2, "points": int(random.integers(1, 4))}
                for b in bodies[1:]
            ]
            law["recovery"], law["lateral"] = 0.05, False
        else:
            shapes = [{"shape": "circle", "on": b, "radius": 0.2, "width": 0.1} for b in bodies[1:]]
        m.contacts("c", shapes, _ground(random, bodies[0]), law)
        told = ", ".join(sorted({str(s["shape"]) for s in shapes}))
        return Scene(m, family, masses, inertias, True, told)
    curved = not flat and bool(random.random() < 0.2)
    law = {**_normal(random, curved), **_friction(random, what)}
    if what == "lugre" and flat:
        law["lateral"] = False
    if grounded:
        ground = _ground(random, bodies[0]) if flat else {"shape": "half_space", "on": bodies[0]}
        shapes = [_in_plane(random, b) if flat else _in_space(random, b, True, curved) for b in bodies[1:]]
        m.contacts("c", shapes, ground, law)
        shapes = [*shapes, ground]
    else:
        shapes = [_in_plane(random, b) if flat else _in_space(random, b, False, curved) for b in bodies]
        m.contacts("c", shapes, law=law)
    told = ", ".join(sorted({str(shape["shape"]) for shape in shapes}))
    told += f"; {law.get('normal_law', 'hunt_crossley')}"
    return Scene(m, family, masses, inertias, False, told, what == "lugre")
