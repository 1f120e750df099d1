"""Andrews' squeezer from its YAML file against the reference solution.

Source: tests/reference/andrews_squeezer.json (IVP/DAE test set, problem andrews; Hairer and Wanner, Solving ODEs II,
VII.7).  The published angles hold about ten digits, the rates seven.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest
from scipy.integrate import solve_ivp

ANGLES = ("beta", "theta", "gamma", "phi", "delta", "omega", "epsilon")
REFERENCE = models.reference("andrews_squeezer")
END = REFERENCE["t_end"]


@pytest.fixture(scope="session", params=["embedding", "lagrange"])
def squeezer(request: pytest.FixtureRequest, module: Callable[..., Any]) -> Any:
    return module("andrews_squeezer", request.param)


@pytest.fixture(scope="session")
def run(squeezer: Any) -> Any:
    return squeezer.simulate((0, END), rtol=1e-12, atol=1e-14)


def residual(module: Any, x: np.ndarray) -> float:
    """max |C| over all rows (m, rad) of states as columns."""
    return float(np.abs(module.constraints(x[: module.n_q], rows="all")).max())


def test_initial_position_and_accelerations(squeezer: Any) -> None:
    given = REFERENCE["initial_conditions"]
    x = squeezer.x0()
    names = squeezer.q_names
    for name in ANGLES:
        assert abs(x[names.index(name)] - float(given["q"][name])) <= 1e-13
    a = dict(zip(names, squeezer.rhs(0.0, x)[squeezer.n_q :], strict=True))
    expected = dict.fromkeys(ANGLES, 0.0)
    expected |= {"beta": float(given["qddot_beta"]), "theta": float(given["qddot_theta"])}
    for name in ANGLES:
        assert abs(a[name] - expected[name]) <= 1e-11 * expected["beta"], name


def test_seven_angles_of_the_reference(run: Any) -> None:
    for name in ANGLES:
        published = REFERENCE["reference_published"][name]
        assert abs(run[name][-1] - published) <= 1e-8 * abs(published), name
        rate = REFERENCE["reference_published"][name + "_dot"]
        assert abs(run[name + "_dot"][-1] - rate) <= 1e-7 * abs(rate), name


def test_stored_states_keep_the_loops_closed(squeezer: Any, run: Any) -> None:
    assert residual(squeezer, run.x) < 1e-11
    assert run.residuals.position < 1e-11
    speed = np.abs(run.x[squeezer.n_q :]).max()
    assert run.residuals.velocity < 1e-11 * max(1.0, speed)


def test_energy_is_the_work_of_the_drive(run: Any) -> None:
    """The torque on K1 is constant: T + V grows by mom * (beta - beta(0)) and nothing else."""
    work = REFERENCE["parameters_SI"]["mom"] * (run["beta"] - run["beta"][0])
    assert np.ptp(run["beta"]) > 1.0
    np.testing.assert_allclose(run["energy"] - run["energy"][0], work, rtol=0, atol=1e-9 * np.abs(work).max())


def test_raw_states_of_plain_solve_ivp(squeezer: Any) -> None:
    solution = solve_ivp(squeezer.rhs, (0, END), squeezer.x0(), method="DOP853", rtol=1e-12, atol=1e-14)
    assert solution.success
    assert residual(squeezer, solution.y) < 1e-10
    final = dict(zip(squeezer.x_names, solution.y[:, -1], strict=True))
    for name in ANGLES:
        published = REFERENCE["reference_published"][name]
        assert abs(final[name] - published) <= 1e-8 * abs(published), name
