"""Places of contact that begin deep in an overlap: forces of moving circles are continuous there and take energy."""

from __future__ import annotations

from typing import Any

import contact_scenes as scenes
import numpy as np
import pytest
from contact_scenes import on

import eomgen as eg

S = 0.15
CORNERS = [(-S, -S), (S, -S), (0.2 * S, 0.1 * S), (0.0, S)]
SHAPES: dict[str, dict[str, Any]] = {
    "sprocket": {"shape": "sprocket", "teeth": 7, "pitch": S, "seat": 0.2 * S, "tip_radius": 1.4 * S},
    "outline": {"shape": "outline", "points": CORNERS},
    "smooth_outline": {"shape": "smooth_outline", "points": CORNERS},
}
ELASTIC: dict[str, Any] = {"stiffness": 1e4, "exponent": 1.5}
COULOMB = {**ELASTIC, "dissipation": 0.4, "friction": 0.5, "smoothing": 1e-2}
BRISTLES = {
    **ELASTIC, "dissipation": 0.4, "friction": 0.5, "friction_law": "lugre", "bristle_stiffness": 300.0,
    "bristle_damping": 2.0, "lateral": False,
}  # fmt: skip
BENT = 0.3  #: states of bristles
#: Part of the largest force that changes within 1e-5 of a way of about 0.2 m.
JUMP, CONTINUOUS = 0.03, 1e-3


def module(shape: dict[str, Any], law: dict[str, Any], radius: float = 0.64 * S) -> eg.Module:
    """A circle of 3.2 seats of the sprocket on a shape that stands."""
    m, (ball,) = scenes.planar("birth", 1, (0, 0, 0))
    m.contacts("c", {"shape": "circle", "on": ball, "radius": radius}, on(shape, m.ground), law)
    return m.compile(target="numpy")


def exerted(mod: eg.Module, places: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force and moment on the circle at some places, in N and by 0.1 m: of one that moves, and of one at rest."""
    x, count = np.zeros((mod.n_x, 2 * places.shape[1])), places.shape[1]
    x[:2] = np.tile(places, 2)
    x[3:6, :count], x[6:, :count] = v[:, None], BENT
    found = np.array(mod.rhs(0.0, x))[3:6] * np.array([1.0, 1.0, 0.1])[:, None]
    return found[:, :count], found[:, count:]


def jumps(mod: eg.Module, ways: int, points: int = 1200) -> tuple[int, list[tuple[float, np.ndarray]]]:
    """Ways on which motion adds a force, and where that jumps though the force of a circle at rest does not."""
    random, judged, found = np.random.default_rng(1), 0, []
    for _ in range(ways):
        a, b = random.uniform(-1.5 * S, 1.5 * S, (2, 2))
        v = random.standard_normal(3)

        def added(t: np.ndarray, a: np.ndarray = a, b: np.ndarray = b, v: np.ndarray = v) -> np.ndarray:
            moving, still = exerted(mod, a[:, None] + t * (b - a)[:, None], v)
            return np.stack([moving - still, still])

        t = np.linspace(0.0, 1.0, points)
        first = added(t)
        every = np.abs(first).max(axis=(1, 2))
        if not every.all():
            continue
        judged += 1
        steps = np.abs(np.diff(first[0], axis=1)).max(axis=0) / every[0]
        for k in np.argsort(steps)[-6:]:
            if steps[k] <= JUMP:
                continue
            low, high = t[k], t[k + 1]
            while steps[k] > JUMP and high - low > 1e-5:
                middle = 0.5 * (low + high)
                left, right = np.abs(np.diff(added(np.array([low, middle, high]))[0], axis=1)).max(axis=0)
                low, high = (low, middle) if left > right else (middle, high)
            change, still = np.abs(np.diff(added(np.array([low, high])), axis=2)).max(axis=(1, 2)) / every
            if change > JUMP and still < CONTINUOUS:
                found.append((float(change), a + low * (b - a)))
    return judged, found


@pytest.mark.parametrize("law", [COULOMB, BRISTLES], ids=["coulomb", "lugre"])
@pytest.mark.parametrize("kind", SHAPES)
def test_damping_and_friction_begin_at_zero(kind: str, law: dict[str, Any]) -> None:
    judged, found = jumps(module(SHAPES[kind], law), 12)
    assert judged >= 10
    assert found == []


@pytest.mark.parametrize("kind", SHAPES)
def test_what_motion_adds_takes_energy(kind: str) -> None:
    mod, random = module(SHAPES[kind], COULOMB), np.random.default_rng(2)
    places = random.uniform(-1.5 * S, 1.5 * S, (2, 4000))
    for _ in range(4):
        v = random.standard_normal(3) * (1.0, 1.0, 10.0)
        added = np.subtract(*exerted(mod, places, v))
        power = added[:2].T @ v[:2] + added[2] * v[2] * 0.1  # the moment is in 10 N m / 0.01 kg m^2 of inertia
        assert (power <= 1e-9 * np.abs(power).max()).all()
        assert (power < 0.0).sum() > 1000


def test_a_circle_in_a_wide_groove_has_the_damping_of_both_sides() -> None:
    """It is pressed by 1 cm into walls of 45 degrees and does not reach the inner corner."""
    groove = [(-0.3, 0.3), (0.0, 0.0), (0.3, 0.3), (0.3, -0.2), (-0.3, -0.2)]
    law, radius, depth, speed = COULOMB, 0.1, 0.01, 0.2
    mod = module({"shape": "outline", "points": groove}, {**law, "friction": 0.0}, radius)
    height = (radius - depth) * np.sqrt(2.0)
    force = exerted(mod, np.array([[0.0], [height]]), np.array([0.0, -speed, 0.0]))[0][:, 0]
    push = 1e4 * depth**1.5 * (1.0 + 0.4 * speed / np.sqrt(2.0))
    np.testing.assert_allclose(force, [0.0, np.sqrt(2.0) * push, 0.0], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("dent", [1e-4, -1e-4])
def test_a_corner_that_hardly_turns_is_no_corner(dent: float) -> None:
    """Nor does it matter where a circle stands beside it, however deep."""
    plain = [(-0.3, 0.0), (0.3, 0.0), (0.3, -0.3), (-0.3, -0.3)]
    bent = [plain[0], (0.0, -dent * 0.3), *plain[1:]]
    places = np.stack([np.linspace(-0.02, 0.02, 801), np.full(801, 0.06)])
    v = np.array([0.5, -0.3, 2.0])
    one, two = (exerted(module({"shape": "outline", "points": p}, COULOMB, 0.1), places, v)[0] for p in (plain, bent))
    assert np.abs(one).max(axis=1).min() > 1.0
    np.testing.assert_allclose(one, two, atol=3e-3 * np.abs(one).max())
