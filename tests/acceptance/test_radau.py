"""The compiled Radau IIA: SciPy's steps, its order, its stability function, and stiff problems of the literature."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import scipy.integrate
import sympy as sm
from scipy.integrate import solve_ivp

import eomgen as eg
from benchmarks.models import chain_with_joints


def linear(k: float, c: float) -> Any:
    """q'' = -k q - c q'."""
    m = eg.Model("oscillator", gravity=(0, 0, 0))
    m.prismatic("q", m.ground, m.body("block", mass=1.0), axis="x")
    m.torque("spring", "q", f"-{k}*q - {c}*q_dot")
    return m.compile(kernels=["rhs", "jacobian"])


def jacobian(mod: Any) -> Callable[[float, np.ndarray], np.ndarray]:
    return lambda t, x: mod.jacobian(t, np.ascontiguousarray(x))


@pytest.mark.parametrize("name", ["double_pendulum", "slider_crank", "stiff chain"])
def test_the_steps_of_scipy(module: Callable[..., Any], name: str) -> None:
    if name == "stiff chain":
        model, x0 = chain_with_joints(4)
        mod = model.compile()
    else:
        mod = module(name)
        x0 = mod.x0()
    options = {"rtol": 1e-6, "atol": 1e-8, "dense_output": True}
    theirs = solve_ivp(mod.rhs, (0, 2), x0, method="Radau", jac=jacobian(mod), **options)
    ours = solve_ivp(mod.rhs, (0, 2), x0, method=mod.Radau, **options)
    assert len(ours.t) == len(theirs.t)
    assert abs(ours.nfev - theirs.nfev) <= 0.01 * theirs.nfev
    assert abs(ours.njev - theirs.njev) <= 1 + 0.05 * theirs.njev
    np.testing.assert_allclose(ours.t, theirs.t, rtol=1e-3)  # where a step is hardly ever rejected, it follows rounding
    times = np.linspace(0, 2, 97)
    np.testing.assert_allclose(ours.sol(times), theirs.sol(times), rtol=1e-5, atol=1e-5)
    whole = mod.simulate((0, 2), x0, method="Radau", rtol=1e-6, atol=1e-8, t_eval=times)
    np.testing.assert_allclose(whole.x[:, -1], mod.project(ours.y[:, -1], t=2.0), rtol=1e-8, atol=1e-8)
    back = mod.simulate((2, 0), ours.y[:, -1], method="Radau", rtol=1e-6, atol=1e-8) if name != "stiff chain" else None
    assert back is None or np.abs(back.x[:, -1] - x0).max() < 1e-3


def test_one_step_multiplies_by_the_stability_function() -> None:
    """R(z) = (1 + 2z/5 + z^2/20) / (1 - 3z/5 + 3z^2/20 - z^3/60): Hairer and Wanner, section IV.3, table 3.1."""
    for k, c, h in ((1.0, 0.1, 0.3), (1e8, 1e4, 0.1), (1e6, 0.0, 0.05)):
        mod = linear(k, c)
        x0 = np.array([1.0, -0.5])
        solver = mod.Radau(mod.rhs, 0.0, x0, 1.0, first_step=h, max_step=h, rtol=1e-2, atol=1e9)
        solver.step()
        assert solver.t == h
        Z, one = h * np.array([[0.0, 1.0], [-k, -c]]), np.eye(2)
        top = one + 0.4 * Z + Z @ Z / 20
        bottom = one - 0.6 * Z + 0.15 * Z @ Z - Z @ Z @ Z / 60
        expected = np.linalg.solve(bottom, top @ x0)
        np.testing.assert_allclose(solver.y, expected, rtol=1e-9, atol=1e-10 * np.abs(x0 * [1, np.sqrt(k)]).max())


def test_order_five_and_dense_output_of_order_three() -> None:
    mod, x0 = linear(1.0, 0.0), np.array([1.0, 0.0])
    ends, within = [], []
    for steps in (8, 16, 32):
        h = 2.0 / steps
        limits = {"first_step": h, "max_step": h, "rtol": 1e-3, "atol": 1e3, "dense_output": True}
        found = solve_ivp(mod.rhs, (0, 2), x0, method=mod.Radau, **limits)
        assert len(found.t) == steps + 1
        ends.append(np.abs(found.y[:, -1] - [np.cos(2), -np.sin(2)]).max())
        times = np.linspace(0, 2, 301)
        within.append(np.abs(found.sol(times) - [np.cos(times), -np.sin(times)]).max())
    assert all(4.8 < np.log2(a / b) < 5.3 for a, b in pairwise(ends))
    assert all(3.8 < np.log2(a / b) < 4.3 for a, b in pairwise(within))  # local error h^4


def test_van_der_pol() -> None:
    """E. Hairer, G. Wanner, section IV.10 and their test set: eps = 1e-6, y(0) = (2, 0), values at t = 1 and 2."""
    q, v, eps = *sm.symbols("q q_dot"), sm.Rational(1, 10**6)
    model = eg.Model.from_lagrangian("van_der_pol", eps * v**2 / 2 - q**2 / 2, [q], forces={q: (1 - q**2) * v})
    mod = model.compile(kernels=["rhs", "jacobian"])
    known = {1.0: (-1.863646254808130, 0.7535430865435460), 2.0: (1.706167732170456, -0.8928097010248257)}
    for t, expected in known.items():
        found = solve_ivp(mod.rhs, (0, t), [2.0, 0.0], method=mod.Radau, rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(found.y[:, -1], expected, rtol=1e-10)
    assert len(solve_ivp(mod.rhs, (0, 2), [2.0, 0.0], method=mod.Radau, rtol=1e-6, atol=1e-8).t) < 1_200


def test_robertson() -> None:
    """Test set for IVP solvers (Mazzia, Magherini), problem ROBER at t = 1e11; concentrations are velocities here."""
    names = [sm.symbols(f"q{i} q{i}_dot") for i in (1, 2, 3)]
    (q1, a), (q2, b), (q3, c) = names
    slow, fast, middle = sm.Float("0.04") * a, 3 * 10**7 * b**2, 10**4 * b * c
    forces = {q1: middle - slow, q2: slow - middle - fast, q3: fast}
    model = eg.Model.from_lagrangian("robertson", (a**2 + b**2 + c**2) / 2, [q1, q2, q3], forces=forces)
    mod = model.compile(kernels=["rhs", "jacobian"])
    atol = np.array([1e30, 1e30, 1e30, 1e-16, 1e-20, 1e-12])
    found = solve_ivp(mod.rhs, (0, 1e11), [0, 0, 0, 1.0, 0, 0], method=mod.Radau, rtol=1e-8, atol=atol)
    assert found.success
    expected = [0.2083340149701255e-07, 0.8333360770334713e-13, 0.9999999791665050]
    np.testing.assert_allclose(found.y[3:, -1], expected, rtol=1e-5)


def test_euler_parameters_are_solved_without_halving() -> None:
    """q' = N(q) v: the state of a free body has one coordinate more than velocities."""
    m = eg.Model("top", gravity=(0, 0, -9.81))
    top = m.body("top", mass=1.0, com=(0, 0, 0.3), inertia=(0.01, 0.01, 0.004))
    m.spherical("ball", m.ground, top, rotation="euler_parameters")
    mod = m.compile()
    x0 = mod.x0(ball_e0=np.cos(0.2), ball_e1=np.sin(0.2), ball_wz=40.0)
    ours = mod.simulate(1.0, x0, method="Radau", rtol=1e-8, atol=1e-10, t_eval=[1.0])
    theirs = mod.simulate(1.0, x0, method="DOP853", rtol=1e-12, atol=1e-13, t_eval=[1.0])
    np.testing.assert_allclose(ours.x, theirs.x, rtol=0, atol=1e-6)


def test_closed_loops_and_inputs(module: Callable[..., Any]) -> None:
    mod = module("slider_crank")
    times, values = [0.0, 0.3, 0.5, 2.0], [0.0, 1.0, -0.5, 0.2]
    options = {"rtol": 1e-8, "atol": 1e-10, "t_eval": np.linspace(0, 1, 11)}
    ours = mod.simulate((0, 1), inputs={"tau": (times, values)}, method="Radau", **options)
    theirs = mod.simulate((0, 1), inputs={"tau": (times, values)}, method="DOP853", **options | {"rtol": 1e-11})
    np.testing.assert_allclose(ours.x, theirs.x, rtol=1e-5, atol=1e-5)


def test_inputs_that_depend_on_the_state() -> None:
    """A stiff controller as an input written as text is in the Jacobian that Newton's method takes."""
    m = eg.Model("controlled", gravity=(0, -9.81, 0))
    u = m.input("tau")
    pin = m.revolute("q", m.ground, m.body("rod", mass=1.0, com=(0.5, 0, 0), inertia={"zz": 0.1}))
    m.torque("motor", pin, u)
    mod = m.compile()
    options = {"rtol": 1e-7, "atol": 1e-9, "t_eval": [2.0]}
    law = "-1e6*(q - 0.3) - 1e4*q_dot"
    found = mod.simulate(2.0, {"q": 0.0}, inputs={"tau": law}, method="Radau", **options)
    assert abs(found["q"][-1] - (0.3 - 9.81 * 0.5 * np.cos(0.3) / 1e6)) < 1e-6
    steps = mod.simulate(2.0, {"q": 0.0}, inputs={"tau": law}, method="Radau", rtol=1e-7, atol=1e-9).t
    assert len(steps) < 400


def test_events_stop_a_run(module: Callable[..., Any]) -> None:
    mod = module("pendulum")

    def through(t: float, x: np.ndarray) -> float:
        return float(x[0])

    through.terminal = True  # type: ignore[attr-defined]
    ours = solve_ivp(mod.rhs, (0, 5), mod.x0(), method=mod.Radau, events=through, rtol=1e-9, atol=1e-11)
    theirs = solve_ivp(mod.rhs, (0, 5), mod.x0(), method="DOP853", events=through, rtol=1e-11, atol=1e-13)
    assert ours.status == theirs.status == 1
    np.testing.assert_allclose(ours.t_events[0], theirs.t_events[0], rtol=1e-7)


def test_any_other_function_or_jacobian_is_left_to_scipy(module: Callable[..., Any]) -> None:
    mod = module("double_pendulum")
    assert isinstance(mod.Radau(lambda t, y: -y, 0.0, [1.0], 1.0), scipy.integrate.Radau)
    assert isinstance(mod.Radau(mod.rhs, 0.0, mod.x0(), 1.0, jac=np.zeros((4, 4))), scipy.integrate.Radau)
    own = mod.Radau(mod.rhs, 0.0, mod.x0(), 1.0, jac=mod.jacobian)
    assert not isinstance(own, scipy.integrate.Radau)
    before = own.y
    own.step()
    assert own.y is not before


def test_a_failure_ends_the_run_and_is_named(module: Callable[..., Any]) -> None:
    mod = module("slider_crank")
    without_mass = mod.bind(dict.fromkeys(("m_c", "m_r", "m_s"), 0.0))
    solver = mod.Radau(without_mass.rhs, 0.0, mod.x0(), 1.0)
    assert "less than spacing" in solver.step()
    m = eg.Model("blow_up", gravity=(0, 0, 0))
    m.prismatic("q", m.ground, m.body("block", mass=1.0), axis="x")
    m.torque("push", "q", "q_dot**2")  # q' = 1 / (1 - t)
    grows = m.compile(kernels=None)
    with pytest.raises(eg.SimulationError, match="Radau stopped"):
        grows.simulate(2.0, {"q": 0.0, "q_dot": 1.0}, method="Radau")
