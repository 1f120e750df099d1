"""Projection, accelerations and their Jacobian of a closed loop against NumPy solves written here."""

import numpy as np
import pytest

from eomgen.errors import PartitionError, ProjectionError, SingularMassMatrixError
from eomgen.numeric import (
    Scales,
    assemble_velocity,
    correct_velocity,
    embed,
    embedded_mass,
    jacobian,
    kinematics,
    partition,
    project,
    rhs,
    tangent_projector,
)

THETAS = [0.0, 0.7, np.pi / 2, 2.5, np.pi, -1.2]


def on_manifold(crank, theta, rate=10.0):
    q = crank.closed(theta)
    C_q = crank.position(q)[1]
    v = assemble_velocity(C_q, crank.rate(q), crank.scales, guess=np.array([rate, 0, 0]), held=[0])
    return q, v


def augmented(crank, q, v):
    """Accelerations from the system with multipliers, least squares so that redundant rows do not matter."""
    here = crank.terms(q, v)
    n, m = len(q), len(here.gamma)
    K = np.block([[here.M, here.C_q.T], [here.C_q, np.zeros((m, m))]])
    return np.linalg.lstsq(K, np.concatenate([-here.h, -here.gamma]), rcond=1e-12)[0][:n]


def the_rhs(crank, x, independent=(0,)):
    return rhs(crank.terms, crank.position, crank.rate, x[:3], x[3:], crank.scales, 2, independent)


@pytest.mark.parametrize("copies", [1, 2])
@pytest.mark.parametrize("independent", [[0], [1], [2]])
@pytest.mark.parametrize("theta", THETAS)
def test_accelerations_equal_an_augmented_solve(crank, theta, independent, copies):
    c = crank(t=0.3, copies=copies, u=(0.2, -0.4), e=0.02, a=0.01, w=7.0)
    q, v = on_manifold(c, theta)
    a = augmented(c, q, v)
    x_dot = the_rhs(c, np.concatenate([q, v]), independent)
    np.testing.assert_allclose(x_dot[3:], a, rtol=0, atol=1e-11 * np.abs(a).max())
    np.testing.assert_allclose(x_dot[:3], v, rtol=0, atol=1e-12)


def test_the_result_does_not_depend_on_the_preferred_set_or_the_units(crank):
    rng = np.random.default_rng(1)
    for theta in rng.uniform(-4, 4, 10):
        c = crank()
        x = np.concatenate(on_manifold(c, theta)) + 1e-6 * rng.normal(size=6)
        expected = the_rhs(c, x)
        for independent in ([1], [2]):
            np.testing.assert_allclose(the_rhs(c, x, independent), expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("copies", [1, 2])
@pytest.mark.parametrize("theta", THETAS)
def test_jacobian_equals_central_differences_in_all_directions(crank, theta, copies):
    c = crank(t=0.3, copies=copies, u=(0.2, -0.4), e=0.02, a=0.01, w=7.0)
    x = np.concatenate(on_manifold(c, theta))
    J = jacobian(c.terms, c.residuals, c.position, c.rate, x[:3], x[3:], c.scales, 2, [0])
    steps = 1e-5 * np.eye(6)
    numeric = np.stack([(the_rhs(c, x + h) - the_rhs(c, x - h)) / 2e-5 for h in steps], axis=1)
    np.testing.assert_allclose(J, numeric, rtol=0, atol=1e-6 * np.abs(numeric).max())


def test_jacobian_vanishes_across_the_manifold(crank):
    c = crank()
    x = np.concatenate(on_manifold(c, 0.7))
    J = jacobian(c.terms, c.residuals, c.position, c.rate, x[:3], x[3:], c.scales, 2, [0])
    C_q = c.position(x[:3])[1]
    transverse = c.scales.q**2 * C_q  # rows: directions the projection takes away
    np.testing.assert_allclose(J[:, 3:] @ transverse.T, 0, atol=1e-8)


def test_projection_is_idempotent_and_minimal(crank):
    c = crank(t=0.2, e=0.02, a=0.01, w=5.0)
    rng = np.random.default_rng(2)
    for theta in THETAS:
        q0, v0 = on_manifold(c, theta)
        q, v = project(c.position, c.rate, q0 + 0.01 * rng.normal(size=3), v0 + rng.normal(size=3), c.scales)
        C, C_q = c.position(q)
        assert np.abs(C).max() < 1e-13
        assert np.abs(C_q @ v + c.rate(q)).max() < 1e-12
        again = project(c.position, c.rate, q, v, c.scales)
        np.testing.assert_allclose(again[0], q, rtol=0, atol=1e-13)
        np.testing.assert_allclose(again[1], v, rtol=0, atol=1e-12)
        # the correction of v has no part along the free direction, in scaled coordinates
        B = partition(c.scales.jacobian(C_q), 2, [0]).B
        w = v0 + rng.normal(size=3)
        correction = (correct_velocity(C_q, c.rate(q), w, c.scales) - w) / c.scales.q
        np.testing.assert_allclose(B.T @ correction, 0, atol=1e-11)


def test_the_tangent_projector_is_the_derivative_of_the_projection(crank):
    c = crank()
    q, v = on_manifold(c, 0.7)
    P = tangent_projector(c.position(q)[1], c.scales)
    np.testing.assert_allclose(P @ P, P, atol=1e-12)
    h = 1e-6
    for i, e in enumerate(np.eye(3)):
        up, down = (project(c.position, c.rate, q + s * h * e, v, c.scales)[0] for s in (1, -1))
        np.testing.assert_allclose(P[:, i], (up - down) / (2 * h), atol=1e-7)


def test_projection_says_when_the_manifold_is_out_of_reach(crank):
    c = crank(l2=0.05, e=0.5)
    with pytest.raises(ProjectionError, match="scaled residual"):
        project(c.position, c.rate, np.array([0.5, 0.0, 0.3]), np.zeros(3), c.scales)


def test_partition_avoids_a_dead_centre_and_strict_one_refuses_it(crank):
    c = crank()
    J = c.scales.jacobian(c.position(c.closed(0.0))[1])
    assert partition(J, 2, [2]).independent.tolist() != [2]
    with pytest.raises(PartitionError):
        partition(J, 2, [2], strict=True)
    assert partition(J, 2, [0], strict=True).independent.tolist() == [0]
    # away from it the preferred one is used
    J = c.scales.jacobian(c.position(c.closed(0.7))[1])
    assert partition(J, 2, [2]).independent.tolist() == [2]


@pytest.mark.parametrize("copies", [1, 2])
def test_velocity_transformation_spans_the_null_space(crank, copies):
    c = crank(copies=copies)
    for theta in THETAS:
        J = c.scales.jacobian(c.position(c.closed(theta))[1])
        split = partition(J, 2, [0])
        np.testing.assert_allclose(J @ split.B, 0, atol=1e-14)
        y = J @ np.array([0.3, -0.2, 0.7])
        np.testing.assert_allclose(J @ split.particular(y), y, atol=1e-13)
        f = J.T @ np.arange(1.0, 2 + copies)
        restored = np.zeros(1 + copies)
        restored[split.rows] = split.multipliers(f)
        np.testing.assert_allclose((J.T @ restored)[split.dependent], f[split.dependent], atol=1e-13)


def test_embedded_mass_is_the_reduced_inertia(crank):
    c = crank()
    q, v = on_manifold(c, 0.7, rate=1.0)
    here = c.terms(q, v)
    M = embedded_mass(here.M, here.C_q, c.scales, 2, [0])
    assert M.shape == (1, 1)
    assert M[0, 0] == pytest.approx(v @ here.M @ v, rel=1e-13)  # v = B with theta_dot = 1


def test_a_coordinate_without_inertia_is_an_error():
    scales = Scales(np.ones(2), np.ones(0))
    with pytest.raises(SingularMassMatrixError):
        embed(np.diag([1.0, 0.0]), np.zeros((0, 2)), scales, 0, [0, 1])
    with pytest.raises(SingularMassMatrixError):
        embed(np.diag([1.0, 1e-30]), np.zeros((0, 2)), scales, 0, [0, 1])


def test_a_mechanism_without_freedom_left(crank):
    """All coordinates driven: the accelerations follow from the constraints alone."""
    c = crank()
    scales = Scales(c.scales.q, np.append(c.scales.c, 1.0))

    def position(q):
        C, C_q = c.position(q)
        return np.append(C, q[0] - 0.7), np.vstack([C_q, [1.0, 0.0, 0.0]])

    def rate(q):
        return np.array([0.0, 0.0, -2.0])

    def terms(q, v):
        here = c.terms(q, v)
        return here._replace(C_q=position(q)[1], gamma=np.append(here.gamma, 0.0))

    q = c.closed(0.7)
    x_dot = rhs(terms, position, rate, q, np.zeros(3), scales, 3, [])
    expected = kinematics(
        c.position, c.rate, c.gamma, np.array([0.7]), np.array([2.0]), np.zeros(1), q, c.scales, 2, [0]
    )
    np.testing.assert_allclose(x_dot, np.concatenate(expected[1:]), atol=1e-12)
