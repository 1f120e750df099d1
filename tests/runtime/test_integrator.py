"""Integrators held ready: the same results as whole runs, each call as if it were the first."""

from __future__ import annotations

import copy
import os
import pickle
import signal
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg

EXAMPLES = Path(__file__).parents[2] / "examples"
TIGHT = {"rtol": 1e-10, "atol": 1e-12}


def spring(**options: Any) -> Any:
    """x'' = (F - k x) / m, which has a closed form."""
    m = eg.Model("spring")
    k, force = m.parameter("k", 9.0), m.input("F", 0.0)
    m.prismatic("J", m.ground, m.body("cart", mass=2), axis="x", coordinate="x")
    m.torque("push", "J", force - k * m.coordinate("x"))
    m.initial = {"x": 0.3}
    return m.compile(**options)


@pytest.fixture(scope="module", params=["cython", "numpy"])
def cart(request: pytest.FixtureRequest) -> Any:
    return spring(target=request.param)


@pytest.fixture(scope="module")
def compiled() -> Any:
    return spring()


@pytest.fixture(scope="module")
def four_bar() -> Any:
    return eg.load(EXAMPLES / "four_bar.yaml").compile()


def closed_form(x: Any, h: float, k: float = 9.0, force: float = 0.0) -> np.ndarray:
    w, rest = np.sqrt(k / 2.0), force / k
    a, b = x[0] - rest, x[1] / w
    return np.array([rest + a * np.cos(w * h) + b * np.sin(w * h), w * (b * np.cos(w * h) - a * np.sin(w * h))])


@pytest.mark.parametrize("method", ["DOP853", "RK45", "Radau", "LSODA"])
def test_the_closed_form(cart: Any, method: str) -> None:
    go = cart.integrator(method=method, **TIGHT)
    x = [0.3, -0.2]
    for h in (1.7, 0.01, -2.5, 0.0):
        np.testing.assert_allclose(go(5.0, x, h), closed_form(x, h), atol=2e-8)
        assert go.evaluations > 0 or h == 0.0


def test_parameters_and_inputs_of_a_call(cart: Any) -> None:
    go = cart.integrator(**TIGHT)
    x = np.array([0.3, 0.0])
    np.testing.assert_allclose(go(0.0, x, 1.0, u=[2.0]), closed_form(x, 1.0, force=2.0), atol=1e-8)
    np.testing.assert_allclose(go(0.0, x, 1.0, p=[4.0]), closed_form(x, 1.0, k=4.0), atol=1e-8)
    np.testing.assert_allclose(go(0.0, x, 1.0), closed_form(x, 1.0), atol=1e-8)  # and none stays behind
    held = cart.integrator({"k": 4.0}, {"F": 2.0}, **TIGHT)
    np.testing.assert_allclose(held(0.0, x, 1.0), closed_form(x, 1.0, 4.0, 2.0), atol=1e-8)


def test_out_may_be_the_state(cart: Any) -> None:
    go = cart.integrator(**TIGHT)
    x = np.array([0.3, 0.0])
    expected = go(0.0, x, 0.5)
    assert go(0.0, x, 0.5, out=x) is x
    np.testing.assert_array_equal(x, expected)


def test_states_that_are_no_numbers_are_told(cart: Any) -> None:
    with pytest.raises(eg.SimulationError, match="stopped near t = 0 s of 1 s"):
        cart.integrator()(0.0, [np.nan, 0.0], 1.0)


def test_a_first_step_may_be_longer_than_a_call(cart: Any) -> None:
    go = cart.integrator(first_step=0.5, **TIGHT)
    np.testing.assert_allclose(go(0.0, [0.3, 0.0], 0.1), closed_form([0.3, 0.0], 0.1), atol=1e-8)


@pytest.mark.parametrize("method", ["DOP853", "RK45", "RK23", "Taylor", "Radau"])
def test_calls_have_the_bits_of_whole_runs_and_forget_each_other(compiled: Any, method: str) -> None:
    go, x = compiled.integrator(method=method, **TIGHT), compiled.x0()
    first = go(0.0, x, 2.0)
    run = compiled.simulate((0.0, 2.0), x, t_eval=[2.0], method=method, **TIGHT)
    np.testing.assert_array_equal(first, run.x[:, -1])
    assert go.evaluations == run.nfev
    go(1.0, first, -30.0)
    np.testing.assert_array_equal(go(0.0, x, 2.0), first)


def test_steps_of_one_size(compiled: Any) -> None:
    go, x = compiled.integrator(method="RK4", step=0.01), compiled.x0()
    by_hand = x
    for k in range(10):
        by_hand = compiled.step(k * 0.01, by_hand, 0.01)
    np.testing.assert_allclose(go(0.0, x, 0.1), by_hand, rtol=1e-14)
    short = compiled.simulate((0.0, 1e-3), x, method="RK4", step=0.01)  # a run shorter than a step
    np.testing.assert_array_equal(short.x[:, -1], go(0.0, x, 1e-3))
    with pytest.raises(eg.UsageError, match="would not end"):
        go(0.0, x, 1e12)


def test_the_model_says_how(cart: Any) -> None:
    assert repr(cart.integrator()) == "<Integrator of spring: DOP853, rtol 1e-08>"


def test_calls_of_loops_have_the_bits_of_whole_runs(four_bar: Any) -> None:
    go, x = four_bar.integrator(**TIGHT), four_bar.x0()
    np.testing.assert_array_equal(go(0.0, x, 1.5), four_bar.simulate((0.0, 1.5), x, t_eval=[1.5], **TIGHT).x[:, -1])


def test_states_off_the_constraints_are_brought_onto_them_first(four_bar: Any) -> None:
    off = four_bar.x0()
    off[: four_bar.n_q] += 0.1
    go = four_bar.integrator(**TIGHT)
    found = four_bar.simulate((0.0, 0.5), off, t_eval=[0.5], **TIGHT).x[:, -1]
    np.testing.assert_array_equal(go(0.0, off, 0.5), found)
    np.testing.assert_allclose(go(0.0, off, 0.0), four_bar.project(off), atol=1e-12)


def test_mechanisms_without_freedom_are_refused() -> None:
    with pytest.raises(eg.UsageError, match="driven_slider_crank has no degree of freedom"):
        eg.load(EXAMPLES / "driven_slider_crank.yaml").compile().integrator()


def test_copies_work_apart(cart: Any) -> None:
    go, x = cart.integrator(**TIGHT), np.array([0.3, 0.0])
    for other in (copy.copy(go), pickle.loads(pickle.dumps(go))):
        np.testing.assert_array_equal(other(0.0, x, 1.0), go(0.0, x, 1.0))


def test_loops_stay_closed(four_bar: Any) -> None:
    go, x = four_bar.integrator(**TIGHT), four_bar.x0()
    energy = four_bar.energy(x).sum()
    for _ in range(50):
        x = go(0.0, x, 0.1)
        assert np.abs(four_bar.constraints(x[: four_bar.n_q])).max() < 1e-11
        assert np.abs(four_bar.velocity_constraints(x)).max() < 1e-10
    assert four_bar.energy(x).sum() == pytest.approx(energy, rel=1e-8)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (((0.0, [1.0], 1.0), {}), r"x must have shape \(2,\), not \(1,\)"),
        (((0.0, [1.0, 2.0], 1.0), {"u": [1.0, 2.0]}), r"u.* shape \(1,\)"),
        (((0.0, [1.0, 2.0], 1.0), {"p": [1.0, 2.0]}), r"p.* shape \(1,\)"),
        (((0.0, [1.0, 2.0], float("nan")), {}), "finite"),
        (((float("inf"), [1.0, 2.0], 1.0), {}), "finite"),
        (((0.0, {"x": 1.0}, 1.0), {}), "integrator of spring"),
        (((0.0, [1j, 2.0], 1.0), {}), "real numbers"),
        (((0.0, [1.0, 2.0], 1.0), {"out": np.zeros(3)}), r"out.* shape \(2,\)"),
        (((0.0, [1.0, 2.0], 1.0), {"out": [0.0, 0.0]}), r"out.* shape \(2,\)"),
        (((0.0, [1.0, 2.0], 1.0), {"out": np.zeros((1, 2))}), r"out.* shape \(2,\)"),
        (((0.0, [1.0, 2.0], 1.0), {"out": np.zeros(4)[::2]}), "out must be a contiguous"),
        (((0.0, [1.0, 2.0], 1.0), {"out": np.broadcast_to(0.0, (2,))}), "out must be a contiguous writeable"),
        (((0.0, [1.0, 2.0], 1.0), {"out": np.zeros(2, dtype=np.float32)}), "float64"),
        (((0.0, [1.0, 2.0], 1.0), {"p": {"kk": 1.0}}), "kk"),
        ((("0", [1.0, 2.0], 1.0), {}), "integrator of spring"),
        (((1e16, [1.0, 2.0], 1.0), {}), "too small at t"),
        (((1e308, [1.0, 2.0], 1e308), {}), "finite"),
    ],
)
def test_wrong_calls_are_told(cart: Any, call: Any, words: str) -> None:
    positional, named = call
    with pytest.raises(eg.UsageError, match=words):
        cart.integrator()(*positional, **named)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"metod": "RK45"}, "no option of integrator 'metod'; did you mean method"),
        ({"method": "RK99"}, "RK99"),
        ({"method": "RK4"}, "RK4 needs step="),
        ({"step": 0.1}, "no other method takes it"),
        ({"rtol": -1.0}, "rtol must not be negative"),
        ({"max_step": 0.0}, "max_step must be greater than 0"),
        ({"parameters": {"kk": 1.0}}, "kk"),
    ],
)
def test_wrong_options_are_told(cart: Any, asked: dict[str, Any], words: str) -> None:
    with pytest.raises(eg.UsageError, match=words):
        cart.integrator(**asked)


def test_a_state_that_is_reset_needs_a_run() -> None:
    m = eg.Model("ball", gravity=(0, -9.81, 0))
    m.prismatic("J", m.ground, m.body("ball", mass=1), axis="y", coordinate="y")
    m.initial = {"y": 1.0}
    m.event("bounce", "y", direction=-1, reset={"y_dot": -m.coordinate("y_dot")})
    with pytest.raises(eg.UsageError, match=r"events of ball reset its state.*simulate"):
        m.compile().integrator()


def make_root() -> Any:
    """A force that is no number where x < 0."""
    m = eg.Model("root")
    m.prismatic("J", m.ground, m.body("cart", mass=1), axis="x", coordinate="x")
    m.torque("pull", "J", -(m.coordinate("x") ** 0.5))
    return m.compile()


@pytest.mark.parametrize("method", ["DOP853", "Radau"])
def test_what_stops_a_call_is_named(method: str) -> None:
    m = eg.Model("wall")
    m.prismatic("J", m.ground, m.body("cart", mass=1), axis="x", coordinate="x")
    m.torque("pull", "J", -1 / (m.coordinate("x") * m.coordinate("x") ** 0.5))
    m.initial = {"x": 1.0}
    mod = m.compile()
    go = mod.integrator(method=method)
    with pytest.raises(eg.SimulationError, match=rf"{method} stopped at t = 2\.1781 s of 11 s"):
        go(1.0, mod.x0(), 10.0)
    root = make_root().integrator(method=method)
    with pytest.raises(eg.SimulationError, match=r"stopped near t = .* of 10 s. Last failure: rhs at .*x = ") as caught:
        root(0.0, [1.0, -1.0], 10.0)
    assert isinstance(caught.value.__cause__, eg.EvaluationError)
    x = np.array([1.0, -1.0])
    with pytest.raises(eg.SimulationError):
        root(0.0, x, 10.0, out=x)
    np.testing.assert_array_equal(x, [1.0, -1.0])  # a call that fails leaves it as it was
    np.testing.assert_allclose(go(1.0, mod.x0(), 0.1), mod.simulate((1.0, 1.1), method=method).x[:, -1], rtol=1e-6)


def test_an_interrupt_stops_a_long_call(compiled: Any) -> None:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        go = compiled.integrator(**TIGHT)
        with pytest.raises(KeyboardInterrupt):
            threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
            go(0.0, compiled.x0(), 1e9)
    finally:
        signal.signal(signal.SIGINT, before)
    np.testing.assert_allclose(go(0.0, [0.3, 0.0], 1.0), closed_form([0.3, 0.0], 1.0), atol=1e-8)


def test_one_thread_at_a_time(compiled: Any) -> None:
    go, refused = compiled.integrator(**TIGHT), []

    def disturb() -> None:
        while not refused:  # not at work yet
            try:
                go(0.0, compiled.x0(), 1e-3)
            except eg.UsageError as error:
                refused.append(str(error))
        os.kill(os.getpid(), signal.SIGINT)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            threading.Timer(0.1, disturb).start()
            while True:  # unless the other was at work for a moment
                with suppress(eg.UsageError):
                    go(0.0, compiled.x0(), 1e9)
    finally:
        signal.signal(signal.SIGINT, before)
    assert refused == [
        "integrator of spring: it is already working in another thread; make one integrator for each thread"
    ]
