"""Drivers of closed loops in C against outside truth: a multiplier solve, finite differences, optimality conditions."""

import numpy as np
import pytest

RATES = [9.0, -2.5, -0.2]


def scales(library, n):
    out = library.fine("scales")
    return out[:n], out[n:]


def kkt(system, x, t=0.0):
    """Accelerations and multipliers from the augmented equations, least squares over redundant rows."""
    n, q, v = system.n, x[: system.n], x[system.n :]
    M, h, C_q, gamma = (
        system.evaluate(f, q=q, v=v, t=t) for f in ("mass_matrix", "bias", "constraint_jacobian", "gamma")
    )
    K = np.block([[M, C_q.T], [C_q, np.zeros((len(C_q), len(C_q)))]])
    return np.linalg.lstsq(K, np.concatenate([-h, -gamma]), rcond=1e-12)[0][:n]


def variants(systems):
    yield "plain", systems.slider_crank()
    yield "slider preferred", systems.slider_crank(preferred=(2,), name="crank_s")
    yield "driven", systems.slider_crank(driven=True, name="crank_t")
    yield "twice", systems.slider_crank(copies=2, name="crank_2")
    yield "by direction", systems.slider_crank(name="crank_d", limits=systems.Limits(jacobian_nodes=0))


@pytest.fixture(params=range(5), ids=["plain", "slider preferred", "driven", "twice", "by direction"])
def case(request, systems, compiled):
    system = list(variants(systems))[request.param][1]
    return system, compiled(system)


def closed_state(system, library, t=0.0, rates=RATES, q=None):
    return library.fine("project", np.concatenate([system.q if q is None else q, rates]), t)


def test_the_projection_closes_the_loops_with_the_smallest_change(case):
    system, library = case
    n, rng = system.n, np.random.default_rng(5)
    s_q, s_c = scales(library, n)
    for t in (0.0, 0.4):
        x = np.concatenate([system.q, RATES]) + 0.05 * rng.standard_normal(2 * n)
        y = library.fine("project", x, t)
        q, v = y[:n], y[n:]
        assert np.abs(system.evaluate("constraints", q=q, t=t) / s_c).max() <= 1e-12
        assert np.abs(system.evaluate("velocity_constraints", q=q, v=v, t=t) / s_c).max() <= 1e-12
        J = system.evaluate("constraint_jacobian", q=q, t=t) * s_q / s_c[:, None]
        change = (x[n:] - v) / s_q  # orthogonal to the constraints' null space
        null = np.linalg.svd(J)[2][n - 1 :]
        assert np.abs(null @ change).max() <= 1e-11
        np.testing.assert_allclose(library.fine("project", y, t), y, rtol=0, atol=1e-13 * np.abs(y).max())


def test_rhs_equals_a_multiplier_solve_on_the_projected_state(case):
    system, library = case
    n, rng = system.n, np.random.default_rng(6)
    for t in (0.0, 0.4, 1.3):
        x = np.concatenate([system.q, RATES]) + 0.02 * rng.standard_normal(2 * n)
        y = library.fine("project", x, t)
        out = library.fine("rhs", x, t)
        np.testing.assert_allclose(out[:n], y[n:], rtol=0, atol=1e-14)
        expected = kkt(system, y, t)
        np.testing.assert_allclose(out[n:], expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def test_jacobian_equals_central_differences_of_rhs_in_every_direction(case):
    system, library = case
    n = system.n
    for t in (0.0, 0.9):
        x = closed_state(system, library, t)
        J = library.fine("jacobian", x, t).reshape(2 * n, 2 * n)
        numeric = np.empty_like(J)
        for k in range(2 * n):
            step = np.zeros(2 * n)
            step[k] = 1e-4 if k < n else 1e-2
            f = [library.fine("rhs", x + s * step, t) for s in (-2, -1, 1, 2)]
            numeric[:, k] = (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step[k])
        np.testing.assert_allclose(J, numeric, rtol=0, atol=1e-7 * np.abs(J).max())


def test_embedded_mass_matrix_is_the_kinetic_energy_of_the_independent_rate(case):
    system, library = case
    x = closed_state(system, library)
    still = library.fine("kinematics", [x[system.terms.preferred[0]], 1.0, 0.0, *x[: system.n]])
    v, t0 = still[system.n : 2 * system.n], np.zeros(system.n)
    if any(not r.is_zero for r in system.terms.constraint_rate):
        v = v - library.fine("kinematics", [x[system.terms.preferred[0]], 0.0, 0.0, *x[: system.n]])[3:6] + t0
    expected = v @ system.evaluate("mass_matrix", q=x[: system.n]) @ v
    np.testing.assert_allclose(library.fine("embedded_mass_matrix", x[: system.n]), [expected], rtol=1e-12)


def test_kinematics_satisfies_all_three_levels_and_holds_what_is_given(case):
    system, library = case
    n, i, t = system.n, system.terms.preferred[0], 0.4
    x = closed_state(system, library, t)
    given = [x[i] + 0.003, 1.5, -2.0]
    q, v, a = np.split(library.fine("kinematics", [*given, *x[:n]], t), 3)
    assert [q[i], v[i], a[i]] == pytest.approx(given, abs=1e-14)
    assert np.abs(system.evaluate("constraints", q=q, t=t)).max() <= 1e-13
    assert np.abs(system.evaluate("velocity_constraints", q=q, v=v, t=t)).max() <= 1e-12
    C_q, gamma = (system.evaluate(f, q=q, v=v, t=t) for f in ("constraint_jacobian", "gamma"))
    assert np.abs(C_q @ a + gamma).max() <= 1e-11


def test_outputs_are_those_of_the_projected_state_and_its_acceleration(case):
    system, library = case
    x = np.concatenate([system.q + 0.01, RATES])
    y, out = library.fine("project", x), library.fine("rhs", x)
    expected = system.evaluate("outputs", q=y[:3], v=y[3:], a=out[3:])
    np.testing.assert_allclose(library.fine("outputs", x), expected, rtol=1e-13)


def test_outputs_without_accelerations_need_no_solve(systems, compiled):
    system = systems.slider_crank(name="crank_o", accelerated=False)
    assert "terms" not in next(d for d in system.program().drivers if d.name == "outputs").blocks
    library = compiled(system)
    x = closed_state(system, library)
    np.testing.assert_allclose(library.fine("outputs", x), [0.1 * np.cos(x[0])], rtol=1e-14)


def test_a_bad_preference_is_left_alone_by_rhs_and_reported_where_the_set_is_fixed(systems, compiled):
    """At the dead centre s cannot move the slider-crank; rhs takes another coordinate and does not notice."""
    good, bad = systems.slider_crank(), systems.slider_crank(preferred=(2,), name="crank_s")
    first, second = compiled(good), compiled(bad)
    for theta in (0.0, 1e-12, 1e-6, 1e-3):
        q = [theta, -np.arcsin(0.1 * np.sin(theta) / 0.35), 0.0]
        q[2] = 0.1 * np.cos(theta) + 0.35 * np.cos(q[1])
        x = closed_state(good, first, q=q)
        np.testing.assert_allclose(second.fine("rhs", x), first.fine("rhs", x), rtol=1e-11, atol=1e-9)
        np.testing.assert_allclose(second.fine("jacobian", x), first.fine("jacobian", x), rtol=1e-8, atol=1e-6)
    dead = [0.0, 0.0, 0.45]
    assert second("embedded_mass_matrix", dead)[0] == 4
    assert second("kinematics", [0.45, 1.0, 0.0, *dead])[0] == 4
    assert first("embedded_mass_matrix", dead)[0] == 0
    for theta, status in ((1e-5, 0), (1e-9, 4)):  # a dead centre to the eye of the last half of the digits
        near = closed_state(good, first, q=[theta, -0.1 * theta / 0.35, 0.45])[:3]
        assert second("embedded_mass_matrix", near)[0] == status


def test_a_state_that_cannot_be_closed_is_reported(systems, compiled):
    system = systems.slider_crank(name="crank_0", driven=True, spun=True, n_dof=0, preferred=())
    library = compiled(system)
    system.p[2] = 0.03  # the rod is too short for the crank's angle at this time
    library.set_parameters(system.p)
    x = np.concatenate([[1.5, 0.1, 0.1], RATES])
    for kernel in ("project", "rhs", "jacobian", "outputs"):
        assert library(kernel, x, 0.75)[0] == 3
    assert library("kinematics", [1.5, 0.1, 0.1], 0.75)[0] in (3, 4)
    x[0] = np.nan
    for kernel in ("project", "rhs", "jacobian", "outputs"):
        assert library(kernel, x, 0.75)[0] == 1


def test_no_inertia_behind_the_only_motion_is_reported(systems, compiled):
    system = systems.slider_crank()
    library = compiled(system)
    system.p[3:6] = 0.0
    library.set_parameters(system.p)
    assert library("rhs", np.concatenate([system.q, RATES]))[0] == 2
    assert library("jacobian", np.concatenate([system.q, RATES]))[0] == 2


def test_a_mechanism_without_freedom_is_carried_by_its_drivers(systems, compiled):
    """One more row, theta = 2 t: nothing is left to solve, motion follows from the constraints alone."""
    system = systems.slider_crank(name="crank_0", driven=True, spun=True, n_dof=0, preferred=())
    library = compiled(system)
    t = 0.7
    x = library.fine("project", np.concatenate([[1.4, -0.2, 0.4], RATES]), t)
    assert x[[0, 3]] == pytest.approx([1.4, 2.0], abs=1e-13)
    np.testing.assert_allclose(library.fine("rhs", x, t)[3:], kkt(system, x, t), atol=1e-11)
    q, v, a = np.split(library.fine("kinematics", [1.3, -0.2, 0.4], t), 3)
    np.testing.assert_allclose([*q, *v], x, atol=1e-12)
    np.testing.assert_allclose(a, library.fine("rhs", x, t)[3:], atol=1e-11)
    assert library.fine("embedded_mass_matrix", x[:3]).size == 0
