"""Ensembles by device code compiled for the host: the steps and states of ``simulate``, run by run."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest

import eomgen as eg
from eomgen.cuda_functions import cuda_functions
from eomgen.errors import UsageError

TIGHT = {"rtol": 1e-10, "atol": 1e-10}


def pair(name: str, device: Any) -> tuple[Any, Any]:
    equations = eg.load(models.EXAMPLES / f"{name}.yaml").derive()
    return cuda_functions(equations, device), equations.compile()


def starts(module: Any, count: int = 4) -> np.ndarray:
    random = np.random.default_rng(1)
    x = module.x0()
    return np.array([module.project(x + 0.05 * random.normal(size=x.size)) for _ in range(count)]).T


@pytest.mark.parametrize("name", ["double_pendulum", "slider_crank", "satellite", "puma560"])
def test_dop853_takes_the_steps_of_simulate(name: str, device: Any) -> None:
    model, module = pair(name, device)
    x0, times = starts(module), np.linspace(0.0, 0.5, 6)
    runs = model.simulate_many((0.0, 0.5), x0, t_eval=times, method="DOP853", **TIGHT)
    assert runs.x.shape == x0.shape
    assert runs.samples is not None
    assert runs.samples.shape == (module.n_x, 6, 4)
    assert (runs.status == 0).all()
    assert name != "double_pendulum" or len(set(runs.rejected.tolist())) > 1  # each run has steps of its own
    for k in range(4):
        one = module.simulate((0.0, 0.5), x0[:, k], method="DOP853", **TIGHT)
        assert runs.steps[k] == len(one.t) - 1
        size = np.abs(one.x).max()
        np.testing.assert_allclose(runs.x[:, k], one.x[:, -1], rtol=0, atol=1e-9 * size)
        stored = module.simulate((0.0, 0.5), x0[:, k], method="DOP853", t_eval=times, **TIGHT)
        np.testing.assert_allclose(runs.samples[:, :, k], stored.x, rtol=0, atol=1e-9 * size)
        assert runs.evaluations[k] == stored.nfev


@pytest.mark.parametrize("name", ["double_pendulum", "slider_crank"])
def test_rk4_with_steps_of_one_size(name: str, device: Any) -> None:
    model, module = pair(name, device)
    x0 = starts(module)
    runs = model.simulate_many(0.25, x0, method="RK4", step=1e-3)
    assert (runs.steps == 250).all()
    assert (runs.rejected == 0).all()
    for k in range(4):
        one = module.simulate((0.0, 0.25), x0[:, k], method="RK4", step=1e-3)
        np.testing.assert_allclose(runs.x[:, k], one.x[:, -1], rtol=0, atol=1e-11 * np.abs(one.x).max())


def test_each_run_has_its_parameters_and_inputs(device: Any) -> None:
    model, module = pair("slider_crank", device)
    x0 = np.repeat(module.x0()[:, None], 3, axis=1)
    u, p = np.array([[0.0, 1.0, -1.0]]), np.repeat(model.p[:, None], 3, axis=1)
    p[model.p_names.index("m_s")] *= [1.0, 1.5, 2.0]
    runs = model.simulate_many((0.0, 0.2), device.foreign(x0), p, u, **TIGHT)
    for k in range(3):
        bound = module.bind(p=p[:, k], u=u[:, k])
        one = bound.simulate((0.0, 0.2), x0[:, k], method="DOP853", **TIGHT)
        np.testing.assert_allclose(runs.x[:, k], one.x[:, -1], rtol=0, atol=1e-8 * np.abs(one.x).max())
    assert np.ptp(runs.x[3]) > 0.01


def test_backwards_and_no_span(device: Any) -> None:
    model, module = pair("double_pendulum", device)
    x0 = starts(module)
    there = model.simulate_many((0.0, 0.3), x0, **TIGHT)
    back = model.simulate_many((0.3, 0.0), there.x, **TIGHT)
    np.testing.assert_allclose(back.x, x0, rtol=0, atol=1e-7)
    still = model.simulate_many((1.0, 1.0), x0)
    np.testing.assert_array_equal(still.x, x0)


def test_a_run_that_fails_is_marked_and_the_others_go_on(device: Any) -> None:
    model, module = pair("slider_crank", device)
    x0 = starts(module)
    good = model.simulate_many((0.0, 0.2), x0)
    x0[2, 1] = 9.0  # cannot be closed
    runs = model.simulate_many((0.0, 0.2), x0)
    np.testing.assert_array_equal(runs.x[:, [0, 2, 3]], good.x[:, [0, 2, 3]])
    assert runs.status.tolist() == [0, -100, 0, 0]
    assert runs.failure[1] > 0
    few = model.simulate_many((0.0, 0.2), good.x, max_steps=3)
    assert (few.status == -104).all()
    assert (few.steps == 3).all()


def bouncing(stop: bool) -> eg.Model:
    m = eg.Model("ball", gravity=(0, "-g", 0))
    m.parameter("g", 10.0)
    m.prismatic("h", m.ground, m.body("ball", mass=1.0), axis="y", coordinate="y")
    m.initial(y=1.0)
    if stop:
        m.event("floor", "y", direction=-1, terminal=2, reset={"y_dot": "-0.5*y_dot"})
    else:
        m.event("floor", "y", direction=-1, reset={"y_dot": "-0.5*y_dot"})
    return m


@pytest.mark.parametrize("stop", [False, True])
def test_events_reset_the_state_as_the_closed_form_says(stop: bool, device: Any) -> None:
    """A ball falls from h in sqrt(2 h/g) and leaves the floor with half the speed."""
    equations = bouncing(stop).derive()
    model, g = cuda_functions(equations, device), 10.0
    heights = np.array([1.0, 2.0, 0.5])
    x0 = np.array([heights, np.zeros(3)])
    end = 1.3 * float(np.sqrt(2 * 2.0 / g))
    runs = model.simulate_many((0.0, end), x0, **TIGHT)
    first = np.sqrt(2 * heights / g)
    assert runs.notes is not None
    np.testing.assert_allclose(runs.notes[1, 0], first, rtol=1e-9)
    second = 2 * first  # up and down with half the speed takes as long as the first fall
    happened = 1 + (second < end).astype(int) + (2.5 * first < end) + (2.75 * first < end)
    if stop:
        happened = np.minimum(happened, 2)
        assert runs.status.tolist() == (happened == 2).astype(int).tolist()
        np.testing.assert_allclose(runs.t, np.minimum(second, end), rtol=1e-9)
    else:
        np.testing.assert_array_equal(runs.noted, happened)
        assert (runs.status == 0).all()
    module = equations.compile()
    for k in range(3):
        one = module.simulate((0.0, end), x0[:, k], **TIGHT)
        np.testing.assert_allclose(runs.x[:, k], one.x[:, -1], rtol=0, atol=1e-8)


def test_what_a_device_cannot_run_is_refused_by_name(device: Any) -> None:
    model, module = pair("slider_crank", device)
    x0 = starts(module)
    with pytest.raises(UsageError, match="no method 'Radau' on a device; there are DOP853, RK4"):
        model.simulate_many(1.0, x0, method="Radau")
    with pytest.raises(UsageError, match="RK4 needs step="):
        model.simulate_many(1.0, x0, method="RK4")
    with pytest.raises(UsageError, match="t_eval must be times in order"):
        model.simulate_many(1.0, x0, t_eval=[2.0])
    with pytest.raises(UsageError, match=r"x0 must have shape \(6,\) or \(6, k\)"):
        model.simulate_many(1.0, x0.T)
    with pytest.raises(UsageError, match="x0 holds no states"):
        model.simulate_many(1.0, x0[:, :0])
    m = eg.Model("driven")
    m.prismatic("d", m.ground, m.body("mass", mass=1.0), axis="x", coordinate="x")
    m.input("F", signal="sin(t)")
    m.torque("push", "d", "F")
    driven = cuda_functions(m.derive(), device)
    with pytest.raises(UsageError, match="input F varies over time in the model"):
        driven.simulate_many(1.0, np.zeros((2, 1)))
