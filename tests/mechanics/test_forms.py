"""Augmented with stabilisation, canonical and differential-algebraic forms, reactions: closed forms and IDA."""

from typing import Any

import judges
import models
import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import eomgen as eg

# -- Baumgarte ---------------------------------------------------------------------------------------------------------
ALPHA, BETA = 4.0, 4.0
MODELS = [
    pytest.param("slider_crank", "cython", marks=pytest.mark.thorough),
    ("slider_crank", "numpy"),
    ("rolling_disc", "numpy"),
]


def stabilised(name: str, target: str = "numpy") -> Any:
    return models.build(name).compile("augmented", target=target, baumgarte=(ALPHA, BETA))


def perturbed(mod: Any, seed: int) -> np.ndarray:
    x = judges.random_states(mod, seed, 1, speed=1.0)[0]
    return np.asarray(x + 1e-3 * np.random.default_rng(seed).uniform(-1, 1, mod.n_x))


@pytest.mark.parametrize(("name", "target"), MODELS)
def test_accelerations_off_the_constraints_are_those_of_the_formula(name: str, target: str) -> None:
    """[M C_q^T; C_q 0] [a; l] = [-h; -gamma - 2 alpha C' - beta^2 C], put together here; x itself is not projected."""
    mod = stabilised(name, target)
    x, n = perturbed(mod, 1), mod.n_q
    C_q, gamma = judges.loop_terms(mod, x[:n], x[n:])
    gamma = gamma + 2 * ALPHA * mod.velocity_constraints(x, rows="all")
    C = mod.constraints(x[:n], rows="all")
    gamma[: len(C)] += BETA**2 * C
    expected = judges.augmented(mod.mass_matrix(x[:n]), mod.bias(0.0, x), C_q, gamma)
    found = mod.rhs(0.0, x)
    judges.agree(found[n:], expected, 1e-10)
    np.testing.assert_array_equal(found[:n], x[n:])
    closed = mod.project(x)
    plain = models.build(name).compile("embedding", target="numpy")
    judges.agree(mod.rhs(0.0, closed), plain.rhs(0.0, closed), 1e-9)  # on the constraints nothing is left of it
    np.testing.assert_allclose(mod.outputs(0.0, x), plain.outputs(0.0, x), rtol=1e-9, atol=1e-9)  # of the closed state


def test_residuals_decay_as_their_closed_form_says() -> None:
    mod = stabilised("four_bar")
    x = perturbed(mod, 2)
    n, times = mod.n_q, np.linspace(0.0, 1.5, 7)
    run = solve_ivp(mod.rhs, (0.0, 1.5), x, t_eval=times, rtol=1e-11, atol=1e-13)
    C, rate = mod.constraints(x[:n]), mod.velocity_constraints(x)
    assert np.abs(C).max() > 1e-4
    decayed = (C[:, None] + (rate + ALPHA * C)[:, None] * times) * np.exp(-ALPHA * times)
    np.testing.assert_allclose(mod.constraints(run.y[:n]), decayed, atol=1e-10)


@pytest.mark.parametrize(("name", "target"), MODELS)
def test_the_jacobian_is_that_of_the_stabilised_right_hand_side(name: str, target: str) -> None:
    mod = stabilised(name, target)
    x = perturbed(mod, 4)
    J = mod.jacobian(0.0, x)
    numeric = np.stack([judges.first(lambda s: mod.rhs(0.0, s), x, e, h=1e-3) for e in np.eye(mod.n_x)], axis=1)
    assert np.abs(J - numeric).max() <= 1e-8 * np.abs(J).max()


# -- Hamilton ----------------------------------------------------------------------------------------------------------
def spherical_pendulum() -> Any:
    t = sp.Symbol("t")
    theta, phi = sp.Function("theta")(t), sp.Function("phi")(t)
    m, l, g = sp.symbols("m l g")
    T = m * l**2 * (theta.diff(t) ** 2 + sp.sin(theta) ** 2 * phi.diff(t) ** 2) / 2
    model = eg.Model.from_lagrangian(
        "bob", T + m * g * l * sp.cos(theta), [theta, phi], parameters={m: 0.7, l: 1.3, g: 9.81}
    )
    return model.compile("hamilton", target="numpy")


def test_the_spherical_pendulum_of_the_textbooks() -> None:
    """H = p_theta^2 / 2 m l^2 + p_phi^2 / 2 m l^2 sin^2 - m g l cos (Goldstein, 3rd ed., ch. 8)."""
    form = spherical_pendulum().canonical
    assert form.z_names == ("theta", "phi", "p_theta", "p_phi")
    theta, phi, p_theta, p_phi = z = np.array([0.9, 0.2, 1.1, -0.4])
    m, l, g = 0.7, 1.3, 9.81
    J = m * l**2
    H = p_theta**2 / (2 * J) + p_phi**2 / (2 * J * np.sin(theta) ** 2) - m * g * l * np.cos(theta)
    assert form.hamiltonian(z) == pytest.approx(H, rel=1e-13)
    turning = p_phi**2 * np.cos(theta) / (J * np.sin(theta) ** 3)
    expected = [p_theta / J, p_phi / (J * np.sin(theta) ** 2), turning - m * g * l * np.sin(theta), 0.0]
    np.testing.assert_allclose(form.rhs(0.0, z), expected, rtol=1e-12, atol=1e-13)
    assert phi == z[1]


@pytest.mark.parametrize("name", ["double_pendulum", "slider_crank", "rolling_disc", "three_cranks", "car_axis"])
def test_the_motion_is_that_of_the_state_form(name: str) -> None:
    """Trees, loops, redundant, nonholonomic and driven rows: q(t) of [q; p] equals q(t) of [q; v] of another method."""
    mod, other = (models.build(name).compile(method, target="numpy") for method in ("hamilton", "embedding"))
    form, n = mod.canonical, mod.n_q
    z0 = form.z0()
    np.testing.assert_allclose(form.expand(z0), mod.x0(), rtol=1e-12, atol=1e-12)
    options = {"rtol": 1e-10, "atol": 1e-12, "method": "DOP853"}
    end = 0.2
    z = solve_ivp(form.rhs, (0.0, end), z0, **options).y[:, -1]
    x = other.project(solve_ivp(other.rhs, (0.0, end), other.x0(), **options).y[:, -1], t=end)
    found = form.expand(z, end)
    assert np.abs(found - x).max() <= 1e-8 * np.abs(x).max()
    assert np.abs(x[:n] - mod.x0()[:n]).max() > 0.02


@pytest.mark.parametrize("name", ["four_bar", "spherical_pendulum"])
def test_momenta_change_as_their_derivative_says(name: str) -> None:
    """p' = -dH/dq + Q equals the derivative of p = M v along the motion of another method."""
    mod, other = (models.build(name).compile(method, target="numpy") for method in ("hamilton", "embedding"))
    form, n = mod.canonical, mod.n_q
    for x in judges.random_states(mod, 2, 3):
        flow = other.rhs(0.0, x)

        def momenta(states: np.ndarray) -> np.ndarray:
            return np.stack([other.mass_matrix(s[:n]) @ s[n:] for s in states.T], axis=1)

        expected = judges.first(momenta, x, flow, h=1e-2)
        found = form.rhs(0.0, form.of(x))[n:]
        assert np.abs(found - expected).max() <= 1e-9 * max(1.0, np.abs(expected).max())
        assert form.hamiltonian(form.of(x)) == pytest.approx(float(np.sum(other.energy(x))), rel=1e-12, abs=1e-12)


# -- Differential-algebraic --------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["double_pendulum", "slider_crank", "skewed_four_bar", "rolling_disc"])
def test_consistent_values_leave_no_residual_and_the_jacobian_is_exact(name: str) -> None:
    mod = models.build(name).compile(target="numpy")
    form = mod.dae
    x = judges.random_states(mod, 3, 1)[0]
    y, yp = form.initial(x)
    assert len(form.y_names) == form.n_y == mod.n_x + mod.n_c + len(mod.constraints(x[: mod.n_q]))
    assert np.abs(form.residual(0.0, y, yp)).max() <= 1e-11 * np.abs(yp).max()
    q, v, a = x[: mod.n_q], x[mod.n_q :], yp[mod.n_q : mod.n_x]
    l = y[mod.n_x : mod.n_x + mod.n_c]
    C_q = mod.constraint_jacobian(q)
    assert np.abs(mod.mass_matrix(q) @ a + mod.bias(0.0, x) + C_q.T @ l).max() <= 1e-10 * max(
        1.0, np.abs(l).max(initial=0)
    )
    random = np.random.default_rng(1)
    y, yp, cj = y + 0.02 * random.normal(size=form.n_y), random.normal(size=form.n_y), 3.7
    J = form.jacobian(0.2, y, yp, cj)

    def moved(columns: np.ndarray) -> np.ndarray:
        return np.stack([form.residual(0.2, c[: form.n_y], c[form.n_y :]) for c in columns.T], axis=1)

    both = np.concatenate([y, yp])
    numeric = np.stack(
        [judges.first(moved, both, np.concatenate([e, cj * e]), h=1e-3, size=1.0) for e in np.eye(form.n_y)], axis=1
    )
    assert np.abs(J - numeric).max() <= 1e-8 * np.abs(J).max()
    assert v.shape == a.shape


@pytest.mark.parametrize(
    ("name", "end", "first", "last"),
    [("slider_crank", 0.5, 1e-5, 1e-7), ("four_bar", 1.0, 1e-4, 1e-6)],
)
def test_ida_finds_the_trajectories_of_embedding(name: str, end: float, first: float, last: float) -> None:
    """A real solver of differential-algebraic equations on F alone: the difference falls with its tolerance."""
    pytest.importorskip("sksundae")
    mod = models.build(name).compile(target="numpy")
    times = np.linspace(0.0, end, 13)
    ours = mod.simulate((0.0, end), t_eval=times, rtol=1e-10, atol=1e-12)
    assert np.ptp(ours.x, axis=1).max() > 1.0
    errors = []
    for rtol in (1e-7, 1e-9):
        theirs = mod.dae.solve((0.0, end), t_eval=times, rtol=rtol, atol=1e-2 * rtol)
        assert theirs.metadata["method"] == "IDA"
        np.testing.assert_array_equal(theirs.t, times)
        errors.append(np.abs(theirs.x - ours.x).max() / np.abs(ours.x).max())
    assert errors[0] <= first
    assert errors[1] <= min(last, 0.3 * errors[0])


# -- Events of IDA's runs ----------------------------------------------------------------------------------------------
G = 9.81


def ball(**floor: Any) -> Any:
    m = eg.Model("ball", gravity=(0, -G, 0))
    e = m.parameter("e", 0.9)
    m.prismatic("J", m.ground, m.body("ball", mass=1.0), axis="y", coordinate="h")
    m.initial(h=1.0)
    m.event("floor", "h", **({"direction": -1, "reset": {"h_dot": -e * m.coordinate("h_dot")}} | floor))
    m.event("apex", "h_dot", direction=-1)
    return m.compile(target="numpy")


@pytest.fixture(scope="module")
def bouncing() -> Any:
    pytest.importorskip("sksundae")
    return ball()


def hits(e: float, count: int) -> np.ndarray:
    first, rest = np.sqrt(2 / G), 2 * np.sqrt(2 / G) * e ** np.arange(1, count)
    return np.cumsum([first, *rest])


def test_a_ball_bounces_as_in_closed_form(bouncing: Any) -> None:
    run = bouncing.dae.solve((0, 2.8), rtol=1e-9, atol=1e-11)
    times = hits(0.9, 4)
    np.testing.assert_allclose(run.t_events["floor"], times, atol=1e-9)
    assert run.t_events["apex"][0] == 0.0
    np.testing.assert_allclose(run.t_events["apex"][1:], (times[:-1] + times[1:]) / 2, atol=1e-9)
    np.testing.assert_allclose(run.x_events["floor"][1], -np.sqrt(2 * G) * 0.9 ** np.arange(4), rtol=1e-8)
    assert run["h"].min() > -1e-9
    twice = np.flatnonzero(np.diff(run.t) == 0.0)
    assert len(twice) == 4
    np.testing.assert_allclose(run["h_dot"][twice + 1], -0.9 * run["h_dot"][twice], rtol=1e-12)
    asked = np.linspace(0.0, 2.8, 13)
    at = bouncing.dae.solve((0, 2.8), t_eval=asked, rtol=1e-9, atol=1e-11)
    np.testing.assert_array_equal(at.t, asked)
    last = np.searchsorted(times, asked) - 1
    after, up = (
        asked - np.where(last < 0, 0.0, times[last]),
        np.where(last < 0, 0.0, np.sqrt(2 * G) * 0.9 ** (last + 1.0)),
    )
    np.testing.assert_allclose(at["h"], np.where(last < 0, 1.0, 0.0) + up * after - G * after**2 / 2, atol=1e-8)


# -- Reactions as unknowns ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize("method", ["newton_euler", "amalgamated", "embedding"])
def test_the_ground_carries_the_change_of_momentum(method: str) -> None:
    """A slider-crank, a joint between two moving bodies cut: reactions at the ground give the sum of m (a_c - g)."""
    mod = models.build("offset_slider_crank").compile(method, target="numpy")
    held = [mod.joint_names.index(name) for name in "AD"]
    for x in judges.random_states(mod, 3, 2):

        def momentum(states: np.ndarray) -> np.ndarray:
            return np.stack([mod.momentum(s)[:3] for s in states.T], axis=1)

        rate = judges.first(momentum, x, mod.rhs(0.0, x), h=1e-2)
        weight = np.array([0.0, 9.81 * 2.3, 0.0])
        np.testing.assert_allclose(mod.reactions(0.0, x)[held, :3].sum(axis=0), rate + weight, rtol=1e-8, atol=1e-8)


def test_sizes_are_those_of_the_table() -> None:
    """Bodies b, freedoms of the tree d, equations of cut joints and couplings k, velocities n, rows m."""
    for name, b, d, k, n, m in (
        ("slider_crank", 3, 3, 5, 3, 2),
        ("rolling_disc", 1, 6, 3, 6, 3),
        ("chain", 3, 3, 0, 3, 0),
    ):
        sizes = {
            method: models.build(name).derive(method).system_size
            for method in ("augmented", "newton_euler", "amalgamated")
        }
        assert sizes["newton_euler"][0] == 12 * b + k
        assert sizes["amalgamated"][0] == 12 * b + d + k
        assert sizes["augmented"] is None if m == 0 else sizes["augmented"][0] == n + m
