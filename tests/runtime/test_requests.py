"""What is asked of a run: wrong values are told by name, events without a value are told of, interrupts keep it."""

from __future__ import annotations

import ctypes
import math
import warnings
from itertools import product
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.operations import FUNCTION, OPERATIONS
from eomgen.runtime.tapes import DeclaredSignal


@pytest.fixture(scope="module", params=["cython", "numpy"])
def swing(request: pytest.FixtureRequest) -> Any:
    m = eg.Model("asked", gravity=(0, -9.81, 0))
    m.revolute("theta", m.ground, m.body("rod", mass=1, com=(0, -1, 0)))
    m.initial(theta=0.5)
    return m.compile(target=request.param)


def ending(times: Any) -> Any:
    def height(t: float, x: np.ndarray) -> float:
        return float(x[0])

    height.terminal = times  # type: ignore[attr-defined]
    return height


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"events": ending(-1)}, "event height: terminal must be true, false, or the number of events .* not -1"),
        ({"events": ending(1.5)}, "not 1.5"),
        ({"events": {"low": {"expression": "theta", "terminal": -2}}}, "event low: terminal .* not -2"),
        ({"events": {"low": {"expression": "theta", "terminal": "once"}}}, "event low: terminal .* not 'once'"),
        ({"method": "RK4", "step": [0.1]}, r"step must be a number of seconds, not \[0.1\]"),
        ({"method": "RK4", "step": "fine"}, "step must be a number, not 'fine'"),
        ({"method": "RK4", "step": -0.1}, "step must be greater than 0 s, not -0.1"),
        ({"t_eval": "all"}, "t_eval must be a list of times in seconds, not 'all'"),
        ({"t_eval": [0, "end"]}, "t_eval must be a number, not 'end'"),
        ({"t_eval": {0: 1}}, "t_eval must be a list of times"),
        ({"method": ["RK45"]}, r"method must be a name or a subclass of OdeSolver, not \['RK45'\]"),
        ({"method": 3}, "method must be a name"),
        ({"span": ("now", "then")}, r"span must be \(start, end\) in seconds"),
        ({"span": (0, None)}, r"span must be \(start, end\) in seconds"),
        ({"max_step": [1, 2]}, r"max_step must be a number of seconds, not \[1, 2\]"),
    ],
)
def test_wrong_values_are_named(swing: Any, asked: dict[str, Any], words: str) -> None:
    with pytest.raises(eg.UsageError, match=words):
        swing.simulate(**{"span": (0, 1), **asked})


@pytest.mark.parametrize(("times", "count"), [(True, 1), (2, 2), (2.0, 2), (np.int64(3), 3), (False, 4), (None, 4)])
def test_times_of_events(swing: Any, times: Any, count: int) -> None:
    """A rod of 1 m that swings from 0.5 rad is at the bottom every 1.02 s."""
    run = swing.simulate((0, 4.2), events=ending(times))
    assert len(run.t_events[0]) == count
    assert run.status == (1 if count < 4 else 0)


@pytest.mark.parametrize("method", ["DOP853", "BDF"])
def test_an_event_without_a_value_is_told_of(swing: Any, method: str) -> None:
    unknown = {"gap": "log(-1 - theta**2)", "low": "theta"}
    with pytest.warns(UserWarning, match="event gap: the value was not a number") as told:
        run = swing.simulate((0, 1.5), events=unknown, method=method)
    assert told[0].filename == __file__
    assert len(run.t_events["gap"]) == 0
    assert len(run.t_events["low"]) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        swing.simulate((0, 1.5), events={"now and then": "sqrt(theta)"}, method=method)  # NaN behind the bottom


@pytest.mark.parametrize("method", ["BDF", "LSODA", "RK45"])
@pytest.mark.parametrize("times", [None, np.linspace(0, 2, 9)])
def test_an_interrupt_keeps_the_run_of_any_method(swing: Any, method: str, times: Any) -> None:
    def press(t: float, x: np.ndarray) -> float:
        if t > 1.2:
            raise KeyboardInterrupt
        return 1.0

    with pytest.raises(eg.SimulationInterrupted, match=r"interrupted at t = 1\.") as stopped:
        swing.simulate((0, 2), events=press, method=method, t_eval=times)
    part = stopped.value.trajectory
    whole = swing.simulate((0, 2), method=method, dense_output=True)
    assert 0.9 < part.t[-1] <= 1.5
    assert (np.diff(part.t) > 0).all()
    np.testing.assert_allclose(part.x, whole.at(part.t).x, atol=1e-6)


def test_an_interrupt_after_a_corner_keeps_the_parts_before() -> None:
    m = eg.Model("pushed")
    m.prismatic("s", m.ground, body := m.body("b", mass=2), axis="x")
    m.force("push", body, (m.input("f"), 0, 0))
    mod = m.compile()

    def press(t: float, x: np.ndarray) -> float:
        if t > 1.2:
            raise KeyboardInterrupt
        return 1.0

    with pytest.raises(eg.SimulationInterrupted) as stopped:
        mod.simulate((0, 2), events=press, method="BDF", inputs={"f": eg.Signal([0, 1], [1, -1], "zero-order")})
    part = stopped.value.trajectory
    assert (np.diff(part.t) > 0).all()
    assert part.t[0] == 0.0
    assert 1.0 < part.t[-1] <= 1.5
    t = part.t
    expected = np.where(t < 1, t**2 / 4, 0.25 + 0.5 * (t - 1) - (t - 1) ** 2 / 4)
    np.testing.assert_allclose(part["s"], expected, atol=1e-6)


def test_tapes_leave_their_domain_as_c_does() -> None:
    """Every operation at awkward operands, beside the C library's own function of that name."""
    libm = ctypes.CDLL(None)
    awkward = [0.0, -0.0, 1.0, -1.0, 0.5, 2.0, -8.0, 1000.0, -1000.0, math.inf, -math.inf, math.nan]

    def played(name: str, *operands: float) -> float:
        code = [("const", k, 0, 0) for k in range(len(operands))]
        tape = [*code, (name, 0, len(operands) - 1, 0)], list(operands), [len(operands)]
        return DeclaredSignal(tape).function(np.empty(0))(0.0, np.empty(0))

    functions = {name: row.arity for name, row in OPERATIONS.items() if row.kind == FUNCTION}
    assert set(functions.values()) == {1, 2}
    for name, arity in functions.items():
        own = getattr(libm, name)
        own.restype, own.argtypes = ctypes.c_double, [ctypes.c_double] * arity
        for given in product(awkward, repeat=arity):
            np.testing.assert_array_equal(played(name, *given), own(*given), err_msg=f"{name}{given}")
    for a in awkward:
        for b in awkward:
            with np.errstate(all="ignore"):
                np.testing.assert_array_equal(played("div", a, b), np.float64(a) / np.float64(b))
                np.testing.assert_array_equal(played("min", a, b), np.minimum(a, b))
                np.testing.assert_array_equal(played("max", a, b), np.maximum(a, b))
    np.testing.assert_array_equal(played("sign", math.nan), math.nan)
