"""Loops against published answers and closed forms: squeezer, slider-cranks, four-bar, inversor; the minimal form."""

from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest
from scipy.integrate import solve_ivp

# -- Andrews' squeezer -------------------------------------------------------------------------------------------------
ANGLES = ("beta", "theta", "gamma", "phi", "delta", "omega", "epsilon")
REFERENCE = models.reference("andrews_squeezer")
END = REFERENCE["t_end"]


@pytest.fixture(scope="session", params=["embedding", pytest.param("lagrange", marks=pytest.mark.thorough)])
def squeezer(request: pytest.FixtureRequest, module: Callable[..., Any]) -> Any:
    return module("andrews_squeezer", request.param, "cython")


@pytest.fixture(scope="session")
def squeezed(squeezer: Any) -> Any:
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


def test_seven_angles_of_the_reference(squeezed: Any) -> None:
    for name in ANGLES:
        published = REFERENCE["reference_published"][name]
        assert abs(squeezed[name][-1] - published) <= 1e-8 * abs(published), name
        rate = REFERENCE["reference_published"][name + "_dot"]
        assert abs(squeezed[name + "_dot"][-1] - rate) <= 1e-7 * abs(rate), name


def test_stored_states_keep_the_loops_closed(squeezer: Any, squeezed: Any) -> None:
    assert residual(squeezer, squeezed.x) < 1e-11
    assert squeezed.residuals.position < 1e-11
    speed = np.abs(squeezed.x[squeezer.n_q :]).max()
    assert squeezed.residuals.velocity < 1e-11 * max(1.0, speed)


def test_energy_is_the_work_of_the_drive(squeezed: Any) -> None:
    """The torque on K1 is constant: T + V grows by mom * (beta - beta(0)) and nothing else."""
    work = REFERENCE["parameters_SI"]["mom"] * (squeezed["beta"] - squeezed["beta"][0])
    assert np.ptp(squeezed["beta"]) > 1.0
    np.testing.assert_allclose(squeezed["energy"] - squeezed["energy"][0], work, rtol=0, atol=1e-9 * np.abs(work).max())


def test_raw_states_of_plain_solve_ivp(squeezer: Any) -> None:
    solution = solve_ivp(squeezer.rhs, (0, END), squeezer.x0(), method="DOP853", rtol=1e-12, atol=1e-14)
    assert solution.success
    assert residual(squeezer, solution.y) < 1e-10
    final = dict(zip(squeezer.x_names, solution.y[:, -1], strict=True))
    for name in ANGLES:
        published = REFERENCE["reference_published"][name]
        assert abs(final[name] - published) <= 1e-8 * abs(published), name


# -- A slider-crank in free motion -------------------------------------------------------------------------------------
NAMES = {"theta": "theta", "beta": "beta", "x": "x", "thetadot": "theta_dot", "xdot": "x_dot"}


@pytest.mark.parametrize("method", ["embedding", pytest.param("lagrange", marks=pytest.mark.thorough)])
@pytest.mark.parametrize("speed", [10, 150])
def test_trajectory_equals_the_reference(module: Callable[..., Any], speed: int, method: str) -> None:
    given = models.reference("planar_slider_crank_dynamics")["reference"][f"omega{speed}"]
    mod = module("free_slider_crank", method, "cython")
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


# -- Peaucellier's inversor --------------------------------------------------------------------------------------------
GIVEN = models.reference("linkages_straight_line")["peaucellier"]
R = float(GIVEN["r"])
POWER = float(GIVEN["L"]) ** 2 - float(GIVEN["s"]) ** 2


@pytest.mark.parametrize("method", ["embedding", pytest.param("lagrange", marks=pytest.mark.thorough)])
def test_Q_stays_on_its_line_over_the_motion(module: Callable[..., Any], method: str) -> None:
    mod = module("peaucellier", method, "cython")
    p = dict(zip(mod.p_names, mod.p, strict=True))
    assert p["r"] == R
    assert abs(p["L"] ** 2 - p["s"] ** 2 - POWER) <= 1e-15
    run = mod.simulate()
    assert np.ptp(run["theta"]) > 1.0
    assert np.abs(run["Q_x"] - float(GIVEN["straight_line_x"])).max() <= 1e-10
    expected = POWER / (2 * R) * np.tan(run["theta"] / 2)
    assert np.abs(run["Q_y"] - expected).max() <= 1e-10
    assert np.abs(np.hypot(run["P_x"] - R, run["P_y"]) - R).max() <= 1e-10
    # P and Q lie on one ray from O, inverse to each other
    assert np.abs(run["P_x"] * run["Q_y"] - run["P_y"] * run["Q_x"]).max() <= 1e-10
    assert np.abs(run["P_x"] * run["Q_x"] + run["P_y"] * run["Q_y"] - POWER).max() <= 1e-10
    assert run.residuals.position < 1e-11


def test_points_equal_the_reference(module: Callable[..., Any]) -> None:
    mod = module("peaucellier")
    angles = np.radians([float(key) for key in GIVEN["rows"]])
    q, _, _ = mod.kinematics(angles[None, :])
    poses = mod.poses(q)
    s = dict(zip(mod.p_names, mod.p, strict=True))["s"]
    for body, length, point in (("crank", R, "P"), ("side_qa", s, "Q"), ("side_qb", s, "Q"), ("side_pa", s, "P")):
        pose = poses[mod.body_names.index(body)]
        places = np.einsum("ijk,j->ik", pose[:2], np.array([length, 0, 0, 1]))
        expected = np.array([[float(x) for x in row[point]] for row in GIVEN["rows"].values()]).T
        assert np.abs(places - expected).max() <= 1e-10, body


# -- The minimal form --------------------------------------------------------------------------------------------------
TIGHT = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}


@pytest.mark.parametrize("method", ["embedding", pytest.param("lagrange", marks=pytest.mark.thorough)])
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
    mod = module(name, method, "cython")
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
