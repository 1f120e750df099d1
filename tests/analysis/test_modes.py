"""Natural frequencies and mode shapes against closed forms and published vehicle models."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest
import scipy.linalg

import eomgen as eg

Compiled = Callable[..., Any]


def test_a_double_pendulum(compiled: Compiled) -> None:
    """Equal point masses on equal rods: omega^2 = g/l (2 -+ sqrt 2), amplitudes 1 : +-sqrt 2 (Landau and Lifshitz)."""
    mod = compiled("double_pendulum")
    p = dict(zip(mod.p_names, mod.p, strict=True))
    same = dict.fromkeys(("m1", "m2"), 0.7) | dict.fromkeys(("l1", "l2"), 0.6)
    assert same.keys() <= p.keys()
    found = mod.modes(p=same)
    expected = np.sqrt(p["g"] / 0.6 * (2 + np.array([-1, 1]) * np.sqrt(2)))
    np.testing.assert_allclose(found.frequencies, expected, rtol=1e-10)
    np.testing.assert_allclose(found.hertz, expected / (2 * np.pi), rtol=1e-10)
    first, second = found.shapes.T  # relative angles: the second absolute one is their sum
    np.testing.assert_allclose([first.sum() / first[0], second.sum() / second[0]], [np.sqrt(2), -np.sqrt(2)], rtol=1e-8)
    M, K = found.linear.mass, found.linear.stiffness
    np.testing.assert_allclose(found.shapes.T @ M @ found.shapes, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(found.squares, scipy.linalg.eigh(K, M, eigvals_only=True), rtol=1e-10)
    assert (found.rigid, found.diverging) == (0, 0)
    assert all(abs(mode.ratio) < 1e-12 for mode in found.damped)


def test_a_quarter_car(compiled: Compiled) -> None:
    """Undamped frequencies and damped eigenvalues of the published quarter-car, about its own equilibrium."""
    given = models.reference("vehicle_linear_models")["quarter_car"]
    found = compiled("quarter_car").modes()
    np.testing.assert_allclose(found.frequencies, [float(x) for x in given["undamped_rad_s"]], rtol=1e-12)
    np.testing.assert_allclose(found.hertz, [float(x) for x in given["undamped_Hz"]], rtol=1e-12)
    pairs = [complex(float(re), float(im)) for re, im in given["eig"] if float(im) > 0]
    assert len(found.damped) == 2
    for mode, value in zip(found.damped, pairs, strict=True):
        assert mode.eigenvalue == pytest.approx(value, rel=1e-12)
        assert mode.frequency == pytest.approx(abs(value), rel=1e-12)
        assert mode.damped == pytest.approx(value.imag, rel=1e-12)
        assert mode.ratio == pytest.approx(-value.real / abs(value), rel=1e-12)
    sag = 9.81 * 550 / 180000
    assert found.linear.x[0] == pytest.approx(-sag, rel=1e-12)


def test_the_undamped_iftomm_four_bar(compiled: Compiled) -> None:
    given = models.reference("iftomm_fourbar_diagonal_spring")["reference"]
    found = compiled("spring_four_bar").modes()
    assert found.frequencies[0] == pytest.approx(complex(given["eig_undamped"].replace(" ", "")).imag, rel=1e-11)
    np.testing.assert_allclose(np.abs(found.motions[:, 0] / found.shapes[0, 0]), 1.0, rtol=1e-9)  # parallelogram


def test_rigid_body_modes_and_modes_that_diverge(compiled: Compiled) -> None:
    """Two masses on a rail joined by a spring: one rigid-body mode, omega^2 = k (1/m1 + 1/m2)."""
    m = eg.Model("train")
    first, second = m.body("first", mass=2.0), m.body("second", mass=3.0)
    m.prismatic("a", m.ground, first, axis="x")
    m.prismatic("b", m.ground, second, axis="x")
    m.spring("k", first, second.at(0, 0.1, 0), stiffness=50.0, length=0.5)
    m.initial(a=0.0, b=0.5)
    found = m.compile(target="numpy").modes()
    assert (found.rigid, found.diverging) == (1, 0)
    length = 0.5
    b = found.linear.x[1] - found.linear.x[0]
    assert np.hypot(b, 0.1) == pytest.approx(length, rel=1e-10)
    omega = np.sqrt(50.0 * (b / length) ** 2 * (1 / 2 + 1 / 3))  # the spring is not along the rail
    np.testing.assert_allclose(found.frequencies, [0.0, omega], rtol=1e-9, atol=0)
    assert "rigid body" in repr(found)
    mod = compiled("cart_pendulum")
    upright = mod.modes(mod.x0(phi=0.0))
    assert (upright.rigid, upright.diverging) == (1, 1)
    p = dict(zip(mod.p_names, mod.p, strict=True))
    total, h = p["m_cart"] + p["m_pole"], p["h"]
    rate = np.sqrt(p["g"] / (h * (4 / 3 - p["m_pole"] / total)))  # Barto, Sutton and Anderson (1983)
    assert np.sqrt(-upright.squares[0]) == pytest.approx(rate, rel=1e-10)


def test_a_top_in_euler_parameters(compiled: Compiled) -> None:
    """Hanging: sqrt(m g l / I) twice and the spin, which nothing holds; no mode for the parameters' length."""
    mod = compiled("top_parameters")
    found = mod.modes(mod.x0(S_e0=0, S_e1=1))
    assert found.frequencies.shape == (3,)
    np.testing.assert_allclose(found.frequencies, [0, *[np.sqrt(9.81 * 0.2 / 0.06)] * 2], rtol=1e-12, atol=0)
    assert found.rigid == 1


def test_a_standing_disc(compiled: Compiled) -> None:
    """Nonholonomic: three modes, of which lean diverges with g/r 4/5 and the others are rigid."""
    mod = compiled("rolling_disc")
    zero = dict.fromkeys(mod.x_names[:2] + mod.x_names[3:], 0.0)
    found = mod.modes(mod.x0(zero))
    np.testing.assert_allclose(found.squares, [-0.8 * 9.81 / 0.5, 0.0, 0.0], rtol=1e-12, atol=1e-9)


def test_no_equilibrium_no_modes(compiled: Compiled) -> None:
    mod = compiled("slider_crank")
    with pytest.raises(eg.UsageError, match="needs an equilibrium, and at this state"):
        mod.modes(mod.x0())
    assert mod.modes().frequencies.shape == (1,)


def test_a_position_by_names() -> None:
    m = eg.Model("pendulum", gravity=(0, -9.81, 0))
    m.revolute("A", m.ground, m.body("a", mass=1, com=(0, -0.5, 0)))
    m.initial(A=0.3, A_dot=1.0)
    mod = m.compile(target="numpy")
    np.testing.assert_allclose(mod.modes({"A": 0.0}).frequencies, np.sqrt(9.81 / 0.5), rtol=1e-12)
    turned = mod.linearize({"A": 0.1, "A_dot": 0.0})
    np.testing.assert_allclose(turned.A, [[0.0, 1.0], [-9.81 / 0.5 * np.cos(0.1), 0.0]], rtol=1e-12)
    with pytest.raises(eg.UsageError, match="B"):
        mod.modes({"B": 0.1})
