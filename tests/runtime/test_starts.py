"""The start of a run: what is found once for the same arguments is what each run would find, and costs few calls."""

from __future__ import annotations

import gc
import sys
from typing import Any

import numpy as np
import pytest
from models import EXAMPLES

import eomgen as eg

CALLS = 50  #: of Python and C in a run of one step; it took 203 and 231 before anything was kept, then 74 and 75
SHORT = (0.0, 1e-9)


@pytest.fixture(scope="module", params=["double_pendulum", "slider_crank"])
def module(request: pytest.FixtureRequest) -> Any:
    return eg.load(EXAMPLES / f"{request.param}.yaml").compile()


def test_a_start_takes_few_calls(module: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "IPython", raising=False)  # of other tests: it would be asked for a notebook
    module.simulate(SHORT)
    count = 0

    def note(frame: Any, event: str, argument: Any) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    gc.disable()  # a collection may come at any time, and what libraries hang on it would be counted
    sys.setprofile(note)
    try:
        module.simulate(SHORT)
    finally:
        sys.setprofile(None)
        gc.enable()
    assert count <= CALLS


@pytest.mark.parametrize("options", [{}, {"method": "RK45"}, {"rtol": 1e-5}, {"atol": 1e-6, "method": "Radau"}])
def test_runs_are_the_same_whether_found_again_or_read(module: Any, options: dict[str, Any]) -> None:
    """Events of none, a limit that limits nothing: arguments that are read one by one."""
    again = [module.bind().simulate(0.3, **options) for _ in range(2)]
    module.simulate(0.3, **options)
    found = [*again, module.simulate(0.3, **options), module.simulate(0.3, events=[], **options)]
    found += [module.simulate(0.3, max_step=np.inf, **options), module.simulate(0.3, inputs={}, **options)]
    for run in found[1:]:
        assert np.array_equal(run.t, found[0].t)
        assert np.array_equal(run.x, found[0].x)
        assert run.residuals == found[0].residuals
        for key in ("method", "rtol", "atol", "span", "nfev", "status", "parameters", "inputs"):
            assert run.metadata[key] == found[0].metadata[key], key


def test_runs_with_parameters_are_those_of_the_bound_module(module: Any) -> None:
    name = module.p_names[0]
    changed = {name: 1.1 * module._parameters[name]}
    module.simulate(0.2)
    one, other = module.simulate(0.2, parameters=changed), module.bind(changed).simulate(0.2)
    assert np.array_equal(one.x, other.x)
    assert not np.array_equal(one.x[:, -1], module.simulate(0.2).x[:, -1])
    assert one.metadata["parameters"][name] == changed[name]


def test_runs_with_parameters_leave_those_without_as_they_were(module: Any) -> None:
    first = module.simulate(0.5)
    changed = module.simulate(0.5, parameters=1.1 * module.p)
    assert not np.array_equal(changed.x[:, -1], first.x[:, -1])
    again = module.simulate(0.5)
    assert np.array_equal(again.x, first.x)
    assert again.metadata == first.metadata


def test_a_refusal_is_one_at_every_run(module: Any) -> None:
    module.simulate(SHORT)
    for options, words in (
        ({"rtol": -1.0}, "rtol must not be negative"),
        ({"method": "Euler"}, "Euler"),
        ({"method": "RK4"}, "needs step="),
        ({"rtol": True, "atol": "x"}, "atol"),
        ({"dense_output": 1}, "dense_output must be True or False"),
        ({"span": (0.0, np.nan)}, "span must be"),
    ):
        for _ in range(2):
            with pytest.raises(eg.UsageError, match=words):
                module.simulate(**{"span": SHORT, **options})


def test_a_tolerance_for_each_state(module: Any) -> None:
    """By the default method too; what is changed afterwards does not change what the run tells."""
    given = np.full(module.n_x, 1e-7)
    run = module.simulate(0.3, atol=given)
    given[:] = 1.0
    assert np.array_equal(run.x, module.simulate(0.3, atol=1e-7).x)
    assert run.metadata["atol"] == [1e-7] * module.n_x
    with pytest.raises(eg.UsageError, match="rtol"):
        module.simulate(0.3, rtol=np.full(module.n_x, 1e-7))


def test_many_tolerances_are_not_all_kept(module: Any) -> None:
    for k in range(40):
        module.simulate(SHORT, rtol=1e-6 * (1 + k))
    assert len(module._settled) <= 16
    assert module.simulate(SHORT, rtol=1e-6).metadata["rtol"] == 1e-6


def test_residuals_asked_for_late_are_those_of_the_run() -> None:
    """Of a short run they are evaluated when they are asked for: from its own states, not what became of a copy."""
    module = eg.load(EXAMPLES / "slider_crank.yaml").compile()
    run = module.simulate(1.0)
    x = run.x.copy()
    position = np.abs(module.constraints(x[: module.n_q], t=run.t, rows="all")).max()
    assert run.residuals.position == position
    assert run.metadata["residuals"]["position"] == position
    assert run.residuals.raw_position >= position
    changed = module.simulate(1.0)
    changed.x[:] = 0.0
    changed.t[:] = 0.0
    assert changed.residuals == run.residuals
    long = module.simulate(1.0, t_eval=np.linspace(0.0, 1.0, 3000))  # too many numbers to keep them twice
    assert long.residuals.position == np.abs(module.constraints(long.x[: module.n_q], t=long.t, rows="all")).max()
