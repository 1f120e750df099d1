"""Runs that end early: steps that lead nowhere, causes named by kernels, Ctrl-C, and what is kept of each."""

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from functools import cache
from itertools import product
from typing import Any

import models
import numpy as np
import pytest
from analysed import compiled
from refusals import refused, refuses
from scipy.integrate import quad
from sweeps import part_of

import eomgen as eg


@pytest.mark.parametrize("rotation", ["euler_angles", pytest.param("euler_parameters", marks=pytest.mark.thorough)])
def test_a_disc_that_falls_flat_ends_its_run(rotation: str) -> None:
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
    module = m.compile(target="numpy")
    with refused("EG-STALLED 50 'r': disc", eg.SimulationError) as caught:
        module.simulate(50)
    assert f"t = {falling:.5g}" in str(caught.value)


@cache
def sliding(target: str) -> Any:
    """A body of 1 kg with dry friction on a spring, by default none."""
    m = eg.Model("sliding")
    m.parameter("friction", 10.0), m.parameter("k", 0.0)
    m.prismatic("s", m.ground, body := m.body("b", mass=1), axis="x")
    m.force("law", body, ("-k*s - friction*sign(s_dot)", 0, 0))
    return m.compile(target=target)


@pytest.mark.parametrize(("method", "target"), [("DOP853", "cython"), ("RK45", "numpy"), ("LSODA", "cython")])
def test_a_friction_that_jumps_is_named(method: str, target: str) -> None:
    """A body of 1 kg at 1 m/s against 10 N stops after 0.1 s; from there the sign of its speed jumps."""
    with pytest.raises(eg.SimulationError) as caught:
        sliding(target).simulate(5, {"s_dot": 1.0}, method=method)
    words = str(caught.value)
    assert words.startswith(f"{method} stopped at t = 0.10000")
    assert ", s_dot = " in words
    assert "the rate of s_dot changes by 20 where s_dot changes by" in words
    assert "jumps (smooth it)" in words


@pytest.mark.parametrize(
    ("method", "target"),
    part_of(
        product(["DOP853", "RK45", "Radau", "BDF", "LSODA", "IDA", "sensitivities", "integrator"], ["cython", "numpy"]),
        lambda case: case in (("DOP853", "cython"), ("LSODA", "numpy"), ("integrator", "cython"), ("Radau", "cython")),
    ),
)
def test_a_sliding_mode_over_a_short_span_is_reported_in_seconds(method: str, target: str) -> None:
    """A spring that holds 1 N against 2 N of dry friction at rest: some 5e7 steps in 0.02 s."""
    module, start = sliding(target).bind({"friction": 2.0, "k": 3.0}), {"s": 1 / 3}
    asked: dict[str, Any] = {"t_eval": [0, 0.02]}
    begun = time.process_time()
    with refused("EG-STALLED 0.02", eg.SimulationError):
        if method == "IDA":
            module.dae.solve(0.02, start, **asked)
        elif method == "sensitivities":
            module.sensitivities(["s"], 0.02, start, **asked)
        elif method == "integrator":
            module.integrator()(0.0, module.x0(s_dot=1e-9, **start), 0.02)
        else:
            module.simulate(0.02, start | {"s_dot": 1e-9}, method=method, **asked)
    assert time.process_time() - begun < 30  # some 3 s


@pytest.mark.parametrize("method", ["DOP853", "LSODA"])
def test_a_run_into_a_pole_ends(method: str) -> None:
    """x'' = 1/(1 - t), whose velocity -ln(1 - t) has no end."""
    m = eg.Model("pole")
    m.prismatic("J", m.ground, m.body("b", mass=1), axis="x", coordinate="x")
    m.torque("push", "J", "1/(1 - t)")
    module, begun = m.compile(target="numpy"), time.process_time()
    refuses(f"EG-STALLED {method} 1 2", module.simulate, 2.0, method=method)
    assert time.process_time() - begun < 10  # some 0.5 s


def test_a_damped_run_backwards_ends() -> None:
    """The dampers of the governor make a motion grow tenfold every 0.3 ms backwards."""
    module, begun = eg.load_example("flyball_governor").compile(target="numpy"), time.process_time()
    refuses("EG-STALLED backwards -1", module.simulate, -1.0)
    assert time.process_time() - begun < 10  # some 1 s


def test_a_floor_without_rebound_is_no_accumulation() -> None:
    """A ball that falls 1 m stays on the floor from its first impact on, at sqrt(2/g)."""
    m = eg.Model("ball", gravity=(0, 0, -9.81))
    m.prismatic("z", m.ground, m.body("ball", mass=1), axis="z", coordinate="h")
    m.event("floor", "h", restitution=0)
    with refused(f"EG-ZENO floor {np.sqrt(2 / 9.81):.6g}") as caught:
        m.compile(target="numpy").simulate(2.0, {"h": 1.0})
    assert "Zeno" not in str(caught.value)


@pytest.mark.parametrize("method", ["DOP853", "RK45"])
def test_no_absolute_tolerance_of_a_state_that_is_0(method: str) -> None:
    """x'' = -x from x = 1 at rest, where every error is infinite in parts of the velocity; the run is x = cos(t)."""
    m = eg.Model("swing")
    m.prismatic("J", m.ground, m.body("b", mass=1), axis="x", coordinate="x")
    m.torque("spring", "J", "-x")
    m.initial(x=1.0)
    run = m.compile(target="numpy").simulate(1.0, method=method, rtol=1e-8, atol=0)
    assert run["x"][-1] == pytest.approx(np.cos(1.0), abs=1e-7)


def four_bar() -> eg.Model:
    m = eg.Model("four_bar")
    for name, value in (("w", 4.0), ("k", 1.0)):
        m.parameter(name, value)
    m.input("tau")
    a, b, c = (m.body(name, mass="sqrt(w)", inertia={"zz": "0.001*sqrt(w)"}) for name in ("crank", "coupler", "rocker"))
    models.join_four_bar(m, (a, b, c), (0.04, 0.12, 0.08, 0.1), "theta bend psi")
    m.torque("motor", "A", "tau")
    m.torque("law", "D", "-sqrt(k + psi)")
    m.guess(theta=1.0, bend=-0.7, psi=1.1)
    m.initial(theta=1.0)
    return m


@pytest.fixture(
    scope="module",
    params=[("auto", "numpy"), pytest.param(("augmented", "cython"), marks=pytest.mark.thorough)],
    ids=str,
)
def linkage(request: Any) -> Any:
    method, target = request.param
    return four_bar().compile(method=method, target=target)


CAUSES = [
    # parameters, added to x, inputs, error, what it tells
    ({"k": -9.0}, 0.0, [0.0], eg.NonFiniteError, "EG-NOT-FINITE loads law"),
    ({"w": 0.0}, 0.0, [0.0], eg.SingularMassMatrixError, "EG-SINGULAR theta inertia"),
    ({}, 1e200, [0.0], eg.NonFiniteError, "EG-NOT-FINITE squares theta_dot, bend_dot, psi_dot overflow"),
    ({}, 0.0, [np.nan], eg.NonFiniteError, "EG-NOT-FINITE input tau"),
    ({}, np.nan, [0.0], eg.NonFiniteError, "EG-NOT-FINITE theta = nan state"),
]


@pytest.mark.parametrize(("p", "added", "u", "error", "demand"), CAUSES, ids=str)
def test_the_cause_is_named(linkage: Any, p: Any, added: float, u: Any, error: type[Exception], demand: str) -> None:
    x = linkage.x0() + np.array([added] * linkage.n_x)
    if added == 1e200:
        x = np.where(np.arange(linkage.n_x) < 3, linkage.x0(), x)
    with refused(demand, error):
        linkage.bind(p=p).rhs(0.0, x, u=u)


@pytest.fixture(autouse=True)
def interrupts() -> Iterator[None]:
    """A process started in the background may ignore Ctrl-C."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def interrupt(call: Callable[[], Any], bound: float) -> Any:
    """The KeyboardInterrupt that ends a call, which may take so many seconds of the processor after Ctrl-C."""
    begun: list[float] = []

    def press() -> None:
        begun.append(time.process_time())
        os.kill(os.getpid(), signal.SIGINT)

    threading.Timer(0.2, press).start()
    with pytest.raises(KeyboardInterrupt) as stopped:
        call()
    assert time.process_time() - begun[0] < bound
    return stopped


def test_an_interrupt_keeps_what_there_was() -> None:
    mod = compiled("double_pendulum", "cython")
    mod.simulate((0, 1e-3))
    stopped = interrupt(lambda: mod.simulate((0, 1e5), rtol=1e-12, atol=1e-12), 0.1)
    assert isinstance(stopped.value, eg.SimulationInterrupted)
    part = stopped.value.trajectory
    assert 0.0 < part.t[-1] < 1e5
    assert len(part.t) > 50
    assert f"t = {part.t[-1]:.6g}" in str(stopped.value)
    few = part.t[:40]
    again = mod.simulate((0, few[-1]), rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(again.t[:39], few[:39])
    np.testing.assert_array_equal(again.x[:, :39], part.x[:, :39])


def test_an_interrupt_ends_an_ensemble() -> None:
    mod, starts = compiled("double_pendulum", "cython"), {"theta1": np.linspace(-1, 1, 4000)}
    interrupt(lambda: mod.simulate_many(1e4, starts, rtol=1e-10, atol=1e-12), 5.0)


def test_what_the_watch_or_a_handler_raises_comes_out() -> None:
    mod = compiled("double_pendulum", "cython")

    def alarm(number: int, frame: Any) -> None:
        raise TimeoutError("too long")

    before = signal.signal(signal.SIGALRM, alarm)
    try:
        with pytest.raises(TimeoutError, match="too long"):
            signal.setitimer(signal.ITIMER_REAL, 0.1)
            mod.simulate((0, 1e5), rtol=1e-12, atol=1e-12, t_eval=[1e5])
    finally:
        signal.signal(signal.SIGALRM, before)


@pytest.fixture(scope="module", params=["cython", "numpy"])
def swing(request: pytest.FixtureRequest) -> Any:
    return compiled("pendulum", request.param)


@pytest.mark.parametrize(("method", "times"), [("BDF", None), ("LSODA", np.linspace(0, 2, 9)), ("RK45", None)])
def test_an_interrupt_keeps_the_run_of_any_method(swing: Any, method: str, times: Any) -> None:
    def press(t: float, x: np.ndarray) -> float:
        if t > 1.2:
            raise KeyboardInterrupt
        return 1.0

    with pytest.raises(eg.SimulationInterrupted) as stopped:
        swing.simulate((0, 2), events=press, method=method, t_eval=times)
    part = stopped.value.trajectory
    assert (stopped.value.code, "t = 1." in str(stopped.value)) == ("EG-INTERRUPTED", True)
    whole = swing.simulate((0, 2), method=method, dense_output=True)
    assert 0.9 < part.t[-1] <= 1.5
    assert (np.diff(part.t) > 0).all()
    np.testing.assert_allclose(part.x, whole.at(part.t).x, atol=1e-6)
