"""Friction by the reaction of a joint, against Newton's and Euler's equations of single bodies, solved by SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

import eomgen as eg

G, SMOOTH = 9.81, 1e-2
TARGETS = ("numpy", "cython")


def pendulum(mu: float = 0.3, **friction) -> eg.Model:
    m = eg.Model("pin", gravity=(0, -G, 0))
    rod = m.body("rod", mass=2.0, inertia={"zz": 0.3}, com=(0.4, 0, 0))
    m.revolute("A", m.ground, rod)
    m.friction("pin", joint="A", coefficient=mu, radius=0.05, smoothing=SMOOTH, **friction)
    return m


def pendulum_truth(mu: float, angle: float, rate: float) -> float:
    """The pin's force follows from the acceleration of the centre of mass, which the pin's friction changes."""

    def balance(acceleration: float) -> float:
        along = -0.4 * (acceleration * np.sin(angle) + rate**2 * np.cos(angle))
        up = 0.4 * (acceleration * np.cos(angle) - rate**2 * np.sin(angle))
        pin = 2.0 * np.hypot(along, up + G)
        turn = (0.3 + 2.0 * 0.4**2) * acceleration + 2.0 * G * 0.4 * np.cos(angle)
        return turn + mu * 0.05 * pin * np.tanh(rate / SMOOTH)

    return brentq(balance, -1e3, 1e3, xtol=1e-13, rtol=1e-14)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(("angle", "rate"), [(0.7, 1.3), (-2.1, -4.0), (0.2, 0.004), (1.0, 0.0)])
def test_pendulum_on_a_pin(target, angle, rate):
    mod = pendulum().compile(target=target)
    assert mod.rhs(0.0, [angle, rate])[1] == pytest.approx(pendulum_truth(0.3, angle, rate), rel=1e-12)


def planar_system(bodies, joints, forces):
    """Accelerations and reactions of bodies in a plane, each set free: unknown are (ax, ay, alpha) and joint forces.

    ``bodies``: (mass, inertia).  ``joints``: (first, second, arms from the centres of mass, w^2 terms, friction), where
    friction(F) is the torque on the second.  ``forces``: (fx, fy, torque) on each body.
    """
    n, k = len(bodies), len(joints)

    def residual(z):
        a, F = z[: 3 * n].reshape(n, 3), z[3 * n :].reshape(k, 2)
        left = [np.array([m * a[i, 0], m * a[i, 1], J * a[i, 2]]) - forces[i] for i, (m, J) in enumerate(bodies)]
        held = []
        for j, (first, second, arms, spins, friction) in enumerate(joints):
            points = []
            for body, arm, spin, sign in zip((first, second), arms, spins, (-1.0, 1.0), strict=True):
                if body is None:
                    points.append(np.zeros(2))
                    continue
                push, turn = sign * F[j], sign * friction(F[j])
                left[body] = left[body] - [*push, arm[0] * push[1] - arm[1] * push[0] + turn]
                points.append(a[body, :2] + a[body, 2] * np.array([-arm[1], arm[0]]) - spin**2 * np.asarray(arm))
            held.append(points[1] - points[0])
        return np.concatenate([*left, *held])

    z, info, ok, message = fsolve(residual, np.zeros(3 * n + 2 * k), xtol=1e-13, full_output=True)
    assert np.abs(residual(z)).max() < 1e-9, message
    return z[: 3 * n].reshape(n, 3), z[3 * n :].reshape(k, 2)


def chain(links: int, mu: float) -> eg.Model:
    m = eg.Model("chain", gravity=(0, -G, 0))
    before = m.ground
    for k in range(links):
        body = m.body(f"rod{k}", mass=1.0 + 0.3 * k, inertia={"zz": 0.02 + 0.01 * k}, com=(0.2, 0, 0))
        m.revolute(f"A{k}", before if k == 0 else before.at(0.5, 0, 0), body)
        m.friction(f"pin{k}", joint=f"A{k}", coefficient=mu, radius=0.04 + 0.01 * k, smoothing=SMOOTH)
        before = body
    return m


@pytest.mark.parametrize("method", ["embedding", "recursive", "newton_euler", "lagrange"])
@pytest.mark.parametrize("target", TARGETS)
def test_chain_of_four(method, target):
    mu, n = 0.35, 4
    mod = chain(n, mu).derive(method).compile(target=target)
    random = np.random.default_rng(3)
    for _ in range(4):
        q, v = random.uniform(-2, 2, n), random.uniform(-3, 3, n)
        angle, spin = np.cumsum(q), np.cumsum(v)
        axis = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        bodies = [(1.0 + 0.3 * k, 0.02 + 0.01 * k) for k in range(n)]
        joints = []
        for k in range(n):
            arms = (0.3 * axis[k - 1], -0.2 * axis[k])
            spins = (spin[k - 1] if k else 0.0, spin[k])

            def rubs(F, k=k):
                return -mu * (0.04 + 0.01 * k) * np.hypot(*F) * np.tanh(v[k] / SMOOTH)

            joints.append((k - 1 if k else None, k, arms, spins, rubs))
        a, F = planar_system(bodies, joints, [np.array([0.0, -G * m, 0.0]) for m, _ in bodies])
        x = np.concatenate([q, v])
        assert np.cumsum(mod.rhs(0.0, x)[n:]) == pytest.approx(a[:, 2], rel=1e-8, abs=1e-8)
        assert mod.reactions(0.0, x)[:, :2] == pytest.approx(F, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize("target", TARGETS)
def test_jacobian_of_a_chain(target):
    mod = chain(3, 0.35).compile(target=target)
    random = np.random.default_rng(4)
    x, h = random.uniform(-1.5, 1.5, 6), 1e-5
    steps = [
        (8 * (mod.rhs(0, x + h * e) - mod.rhs(0, x - h * e)) - (mod.rhs(0, x + 2 * h * e) - mod.rhs(0, x - 2 * h * e)))
        / (12 * h)
        for e in np.eye(6)
    ]
    assert mod.jacobian(0.0, x) == pytest.approx(np.array(steps).T, rel=1e-7, abs=1e-6)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("rate", [0.5, -0.5])
def test_block_in_an_inclined_guide(target, rate):
    """Pushed by u along the horizontal it is held by N = m g cos + u sin: m a = m g sin - u cos -+ mu |N|."""
    slope, mass, mu, u = 0.5, 3.0, 0.2, 20.0
    m = eg.Model("incline", gravity=(0, -G, 0))
    block = m.body("block", mass=mass, inertia={"zz": 0.1})
    m.prismatic("A", m.ground.at(0, 0, 0), block, axis=(np.cos(slope), -np.sin(slope), 0))
    m.force("push", at=block, value=(-u, 0, 0))
    m.friction("rub", joint="A", coefficient=mu, smoothing=SMOOTH)
    mod = m.compile(target=target)
    normal = mass * G * np.cos(slope) + u * np.sin(slope)
    along = mass * G * np.sin(slope) - u * np.cos(slope) - mu * normal * np.tanh(rate / SMOOTH)
    assert mod.rhs(0.0, [0.3, rate])[1] == pytest.approx(along / mass, rel=1e-12)


def slider_crank(mu: float, pins: float) -> eg.Model:
    m = eg.Model("engine", gravity=(0, -G, 0))
    crank = m.body("crank", mass=1.0, inertia={"zz": 0.01}, com=(0.05, 0, 0))
    rod = m.body("rod", mass=0.8, inertia={"zz": 0.02}, com=(0.15, 0, 0))
    piston = m.body("piston", mass=0.5, inertia={"zz": 0.001})
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(0.1, 0, 0), rod)
    m.revolute("C", rod.at(0.3, 0, 0), piston)
    m.prismatic("S", m.ground, piston, axis="x", coordinate="s")
    m.initial(theta=0.8, theta_dot=20.0)
    m.guess(s=0.35)
    m.friction("guide", joint="S", coefficient=mu, smoothing=SMOOTH)
    for name in "ABC":
        m.friction(f"pin{name}", joint=name, coefficient=pins, radius=0.02, smoothing=SMOOTH)
    return m
