"""Impulses found edge by edge: least squares by SciPy, stacks that sweeps leave unsolved, the laws, the order."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest
from scipy.optimize import nnls

from eomgen.numeric.contact_edges import solve_edges
from eomgen.numeric.contact_problem import ContactProblem
from eomgen.runtime.late import eager

TOLERANCE = 1e-4


@pytest.fixture(scope="module")
def in_c() -> Any:
    return eager(models.build("pendulum").compile().core).solve_contacts


def stack(rng: np.random.Generator, links: int, mu: float) -> ContactProblem:
    """A heavy body on light links on the ground, all of them pressed down: more contacts than freedoms hold it.

    Freedoms are x, z and the turn of the body, and x and z of each link; contacts those of each link with the ground
    and of the body with each link.
    """
    freedoms = 3 + 2 * links
    mass = np.ones(freedoms)
    mass[:3] = 3e3, 3e3, 1e3
    rows = np.zeros((2 * links, 2, freedoms))
    for k, at in enumerate(np.linspace(-1.0, 1.0, links)):
        rows[k, 0, 4 + 2 * k] = rows[k, 1, 3 + 2 * k] = 1.0
        rows[links + k, 0, [1, 2, 4 + 2 * k]] = 1.0, at, -1.0
        rows[links + k, 1, [0, 2, 3 + 2 * k]] = 1.0, -0.3, -1.0
    J = rows.reshape(-1, freedoms)
    v = 0.1 * rng.normal(size=freedoms)
    v[0], v[1], v[4::2] = 0.2, -0.5, v[4::2] - 0.5
    return ContactProblem(J / mass @ J.T, (J @ v).reshape(-1, 2), np.full(2 * links, mu))


def coulomb_faults(problem: ContactProblem, P: np.ndarray) -> float:
    """How far Signorini's and Coulomb's laws are missed (m/s), written without projections."""
    y = problem.c + (problem.W @ P.ravel()).reshape(P.shape)
    found = 0.0
    for i in range(problem.m):
        n, reach = P[i, 0], problem.mu[i] * P[i, 0]
        found = max(found, -n * problem.normal[i], -y[i, 0], min(n * problem.normal[i], y[i, 0]))
        spare = (reach - abs(P[i, 1])) * problem.across[i]  # of friction, as a velocity
        found = max(found, -spare, min(spare, abs(y[i, 1])))
        if abs(y[i, 1]) > 1e-2:
            found = max(found, P[i, 1] * np.sign(y[i, 1]) * problem.across[i])
    return float(found)


@pytest.mark.parametrize("seed", range(4))
def test_without_friction_they_are_least_squares(in_c: Any, seed: int) -> None:
    rng = np.random.default_rng(seed)
    X, z = rng.normal(size=(60, 25)), rng.normal(size=60)
    given = ContactProblem(X.T @ X, (X.T @ z)[:, None], np.zeros(25))
    wanted, _ = nnls(X, -z)
    assert 0 < np.count_nonzero(wanted) < 25
    start = np.abs(rng.normal(size=(25, 1)))
    for found in (solve_edges(given, start, np.inf, 1e-12)[0], in_c(given.W, given.c, given.mu, start, 1e-12, 1)[0]):
        np.testing.assert_allclose(found[:, 0], wanted, atol=1e-7 * wanted.max())


@pytest.mark.parametrize("mu", [0.0, 0.15, 0.7])
@pytest.mark.parametrize("links", [6, 20])
def test_stacks_that_sweeps_leave_unsolved(in_c: Any, mu: float, links: int) -> None:
    """Both forms obey the laws without a step of Newton's method, and give the same velocities."""
    given = stack(np.random.default_rng(links), links, mu)
    swept = np.zeros((given.m, 2))
    for _ in range(100):
        given.sweep(swept)
    assert given.size(given.misses(swept)[0]) > 10.0 * TOLERANCE
    nothing = np.zeros((given.m, 2))
    P, least = solve_edges(given, nothing, np.inf, TOLERANCE)
    assert least <= TOLERANCE
    assert coulomb_faults(given, P) < 2.0 * TOLERANCE / max(min(mu, 1.0), 0.01)
    quick, count, residual = in_c(given.W, given.c, given.mu, nothing, TOLERANCE, 1)
    assert count == 0  # no step of Newton's method
    assert residual == pytest.approx(least, abs=1e-8)
    np.testing.assert_allclose(given.W @ quick.ravel(), given.W @ P.ravel(), atol=1e-6)


def test_the_order_of_contacts_does_not_matter(in_c: Any) -> None:
    """Velocities are the same where contacts are numbered otherwise, and when directions across are turned over."""
    given = stack(np.random.default_rng(5), 12, 0.4)
    nothing = np.zeros((given.m, 2))
    P = in_c(given.W, given.c, given.mu, nothing, 1e-9, 50)[0]
    y = given.velocities(P)
    order = np.random.default_rng(6).permutation(given.m)
    rows = (2 * order[:, None] + [0, 1]).ravel()
    signs = np.tile([1.0, -1.0], given.m)
    W = given.W[np.ix_(rows, rows)] * np.outer(signs, signs)
    turned = ContactProblem(W, given.c[order] * [1.0, -1.0], given.mu[order])
    found = turned.velocities(in_c(turned.W, turned.c, turned.mu, nothing, 1e-9, 50)[0])
    np.testing.assert_allclose(found * [1.0, -1.0], y[order], atol=1e-6)


def test_impulses_of_the_last_step_stay(in_c: Any) -> None:
    """From a solution on nothing is done; from near it little is left to do, and the laws are obeyed."""
    given = stack(np.random.default_rng(9), 12, 0.3)
    P = in_c(given.W, given.c, given.mu, np.zeros((given.m, 2)), TOLERANCE, 1)[0]
    again, count, _ = in_c(given.W, given.c, given.mu, P, TOLERANCE, 1)
    assert count == 0
    np.testing.assert_array_equal(again, P)
    near = ContactProblem(given.W, given.c * 1.01, given.mu)
    found, _, residual = in_c(near.W, near.c, near.mu, P, TOLERANCE, 1)
    assert residual <= TOLERANCE
    assert coulomb_faults(near, found) < 1e-3


def test_contacts_that_nothing_moves(in_c: Any) -> None:
    """A contact without compliance takes no impulse, and leaves the others as they are without it."""
    given = stack(np.random.default_rng(2), 10, 0.3)
    W, c = given.W.copy(), given.c.copy()
    W[8:10], W[:, 8:10], c[4] = 0.0, 0.0, (0.2, 0.1)
    P, _, residual = in_c(W, c, given.mu, np.zeros((given.m, 2)), TOLERANCE, 1)
    assert residual <= TOLERANCE
    assert not P[4].any()
    assert np.isfinite(P).all()
