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


@pytest.mark.parametrize("way", ["planar", "free", "turned", "chain"])
@pytest.mark.parametrize("factor", [2.0, 0.5, 10.0])
def test_a_gap_at_another_scale_is_refused(way: str, factor: float) -> None:
    module = thrown(f"{factor}*({{y}} - 0.5)", "{v}", way).compile(target="numpy")
    with pytest.raises(UsageError, match=rf"gap hit changes by {factor:g} for each.*divide it by {factor:g}"):
        module.simulate(0.4)


@pytest.mark.parametrize("way", ["planar", "free", "turned", "chain"])
@pytest.mark.parametrize("factor", [2.0, 0.5])
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
    m.output("half", "0.5*(P_y - 0.5)")
    module = m.compile(target="numpy")
    start = module.x0(P_y=0.5, P_y_dot=-1.0, P_x_dot=1.0)
    with pytest.raises(UsageError, match=r"gap half changes by 0\.5"):
        module.impact(0.0, start, {"half": 0.5}, friction={"half": (0.1, "slide")})


def test_a_pendulum_has_no_place_to_tell_it_by() -> None:
    """Its gap cannot be judged, and is taken as it is written."""
    m = eg.Model("pendulum", gravity=(0, -10, 0))
    m.revolute("A", m.ground, m.body("bob", mass=1.0, inertia={"zz": 0.1}, com=(0.5, 0, 0)), axis="z", coordinate="q")
    m.output("slide", "q_dot")
    m.event("hit", "q + 1", restitution=0.5, friction=0.1, slip="slide")
    assert len(m.compile(target="numpy").simulate(1.0).t_events["hit"])
