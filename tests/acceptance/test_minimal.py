"""The strictly minimal face drives the same motion: two states for the slider-crank, through plain ``solve_ivp``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

TIGHT = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}


@pytest.mark.parametrize("method", ["embedding", "lagrange"])
@pytest.mark.parametrize(
    ("name", "end", "given"),
    [
        ("slider_crank", 1.0, {"theta": 0.3, "theta_dot": 10.0}),
        ("four_bar", 1.0, {"theta": 1.0, "theta_dot": 10.0}),
        ("spatial_loop", 1.0, {"theta": 0.4, "theta_dot": 6.0}),
    ],
)
def test_minimal_form_equals_the_tree_form(
    module: Callable[..., Any], name: str, end: float, given: dict[str, float], method: str
) -> None:
    mod = module(name, method)
    minimal = mod.minimal
    assert minimal.x_names == ("theta", "theta_dot")
    start = minimal.x0(**given)
    assert start.shape == (2,)
    assert start == pytest.approx(list(given.values()), abs=1e-15)
    times = np.linspace(0, end, 21)
    small = solve_ivp(minimal.rhs, (0, end), start, t_eval=times, **TIGHT)
    full = solve_ivp(mod.rhs, (0, end), mod.x0(**given), t_eval=times, **TIGHT)
    assert small.success
    assert full.success
    assert np.ptp(small.y[0]) > 1.0
    projected = mod.project(full.y)
    chosen = [mod.x_names.index("theta"), mod.x_names.index("theta_dot")]
    sizes = np.abs(projected).max(axis=1, keepdims=True)
    assert np.abs(small.y - projected[chosen]).max() <= 1e-9 * sizes[chosen].max()
    minimal.reset(projected[: mod.n_q, 0])
    expanded = minimal.expand(small.y, times)
    assert (np.abs(expanded - projected) <= 1e-9 * np.maximum(1.0, sizes)).all()


def test_the_solved_system_has_the_size_of_the_degrees_of_freedom(module: Callable[..., Any]) -> None:
    mod = module("slider_crank")
    assert (mod.n_dof, mod.minimal.n_x, mod.n_x) == (1, 2, 6)
    x = mod.x0(theta=0.3, theta_dot=10.0)
    M = mod.embedded_mass_matrix(x[: mod.n_q])
    assert M.shape == (1, 1)
    # T = v_i^T M v_i / 2
    assert mod.energy(x)[0] == pytest.approx(0.5 * M[0, 0] * 100.0, rel=1e-13)
    assert mod.minimal.rhs(0.0, mod.minimal.reduce(x)) == pytest.approx(mod.minimal.reduce(mod.rhs(0.0, x)), rel=1e-12)


def test_equations_read_in_sympy_have_that_size_too(equations: Callable[..., Any]) -> None:
    eqs = equations("slider_crank")
    assert eqs.mass_matrix.shape == (1, 1)
    assert eqs.force.shape == (1, 1)
