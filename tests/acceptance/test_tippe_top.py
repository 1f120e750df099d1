"""The tippe top: an eccentric sphere that slides on a plane turns over, or not, as published criteria say.

With alpha = a / R (eccentricity), gamma = I_1 / I_3 and friction that grows with the sliding velocity, the inverted
spin is the only stable one if 1 - alpha < gamma < 1 + alpha and Jellett's constant exceeds
sqrt(m g R^3 I_3 alpha) (1 + alpha)^2 / sqrt(1 + alpha - gamma) (S. Rauch-Wojciechowski, M. Skoldstam, T. Glad,
Mathematical analysis of the tippe top, Regul. Chaotic Dyn. 10 (2005), 333-362; the three groups of tops also in
T. Ueda, K. Sasaki, S. Watanabe, SIAM J. Appl. Dyn. Syst. 4 (2005), 1159-1194).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg

M, R, ALPHA, G = 0.015, 0.015, 0.1, 9.81
I_3 = 0.4 * M * R * R
TILT, STIFFNESS = 0.1, 2000.0


@pytest.fixture(scope="module")
def top() -> Any:
    m = eg.Model("tippe_top", gravity=(0, 0, -G))
    I_1 = I_3 * m.parameter("gamma", 1.0)
    body = m.body("top", mass=M, com=(0, 0, -ALPHA * R), inertia={"xx": I_1, "yy": I_1, "zz": I_3})
    m.free("fly", m.ground, body, rotation="euler_parameters")
    law = {"normal_law": "linear", "stiffness": STIFFNESS, "damping": 1.0, "friction": 0.3, "smoothing": 0.1}
    m.sphere_plane("floor", m.ground, body, radius=R, **law)
    return m.compile()


def threshold(gamma: float) -> float:
    """The published least Jellett constant of an inversion."""
    return float(np.sqrt(M * G * R**3 * I_3 * ALPHA) * (1 + ALPHA) ** 2 / np.sqrt(1 + ALPHA - gamma))


def spun(mod: Any, gamma: float, jellett: float, end: float) -> tuple[Any, Any, Any]:
    """A run from a small tilt, spun about the vertical: it, the cosine of the tilt, L . (R z - a e_3) over time."""
    inertia = np.array([gamma, gamma, 1.0]) * I_3
    up = np.array([0.0, np.sin(TILT), np.cos(TILT)])  # in body axes
    spin = jellett / (R * up @ (inertia * up) - ALPHA * R * inertia[2] * up[2])
    start = {"fly_z": R - M * G / STIFFNESS, "fly_e0": np.cos(0.5 * TILT), "fly_e1": np.sin(0.5 * TILT)}
    start |= {"fly_e2": 0.0, "fly_e3": 0.0, **dict(zip(mod.v_names[3:], spin * up, strict=True))}
    run = mod.simulate(end, start, {"gamma": gamma}, rtol=1e-8, atol=1e-10)
    E = mod.poses(run.q)[0, :3, :3]
    L = np.einsum("ijk,jk->ik", E, inertia[:, None] * run.v[3:6])
    return run, E[2, 2], L[2] * R - ALPHA * R * np.einsum("ik,ik->k", L, E[:, 2])


@pytest.mark.parametrize(
    ("gamma", "times", "turns"), [(1.0, 2.0, True), (1.0, 0.8, False), (0.95, 1.5, True), (0.8, 3.0, False)]
)
def test_which_tops_turn_over(top: Any, gamma: float, times: float, turns: bool) -> None:
    """By the spin as a multiple of the published threshold; a top with gamma < 1 - alpha does so at no spin."""
    wanted = times * threshold(gamma)
    run, tilt, jellett = spun(top, gamma, wanted, 8.0)
    np.testing.assert_allclose(jellett, wanted, rtol=2e-3)  # the contact yields a little
    energy = run["energy"]
    assert energy[-1] < energy[0]
    if turns:
        assert tilt[-1] < -0.99
        assert run["fly_z"][-1] == pytest.approx(R - M * G / STIFFNESS, rel=1e-3)
        # it spins on about the vertical, with the same Jellett constant, the other way round in its own axes
        assert run[top.v_names[5]][-1] == pytest.approx(-wanted / (I_3 * R * (1 + ALPHA)), rel=0.02)
    else:
        assert tilt[-1] > -0.9
