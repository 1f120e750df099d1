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


@pytest.mark.parametrize("inputs", [{}, {"u": lambda t, x: 3.0 * t}])
def test_events_of_a_model_share_the_calls_of_their_kernel(module: Any, inputs: dict[str, Any],
                                                           monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    calls, real = [0], NumpyTimed.__call__

    def counted(self: NumpyTimed, *given: Any, **named: Any) -> Any:
        calls[0] += self.name == "events"
        return real(self, *given, **named)

    monkeypatch.setattr(NumpyTimed, "__call__", counted)
    run = module.simulate(1.0, inputs=inputs, rtol=1e-10, atol=1e-12)
    for k, level in enumerate(LEVELS):  # up and down within the first half period
        up = np.arcsin(level / 0.1) / 5.0
        np.testing.assert_allclose(run.t_events[k][:2], [up, np.pi / 5.0 - up], atol=1e-7)
        np.testing.assert_allclose(run.x_events[k][0], level, atol=1e-12)
    assert calls[0] < 80 * len(run.t)  # a few hundred zeros in turn would take thousands


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
