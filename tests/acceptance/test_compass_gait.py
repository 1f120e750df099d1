"""The compass-gait biped walks down a slope of 3 degrees: its limit cycle by constraints that close and open.

Legs of 1 m with 5 kg in their middles, 10 kg at the hip, as in A. Goswami, B. Thuilot, B. Espiau, Compass-like biped
robot, INRIA RR-2996 (1996).  The state right after heel strike on the stable limit cycle is the one that is given for
this biped in the literature after them: stance leg 0.2187, swing leg -0.3234 rad from the vertical, with -1.0918 and
-0.3772 rad/s.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg

SLOPE, G = np.deg2rad(3.0), 9.81
STANCE, SWING, STANCE_RATE, SWING_RATE = 0.2187, -0.3234, -1.0918, -0.3772


@pytest.fixture(scope="module")
def biped() -> Any:
    """In axes along the slope; a foot that comes down in front is held, and the other one let go."""
    m = eg.Model("compass", gravity=(G * np.sin(SLOPE), -G * np.cos(SLOPE), 0))
    carriage, hip = m.body("carriage", mass=0), m.body("hip", mass=10.0)
    m.prismatic("x", m.ground, carriage, axis="x")
    m.prismatic("y", carriage, hip, axis="y")
    for name in "ab":
        leg = m.body(f"leg_{name}", mass=5.0, com=(0, -0.5, 0), inertia={"zz": 0})
        m.revolute(f"turn_{name}", hip, leg, coordinate=name)
        leg.marker("foot", at=(0, -1, 0))
    for name, other in ("ab", "ba"):
        # feet of equal legs touch the ground as they pass each other, which does not count
        ahead = f"x(leg_{name}.foot) - x(leg_{other}.foot)"
        m.hold(
            f"step_{name}", m.ground, f"leg_{name}.foot", axes="xy", closed=name == "a", releases=f"step_{other}",
            closes=f"y(leg_{name}.foot) if {ahead} > 0.3 else 1",
        )  # fmt: skip
    return m.compile()


def start(stance: float, swing: float, stance_rate: float, swing_rate: float) -> dict[str, float]:
    a, b = stance + SLOPE, swing + SLOPE
    hip = {"x": -np.sin(a), "y": np.cos(a), "x_dot": -np.cos(a) * stance_rate, "y_dot": -np.sin(a) * stance_rate}
    return {**hip, "a": a, "b": b, "a_dot": stance_rate, "b_dot": swing_rate}


def by_hand(state: Any) -> tuple[Any, float]:
    """One step by the equations of the paper, with SciPy: the state after the next heel strike, and the time."""
    from scipy.integrate import solve_ivp

    m_H, m, a, b = 10.0, 5.0, 0.5, 0.5
    l = a + b

    def rates(t: float, x: Any) -> Any:
        ns, s, w_ns, w_s = x
        M = np.array([[m * b**2, -m * l * b * np.cos(s - ns)], [0, (m_H + m) * l**2 + m * a**2]])
        M[1, 0] = M[0, 1]
        c = np.array([m * l * b * np.sin(s - ns) * w_s**2, -m * l * b * np.sin(s - ns) * w_ns**2])
        g = np.array([m * b * G * np.sin(ns), -(m_H * l + m * a + m * l) * G * np.sin(s)])
        return [w_ns, w_s, *np.linalg.solve(M, -c - g)]

    def strike(t: float, x: Any) -> float:
        return float(x[0] + x[1] + 2 * SLOPE) if x[0] > x[1] + 0.3 else 1.0

    strike.terminal, strike.direction = True, -1  # type: ignore[attr-defined]
    run = solve_ivp(rates, (0, 2), state, events=strike, method="DOP853", rtol=1e-11, atol=1e-12)
    ns, s, w_ns, w_s = run.y[:, -1]
    k = np.cos(s - ns)
    before = np.array([[-m * a * b, -m * a * b + (m_H * l**2 + 2 * m * a * l) * k], [0, -m * a * b]])
    after = np.array([[m * b * (b - l * k), m * l * (l - b * k) + m * a**2 + m_H * l**2], [m * b**2, -m * b * l * k]])
    w = np.linalg.solve(after, before @ [w_ns, w_s])
    return np.array([s, ns, *w]), float(run.t[-1])


def test_the_published_limit_cycle(biped: Any) -> None:
    """From the published state it walks on; after each heel strike the same state with the legs exchanged."""
    run = biped.simulate(3.2, start(STANCE, SWING, STANCE_RATE, SWING_RATE), rtol=1e-10, atol=1e-12)
    strikes = np.sort(np.concatenate([run.t_events["step_a_closes"], run.t_events["step_b_closes"]]))
    assert len(strikes) == 4
    state, t = np.array([SWING, STANCE, SWING_RATE, STANCE_RATE]), 0.0
    for k, strike in enumerate(strikes):
        state, step = by_hand(state)
        t += step
        assert strike == pytest.approx(t, abs=1e-6)
        stance, swing = "ba" if k % 2 == 0 else "ab"
        i = np.flatnonzero(np.abs(run.t - strike) < 1e-9)[-1]
        found = [run[swing][i] - SLOPE, run[stance][i] - SLOPE, run[f"{swing}_dot"][i], run[f"{stance}_dot"][i]]
        np.testing.assert_allclose(found, state, atol=1e-6)
        np.testing.assert_allclose(found, [SWING, STANCE, SWING_RATE, STANCE_RATE], atol=2e-3)  # published


def test_a_disturbed_gait_comes_back(biped: Any) -> None:
    """The published cycle is stable: a start beside it is nearer after eight steps."""
    run = biped.simulate(8.0, start(STANCE, SWING, 1.02 * STANCE_RATE, SWING_RATE), rtol=1e-9, atol=1e-11)
    strikes = np.sort(np.concatenate([run.t_events["step_a_closes"], run.t_events["step_b_closes"]]))
    i = [np.flatnonzero(np.abs(run.t - strike) < 1e-9)[-1] for strike in strikes]
    rates = np.array([min(run["a_dot"][k], run["b_dot"][k]) for k in i])
    off = np.abs(rates - STANCE_RATE)
    assert len(strikes) > 8
    assert off[8] < 0.3 * 0.02 * abs(STANCE_RATE)
