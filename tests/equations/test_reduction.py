"""The embedded system that is shown in SymPy against the closed form of a slider-crank with one heavy slider."""

from __future__ import annotations

import numpy as np
import pytest

import eomgen as eg

R, L, CRANK, SLIDER = 0.2, 0.5, 0.03, 1.4


def advance(angle: float) -> float:
    """ds/dtheta of s = r cos(theta) + sqrt(l^2 - r^2 sin^2(theta))."""
    return float(-R * np.sin(angle) - R**2 * np.sin(2 * angle) / (2 * np.sqrt(L**2 - (R * np.sin(angle)) ** 2)))


@pytest.mark.parametrize("method", ["embedding", "lagrange", "recursive"])
@pytest.mark.parametrize("angle", [0.8, 2.5])
def test_one_equation_in_the_crank_angle(method: str, angle: float) -> None:
    """(J + m s'^2) theta'' = tau - m s' s'' theta'^2, s' and s'' derivatives by theta."""
    m = eg.Model("press", gravity=(0, 0, 0))
    crank, rod = m.body("crank", mass=0, inertia={"zz": CRANK}), m.body("rod", mass=0)
    slider = m.body("slider", mass=SLIDER)
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(R, 0, 0), rod, coordinate="phi")
    m.revolute("C", rod.at(L, 0, 0), slider)
    m.prismatic("D", m.ground, slider, axis="x", coordinate="s")
    m.torque("motor", "A", m.input("tau", 0.7))
    m.guess = {"theta": angle, "phi": -1.2 * angle, "s": 0.6}
    equations = m.derive(method, independent=["theta"])
    rate = 3.0
    module = equations.compile(target="numpy")
    x = module.x0({"theta": angle, "theta_dot": rate})
    values = dict(zip((*module.x_names, "tau"), (*x, 0.7), strict=True))
    mass, force = (
        float(matrix[0].subs({s: values[s.name] for s in matrix.free_symbols}))
        for matrix in (equations.mass_matrix, equations.force)
    )
    slope, d = advance(angle), 1e-5
    bend = (advance(angle + d) - advance(angle - d)) / (2 * d)
    assert mass == pytest.approx(CRANK + SLIDER * slope**2, rel=1e-11)
    assert force == pytest.approx(0.7 - SLIDER * slope * bend * rate**2, rel=1e-8)
