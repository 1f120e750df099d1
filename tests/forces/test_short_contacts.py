"""Contacts shorter than a step of the flight before: no run at default tolerances steps over one.

Balls fly on a known parabola until they touch, so geometry in NumPy says which touch; times in which shapes can meet
are judged by motions in closed form.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import contact_scenes as scenes
import numpy as np
import pytest
from contact_scenes import ELASTIC, PLANAR, on
from scipy.integrate import solve_ivp

import eomgen as eg
from benchmarks.short_contacts import GRAZING, judge, model, shot
from eomgen.limits.runs import WITHIN

COMPILED = ("DOP853", "RK45", "RK23", "Radau")
SPEED = 20.0


@cache
def wall(target: str) -> Any:
    """A ball at 20 m/s before a wall without thickness, from which it comes back."""
    m = eg.Model("thin", gravity=(0, 0, 0))
    ball = m.body("ball", mass=1.0, inertia={"zz": 0.004})
    m.planar("j", m.ground, ball)
    thin = {"shape": "segment", "on": m.ground.at(2, 0, 0, rpy=(0, 0, np.pi / 2)), "length": 3.0}
    m.contacts("wall", {"shape": "circle", "on": ball, "radius": 0.05}, thin, {"stiffness": 1e6})
    return m.compile(target=target)


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(
    ("target", "method"),
    [*(("cython", name) for name in (*COMPILED, "BDF", "LSODA")), ("numpy", "DOP853"), ("numpy", "RK45")],
)
def test_no_method_steps_over_a_wall(target: str, method: str, way: float) -> None:
    """Forwards and backwards in time."""
    run = wall(target).simulate((0, 0.3 * way), initial={"j_x_dot": SPEED * way}, method=method)
    assert run["j_x_dot"][-1] == pytest.approx(-SPEED * way, rel=1e-5)
    assert run["j_x"].max() < 2.0


def test_ensembles_integrators_and_solvers_of_scipy() -> None:
    module = wall("cython")
    speeds = np.concatenate([np.linspace(5.0, SPEED, 11), [-SPEED]])
    many = module.simulate_many((0, 0.6), initial={"j_x_dot": speeds})
    wanted = np.where(speeds > 0.0, -speeds, speeds)
    assert np.allclose(np.asarray(many.x)[3], wanted, rtol=1e-4)
    x = module.x0(j_x_dot=SPEED)
    assert module.integrator()(0.0, x, 0.3)[3] == pytest.approx(-SPEED, rel=1e-5)
    found = solve_ivp(module.rhs, (0, 0.3), x, method=module.DOP853, rtol=1e-8, atol=1e-10)
    assert found.y[3, -1] == pytest.approx(-SPEED, rel=1e-5)


def test_derivatives_of_a_run_pass_over_no_contact() -> None:
    """The ball comes back with the speed that it had: d(end)/d(start) = -1."""
    found = wall("cython").sensitivities("j_x_dot", (0, 0.3), initial={"j_x_dot": SPEED})
    assert found.trajectory["j_x_dot"][-1] == pytest.approx(-SPEED, rel=1e-5)
    assert found.dx[3, 0, -1] == pytest.approx(-1.0, rel=1e-4)


@pytest.mark.parametrize("kind", ["circle", "segment", "polygon"])
def test_random_shots_are_turned_where_they_touch(kind: str) -> None:
    module, rng, touched = model(kind).compile(), np.random.default_rng(11), 0
    for k in range(35):
        one = shot(rng, kind)
        turned, _ = judge(module, one, COMPILED[k % 4])
        touched += one.depth > GRAZING
        assert turned > 1e-6 if one.depth > GRAZING else one.depth > 0 or turned < 1e-6, (k, one)
    assert touched > 25


def test_flights_far_from_shapes_cost_what_they_do_without() -> None:
    spent = []
    for bulk in (True, False):
        m, bodies = scenes.planar("far", 2)
        for k, body in enumerate(bodies):
            m.spring(f"s{k}", m.ground.at(3.0 * k, 0, 0), body, stiffness=20.0)
        if bulk:
            m.contacts("among", [on(PLANAR["box"], bodies[0]), on(PLANAR["circle"], bodies[1])], law=ELASTIC)
        run = m.compile().simulate((0, 20), initial={"j0_x": -0.5, "j0_3_dot": 3.0, "j1_x": 3.5, "j1_y": 0.4})
        spent.append(run.nfev)
    assert spent[0] <= 1.3 * spent[1]


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("kinds", [("circle", "circle"), ("box", "circle"), ("polygon", "segment"), ("box", "polygon")])
def test_nothing_meets_within_the_time(target: str, kinds: tuple[str, str]) -> None:
    """Of motions with constant accelerations, one body turning: depths in NumPy stay below a part of the thickness."""
    m, (a, b) = scenes.planar("times", 2, (0, 0, 0))
    m.contacts("touch", on(PLANAR[kinds[0]], a), on(PLANAR[kinds[1]], b), ELASTIC)
    time = m.compile(target=target).kernels.motion("meeting_time")
    thick = {"circle": 0.2, "box": 0.14, "polygon": 0.2, "segment": 0.06}
    rng, short = np.random.default_rng(2), 0
    for _ in range(120):
        q, v, acc = rng.uniform(-0.4, 0.4, 6), rng.uniform(-3, 3, 6), rng.uniform(-20, 20, 6)
        v[[2, 5]] *= [0.0, 1.0]
        acc[[2, 5]] = 0.0
        if max(scenes.depths(*kinds, q[:3], q[3:])) > 0.0:
            continue
        end = float(time(q, v, acc)[0])
        short += end < 0.3
        for t in np.linspace(0.0, min(end, 1.0), 25):
            at = q + v * t + 0.5 * acc * t * t
            assert max(scenes.depths(*kinds, at[:3], at[3:])) <= WITHIN * (thick[kinds[0]] + thick[kinds[1]]) * 1.01
    assert short > 10


def test_shapes_that_part_or_rest_leave_steps_free() -> None:
    m, (a, b) = scenes.planar("parting", 2, (0, 0, 0))
    m.contacts("touch", on(PLANAR["circle"], a), on(PLANAR["circle"], b), ELASTIC)
    time = m.compile(target="numpy").kernels.motion("meeting_time")
    q, still = np.array([0, 0, 0, 1.0, 0, 0]), np.zeros(6)
    away = np.array([-1.0, 0, 0, 2.0, 0, 5.0])
    assert time(q, still, still)[0] == time(q, away, still)[0] > 1e200
    closing, pulled = np.array([0, 0, 0, -2.0, 0, 0]), np.array([0, 0, 0, -4.0, 0, 0])
    assert time(q, closing, still)[0] == pytest.approx(0.75 * 0.8 / 2.0, rel=1e-12)
    assert time(q, still, pulled)[0] == pytest.approx(np.sqrt(2.0 * 0.75 * 0.8 / 4.0), rel=1e-12)
    assert time(q, away / 3.0, pulled)[0] == pytest.approx((1.0 + np.sqrt(1.0 + 2.0 * 4.0 * 0.6)) / 4.0, rel=1e-12)
