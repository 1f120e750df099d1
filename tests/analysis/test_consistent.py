"""Consistent states: the least change in any metric, against SciPy's constrained minimiser; held values stay."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

import eomgen as eg


def disturbed(mod: Any, seed: int, size: float = 0.1) -> np.ndarray:
    x = mod.x0()
    length = mod.metadata["length_scale"]
    kinds = [*mod.metadata["coordinate_kinds"], *mod.metadata["velocity_kinds"]]
    sizes = np.array([length if kind == "length" else 1.0 for kind in kinds])
    return x + size * np.random.default_rng(seed).normal(size=x.size) * sizes


@pytest.mark.parametrize("name", ["slider_crank", "tilted_four_bar", "three_cranks"])
@pytest.mark.parametrize("metric", ["plain", "weights", "mass"])
def test_least_change(name: str, metric: str, compiled: Callable[..., Any]) -> None:
    mod = compiled(name)
    n, s = mod.n_q, mod.layout.scales.q
    x = disturbed(mod, 3)
    first, second = mod.q_names[0], mod.v_names[-1]
    weights: Any = {"plain": None, "weights": {first: 30.0, second: 0.1}, "mass": "mass"}[metric]
    found = mod.consistent(x, weights=weights)
    q, v = found[:n], found[n:]
    np.testing.assert_allclose(mod.constraints(q, rows="all"), 0.0, atol=1e-12)
    np.testing.assert_allclose(mod.velocity_constraints(found, rows="all"), 0.0, atol=1e-11)
    W_q, W_v = np.diag(1 / s**2), np.diag(1 / s**2)
    if metric == "weights":
        W_q[0, 0] *= 30.0
        W_v[0, 0] *= 30.0
        W_v[-1, -1] *= 0.1
    if metric == "mass":
        W_q, W_v = mod.mass_matrix(x[:n]), mod.mass_matrix(q)

    def cost(z: np.ndarray) -> float:
        d = z - x[:n]
        return float(d @ W_q @ d) / np.abs(W_q).max()

    rows = {"type": "eq", "fun": lambda z: mod.constraints(z)}
    best = minimize(cost, mod.project(x)[:n], constraints=rows, method="SLSQP", options={"ftol": 1e-16, "maxiter": 900})
    assert cost(q) <= best.fun * (1 + 1e-6)
    np.testing.assert_allclose(q, best.x, atol=1e-4)
    C_q = mod.constraint_jacobian(q)
    n_c = len(C_q)
    K = np.block([[W_v, C_q.T], [C_q, np.zeros((n_c, n_c))]])
    expected = np.linalg.lstsq(K, np.concatenate([W_v @ x[n:], np.zeros(n_c)]), rcond=None)[0][: mod.n_v]
    np.testing.assert_allclose(v, expected, atol=1e-8 * np.abs(expected).max())


def test_held_values_stay(compiled: Callable[..., Any]) -> None:
    mod = compiled("slider_crank")
    x = disturbed(mod, 5, 0.05)
    found = mod.consistent(x, hold=["theta", "s_dot"])
    assert found[mod.x_names.index("theta")] == x[mod.x_names.index("theta")]
    assert found[mod.x_names.index("s_dot")] == x[mod.x_names.index("s_dot")]
    np.testing.assert_allclose(mod.constraints(found[: mod.n_q]), 0.0, atol=1e-12)
    np.testing.assert_allclose(mod.velocity_constraints(found), 0.0, atol=1e-11)
    with pytest.raises(eg.EomgenError, match="with theta, B, s held"):
        mod.consistent(x, hold=list(mod.q_names))


def test_rotations_and_nonholonomic_rows(compiled: Callable[..., Any]) -> None:
    mod = compiled("rssr")
    found = mod.consistent(disturbed(mod, 1, 0.05))
    np.testing.assert_allclose(mod.constraints(found[: mod.n_q]), 0.0, atol=1e-12)
    np.testing.assert_allclose(mod.velocity_constraints(found), 0.0, atol=1e-11)
    disc = compiled("rolling_disc")
    found = disc.consistent(disturbed(disc, 1), hold=["x", "yaw_dot"])
    np.testing.assert_allclose(disc.velocity_constraints(found), 0.0, atol=1e-11)


def test_least_change_in_the_mass_metric_is_a_plastic_impact(compiled: Callable[..., Any]) -> None:
    """Velocities that constraints stop at once lose the least kinetic energy (Gauss, Robin)."""
    mod = compiled("three_cranks")
    x = mod.x0()
    x[mod.n_q :] = [1.0, -2.0, 0.5, 3.0][: mod.n_v]
    v = mod.consistent(x, weights="mass")[mod.n_q :]
    M = mod.mass_matrix(x[: mod.n_q])
    impulse = M @ (v - x[mod.n_q :])
    C_q = mod.constraint_jacobian(x[: mod.n_q])
    left = impulse - C_q.T @ np.linalg.lstsq(C_q.T, impulse, rcond=None)[0]
    np.testing.assert_allclose(left, 0.0, atol=1e-10)


def test_what_is_refused(compiled: Callable[..., Any]) -> None:
    mod = compiled("slider_crank")
    x = mod.x0()
    for words, message in (
        ({"weights": {"thet": 1.0}}, r"did you mean 'theta'\?"),
        ({"weights": {"theta": -1.0}}, "must be positive"),
        ({"weights": "inertia"}, "or 'mass'"),
        ({"hold": ["q"]}, "no coordinate or velocity 'q'"),
    ):
        with pytest.raises(eg.EomgenError, match=message):
            mod.consistent(x, **words)
    with pytest.raises(eg.EomgenError, match=r"x must have shape \(6,\)"):
        mod.consistent(np.zeros(3))
