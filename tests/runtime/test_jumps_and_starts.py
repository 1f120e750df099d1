"""Events that jump happen once, and a value that starts at zero and comes back within a step is found where it does."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg

STEPPED = ("DOP853", "RK45", "RK23", "Radau", "BDF", "LSODA", "RK4", "Taylor")
LOOPS = [*(("cython", method) for method in STEPPED), *(("numpy", method) for method in STEPPED[:6])]
JUMPS = 9


def thrown(**initial: float) -> eg.Model:
    m = eg.Model("thrown", gravity=(0, -9.81, 0))
    ball = m.body("ball", mass=1.0)
    m.prismatic("J", m.ground, ball, axis="y", coordinate="h")
    m.initial(**initial)
    return m


def compiled(kind: str) -> dict[str, Any]:
    m = thrown(h=0.0, h_dot=5.0) if kind == "floor" else thrown(h=1.0)
    if kind == "floor":
        m.event("floor", "h", direction=-1, reset={"h_dot": "-0.9*h_dot"})
    for k in range(JUMPS if kind == "jumps" else 0):
        m.event(f"e{k}", f"1 if t > {0.1 * (k + 1)!r} else -1", reset={"h_dot": "h_dot + 1"})
    return {target: m.compile(target=target) for target in ("cython", "numpy")}


@pytest.fixture(scope="module")
def floor() -> dict[str, Any]:
    return compiled("floor")


@pytest.fixture(scope="module")
def jumps() -> dict[str, Any]:
    return compiled("jumps")


@pytest.mark.parametrize(("target", "method"), LOOPS)
def test_a_ball_thrown_up_from_the_floor_lands(floor: dict[str, Any], target: str, method: str) -> None:
    """Also where one step holds the whole flight, as Taylor takes it."""
    lands = 2 * 5.0 / 9.81
    given = {"step": 1.2 * lands} if method == "RK4" else {"first_step": 1.2 * lands}
    given = {} if method == "Taylor" else given
    run = floor[target].simulate(1.25 * lands, method=method, rtol=1e-9, atol=1e-11, **given)
    assert np.asarray(run.t_events["floor"]) == pytest.approx([lands], rel=1e-6)
    rest = 0.25 * lands
    assert run["h"][-1] == pytest.approx(4.5 * rest - 9.81 / 2 * rest**2, abs=1e-5)


@pytest.mark.parametrize(("target", "method"), LOOPS)
def test_a_value_that_jumps_resets_once(jumps: dict[str, Any], target: str, method: str) -> None:
    given = {"step": 0.013} if method == "RK4" else {}
    run = jumps[target].simulate(1.5, method=method, **given)
    for k in range(JUMPS):
        assert np.asarray(run.t_events[f"e{k}"]) == pytest.approx([0.1 * (k + 1)], abs=1e-12)
    true = 1.0 - 9.81 / 2 * 1.5**2 + sum(1.5 - 0.1 * (k + 1) for k in range(JUMPS))
    assert run["h"][-1] == pytest.approx(true, abs=1e-6)
