"""Impacts with friction: gaps that are no distances, and sliding velocities of other places, are refused by number."""

from __future__ import annotations

import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import UsageError


def thrown(gap: str, slide: str, way: str = "planar") -> eg.Model:
    """A body thrown along a floor at 0.5 m, on joints of several kinds."""
    m = eg.Model("thrown", gravity=(0, -10, 0))
    body = m.body("body", mass=1.0, inertia={"xx": 0.1, "yy": 0.1, "zz": 0.1})
    if way == "planar":
        m.planar("P", m.ground, body)
        names = {"y": "P_y", "v": "P_x_dot"}
    elif way == "free":
        m.free("P", m.ground, body)
        names = {"y": "P_y", "v": "P_x_dot"}
    elif way == "turned":
        m.planar("P", m.ground.at(0, 0, 0, rpy=(0, 0, 0.7)), body)
        names = {"y": "y(body)", "v": "vx(body)"}
    else:
        cart = m.body("cart", mass=1.0)
        m.prismatic("X", m.ground, cart, axis="x", coordinate="s")
        m.prismatic("Y", cart, body, axis="y", coordinate="h")
        names = {"y": "h", "v": "s_dot"}
    m.output("slide", slide.format(**names))
    m.event("hit", gap.format(**names), restitution=0.5, friction=0.1, slip="slide")
    start = {"turned": {"P_x": np.sin(0.7), "P_y": np.cos(0.7), "P_x_dot": np.cos(0.7), "P_y_dot": -np.sin(0.7)}}
    m.initial(start.get(way, {names["y"]: 1.0, names["v"]: 1.0}))
    return m


REFUSED = [(way, factor) for way in ("planar", "free", "turned", "chain") for factor in (2.0, 10.0)] + [("free", 0.5)]


@pytest.mark.parametrize(("way", "factor"), REFUSED)
def test_a_gap_at_another_scale_is_refused(way: str, factor: float) -> None:
    module = thrown(f"{factor}*({{y}} - 0.5)", "{v}", way).compile(target="numpy")
    with pytest.raises(UsageError, match=rf"gap hit changes by {factor:g} for each.*divide it by {factor:g}"):
        module.simulate(0.4)


@pytest.mark.parametrize(("way", "factor"), REFUSED)
def test_so_is_a_sliding_velocity(way: str, factor: float) -> None:
    module = thrown("{y} - 0.5", f"{factor}*{{v}}", way).compile(target="numpy")
    with pytest.raises(UsageError, match=rf"sliding velocity slide changes by {factor:g} for each"):
        module.simulate(0.4)


@pytest.mark.parametrize("way", ["planar", "free", "turned"])
def test_distances_are_taken(way: str) -> None:
    """v+ = v - mu (1 + e) v_n, as the body does not turn."""
    run = thrown("{y} - 0.5", "{v}", way).compile(target="numpy").simulate(0.4)
    P = 1.5 * np.sqrt(10.0)
    v = run.x[-3 if way != "free" else -6 :, -1]
    turn = 0.7 if way == "turned" else 0.0
    assert np.cos(turn) * v[0] - np.sin(turn) * v[1] == pytest.approx(1.0 - 0.1 * P, abs=1e-7)


def test_a_slope_written_by_its_tangent_is_no_distance() -> None:
    """y - x tan a falls to 0 where the distance does, but is 1/cos a as large."""
    with pytest.raises(UsageError, match=r"gap hit changes by 1\.15"):
        thrown("{y} - 0.5 - 0.57735026919*P_x", "{v}*0.866025403784 + P_y_dot*0.5").compile(target="numpy").simulate(
            0.4
        )
    good = thrown("({y} - 0.5 - 0.57735026919*P_x)*0.866025403784", "{v}*0.866025403784 + P_y_dot*0.5")
    good.compile(target="numpy").simulate(0.4)


def test_without_friction_any_scale_is_taken() -> None:
    ends = []
    for factor in (1.0, 2.0):
        m = eg.Model("ball", gravity=(0, -10, 0))
        m.planar("P", m.ground, m.body("ball", mass=1.0, inertia={"zz": 0.1}))
        m.event("hit", f"{factor}*(P_y - 0.5)", restitution=0.5)
        m.initial(P_y=1.0, P_x_dot=1.0)
        ends.append(m.compile(target="numpy").simulate(0.4).x[:, -1])
    assert ends[0] == pytest.approx(ends[1], abs=1e-10)


def test_impacts_by_call_are_judged_too() -> None:
    module = thrown("{y} - 0.5", "{v}").compile(target="numpy")
    m = thrown("{y} - 0.5", "{v}")
    m.output("twice", "2*(P_y - 0.5)")
    module = m.compile(target="numpy")
    start = module.x0(P_y=0.5, P_y_dot=-1.0, P_x_dot=1.0)
    with pytest.raises(UsageError, match=r"gap twice changes by 2 "):
        module.impact(0.0, start, {"twice": 0.5}, friction={"twice": (0.1, "slide")})


def test_a_pendulum_has_no_place_to_tell_it_by() -> None:
    """Its gap cannot be judged, and is taken as it is written."""
    m = eg.Model("pendulum", gravity=(0, -10, 0))
    m.revolute("A", m.ground, m.body("bob", mass=1.0, inertia={"zz": 0.1}, com=(0.5, 0, 0)), axis="z", coordinate="q")
    m.output("slide", "q_dot")
    m.event("hit", "q + 1", restitution=0.5, friction=0.1, slip="slide")
    assert len(m.compile(target="numpy").simulate(1.0).t_events["hit"])


@pytest.mark.parametrize("way", ["planar", "chain", "free"])
def test_a_plane_tilted_against_the_floor(way: str) -> None:
    """A puck on a plane spanned by x and (0, 0.6, 0.8): its height is a distance though it changes by 0.8 of the way.

    It falls 0.5 m, so that it comes down at u = sqrt(9.81); the plane bears a part of the floor's impulse N, of which
    0.8 acts along the plane: 0.8 N = 1.5 u / 0.8.
    """
    m = eg.Model("puck", gravity=(0, 0, -9.81))
    body = m.body("b", mass=1.0, inertia={"xx": 0.008, "yy": 0.008, "zz": 0.008})
    if way == "planar":
        m.planar("F", m.ground.at(0, 0, 0, rpy=(np.arctan2(0.8, 0.6), 0, 0)), body)
    elif way == "chain":
        cart = m.body("cart", mass=1e-9)
        m.prismatic("P", m.ground, cart, axis="x", coordinate="F_x")
        m.prismatic("Q", cart, body, axis=(0, 0.6, 0.8), coordinate="F_y")
    else:
        m.free("F", m.ground, body)
        m.coupling("plane", equation="0.6*z(b) - 0.8*y(b)")
        for k in (1, 2, 3):
            m.coupling(f"turn{k}", equation=f"F_{k}")
    m.output("slide", "vx(b)")
    m.event("hit", "z(b) + 0.5", slip="slide", restitution=0.5, friction=0.1, terminal=2)
    run = m.compile(target="numpy").simulate(1.5, {"F_x_dot": 1.0})
    u = np.sqrt(2.0 * 9.81 * 0.5) * 0.8
    after = np.flatnonzero(np.abs(run.t - run.t_events["hit"][0]) < 1e-12)[-1]
    assert run["F_x_dot"][after] == pytest.approx(1.0 - 0.1 * 1.5 * (u / 0.8) / 0.8, abs=1e-6)


@pytest.mark.parametrize("rope", [{}, {"opens": "100 - t"}])
def test_a_gap_written_by_a_coupled_coordinate(rope: dict[str, str]) -> None:
    """A pulley lifts body B by twice the way of A, always or while it is closed: the height of B in A's coordinate."""
    ends = []
    for gap in ("y(b)", "1 - 2*p"):
        m = eg.Model("pulley", gravity=(0, 0, 0))
        a, b = m.body("a", mass=1.0), m.body("b", mass=1.0, inertia={"zz": 0.1})
        m.prismatic("A", m.ground, a, axis="y", coordinate="p")
        m.planar("B", m.ground, b)
        m.coupling("rope", equation="B_y + 2*p - 1", **rope)
        m.coupling("turn", equation="B_3")
        m.output("slide", "vx(b)")
        m.event("hit", gap, restitution=0.5, friction=0.1, slip="slide")
        m.initial(B_y=1.0, B_y_dot=-1.0, B_x_dot=1.0, p=0.0, p_dot=0.5)
        ends.append(m.compile(target="numpy").simulate(1.5, rtol=1e-11, atol=1e-13))
    assert len(ends[0].t_events["hit"]) == 1
    assert ends[0].x[:, -1] == pytest.approx(ends[1].x[:, -1], abs=1e-8)


def test_far_from_the_origin() -> None:
    m = thrown("{y} - 0.5", "{v}")
    run = m.compile(target="numpy").simulate(0.4, {"P_x": 1e6, "P_y": 1.0, "P_x_dot": 1.0})
    assert run["P_x_dot"][-1] == pytest.approx(1.0 - 0.15 * np.sqrt(10.0), abs=1e-6)
