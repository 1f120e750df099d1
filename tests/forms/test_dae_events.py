"""Events of IDA's runs: closed forms, and the same as those of simulate."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg

G = 9.81


def ball(**floor: Any) -> Any:
    m = eg.Model("ball", gravity=(0, -G, 0))
    e = m.parameter("e", 0.9)
    m.prismatic("J", m.ground, m.body("ball", mass=1.0), axis="y", coordinate="h")
    m.initial(h=1.0)
    m.event("floor", "h", **({"direction": -1, "reset": {"h_dot": -e * m.coordinate("h_dot")}} | floor))
    m.event("apex", "h_dot", direction=-1)
    return m.compile(target="numpy")


@pytest.fixture(scope="module")
def bouncing() -> Any:
    pytest.importorskip("sksundae")
    return ball()


def hits(e: float, count: int) -> np.ndarray:
    first, rest = np.sqrt(2 / G), 2 * np.sqrt(2 / G) * e ** np.arange(1, count)
    return np.cumsum([first, *rest])


def test_a_ball_bounces_as_in_closed_form(bouncing: Any) -> None:
    run = bouncing.dae.solve((0, 2.8), rtol=1e-9, atol=1e-11)
    times = hits(0.9, 4)
    np.testing.assert_allclose(run.t_events["floor"], times, atol=1e-9)
    assert run.t_events["apex"][0] == 0.0
    np.testing.assert_allclose(run.t_events["apex"][1:], (times[:-1] + times[1:]) / 2, atol=1e-9)
    np.testing.assert_allclose(run.x_events["floor"][1], -np.sqrt(2 * G) * 0.9 ** np.arange(4), rtol=1e-8)
    assert run["h"].min() > -1e-9
    twice = np.flatnonzero(np.diff(run.t) == 0.0)
    assert len(twice) == 4
    np.testing.assert_allclose(run["h_dot"][twice + 1], -0.9 * run["h_dot"][twice], rtol=1e-12)
    asked = np.linspace(0.0, 2.8, 13)
    at = bouncing.dae.solve((0, 2.8), t_eval=asked, rtol=1e-9, atol=1e-11)
    np.testing.assert_array_equal(at.t, asked)
    last = np.searchsorted(times, asked) - 1
    after, up = (
        asked - np.where(last < 0, 0.0, times[last]),
        np.where(last < 0, 0.0, np.sqrt(2 * G) * 0.9 ** (last + 1.0)),
    )
    np.testing.assert_allclose(at["h"], np.where(last < 0, 1.0, 0.0) + up * after - G * after**2 / 2, atol=1e-8)


def test_runs_that_an_event_ends_and_bounces_that_die_away(bouncing: Any) -> None:
    ended = ball(terminal=3).dae.solve((0, 10), rtol=1e-9, atol=1e-11)
    assert (ended.status, len(ended.t_events["floor"])) == (1, 3)
    assert ended.t[-1] == pytest.approx(hits(0.9, 3)[-1], abs=1e-9)
    half = bouncing.dae.solve((0, 10), events={"half": {"expression": "h - 0.5", "terminal": True}})
    assert half.t[-1] == pytest.approx(np.sqrt(1 / G), abs=1e-7)
    with pytest.raises(eg.ZenoError, match=r"floor.*near t = 8.5789.*Zeno"):
        bouncing.dae.solve((0, 20))
    with pytest.raises(eg.ZenoError, match="repeats without an end"):
        ball(reset={"h_dot": "0"}).dae.solve((0, 2))
    with pytest.raises(eg.UsageError, match="sets eventsfn of IDA itself, so it cannot be given; give events="):
        bouncing.dae.solve((0, 1), eventsfn=print)


def two_bars() -> eg.Model:
    """A double pendulum whose end hits a wall that moves."""
    m = eg.Model("wall", gravity=(0, -G, 0))
    upper = m.body("upper", mass=1.0, com=(0, -0.5, 0), inertia={"zz": 0.08})
    lower = m.body("lower", mass=0.7, com=(0, -0.4, 0), inertia={"zz": 0.05})
    m.revolute("A", m.ground, upper, coordinate="a")
    m.revolute("B", upper.at(0, -1, 0), lower, coordinate="b")
    m.event("wall", lower.at(0, -0.8, 0).position[0] + 0.3 + 0.05 * m.t, restitution=0.6)
    m.initial(a=0.9, b=0.2)
    return m


def crank(event: str, theta: float, folder: Path) -> eg.Model:
    source = (Path(__file__).parents[2] / "examples" / "slider_crank.yaml").read_text(encoding="utf-8")
    source = source.replace("initial: {theta: 0.3, theta_dot: 10}", f"initial: {{theta: {theta}, theta_dot: -10}}")
    (folder / "crank.yaml").write_text(f"{source}\nevents: {{{event}}}\n", encoding="utf-8")
    return eg.load(folder / "crank.yaml")


@pytest.mark.parametrize(
    ("name", "end"), [("an impact of a tree", 1.2), ("a reset in a loop", 0.3), ("an impact in a loop", 0.2)]
)
def test_mechanisms_meet_events_as_in_simulate(name: str, end: float, tmp_path: Path) -> None:
    pytest.importorskip("sksundae")
    kick = "kick: {expression: theta + 1, direction: -1, reset: {theta_dot: 1.1*theta_dot}}"
    model = {
        "an impact of a tree": two_bars,
        "a reset in a loop": lambda: crank(kick, -0.5, tmp_path),
        "an impact in a loop": lambda: crank("stop: {expression: 0.4 - s, restitution: 0.5}", 1.3, tmp_path),
    }[name]()
    mod = model.compile(target="numpy")
    ours = mod.simulate((0, end), rtol=1e-11, atol=1e-13)
    assert len(ours.t_events[0]) >= 1
    errors = []
    for rtol in (1e-6, 1e-9):
        theirs = mod.dae.solve((0, end), rtol=rtol, atol=1e-2 * rtol)
        np.testing.assert_allclose(theirs.t_events[0], ours.t_events[0], atol=10 * rtol)
        assert theirs.residuals.raw_velocity < 1e-3
        errors.append(float(np.abs(theirs.x[:, -1] - ours.x[:, -1]).max() / np.abs(ours.x).max()))
    assert errors[1] < min(1e-6, 0.1 * errors[0])


def test_resets_at_the_end_at_corners_and_backwards() -> None:
    pytest.importorskip("sksundae")
    m = eg.Model("kicked")
    m.prismatic("s", m.ground, m.body("a", mass=1.0), axis="x")
    m.torque("f", "s", m.input("u"))
    m.event("kick", "t - 1", reset={"s_dot": "s_dot + 2"})
    m.event("noted", "s - 0.5")
    mod = m.compile(target="numpy")
    assert mod.dae.solve(1.0)["s_dot"][-1] == 2.0
    bends = mod.dae.solve(2.0, inputs={"u": ([0.0, 1.0, 2.0], [0.0, 0.0, 1.0])})
    assert bends["s_dot"][-1] == pytest.approx(2.5, rel=1e-9)
    jumps = mod.dae.solve(2.0, inputs={"u": eg.Signal([0.0, 1.5], [0.0, 1.0], "zero-order")})
    assert jumps["s_dot"][-1] == pytest.approx(2.5, rel=1e-9)
    assert jumps.t_events["noted"] == pytest.approx([1.25], abs=1e-9)
    assert mod.dae.solve((2.0, 0.0))["s_dot"][-1] == 2.0


@pytest.mark.parametrize("speed", [0.0, -2.0])
@pytest.mark.parametrize("law", [{"restitution": 0.5}, {"terminal": True, "direction": -1}, {"direction": 1}])
def test_an_event_at_the_start_is_as_in_simulate(law: dict[str, Any], speed: float) -> None:
    # a ball on the floor: at rest it is about to fall through, by h = -g t^2 / 2
    m = eg.Model("ball", gravity=(0, -9.81, 0))
    m.prismatic("J", m.ground, m.body("b", mass=1), axis="y", coordinate="h")
    m.event("floor", "h", **law)
    mod, start = m.compile(target="numpy"), {"h": 0.0, "h_dot": speed}
    if law.get("restitution") and not speed:
        for run in (mod.simulate, mod.dae.solve):
            with pytest.raises(eg.ZenoError, match=r"events floor .* near t = 0 s"):
                run(0.1, start)
        return
    runs = [mod.simulate(0.1, start), mod.dae.solve(0.1, start)]
    for run in runs:
        assert len(run.t_events["floor"]) == ("direction" not in law or law["direction"] < 0)
        falls = speed * 0.1 - 0.5 * 9.81 * 0.01 if "restitution" not in law else 0.1 - 0.5 * 9.81 * 0.01
        if law.get("terminal"):
            assert run.t.tolist() == [0.0, 0.0]
            assert run.status == 1
            falls = 0.0
        assert run["h"][-1] == pytest.approx(falls, abs=1e-6)
