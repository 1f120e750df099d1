"""N four-bars (IFToMM A02) at tight tolerances: no worse than their closed equation, and every pass is found.

The mechanism against Jacobi's amplitude, which solves the closed equation, and against what the same stepper makes of
that equation at the same tolerance.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import models
import numpy as np
import pytest

from benchmarks.four_bars import FACTOR, TIMES, Motion, compare
from benchmarks.linkages import n_four_bar

TOLERANCES = (1e-8, 1e-9, 1e-10, 1e-11, 1e-12)


@cache
def compiled(n: int, target: str = "cython") -> Any:
    return n_four_bar(n).compile(independent=["theta0"], target=target)


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


@pytest.mark.slow
@pytest.mark.parametrize("method", ["DOP853", "Radau"])
@pytest.mark.parametrize("n", [1, 2, 10])
def test_so_it_is_at_every_tolerance(n: int, method: str) -> None:
    for rtol in TOLERANCES:
        found = compare(compiled(n), Motion(n), n, method, rtol)
        assert found.factor <= FACTOR, (rtol, found)
        assert found.passes == 10


@pytest.mark.slow
@pytest.mark.parametrize(("method", "rtol"), [("DOP853", 1e-12), ("Radau", 1e-8)])
def test_so_it_is_with_forty_loops(method: str, rtol: float) -> None:
    found = compare(compiled(40), Motion(40), 40, method, rtol)
    assert found.factor <= FACTOR, found
    assert found.passes == 10


def test_numpy_passes_as_well_as_c() -> None:
    found = compare(compiled(1, "numpy"), Motion(1), 1, "DOP853", 1e-11)
    assert found.factor <= FACTOR
    assert found.passes == 10


@pytest.mark.parametrize(
    ("target", "method"), [("cython", "DOP853"), ("cython", "Radau"), ("cython", "LSODA"), ("numpy", "RK45")]
)
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
