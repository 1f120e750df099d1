"""A ball on a floor that moves by itself: Newton's law holds for the velocity relative to it."""

from __future__ import annotations

import numpy as np
import pytest

import eomgen as eg

REST, SPEED = 0.6, 0.8


def ball(floor: str, **inputs: float) -> eg.Model:
    m = eg.Model("ball", gravity=(0, 0, -9.81))
    m.prismatic("J", m.ground, m.body("ball", mass=1.0), axis="z", coordinate="z")
    for name, value in inputs.items():
        m.input(name, value)
    m.event("bounce", f"z - {floor}", direction=-1, restitution=REST)
    return m


@pytest.mark.parametrize("method", ["DOP853", "LSODA"])
@pytest.mark.parametrize("way", ["in time", "by an input"])
def test_a_floor_that_rises(way: str, method: str) -> None:
    """Seen from the floor, z - V t falls from 1 m at the speed V and rises at e times the speed of the impact."""
    moving, given = (f"{SPEED}*t", {}) if way == "in time" else ("h", {"h": f"{SPEED}*t"})
    mod = ball(moving, **({"h": 0.0} if given else {})).compile(target="numpy")
    run = mod.simulate(0.9, {"z": 1.0, "z_dot": 0.0}, inputs=given, method=method, rtol=1e-10, atol=1e-12)
    fall = (-SPEED + np.sqrt(SPEED**2 + 2 * 9.81)) / 9.81
    hit = -(SPEED + 9.81 * fall)
    assert run.t_events["bounce"][0] == pytest.approx(fall, abs=1e-7)
    after = 0.9 - fall
    assert after < 2 * REST * abs(hit) / 9.81
    assert run["z_dot"][-1] == pytest.approx(SPEED - REST * hit - 9.81 * after, abs=1e-6)
    assert run["z"][-1] == pytest.approx(SPEED * 0.9 - REST * hit * after - 9.81 * after**2 / 2, abs=1e-6)
