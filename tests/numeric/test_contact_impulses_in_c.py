"""Impulses of rigid contacts in compiled code: the laws themselves judge them, and the same iterations in NumPy."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest

from eomgen.numeric.contact_impulses import ContactProblem, solve_contacts
from eomgen.runtime.late import eager


@pytest.fixture(scope="module")
def in_c() -> Any:
    return eager(models.build("pendulum").compile().core).solve_contacts


def problem(rng: np.random.Generator, m: int, d: int, freedoms: int) -> ContactProblem:
    """Contacts of as many directions; those beyond the freedoms are redundant."""
    J = rng.normal(size=(m * d, freedoms))
    heavy = np.exp(rng.uniform(-2.0, 2.0, freedoms))
    v = rng.normal(size=freedoms)
    return ContactProblem(
        J @ (J / heavy).T, (J @ v).reshape(m, d), rng.uniform(0.0, 0.8, m) * (rng.uniform(size=m) > 0.2)
    )


def faults(problem: ContactProblem, P: np.ndarray) -> float:
    """How far Signorini's and Coulomb's laws are missed, as velocities, written without projections."""
    y = (problem.W @ P.ravel()).reshape(P.shape) + problem.c
    found = 0.0
    for i in range(problem.m):
        push, away = P[i, 0], y[i, 0]
        found = max(found, -away, -push * problem.normal[i], min(abs(push) * problem.normal[i], abs(away)))
        pull, slip = np.linalg.norm(P[i, 1:]), np.linalg.norm(y[i, 1:])
        reach = problem.mu[i] * push
        found = max(found, (pull - reach) * problem.across[i])
        if slip > 1e-2:  # slides: full friction, opposite to the slip, whose direction is known well
            found = max(found, np.abs(P[i, 1:] + reach * y[i, 1:] / slip).max() * problem.across[i])
    return float(found)


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize(("m", "freedoms"), [(1, 3), (3, 9), (6, 8), (12, 40), (20, 24)])
def test_both_find_the_same(in_c: Any, d: int, m: int, freedoms: int) -> None:
    rng = np.random.default_rng(100 * m + d)
    for _ in range(6):
        given = problem(rng, m, d, freedoms)
        start = np.abs(rng.normal(size=(m, d))) * (rng.uniform() > 0.5)
        tolerance = 1e-11 * float(np.abs(given.c).max())
        P, count, residual = in_c(given.W, given.c, given.mu, start, tolerance, 600)
        same = solve_contacts(given, start, tolerance, 600)
        assert residual == pytest.approx(given.size(given.misses(P)[0]), abs=1e-13)
        assert residual <= tolerance
        assert faults(given, P) < 1e-7
        assert count == same.iterations
        np.testing.assert_allclose((given.W @ P.ravel()), given.W @ same.impulses.ravel(), atol=1e-9)
        if m * d <= freedoms:
            np.testing.assert_allclose(P, same.impulses, atol=1e-10 * max(1.0, float(np.abs(P).max())))


def test_nothing_in_place_and_shapes_that_do_not_fit(in_c: Any) -> None:
    given = problem(np.random.default_rng(1), 4, 2, 10)
    start, W = np.zeros((4, 2)), given.W.copy()
    in_c(given.W, given.c, given.mu, start, 1e-9, 10)
    assert not start.any()
    np.testing.assert_array_equal(given.W, W)
    for bad in (
        (given.W[:3, :3], given.c, given.mu, start),
        (given.W, given.c, given.mu[:2], start),
        (given.W, given.c, given.mu, start[:2]),
        (np.zeros((20, 20)), np.zeros((4, 5)), given.mu, np.zeros((4, 5))),
    ):
        with pytest.raises(ValueError, match="do not belong together"):
            in_c(*bad, 1e-9, 10)


def test_numbers_that_are_not_finite_are_told_by_the_residual(in_c: Any) -> None:
    given = problem(np.random.default_rng(2), 10, 2, 30)
    given.c[3, 0] = np.nan
    _, count, residual = in_c(given.W, given.c, given.mu, np.zeros((10, 2)), 1e-9, 50)
    assert not residual <= 1e-9
    assert count <= 50
