"""Rigid contacts of free bodies: impulses never give energy and keep both momenta; laws too, in any order of groups."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import pytest
from contact_scenes import momenta
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


def free_bodies(masses: Sequence[Any]) -> tuple[eg.Model, list[Any]]:
    m = eg.Model("rigid", gravity=(0, 0, 0))
    for name in masses:
        if isinstance(name, str):
            m.parameter(name, 1.0)
    bodies = [m.body(f"b{k}", mass=x, inertia={"zz": f"0.005*{x}"}) for k, x in enumerate(masses)]
    for k, body in enumerate(bodies):
        m.planar(f"j{k}", m.ground, body)
    return m, bodies


@cache
def three_bodies() -> eg.Module:
    """Of masses, friction and restitution that are parameters; each is a shape with another beside it."""
    m, bodies = free_bodies(("m0", "m1", "m2"))
    m.parameter("mu", 0.0), m.parameter("e", 0.0)
    shapes = [shape_of(k + more, body.at(0.05 * more, 0, 0)) for k, body in enumerate(bodies) for more in (0, 1)]
    m.contacts("c", shapes, law={**RIGID, "friction": "mu", "restitution": "e"})
    return m.compile(**IN_C)


@pytest.mark.parametrize(("seed", "count"), part_of([(3, 10), *((seed, 50) for seed in range(31, 37))], (3, 10).__eq__))
def test_impulses_keep_momenta_and_give_no_energy(seed: int, count: int) -> None:
    """Restitutions of 0 to 1, friction, masses of 1 to 1e6, three bodies that meet at once, none of them ground."""
    mod, random, met = three_bodies(), np.random.default_rng([seed, 31]), 0
    whole = 0
    for k in range(count):
        masses = 10.0 ** np.array([0.0, random.uniform(-3, 3), random.uniform(-3, 3)])
        law = {"e": (0.0, 1.0, random.uniform())[k % 3], "mu": (0.0, random.uniform(0, 1.2))[k % 2]}
        x = np.zeros(18)
        for n, place in enumerate([(0.0, 0.0), (0.45, 0.02), (-0.45, -0.02)]):
            x[3 * n : 3 * n + 2], x[3 * n + 2] = place, random.uniform(-3, 3)
            x[9 + 3 * n : 11 + 3 * n] = np.multiply(place, -4.0) + 0.1 * random.standard_normal(2)
            x[11 + 3 * n] = 3.0 * random.standard_normal()
        own = mod.bind({**law, **{f"m{n}": mass for n, mass in enumerate(masses)}})
        run = own.simulate(0.4, dict(zip(mod.x_names, x, strict=True)), method="moreau", step=1e-3)
        energy = own.energy(run.x)[0]
        assert np.diff(energy).max() <= 1e-9 * energy[0]
        met += np.abs(run.x[9:, -1] - run.x[9:, 0]).max() > 0.1
        found, size = momenta(masses, 0.005 * masses, run.x)
        assert np.abs(found[:2] - found[:2, :1]).max() < 1e-10 * size
        if run.metadata["steps"] > 400:
            continue  # a step was taken in parts, which are not stored
        # places are moved by the scheme's mean velocities, so that the angular momentum is kept as well, but for what
        # is removed of penetrations, by which places are moved besides
        q, v = run.x[:9].reshape(3, 3, -1)[:, :2], run.x[9:].reshape(3, 3, -1)[:, :2]
        removed = np.diff(q) - 0.5 * np.diff(run.t) * (v[..., 1:] + v[..., :-1])
        turned = removed[:, 0] * v[:, 1, 1:] - removed[:, 1] * v[:, 0, 1:]
        assert np.abs(np.diff(found[2]) - masses @ turned).max() < 1e-11 * size
        assert np.abs(masses @ removed[:, 0]).max() < 1e-11 * masses.max()
        whole += 1
    assert met > 0.7 * count
    assert whole > 0.9 * count


def push(order: int) -> np.ndarray:
    """Accelerations times masses in one scene, described in several ways."""
    masses = np.array([1.0, 1e6, 2.0])
    m, (a, b, c) = free_bodies(masses.tolist())
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
        m, bodies = free_bodies([1.0, 2.0])
        both = [{**ROUND, "on": body} for body in bodies]
        m.contacts("c", both[:first], both[:second], SOFT)
        refuses(told, m.compile, target="numpy")
