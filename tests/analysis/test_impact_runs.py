"""Runs with impacts against closed forms and event-driven references written here."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import eomgen as eg

G = 9.81


def box(gravity: float = 0.0, target: str = "numpy") -> Any:
    """A mass between two walls 1 m apart."""
    m = eg.Model("box", gravity=(0, -gravity, 0))
    b = m.body("b", mass=2.0)
    m.prismatic("y", m.ground, b, axis="y")
    m.force("push", b, (0, m.input("F", 0.0), 0))
    m.output("lo", "y")
    m.output("hi", "1 - y")
    return m.compile(target=target)


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_to_and_fro_between_walls(target: str) -> None:
    """The mirror images of the walls: y is a triangle wave of y0 + v t."""
    mod, rng = box(target=target), np.random.default_rng(1)
    for _ in range(20 if target == "numpy" else 5):
        y, v = rng.random(), rng.uniform(-5, 5)
        run = mod.simulate_impacts(2.0, {"lo": 1.0, "hi": 1.0}, {"y": y, "y_dot": v})
        straight = y + v * run.t
        np.testing.assert_allclose(run["y"], 1.0 - np.abs((straight % 2.0) - 1.0), atol=1e-9)
        assert len(run.impacts) == abs(int(np.floor(y + 2 * v)))
        assert run.ended == "end"
        assert run.t[-1] == 2.0


@pytest.mark.parametrize("v", [-30.0, -10.0, 0.5, 3.0, 6.0, 30.0])
def test_between_floor_and_ceiling(v: float) -> None:
    """With gravity: flights by the closed form, from wall to wall."""
    run = box(G).simulate_impacts(1.5, {"lo": 1.0, "hi": 1.0}, {"y": 0.2, "y_dot": v})
    t, y, times = 0.0, 0.2, []
    while True:
        up = v > 0.0 and v * v / (2 * G) > 1.0 - y
        flight = (v - np.sqrt(v * v - 2 * G * (1.0 - y))) / G if up else (v + np.sqrt(v * v + 2 * G * y)) / G
        if t + flight > 1.5:
            break
        t, y, v = t + flight, float(up), -(v - G * flight)
        times.append(t)
    np.testing.assert_allclose([at for at, _ in run.impacts], times, atol=1e-8)
    rest = 1.5 - t
    np.testing.assert_allclose(run.x[:, -1], [y + v * rest - G * rest**2 / 2, v - G * rest], atol=1e-6)
    assert run["y"].min() > -1e-9
    assert run["y"].max() < 1.0 + 1e-9


def test_a_ceiling_that_is_touched_within_one_step() -> None:
    """The solver's steps end above no ceiling, but the flight between does."""
    mod = box(G)
    for over in (1e-6, 1e-4, 1e-2):
        v = np.sqrt(2 * G * (0.5 + over))
        run = mod.simulate_impacts(0.6, {"hi": 0.5}, {"y": 0.5, "y_dot": v})
        assert len(run.impacts) == 1
        np.testing.assert_allclose(run.impacts[0][0], (v - np.sqrt(2 * G * over)) / G, rtol=1e-7)
        assert run["y"].max() < 1.0 + 1e-9
    below = mod.simulate_impacts(0.6, {"hi": 0.5}, {"y": 0.5, "y_dot": np.sqrt(2 * G * (0.5 - 1e-6))})
    assert not below.impacts


def bounced(x: Any, v: Any, m: Any, end: float) -> tuple[Any, Any, int]:
    """Three balls between walls at -1 and 2, from event to event, with e = 1."""
    x, v, t, count = np.array(x), np.array(v), 0.0, 0
    while True:
        gaps = np.array([x[1] - x[0], x[2] - x[1], x[0] + 1, 2 - x[2]])
        rates = np.array([v[1] - v[0], v[2] - v[1], v[0], -v[2]])
        closing = rates < -1e-12
        wait = np.where(closing, -gaps / np.where(closing, rates, 1.0), np.inf)
        i = int(wait.argmin())
        if t + wait[i] > end:
            return x + v * (end - t), v, count
        x, t, count = x + v * wait[i], t + wait[i], count + 1
        if i < 2:
            v[i : i + 2] = 2 * (m[i] * v[i] + m[i + 1] * v[i + 1]) / (m[i] + m[i + 1]) - v[i : i + 2]
        else:
            v[0 if i == 2 else 2] *= -1


def test_three_balls_between_two_walls() -> None:
    m = eg.Model("balls")
    masses = [1.0, 2.0, 0.5]
    for i, mass in enumerate(masses):
        m.prismatic(f"x{i}", m.ground, m.body(f"b{i}", mass=mass), axis="x")
    for name, gap in (("g0", "x1 - x0"), ("g1", "x2 - x1"), ("left", "x0 + 1"), ("right", "2 - x2")):
        m.output(name, gap)
    mod = m.compile(target="numpy")
    gaps = dict.fromkeys(("g0", "g1", "left", "right"), 1.0)
    rng = np.random.default_rng(2)
    for _ in range(5):
        x, v = np.sort(rng.uniform(-1, 2, 3)), 2.0 * rng.normal(size=3)
        run = mod.simulate_impacts(4.0, gaps, np.concatenate([x, v]))
        place, speed, count = bounced(x, v, masses, 4.0)
        np.testing.assert_allclose(run.x[:, -1], [*place, *speed], atol=1e-7)
        assert len(run.impacts) == count > 0
        assert min(run[name].min() for name in gaps) > -1e-9
        assert run.energy_drift < 1e-9


def test_inputs_that_vary_are_followed() -> None:
    """Pressed to the floor by a force that is a number, a table or a function: the same flights."""
    mod = box(0.5)
    runs = [
        mod.simulate_impacts(2.0, {"lo": 0.9}, {"y": 0.2}, inputs={"F": F})
        for F in (-60.0, lambda t, x: -60.0, ([0.0, 2.0], [-60.0, -60.0]), "-60 + 0*t")
    ]
    a, flights = 30.5, np.arange(60)
    first = np.sqrt(0.4 / a)
    times = first + 2 * first * 0.9 * (1 - 0.9**flights) / 0.1
    for run in runs:
        found = np.array([t for t, _ in run.impacts])
        np.testing.assert_allclose(found, times[times < 2.0], atol=1e-8)
        assert run["y"].min() > -1e-9
    np.testing.assert_allclose(runs[1]["F"], -60.0)


def test_a_ball_on_a_racket() -> None:
    """Flights to a moving gap, by roots of their closed form."""
    m = eg.Model("racket", gravity=(0, -G, 0))
    m.prismatic("y", m.ground, m.body("ball", mass=2.0), axis="y")
    m.output("gap", "y - 0.02*sin(30*t)")
    run = m.compile(target="numpy").simulate_impacts(3.0, {"gap": 0.8}, {"y": 0.5}, rtol=1e-10, atol=1e-12)
    t, y, v, times = 0.0, 0.5, 0.0, []

    def gap(s: float) -> float:
        return y + v * s - G * s * s / 2 - 0.02 * np.sin(30 * (t + s))

    while len(times) < 6:
        grid = np.arange(1e-4, 3.0, 1e-4)
        k = int(np.flatnonzero([gap(s) < 0 for s in grid])[0])
        s = brentq(gap, grid[k - 1], grid[k], xtol=1e-15)
        t, y, w = t + s, 0.02 * np.sin(30 * (t + s)), 0.6 * np.cos(30 * (t + s))
        v = w - 0.8 * (v - G * s - w)
        times.append(t)
    np.testing.assert_allclose([at for at, _ in run.impacts][:6], times, atol=1e-7)


def test_balls_pass_it_on_where_there_is_room_between_them() -> None:
    m = eg.Model("cradle")
    for i in range(4):
        m.prismatic(f"x{i}", m.ground, m.body(f"b{i}", mass=1.0), axis="x")
    for i in range(3):
        m.output(f"g{i}", f"x{i + 1} - x{i} - 1")
    mod = m.compile(target="numpy")
    gaps = {"g0": 1.0, "g1": 1.0, "g2": 1.0}
    run = mod.simulate_impacts(3.0, gaps, {"x0": -1.0, "x1": 1.0, "x2": 2.001, "x3": 3.002, "x0_dot": 1.0})
    assert [hit.names for _, hit in run.impacts] == [("g0",), ("g1",), ("g2",)]
    np.testing.assert_allclose(run.x[4:, -1], [0, 0, 0, 1], atol=1e-12)
    run = mod.simulate_impacts(3.0, gaps, {"x0": -1.0, "x1": 1.0, "x2": 2.0, "x3": 3.0, "x0_dot": 1.0})
    assert len(run.impacts) == 1  # those that touch at rest stay together until they are struck
    np.testing.assert_allclose(run.x[4:, -1], [-0.5, 0.5, 0.5, 0.5], atol=1e-12)
    run = mod.simulate_impacts(3.0, dict.fromkeys(gaps, 0.0), {"x0": -1.0, "x1": 1.0, "x2": 2.5, "x3": 4, "x0_dot": 1})
    np.testing.assert_allclose(run.impacts[0][1].x[4:], [0.5, 0.5, 0, 0], atol=1e-12)  # and go on together
    assert run.ended == "end"
    assert run["g0"].min() > -1e-9


def test_how_runs_end() -> None:
    mod = box(G)
    still = mod.simulate_impacts(1.0, {"lo": 0.5}, {"y": 0.0})
    assert (still.ended, len(still.t), still.impacts) == ("rest", 1, [])
    run = mod.simulate_impacts(4.0, {"lo": 0.5}, {"y": 1.0})
    assert run.ended == "rest"
    np.testing.assert_allclose(run.x[1, -2:], [run.impacts[-1][1].rates_before[0], run.impacts[-1][1].rates_after[0]])
    np.testing.assert_allclose(run.x[:, -1], run.impacts[-1][1].x, atol=0)
    plastic = mod.simulate_impacts(4.0, {"lo": 0.0}, {"y": 1.0})
    assert (plastic.ended, len(plastic.impacts), plastic["y_dot"][-1]) == ("rest", 1, 0.0)
    assert mod.simulate_impacts(9.0, {"lo": 0.9}, {"y": 1.0}, most=4).ended == "impacts"
    pulled = mod.simulate_impacts(0.1, {"lo": 0.5}, {"y": 0.0}, inputs={"F": 2 * (G + 1.0)})
    assert pulled.ended == "end"  # it is drawn away
    np.testing.assert_allclose(pulled["y"][-1], 0.005, rtol=1e-8)
    stuck = box().simulate_impacts(1.0, {"hi": 0.0}, {"y": 0.5, "y_dot": 1.0})
    assert (stuck.ended, stuck.t[-1]) == ("end", 1.0)  # nothing presses it to the wall
    np.testing.assert_allclose(stuck["y"][-1], 1.0, atol=1e-9)
    struck = mod.simulate_impacts(0.1, {"lo": 0.5}, {"y": 0.0, "y_dot": -2.0})
    np.testing.assert_allclose(struck.t[:2], 0.0)
    np.testing.assert_allclose(struck["y_dot"][:2], [-2.0, 1.0])


def test_a_gap_that_jumps_is_told() -> None:
    m = eg.Model("jump")
    m.prismatic("y", m.ground, m.body("b", mass=2.0), axis="y")
    m.input("floor", 0.0)
    m.output("gap", "y - floor")
    floor = eg.Signal([0.0, 0.5], [0.0, 1.0], "zero-order")
    with pytest.raises(eg.SimulationError, match=r"the gap gap is -0\.5 at t = 0\.5 s"):
        m.compile(target="numpy").simulate_impacts(1.0, {"gap": 1.0}, {"y": 0.5}, inputs={"floor": floor})


def test_the_run_is_a_trajectory(tmp_path: Path) -> None:
    run = box(G).simulate_impacts(1.5, {"lo": 0.6, "hi": 0.5}, {"y": 0.2, "y_dot": 6.0})
    hits = {name: [t for t, hit in run.impacts if name in hit.names] for name in ("lo", "hi")}
    for name, times in hits.items():
        np.testing.assert_array_equal(run.t_events[name], times)
        np.testing.assert_allclose(run.x_events[name][0], float(name == "hi"), atol=1e-9)
    t = 0.5 * (run.impacts[0][0] + run.impacts[1][0])
    s = t - run.impacts[0][0]
    np.testing.assert_allclose(run.at(t)["y"], 1.0 + run.impacts[0][1].x[1] * s - G * s * s / 2, rtol=1e-9)
    np.testing.assert_allclose(run.at(run.t[[0, -1]]).x, run.x[:, [0, -1]], atol=1e-12)
    assert len(run.pieces) == len(run.impacts) + 1
    assert run.pieces[1].t[0] == run.impacts[0][0] == run.pieces[0].t[-1]
    np.testing.assert_array_equal(np.concatenate([piece["energy"] for piece in run.pieces]), run["energy"])
    read = eg.load_trajectory(run.save(tmp_path / "run.npz"))
    np.testing.assert_array_equal(read["y"], run["y"])
    np.testing.assert_array_equal(read.t_events["hi"], run.t_events["hi"])
    for other in (pickle.loads(pickle.dumps(run)), copy.copy(run)):
        assert (other.ended, len(other.impacts), len(other.pieces)) == (run.ended, len(run.impacts), len(run.pieces))
        np.testing.assert_array_equal(other["lo"], run["lo"])
    pytest.importorskip("pandas")
    assert run.to_pandas("y", "lo").shape == (len(run.t), 2)


def test_an_event_of_the_model_ends_a_run_with_impacts() -> None:
    m = eg.Model("ended", gravity=(0, -10, 0))
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="y", coordinate="h")
    m.event("late", "t - 0.6", terminal=True)
    m.initial(h=1.0)
    run = m.compile(target="numpy").simulate_impacts(2.0, {"h": 0.5})
    assert (run.ended, run.t[-1], len(run.impacts)) == ("event", pytest.approx(0.6, abs=1e-9), 1)
    m.event("often", "h - 0.5", terminal=2)
    with pytest.raises(eg.UsageError, match="event often ends a run after 2 times"):
        m.compile(target="numpy").simulate_impacts(2.0, {"h": 0.5})
