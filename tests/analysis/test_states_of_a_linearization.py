"""``to_x`` of a linearization: changes of the whole state, with Euler parameters and closed loops too."""

from __future__ import annotations

from importlib.resources import files

import numpy as np
import pytest

import eomgen as eg


def bob() -> eg.Model:
    """A rigid body hung on a ball joint in Euler parameters, with a spring that centres its spin."""
    m = eg.Model("bob", gravity=(0, 0, -9.81))
    body = m.body("body", mass=2, com=(0, 0, -0.5), inertia=(0.3, 0.4, 0.1))
    m.spherical("ball", m.ground, body, rotation="euler_parameters")
    m.spring("k", m.ground.at(1, 0, -0.5), body.at(0.3, 0, -0.5), stiffness=30, length=0.7)
    return m


def check(mod: object, x: np.ndarray) -> None:
    """At an equilibrium J T = T A; and x + h T s stays on the constraints to second order."""
    lin = mod.linearize(x)
    T = lin.to_x
    assert T.shape == (mod.n_x, len(lin.states))
    J = mod.jacobian(0.0, lin.x)
    np.testing.assert_allclose(J @ T, T @ lin.A, rtol=0, atol=1e-8 * max(1.0, np.abs(lin.A).max()))
    s = np.random.default_rng(2).normal(size=T.shape[1])
    away = []
    for h in (1e-3, 5e-4):
        moved = lin.x + h * T @ s
        away.append(np.abs(mod.project(moved) - moved).max())
    assert away[0] < 1e-4
    assert away[1] < 0.3 * away[0] + 1e-13  # a quarter: second order


def test_with_euler_parameters() -> None:
    mod = bob().compile(target="numpy")
    lin = mod.linearize(mod.x0())
    assert lin.states[0] == "ball_rx"
    assert lin.is_equilibrium
    check(mod, mod.x0())
    # a small turn about x changes e1 by half of it, as e = (cos a/2, sin a/2, 0, 0)
    column = dict(zip(mod.x_names, lin.to_x[:, 0], strict=True))
    assert column["ball_e1"] == pytest.approx(0.5)
    assert column["ball_e0"] == pytest.approx(0.0, abs=1e-15)


def test_a_closed_loop() -> None:
    mod = eg.load(files("eomgen.examples") / "four_bar.yaml").compile(target="numpy")
    found = mod.equilibrium()
    check(mod, found.x)


def test_the_full_form() -> None:
    mod = eg.load(files("eomgen.examples") / "double_pendulum.yaml").compile(target="numpy")
    np.testing.assert_array_equal(mod.linearize(mod.x0(), form="full").to_x, np.eye(mod.n_x))
