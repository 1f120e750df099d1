"""The augmented form: its system from outside, Baumgarte's stabilisation against its closed form, exact Jacobian."""

from __future__ import annotations

from typing import Any

import judges
import models
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import eomgen as eg
from eomgen.errors import UsageError

ALPHA, BETA = 4.0, 4.0
MODELS = [("slider_crank", "cython"), ("slider_crank", "numpy"), ("rolling_disc", "numpy")]


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


def test_a_nonholonomic_residual_decays_at_twice_alpha() -> None:
    mod = stabilised("rolling_disc")
    x = perturbed(mod, 3)
    x[: mod.n_q] = mod.project(x)[: mod.n_q]
    slip = mod.velocity_constraints(x)[mod.metadata["n_h"] :]
    run = solve_ivp(mod.rhs, (0.0, 0.3), x, rtol=1e-11, atol=1e-13)
    left = mod.velocity_constraints(run.y[:, -1])[mod.metadata["n_h"] :]
    np.testing.assert_allclose(left, slip * np.exp(-2 * ALPHA * 0.3), atol=1e-9)


@pytest.mark.parametrize(("name", "target"), MODELS)
def test_the_jacobian_is_that_of_the_stabilised_right_hand_side(name: str, target: str) -> None:
    mod = stabilised(name, target)
    x = perturbed(mod, 4)
    J = mod.jacobian(0.0, x)
    numeric = np.stack([judges.first(lambda s: mod.rhs(0.0, s), x, e, h=1e-3) for e in np.eye(mod.n_x)], axis=1)
    assert np.abs(J - numeric).max() <= 1e-8 * np.abs(J).max()


def test_a_stored_trajectory_is_projected_all_the_same() -> None:
    mod = stabilised("slider_crank", "cython")
    plain = models.build("slider_crank").compile(target="numpy")
    times = np.linspace(0, 0.4, 9)
    one, other = (m.simulate((0, 0.4), t_eval=times, rtol=1e-10, atol=1e-12) for m in (mod, plain))
    assert one.residuals.position < 1e-11
    assert one.residuals.raw_position > 0.0
    assert np.abs(one.x - other.x).max() <= 1e-6 * np.abs(other.x).max()


def test_what_baumgarte_cannot_be_is_said() -> None:
    model = models.build("slider_crank")
    with pytest.raises(UsageError, match="works with method 'augmented' only, not 'embedding'"):
        model.derive("embedding", baumgarte=(1, 1))
    with pytest.raises(UsageError, match=r"two numbers \(alpha, beta\) in 1/s, not 5"):
        model.derive("augmented", baumgarte=5)
    with pytest.raises(UsageError, match="not negative"):
        model.derive("augmented", baumgarte=(-1, 2))
    with pytest.raises(UsageError, match="this model has no constraints"):
        models.build("pendulum").derive("augmented", baumgarte=(1, 1))


def test_a_form_that_is_not_there_lists_those_that_are() -> None:
    with pytest.raises(UsageError, match="augmented, newton_euler, amalgamated, gibbs_appell, hamilton"):
        models.build("pendulum").derive("kane")
    bare = eg.load(models.EXAMPLES / "pendulum.yaml")
    assert bare.derive("gibbs_appell").method == "gibbs_appell"
