"""Runs whose steps lead nowhere end in time, with what is to blame; short impacts and small steps asked for do not."""

from __future__ import annotations

import time

import numpy as np
import pytest
from scipy.integrate import quad

import eomgen as eg
from eomgen.simulation.stalling import MANY, WINDOW, Crawling, StallCheck


@pytest.mark.parametrize("target", ["cython", "numpy"])
@pytest.mark.parametrize("rotation", ["euler_angles", "euler_parameters"])
def test_a_disc_that_falls_flat_ends_its_run(rotation: str, target: str) -> None:
    """A thin disc that leans 0.2 rad at rest rolls about no axle: (m r^2/4 + m r^2) lean'' = m g r sin(lean)."""
    rate = lambda lean: np.sqrt(2 * 9.81 / 1.25 * (np.cos(0.2) - np.cos(lean)))  # noqa: E731
    # lean = 0.2 + s^2 takes the root out of the start
    falling = quad(lambda s: 2 * s / rate(0.2 + s * s), 0, np.sqrt(np.pi / 2 - 0.2))[0]
    m = eg.Model("disc", gravity=(0, 0, -9.81))
    m.rolling("r", disc := m.body("d", mass=1, inertia=(0.25, 0.25, 0.5)), radius=1)
    m.free("f", m.ground, disc, rotation=rotation)
    angle = np.pi / 2 - 0.2
    half = {"f_e0": np.cos(angle / 2), "f_e1": np.sin(angle / 2)}
    m.initial(**half if rotation == "euler_parameters" else {"f_1": angle})
    module = m.compile(target=target)
    with pytest.raises(eg.SimulationError, match=rf"t = {falling:.5g}\d* s of 50 s: constraint 'r': the disc lies"):
        module.simulate(50)


def sliding(law: str, **initial: float) -> eg.Model:
    m = eg.Model("sliding")
    m.prismatic("s", m.ground, body := m.body("b", mass=1), axis="x")
    m.force("law", body, (law, 0, 0))
    m.initial(**initial)
    return m


@pytest.mark.parametrize("target", ["cython", "numpy"])
@pytest.mark.parametrize("method", ["DOP853", "RK45", "LSODA"])
def test_a_friction_that_jumps_is_named(method: str, target: str) -> None:
    """A body of 1 kg at 1 m/s against 10 N stops after 0.1 s; from there the sign of its speed jumps."""
    module = sliding("-10*sign(s_dot)", s_dot=1.0).compile(target=target)
    with pytest.raises(eg.SimulationError) as caught:
        module.simulate(5, method=method)
    words = str(caught.value)
    assert words.startswith(f"{method} stopped at t = 0.10000")
    assert ", s_dot = " in words
    assert "the rate of s_dot changes by 20 where s_dot changes by" in words
    assert "jumps (smooth it)" in words


@pytest.mark.parametrize("target", ["cython", "numpy"])
@pytest.mark.parametrize("method", ["DOP853", "RK45", "Radau", "BDF", "LSODA", "IDA", "sensitivities", "integrator"])
def test_a_sliding_mode_over_a_short_span_is_told_in_seconds(method: str, target: str) -> None:
    """A spring that holds 1 N against 2 N of dry friction at rest: some 5e7 steps in 0.02 s."""
    m = sliding("-3*s - 2*sign(s_dot)", s=1 / 3)
    module = m.compile(target=target)
    for asked in ({}, {"t_eval": [0, 0.02]}):
        begun = time.perf_counter()
        with pytest.raises(eg.SimulationError, match="no progress|would take too long|Required step size"):
            if method == "IDA":
                module.dae.solve(0.02, **asked)
            elif method == "sensitivities":
                module.sensitivities(["s"], 0.02, **asked)
            elif method == "integrator":
                module.integrator()(0.0, module.x0(s_dot=1e-9), 0.02)
            else:
                module.simulate(0.02, {"s_dot": 1e-9}, method=method, **asked)
        assert time.perf_counter() - begun < 60  # alone, some 3 s


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_sticking_within_loose_tolerances_is_no_stall(target: str) -> None:
    """Steps of sticking that end soon, and a body that slides on at a moving belt's speed: x = 1 s at 2 m/s."""
    module = sliding("-10*sign(s_dot - 2)", s_dot=1.0).compile(target=target)
    run = module.simulate(0.3, rtol=1e-3, atol=1e-3)
    np.testing.assert_allclose(run["s"][-1], 0.15 + 2 * 0.2, atol=1e-3)  # 0.1 s up to the belt's speed


def test_sticking_that_leaves_few_steps_is_no_stall() -> None:
    """After 10 ns of a stiff state, some 4e8 steps of which would be left, friction holds for 10 us: 7e5 are left."""
    m = sliding("-3*s - mu*sign(s_dot)", s=1 / 3)
    m.state("z", initial=1.0, rate=f"-{m.input('k')}*z")
    m.input("mu")
    times = {"k": eg.Signal([0, 1e-8], [1e11, 0], "zero-order"), "mu": eg.Signal([0, 1e-5], [2, 0], "zero-order")}
    run = m.compile(target="numpy").simulate(2e-3, {"s_dot": 1e-9}, inputs=times, atol=3e-10)
    np.testing.assert_allclose(run["s_dot"][-1], -(2e-3 - 1e-5), rtol=1e-4)  # the spring pulls with 1 N from there


@pytest.mark.parametrize(("method", "rtol"), [("DOP853", 1e-12), ("RK23", 1e-8), ("LSODA", 1e-10)])
def test_hard_impacts_are_no_crawl(method: str, rtol: float) -> None:
    """A ball of 1 kg on a contact of 1e10 N/m: 31 us of touch (pi sqrt(m/k)) every 0.2 s, in a run of 20 s."""
    module = sliding("1e10*max(-s, 0) - 10", s=0.05).compile()
    traj = module.simulate(20, method=method, rtol=rtol, atol=rtol * 1e-3)
    touches = np.count_nonzero(np.diff(np.sign(traj["s_dot"])) > 0)
    assert touches == 100  # 0.1 s down, then 0.2 s from touch to touch
    assert traj["s"].min() < -0.9e-5


def test_what_counts_as_a_crawl() -> None:
    def walk(
        step: float, slide: float, troubled: bool = False, max_step: float = np.inf, end: float = 1.0
    ) -> StallCheck:
        check = StallCheck(0.0, end, np.array([1.0, 1.0]), 1, max_step, lambda t, x: troubled, lambda t, x: 0.0 * x)
        for k in range(1, 3 * WINDOW):
            check.look(k * step, np.array([1.0, 1.0 + k * slide]))
        return check

    for slide, troubled in ((0.0, False), (1e-9, False), (1e-2, True)):
        with pytest.raises(Crawling) as caught:
            walk(1e-9, slide, troubled)
        assert caught.value.step == pytest.approx(1e-9)
        assert caught.value.t == pytest.approx(WINDOW * 1e-9)
    walk(1e-9, 1e-2)  # the state moves
    walk(1e-9, 0.0, max_step=1e-9)  # as asked
    walk(1e-8, 0.0)  # long enough
    walk(1e-9, 0.0, end=1e-9 * MANY)  # soon there
