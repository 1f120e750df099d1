"""Rigid contact with friction by Moreau's steps: closed forms, corners, sunk starts, thin walls, mean forces."""

import itertools
import pickle
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from models import IN_C
from refusals import refuses
from rigid_scenes import SHAPES, G, on_floor, rigid
from sweeps import TARGETS

import eomgen as eg


@pytest.mark.parametrize("target", TARGETS)
def test_bouncing_ball(target: str) -> None:
    """Times and heights of a ball that falls from 1 m with e = 0.8, to the order of the step."""
    ball = on_floor(SHAPES["circle"], {"restitution": 0.8}, target=target)
    fall = np.sqrt(2.0 / G)
    errors = []
    for h in (2e-3, 1e-3, 5e-4) if target == "cython" else (4e-3,):
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


def test_newtons_cradle() -> None:
    """Balls a little apart pass the velocity on from pair to pair: the last leaves with it, the others stand still."""
    m = eg.Model("cradle", gravity=(0, 0, 0))
    balls = []
    for k in range(5):
        balls.append(m.body(f"b{k}", mass=0.3))
        m.prismatic(f"j{k}", m.ground.at(0.11 * k, 0, 0), balls[-1], axis="x", coordinate=f"x{k}")
    m.contacts("c", {"shape": "sphere", "radius": 0.05, "on": balls}, law=rigid(restitution=1.0))
    run = m.compile(target="numpy").simulate(0.2, {"x0_dot": 1.0}, method="moreau", step=1e-3)
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
    mod = m.compile(target="numpy")
    p = np.pi / 3  # the tip is below the centre, on the side to which the rod moves
    assert 1 + 3 * np.cos(p) * (np.cos(p) - 2.0 * np.sin(p)) < 0
    start = {"j_x": 0.0, "j_y": 0.5 * np.sin(p) + 1e-3, "j_3": p, "j_x_dot": -2.0}
    run = mod.simulate(0.01, start, method="moreau", step=1e-4)
    sliding = run["j_x_dot"] + 0.5 * np.sin(run["j_3"]) * run["j_3_dot"]
    assert sliding[0] == -2.0
    assert abs(sliding[1]) < 5e-3  # the tip turned on in half a step
    assert run["energy"][1] < run["energy"][0]
    assert run.metadata["missed_steps"] == 0


WALL = [(-1.0, -0.3), (0.0, -0.3), (0.0, 0.0), (-1.0, 0.0)]


def cornered(second: dict[str, Any], target: str) -> Any:
    m = eg.Model("fall", gravity=(0, -9.81, 0))
    body = m.body("b", mass=1.0, inertia={"zz": 0.005})
    m.planar("j", m.ground, body)
    first = {"shape": "circle", "on": body, "radius": 0.1}
    m.contacts("c", first, {"on": m.ground, **second}, {"normal_law": "rigid"})
    return m.compile(target=target)


def test_a_ball_rests_on_the_top_of_a_wall_and_against_its_side() -> None:
    """It still touches edges and corners: on the top, and pushed against the side."""
    mod = cornered({"shape": "outline", "points": WALL}, "numpy")
    run = mod.simulate(0.5, {"j_x": -0.3, "j_y": 0.15}, method="moreau", step=1e-3)
    assert run["j_y"][-1] == pytest.approx(0.1, abs=1e-6)
    run = mod.simulate(0.1, {"j_x": 0.15, "j_y": -0.1, "j_x_dot": -2.0}, method="moreau", step=1e-3)
    assert run["j_x"].min() == pytest.approx(0.1, abs=2.1e-3)
    assert run["j_x_dot"][-1] == pytest.approx(0.0, abs=1e-9)
    run = mod.simulate(0.3, {"j_x": 0.0, "j_y": 0.12}, method="moreau", step=1e-3)  # on the corner
    assert run["j_y"][-1] == pytest.approx(0.1, abs=2e-3)


DEPTH = 2e-3


def floating(target: str, gravity: float = 0.0) -> Any:
    """A ball (r = 0.1 m) at the side of a wall, without a load."""
    m = eg.Model("floating", gravity=(0, -gravity, 0))
    ball = m.body("b", mass=1.0, inertia={"zz": 0.004})
    m.planar("j", m.ground, ball)
    wall = {"shape": "half_plane", "on": m.ground.at(0, 0, 0, rpy=(0, 0, -np.pi / 2))}
    m.contacts("c", {"shape": "circle", "radius": 0.1, "on": ball}, wall, rigid(friction=0.3))
    return m.compile(target=target)


@pytest.mark.parametrize("target", TARGETS)
def test_a_sunk_start_without_load_is_worked_off(target: str) -> None:
    """A fifth of the depth in each step, as a displacement: the ball stays at rest."""
    run = floating(target).simulate(0.05, {"j_x": 0.1 - DEPTH}, method="moreau", step=1e-3)
    depth = 0.1 - run["j_x"]
    np.testing.assert_allclose(depth[:20], DEPTH * 0.8 ** np.arange(20), rtol=5e-3)
    assert depth[-1] < 1e-7
    assert np.abs(run.v).max() == 0.0


@pytest.mark.parametrize("target", TARGETS)
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


@cache
def walled() -> eg.Module:
    """A ball (r = 20 mm) that flies along x against a wall of 10 mm at x = 1 m."""
    m = eg.Model("wall")
    ball = m.body("b", mass=0.1, inertia={"zz": 1e-5})
    m.planar("j", m.ground, ball)
    wall = {"shape": "segment", "length": 2.0, "radius": 0.005, "on": m.ground.at(1.0, 0, 0, rpy=(0, 0, np.pi / 2))}
    m.contacts("c", {"shape": "circle", "radius": 0.02, "on": ball}, wall, rigid())
    return m.compile(target="numpy")


def thrown_at_wall(offset: float, speed: float, step: float, end: float | None = None) -> eg.Trajectory:
    start = {"j_x": offset, "j_x_dot": speed}
    return walled().simulate(end or 2.0 / speed, start, method="moreau", step=step)


@pytest.mark.parametrize("phase", [0.0, 0.25, 0.5, 0.875])
@pytest.mark.parametrize(("speed", "step"), [(12.0, 5e-3), (60.0, 5e-3)])
def test_a_thin_wall_stops_a_ball(phase: float, speed: float, step: float) -> None:
    run = thrown_at_wall(phase * speed * step, speed, step)
    assert abs(run["j_x_dot"][-1]) < 1e-9
    assert 0.97 < run["j_x"][-1] < 0.9751
    assert run.metadata["penetration"] < 2e-3
    assert len(run.t) <= 2.0 / speed / step + 2  # the times are those of the steps asked for


def test_too_fast_for_any_step() -> None:
    refuses("EG-STALLED moreau", thrown_at_wall, 0.0, 1e6, 5e-3, 5e-3)


def test_loops_close_at_the_end_of_a_step() -> None:
    """A slider that an input moves is where the input is at the end of a step, not half a step before."""
    m = eg.Model("led", gravity=(0, -9.81, 0))
    m.input("s")
    m.prismatic("x", m.ground, m.body("slider", mass=1.0), axis="x", coordinate="x")
    m.driver("d", "x", "s")
    ball = m.body("b", mass=1.0, inertia={"zz": 0.01})
    m.planar("j", m.ground, ball)
    m.contacts("c", {"shape": "circle", "radius": 0.1, "on": ball}, {"shape": "half_plane", "on": m.ground}, rigid())
    wave = {"inputs": {"s": "0.1*sin(20*t)"}, "method": "moreau", "step": 5e-3}
    run = m.compile(target="numpy").simulate(0.02, {"j_y": 0.3}, **wave)
    np.testing.assert_allclose(run["x"], 0.1 * np.sin(20 * run.t), atol=1e-9)
    assert run.residuals.raw_position < 1e-9


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("slope", [0.3, 0.6])
def test_block_on_a_slope(slope: float, target: str) -> None:
    """m g cos, and m g sin where it holds, mu m g cos where it slides."""
    block = on_floor({"shape": "box", "size": (0.6, 0.2)}, {"friction": 0.5}, slope, 0.03, target=target)
    run = block.simulate(0.2, {"j_y": 0.1}, method="moreau", step=1e-3, contact_forces=True)
    weight = 1.0 * G
    held = min(np.sin(slope), 0.5 * np.cos(slope))
    np.testing.assert_allclose(run["normal(c)"], weight * np.cos(slope), rtol=1e-8)  # contact_tolerance is 1e-9
    np.testing.assert_allclose(run["friction(c)"][1:], weight * held, rtol=1e-8)
    assert run.units["normal(c)"] == run.units["friction(c)"] == "N"
    force = run.contact_forces.on("b")
    np.testing.assert_allclose(force[:2, 5], [-weight * held, weight * np.cos(slope)], rtol=1e-8)
    np.testing.assert_allclose(force, -run.contact_forces.on("ground"), atol=1e-12 * weight)


@pytest.fixture(scope="module")
def heap() -> Any:
    """Discs and a box that fall into a heap, in a trough."""
    m = eg.Model("heap", gravity=(0.3, -G, 0))
    shapes = []
    for k in range(6):
        body = m.body(f"b{k}", mass=0.5 + 0.2 * k, inertia={"zz": 0.01 + 0.003 * k})
        m.planar(f"j{k}", m.ground, body)
        m.initial(**{f"j{k}_x": 0.21 * (k % 3) - 0.2, f"j{k}_y": 0.35 + 0.3 * (k // 3), f"j{k}_x_dot": 0.5 - 0.2 * k})
        m.initial(**{f"j{k}_3_dot": 1.0 - k})
        shapes.append(
            {"shape": "circle", "radius": 0.1, "on": body}
            if k % 2
            else {"shape": "box", "size": (0.2, 0.1), "on": body}
        )
    m.contacts("heap", shapes, law=rigid(friction=0.4, restitution=0.3))
    m.contacts("floor", shapes, {"shape": "half_plane", "on": m.ground}, rigid(friction=0.6))
    return m.compile(**IN_C)


@pytest.mark.parametrize("h", [1e-3, 4e-3])
def test_forces_change_momentum_as_the_run_does(heap: Any, h: float) -> None:
    """Of each body m (v+ - v)/h = m g + F, and the same of turning, to rounding: impacts and friction among them."""
    run = heap.simulate(0.6, method="moreau", step=h, contact_forces=True)
    assert run.metadata["contacts"] >= 8
    q = run.x[: heap.n_q]
    steps = np.diff(run.t)
    for k in range(6):
        mass, spin = 0.5 + 0.2 * k, 0.01 + 0.003 * k
        wrench = run.contact_forces.on(f"b{k}")[:, 1:]
        sides = run.contact_forces.on(f"b{k}", "heap") + run.contact_forces.on(f"b{k}", "floor")
        np.testing.assert_allclose(wrench, sides[:, 1:], atol=1e-9)
        names = [heap.q_names.index(f"j{k}_{axis}") for axis in ("x", "y")]
        rate = np.array([np.diff(run[f"j{k}_{axis}_dot"]) / steps for axis in ("x", "y", "3")])
        middle = q[names, :-1] + 0.5 * steps * np.array([run[f"j{k}_x_dot"], run[f"j{k}_y_dot"]])[:, :-1]
        about = wrench[5] - (middle[0] * wrench[1] - middle[1] * wrench[0])
        size = max(float(np.abs(wrench[:2]).max()), mass * G)
        np.testing.assert_allclose(mass * rate[0], 0.3 * mass + wrench[0], atol=1e-10 * size)
        np.testing.assert_allclose(mass * rate[1], -G * mass + wrench[1], atol=1e-10 * size)
        if run.metadata["steps"] == len(steps):  # each with one middle
            np.testing.assert_allclose(spin * rate[2], about, atol=1e-10 * size)
    total = sum(run.contact_forces.on(f"b{k}", "heap") for k in range(6))
    np.testing.assert_allclose(total, 0.0, atol=1e-9)  # action and reaction


def test_stored_copied_and_requested_wrongly(tmp_path: Path) -> None:
    ball = on_floor(SHAPES["circle"], {"friction": 0.3})
    options: dict[str, Any] = {"method": "moreau", "step": 1e-3}
    whole = ball.simulate(0.5, {"j_y": 0.4}, **options)
    some = ball.simulate(0.5, {"j_y": 0.4}, t_eval=np.linspace(0.0, 0.5, 11), **options)
    np.testing.assert_array_equal(some["normal(c)"], whole["normal(c)"][::50])
    hit = int(np.argmax(whole["normal(c)"]))
    inside = ball.simulate(0.5, {"j_y": 0.4}, t_eval=[whole.t[hit] - 4e-4, whole.t[hit] + 4e-4], **options)
    np.testing.assert_array_equal(inside["normal(c)"], whole["normal(c)"][[hit, hit + 1]])
    again = pickle.loads(pickle.dumps(whole))
    np.testing.assert_array_equal(again["normal(c)"], whole["normal(c)"])
    np.testing.assert_array_equal(again.contact_forces.friction("c"), whole["friction(c)"])
    whole.save(tmp_path / "run.npz")
    np.testing.assert_array_equal(eg.load_trajectory(tmp_path / "run.npz")["normal(c)"], whole["normal(c)"])
    refuses("EG-UNSUPPORTED contact_forces=True", whole.contact_forces.on, "b")
    kept = ball.simulate(0.5, {"j_y": 0.4}, contact_forces=True, **options).contact_forces
    refuses("EG-RANGE 0 0.5 0.6", kept.at, 0.6)
    refuses("EG-NAME-UNKNOWN wheel", kept.on, "wheel")
