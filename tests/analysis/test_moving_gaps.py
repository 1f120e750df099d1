"""Impacts on a floor that an input moves: a ball that falls on it leaves at twice its speed less its own (e = 1)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg

G, SPEED = 10.0, 0.5
WAYS: dict[str, Any] = {
    "text": "0.5*t",
    "line": ([0.0, 2.0], [0.0, 1.0]),
    "bent": ([-1.0, 0.0, 2.0], [0.0, 0.0, 1.0]),
    "spline": eg.Signal([0.0, 0.2, 0.6], [0.0, 0.1, 0.3], "cubic"),
}
#: The ball meets the floor where 1 - g t^2/2 = w t.
HIT = (-SPEED + np.sqrt(SPEED**2 + 2.0 * G)) / G
AFTER = 2.0 * SPEED + G * HIT


def ball(target: str, bounces: bool = True) -> Any:
    m = eg.Model("racket", gravity=(0, -G, 0))
    m.input("u")
    body = m.body("ball", mass=1)
    m.prismatic("s", m.ground, body, axis="y")
    m.initial(s=1.0)
    m.output("over", "s - u")
    if bounces:
        m.event("floor", "s - u", restitution=1.0)
    return m.compile(target=target)


@pytest.fixture(scope="module", params=["cython", "numpy"])
def racket(request: Any) -> Any:
    return ball(request.param)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("method", ["DOP853", "Radau", "LSODA"])
def test_a_hit_takes_the_speed_of_the_floor(racket: Any, way: str, method: str) -> None:
    run = racket.simulate(0.6, inputs={"u": WAYS[way]}, method=method, rtol=1e-10, atol=1e-12)
    assert racket.u_names == ("u", "u_dot")
    assert abs(run.t_events["floor"][0] - HIT) < 1e-9
    assert (
        abs(
            run["s_dot"][np.searchsorted(run.t, HIT + 1e-6)]
            + G * (run.t[np.searchsorted(run.t, HIT + 1e-6)] - HIT)
            - AFTER
        )
        < 1e-8
    )


def test_a_floor_whose_rate_is_not_known_is_refused(racket: Any) -> None:
    with pytest.raises(eg.UsageError, match="its rate u_dot, and the rate of a function is not known"):
        racket.simulate(0.6, inputs={"u": lambda t, x: SPEED * t})
    with pytest.raises(eg.UsageError, match="the gap depends on the input u"):
        racket.simulate(0.6, inputs={"u": "0.1*s"})
    given = {"u": lambda t, x: SPEED * t, "u_dot": SPEED}
    run = racket.simulate(0.6, inputs=given, rtol=1e-10, atol=1e-12)
    assert abs(run["s_dot"][-1] + G * (0.6 - HIT) - AFTER) < 1e-8


def test_gaps_given_for_a_run_or_an_impact_move_with_their_inputs() -> None:
    mod = ball("numpy", bounces=False)
    assert mod.u_names == ("u",)
    for given in (*WAYS.values(), lambda t, x: SPEED * t):
        run = mod.simulate_impacts(0.6, {"over": 1.0}, inputs={"u": given}, rtol=1e-10, atol=1e-12)
        assert abs(run.impacts[0][0] - HIT) < 1e-9
        assert abs(run["s_dot"][-1] + G * (0.6 - HIT) - AFTER) < 1e-8
    for given in ("0.1*s", lambda t, x: 0.1 * x[0]):
        with pytest.raises(eg.UsageError, match="input u depends on the state"):
            mod.simulate_impacts(0.6, {"over": 1.0}, inputs={"u": given})
    mod = ball("numpy")
    hit = mod.impact(0.0, [0.3, -2.0], {"over": 0.5}, u={"u": 0.3, "u_dot": 1.0})
    assert abs(hit.x[1] - (1.0 + 0.5 * 3.0)) < 1e-12  # leaves at e times the speed of approach
    held = mod.impact(0.0, [0.3, -2.0], {"over": 0.5}, u={"u": 0.3})
    assert abs(held.x[1] - 1.0) < 1e-12
