"""First-order states in mechanisms with loops, Euler parameters and long chains."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import eomgen as eg


def crank(states: bool = True) -> eg.Model:
    """A slider-crank whose motor sees the filtered speed of the slider, and a lagged force of the spring.

    Without ``states`` a body of 1 kg on a slide of its own takes the place of each: its speed is the state.
    """
    m = eg.Model("crank", gravity=(0, -9.81, 0))
    r, l = m.parameter("r", 0.1), m.parameter("l", 0.35)
    m.parameter("T", 0.05)
    wheel = m.body("wheel", mass=1.0, com=(r / 2, 0, 0), inertia={"zz": r**2 / 12})
    rod = m.body("rod", mass=0.8, com=(l / 2, 0, 0), inertia={"zz": 0.8 * l**2 / 12}, markers={"tip": (l, 0, 0)})
    slider = m.body("slider", mass=0.5)
    m.revolute("A", m.ground, wheel, coordinate="theta")
    m.revolute("B", wheel.at(r, 0, 0), rod)
    m.revolute("C", "rod.tip", slider)
    m.prismatic("D", m.ground, slider, axis="x", coordinate="s")
    m.input("u")
    m.spring("k1", m.ground.at(0.5, 0, 0), slider, stiffness=200, length=0.1)
    rates = {"f": "(vx(rod.tip) - f)/T", "d": "50*(force(k1) - d)"}
    if states:
        for name, rate in rates.items():
            m.state(name, rate, initial=20 if name == "d" else 0)
        m.torque("motor", "A", "-0.4*f + u + 0.001*d")
    else:
        for name, rate in rates.items():
            m.prismatic(f"slide_{name}", m.ground, m.body(f"body_{name}", mass=1.0), axis="z", coordinate=f"q{name}")
            m.actuator(f"drive_{name}", f"q{name}", value=rate.replace("- f", "- qf_dot").replace("- d", "- qd_dot"))
        m.torque("motor", "A", "-0.4*qf_dot + u + 0.001*qd_dot")
        m.initial(qd_dot=20)
    m.output("push", "force(k1)")
    m.initial(theta=0.3, theta_dot=10)
    return m


@cache
def compiled(target: str, states: bool = True) -> Any:
    return crank(states).compile(target=target)


def extended(mod: Any, x: np.ndarray) -> np.ndarray:
    """The state of the model with bodies for states."""
    other = compiled("numpy", states=False)
    names = {"qf_dot": "f", "qd_dot": "d"}
    known = dict(zip(mod.x_names, x, strict=True))
    return np.array([known.get(names.get(name, name), 0.0) for name in other.x_names])


def differences(mod: Any, x: np.ndarray, t: float = 0.1) -> np.ndarray:
    h = 1e-6
    columns = [(mod.rhs(t, x + h * e) - mod.rhs(t, x - h * e)) / (2 * h) for e in np.eye(len(x))]
    return np.array(columns).T


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_a_loop_with_states_moves_as_one_with_bodies_in_their_place(target: str) -> None:
    mod, other = compiled(target), compiled("numpy", states=False)
    names = {"qf_dot": "f", "qd_dot": "d"}
    for theta in (0.3, 1.2, 2.5):
        x = mod.x0(theta=theta, theta_dot=4.0, f=0.3, d=-7.0)
        found = dict(zip(mod.x_names, mod.rhs(0.1, x, u=[0.3]), strict=True))
        wanted = dict(zip(other.x_names, other.rhs(0.1, extended(mod, x), u=[0.3]), strict=True))
        for name, value in wanted.items():
            if name not in ("qf", "qd"):
                assert found[names.get(name, name)] == pytest.approx(value, rel=1e-10, abs=1e-10)
        np.testing.assert_allclose(mod.jacobian(0.1, x), differences(mod, x), rtol=1e-5, atol=2e-4)


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_the_projection_keeps_states_to_the_last_bit(target: str) -> None:
    mod = compiled(target)
    x = mod.x0(theta=1.0, theta_dot=3.0)
    x = x + np.array([1e-3, -2e-3, 1e-3, 0.02, 0.01, -0.03, 0.0, 0.0])
    x[-2:] = 0.1, 1.7e9
    closed = mod.project(x)
    np.testing.assert_array_equal(closed[-2:], x[-2:])
    assert np.abs(mod.constraints(closed[:3])).max() < 1e-12
    assert np.abs(mod.velocity_constraints(closed)).max() < 1e-11  # however large a state is
    assert mod.rhs(0.0, x)[:3] == pytest.approx(closed[3:6], abs=1e-12)


def test_runs_equilibria_and_minimal_form_of_a_loop() -> None:
    mod, other = compiled("cython"), compiled("numpy", states=False)
    traj = mod.simulate(0.5, rtol=1e-10, atol=1e-12)
    wanted = other.simulate(0.5, rtol=1e-10, atol=1e-12)
    for name, twin in (("theta", "theta"), ("f", "qf_dot"), ("d", "qd_dot"), ("push", "push")):
        assert traj[name][-1] == pytest.approx(wanted[twin][-1], rel=1e-6)
    rest = mod.equilibrium()
    assert np.abs(mod.rhs(0.0, rest.x)).max() < 1e-9
    assert rest["d"] == pytest.approx(float(mod.outputs(0.0, rest.x)[0]), rel=1e-10)
    held = mod.equilibrium(hold={"theta": 0.4}, unknowns=["u"])
    assert held["theta"] == pytest.approx(0.4)
    assert np.abs(held.module.rhs(0.0, held.x)).max() < 1e-9
    linear = mod.linearize(rest.x)
    assert linear.states == ("theta", "theta_dot", "f", "d")
    minimal = mod.minimal
    x = minimal.x0(theta=0.3)
    assert minimal.x_names == ("theta", "theta_dot", "f", "d")
    np.testing.assert_allclose(minimal.rhs(0.0, x), mod.rhs(0.0, minimal.expand(x))[[0, 3, 6, 7]], rtol=1e-12)
    h = 1e-6
    reduced = []
    start = minimal.x0(**{name: rest[name] for name in ("theta", "f", "d")}, theta_dot=0.0)
    for e in np.eye(4):
        reduced.append((minimal.rhs(0.0, start + h * e) - minimal.rhs(0.0, start - h * e)) / (2 * h))
    np.testing.assert_allclose(np.array(reduced).T, linear.A, rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize(
    "method", ["lagrange", "recursive", "augmented", "newton_euler", "amalgamated", "gibbs_appell", "hamilton"]
)
def test_methods_agree(method: str) -> None:
    mod, one = compiled("numpy"), crank().compile(method=method, target="numpy")
    x = mod.x0(theta=1.1, theta_dot=-2.0, f=0.2, d=3.0)
    np.testing.assert_allclose(one.rhs(0.2, x), mod.rhs(0.2, x), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(one.jacobian(0.2, x), mod.jacobian(0.2, x), rtol=1e-7, atol=1e-7)


def test_euler_parameters_and_states() -> None:
    m = eg.Model("craft", gravity=(0, 0, -9.81))
    hull = m.body("hull", mass=2.0, inertia=(0.1, 0.2, 0.25), com=(0.01, 0.02, 0))
    m.free("j", m.ground, hull, rotation="euler_parameters")
    m.torque("thrust", hull, ("w1", 0, "0.1*w2"))
    m.state("w1", "(0.5*t - w1 - wx(hull))/0.3")
    m.state("w2", "z(hull) - w2", initial=0.4)
    modules = [m.compile(target=target) for target in ("numpy", "cython")]
    x = modules[0].x0(j_wx=0.3, j_wy=1.0, j_x=0.5)
    assert modules[0].x_names[-2:] == ("w1", "w2")
    for mod in modules:
        np.testing.assert_allclose(mod.jacobian(0.1, x), differences(mod, x), atol=1e-7)
        wx = mod.rhs(0.1, x)[-2]
        assert wx == pytest.approx((0.05 - 0.3) / 0.3)
    np.testing.assert_allclose(modules[0].rhs(0.1, x), modules[1].rhs(0.1, x), rtol=1e-13, atol=1e-14)
    assert modules[1].linearize(x).states[-2:] == ("w1", "w2")


def test_long_chains_and_large_loops() -> None:
    """Mass matrices made column by column, and straight-line code that judges its own corrections."""
    for closed in (False, True):
        m = eg.Model("chain", gravity=(0, -9.81, 0))
        last: Any = m.ground
        n = 11 if closed else 30
        for k in range(n):
            link = m.body(f"b{k}", mass=1.0, com=(0.5, 0, 0), inertia=(0.06, 0.06, 0.1))
            m.revolute(f"j{k}", last if k == 0 else last.at(1, 0, 0), link)
            last = link
        if closed:
            m.revolute("close", last.at(1, 0, 0), m.ground.at(2.0, 0, 0))
            m.guess(**{f"j{k}": 1.2 if k == 0 else -0.25 for k in range(n)})
        m.state("a", "wz(b5) - a")
        m.state("p", "1e6*wz(b3) - 3*p", initial=5e6)
        m.torque("tq", "j0", "-a - 1e-6*p")
        modules = [m.compile(target=target) for target in ("numpy", "cython")]
        x = modules[0].x0()
        x[: 2 * n] += 0.05 * np.random.default_rng(3).normal(size=2 * n)
        x = modules[0].project(x)
        a, b = (mod.rhs(0.1, x) for mod in modules)
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)
        speed = x[n : 2 * n].cumsum()
        assert a[-2:] == pytest.approx([speed[5] - x[-2], 1e6 * speed[3] - 3 * x[-1]], rel=1e-9)
        J = modules[1].jacobian(0.1, x)
        np.testing.assert_allclose(J, modules[0].jacobian(0.1, x), rtol=1e-7, atol=1e-7)
        if closed:
            assert np.abs(modules[1].velocity_constraints(x)).max() < 1e-12
