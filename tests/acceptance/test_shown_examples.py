"""Jansen's leg beside circles that are cut by hand, and the forces of a V engine beside the textbook's series."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import eomgen as eg

EXAMPLES = Path(__file__).parents[2] / "examples"


def meet(a: np.ndarray, ra: float, b: np.ndarray, rb: float) -> list[np.ndarray]:
    """Both points at distances ra of a and rb of b."""
    way = b - a
    length = np.hypot(*way)
    along = (ra**2 - rb**2 + length**2) / (2 * length)
    off = np.sqrt(ra**2 - along**2)
    u = way / length
    return [a + along * u + side * off * np.array([-u[1], u[0]]) for side in (1.0, -1.0)]


def test_jansens_foot_is_where_the_circles_meet() -> None:
    a, b, c, d, e, f, g, h, i, j, k, l, m = np.array(
        [38, 41.5, 39.3, 40.1, 55.8, 39.4, 36.7, 65.7, 49, 50, 61.9, 7.8, 15]
    )
    mod = eg.load(EXAMPLES / "jansen_leg.yaml").compile(target="numpy")
    traj = mod.simulate(1.0, t_eval=np.linspace(0.0, 1.0, 25))
    for t, x, y in zip(traj.t, traj["foot_x"], traj["foot_y"], strict=True):
        P, B = m * np.array([np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)]), np.array([-a, -l])
        C = max(meet(P, j, B, b), key=lambda p: p[1])
        E = min(meet(P, k, B, c), key=lambda p: p[1])
        D = min(meet(B, d, C, e), key=lambda p: p[0])
        F = min(meet(D, f, E, g), key=lambda p: p[0])
        G = min(meet(E, i, F, h), key=lambda p: p[1])
        assert [100 * x, 100 * y] == pytest.approx(G, abs=1e-9)
    # flat for half a turn: the lower part of the path is straight within a unit, over more than 40
    low = traj["foot_y"] < traj["foot_y"].min() + 0.01
    assert low.sum() >= 10
    assert np.ptp(traj["foot_x"][low]) > 0.4


def test_a_v_engine_at_90_degrees_has_no_primary_force() -> None:
    """Norton, Design of Machinery, ch. 14: with A2 = n + n^3 / 4 + 15 n^5 / 128 of n = r/l, each piston's inertia force
    has the parts m r w^2 (cos a + A2 cos 2a + ...) along its cylinder; at 90 degrees the first of both turn with the
    crank, and the counterweight takes them; the second are sqrt(2) m r w^2 A2 across the V."""
    mod = eg.load(EXAMPLES / "v_twin.yaml").compile(target="numpy")
    omega, r, l, m = 100 * np.pi, 0.04, 0.16, 0.5
    t = np.arange(64) / 64 * 0.02
    traj = mod.simulate(0.02, t_eval=t)
    reactions = mod.reactions(traj.t, traj.x)
    held = [k for k, name in enumerate(mod.joint_names) if name in ("bearing", "cylinder_1", "cylinder_2")]
    shaking = -reactions[held, :2].sum(axis=0)  # what the engine exerts on its frame
    spectrum = np.fft.rfft(shaking, axis=1) / 32
    n = r / l
    second = np.sqrt(2) * m * r * omega**2 * (n + n**3 / 4 + 15 * n**5 / 128)
    assert np.abs(spectrum[:, 1]).max() < 1e-9 * second
    assert abs(spectrum[0, 2]) == pytest.approx(second, rel=2e-4)  # the series ends
    assert abs(spectrum[1, 2]) < 1e-9 * second
