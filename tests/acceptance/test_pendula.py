"""Double pendulum and three-link chains against high-precision references, to 1e-9.

Sources: tests/reference/double_pendulum.json and nlink_chain.json (34- and 30-digit integrations of textbook equations
in absolute angles from the downward vertical).  Joints give relative angles: absolute ones are their running sums.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest
from scipy.integrate import solve_ivp

METHODS = ["embedding", "lagrange"]
TIGHT = {"method": "DOP853", "rtol": 3e-14, "atol": 1e-15}


def absolute(columns: np.ndarray) -> np.ndarray:
    """Absolute angles and rates (2 n, k) of states in relative ones."""
    n = len(columns) // 2
    return np.concatenate([np.cumsum(columns[:n], axis=0), np.cumsum(columns[n:], axis=0)])


def relative(theta: np.ndarray) -> np.ndarray:
    return np.diff(theta, prepend=0.0)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", ["A", "B"])
def test_double_pendulum(module: Callable[..., Any], case: str, method: str) -> None:
    given = models.reference("double_pendulum")["reference"][case]
    mod = module("double_pendulum", method).bind(
        p=dict(zip(("m1", "m2", "l1", "l2"), map(float, given["par"]), strict=True))
    )
    assert mod.q_names == ("theta1", "bend")
    start = np.array([float(x) for x in given["ic"]])
    x0 = np.concatenate([relative(start[:2]), relative(start[2:])])
    times = [float(t) for t in given["values"]]
    solution = solve_ivp(mod.rhs, (0, times[-1]), x0, t_eval=times, **TIGHT)
    expected = np.array([[float(x) for x in row] for row in given["values"].values()]).T
    assert np.abs(absolute(solution.y) - expected).max() <= 1e-9


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("name", "case"), [("chain", "rod3_horizontal"), ("point_chain", "pm3_horizontal")])
def test_chain_of_three(module: Callable[..., Any], name: str, case: str, method: str) -> None:
    given = models.reference("nlink_chain")["reference"][case]
    mod = module(name, method)
    assert mod.q_names == ("q1", "q2", "q3")
    x0 = np.concatenate([relative(np.array([float(x) for x in given["theta0"]])), np.zeros(3)])
    accelerations = np.cumsum(mod.rhs(0.0, x0)[3:])
    assert np.abs(accelerations - np.array([float(x) for x in given["acc0"]])).max() <= 1e-13
    times = [float(t) for t in given["values"]]
    solution = solve_ivp(mod.rhs, (0, times[-1]), x0, t_eval=times, **TIGHT)
    expected = np.array([[float(x) for x in row["theta"] + row["omega"]] for row in given["values"].values()]).T
    assert np.abs(absolute(solution.y) - expected).max() <= 1e-9
    run = mod.simulate((0, times[-1]), x0, t_eval=times, rtol=3e-14, atol=1e-15)
    if name == "chain":  # the example's own outputs are the absolute angles
        ours = np.array([run[f"theta{k}"] for k in (1, 2, 3)])
        assert np.abs(ours - expected[:3]).max() <= 1e-9
