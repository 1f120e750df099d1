"""Compiled steppers against SciPy's own: the same steps, the same dense output, the same rules."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.integrate
from children import child
from scipy.integrate import solve_ivp

import eomgen as eg

METHODS = ["DOP853", "RK45", "RK23"]
TOLERANCES = {"DOP853": (1e-7, 1e-9), "RK45": (1e-7, 1e-9), "RK23": (1e-5, 1e-7)}


@pytest.mark.parametrize("name", ["double_pendulum", "slider_crank"])
@pytest.mark.parametrize("method", METHODS)
def test_the_steps_of_scipy(module: Callable[..., Any], name: str, method: str) -> None:
    mod, (rtol, atol) = module(name), TOLERANCES[method]
    x0 = mod.x0()
    theirs = solve_ivp(mod.rhs, (0, 2), x0, method=method, rtol=rtol, atol=atol, dense_output=True)
    ours = solve_ivp(mod.rhs, (0, 2), x0, method=getattr(mod, method), rtol=rtol, atol=atol, dense_output=True)
    assert len(ours.t) == len(theirs.t)
    assert ours.nfev == theirs.nfev
    # where the estimate of the error is all rounding, the next step follows the rounding
    np.testing.assert_allclose(ours.t, theirs.t, rtol=1e-4)
    assert np.abs(theirs.sol(ours.t) - ours.y).max() < 100 * rtol
    times = np.linspace(0, 2, 97)
    np.testing.assert_allclose(ours.sol(times), theirs.sol(times), rtol=10 * rtol, atol=10 * rtol)
    whole = mod.simulate((0, 2), x0, method=method, rtol=rtol, atol=atol)
    np.testing.assert_allclose(whole.t, ours.t, rtol=1e-12)
    asked = mod.simulate((0, 2), x0, method=method, rtol=rtol, atol=atol, t_eval=times)
    np.testing.assert_array_equal(asked.t, times)
    np.testing.assert_allclose(asked.x, ours.sol(times), rtol=100 * rtol, atol=100 * rtol)  # projected
    dense = mod.simulate((0, 2), x0, method=method, rtol=rtol, atol=atol, dense_output=True)
    np.testing.assert_allclose(dense.at(times).x, asked.x, rtol=1e-12, atol=1e-12)
    assert dense.nfev == ours.nfev


@pytest.mark.parametrize("method", METHODS)
def test_backwards_with_limits_on_the_steps(module: Callable[..., Any], method: str) -> None:
    mod = module("double_pendulum")
    limits = {"max_step": 0.03, "first_step": 1e-3, "rtol": 1e-6, "atol": 1e-8}
    theirs = solve_ivp(mod.rhs, (1, 0), mod.x0(), method=method, **limits)
    ours = solve_ivp(mod.rhs, (1, 0), mod.x0(), method=getattr(mod, method), **limits)
    np.testing.assert_allclose(ours.t, theirs.t, rtol=1e-7, atol=1e-9)
    assert np.abs(np.diff(ours.t)).max() <= 0.03 * (1 + 1e-12)
    times = np.linspace(0.9, 0.1, 7)
    asked = mod.simulate((1, 0), mod.x0(), method=method, t_eval=times, **limits)
    np.testing.assert_array_equal(asked.t, times)
    np.testing.assert_allclose(mod.simulate((1, 0), mod.x0(), method=method, **limits).x, ours.y, rtol=1e-9, atol=1e-9)


def test_events_of_plain_scipy(module: Callable[..., Any]) -> None:
    mod = module("pendulum")

    def through(t: float, x: np.ndarray) -> float:
        return float(x[0])

    through.terminal = True  # type: ignore[attr-defined]
    options = {"events": through, "rtol": 1e-9, "atol": 1e-11}
    theirs = solve_ivp(mod.rhs, (0, 5), mod.x0(), method="DOP853", **options)
    ours = solve_ivp(mod.rhs, (0, 5), mod.x0(), method=mod.DOP853, **options)
    assert ours.status == theirs.status == 1
    np.testing.assert_allclose(ours.t_events[0], theirs.t_events[0], rtol=1e-9)


def test_any_other_function_is_called_and_not_replaced(module: Callable[..., Any]) -> None:
    mod = module("double_pendulum")
    decay = solve_ivp(lambda t, y: -y, (0, 1), [1.0, 2.0], method=mod.DOP853, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(decay.y[:, -1], np.exp(-1) * np.array([1.0, 2.0]), rtol=1e-9)
    assert isinstance(mod.RK45(lambda t, y: -y, 0.0, [1.0], 1.0), scipy.integrate.RK45)
    heavy = mod.bind({"m_2": 3.0} if "m_2" in mod.p_names else {mod.p_names[0]: 3.0})
    solver = mod.DOP853(heavy.rhs, 0.0, mod.x0(), 1.0, rtol=1e-8, atol=1e-10)
    solver.step()
    theirs = scipy.integrate.DOP853(heavy.rhs, 0.0, mod.x0(), 1.0, rtol=1e-8, atol=1e-10)
    theirs.step()
    np.testing.assert_allclose(solver.y, theirs.y, rtol=1e-12)
    before = solver.y
    solver.step()
    assert solver.y is not before  # solve_ivp keeps each


def test_inputs_from_tables(module: Callable[..., Any]) -> None:
    mod = module("slider_crank")
    times, values = [0.0, 0.3, 0.5, 2.0], [0.0, 1.0, -0.5, 0.2]
    options = {"rtol": 1e-10, "atol": 1e-12, "t_eval": np.linspace(0, 1, 21)}
    ours = mod.simulate((0, 1), inputs={"tau": (times, values)}, **options)
    theirs = mod.simulate((0, 1), inputs={"tau": lambda t, x: float(np.interp(t, times, values))}, **options)
    np.testing.assert_allclose(ours.x, theirs.x, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"max_step": -1}, "max_step must be greater than 0"),
        ({"first_step": 100.0}, "first_step must not exceed the span of 1 s"),
        ({"atol": [1e-6, 1e-6, 1e-6]}, "one for each state"),
        ({"rtol": -1e-3}, "must not be negative"),
        ({"max_steps": 3}, "did you mean max_step"),
    ],
)
def test_wrong_options(module: Callable[..., Any], options: dict[str, Any], words: str) -> None:
    with pytest.raises(eg.UsageError, match=words):
        module("double_pendulum").simulate((0, 1), **options)


def test_a_failure_ends_the_run_and_is_named(module: Callable[..., Any]) -> None:
    mod = module("slider_crank")
    without_mass = mod.bind(dict.fromkeys(("m_c", "m_r", "m_s"), 0.0))
    solver = mod.DOP853(without_mass.rhs, 0.0, mod.x0(), 1.0)
    assert "less than spacing" in solver.step()
    assert solver.status == "failed"


LONG = """
import sys, numpy as np, eomgen as eg
mod = eg.load(sys.argv[1]).compile()
print("ready", flush=True)
try:
    mod.simulate((0, 1e6), rtol=1e-12, atol=1e-12, t_eval=[1e6])
except KeyboardInterrupt:
    print("stopped")
"""


def test_an_interrupt_is_heard() -> None:
    model = Path(__file__).parents[2] / "examples" / "double_pendulum.yaml"
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n" + LONG
    command = [sys.executable, "-c", code, str(model)]
    with child(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "ready\n"
        time.sleep(0.3)
        begun = time.perf_counter()
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=30)[0] == "stopped\n"
    assert time.perf_counter() - begun < 2.0  # its own share is a few hundredths; the rest is leaving Python
