"""Shapes that land without rebound, by moreau: one impact, whatever the part of the step in which they meet.

The judges are the closed form of a plastic impact with friction, and the limit of small restitutions.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

import eomgen as eg

TARGETS = ("numpy", "cython")


def rod(restitution: float, friction: float) -> eg.Model:
    """A rod of 1 m and 1 kg over a floor."""
    m = eg.Model("rod", gravity=(0, 0, 0))
    body = m.body("body", mass=1.0, inertia={"zz": 1 / 12})
    m.planar("j", m.ground, body)
    law = {"normal_law": "rigid", "restitution": restitution, "friction": friction}
    shape = {"shape": "segment", "on": body, "length": 1.0, "radius": 0.01}
    m.contacts("c", shape, {"shape": "half_plane", "on": m.ground}, law)
    return m


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
@pytest.mark.parametrize("h", [1e-4, 2.5e-5])
def test_an_impact_with_friction_does_not_depend_on_where_in_the_step_it_falls(
    target: str, friction: float, h: float
) -> None:
    module, angle = rod(0.0, friction).compile(target=target), 1.0
    found = []
    for gap in np.linspace(1.05e-3, 1.05e-3 + 2 * h, 9):
        start = {"j_y": 0.5 * np.sin(angle) + 0.01 + gap, "j_y_dot": -1.0, "j_3": angle, "j_x_dot": 0.5}
        found.append(module.simulate(1.6e-3, start, method="moreau", step=h).x[3:, -1])
    expected = plastic(angle, friction, (0.5, -1.0, 0.0))
    assert np.array(found) == pytest.approx(np.tile(expected, (9, 1)), abs=10 * h)
    assert np.ptp(found, axis=0).max() < 10 * h


def test_it_is_the_limit_of_small_restitutions() -> None:
    start = {"j_y": 0.5 * np.sin(1.0) + 0.0112, "j_y_dot": -1.0, "j_3": 1.0, "j_x_dot": 0.5}
    ends = [
        rod(e, 0.1).compile(target="numpy").simulate(1.6e-3, start, method="moreau", step=2.5e-5).x[3:, -1]
        for e in (0.0, 1e-12)
    ]
    assert ends[0] == pytest.approx(ends[1], abs=2.5e-4)


@pytest.mark.parametrize("target", TARGETS)
def test_what_lands_touches(target: str) -> None:
    """A stack that falls: its parts stay together, and no gap is left under it."""
    m = eg.Model("stack", gravity=(0, -9.81, 0))
    boxes = []
    for k in range(3):
        box = m.body(f"b{k}", mass=1.0, inertia={"zz": 0.01})
        m.planar(f"j{k}", m.ground, box)
        boxes.append({"shape": "box", "on": box, "size": (0.3, 0.2)})
    law = {"normal_law": "rigid", "restitution": 0.0, "friction": 0.5}
    m.contacts("floor", boxes, {"shape": "half_plane", "on": m.ground}, law)
    m.contacts("between", boxes, law=law)
    height = 0.0113
    run = m.compile(target=target).simulate(
        0.2, {f"j{k}_y": 0.1 + 0.2 * k + height for k in range(3)}, method="moreau", step=1e-3
    )
    fallen = int(np.searchsorted(run.t, np.sqrt(2.0 * height / 9.81))) + 2
    for k in range(3):
        assert run[f"j{k}_y"][fallen:] == pytest.approx(0.1 + 0.2 * k, abs=5e-5)
        assert run[f"j{k}_y_dot"][fallen:] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("gap", [0.0, 1e-7, 0.01])
def test_a_plastic_cradle_leaves_no_residual(target: str, gap: float) -> None:
    """Three balls that go on as one: nothing moves beside them, and no residual is too large for that."""
    m: Any = eg.Model("cradle", gravity=(0, 0, 0))
    for k in range(3):
        m.prismatic(f"j{k}", m.ground, m.body(f"b{k}", mass=1.0), axis="x", coordinate=f"x{k}")
    balls = [{"shape": "sphere", "on": f"b{k}", "radius": 0.1} for k in range(3)]
    m.contacts("c", balls, law={"normal_law": "rigid", "restitution": 0.0})
    module = m.compile(target=target)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = module.simulate(1.0, {"x0": -0.3, "x1": 0.0, "x2": 0.2 + gap, "x0_dot": 1.0}, method="moreau", step=1e-3)
    assert run.x[3:, -1] == pytest.approx([1 / 3] * 3, abs=1e-4)
    assert run.x[3:].sum(axis=0) == pytest.approx(1.0, abs=1e-13)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("part", [0.1, 0.35, 0.6, 0.85])
def test_a_landing_keeps_momenta(target: str, part: float) -> None:
    """A disc lands on the end of a free rod, with friction, wherever in the step: momentum and its moment stay."""
    m = eg.Model("free", gravity=(0, 0, 0))
    rod_, disc = m.body("rod", mass=2.0, inertia={"zz": 0.1}), m.body("disc", mass=0.5, inertia={"zz": 0.002})
    m.planar("a", m.ground, rod_)
    m.planar("b", m.ground, disc)
    law = {"normal_law": "rigid", "restitution": 0.0, "friction": 0.7}
    m.contacts(
        "c", {"shape": "box", "on": rod_, "size": (0.8, 0.1)}, {"shape": "circle", "on": disc, "radius": 0.1}, law
    )
    start = {
        "b_x": 0.3,
        "b_y": 0.15 + 0.02 + part * 2e-3,
        "b_y_dot": -2.0,
        "b_x_dot": 1.5,
        "b_3_dot": 30.0,
        "a_3_dot": 0.4,
    }
    run = m.compile(target=target).simulate(0.014, start, method="moreau", step=1e-3)
    x, y, vx, vy, w = (np.array([run[f"{k}_{n}"] for k in "ab"]) for n in ("x", "y", "x_dot", "y_dot", "3_dot"))
    mass, inertia = np.array([2.0, 0.5]), np.array([0.1, 0.002])
    assert abs(vy[1, -1] - vy[1, 0]) > 0.5
    hit = 1 + int(np.argmax(np.abs(np.diff(vy[1])) > 0.1))
    for kept in (mass @ vx, mass @ vy, (mass @ (x * vy - y * vx) + inertia @ w)[: hit + 1]):
        assert kept == pytest.approx(np.full(len(kept), kept[0]), abs=1e-12)
    assert np.diff(run["energy"]).max() < 1e-6 * run["energy"][0]


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("gap", [0.01, 0.0103])
def test_a_landing_moves_nothing_else(target: str, gap: float) -> None:
    """A box that a large force presses to the floor, where friction holds it, while another lands beside it."""
    m = eg.Model("beside", gravity=(0, -9.81, 0))
    held, other = m.body("held", mass=0.1, inertia={"zz": 0.001}), m.body("other", mass=1.0, inertia={"zz": 0.01})
    m.planar("a", m.ground, held)
    m.planar("b", m.ground, other)
    m.force("press", held.at(0, 0, 0), (300, -1000, 0))
    boxes = [{"shape": "box", "on": body, "size": (0.2, 0.2)} for body in (held, other)]
    law = {"normal_law": "rigid", "restitution": 0.0, "friction": 0.5}
    m.contacts("floor", boxes, {"shape": "half_plane", "on": m.ground}, law)
    start = {"a_y": 0.1, "b_x": 2.0, "b_y": 0.1 + gap, "b_y_dot": -1.0}
    run = m.compile(target=target).simulate(0.03, start, method="moreau", step=1e-3)
    assert run["b_y"][-1] == pytest.approx(0.1, abs=1e-9)
    assert np.abs(run["a_x"]).max() < 1e-10
    assert np.abs(run["a_y"] - 0.1).max() < 1e-10


def test_fast_bodies_stop_at_thin_walls_while_others_land() -> None:
    m = eg.Model("wall", gravity=(0, -9.81, 0))
    fast, ball = m.body("fast", mass=1.0, inertia={"zz": 0.01}), m.body("ball", mass=1.0, inertia={"zz": 0.01})
    m.planar("a", m.ground, fast)
    m.planar("b", m.ground, ball)
    small, large = ({"shape": "circle", "on": b, "radius": r} for b, r in ((fast, 0.005), (ball, 0.1)))
    wall = {"shape": "box", "on": m.ground.at(0.5, 1.0, 0), "size": (0.01, 2.0)}
    law = {"normal_law": "rigid", "restitution": 0.0, "friction": 0.2}
    m.contacts("stop", small, wall, law)
    m.contacts("floor", large, {"shape": "half_plane", "on": m.ground}, law)
    module = m.compile()
    for phase in np.linspace(0.0, 0.02, 23):
        start = {"a_x": 0.1 + phase, "a_y": 1.0, "a_x_dot": 20.0, "b_x": -1.0, "b_y": 0.1 + 0.0189, "b_y_dot": -1.0}
        assert module.simulate(0.04, start, method="moreau", step=1e-3)["a_x"].max() < 0.5


@pytest.mark.parametrize("target", TARGETS)
def test_what_lands_elsewhere_in_the_same_step_changes_nothing(target: str) -> None:
    """Balls beside each other fall from many heights, as each does alone."""

    def balls(count: int) -> Any:
        m = eg.Model("balls", gravity=(0, -9.81, 0))
        bodies = [m.body(f"b{k}", mass=1.0, inertia={"zz": 0.01}) for k in range(count)]
        for k, body in enumerate(bodies):
            m.planar(f"j{k}", m.ground, body)
        shapes = [{"shape": "circle", "on": body, "radius": 0.1} for body in bodies]
        law = {"normal_law": "rigid", "friction": 0.3}
        m.contacts("c", shapes, {"shape": "half_plane", "on": m.ground}, law)
        return m.compile(target=target)

    heights = 0.12 + np.random.default_rng(1).uniform(0, 0.004, 8)
    start = {f"j{k}_y": y for k, y in enumerate(heights)} | {f"j{k}_x": float(k) for k in range(8)}
    together, alone = balls(8).simulate(0.12, start, method="moreau", step=1e-3), balls(1)
    landed = 0
    for k, y in enumerate(heights):
        one = alone.simulate(0.12, {"j0_y": y}, method="moreau", step=1e-3)
        assert together[f"j{k}_y"] == pytest.approx(one["j0_y"], abs=1e-9)
        landed += abs(one["j0_y"][-1] - 0.1) < 1e-9
    assert landed == 8
