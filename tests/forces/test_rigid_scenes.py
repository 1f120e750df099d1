"""Rigid contacts of free bodies: impulses never give energy and keep both momenta; laws too, in any order of groups."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from models import IN_C
from refusals import refuses
from sweeps import part_of

import eomgen as eg

RIGID: dict[str, Any] = {"normal_law": "rigid"}
SOFT: dict[str, Any] = {"stiffness": 1e4, "dissipation": 0.3, "friction": 0.4, "smoothing": 0.01}
ROUND: dict[str, Any] = {"shape": "circle", "radius": 0.1}


def shape_of(kind: int, body: Any) -> dict[str, Any]:
    kinds = (ROUND, {"shape": "box", "size": (0.2, 0.16)}, {"shape": "segment", "length": 0.2, "radius": 0.05})
    return {**kinds[kind % 3], "on": body}


def free_bodies(masses: np.ndarray) -> tuple[eg.Model, list[Any]]:
    m = eg.Model("rigid", gravity=(0, 0, 0))
    bodies = [m.body(f"b{k}", mass=float(x), inertia={"zz": float(0.005 * x)}) for k, x in enumerate(masses)]
    for k, body in enumerate(bodies):
        m.planar(f"j{k}", m.ground, body)
    return m, bodies


def both_momenta(masses: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Of the plane, and about the origin, of columns of states; and a measure of what takes part."""
    n = len(masses)
    q, v = x[: 3 * n].reshape(n, 3, -1), x[3 * n :].reshape(n, 3, -1)
    p = masses[:, None, None] * v[:, :2]
    spin = q[:, 0] * p[:, 1] - q[:, 1] * p[:, 0] + 0.005 * masses[:, None] * v[:, 2]
    return np.vstack([p.sum(axis=0), spin.sum(axis=0)]), np.abs(p).max() + np.abs(spin).max()


@pytest.mark.parametrize("number", part_of(range(6), (3).__eq__))
def test_impulses_keep_momenta_and_give_no_energy(number: int) -> None:
    """Restitutions of 0 to 1, friction, masses of 1 to 1e6, three bodies that meet at once, none of them ground."""
    random = np.random.default_rng([number, 31])
    masses = 10.0 ** np.array([0.0, random.uniform(-3, 3), random.uniform(-3, 3)])
    restitution = (0.0, 1.0, 0.5, 0.3, 0.9, 1.0)[number]
    friction = (0.0, 0.0, 0.3, 1.2, 0.5, 0.6)[number]
    m, bodies = free_bodies(masses)
    shapes = [shape_of(number + k * (number > 1), body) for k, body in enumerate(bodies)]
    m.contacts("c", shapes, law={**RIGID, "friction": friction, "restitution": restitution})
    mod = m.compile(**IN_C)
    x = np.zeros(18)
    for k, place in enumerate([(0.0, 0.0), (0.4, 0.02), (-0.4, -0.02)]):
        x[3 * k : 3 * k + 2], x[3 * k + 2] = place, random.uniform(-1, 1)
        x[9 + 3 * k : 11 + 3 * k] = np.multiply(place, -4.0) + 0.1 * random.standard_normal(2)
        x[11 + 3 * k] = 3.0 * random.standard_normal()
    run = mod.simulate(0.4, dict(zip(mod.x_names, x, strict=True)), method="moreau", step=1e-3)
    energy = np.array([mod.energy(column)[0] for column in run.x.T])
    assert np.diff(energy).max() <= 1e-9 * energy[0]
    assert np.abs(run.x[9:, -1] - run.x[9:, 0]).max() > 0.1  # they met
    found, size = both_momenta(masses, run.x)
    np.testing.assert_allclose(found[:2], found[:2, :1] * np.ones_like(found[:2]), atol=1e-10 * size)
    # places are moved by the scheme's mean velocities, so that the angular momentum is kept as well
    np.testing.assert_allclose(found[2], found[2, 0], atol=1e-11 * size)


def push(order: int) -> np.ndarray:
    """Accelerations times masses in one scene, described in several ways."""
    masses = np.array([1.0, 1e6, 2.0])
    m, (a, b, c) = free_bodies(masses)
    left, right = [shape_of(0, a), shape_of(1, b)], [shape_of(2, c)]
    if order == 0:
        m.contacts("c", left, right, SOFT)
    elif order == 1:
        m.contacts("c", right, left, SOFT)
    elif order == 2:
        m.contacts("c", left[::-1], right, SOFT)
    else:
        m.contacts("c", left[:1], right, SOFT)
        m.contacts("d", left[1:], right, SOFT)
    places, speeds = [0.0, 0.0, 0.1, 0.3, 0.01, -0.2, 0.15, 0.02, 0.4], [0.3, -0.2, 1.0, 0.1, 0.2, -1.0, 0.0, 0.5, 2.0]
    x = np.array([*places, *speeds])
    mod = m.compile(target="numpy", kernels=["rhs"])
    return mod.rhs(0.0, x)[9:] * np.repeat(masses, 3)


def test_order_and_split_of_groups_change_nothing() -> None:
    found = push(0)
    assert np.abs(found).max() > 1.0
    assert np.abs(found.reshape(3, 3)[:, :2].sum(axis=0)).max() < 1e-12 * np.abs(found).max()
    for order in (1, 2, 3):
        np.testing.assert_allclose(push(order), found, rtol=1e-10, atol=1e-9)


def test_a_shape_in_both_groups_and_groups_without_shapes_are_refused() -> None:
    """So that no pair is counted twice."""
    for first, second, told in (
        (2, 2, "EG-CONFLICT contacts.c.second"),
        (0, 2, "EG-MISSING contacts.c"),
        (2, 0, "EG-MISSING contacts.c"),
    ):
        m, bodies = free_bodies(np.array([1.0, 2.0]))
        both = [{**ROUND, "on": body} for body in bodies]
        m.contacts("c", both[:first], both[:second], SOFT)
        refuses(told, m.compile, target="numpy")
