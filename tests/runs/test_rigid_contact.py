"""Rigid contact with friction by Moreau's steps: closed forms, corners, sunk starts, thin walls, mean forces."""

import itertools
import pickle
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from models import IN_C
from refusals import refused, refuses
from sweeps import TARGETS, part_of

import eomgen as eg

G = 9.81
SHAPES: dict[str, dict[str, Any]] = {
    "circle": {"shape": "circle", "radius": 0.1},
    "box": {"shape": "box", "size": (0.2, 0.14)},
    "triangle": {"shape": "polygon", "points": ((0.12, 0.01), (-0.1, 0.1), (-0.08, -0.1))},
    "segment": {"shape": "segment", "length": 0.3, "radius": 0.03},
}


def rigid(**law: Any) -> dict[str, Any]:
    return {"normal_law": "rigid", **law}


def on_floor(
    shape: Mapping[str, Any],
    law: Mapping[str, float],
    slope: float = 0.0,
    inertia: float = 0.005,
    target: str = "cython",
) -> Any:
    """A body of 1 kg in the plane on a floor along x that falls towards +x by an angle."""
    values = {"friction": 0.0, "restitution": 0.0, **law, "slope": slope, "inertia": inertia}
    return floor_of(tuple(shape.items()), target).bind(values)


@cache
def floor_of(shape: tuple[tuple[str, Any], ...], target: str) -> Any:
    """The same for any law, slope and inertia, which are parameters: one build for a shape."""
    m = eg.Model("on_floor", gravity=(f"{G}*sin(slope)", f"-{G}*cos(slope)", 0))
    for name, value in (("friction", 0.3), ("restitution", 0.0), ("slope", 0.0), ("inertia", 0.005)):
        m.parameter(name, value)
    body = m.body("b", mass=1.0, inertia={"zz": "inertia"})
    m.planar("j", m.ground, body)
    law = rigid(friction="friction", restitution="restitution")
    m.contacts("c", {**dict(shape), "on": body}, {"shape": "half_plane", "on": m.ground}, law)
    return m.compile(target=target, **(IN_C if target == "cython" else {}))


def pile(kinds: Sequence[str]) -> eg.Model:
    """Bodies of several shapes among themselves, between two walls on a floor."""
    m = eg.Model("pile", gravity=(0, -G, 0))
    m.parameter("mu", 0.3), m.parameter("e", 0.0)
    shapes = []
    for k, kind in enumerate(kinds):
        body = m.body(f"b{k}", mass=1.0 + 0.2 * k, inertia={"zz": 0.01})
        m.planar(f"j{k}", m.ground, body)
        shapes.append({**SHAPES[kind], "on": body})
    m.contacts("among", shapes, law=rigid(friction="mu", restitution="e"))
    turned = [m.ground.at(x, 0, 0, rpy=(0, 0, x / abs(x) * np.pi / 2)) for x in (-0.6, 0.6)]
    sides = {"shape": "half_plane", "on": [m.ground, *turned]}
    m.contacts("walls", shapes, sides, rigid(friction="mu", restitution="e"))
    return m


def thrown(rng: np.random.Generator, count: int) -> dict[str, float]:
    """Initial values of a pile, apart from each other and fast."""
    start: dict[str, float] = {}
    for k in range(count):
        start |= {f"j{k}_x": -0.4 + 0.4 * (k % 3), f"j{k}_y": 0.25 + 0.4 * (k // 3), f"j{k}_3": rng.uniform(-3, 3)}
        start |= {
            f"j{k}_x_dot": rng.uniform(-2, 2),
            f"j{k}_y_dot": rng.uniform(-2, 2),
            f"j{k}_3_dot": rng.uniform(-9, 9),
        }
    return start


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


def floating(target: str) -> Any:
    """A ball (r = 0.1 m) at the side of a wall, without a load."""
    m = eg.Model("floating")
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


# -- rigid contact -----------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def ball() -> Any:
    return on_floor(SHAPES["circle"], {"friction": 0.3}, target="numpy")


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({}, "EG-MISSING step="),
        ({"step": 0.0}, "EG-RANGE step 0"),
        ({"step": -1e-3}, "EG-RANGE step 0"),
        ({"step": "fast"}, "EG-NUMBER step"),
        ({"step": 1e-3, "rtol": 1e-6}, "EG-NAME-UNKNOWN rtol"),
        ({"step": 1e-3, "contact_tolerence": 1e-6}, "EG-NAME-UNKNOWN contact_tolerance"),
        ({"step": 1e-3, "contact_tolerance": 0.0}, "EG-RANGE contact_tolerance 0"),
        ({"step": 1e-3, "contact_iterations": 0}, "EG-RANGE contact_iterations 1"),
        ({"step": 1e-3, "events": "j_y"}, "EG-UNSUPPORTED events"),
        ({"step": 1e-3, "dense_output": True}, "EG-NAME-UNKNOWN dense_output"),
        ({"step": 1e-3, "t_eval": [0.5, 0.1]}, "EG-RANGE t_eval"),
        ({"step": 1e-3, "span": (1.0, 0.0)}, "EG-UNSUPPORTED forwards"),
    ],
)
def test_options(ball: Any, options: dict[str, Any], told: str) -> None:
    refuses(told, lambda: ball.simulate(options.pop("span", 0.2), {"j_y": 0.2}, method="moreau", **options))


def test_deep_start(ball: Any) -> None:
    refuses("EG-CONTRADICTION c 0.05", ball.simulate, 0.2, {"j_y": 0.05}, method="moreau", step=1e-3)


@pytest.mark.parametrize("method", [None, "Radau"])
def test_other_methods_have_no_force_for_it(ball: Any, method: str | None) -> None:
    refuses("EG-UNSUPPORTED rigid moreau", ball.simulate, 0.2, {"j_y": 0.2}, method=method)


def test_residual_that_is_not_reached() -> None:
    """Few iterations: the run goes on, and a warning says in how many steps and by how much."""
    block = on_floor({"shape": "box", "size": (0.6, 0.2)}, {"friction": 0.4}, 0.1, 0.03, target="numpy")
    with pytest.warns(UserWarning, match="of 20 steps"):
        run = block.simulate(
            0.02,
            {"j_y": 0.1, "j_x_dot": 1.0},
            method="moreau",
            step=1e-3,
            contact_iterations=1,
            contact_tolerance=1e-15,
        )
    assert run.metadata["missed_steps"] > 0
    assert run.metadata["contact_residual"] > 0.0


def test_inputs() -> None:
    """A box that is pushed by a ramp holds until the push exceeds friction, and first-order states go along."""
    m = eg.Model("pushed", gravity=(0, -G, 0))
    m.input("push"), m.parameter("mu", 0.5)
    body = m.body("b", mass=1.0, inertia={"zz": 0.05})
    m.planar("j", m.ground, body)
    m.force("p", body, ("push", 0, 0))
    m.state("a", "push - a", initial=0.0)
    m.contacts(
        "c",
        {"shape": "box", "size": (0.6, 0.2), "on": body},
        {"shape": "half_plane", "on": m.ground},
        rigid(friction="mu"),
    )
    run = m.compile(target="numpy").simulate(
        1.0, {"j_y": 0.1}, {"mu": 0.4}, inputs={"push": ([0.0, 1.0], [0.0, 8.0])}, method="moreau", step=1e-3
    )
    begins = 0.4 * G / 8.0
    k = int(np.searchsorted(run.t, begins))
    assert np.abs(run["j_x"][: k - 1]).max() < 1e-12
    t = run.t[-1]
    np.testing.assert_allclose(run["j_x_dot"][-1], 4.0 * (t * t - begins**2) - 0.4 * G * (t - begins), atol=1e-4)
    np.testing.assert_allclose(run["a"], 8.0 * (run.t - 1 + np.exp(-run.t)), atol=1e-3)


TIMES = np.linspace(0.0, 0.1, 5)
ENTRIES: dict[str, Callable[[Any], Any]] = {
    "simulate_many": lambda m: m.simulate_many((0, 0.1), m.x0(j_y=0.1)[:, None]),
    "integrator": lambda m: m.integrator()(0.0, m.x0(j_y=0.1), 0.1),
    "step": lambda m: m.step(0.0, m.x0(j_y=0.1), 0.01),
    "sensitivities": lambda m: m.sensitivities(["j_y"], (0, 0.1)),
    "fit": lambda m: m.fit({"t": TIMES, "j_y": 0.1 + 0.0 * TIMES}, ["j_y_dot"]),
    "linearize": lambda m: m.linearize({"j_y": 0.1}),
    "equilibrium": lambda m: m.equilibrium({"j_y": 0.1}),
    "modes": lambda m: m.modes({"j_y": 0.1}),
    "simulate_impacts": lambda m: m.simulate_impacts(0.1, {"j_y": 1.0}),
    "dae.solve": lambda m: m.dae.solve((0, 0.1), {"j_y": 0.1}),
    "method DOP853": lambda m: m.DOP853,
    "method RK45": lambda m: m.RK45,
    "method RK23": lambda m: m.RK23,
    "method Radau": lambda m: m.Radau,
    "method Taylor": lambda m: m.Taylor,
}


@pytest.mark.parametrize("target", TARGETS)
def test_what_has_no_impulses_says_so(target: str) -> None:
    floor = on_floor(SHAPES["circle"], {"friction": 0.3}, target=target)
    for entry, call in ENTRIES.items():
        what = "linearize" if entry == "modes" else entry
        refuses(f"EG-UNAVAILABLE {what} 'c' 'on_floor' moreau", call, floor)


@pytest.mark.parametrize("asked", ["power(c)", "force(c, on=b).y"])
def test_forces_of_rigid_contacts_as_outputs(asked: str) -> None:
    """They are refused, and the message names what runs have, which is there."""
    m = eg.Model("asked", gravity=(0, -9.81, 0))
    body = m.body("b", mass=1.0, inertia={"zz": 0.01})
    m.planar("j", m.ground, body)
    m.contacts("c", {**SHAPES["circle"], "on": body}, {"shape": "half_plane", "on": m.ground}, rigid(friction=0.3))
    run = m.compile(target="numpy").simulate(0.01, {"j_y": 0.5}, method="moreau", step=1e-3, contact_forces=True)
    with refused("EG-UNSUPPORTED impulses FMU", eg.ModelError) as caught:
        m.derive().write_fmu("asked.fmu")
    assert [problem.path for problem in caught.value.problems] == ["contacts.c"]  # whatever its law is called there
    m.output("f", asked)
    with refused(
        "EG-UNSUPPORTED outputs.f.expression run.contact_forces.on(BODY)" + " normal(c)" * ("on=" not in asked)
    ):
        m.compile(target="numpy")
    assert {"normal(c)", "friction(c)"} <= set(run.columns.names)
    assert run.contact_forces.on("b").shape == (6, len(run))


FILE = """
name: slid
gravity: [0, -9.81, 0]
bodies: {crate: {mass: 20.0, inertia: {zz: 0.8}}}
joints: {j: {type: planar, between: [ground, crate]}}
contacts:
  floor:
    first: [{shape: box, on: crate, size: [0.6, 0.4]}]
    second: [{shape: half_plane, on: ground}]
    LAW
    friction: 0.25
initial: {j_y: 0.2, j_x_dot: 1.0}
simulation: {end: 0.2, method: moreau, step: 2e-3}
"""

RIGID, SOFT = "normal_law: rigid", "stiffness: 1e7\n    smoothing: 1e-3"
SPEED = 1.0 - 0.25 * 9.81 * 0.2  #: of a block that slides, after 0.2 s


def written(folder: Path, law: str, old: str = "", new: str = "") -> Path:
    path = folder / "slid.yaml"
    text = FILE.replace("LAW", law)
    assert old in text
    path.write_text(text.replace(old, new) if old else text)
    return path


@pytest.mark.parametrize("law", [RIGID, SOFT])
def test_a_run_takes_method_and_step_of_the_file(law: str, tmp_path: Path) -> None:
    model = eg.load(written(tmp_path, law))
    assert model.simulation == {"end": 0.2, "method": "moreau", "step": 2e-3}
    mod = model.compile(target="numpy")
    run = mod.simulate()
    assert (run.metadata["method"], len(run.t)) == ("moreau", 101)
    assert run["j_x_dot"][-1] == pytest.approx(SPEED, abs=1e-9)
    assert len(mod.simulate(step=1e-2).t) == len(mod.simulate(method="moreau", step=1e-2).t) == 21
    assert len(mod.simulate(method="moreau").t) == 101
    model.save(tmp_path / "again.yaml")
    assert eg.load(tmp_path / "again.yaml").simulation == model.simulation


# -- rigid contact -----------------------------------------------------------------------------------------------------
KINDS = ("circle", "box", "triangle", "segment")


@cache
def random_heap() -> eg.Module:
    return pile(KINDS).compile(**IN_C)


@pytest.mark.parametrize(("seed", "count"), part_of([(7, 12), *((seed, 50) for seed in range(10, 18))], (7, 12).__eq__))
def test_energy_never_grows_in_random_scenes(seed: int, count: int) -> None:
    """Piles, with friction and restitution of any size: no more energy than before, and no shape in another."""
    rng, missed = np.random.default_rng(seed), 0
    for k in range(count):
        law = {"mu": rng.uniform(0, 1), "e": (0.0, rng.uniform(0, 1), 1.0)[k % 3]}
        run = random_heap().simulate(0.2, thrown(rng, 4), law, method="moreau", step=1e-3)
        energy = run["energy"]
        assert np.all(energy <= energy[0] * (1 + 1e-12))
        assert np.max(np.diff(energy)) < 1e-5 * energy[0]  # where a part of a penetration is removed
        assert run.metadata["penetration"] < 1e-3
        missed += run.metadata["missed_steps"]
    assert missed == 0


@cache
def rod(target: str) -> eg.Module:
    """A rod of 1 m and 1 kg over a floor."""
    m = eg.Model("rod", gravity=(0, 0, 0))
    m.parameter("mu", 0.1), m.parameter("e", 0.0)
    body = m.body("body", mass=1.0, inertia={"zz": 1 / 12})
    m.planar("j", m.ground, body)
    law = rigid(restitution="e", friction="mu")
    shape = {"shape": "segment", "on": body, "length": 1.0, "radius": 0.01}
    m.contacts("c", shape, {"shape": "half_plane", "on": m.ground}, law)
    return m.compile(target=target)


def plastic(angle: float, friction: float, v: tuple[float, float, float]) -> np.ndarray:
    """Velocities (x, y, angle) after: the tip sticks if Coulomb's law allows, else it slides as it would at the end."""
    tip = -0.5 * np.array([np.cos(angle), np.sin(angle)])  # from the centre
    n, t = np.array([0.0, 1.0, tip[0]]), np.array([1.0, 0.0, -tip[1] + 0.01])  # the round end touches 1 cm below
    inverse = np.diag([1.0, 1.0, 12.0])
    before = np.array(v)
    J = np.array([n, t])
    stick = -np.linalg.solve(J @ inverse @ J.T, J @ before)
    if abs(stick[1]) <= friction * stick[0]:
        return np.asarray(before + inverse @ J.T @ stick)
    for side in (1.0, -1.0):
        along = n - side * friction * t
        P = -(n @ before) / (n @ inverse @ along)
        after = before + inverse @ along * P
        if P > 0.0 and side * (t @ after) >= 0.0:
            return np.asarray(after)
    raise AssertionError


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("friction", [0.0, 0.1, 0.5])
def test_an_impact_with_friction_does_not_depend_on_where_in_the_step_it_falls(target: str, friction: float) -> None:
    module, angle, h = rod(target), 1.0, 1e-4
    found = []
    for gap in np.linspace(1.05e-3, 1.05e-3 + 2 * h, 9):
        start = {"j_y": 0.5 * np.sin(angle) + 0.01 + gap, "j_y_dot": -1.0, "j_3": angle, "j_x_dot": 0.5}
        found.append(module.simulate(1.6e-3, start, {"mu": friction}, method="moreau", step=h).x[3:, -1])
    expected = plastic(angle, friction, (0.5, -1.0, 0.0))
    assert np.array(found) == pytest.approx(np.tile(expected, (9, 1)), abs=10 * h)
    assert np.ptp(found, axis=0).max() < 10 * h


def linkage(target: str) -> Any:
    """A four-bar that falls on balls between its cranks and the floor, driven by a torque."""
    m = eg.Model("linkage", gravity=(0, -G, 0))
    crank = m.body("crank", mass=1.0, com=(0.1, 0, 0), inertia={"zz": 0.01})
    rod = m.body("rod", mass=2.0, com=(0.25, 0, 0), inertia={"zz": 0.05})
    rocker = m.body("rocker", mass=1.5, com=(0.15, 0, 0), inertia={"zz": 0.02})
    m.revolute("A", m.ground, crank, coordinate="a")
    m.revolute("B", crank.at(0.2, 0, 0), rod, coordinate="b")
    m.revolute("C", m.ground.at(0.5, 0, 0), rocker, coordinate="c")
    m.revolute("D", rod.at(0.5, 0, 0), rocker.at(0.3, 0, 0))
    m.torque("motor", "A", m.input("u", 0.0))
    m.initial(a=1.2), m.guess(b=-1.0, c=1.5)
    ends = [{"shape": "circle", "radius": 0.05, "on": rod.at(x, 0.0, 0)} for x in (0.0, 0.25, 0.5)]
    floor = {"shape": "half_plane", "on": m.ground.at(0, 0.1, 0)}
    m.contacts("floor", ends, floor, rigid(friction=0.3, restitution=0.2))
    return m.compile(target=target, **(IN_C if target == "cython" else {}))


def run_both(build: Any, **options: Any) -> tuple[Any, Any]:
    mod = build("cython")
    quick = mod.simulate(method="moreau", contact_forces=True, **options)
    again = mod.simulate(method="moreau", contact_forces=True, **options)
    np.testing.assert_array_equal(quick.x, again.x)
    return quick, build("numpy").simulate(method="moreau", contact_forces=True, **options)


@pytest.mark.parametrize("inputs", [{}, {"u": ([0.0, 0.2, 0.4], [0.0, -3.0, 3.0])}, {"u": "-2*sin(9*t) - a_dot"}])
def test_a_loop_with_inputs(inputs: dict[str, Any]) -> None:
    c, python = run_both(linkage, span=0.4, step=1e-3, inputs=inputs)
    assert c.metadata["contacts"] >= 1
    assert c["normal(floor)"].max() > 10.0
    np.testing.assert_allclose(c.x, python.x, atol=1e-6)
    if "a_dot" not in str(inputs):  # which lets it stick, where forces are not unique
        np.testing.assert_allclose(c["normal(floor)"], python["normal(floor)"], atol=1e-4 * c["normal(floor)"].max())
    assert c.residuals.raw_position < 1e-6
    for key in ("steps", "contacts", "missed_steps"):
        assert c.metadata[key] == python.metadata[key]
    assert c.metadata["penetration"] == pytest.approx(python.metadata["penetration"], abs=1e-7)


@cache
def four_bar(kind: str) -> eg.Module:
    """A four-bar whose coupler carries a circle over a floor at `low`, by rigid contact or by an event with impacts."""
    m = eg.Model("four_bar", gravity=(0, -G, 0))
    m.parameter("low", -50.0)
    crank = m.body("crank", mass=1.0, com=(0.1, 0, 0), inertia={"zz": 0.01})
    coupler = m.body("coupler", mass=2.0, com=(0.25, 0.05, 0), inertia={"zz": 0.05})
    rocker = m.body("rocker", mass=1.5, com=(0.2, 0, 0), inertia={"zz": 0.03})
    models.join_four_bar(m, (crank, coupler, rocker), (0.2, 0.5, 0.4, 0.45), "a b d")
    m.initial(a=0.3), m.guess(b=0.4, d=1.25)
    ball = coupler.marker("ball", at=(0.25, -0.1, 0))
    if kind == "event":
        m.event("strike", "y(coupler.ball) - 0.05 - low", restitution=0.5)
        return m.compile(target="numpy")
    plane = {"shape": "half_plane", "on": m.ground.at(0, "low", 0)}
    m.contacts("floor", {"shape": "circle", "on": ball, "radius": 0.05}, plane, rigid(restitution=0.5))
    return m.compile(target=kind)


@pytest.mark.parametrize("target", TARGETS)
def test_free_flight_of_a_loop_is_of_second_order(target: str) -> None:
    """Errors fall to a quarter with half the step, from 0.03 of a radian on; loops are closed to rounding."""
    start, errors = {"a": 0.3, "a_dot": 15.0}, []
    exact = four_bar("event").simulate(0.5, start, rtol=1e-12, atol=1e-13)
    for h in (2e-3, 1e-3, 5e-4):
        run = four_bar(target).simulate(0.5, start, method="moreau", step=h)
        assert run.residuals.raw_position < 1e-13
        assert run.residuals.raw_velocity < 1e-11
        errors.append([run[name][-1] - exact[name][-1] for name in ("a", "a_dot")])
    ratios = np.abs(errors[:-1]) / np.abs(errors[1:])
    assert 3.7 < ratios.min() < ratios.max() < 4.4
    assert abs(errors[1][0]) < 1e-3


@pytest.mark.parametrize("target", TARGETS)
def test_a_coupler_bounces_as_by_events(target: str) -> None:
    """Impacts lie within a step of their time, and the motion between is off by what such a delay makes of it."""
    start, low, h = {"a": 2.5}, {"low": 0.02}, 5e-4
    run = four_bar(target).simulate(0.48, start, low, method="moreau", step=h)
    exact = four_bar("event").simulate(0.48, start, low, t_eval=run.t, rtol=1e-11, atol=1e-13)
    hits = exact.t_events["strike"]
    assert len(hits) >= 3
    np.testing.assert_allclose(run["a"], exact["a"], atol=12 * h)
    before = run.t < hits[0] - h
    np.testing.assert_allclose(run["a"][before], exact["a"][before], atol=2e-6)
    assert run.metadata["missed_steps"] == 0
    assert run.residuals.raw_position < 1e-13
