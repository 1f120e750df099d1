"""Hamilton's equations on [q; p]: closed forms, conservation, the same motion as the other forms, embedded systems."""

from __future__ import annotations

import inspect
from typing import Any

import judges
import models
import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import eomgen as eg
from eomgen.errors import UsageError


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


@pytest.mark.parametrize("name", ["double_pendulum", "slider_crank", "rolling_disc", "three_cranks"])
def test_the_motion_is_that_of_the_state_form(name: str) -> None:
    """Trees, loops, redundant and nonholonomic rows: q(t) of [q; p] equals q(t) of [q; v] of another method."""
    mod, other = (models.build(name).compile(method, target="numpy") for method in ("hamilton", "embedding"))
    form, n = mod.canonical, mod.n_q
    z0 = form.z0()
    np.testing.assert_allclose(form.expand(z0), mod.x0(), rtol=1e-12, atol=1e-12)
    options = {"rtol": 1e-10, "atol": 1e-12, "method": "DOP853"}
    end = 0.2
    z = solve_ivp(form.rhs, (0.0, end), z0, **options).y[:, -1]
    x = other.project(solve_ivp(other.rhs, (0.0, end), other.x0(), **options).y[:, -1])
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


def test_energy_of_a_lone_top_in_euler_parameters_is_its_hamiltonian() -> None:
    """p of angular velocities is the angular momentum in body axes; |p| and H are kept (Euler's equations)."""
    m = eg.Model("top")
    body = m.body("body", mass=1.0, inertia=(0.1, 0.2, 0.25))
    m.spherical("s", m.ground, body, rotation="euler_parameters")
    mod = m.compile("hamilton", target="numpy")
    form = mod.canonical
    x = mod.x0({"s_wx": 1.0, "s_wy": -0.5, "s_wz": 2.0})
    z = form.of(x)
    np.testing.assert_allclose(z[4:], [0.1, -0.1, 0.5], rtol=1e-14)
    spin = solve_ivp(form.rhs, (0, 3), z, rtol=1e-10, atol=1e-12).y[:, -1]
    assert np.abs(spin - z).max() > 0.1
    assert np.linalg.norm(spin[4:]) == pytest.approx(np.linalg.norm(z[4:]), rel=1e-8)
    assert form.hamiltonian(spin) == pytest.approx(form.hamiltonian(z), rel=1e-8)


def test_other_methods_have_no_momenta() -> None:
    mod = models.build("pendulum").compile("embedding", target="numpy")
    with pytest.raises(UsageError, match="derive it with method='hamilton'"):
        _ = mod.canonical
    assert not hasattr(mod, "canonical")
    assert not hasattr(mod, "Taylor")
    found = {name for name, _ in inspect.getmembers(mod)}  # as notebooks do to complete names
    assert {"rhs", "simulate", "minimal", "dae"} <= found
    with pytest.raises(AttributeError, match="there are DOP853|there are .*simulate, "):
        _ = mod.nothing
    form = models.build("pendulum").compile("hamilton", target="numpy").canonical
    with pytest.raises(UsageError, match=r"z must have shape \(2,\) \[theta, p_theta\]"):
        form.rhs(0.0, np.zeros(3))
