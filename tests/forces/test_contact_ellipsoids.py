"""Ellipsoids on each other and on capsules: nearest points that are known, spheres, runs without loss."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from flying_bodies import ELASTIC, check_hit, check_slopes, depth_of, flying, state
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

AXES = np.array([(0.2, 0.1, 0.08), (0.15, 0.06, 0.12)])
PAIR = [{"shape": "ellipsoid", "semi_axes": tuple(axes)} for axes in AXES]
ROD = {"shape": "capsule", "length": 0.4, "radius": 0.05}
OWN = Rotation.from_euler("xyz", (0.2, 0.5, -0.3))


#: Polar angles of points all over the first ellipsoid, and the points.
ANGLES = np.array([(p, q) for p in np.linspace(0, 2 * np.pi, 64, endpoint=False) for q in np.linspace(0.05, 3.09, 32)])
NET = AXES[0] * np.stack(
    [np.cos(ANGLES[:, 0]) * np.sin(ANGLES[:, 1]), np.sin(ANGLES[:, 0]) * np.sin(ANGLES[:, 1]), np.cos(ANGLES[:, 1])], 1
)


def support(turn: Rotation, axes: np.ndarray, n: np.ndarray) -> np.ndarray:
    """The farthest point of an ellipsoid along a direction, from its centre."""
    local = turn.inv().apply(n)
    return turn.apply(axes**2 * local / np.linalg.norm(axes * local))


def test_two_ellipsoids_of_known_normal() -> None:
    """Both are put so that they touch at a chosen normal and are then moved along it, in turned frames."""
    m, (a, b) = flying(2)
    m.contacts("touch", {**PAIR[0], "on": a.at(0.03, 0.01, 0, rpy=(0.2, 0.5, -0.3))}, {**PAIR[1], "on": b}, ELASTIC)
    mods = [m.compile(target=target) for target in ("numpy", "cython")]
    rng = np.random.default_rng(3)
    for k in range(40):
        turns = [Rotation.random(random_state=rng.integers(1 << 30)) for _ in "ab"]
        n = rng.standard_normal(3)
        n /= np.linalg.norm(n)
        depth = rng.uniform(1e-3, 8e-3)
        centre = turns[0].apply((0.03, 0.01, 0))
        place = centre + support(turns[0] * OWN, AXES[0], n) + support(turns[1], AXES[1], n) - depth * n
        x = state(mods[0], [(0, 0, 0), place], turns)
        for mod in mods:
            assert depth_of(mod, x) == pytest.approx(depth, abs=1e-11)
        force = -mods[1].bias(0.0, x)
        push = 2e4 * depth**1.5
        assert np.linalg.norm(force[6:9]) == pytest.approx(push, rel=1e-8)
        assert np.abs(force[:3] + force[6:9]).max() <= 1e-12 * push
        if k < 4:
            check_slopes(mods[1], x)
            one, other = (mod.jacobian(0.0, x) for mod in mods)
            assert np.abs(one - other).max() <= 1e-9 * np.abs(other).max()
            h = 1e-7
            steps = h * np.eye(mods[1].n_x)[: mods[1].n_q]
            slopes = np.array([(mods[1].rhs(0.0, x + e) - mods[1].rhs(0.0, x - e)) / (2 * h) for e in steps]).T
            assert np.abs(slopes - other[:, : mods[1].n_q]).max() <= 1e-5 * np.abs(slopes).max()
        apart = state(mods[0], [(0, 0, 0), place + 1.001 * depth * n], turns)
        assert all(mod.energy(apart)[1] == 0.0 for mod in mods)


def test_ellipsoids_of_equal_axes_are_spheres() -> None:
    values = []
    for first, second in (("sphere", "sphere"), ("ellipsoid", "ellipsoid")):
        shapes = [
            {"shape": kind, **({"radius": r} if kind == "sphere" else {"semi_axes": (r, r, r)})}
            for kind, r in ((first, 0.1), (second, 0.06))
        ]
        m, (a, b) = flying(2)
        m.contacts(
            "touch", {**shapes[0], "on": a}, {**shapes[1], "on": b}, {**ELASTIC, "friction": 0.3, "smoothing": 0.01}
        )
        mod = m.compile(target="numpy")
        x = state(mod, [(0, 0, 0), (0.1, 0.05, 0.09)], [OWN, OWN.inv()])
        x[mod.n_q :] = np.linspace(-1, 1, 12)
        together = state(mod, [(0, 0, 0), (0, 0, 0)], [OWN, OWN])
        values.append([*mod.rhs(0.0, x), *mod.rhs(0.0, together)])
    assert np.abs(values[0]).max() > 10.0
    np.testing.assert_allclose(values[1], values[0], rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("swapped", [False, True])
def test_an_ellipsoid_and_a_capsule(swapped: bool) -> None:
    """Against the least distance of points of the surface and of the axis that SciPy finds, at middles and ends."""
    m, (a, b) = flying(2)
    groups = [{**PAIR[0], "on": a.at(0.03, 0.01, 0, rpy=(0.2, 0.5, -0.3))}, {**ROD, "on": b}]
    m.contacts("touch", *(groups[::-1] if swapped else groups), ELASTIC)
    mods = [m.compile(target=target) for target in ("numpy", "cython")]
    rng, met = np.random.default_rng(12), {"middle": 0, "end": 0}
    for _ in range(100):
        turns = [Rotation.random(random_state=rng.integers(1 << 30)) for _ in "ab"]
        frame = turns[0] * OWN
        way = rng.standard_normal(3)
        surface = frame.apply(AXES[0] * way / np.linalg.norm(way)) + turns[0].apply((0.03, 0.01, 0))
        out = frame.apply(way / AXES[0] / np.linalg.norm(way / AXES[0]))
        along = turns[1].apply((0, 0, 1))
        place = surface + rng.uniform(0.01, 0.045) * out + rng.uniform(-0.25, 0.25) * along

        # in axes of the ellipsoid; a search starts at the nearest corner of a fine net
        there, axis = frame.inv().apply([place - turns[0].apply((0.03, 0.01, 0)), along])
        flat = (NET - there) @ axis
        nearest = int(np.argmin(((NET - there - np.clip(flat, -0.2, 0.2)[:, None] * axis) ** 2).sum(axis=1)))

        def square(s: np.ndarray, there: np.ndarray = there, axis: np.ndarray = axis) -> float:
            (p, q, t), (a, b, c) = s.tolist(), AXES[0].tolist()
            u = a * math.cos(p) * math.sin(q), b * math.sin(p) * math.sin(q), c * math.cos(q)
            return float(((u - there - t * axis) ** 2).sum())

        start = (*ANGLES[nearest], np.clip(flat[nearest], -0.2, 0.2))
        bounds = [(-1, 8), (-1, 4.2), (-0.2, 0.2)]
        found = minimize(square, start, bounds=bounds, options={"ftol": 1e-16, "gtol": 1e-11})
        body = place - turns[0].apply((0.03, 0.01, 0))
        t = np.linspace(-0.2, 0.2, 81)
        line = frame.inv().apply(body + t[:, None] * along) / AXES[0]
        depth = 0.05 - np.sqrt(found.fun)
        if depth < 2e-3 or ((line**2).sum(axis=1) < 1.02).any():
            continue
        met["middle" if abs(found.x[2]) < 0.199 else "end"] += 1
        x = state(mods[0], [(0, 0, 0), place], turns)
        for mod in mods:
            assert depth_of(mod, x) == pytest.approx(depth, abs=3e-7)
        if sum(met.values()) <= 4:
            check_slopes(mods[1], x)
            one, other = (mod.jacobian(0.0, x) for mod in mods)
            assert np.abs(one - other).max() <= 1e-9 * np.abs(other).max()
        if sum(met.values()) > 30:
            break
    assert min(met.values()) >= 3


@pytest.mark.parametrize("other", [PAIR[1], ROD])
def test_lossless_hits_keep_energy_and_momentum(other: dict[str, Any]) -> None:
    m, (a, b) = flying(2)
    m.contacts("touch", {**PAIR[0], "on": a}, {**other, "on": b}, ELASTIC)
    check_hit(m.compile(), 0.4)


def test_a_sphere_about_the_centre_of_an_ellipsoid_leaves_along_its_least_axis() -> None:
    """Also from places on its greatest axis, of which no nearest point is unique."""
    m, (a, b) = flying(2)
    m.contacts("touch", {**PAIR[0], "on": a}, {"shape": "sphere", "radius": 0.02, "on": b}, ELASTIC)
    for target in ("numpy", "cython"):
        mod = m.compile(target=target)
        for place, depth in (((0, 0, 0), 0.1), ((0, 0, 0.01), 0.09), ((0, 0, -0.01), 0.09), ((0.05, 0, 0), None)):
            x = state(mod, [(0, 0, 0), place], [Rotation.identity()] * 2)
            force = -mod.bias(0.0, x)
            assert np.isfinite(mod.jacobian(0.0, x)).all()
            if depth is not None:
                np.testing.assert_allclose(np.abs(force[6:9]), [0, 0, 2e4 * depth**1.5], rtol=1e-4, atol=1e-6)
                assert force[8] * (place[2] or 1.0) > 0
            else:  # nearest points of the section y = 0 of half axes A and c: x A^2 / (A^2 - c^2) along x
                at = 0.05 * 0.2**2 / (0.2**2 - 0.08**2)
                up = 0.08 * np.sqrt(1 - (at / 0.2) ** 2)
                wanted = 0.02 + np.hypot(at - 0.05, up)
                assert depth_of(mod, x) == pytest.approx(wanted, rel=1e-4)
