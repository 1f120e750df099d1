"""Ensembles on the workers of dask.distributed: the same bits, whatever becomes of a worker."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import distributed
import numpy as np
import pytest

from eomgen.ensembles.handle import describe

from .test_simulate_many import TIGHT, angles

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def test_workers_give_the_same_bits(pendulum: Any, client: Any) -> None:
    here = pendulum.simulate_many(2, angles(50), **TIGHT)
    there = pendulum.simulate_many(2, angles(50), cluster=client, block=9, **TIGHT)
    np.testing.assert_array_equal(there.x, here.x)
    np.testing.assert_array_equal(there.evaluations, here.evaluations)


def test_killing_a_worker_loses_nothing(pendulum: Any, client: Any, tmp_path: Path) -> None:
    here = pendulum.simulate_many(500, angles(256), **TIGHT)
    victim = next(iter(client.run(os.getpid).values()))
    ready: list[int] = []  # blocks that were there when the worker died

    def kill() -> None:
        deadline = time.monotonic() + 60
        while not ready and time.monotonic() < deadline:
            time.sleep(0.005)
            if done := len(list(tmp_path.glob("runs/block_*.npz"))):
                os.kill(victim, signal.SIGKILL)
                ready.append(done)

    thread = threading.Thread(target=kill)
    thread.start()
    there = pendulum.simulate_many(500, angles(256), cluster=client, block=8, store=tmp_path / "runs", **TIGHT)
    thread.join()
    assert ready, "no block came in a minute"
    assert ready[0] < 16  # of 32: in the midst of the run
    assert there.ok.all()
    np.testing.assert_array_equal(there.x, here.x)
    deadline = time.monotonic() + 30
    with pytest.raises(ProcessLookupError):
        while time.monotonic() < deadline:
            os.kill(victim, 0)
            time.sleep(0.05)
    client.wait_for_workers(2)


def test_failures_are_gathered(crank: Any, client: Any) -> None:
    lengths = np.array([0.1, 0.5, 0.2, 0.12])
    ensemble = crank.simulate_many(1, {"theta": 1.2}, {"r": lengths}, cluster=client, block=2)
    assert [failure.run for failure in ensemble.failures()] == [1]
    assert "cannot close" in ensemble.failures()[0].message


def test_a_block_whose_task_fails_is_marked_and_the_others_are_kept(pendulum: Any, client: Any, tmp_path: Path) -> None:
    def refuse(block: Any) -> dict[str, Any]:
        if block.x[0].max() > 0.9 and np.isfinite(block.x).all():
            raise ArithmeticError("too high")
        return {"top": block.x[0].max()}

    starts = {"theta1": np.array([0.1, 0.2, 2.0, 0.3]), "theta1_dot": 0.0}
    ensemble = pendulum.simulate_many(1e-3, starts, reduce=refuse, cluster=client, block=1, store=tmp_path / "runs")
    (failure,) = ensemble.failures()
    assert failure.run == 2
    assert "ArithmeticError: too high" in failure.message
    assert len(list((tmp_path / "runs").glob("block_*.npz"))) == 3  # what failed is run again next time


def test_a_module_is_built_where_its_file_is_not(pendulum: Any, tmp_path: Path) -> None:
    handle = describe(pendulum)
    away = handle._replace(file=str(tmp_path / "gone.so"))
    module = away.open()
    np.testing.assert_array_equal(module.rhs(0.0, pendulum.x0()), pendulum.rhs(0.0, pendulum.x0()))
