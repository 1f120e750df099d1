"""Accelerations and velocities of joints whose directions change as they move, in closed form and as differences."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.equations import METHODS

KINDS: dict[str, dict[str, Any]] = {
    "revolute": {}, "prismatic": {}, "cylindrical": {}, "planar": {}, "universal": {}, "screw": {"pitch": 0.4},
    "spherical": {}, "free": {"sequence": "zxz"}, "constant_velocity": {},
}  # fmt: skip


@pytest.mark.parametrize("method", METHODS)
def test_a_bead_on_a_parabola(method: str) -> None:
    """z = c x^2: (1 + 4 c^2 x^2) x'' + 4 c^2 x x'^2 + 2 g c x = 0 (Goldstein, exercise 1.19, at rest)."""
    c = 0.7
    m = eg.Model("bead", gravity=(0, 0, -9.81))
    bead = m.body("bead", mass=1.7)
    m.curve_slider("wire", m.ground, bead, curve=["s", 0, f"{c}*s**2"], coordinate="s")
    mod = m.compile(method=method, target="numpy")
    for x, v in ((0.4, 2.0), (-1.1, 0.6)):
        expected = -(4 * c**2 * x * v**2 + 2 * 9.81 * c * x) / (1 + 4 * c**2 * x**2)
        assert mod.rhs(0.0, np.array([x, v])) == pytest.approx([v, expected], rel=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_a_heavy_top_in_euler_angles(method: str) -> None:
    """Steady precession: A p^2 cos(theta) - C (r + p cos(theta)) p + m g l = 0 (Goldstein, sec. 5.7)."""
    A, C, mgl, theta, spin = 0.8, 0.3, 2.0 * 9.81 * 0.25, 0.6, 40.0
    m = eg.Model("top", gravity=(0, 0, -9.81))
    body = m.body("top", mass=2.0, com=(0, 0, 0.25), inertia=(A - 2.0 * 0.25**2, A - 2.0 * 0.25**2, C))
    m.spherical("tip", m.ground, body, sequence="zxz")
    mod = m.compile(method=method, target="numpy")
    roots = np.roots([(A - C) * np.cos(theta), -C * spin, mgl])
    for p in roots.real:
        x = np.array([0.4, theta, 1.3, p, 0.0, spin])
        assert mod.rhs(0.0, x)[3:] == pytest.approx([0.0, 0.0, 0.0], abs=1e-9 * (p * p + spin * spin))


@pytest.mark.parametrize("kind", KINDS)
def test_joints_from_the_second_body_to_the_first(kind: str) -> None:
    """The tree passes such a joint backwards: velocity of a point of the body behind it, as a difference of places."""
    m = eg.Model("backwards", gravity=(0, 0, 0))
    first = m.body("first", mass=1.0, inertia=(1, 1, 1))
    second = m.body("second", mass=1.0, com=(0.1, 0.2, 0.3), inertia=(1, 2, 2))
    m.revolute("A", m.ground, first, axis="y")
    near = second.at(0.3, -0.2, 0.1, rpy=(0.4, 0.2, -0.3))
    getattr(m, kind)("B", near, first.at(0.5, 0.1, 0.2, rpy=(-0.2, 0.5, 0.3)), **KINDS[kind])
    tip = second.marker("tip", at=(0.4, 0.5, -0.6))
    for k, letter in enumerate("xyz"):
        m.output(f"at_{letter}", tip.position[k])
        m.output(f"speed_{letter}", tip.velocity[k])
    mod = m.compile(target="numpy")
    n, rng, h = mod.n_q, np.random.default_rng(5), 1e-4
    q, v = rng.uniform(0.3, 0.9, n), rng.uniform(-1.0, 1.0, n)

    def places(s: float) -> np.ndarray:
        return np.array(mod.outputs(0.0, np.concatenate([q + s * v, v])))[::2]

    expected = (8.0 * (places(h) - places(-h)) - (places(2 * h) - places(-2 * h))) / (12.0 * h)
    assert mod.outputs(0.0, np.concatenate([q, v]))[1::2] == pytest.approx(expected, abs=1e-10)
