"""A massless toggle at its dead centre moves no inertia, which is said; a little away it follows its closed form.

Source: the slider's position s = r cos(theta) + sqrt(l^2 - r^2 sin(theta)^2), so that with the slider's mass alone
theta'' = (tau - m s' s'' theta'^2) / (m s'^2), ' by theta on the right.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import SingularMassMatrixError

R, L, MASS, TAU = 0.1, 0.35, 0.5, 1.0


@pytest.fixture(scope="module", params=["cython", "numpy"])
def toggle(request: pytest.FixtureRequest) -> Any:
    m = eg.Model("toggle")
    inertia = m.parameter("inertia", 0.0)
    crank, rod = m.body("crank", mass=m.parameter("crank_mass", 0.0), inertia={"zz": inertia}), m.body("rod", mass=0)
    slider = m.body("slider", mass=MASS)
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(R, 0, 0), rod)
    m.revolute("C", rod.at(L, 0, 0), slider)
    m.prismatic("D", m.ground, slider, axis="x", coordinate="s")
    m.torque("motor", "A", TAU)
    m.initial(theta=1.0)
    return m.compile(independent=["theta"], target=request.param)


def closed_form(theta: float, rate: float) -> float:
    root = np.sqrt(L**2 - (R * np.sin(theta)) ** 2)
    slope = -R * np.sin(theta) - R**2 * np.sin(theta) * np.cos(theta) / root
    bend = -R * np.cos(theta) - R**2 * np.cos(2 * theta) / root - (R**2 * np.sin(theta) * np.cos(theta)) ** 2 / root**3
    return float((TAU - MASS * slope * bend * rate**2) / (MASS * slope**2))


@pytest.mark.parametrize("theta", [0.0, np.pi, -np.pi, 2 * np.pi])
def test_no_acceleration_is_made_up_at_the_dead_centre(toggle: Any, theta: float) -> None:
    x = toggle.x0(theta=theta, theta_dot=1.0)
    with pytest.raises(SingularMassMatrixError):
        toggle.rhs(0.0, x)
    with pytest.raises(SingularMassMatrixError):
        toggle.jacobian(0.0, x)
    assert np.isfinite(toggle.bind({"inertia": 1e-9}).rhs(0.0, x)).all()  # a crank of a milligram is enough


@pytest.mark.parametrize("theta", [0.3, 1e-3, 1e-6, 1e-10, np.pi - 1e-6])
def test_beside_it_the_closed_form_is_followed(toggle: Any, theta: float) -> None:
    x = toggle.x0(theta=theta, theta_dot=2.0)
    found = toggle.rhs(0.0, x)[toggle.x_names.index("theta_dot")]
    assert found == pytest.approx(closed_form(theta, 2.0), rel=1e-9 + 1e-15 / abs(np.sin(theta)))


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_a_planet_held_still_is_not_what_the_inertia_of_a_cart_is_measured_by(target: str) -> None:
    m = eg.Model("held")
    planet, cart = m.body("planet", mass=6e24), m.body("cart", mass=1e-3)
    m.prismatic("P", m.ground, planet, coordinate="place")
    m.prismatic("C", planet, cart, coordinate="s")
    m.driver("hold", "P", "0.0")
    m.force("push", cart, (0, 0, 2e-3))
    mod = m.compile(target=target)
    assert mod.rhs(0.0, mod.x0())[mod.x_names.index("s_dot")] == pytest.approx(2.0)
