"""Rigid contact with friction by Moreau's steps: closed forms and published answers."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from rigid_scenes import SHAPES, G, on_floor, rigid

import eomgen as eg


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_bouncing_ball(target: str) -> None:
    """Times and heights of a ball that falls from 1 m with e = 0.8, to the order of the step."""
    ball = on_floor(SHAPES["circle"], {"restitution": 0.8}, target=target)
    fall = np.sqrt(2.0 / G)
    errors = []
    for h in (2e-3, 1e-3, 5e-4):
        run = ball.simulate(2.4, {"j_y": 1.1}, method="moreau", step=h)
        hits = np.flatnonzero(np.diff(run["j_y_dot"]) > 0.1)
        tops = [run["j_y"][a:b].max() - 0.1 for a, b in itertools.pairwise(hits)]
        times = [fall, fall * (1 + 2 * 0.8), fall * (1 + 2 * 0.8 + 2 * 0.64)]
        errors.append(
            max(np.abs(run.t[hits[:3]] - times).max() / h, np.abs(np.subtract(tops[:2], (0.64, 0.4096))).max() / h)
        )
        assert run["j_y"].min() > 0.1 - 1e-12
        assert run.metadata["missed_steps"] == 0
    assert max(errors) < 5.0  # in steps: m/s and 1


def test_ball_without_loss_comes_back() -> None:
    """e = 1: the energy is kept to rounding over 20 bounces."""
    run = on_floor(SHAPES["circle"], {"restitution": 1.0}).simulate(10.0, {"j_y": 0.35}, method="moreau", step=1e-3)
    assert np.count_nonzero(np.diff(run["j_y_dot"]) > 0.1) > 20
    np.testing.assert_allclose(run["energy"], run["energy"][0], rtol=1e-12)


@pytest.mark.parametrize("mu", [0.2, 0.5, 1.0])
def test_block_slips_at_the_angle_of_friction(mu: float) -> None:
    """It holds without creep 1e-3 rad below atan(mu), and slides as the closed form says 1e-3 rad above."""
    for aside in (-1e-3, 1e-3):
        slope = np.arctan(mu) + aside
        block = on_floor({"shape": "box", "size": (0.6, 0.2)}, {"friction": mu}, slope, 0.03)
        run = block.simulate(1.0, {"j_y": 0.1}, method="moreau", step=1e-3)
        slides = max(0.0, 0.5 * G * (np.sin(slope) - mu * np.cos(slope)))
        np.testing.assert_allclose(run["j_x"][-1], slides, atol=1e-9)
        assert np.abs(run["j_y"] - 0.1).max() < 1e-9
        assert np.abs(run["j_3"]).max() < 1e-9


def test_disc_begins_to_roll() -> None:
    """A disc that slides at v0 rolls from v0 / (3 mu g) on, at 2 v0 / 3."""
    run = on_floor(SHAPES["circle"], {"friction": 0.3}).simulate(
        0.5, {"j_y": 0.1, "j_x_dot": 1.0}, method="moreau", step=1e-4
    )
    slip = run["j_x_dot"] + 0.1 * run["j_3_dot"]
    first = run.t[np.flatnonzero(np.abs(slip) < 1e-6)[0]]
    assert abs(first - 1.0 / (3 * 0.3 * G)) < 1.1e-4
    np.testing.assert_allclose(run["j_x_dot"][-1], 2.0 / 3.0, rtol=1e-9)


def test_billiard_ball() -> None:
    """Sliding with spin about all axes: u = v + w x (-R n) falls at 7/2 mu g along itself, then the ball rolls."""
    m = eg.Model("billiard", gravity=(0, 0, -G))
    ball = m.body("ball", mass=0.2, inertia=(0.4 * 0.2 * 0.03**2,) * 3)
    m.free("j", m.ground, ball, rotation="euler_parameters")
    m.contacts(
        "c",
        {"shape": "sphere", "radius": 0.03, "on": ball},
        {"shape": "half_space", "on": m.ground},
        rigid(friction=0.2),
    )
    m.output("px", ball.position[0]), m.output("py", ball.position[1])
    m.output("vx", ball.velocity[0]), m.output("vy", ball.velocity[1])
    mod = m.compile()
    w0 = np.array([20.0, 30.0, 40.0])  # at rest of the angles, ground and body axes are one
    start = {"j_z": 0.03, "j_x_dot": 1.0, "j_y_dot": -0.3} | dict(zip(mod.v_names[3:], w0, strict=True))
    run = mod.simulate(0.6, start, method="moreau", step=2e-4)
    v0, n = np.array([1.0, -0.3, 0.0]), np.array([0.0, 0.0, 1.0])
    u0 = v0 + np.cross(w0, -0.03 * n)
    size, rolls = np.linalg.norm(u0), 2.0 * np.linalg.norm(u0) / (7.0 * 0.2 * G)
    t = np.minimum(run.t, rolls)
    v = v0[:, None] - 0.2 * G * np.outer(u0 / size, t)
    place = np.outer(v0, t) - 0.1 * G * np.outer(u0 / size, t * t) + (v0 - 2.0 / 7.0 * u0)[:, None] * (run.t - t)
    np.testing.assert_allclose([run["vx"], run["vy"]], v[:2], atol=2e-3)
    np.testing.assert_allclose([run["px"], run["py"]], place[:2], atol=3e-4)
    np.testing.assert_allclose([run["vx"][-1], run["vy"][-1]], (v0 - 2.0 / 7.0 * u0)[:2], rtol=1e-6)


def test_newtons_cradle() -> None:
    """Balls a little apart pass the velocity on from pair to pair: the last leaves with it, the others stand still."""
    m = eg.Model("cradle", gravity=(0, 0, 0))
    balls = []
    for k in range(5):
        balls.append(m.body(f"b{k}", mass=0.3))
        m.prismatic(f"j{k}", m.ground.at(0.11 * k, 0, 0), balls[-1], axis="x", coordinate=f"x{k}")
    m.contacts("c", {"shape": "sphere", "radius": 0.05, "on": balls}, law=rigid(restitution=1.0))
    run = m.compile().simulate(0.2, {"x0_dot": 1.0}, method="moreau", step=1e-3)
    np.testing.assert_allclose([run[f"x{k}_dot"][-1] for k in range(5)], [0, 0, 0, 0, 1], atol=1e-12)


def test_rod_of_painleve() -> None:
    """A rough rod stops at once where no force can hold it: an impact without collision (Stewart, 2000).

    Of a slender rod at an angle p the normal acceleration is A + B N with B = (1 + 3 cos p (cos p - mu sin p)) / m,
    which is negative for mu > 4/3 at some angles: then only an impulse of friction is a solution.
    """
    m = eg.Model("painleve", gravity=(0, -G, 0))
    rod = m.body("rod", mass=1.0, inertia={"zz": 1.0 / 12.0})
    m.planar("j", m.ground, rod)
    tip = rod.at(-0.5, 0, 0)
    m.contacts(
        "c",
        {"shape": "circle", "radius": 1e-3, "on": tip},
        {"shape": "half_plane", "on": m.ground},
        rigid(friction=2.0),
    )
    mod = m.compile()
    p = np.pi / 3  # the tip is below the centre, on the side to which the rod moves
    assert 1 + 3 * np.cos(p) * (np.cos(p) - 2.0 * np.sin(p)) < 0
    start = {"j_x": 0.0, "j_y": 0.5 * np.sin(p) + 1e-3, "j_3": p, "j_x_dot": -2.0}
    run = mod.simulate(0.01, start, method="moreau", step=1e-4)
    sliding = run["j_x_dot"] + 0.5 * np.sin(run["j_3"]) * run["j_3_dot"]
    assert sliding[0] == -2.0
    assert abs(sliding[1]) < 5e-3  # the tip turned on in half a step
    assert run["energy"][1] < run["energy"][0]
    assert run.metadata["missed_steps"] == 0
