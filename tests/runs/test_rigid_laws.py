"""Rigid contact: what holds in every scene: energy, momentum, other axes and units, any part of a step."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from models import IN_C
from rigid_scenes import G, pile, rigid, thrown
from sweeps import TARGETS, part_of

import eomgen as eg

KINDS = ("circle", "box", "triangle", "segment")


@cache
def heap() -> eg.Module:
    return pile(KINDS).compile(**IN_C)


@pytest.mark.parametrize(("seed", "count"), part_of([(7, 12), *((seed, 50) for seed in range(10, 18))], (7, 12).__eq__))
def test_energy_never_grows_in_random_scenes(seed: int, count: int) -> None:
    """Piles, with friction and restitution of any size: no more energy than before, and no shape in another."""
    rng, missed = np.random.default_rng(seed), 0
    for k in range(count):
        law = {"mu": rng.uniform(0, 1), "e": (0.0, rng.uniform(0, 1), 1.0)[k % 3]}
        run = heap().simulate(0.2, thrown(rng, 4), law, method="moreau", step=1e-3)
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
    m.revolute("A", m.ground, crank, coordinate="a")
    m.revolute("B", crank.at(0.2, 0, 0), coupler, coordinate="b")
    m.revolute("C", coupler.at(0.5, 0, 0), rocker.at(0.4, 0, 0))
    m.revolute("D", m.ground.at(0.45, 0, 0), rocker, coordinate="d")
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
