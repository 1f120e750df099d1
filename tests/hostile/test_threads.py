"""Eight threads on one module at once give what one thread gives, bit by bit; with and without the GIL."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.runtime.late import eager

EXAMPLES = Path(__file__).parents[2] / "examples"
THREADS = 8
SPAN = (0.0, 0.5)


@pytest.fixture(autouse=True)
def frequent_turns() -> Iterator[None]:
    """Threads take turns much more often than usual."""
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    yield
    sys.setswitchinterval(interval)


@pytest.fixture(scope="module")
def crank() -> Any:
    return eg.load(EXAMPLES / "slider_crank.yaml").compile()


def in_threads(task: Callable[[int], Any]) -> list[Any]:
    """What a task gives in each of the threads, which begin together; what one raises is raised here."""
    gate, results = threading.Barrier(THREADS), [None] * THREADS
    errors: list[BaseException] = []

    def work(k: int) -> None:
        try:
            gate.wait()
            results[k] = task(k)
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=work, args=(k,)) for k in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if errors:
        raise errors[0]
    return results


def agree(task: Callable[[int], Any]) -> None:
    """Every thread's arrays have the bits of those that this thread gets."""
    expected = [task(k) for k in range(THREADS)]
    for k, found in enumerate(in_threads(task)):
        assert len(found) == len(expected[k])
        for one, two in zip(found, expected[k], strict=True):
            np.testing.assert_array_equal(one, two)


def states(module: Any, k: int, count: int = 40) -> np.ndarray:
    random = np.random.default_rng(k)
    x = module.x0()
    return x[:, None] + 0.01 * random.normal(size=(len(x), count))


def test_calls_that_leave_their_work_to_the_next() -> None:
    module = eg.load_example("excavator").compile()
    assert eager(module.core).sizes["n_work"] > 1024, "work of this size is on the stack"
    start = states(module, 0)[:, 0].copy()
    expected = module.rhs(0.0, start)
    with pytest.raises(eg.EomgenError):
        module.rhs(0.0, np.full_like(start, 1e200))
    np.testing.assert_array_equal(module.rhs(0.0, start), expected)

    def task(k: int) -> list[Any]:
        columns = [np.ascontiguousarray(column) for column in states(module, k).T]
        return [module.rhs(0.0, x, p=module.p) if i % 2 else module.rhs(0.0, x) for i, x in enumerate(columns)]

    agree(task)


def test_kernels_and_batches(crank: Any) -> None:
    def task(k: int) -> list[Any]:
        x, n = states(crank, k), crank.n_q
        single = [crank.rhs(0.1, np.ascontiguousarray(column)) for column in x.T]
        p = crank.p * (1.0 + 0.01 * k)
        return [
            *single, crank.rhs(0.0, x), crank.rhs(0.0, x, p=p), crank.jacobian(0.0, x), crank.energy(x),
            crank.inverse_dynamics(x[:n], x[n:], x[n:]), crank.bind(p=p).rhs(0.0, x), crank.project(x),
        ]  # fmt: skip

    agree(task)


def test_lanes_that_all_threads_want_first() -> None:
    """The first large batches of all threads come at once: one compiles the lanes, none sees half of them."""
    arm = eg.load(EXAMPLES / "two_link_manipulator.yaml").compile()
    x = [states(arm, k, 5000) for k in range(THREADS)]
    found = in_threads(lambda k: [arm.rhs(0.0, x[k]), arm.mass_matrix(x[k][: arm.n_q])])
    assert arm.core.core.lane_width > 1
    for k, (rates, M) in enumerate(found):
        np.testing.assert_array_equal(rates, arm.rhs(0.0, x[k]))
        np.testing.assert_array_equal(M, arm.mass_matrix(x[k][: arm.n_q]))


@pytest.mark.parametrize("method", ["DOP853", "Radau", "LSODA"])
def test_simulations(crank: Any, method: str) -> None:
    def task(k: int) -> list[Any]:
        run = crank.simulate(SPAN, initial={"theta": 0.3 + 0.01 * k}, inputs={"tau": "0.1*sin(t)"}, method=method)
        return [run.t, run.x, run["pin_x" if "pin_x" in crank.y_names else crank.y_names[0]]]

    agree(task)


def test_one_solution_read_by_all(crank: Any) -> None:
    """Interpolants and whole solutions keep nothing of a call."""
    times = np.linspace(*SPAN, 301)
    x0, context = crank.x0(), crank.kernels.context
    n = len(x0)
    core = crank.core.core
    plan = {"nodes": [SPAN[1]], "t_eval": None, "dense": True, "events": None, "watch": None}
    settings = {"rtol": 1e-8, "atol": np.full(n, 1e-10), "max_step": np.inf}
    journey = core.journey("DOP853", context, *SPAN[:1], x0, SPAN[1], plan=plan, **settings)
    assert journey.travel() == 1
    journey.outcome()
    dense = journey.dense()
    stepper = core.stepper("DOP853", context, SPAN[0], x0, SPAN[1], **settings)
    assert stepper.step()
    inside = stepper.interpolant()
    within = np.linspace(inside.t_min, inside.t_max, 200)

    def task(k: int) -> list[Any]:
        return [dense(times[k:]), inside(within[k:]), *(inside(t) for t in within[:50])]

    agree(task)


def test_minimal_forms_remember_for_each_thread(crank: Any) -> None:
    """Newton's guesses of one thread are not those of another."""

    def task(k: int) -> list[Any]:
        x = crank.minimal.x0(theta=0.2 + 0.6 * k, theta_dot=3.0)
        rates = []
        for _ in range(60):
            rates.append(crank.minimal.rhs(0.0, x))
            x = x + 0.005 * rates[-1]
        return [*rates, crank.minimal.expand(x)]

    agree(task)
    crank.minimal.reset(crank.x0(theta=1.0)[: crank.n_q])
    start = in_threads(lambda k: crank.minimal.expand([1.0, 0.0]))  # new threads begin where it was set
    assert len({value.tobytes() for value in start}) == 1


def test_failures_of_many_threads_are_remembered_safely(crank: Any) -> None:
    """The record of the last failure is written and read by all at once."""
    kernel = crank.kernels.timed("rhs", nan=True)
    broken = np.full(crank.n_x, np.nan)

    def task(k: int) -> list[Any]:
        kinds = set()
        for _ in range(2000):
            kernel(float(k), broken)
            failure = kernel.failure
            kinds.add(failure is None or failure[0])
            if k % 2:
                kernel.failure = None
        return sorted(map(str, kinds))

    assert all(set(found) <= {"True", "1", "3"} for found in in_threads(task))


def test_ensembles_side_by_side(crank: Any) -> None:
    def task(k: int) -> list[Any]:
        found = crank.simulate_many(SPAN, count=9, initial={"theta": np.linspace(0.1, 0.4, 9) + 0.01 * k})
        return [found.x, found.status]

    agree(task)


def test_different_models_are_derived_side_by_side() -> None:
    names = ("pendulum", "slider_crank", "cart_pendulum", "double_pendulum", "four_bar", "spherical_pendulum")

    def task(k: int) -> list[Any]:
        module = eg.load(EXAMPLES / f"{names[k % len(names)]}.yaml").compile(target="numpy")
        return [module.rhs(0.0, module.x0())]

    agree(task)


def test_the_layer_keeps_the_gil_off(crank: Any) -> None:
    """In a Python without the GIL, importing a compiled module does not bring it back."""
    enabled = getattr(sys, "_is_gil_enabled", lambda: True)
    assert enabled() == ("free-threading" not in sys.version)
