"""Eight threads on one module at once give what one thread gives, bit by bit; many models leave nothing behind."""

import gc
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from analysed import compiled

import eomgen as eg

THREADS = 8
SPAN = (0.0, 0.1)
TARGETS = pytest.mark.parametrize("crank", ["cython", pytest.param("numpy", marks=pytest.mark.thorough)], indirect=True)


@pytest.fixture(autouse=True)
def frequent_turns() -> Iterator[None]:
    """Threads take turns much more often than usual."""
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    yield
    sys.setswitchinterval(interval)


@pytest.fixture(scope="module")
def crank(request: pytest.FixtureRequest) -> Any:
    return compiled("slider_crank", request.param)


def agree(task: Callable[[int], Any]) -> None:
    """Every thread's arrays have the bits of those that this thread gets; all begin together."""
    expected = [task(k) for k in range(THREADS)]
    gate, results, errors = threading.Barrier(THREADS), [None] * THREADS, []

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
    assert not errors
    for found, right in zip(results, expected, strict=True):
        for one, two in zip(found, right, strict=True):
            np.testing.assert_array_equal(one, two)
    assert gc.isenabled()  # what works without the collector leaves it as it was


@TARGETS
def test_calls_runs_and_ensembles(crank: Any) -> None:
    def task(k: int) -> list[Any]:
        x = crank.x0()[:, None] + 0.01 * np.random.default_rng(k).normal(size=(crank.n_x, 12))
        n, p = crank.n_q, crank.p * (1.0 + 0.01 * k)
        start = {"theta": 0.3 + 0.01 * k}
        run = crank.simulate(SPAN, initial=start, inputs={"tau": "0.1*sin(t)"}, method="DOP853" if k % 2 else "Radau")
        many = crank.simulate_many(SPAN, count=3, initial={"theta": np.linspace(0.1, 0.4, 3) + 0.01 * k})
        x_min = crank.minimal.x0(theta=0.2 + 0.6 * k, theta_dot=3.0)
        with pytest.raises(eg.EomgenError):  # the failure of one thread is not another's
            crank.rhs(0.0, np.full(crank.n_x, np.nan))
        return [
            *(crank.rhs(0.1, np.ascontiguousarray(column)) for column in x.T), crank.rhs(0.0, x), crank.rhs(0.0, x, p=p),
            crank.jacobian(0.0, x), crank.energy(x), crank.inverse_dynamics(x[:n], x[n:], x[n:]), crank.project(x),
            crank.bind(p=p).rhs(0.0, x), run.t, run.x, many.x, many.status, crank.minimal.rhs(0.0, x_min),
        ]  # fmt: skip

    agree(task)


def test_different_models_are_derived_side_by_side() -> None:
    names = ("pendulum", "slider_crank", "cart_pendulum", "double_pendulum", "four_bar", "spherical_pendulum")

    def task(k: int) -> list[Any]:
        module = eg.load_example(names[k % len(names)]).compile(target="numpy")
        return [module.rhs(0.0, module.x0())]

    agree(task)


MANY = """
import gc, os, sys, threading, warnings
import numpy as np
import eomgen as eg

warnings.simplefilter("ignore")
names = ("pendulum", "slider_crank", "cam_follower", "rolling_disc", "satellite")

def one(k):
    model = eg.load_example(names[k % len(names)])
    model.parameter(f"unused{k}", k)
    module = model.compile(target="numpy")
    run = module.simulate(0.05, method="RK45", rtol=1e-6)
    run.save("run.npz")
    assert (eg.load_trajectory("run.npz").x == run.x).all()
    try:
        module.simulate(0.05, nothing=1)
    except eg.UsageError:
        pass

def held():
    gc.collect()
    return len(gc.get_objects()), sys.getallocatedblocks(), len(os.listdir("/proc/self/fd")), threading.active_count()

counts = []
for k in range(130):  # caches keep 64 models
    one(k)
    if k in (89, 109, 129):
        counts.append(held())
print(*("%d %d %d %d" % c for c in counts), sep="; ")
for early, late in zip(counts, counts[1:]):
    assert late[0] - early[0] < 20 * 60, counts
    assert late[1] - early[1] < 20 * 500, counts
    assert late[2:] == early[2:], counts
"""


@pytest.mark.slow
@pytest.mark.thorough
def test_nothing_grows_over_many_models(tmp_path: Any) -> None:
    """In a process of its own: here caches are full of other tests' models, which larger ones would replace."""
    done = subprocess.run([sys.executable, "-c", MANY], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr[-2000:]
