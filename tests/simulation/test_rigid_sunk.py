"""Rigid contact: a penetration that no load presses together goes, and no energy comes of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rigid_scenes import rigid

import eomgen as eg
from eomgen.limits.rigid_contacts import REMOVED

DEPTH = 2e-3


def floating(target: str, gravity: float = 0.0) -> Any:
    """A ball (r = 0.1 m) at the side of a wall, without a load."""
    m = eg.Model("floating", gravity=(0, -gravity, 0))
    ball = m.body("b", mass=1.0, inertia={"zz": 0.004})
    m.planar("j", m.ground, ball)
    wall = {"shape": "half_plane", "on": m.ground.at(0, 0, 0, rpy=(0, 0, -np.pi / 2))}
    m.contacts("c", {"shape": "circle", "radius": 0.1, "on": ball}, wall, rigid(friction=0.3))
    return m.compile(target=target)


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_a_sunk_start_without_load_is_worked_off(target: str) -> None:
    """A fifth of the depth in each step, as a displacement: the ball stays at rest."""
    run = floating(target).simulate(0.05, {"j_x": 0.1 - DEPTH}, method="moreau", step=1e-3)
    depth = 0.1 - run["j_x"]
    np.testing.assert_allclose(depth[:20], DEPTH * (1.0 - REMOVED) ** np.arange(20), rtol=5e-3)
    assert depth[-1] < 1e-7
    assert np.abs(run.v).max() == 0.0


def test_a_ball_that_leaves_is_not_pushed() -> None:
    """What parts by itself as fast as a step would push goes its own way."""
    run = floating("numpy").simulate(0.02, {"j_x": 0.1 - DEPTH, "j_x_dot": 1.0}, method="moreau", step=1e-3)
    np.testing.assert_allclose(run["j_x"], 0.1 - DEPTH + run.t, atol=1e-12)


def test_a_ball_that_slides_along_keeps_its_speed() -> None:
    """Beside the wall it falls freely: the correction has no friction and takes no energy."""
    mod = floating("cython", 9.81)
    run = mod.simulate(0.1, {"j_x": 0.1 - DEPTH, "j_y_dot": 1.0}, method="moreau", step=1e-3)
    np.testing.assert_allclose(run["j_y_dot"], 1.0 - 9.81 * run.t, atol=1e-12)
    np.testing.assert_allclose(run["j_x_dot"], 0.0, atol=1e-15)
    assert abs(run["j_x"][-1] - 0.1) < 1e-9


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_a_sunk_block_under_its_weight_rises_without_speed(target: str) -> None:
    m = eg.Model("block", gravity=(0, -9.81, 0))
    body = m.body("b", mass=2.0, inertia={"zz": 0.02})
    m.planar("j", m.ground, body)
    box = {"shape": "box", "size": (0.4, 0.2), "on": body}
    m.contacts("c", box, {"shape": "half_plane", "on": m.ground}, rigid(friction=0.3))
    run = m.compile(target=target).simulate(0.1, {"j_y": 0.1 - DEPTH}, method="moreau", step=1e-3)
    assert abs(run["j_y"][-1] - 0.1) < 1e-7
    assert np.abs(run["j_y_dot"]).max() < 1e-9
    T, _, _ = run.energies
    assert T.max() < 1e-15
