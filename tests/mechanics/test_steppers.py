"""Compiled steppers: the steps of SciPy, order and stability of Radau IIA, stiff problems of the literature."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import sympy as sm
from analysed import compiled
from scipy.integrate import solve_ivp
from sweeps import part_of

import eomgen as eg
from benchmarks.models import chain_with_joints


# -- Radau IIA ---------------------------------------------------------------------------------------------------------
def jacobian(mod: Any) -> Callable[[float, np.ndarray], np.ndarray]:
    return lambda t, x: mod.jacobian(t, np.ascontiguousarray(x))


@pytest.mark.parametrize("name", ["slider_crank", "stiff chain"])
def test_the_steps_of_scipys_radau(module: Callable[..., Any], name: str) -> None:
    if name == "stiff chain":
        model, x0 = chain_with_joints(4)
        mod = model.compile(target="numpy")
    else:
        mod = module(name, target="cython")
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
    module = compiled("oscillator", "cython")  # q'' = -k q - c q'
    for k, c, h in ((1.0, 0.1, 0.3), (1e8, 1e4, 0.1), (1e6, 0.0, 0.05)):
        mod = module.bind({"k": k, "c": c})
        x0 = np.array([1.0, -0.5])
        solver = mod.Radau(mod.rhs, 0.0, x0, 1.0, first_step=h, max_step=h, rtol=1e-2, atol=1e9)
        solver.step()
        assert solver.t == h
        Z, one = h * np.array([[0.0, 1.0], [-k, -c]]), np.eye(2)
        top = one + 0.4 * Z + Z @ Z / 20
        bottom = one - 0.6 * Z + 0.15 * Z @ Z - Z @ Z @ Z / 60
        expected = np.linalg.solve(bottom, top @ x0)
        np.testing.assert_allclose(solver.y, expected, rtol=1e-9, atol=1e-10 * np.abs(x0 * [1, np.sqrt(k)]).max())


def test_van_der_pol() -> None:
    """E. Hairer, G. Wanner, section IV.10 and their test set: eps = 1e-6, y(0) = (2, 0), values at t = 1 and 2."""
    q, v, eps = *sm.symbols("q q_dot"), sm.Rational(1, 10**6)
    model = eg.Model.from_lagrangian("van_der_pol", eps * v**2 / 2 - q**2 / 2, [q], forces={q: (1 - q**2) * v})
    mod = model.compile(target="numpy")
    known = {1.0: (-1.863646254808130, 0.7535430865435460), 2.0: (1.706167732170456, -0.8928097010248257)}
    for t, expected in known.items():
        found = solve_ivp(mod.rhs, (0, t), [2.0, 0.0], method=mod.Radau, rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(found.y[:, -1], expected, rtol=1e-10)
    assert len(solve_ivp(mod.rhs, (0, 2), [2.0, 0.0], method=mod.Radau, rtol=1e-6, atol=1e-8).t) < 1_200


@pytest.mark.thorough
def test_robertson() -> None:
    """Test set for IVP solvers (Mazzia, Magherini), problem ROBER at t = 1e11; concentrations are velocities here."""
    names = [sm.symbols(f"q{i} q{i}_dot") for i in (1, 2, 3)]
    (q1, a), (q2, b), (q3, c) = names
    slow, fast, middle = sm.Float("0.04") * a, 3 * 10**7 * b**2, 10**4 * b * c
    forces = {q1: middle - slow, q2: slow - middle - fast, q3: fast}
    model = eg.Model.from_lagrangian("robertson", (a**2 + b**2 + c**2) / 2, [q1, q2, q3], forces=forces)
    mod = model.compile(kernels=["rhs", "jacobian"], optimize=0)
    atol = np.array([1e30, 1e30, 1e30, 1e-16, 1e-20, 1e-12])
    found = solve_ivp(mod.rhs, (0, 1e11), [0, 0, 0, 1.0, 0, 0], method=mod.Radau, rtol=1e-8, atol=atol)
    assert found.success
    expected = [0.2083340149701255e-07, 0.8333360770334713e-13, 0.9999999791665050]
    np.testing.assert_allclose(found.y[3:, -1], expected, rtol=1e-5)


# -- Step by step ------------------------------------------------------------------------------------------------------
NAMES = (
    "pendulum", "cart_pendulum", "spherical_pendulum", "slider_crank", "four_bar", "peaucellier", "planetary_gear",
    "cam_follower", "rolling_disc", "bicycle",
)  # fmt: skip
TOLERANCES_agreement = {"DOP853": (1e-8, 1e-10), "RK45": (1e-7, 1e-9)}
END = 2.0


@pytest.mark.parametrize("name", part_of(NAMES, {"rolling_disc", "slider_crank"}.__contains__))
@pytest.mark.parametrize("method", TOLERANCES_agreement)
def test_steps_times_solutions_and_events(module: Callable[..., Any], name: str, method: str) -> None:
    mod = module(name, target="cython")
    rtol, atol = TOLERANCES_agreement[method]
    x0 = mod.x0()

    def middle(t: float, x: np.ndarray) -> float:
        return float(x[0] - x0[0] - 0.1 * np.sin(7.0 * t + 0.3))

    def rising(t: float, x: np.ndarray) -> float:
        return float(np.cos(5.0 * t) + 0.1 * x[-1])

    rising.direction = 1.0  # type: ignore[attr-defined]
    times = np.linspace(0, END, 101)
    options: dict[str, Any] = {"rtol": rtol, "atol": atol, "events": [middle, rising]}
    theirs, ours = (
        solve_ivp(mod.rhs, (0, END), x0, method=solver, dense_output=True, **options)
        for solver in (method, getattr(mod, method))
    )
    assert len(ours.t) == len(theirs.t) > 10
    assert ours.nfev == theirs.nfev
    np.testing.assert_allclose(ours.t, theirs.t, rtol=0, atol=1e-6 * END)
    size = np.abs(theirs.y).max()
    assert np.abs(ours.y - theirs.sol(ours.t)).max() < 1e-10 * size
    assert np.abs(ours.sol(times) - theirs.sol(times)).max() < 1e-10 * size
    sampled = [
        solve_ivp(mod.rhs, (0, END), x0, method=solver, t_eval=times, **options)
        for solver in (method, getattr(mod, method))
    ]
    np.testing.assert_array_equal(sampled[1].t, times)
    assert np.abs(sampled[1].y - sampled[0].y).max() < 1e-10 * size
    assert sum(map(len, theirs.t_events)) > 0
    for mine, scipys, states, their_states in zip(
        ours.t_events, theirs.t_events, ours.y_events, theirs.y_events, strict=True
    ):
        assert len(mine) == len(scipys)
        np.testing.assert_allclose(mine, scipys, rtol=0, atol=1e-10)
        np.testing.assert_allclose(states, their_states, rtol=0, atol=1e-9 * size)
    # the loop in C finds the same, events as functions included
    whole = mod.simulate((0, END), x0, method=method, **options)
    np.testing.assert_allclose(whole.t, ours.t, rtol=0, atol=1e-6 * END)  # it projects the start
    for mine, scipys in zip(whole.t_events, theirs.t_events, strict=True):
        assert len(mine) >= len(scipys)  # a value that comes to zero and back within a step is found, too
        nearest = np.abs(mine[:, None] - scipys[None, :]).min(axis=0) if len(scipys) else np.empty(0)
        assert (nearest < 1e-8).all()
