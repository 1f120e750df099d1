"""Ten motions without chaos: our steppers through plain ``solve_ivp`` against SciPy's own, step by step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

NAMES = (
    "pendulum",
    "cart_pendulum",
    "spherical_pendulum",
    "slider_crank",
    "four_bar",
    "peaucellier",
    "planetary_gear",
    "cam_follower",
    "rolling_disc",
    "bicycle",
)
TOLERANCES = {"DOP853": (1e-8, 1e-10), "RK45": (1e-7, 1e-9), "RK23": (1e-6, 1e-8)}
END = 2.0


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("method", TOLERANCES)
def test_steps_times_solutions_and_events(module: Callable[..., Any], name: str, method: str) -> None:
    mod = module(name)
    rtol, atol = TOLERANCES[method]
    x0 = mod.x0()

    def middle(t: float, x: np.ndarray) -> float:
        return float(x[0] - x0[0] - 0.1 * np.sin(7.0 * t + 0.3))

    def rising(t: float, x: np.ndarray) -> float:
        return float(np.cos(5.0 * t) + 0.1 * x[-1])

    rising.direction = 1.0  # type: ignore[attr-defined]
    times = np.linspace(0, END, 101)
    options: dict[str, Any] = {"rtol": rtol, "atol": atol, "events": [middle, rising]}
    theirs, ours = (
        solve_ivp(mod.rhs, (0, END), x0, method=solver, dense_output=True, **options)
        for solver in (method, getattr(mod, method))
    )
    assert len(ours.t) == len(theirs.t) > 10
    assert ours.nfev == theirs.nfev
    np.testing.assert_allclose(ours.t, theirs.t, rtol=0, atol=1e-6 * END)
    size = np.abs(theirs.y).max()
    assert np.abs(ours.y - theirs.sol(ours.t)).max() < 1e-10 * size
    assert np.abs(ours.sol(times) - theirs.sol(times)).max() < 1e-10 * size
    sampled = [
        solve_ivp(mod.rhs, (0, END), x0, method=solver, t_eval=times, **options)
        for solver in (method, getattr(mod, method))
    ]
    np.testing.assert_array_equal(sampled[1].t, times)
    assert np.abs(sampled[1].y - sampled[0].y).max() < 1e-10 * size
    assert sum(map(len, theirs.t_events)) > 0
    for mine, scipys, states, their_states in zip(
        ours.t_events, theirs.t_events, ours.y_events, theirs.y_events, strict=True
    ):
        assert len(mine) == len(scipys)
        np.testing.assert_allclose(mine, scipys, rtol=0, atol=1e-10)
        np.testing.assert_allclose(states, their_states, rtol=0, atol=1e-9 * size)
    # the loop in C finds the same, events as functions included
    whole = mod.simulate((0, END), x0, method=method, **options)
    np.testing.assert_allclose(whole.t, ours.t, rtol=0, atol=1e-6 * END)  # it projects the start
    for mine, scipys in zip(whole.t_events, theirs.t_events, strict=True):
        assert len(mine) >= len(scipys)  # a value that comes to zero and back within a step is found, too
        nearest = np.abs(mine[:, None] - scipys[None, :]).min(axis=0) if len(scipys) else np.empty(0)
        assert (nearest < 1e-8).all()
