"""Taylor's method side by side in lanes: the same runs, whoever takes them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg

from ..runtime.test_taylor import FORCES, START_OF_ALL, A, B
from .conftest import compiled

TIGHT = {"method": "Taylor", "rtol": 1e-11, "atol": 1e-13}


def angles(k: int) -> dict[str, Any]:
    draw = np.random.default_rng(5)
    return {"theta1": draw.uniform(-1, 1, k), "bend": draw.uniform(-1, 1, k), "bend_dot": 0.1}


def test_runs_are_those_of_simulate(pendulum: Any) -> None:
    """Lanes round fused products once, so that steps may differ in their last digits."""
    times = np.linspace(0, 3, 8)
    masses = np.linspace(0.5, 2.0, 19)
    many = pendulum.simulate_many(3, angles(19), {"m2": masses}, t_eval=times, **TIGHT)
    assert many.ok.all()
    assert many.rejected.sum() < 0.02 * many.steps.sum()
    np.testing.assert_array_equal(many.evaluations, many.steps + many.rejected + 1)
    for j in range(19):
        alone = pendulum.simulate(3, **many.case(j), t_eval=times, **TIGHT)
        exact = pendulum.simulate(3, **many.case(j), t_eval=times, rtol=1e-13, atol=1e-15)
        np.testing.assert_allclose(many.samples[:, :, j], alone.x, rtol=0, atol=2e-12)
        np.testing.assert_allclose(many.samples[:, :, j], exact.x, rtol=0, atol=1e-9)


def test_bits_do_not_depend_on_threads_blocks_or_lanes(pendulum: Any) -> None:
    given = angles(37)
    one = pendulum.simulate_many(2, given, threads=1, **TIGHT)
    for options in ({"threads": 3}, {"threads": 2, "block": 5}):
        other = pendulum.simulate_many(2, given, **options, **TIGHT)
        np.testing.assert_array_equal(one.x, other.x)
        np.testing.assert_array_equal(one.steps, other.steps)
    turned = {name: value[::-1] if np.ndim(value) else value for name, value in given.items()}
    back = pendulum.simulate_many(2, turned, **TIGHT)
    np.testing.assert_array_equal(one.x, back.x[:, ::-1])


def test_every_recurrence_in_lanes() -> None:
    m = eg.Model("masses_in_lanes")
    m.parameter("a", A), m.parameter("b", B)
    for k, (text, _) in enumerate(FORCES.values()):
        body = m.body(f"body{k}", mass=1.0)
        m.prismatic(f"J{k}", m.ground, body, axis="x", coordinate=f"x{k}")
        m.torque(
            f"F{k}",
            f"J{k}",
            text.replace("exp", "EXP").replace("x", f"x{k}").replace("v", f"x{k}_dot").replace("EXP", "exp"),
        )
    mod = m.compile()
    starts = START_OF_ALL[:, None] * np.linspace(0.5, 1.0, 3)
    many = mod.simulate_many(1, starts, **TIGHT)
    for j in range(3):
        exact = mod.simulate(1, starts[:, j], rtol=1e-13, atol=1e-15).x[:, -1]
        np.testing.assert_allclose(many.x[:, j], exact, rtol=0, atol=1e-9)


def test_a_run_that_fails_holds_up_no_other() -> None:
    """s'' = 2 s^3 from s = s' = 1 ends at t = 1; from 0.5 at t = 2 (s = 1/(2 - t))."""
    m = eg.Model("bursts")
    body = m.body("mass", mass=1.0)
    m.prismatic("J", m.ground, body, axis="x", coordinate="s")
    m.torque("push", "J", "2*s**3")
    s = np.array([0.5, 1.0, 0.5, 0.25, 1.0, 0.5, 0.25, 0.5, 0.5])
    many = m.compile().simulate_many(1.5, {"s": s, "s_dot": s**2}, first_step=1e-3, **TIGHT)
    np.testing.assert_array_equal(many.ok, s < 1)
    np.testing.assert_allclose(many.x[0, s < 1], 1 / (1 / s[s < 1] - 1.5), rtol=1e-9)
    np.testing.assert_allclose(many.t_end[s == 1], 1.0, atol=1e-6)


def test_what_has_no_series_is_refused() -> None:
    with pytest.raises(eg.UsageError, match="no Taylor series"):
        compiled("slider_crank", "cython").simulate_many(1, count=2, method="Taylor")
    with pytest.raises(eg.UsageError, match="constant between corners"):
        compiled("cart_pendulum", "cython").simulate_many(1, count=2, method="Taylor", inputs={"F": "sin(t)"})


def test_lanes_end_at_singularities() -> None:
    """s'' = -1/s^2 falls into 0."""
    m = eg.Model("well")
    body = m.body("mass", mass=1.0)
    m.prismatic("J", m.ground, body, axis="x", coordinate="s")
    m.torque("pull", "J", "-1/s**2")
    s = np.linspace(0.5, 1.0, 9)
    many = m.compile().simulate_many(3, {"s": s}, method="Taylor")
    assert not many.ok.any()
    np.testing.assert_allclose(many.t_end, np.pi / np.sqrt(8) * s**1.5, rtol=1e-4)
