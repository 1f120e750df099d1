"""Energy of springs and stops in closed form, and the accelerations that every method takes from it."""

from __future__ import annotations

import numpy as np
import pytest

import eomgen as eg
from eomgen.equations import METHODS


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("length", [0.0, 0.4])
def test_a_mass_on_a_spring(method: str, length: float) -> None:
    """V = k (s - s0)^2 / 2 with the distance s = sqrt(x^2 + h^2); m x'' = -k (s - s0) x / s."""
    k, h, mass = 30.0, 0.5, 2.0
    m = eg.Model("spring", gravity=(0, 0, 0))
    body = m.body("body", mass=mass)
    m.prismatic("J", m.ground, body, axis="x", coordinate="x")
    m.spring("S", m.ground.at(0, h, 0), body, stiffness=k, length=length)
    mod = m.compile(method=method, target="numpy")
    for x, v in ((0.8, 1.5), (-0.3, 0.2)):
        s = np.hypot(x, h)
        assert mod.energy(np.array([x, v])) == pytest.approx([mass * v**2 / 2, k * (s - length) ** 2 / 2], rel=1e-13)
        assert mod.rhs(0.0, np.array([x, v])) == pytest.approx([v, -k * (s - length) * x / s / mass], rel=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_a_torsion_spring_and_a_stop(method: str) -> None:
    """V = c (a - a0)^2 / 2 below the stop, with K d^(n+1) / (n + 1) of the penetration d beyond it."""
    c, rest, K, n, limit, inertia = 7.0, 0.2, 400.0, 1.5, 0.9, 0.3
    m = eg.Model("turn", gravity=(0, 0, 0))
    wheel = m.body("wheel", mass=1.0, inertia={"zz": inertia})
    m.revolute("J", m.ground, wheel, coordinate="a")
    m.torsional_spring("S", "J", stiffness=c, angle=rest)
    m.stop("end", joint="J", upper=limit, stiffness=K, exponent=n, dissipation=0.0)
    mod = m.compile(method=method, target="numpy")
    for a in (0.5, 1.1):
        d = max(a - limit, 0.0)
        V = c * (a - rest) ** 2 / 2 + K * d ** (n + 1) / (n + 1)
        assert mod.energy(np.array([a, 0.4]))[1] == pytest.approx(V, rel=1e-13)
        assert mod.rhs(0.0, np.array([a, 0.4]))[1] == pytest.approx(-(c * (a - rest) + K * d**n) / inertia, rel=1e-12)


@pytest.mark.parametrize("side", ["lower", "upper"])
@pytest.mark.parametrize("rate", [-0.8, 0.5])
def test_a_lower_stop_brakes(side: str, rate: float) -> None:
    """Hunt and Crossley: K d^n (1 + f d') of the penetration d and its rate, at either end."""
    K, n, f, inertia = 400.0, 1.5, 0.6, 0.3
    m = eg.Model("ends", gravity=(0, 0, 0))
    m.revolute("J", m.ground, m.body("wheel", mass=1.0, inertia={"zz": inertia}), coordinate="a")
    m.stop("end", joint="J", **{side: 0.0}, stiffness=K, exponent=n, dissipation=f)
    mod = m.compile(target="numpy")
    inward, d = (-1.0 if side == "lower" else 1.0), 0.2
    push = K * d**n * (1.0 + f * inward * rate)
    assert mod.rhs(0.0, np.array([inward * d, rate]))[1] == pytest.approx(-inward * push / inertia, rel=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_springs_and_dampers_on_coordinates(method: str) -> None:
    """On both coordinates of a cylindrical joint: m z'' = -k (z - z0) - c z', I a'' = -K a, V the sum of both."""
    k, rest, c, K, mass, inertia = 30.0, 0.2, 1.5, 4.0, 2.0, 0.3
    m = eg.Model("piston", gravity=(0, 0, 0))
    piston = m.body("piston", mass=mass, inertia=(1, 1, inertia))
    m.cylindrical("C", m.ground, piston, coordinates=["z", "a"])
    m.joint_spring("S", "z", stiffness=k, rest=rest)
    m.joint_spring("T", "a", stiffness=K)
    m.joint_damper("D", "z", c)
    mod = m.compile(method=method, target="numpy")
    z, a, v, w = 0.5, 0.7, 0.3, -0.4
    x = np.array([z, a, v, w])
    V = k * (z - rest) ** 2 / 2 + K * a**2 / 2
    assert mod.energy(x) == pytest.approx([mass * v**2 / 2 + inertia * w**2 / 2, V], rel=1e-13)
    assert mod.rhs(0.0, x) == pytest.approx([v, w, (-k * (z - rest) - c * v) / mass, -K * a / inertia], rel=1e-12)
