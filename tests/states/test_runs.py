"""Runs of models with first-order states: every stepper, events, sensitivities and ensembles, against SciPy."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import eomgen as eg

M, K, C, G = 2.0, 4.0, 2.5, 3.0


def lag(events: bool = False, tau: float = 0.5) -> eg.Model:
    """A mass on a spring, a lag of first order behind it, and a force in proportion to the lag's value."""
    m = eg.Model("lag")
    m.parameter("k", K)
    m.parameter("tau", tau, unit="s")
    m.input("F")
    m.prismatic("s", m.ground, m.body("b", mass=M), axis="x")
    m.actuator("law", "s", value=f"-k*s - {C}*s_dot + F - {G}*a")
    m.state("a", "(s - a)/tau", initial=0.2)
    m.output("y", "a + s")
    m.output("rates", "a_dot + s_ddot")
    m.initial(s=0.1)
    if events:
        m.event("hit", "s - 0.05", direction=-1, reset={"a": "a + 0.5"})
        m.event("low", "a - 0.15", direction=-1)
    return m


@cache
def compiled(target: str = "cython", events: bool = False) -> Any:
    return lag(events).compile(target=target)


def matrix(k: float = K, tau: float = 0.5) -> np.ndarray:
    return np.array([[0, 1, 0], [-k / M, -C / M, -G / M], [1 / tau, 0, -1 / tau]])


ALONE = ("DOP853", "RK45", "RK23", "Radau", "BDF", "LSODA")  #: methods that need no compiled code


@pytest.mark.parametrize(
    ("target", "method"),
    [*(("cython", method) for method in (*ALONE, "Taylor", "RK4")), *(("numpy", method) for method in ALONE)],
)
def test_every_stepper_finds_the_matrix_exponential(target: str, method: str) -> None:
    mod = compiled(target)
    options: dict[str, Any] = {"step": 1e-3} if method == "RK4" else {"rtol": 1e-9, "atol": 1e-11}
    traj = mod.simulate(2.0, method=method, **options)
    x = expm(2.0 * matrix()) @ [0.1, 0.0, 0.2]
    np.testing.assert_allclose(traj.x[:, -1], x, atol=2e-7)
    rates = matrix() @ x
    assert [traj[name][-1] for name in ("a", "a_dot", "y")] == pytest.approx([x[2], rates[2], x[2] + x[0]], abs=1e-6)
    assert traj["rates"][-1] == pytest.approx(rates[2] + rates[1], abs=1e-6)


def test_the_answer_to_a_sine_is_that_of_the_transfer_function() -> None:
    w, mod = 1.7, compiled()
    times = np.linspace(100.0, 120.0, 400)
    traj = mod.simulate(120.0, inputs={"F": lambda t, x: np.sin(w * t)}, t_eval=times, rtol=1e-9)
    s = 1j * w
    lagged = 1 / (1 + 0.5 * s)
    answer = lagged / (M * s**2 + C * s + K + G * lagged)
    np.testing.assert_allclose(traj["a"], np.imag(answer * np.exp(s * traj.t)), atol=1e-6)


def test_jacobians_and_taylor_steps_know_states() -> None:
    for target in ("cython", "numpy"):
        mod = compiled(target)
        x = np.array([0.3, -0.2, 0.7])
        np.testing.assert_allclose(mod.jacobian(0.0, x), matrix(), rtol=1e-14, atol=1e-15)
        np.testing.assert_allclose(mod.input_jacobian(0.0, x), [[0.0], [1 / M], [0.0]], atol=1e-15)
        by_tau = -(x[0] - x[2]) / 0.25
        np.testing.assert_allclose(mod.parameter_jacobian(0.0, x), [[0, 0], [-x[0] / M, 0], [0, by_tau]], atol=1e-14)


def with_events(parameters: dict[str, float] | None = None, start: tuple[float, ...] = (0.1, 0.0, 0.2)) -> np.ndarray:
    """The end at t = 3 by SciPy's own events; s passes 0.05 downwards once."""
    A = matrix(**(parameters or {}))
    hit: Any = lambda t, x: x[0] - 0.05  # noqa: E731
    hit.terminal, hit.direction = True, -1
    tight = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
    first = solve_ivp(lambda t, x: A @ x, (0, 3), start, events=hit, **tight)
    x = first.y[:, -1] + [0, 0, 0.5]
    assert first.status == 1
    return np.asarray(solve_ivp(lambda t, x: A @ x, (first.t[-1], 3), x, **tight).y[:, -1])


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_events_see_states_and_reset_them(target: str) -> None:
    traj = compiled(target, events=True).simulate(3.0, rtol=1e-10, atol=1e-12)
    assert [len(times) for times in traj.t_events] == [1, 2]
    np.testing.assert_allclose(traj.x[:, -1], with_events(), atol=1e-8)


def test_sensitivities_go_through_resets_of_states() -> None:
    found = compiled(events=True).sensitivities(["tau", "k", "a"], 3.0, rtol=1e-10, atol=1e-12)
    h = 1e-5
    ends = {
        "tau": [with_events({"tau": 0.5 + sign * h}) for sign in (1, -1)],
        "k": [with_events({"k": K + sign * h}) for sign in (1, -1)],
        "a": [with_events(start=(0.1, 0.0, 0.2 + sign * h)) for sign in (1, -1)],
    }
    for by, (ahead, behind) in ends.items():
        slope = (ahead - behind) / (2 * h)
        np.testing.assert_allclose([found[name, by][-1] for name in ("s", "s_dot", "a")], slope, atol=2e-5)


def test_many_runs_are_single_runs() -> None:
    mod = compiled(events=True)
    taus, starts = np.array([0.4, 0.5, 0.6, 0.7, 0.9]), np.array([0.1, 0.2, 0.3, 0.05, 0.0])
    many = mod.simulate_many(3.0, parameters={"tau": taus}, initial={"a": starts})
    alone = lag(events=True).compile(lanes=0).simulate_many(3.0, parameters={"tau": taus}, initial={"a": starts})
    for k, (tau, a) in enumerate(zip(taus, starts, strict=True)):
        single = mod.simulate(3.0, parameters={"tau": tau}, initial={"a": a}).x[:, -1]
        np.testing.assert_array_equal(alone.x[:, k], single)
        np.testing.assert_allclose(many.x[:, k], single, rtol=0.0, atol=1e-8)


def test_trajectories_keep_states(tmp_path: Path) -> None:
    mod = compiled()
    traj = mod.simulate(1.0)
    traj.save(tmp_path / "run.npz")
    read = eg.load_trajectory(tmp_path / "run.npz")
    np.testing.assert_array_equal(read["a"], traj["a"])
    frame = traj.to_pandas()
    np.testing.assert_array_equal(frame["a"], traj["a"])
    assert "a_dot" in frame.columns
    onwards = mod.simulate((1.0, 2.0), initial=traj)
    assert onwards["a"][0] == traj["a"][-1]
    np.testing.assert_allclose(onwards.x[:, -1], expm(2.0 * matrix()) @ [0.1, 0, 0.2], atol=1e-7)
    assert mod.simulate(0.1, initial=np.array([0.0, 0.0, 0.9]))["a"][0] == 0.9


def test_steps_of_an_integrator_carry_states() -> None:
    mod = compiled()
    x = mod.integrator(rtol=1e-10, atol=1e-12)(0.0, mod.x0(), 0.7)
    np.testing.assert_allclose(x, expm(0.7 * matrix()) @ [0.1, 0, 0.2], atol=1e-9)
    h = 0.01
    np.testing.assert_allclose(mod.step(0.0, mod.x0(), h), expm(h * matrix()) @ [0.1, 0, 0.2], atol=1e-9)
    found = solve_ivp(mod.rhs, (0, 2), mod.x0(), method=mod.DOP853, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(found.y[:, -1], expm(2.0 * matrix()) @ [0.1, 0, 0.2], atol=1e-9)


def test_the_differential_algebraic_form_has_the_same_motion() -> None:
    mod = compiled()
    form = mod.dae
    y, rates = form.initial(mod.x0())
    assert np.abs(form.residual(0.0, y, rates)).max() < 1e-13
    np.testing.assert_allclose(rates[:3], matrix() @ mod.x0(), atol=1e-14)


def test_a_driven_mechanism_integrates_its_states() -> None:
    """s = 0.1 sin 3 t is prescribed; a' = s' - 4 a has a closed form."""
    m = eg.Model("driven")
    m.prismatic("s", m.ground, m.body("b", mass=1.0))
    m.driver("d", "s", "0.1*sin(3*t)")
    m.state("a", "s_dot - 4*a")
    traj = m.compile().simulate(1.0, rtol=1e-10, atol=1e-12)
    exact = 0.3 * (4 * np.cos(3 * traj.t) + 3 * np.sin(3 * traj.t) - 4 * np.exp(-4 * traj.t)) / 25
    np.testing.assert_allclose(traj["a"], exact, atol=1e-9)
    np.testing.assert_allclose(traj["s"], 0.1 * np.sin(3 * traj.t), atol=1e-12)


def test_an_impact_leaves_states_alone() -> None:
    m = eg.Model("bounce", gravity=(0, 0, -9.81))
    m.prismatic("z", m.ground, m.body("b", mass=1.0), axis="z")
    m.state("h", "vz(b) - 2*h")
    m.event("floor", "z", restitution=0.8)
    m.initial(z=1.0)
    traj = m.compile().simulate(1.0, rtol=1e-10, atol=1e-12)
    fall = float(np.sqrt(2 / 9.81))
    flight: Any = lambda t, x: [x[1], -9.81, x[1] - 2 * x[2]]  # noqa: E731
    before = solve_ivp(flight, (0, fall), [1, 0, 0], rtol=1e-11, atol=1e-13).y[:, -1]
    after = solve_ivp(flight, (fall, 1), [0, -0.8 * before[1], before[2]], rtol=1e-11, atol=1e-13).y[:, -1]
    np.testing.assert_allclose(traj.x[:, -1], after, atol=1e-8)


def test_parts_of_a_trajectory() -> None:
    traj = compiled().simulate(0.2)
    np.testing.assert_array_equal(traj.s[0], traj["a"])
    np.testing.assert_array_equal(traj.v[0], traj["s_dot"])
    assert (traj.q.shape[0], traj.v.shape[0], traj.s.shape[0]) == (1, 1, 1)
