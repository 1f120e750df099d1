"""Events by the hundred cost their number, not its square, where Python steps: all are evaluated side by side."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.runtime.numpy_core import NumpyTimed

MANY = 300
LEVELS = (np.linspace(0.0, 0.09, MANY) + 1e-3).tolist()


@pytest.fixture(scope="module")
def module() -> Any:
    m = eg.Model("many", gravity=(0.0, 0.0, 0.0))
    m.prismatic("s", m.ground, m.body("a", mass=1.0), axis="x")
    m.torque("f", "s", "-k*s + 0*u")
    m.parameter("k", 25.0)
    m.input("u")
    m.initial(s_dot=0.5)  # s = 0.1 sin 5 t
    for k, level in enumerate(LEVELS):
        m.event(f"e{k}", f"s - {level!r}")
    return m.compile(target="numpy")


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How often the kernel of the model's events was called."""
    count, real = [0], NumpyTimed.__call__

    def counted(self: NumpyTimed, *given: Any, **named: Any) -> Any:
        count[0] += self.name == "events"
        return real(self, *given, **named)

    monkeypatch.setattr(NumpyTimed, "__call__", counted)
    return count


@pytest.mark.parametrize("inputs", [{}, {"u": lambda t, x: 3.0 * t}])
def test_events_of_a_model_share_the_calls_of_their_kernel(
    module: Any, inputs: dict[str, Any], calls: list[int]
) -> None:
    run = module.simulate(1.0, inputs=inputs, rtol=1e-10, atol=1e-12)
    for k, level in enumerate(LEVELS):  # up and down within the first half period
        up = np.arcsin(level / 0.1) / 5.0
        np.testing.assert_allclose(run.t_events[k][:2], [up, np.pi / 5.0 - up], atol=1e-7)
        np.testing.assert_allclose(run.x_events[k][0], level, atol=1e-12)
    assert calls[0] < 80 * len(run.t)  # a few hundred zeros in turn would take thousands


def test_ida_asks_for_the_values_of_all_events_at_once(module: Any, calls: list[int]) -> None:
    pytest.importorskip("sksundae")
    run = module.dae.solve(0.3, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose([times[0] for times in run.t_events], np.arcsin(np.array(LEVELS) / 0.1) / 5.0, atol=1e-6)
    assert calls[0] < 20 * MANY  # each by itself: 300 for every look of IDA


def test_derivatives_ask_for_the_values_of_all_events_at_once(module: Any, calls: list[int]) -> None:
    run = module.sensitivities("k", 0.2)
    assert sum(len(times) for times in run.trajectory.t_events) > 200
    assert calls[0] < 100 * MANY  # the run stops at each of them


def straight(*, expression: str, **options: Any) -> Any:
    """A body at constant speed 1, and MANY events of the expression."""
    m = eg.Model("straight", gravity=(0.0, 0.0, 0.0))
    m.prismatic("s", m.ground, m.body("a", mass=1.0), axis="x")
    m.initial(s_dot=1.0)
    for k in range(MANY):
        m.event(f"e{k}", expression.format(1e-3 * (k + 1)), **options)
    return m.compile(target="numpy")


def test_values_that_leave_zero_are_followed_side_by_side(calls: list[int]) -> None:
    run = straight(expression="s*(s - {})").simulate(1.0, first_step=0.5)
    for k in range(MANY):
        np.testing.assert_allclose(run.t_events[k], [0.0, 1e-3 * (k + 1)], atol=1e-9)
    assert calls[0] < 20 * MANY  # each by itself: 26 looks for each


def test_values_after_a_reset_are_followed_side_by_side(calls: list[int]) -> None:
    run = straight(expression="s - 0.1", reset={"s_dot": "0.999*s_dot"}).simulate(1.0)
    assert all(len(times) == 1 for times in run.t_events)
    assert calls[0] < 20 * MANY


def test_texts_are_evaluated_in_one_pass(module: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from eomgen.graph.evaluate import Evaluator

    calls, real = [0], Evaluator.__call__

    def counted(self: Evaluator, values: Any) -> Any:
        calls[0] += 1
        return real(self, values)

    texts = {f"t{k}": f"s - {1.0 + level!r}" for k, level in enumerate(LEVELS)}  # never met
    monkeypatch.setattr(Evaluator, "__call__", counted)
    run = module.simulate(1.0, events=texts)
    assert all(len(run.t_events[name]) == 0 for name in texts)
    assert calls[0] < 10 * len(run.t)
    met = module.simulate(1.0, events={"one": f"s - {LEVELS[7]!r}", "two": "t - 0.25", "three": "s_dot*k"})
    assert met.t_events["one"][0] == pytest.approx(np.arcsin(LEVELS[7] / 0.1) / 5.0, abs=1e-6)
    np.testing.assert_allclose(met.t_events["two"], [0.25], atol=1e-12)
    np.testing.assert_allclose(met.t_events["three"], np.pi / 10.0 * np.array([1, 3]), atol=1e-6)
