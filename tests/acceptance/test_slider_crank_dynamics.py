"""Free motion of a rigid slider-crank with gravity against high-precision references.

Source: tests/reference/planar_slider_crank_dynamics.json (parameters of Flores, Leine and Glocker 2010, ideal guide;
multiplier form with 30 digits, checked there against a closed-form reduction to 8e-13).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest

NAMES = {"theta": "theta", "beta": "beta", "x": "x", "thetadot": "theta_dot", "xdot": "x_dot"}


@pytest.mark.parametrize("method", ["embedding", "lagrange"])
@pytest.mark.parametrize("speed", [10, 150])
def test_trajectory_equals_the_reference(module: Callable[..., Any], speed: int, method: str) -> None:
    given = models.reference("planar_slider_crank_dynamics")["reference"][f"omega{speed}"]
    mod = module("free_slider_crank", method)
    times = [float(t) for t in given["values"]]
    initial = {"theta": 0.0, "theta_dot": float(speed)}
    run = mod.simulate((0, times[-1]), initial, t_eval=[0.0, *times], rtol=1e-13, atol=1e-14)
    for k, row in enumerate(given["values"].values(), start=1):
        for theirs, ours in NAMES.items():
            expected = float(row[theirs])
            assert abs(run[ours][k] - expected) <= 1e-9 * max(1.0, abs(expected)), (times[k - 1], ours)
        rod = run["theta_dot"][k] + run["bend_dot"][k]
        assert abs(rod - float(row["betadot"])) <= 1e-9 * max(1.0, abs(float(row["betadot"])))


@pytest.mark.parametrize("speed", [10, 150])
def test_initial_accelerations_equal_the_reference(module: Callable[..., Any], speed: int) -> None:
    given = models.reference("planar_slider_crank_dynamics")["reference"][f"omega{speed}"]
    mod = module("free_slider_crank")
    x = mod.x0(theta=0.0, theta_dot=float(speed))
    a = dict(zip(mod.q_names, mod.rhs(0.0, x)[mod.n_q :], strict=True))
    expected = np.array([float(value) for value in given["initial_acc"]])
    ours = np.array([a["theta"], a["theta"] + a["bend"], a["x"]])
    assert np.abs(ours - expected).max() <= 1e-12 * np.abs(expected).max()


def test_either_coordinate_can_be_independent(module: Callable[..., Any]) -> None:
    """Crank angle or slider position: one motion, two embedded mass matrices, M_s = M_theta (theta'/s')^2."""
    turn, slide = module("slider_crank"), module("slider_crank", independent=("s",))
    for theta, rate in ((0.5, 10.0), (1.7, -6.0), (4.0, 3.0)):
        x = turn.x0(theta=theta, theta_dot=rate)
        state = dict(zip(turn.x_names, x, strict=True))
        other = np.array([state[name] for name in slide.x_names])
        a = dict(zip(turn.v_names, turn.rhs(0.0, x)[3:], strict=True))
        b = dict(zip(slide.v_names, slide.rhs(0.0, other)[3:], strict=True))
        size = max(map(abs, a.values()))
        assert all(abs(a[name] - b[name]) <= 1e-11 * size for name in a)
        (M_theta,), (M_s,) = turn.embedded_mass_matrix(x[:3])[0], slide.embedded_mass_matrix(other[:3])[0]
        assert M_s == pytest.approx(M_theta * (state["theta_dot"] / state["s_dot"]) ** 2, rel=1e-11)
