"""Shapes that turn, and pieces of ground: no run steps over their contacts; judged by runs of small steps."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import eomgen as eg


@cache
def thrown(name: str, target: str) -> Any:
    """A body in space without gravity before a half-space or another body."""
    shape, other = SOLIDS[name]
    m = eg.Model("thrown", gravity=(0, 0, 0))
    a = m.body("a", mass=1.0, inertia={"xx": 0.02, "yy": 0.03, "zz": 0.025})
    m.free("j", m.ground, a)
    m.contacts("c", {**shape, "on": a}, {**other, "on": m.ground}, {"stiffness": 1e7})
    m.output("energy", "total_energy")
    return m.compile(target=target)


SOLIDS = {
    "ellipsoid": ({"shape": "ellipsoid", "semi_axes": [0.02, 0.3, 0.02]}, {"shape": "half_space"}),
    "capsules": (
        {"shape": "capsule", "length": 0.8, "radius": 0.01},
        {"shape": "capsule", "length": 0.6, "radius": 0.01},
    ),
    "cuboid": ({"shape": "cuboid", "size": [0.01, 0.5, 0.01]}, {"shape": "half_space"}),
    "capsule": ({"shape": "capsule", "length": 0.8, "radius": 0.01}, {"shape": "half_space"}),
}


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("name", SOLIDS)
def test_turning_bodies_do_not_pass(name: str, target: str) -> None:
    """A long thin body that spins fast and flies slowly: its tip sweeps many times a flight."""
    module, judge = thrown(name, target), thrown(name, "cython")
    rng = np.random.default_rng(3)
    met = 0
    for _ in range(6 if target == "cython" else 2):
        start = {"j_z": 0.9, "j_x": 0.005, "j_z_dot": -1.5, "j_1_dot": rng.uniform(30.0, 90.0), "j_3_dot": rng.normal()}
        free = module.simulate((0, 0.8), initial=start)
        small = judge.simulate((0, 0.8), initial=start, max_step=2e-5)
        pushed = [run["j_z_dot"] != start["j_z_dot"] for run in (free, small)]
        assert pushed[0].any() == pushed[1].any()
        if not pushed[1].any():
            continue
        met += 1
        first = [run.t[hit][0] for run, hit in zip((free, small), pushed, strict=True)]
        assert first[0] == pytest.approx(first[1], abs=2e-3)
        assert np.ptp(free["energy"]) < 1e-3 * free["energy"][0]
    assert met > 0


@pytest.mark.parametrize("shape", ["profile", "smooth_profile"])
@pytest.mark.parametrize("speed", [2.0, 20.0, 50.0])
def test_balls_do_not_pass_through_a_bump(shape: str, speed: float) -> None:
    module = bump(shape, "numpy" if speed == 20.0 else "cython")
    for height in (0.1, 0.2, 0.35):
        run = module.simulate((0, 4.0 / speed), initial={"j_x_dot": speed, "j_y": height})
        assert run["j_x"].max() < 2.05
        assert np.hypot(run["j_x_dot"][-1], run["j_y_dot"][-1]) == pytest.approx(speed, rel=1e-4)
    over = module.simulate((0, 4.0 / speed), initial={"j_x_dot": speed, "j_y": 0.6})
    assert over["j_x"][-1] == pytest.approx(4.0, rel=1e-9)
    assert len(over.t) < 60


@cache
def bump(shape: str, target: str) -> Any:
    """A ball beside a narrow hill of a profile."""
    m = eg.Model("bump", gravity=(0, 0, 0))
    ball = m.body("ball", mass=1.0, inertia={"zz": 0.0004})
    m.planar("j", m.ground, ball)
    points = [[-5, 0], [1.9, 0], [2.0, 0.4], [2.1, 0], [5, 0]]
    ground = {"shape": shape, "on": m.ground, "points": points, "depth": 0.3}
    m.contacts("c", {"shape": "circle", "on": ball, "radius": 0.05}, ground, {"stiffness": 1e7})
    return m.compile(target=target)
