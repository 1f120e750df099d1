"""What the runs of an ensemble have in common with runs of simulate."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg

from .conftest import compiled
from .test_simulate_many import TIGHT, angles


@pytest.mark.parametrize("method", ["DOP853", "RK45", "RK23"])
def test_a_run_is_that_of_simulate_and_errs_no_more(pendulum: Any, method: str) -> None:
    options = {"max_step": 0.2, "method": method}
    ensemble = pendulum.simulate_many((1, -1), angles(13), rtol=1e-6, atol=1e-8, **options)
    alone = [pendulum.simulate((1, -1), **ensemble.case(j), rtol=1e-6, atol=1e-8, **options) for j in range(13)]
    exact = [pendulum.simulate((1, -1), **ensemble.case(j), rtol=1e-12, atol=1e-14) for j in range(13)]
    errors = np.array(
        [
            [np.abs(x - judge.x[:, -1]).max() for x in (ensemble.x[:, j], run.x[:, -1])]
            for j, (run, judge) in enumerate(zip(alone, exact, strict=True))
        ]
    )
    assert errors[:, 0].max() < 1.2 * errors[:, 1].max()
    assert np.median(errors[:, 0]) < 1.2 * np.median(errors[:, 1])
    steps = np.array([len(run.t) - 1 for run in alone])
    assert ((ensemble.steps >= steps) & (ensemble.steps <= 1.25 * steps + 1)).all()
    stages = {"DOP853": 12, "RK45": 6, "RK23": 3}[method]
    np.testing.assert_array_equal(ensemble.evaluations, 2 + stages * (ensemble.steps + ensemble.rejected))


@pytest.mark.parametrize("method", ["DOP853", "RK45", "RK23"])
def test_a_run_without_lanes_has_the_bits_of_simulate(method: str) -> None:
    pendulum = compiled("double_pendulum", "cython", 0)
    options = {"rtol": 1e-6, "atol": 1e-8, "max_step": 0.2, "method": method}
    ensemble = pendulum.simulate_many((1, -1), angles(13), **options)
    for j in range(13):
        run = pendulum.simulate((1, -1), **ensemble.case(j), **options)
        np.testing.assert_array_equal(run.x[:, -1], ensemble.x[:, j])
        assert len(run.t) - 1 == ensemble.steps[j]
        assert run.nfev == ensemble.evaluations[j]


def test_results_do_not_depend_on_threads_blocks_or_lanes(pendulum: Any, tmp_path: Path) -> None:
    k, times = 600, np.linspace(0, 2, 3)
    whole = pendulum.simulate_many(2, angles(k), t_eval=times, **TIGHT)
    one = pendulum.simulate_many(2, angles(k), t_eval=times, threads=1, block=7, **TIGHT)
    np.testing.assert_array_equal(whole.samples, one.samples)
    turned = {name: x[::-1] if np.ndim(x) else x for name, x in angles(k).items()}
    np.testing.assert_array_equal(pendulum.simulate_many(2, turned, **TIGHT).x[:, ::-1], whole.x)
    few = {name: x[5:8] if np.ndim(x) else x for name, x in angles(k).items()}
    np.testing.assert_array_equal(pendulum.simulate_many(2, few, **TIGHT).x, whole.x[:, 5:8])
    statistics = [
        pendulum.simulate_many(2, angles(k), t_eval=times, reduce="statistics", **options, **TIGHT).reduced
        for options in ({}, {"threads": 1, "block": 256})
    ]
    for name, value in statistics[0].items():
        np.testing.assert_array_equal(value, statistics[1][name])
    for lanes, near in ((0, 3e-8), (2, 1e-10)):  # one state at a time with the steps of simulate, and two
        module = compiled("double_pendulum", "cython", lanes)
        assert module.core.core.lane_width == max(lanes, 1)
        other = module.simulate_many(2, angles(600), t_eval=times, **TIGHT)
        np.testing.assert_allclose(other.samples, whole.samples, rtol=0, atol=near)
        again = module.simulate_many(2, turned, t_eval=times, threads=1, block=13, **TIGHT)
        np.testing.assert_array_equal(again.samples[..., ::-1], other.samples)


@pytest.mark.parametrize(("lanes", "near"), [(0, 0.0), (2, 1e-9), (None, 1e-9)])
def test_states_given_for_every_run_are_brought_onto_the_constraints(lanes: int | None, near: float) -> None:
    """Whole states (n_x, k), with parameters alike for all and not; without lanes to the last bit."""
    crank = compiled("slider_crank", "cython", lanes)
    closed = np.array([crank.x0(theta=a, theta_dot=5.0) for a in np.linspace(0.1, 1.0, 7)]).T
    given = closed + 1e-3 * np.random.default_rng(0).standard_normal(closed.shape)
    for parameters in ({}, {"m_s": np.linspace(0.3, 0.9, 7)}, {"r": np.linspace(0.0999, 0.1001, 7)}):
        ensemble = crank.simulate_many(0.3, given, parameters, t_eval=[0.0, 0.3], **TIGHT)
        assert ensemble.ok.all()
        for k in range(7):
            alone = crank.simulate(0.3, **ensemble.case(k), t_eval=[0.0, 0.3], **TIGHT)
            np.testing.assert_array_equal(ensemble.samples[:, 0, k], alone.x[:, 0])
            np.testing.assert_allclose(ensemble.samples[:, :, k], alone.x, rtol=near, atol=near)
            bound = crank.bind({name: x[k] for name, x in parameters.items()})
            assert np.abs(bound.constraints(ensemble.samples[: crank.n_q, 0, k], rows="all")).max() < 1e-12
        assert np.abs(ensemble.samples[:, 0] - given).max() < 0.1


def test_a_state_that_cannot_be_closed_holds_up_no_other(crank: Any) -> None:
    good = np.array([crank.x0(theta=a, theta_dot=5.0) for a in np.linspace(0.1, 1.0, 5)]).T
    states = np.insert(good, 2, 50.0, axis=1)
    ensemble = crank.simulate_many(0.3, states, **TIGHT)
    assert [failure.run for failure in ensemble.failures()] == [2]
    np.testing.assert_array_equal(np.delete(ensemble.x, 2, axis=1), crank.simulate_many(0.3, good, **TIGHT).x)


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_starts_at_which_a_closed_constraint_does_not_hold(target: str) -> None:
    """Such runs are marked with the words of simulate, and the others go on; states are taken as they are."""
    m = eg.Model("clutch")
    for name in ("a1", "b1"):
        m.revolute(name, m.ground, m.body(f"disc_{name}", mass=1.0, inertia={"zz": 0.3}), coordinate=name)
    m.parameter("off", 0.0)
    m.coupling("c", equation="a1 - b1 - off", opens="3 - t", closed=True)
    mod = m.compile(target=target)
    with pytest.raises(eg.UsageError, match="constraint c is closed at the start, and its equation") as refusal:
        mod.simulate(1.0, {"a1": 0.4})
    runs = mod.simulate_many(1.0, {"a1": [0.5, 0.4, 0.0], "b1": [0.5, 0.0, 0.0], "b1_dot": [0.0, 0.0, 1.0]})
    assert [bool(ok) for ok in runs.ok] == [True, False, False]
    told = {failure.run: failure.message for failure in runs.failures()}
    assert told[1] == str(refusal.value)
    assert "changes by -1 rad/s" in told[2]
    assert np.isnan(runs.x[:, 1]).all()
    np.testing.assert_allclose(runs.x[:2, 0], 0.5, atol=1e-12)
    later = mod.simulate_many(1.0, {"a1": [0.4, 0.4]}, {"off": [0.4, 0.3]})
    assert [bool(ok) for ok in later.ok] == [True, False]
    assert mod.simulate_many(1.0, {"a1": [0.5, 0.4], "c_closed": 1.0}).ok.all()
    assert mod.simulate_many(1.0, np.repeat(mod.x0(a1=0.4)[:, None], 2, axis=1)).ok.all()
