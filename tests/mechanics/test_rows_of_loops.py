"""Chains of loops: Bricard, N four-bars (IFToMM A02, A04) through their change points, at tight tolerances."""

from functools import cache
from typing import Any

import models
import numpy as np
import pytest
from refusals import refuses
from scipy.integrate import solve_ivp
from sweeps import TARGETS

import eomgen as eg
from benchmarks.calls import FACTOR, compare
from benchmarks.models.linkages import TIMES, Motion, n_four_bar

# -- Bricard -----------------------------------------------------------------------------------------------------------
NAMES = ("x3", "y3", "z3", "x4", "y4", "z4", "angle1", "angle2", "angle3", "angle4", "angle5")


@pytest.fixture(scope="module")
def bricard() -> eg.Equations:
    return eg.load(models.EXAMPLES / "bricard.yaml").derive()


def test_the_count_says_it_cannot_move_and_the_rank_says_it_can(bricard: eg.Equations) -> None:
    report = bricard.report
    assert report.gruebler_kutzbach == 0
    assert (report.constraints, report.rank, report.degrees_of_freedom) == (5, 4, 1)
    assert len(report.redundant) == 1
    assert report.redundant[0].startswith("J6.")


@pytest.mark.parametrize("target", TARGETS)
def test_ten_seconds_of_published_motion(bricard: eg.Equations, target: str) -> None:
    values = models.reference("iftomm_A04_bricard")["values"]
    end = 10.0 if target == "cython" else 1.0
    times = np.array(sorted(float(t) for t in values if float(t) <= end))
    rows = {float(t): value for t, value in values.items()}
    expected = np.array(
        [[*rows[t]["corner3_(1,-1,0)"], *rows[t]["corner4_(1,-1,1)"], *rows[t]["angles"]] for t in times]
    ).T
    mod = bricard.compile(target=target)
    run = mod.simulate((0, end), t_eval=times)
    found = np.array([run[name] for name in NAMES])
    assert np.abs(found - expected).max() <= 1e-8
    energy = np.sum(mod.energy(run.x), axis=0)
    assert np.ptp(energy) <= 1e-8 * np.max(mod.energy(run.x)[0])
    assert np.abs(mod.constraints(run.x[: mod.n_q], rows="all")).max() <= 1e-12


# -- N four-bars -------------------------------------------------------------------------------------------------------
HIGH_PRECISION = 1e-3


def tip(n: int, times: np.ndarray) -> np.ndarray:
    """x and y of the first crank's tip, and the mechanism's theta rate, by the closed equation."""
    slope = 9.81 * ((n + 1) / 2 + n) / ((n + 1) / 3 + n)
    found = solve_ivp(
        lambda t, y: [y[1], -slope * np.cos(y[0])],
        (0, times[-1]),
        [np.pi / 2, -1.0],
        method="DOP853",
        t_eval=times,
        rtol=3e-14,
        atol=1e-15,
    )
    return np.array([np.cos(found.y[0]), np.sin(found.y[0]), found.y[1]])


def test_the_published_motion_of_two_loops() -> None:
    published = models.reference("iftomm_A02_n_four_bar")["reference_B0_xy"]["N2"]
    times = np.array(sorted(float(t) for t in published if t != "period"))
    expected = np.array([[float(x) for x in published[f"{t:g}"]] for t in times]).T
    np.testing.assert_allclose(tip(2, times)[:2], expected, atol=1e-10)  # the equation of one variable is the same
    run = compiled(2).simulate((0, 10), t_eval=times, rtol=1e-10, atol=1e-12)
    assert np.abs(run["x"] - expected[0]).max() <= 1e-5
    assert np.abs(run["y"] - expected[1]).max() <= 1e-5


@pytest.mark.parametrize("n", [10, pytest.param(40, marks=pytest.mark.thorough)])
def test_a_chain_of_any_length_goes_through_its_flat_position(n: int) -> None:
    mod = compiled(n)
    run = mod.simulate((0, 10))
    x, y, rate = tip(n, run.t)
    assert np.abs(run["x"] - x).max() <= HIGH_PRECISION
    assert np.abs(run["y"] - y).max() <= HIGH_PRECISION
    assert np.count_nonzero(np.diff(np.sign(y))) == 10  # flat ten times
    energy = np.sum(mod.energy(run.x), axis=0)
    assert np.ptp(energy) <= 1e-4 * np.max(mod.energy(run.x)[0])
    assert run.residuals.position <= 1e-12
    assert run.residuals.velocity <= 1e-10 * np.abs(rate).max()
    cranks = np.array([run[f"theta{k}"] for k in range(n + 1)])
    assert np.abs(cranks - cranks[0]).max() <= 1e-5  # it stays a row of parallelograms


@pytest.mark.parametrize("n", [10, pytest.param(40, marks=pytest.mark.thorough)])
def test_tight_tolerances_do_not_make_steps_crawl_at_the_flat_position(n: int) -> None:
    """Steps start on the constraints, and a state that is on them to rounding is not moved by that rounding."""
    run = compiled(n).simulate((0, 10), rtol=1e-10, atol=1e-12)
    assert len(run.t) <= 400  # 142 are taken; of 10 loops 2,129 were
    x, y, _ = tip(n, run.t)
    assert max(np.abs(run["x"] - x).max(), np.abs(run["y"] - y).max()) <= 1e-4
    assert np.ptp(run["energy"]) <= 1e-6 * run["T"].max()
    assert max(run.residuals.position, run.residuals.velocity) <= 1e-10


def test_a_state_with_more_freedoms_at_once_is_named() -> None:
    """Exactly flat, n + 1 freedoms are free at once: no accelerations of one freedom are made up."""
    mod = compiled(2)
    refuses("EG-PARTITION theta0", mod.rhs, 0.0, np.zeros(mod.n_x))


# -- Tight tolerances --------------------------------------------------------------------------------------------------
TOLERANCES = (1e-8, 1e-9, 1e-10, 1e-11, 1e-12)


@cache
def compiled(n: int, target: str = "cython") -> Any:
    return n_four_bar(n).compile(
        independent=["theta0"], target=target, **({"optimize": 0} if target == "cython" else {})
    )


def test_jacobis_amplitude_is_the_published_motion() -> None:
    published = models.reference("iftomm_A02_n_four_bar")["reference_B0_xy"]["N2"]
    motion = Motion(2)
    for t, place in published.items():
        if t != "period":
            theta = motion.exact[int(np.argmin(np.abs(TIMES - float(t))))]
            assert np.abs(np.array([np.cos(theta), np.sin(theta)]) - np.array(place, dtype=float)).max() <= 1e-13


@pytest.mark.parametrize("method", ["DOP853", "Radau"])
@pytest.mark.parametrize("n", [1, 2])
def test_the_error_is_that_of_the_closed_equation(n: int, method: str) -> None:
    for rtol in (1e-8, 1e-12) if method == "Radau" else TOLERANCES:
        found = compare(compiled(n), Motion(n), n, method, rtol)
        assert found.factor <= FACTOR, (rtol, found)
        assert found.passes == 10


@pytest.mark.parametrize(("target", "method"), [("cython", "DOP853"), ("cython", "Radau"), ("cython", "LSODA")])
def test_change_points_are_those_of_the_run_not_of_the_times_stored(target: str, method: str) -> None:
    """The loop in C, SciPy's over C, SciPy's over NumPy."""
    passed = (0.5 * np.pi - Motion(1).exact[-1] - 0.5 * np.pi) // np.pi + 1
    for times in (None, [10.0], TIMES[::20]) if target == "numpy" else (None, [10.0], TIMES[::20], TIMES):
        run = compiled(1, target).simulate((0, 10), method=method, rtol=1e-6, atol=1e-8, t_eval=times)
        points = run.change_points
        assert len(points) == passed == 10
        for point in points:
            assert point.degrees_of_freedom == 2
            assert abs(np.sin(point.coordinates["theta0"])) <= 1e-7
