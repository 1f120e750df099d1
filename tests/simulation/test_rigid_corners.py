"""Rigid contact beside corners of outlines and profiles: what is not touched is not pulled."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg

WALL = [(-1.0, -0.3), (0.0, -0.3), (0.0, 0.0), (-1.0, 0.0)]
HILL = [(-1.0, 0.0), (-0.2, 0.0), (0.0, 0.6), (0.2, 0.0), (1.0, 0.0)]
SPROCKET: dict[str, Any] = {"shape": "sprocket", "teeth": 9, "pitch": 0.1, "seat": 0.022, "tip_radius": 0.165}


def ball(second: dict[str, Any], target: str) -> Any:
    m = eg.Model("fall", gravity=(0, -9.81, 0))
    body = m.body("b", mass=1.0, inertia={"zz": 0.005})
    m.planar("j", m.ground, body)
    first = {"shape": "circle", "on": body, "radius": 0.1}
    m.contacts("c", first, {"on": m.ground, **second}, {"normal_law": "rigid"})
    return m.compile(target=target)


@pytest.mark.parametrize(
    ("second", "start"),
    [
        ({"shape": "outline", "points": WALL}, {"j_x": 0.12, "j_y": 0.3}),
        ({"shape": "profile", "points": HILL, "depth": 0.2}, {"j_x": -0.5, "j_y": 0.9, "j_x_dot": 3.0, "j_y_dot": 1.0}),
        ({"shape": "profile", "points": HILL, "depth": 0.2}, {"j_x": 0.33, "j_y": 0.6}),
        (SPROCKET, {"j_x": 0.272, "j_y": 0.5}),
    ],
)
def test_what_passes_beside_a_corner_falls_freely(second: dict[str, Any], start: dict[str, float]) -> None:
    mod = ball(second, "numpy")
    run = mod.simulate(0.25, start, method="moreau", step=1e-3)
    t = run.t
    y = start["j_y"] + start.get("j_y_dot", 0.0) * t - 0.5 * 9.81 * t**2
    free = y > 0.12 if second["shape"] == "profile" else t >= 0
    np.testing.assert_allclose(run["j_x"][free], (start["j_x"] + start.get("j_x_dot", 0.0) * t)[free], atol=1e-12)
    np.testing.assert_allclose(run["j_y"][free], y[free], atol=1e-9)


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_a_ball_rests_on_the_top_of_a_wall_and_against_its_side(target: str) -> None:
    """It still touches edges and corners: on the top, and pushed against the side."""
    mod = ball({"shape": "outline", "points": WALL}, target)
    run = mod.simulate(0.5, {"j_x": -0.3, "j_y": 0.15}, method="moreau", step=1e-3)
    assert run["j_y"][-1] == pytest.approx(0.1, abs=1e-6)
    run = mod.simulate(0.1, {"j_x": 0.15, "j_y": -0.1, "j_x_dot": -2.0}, method="moreau", step=1e-3)
    assert run["j_x"].min() == pytest.approx(0.1, abs=2.1e-3)
    assert run["j_x_dot"][-1] == pytest.approx(0.0, abs=1e-9)
    run = mod.simulate(0.3, {"j_x": 0.0, "j_y": 0.12}, method="moreau", step=1e-3)  # on the corner
    assert run["j_y"][-1] == pytest.approx(0.1, abs=2e-3)
