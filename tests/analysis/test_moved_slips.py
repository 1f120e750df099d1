"""Impacts with friction on what moves by itself, beside gaps without friction, and of one point in space in any way."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.analysis.impact_friction import strike_rough


def thrown_on_a_table(slip: str) -> Any:
    """A body that falls on a table that moves by an input, seen as a place or as a velocity."""
    m = eg.Model("ball", gravity=(0, -9.81, 0))
    b = m.body("b", mass=1.0, inertia={"zz": 0.004})
    m.planar("j", m.ground, b)
    m.input("X"), m.input("V")
    m.output("place", "j_x - X")
    m.output("speed", "vx(b) - V")
    m.output("gap", "j_y - 0.1")
    m.event("floor", "j_y - 0.1", restitution=0.5, friction=0.1, slip=slip)
    m.initial(j_y=0.3)
    return m.compile(target="numpy")


@pytest.mark.parametrize("slip", ["place", "speed"])
@pytest.mark.parametrize("X", ["2*t", ([0.0, 1.0], [0.0, 2.0]), lambda t, x: 2.0 * t])
def test_events_and_runs_see_the_rate_of_a_table(slip: str, X: Any) -> None:
    """It slides all through the impact, so that it takes mu (1 + e) v_n of the table's speed."""
    mod, inputs = thrown_on_a_table(slip), {"X": X, "V": "2.0"}
    expected = 0.1 * 1.5 * np.sqrt(2 * 9.81 * 0.2)
    run = mod.simulate(0.3, inputs=inputs)
    again = mod.simulate_impacts(0.3, {"gap": 0.5}, friction={"gap": (0.1, slip)}, inputs=inputs)
    np.testing.assert_allclose([run["j_x_dot"][-1], again["j_x_dot"][-1]], expected, rtol=1e-8)


def test_a_table_that_moves_with_the_state_is_refused() -> None:
    with pytest.raises(eg.UsageError, match="input X depends on the state, and so does its rate"):
        thrown_on_a_table("place").simulate(0.3, inputs={"X": "2*j_x_dot", "V": "0"})


@pytest.mark.parametrize(
    ("slip", "unit", "upright", "speed"),
    [
        ("vx(b) - 2", "", False, -2.0),
        ("0*vx(b) - 2", "", False, -2.0),
        ("0*fly_y_dot - 2", "", True, -2.0),
        ("vx(b) - 1", "", True, -1.0),
        ("0*belt - 1", "", True, -1.0),
        ("-V", "", True, -3.0),  # V is in m/s
        ("-W", "m/s", True, -4.0),
        ("-W", "", True, 0.0),  # a place, that of something at rest
        ("x(b) - 2*t", "", True, -2.0),
        ("x(b) - 2", "", True, 0.0),
        ("sin(fly_x)*vx(b) - 2", "", False, -2.0),  # no velocity moves it where x is 0
    ],
)
def test_velocities_and_places_by_how_they_are_written(slip: str, unit: str, upright: bool, speed: float) -> None:
    m = eg.Model("belt")
    b = m.body("b", mass=1.0, inertia={"zz": 0.1})
    m.input("V", 3.0, unit="m/s"), m.input("W", 4.0)
    if upright:
        m.prismatic("fly", m.ground, b, axis="y", coordinate="fly_y")
    else:
        m.planar("fly", m.ground, b)
    m.output("slide", slip, unit=unit)
    m.output("belt", "vx(b)")
    m.output("gap", "y(b)")
    mod = m.compile(target="numpy")
    hit = mod.impact(0.5, mod.x0(fly_y_dot=-1.0), {"gap": 0.5}, friction={"gap": (0.4, "slide")})
    np.testing.assert_allclose(hit.sliding_before["gap"], [speed], atol=1e-9)
    np.testing.assert_allclose(hit.friction["gap"], [-np.sign(speed) * 0.4 * 1.5], atol=1e-9)


def test_a_belt_brings_energy_in() -> None:
    m = eg.Model("belt")
    m.planar("fly", m.ground, m.body("b", mass=1.0, inertia={"zz": 0.1}))
    m.output("gap", "y(b)")
    m.output("slide", "vx(b) - 2")
    mod = m.compile(target="numpy")
    hit = mod.impact(0.0, mod.x0(fly_y_dot=-1.0), {"gap": 1.0}, friction={"gap": (0.3, "slide")})
    assert hit.energy_lost == pytest.approx(-0.5 * (0.3 * 2.0) ** 2)


def line(slides: bool = False) -> Any:
    """Four bodies on a line with gaps between them, and one that flies far away and strikes the floor."""
    m = eg.Model("line")
    for i in range(4):
        m.prismatic(f"s{i}", m.ground, m.body(f"b{i}", mass=1.0), axis="x")
    m.planar("f", m.ground, m.body("far", mass=1.0, inertia={"zz": 0.1}))
    for i in range(3):
        m.output(f"g{i}", f"s{i + 1} - s{i}")
    m.output("gf", "y(far)")
    m.output("slide", "vx(far)")
    m.output("rub", "s3_dot")
    return m.compile(target="numpy")


def test_friction_far_away_changes_nothing() -> None:
    """The second body of the line opens and closes again at once, which is where both laws differ."""
    mod = line()
    x = mod.x0(s0_dot=1.0, s2_dot=0.3, s3_dot=0.5, f_x_dot=0.2, f_y_dot=-1.0)
    for e in (1.0, 0.5, 0.0):
        gaps = dict.fromkeys(("g0", "g1", "g2", "gf"), e)
        plain = mod.impact(0.0, x, gaps)
        for friction in ({"gf": (0.0, "slide")}, {"gf": (0.3, "slide")}, {"g2": (0.0, "rub"), "gf": (0.1, "slide")}):
            hit = mod.impact(0.0, x, gaps, friction=friction)
            np.testing.assert_allclose(hit.x[7:11], plain.x[7:11], atol=1e-12)
            np.testing.assert_allclose(hit.impulses, plain.impulses, atol=1e-12)
            mu = friction["gf"][0]
            np.testing.assert_allclose(hit.friction["gf"], [-min(mu * (1 + e), 0.2)], atol=1e-12)
            assert hit.energy_lost >= -1e-14
        if e == 1.0:
            np.testing.assert_allclose(plain.x[7:11], [0.0, 0.3, 0.5, 1.0], atol=1e-12)


def test_little_friction_where_no_gap_opens_is_none() -> None:
    mod, rng = line(), np.random.default_rng(4)
    for _ in range(20):
        v = np.sort(rng.normal(size=4))[::-1]
        x = mod.x0(**{f"s{i}_dot": v[i] for i in range(4)})
        gaps = {f"g{i}": float(e) for i, e in enumerate(rng.random(3))}
        plain, hit = mod.impact(0.0, x, gaps), mod.impact(0.0, x, gaps, friction={"g2": (1e-12, "rub")})
        closing = plain.rates_after >= -1e-12
        assert closing.all()
        np.testing.assert_allclose(hit.x, plain.x, atol=1e-9)


def holds(W: Any, y: Any, P: Any, mu: float) -> None:
    """Newton's law, here without restitution, and Coulomb's law for the velocities after."""
    after, size = y + W @ P, np.abs(P).max()
    assert abs(after[0]) <= 1e-8 * np.abs(y).max()
    assert P[0] > 0.0
    slip, pull = after[1:], P[1:]
    assert np.linalg.norm(pull) <= mu * P[0] * (1 + 1e-8) + 1e-9 * size
    if np.linalg.norm(slip) > 1e-6 * np.abs(y).max():
        np.testing.assert_allclose(pull, -mu * P[0] * slip / np.linalg.norm(slip), atol=1e-5 * size)


def test_a_point_in_space_that_iterations_do_not_find() -> None:
    W = np.array(
        [
            [0.461513331433851, -0.5970407534912346, 2.1685525894882103],
            [-0.5970407534912346, 2.085488025017902, -1.9825999639960386],
            [2.1685525894882103, -1.9825999639960386, 11.560157281335272],
        ]
    )
    y = np.array([-0.12082173954126577, 0.15224943425546106, -2.3762506027287724])
    for a in (0.0, 0.7, 2.0, -1.4):  # axes across that are turned
        turn = np.eye(3)
        turn[1:, 1:] = [[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]
        given = turn @ W @ turn.T, turn @ y
        P = strike_rough(*given, np.zeros(1), np.full(3, 1e-13), np.ones(1), np.array([0, 0]), ["g"])
        holds(*given, P, 1.0)
        np.testing.assert_allclose(P[0], 0.045752, atol=1e-6)
        np.testing.assert_allclose((turn.T @ P)[1:], -P[0] * np.array([np.cos(4.730956), np.sin(4.730956)]), atol=1e-6)


def test_a_point_in_space_always_has_impulses() -> None:
    """A positive definite inverse mass leaves no impact without a solution (Acary, Cadoux, Lemarechal, Malick 2011)."""
    rng, count = np.random.default_rng(8), 0
    for k in range(1500):
        A = rng.normal(size=(3, 3)) * np.exp(rng.normal(size=(3, 1)))
        W, y, mu = A @ A.T, A @ rng.normal(size=3), float(rng.exponential())
        if k % 5 == 0:
            W[1:, 1:] = np.eye(2) * (W[1, 1] + W[2, 2])  # as round across as a ball
        if not y[0] < -1e-3:
            continue
        count += 1
        P = strike_rough(W, y, np.zeros(1), np.full(3, 1e-14), np.array([mu]), np.array([0, 0]), ["g"])
        holds(W, y, P, mu)
        assert P @ (y + 0.5 * W @ P) <= 1e-9 * np.abs(P * y).max()
    assert count > 600
