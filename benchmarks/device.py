"""Batches and ensembles on a GPU: time of a state beside eomgen's own lanes on all cores and JAX's vmap on the GPU."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np

from .harness import Report, Timed, benchmark, in_turns, spent, timed
from .peers import ROBOTS, installed

BATCHES = (256, 4096, 65_536)
FUNCTIONS = ("rhs", "mass_matrix", "inverse_dynamics", "jacobian")
LAUNCHES = 20
SMALL = 4096  #: states that one processor may be through with before others have begun
THREADS = os.cpu_count() or 1


class OnGpu:
    """A robot on the GPU and on the processor; results are compared before they are timed."""

    def __init__(self, equations: Any, gpu: Any) -> None:
        self.equations, self.gpu, self.error = equations, gpu, 0.0
        self.module, self.model = equations.compile(), equations.to_cuda(gpu)
        self.pool = ThreadPoolExecutor(THREADS)

    def states(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """x (n_x, count) and accelerations (n_v, count)."""
        random, start = np.random.default_rng(0), self.module.x0()
        x = start[:, None] + 0.3 * random.normal(size=(start.size, count))
        x = np.asarray(self.module.project(x)) if self.module.layout.quaternion_slots else x
        return x, random.normal(size=(self.module.n_v, count))

    def contestants(self, function: str, count: int) -> dict[str, Timed]:
        """Seconds of one batch."""
        x, a = self.states(count)
        q, v = np.split(x, [self.module.n_q])
        first = [0.0] if function in ("rhs", "jacobian") else []
        given = {"mass_matrix": [q], "inverse_dynamics": [q, v, a]}.get(function, [x])
        there, on_gpu, here = (
            [self.gpu.put(y) for y in given],
            getattr(self.model, function),
            getattr(self.module, function),
        )
        wanted, found = np.asarray(here(*first, *given)), on_gpu(*first, *there).numpy()
        self.error = max(self.error, float(np.abs(found - wanted).max() / np.abs(wanted).max()))
        blocks = [block for block in np.array_split(np.arange(count), THREADS) if block.size]
        parts = [[np.ascontiguousarray(array[:, block]) for array in given] for block in blocks]

        def batches(calls: int) -> float:
            self.gpu.stream.sync()
            start = perf_counter()
            for _ in range(LAUNCHES):
                on_gpu(*first, *there)
            self.gpu.stream.sync()
            return (perf_counter() - start) / LAUNCHES

        def cores(calls: int) -> float:
            """All of them, or one: a small batch is through before the others have begun."""
            found = spent(lambda: list(self.pool.map(lambda part: here(*first, *part), parts)))[1]
            return min(found, spent(lambda: here(*first, *given))[1]) if count <= SMALL else found

        traced = function == "rhs" and count >= SMALL and self.module.n_v < 10
        return {"gpu": batches, "cores": cores, **(self.jax(x, wanted) if traced else {})}

    def jax(self, x: np.ndarray, wanted: np.ndarray) -> dict[str, Timed]:
        """JAX on the same GPU; nothing where it is not there."""
        if not installed("jax"):
            return {}
        import jax

        if jax.default_backend() != "gpu":
            return {}
        rhs, states = self.equations.to_jax().rhs, jax.numpy.array(x)
        call = jax.jit(jax.vmap(lambda x: rhs(0.0, x), in_axes=1, out_axes=1))
        if not np.allclose(call(states), wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max()):
            raise RuntimeError(f"{self.module.name}: JAX differs")
        return {"jax": timed(lambda: call(states).block_until_ready())}

    def runs(self, count: int) -> dict[str, Timed]:
        """Seconds of an ensemble of 0.1 s by DOP853."""
        options = {"method": "DOP853", "rtol": 1e-8, "atol": 1e-8}
        given = (0.0, 0.1), self.states(count)[0]
        here = partial(self.module.simulate_many, *given, progress=False, **options)
        return {"gpu": timed(partial(self.model.simulate_many, *given, **options)), "cores": timed(here)}


@benchmark("device", "many states on a GPU")
def device(report: Report, quick: bool) -> None:
    """Compare and time where there is a GPU; else only say so."""
    from eomgen.errors import EomgenError
    from eomgen.runtime.device import CudaDevice

    try:
        gpu = CudaDevice()
    except EomgenError as error:
        report.note(f"NO GPU: nothing was run or timed ({error})")
        return
    rows: list[list[Any]] = []
    runs: list[list[Any]] = []
    batches = BATCHES[:1] if quick else BATCHES
    for robot in (ROBOTS[0],) if quick else (ROBOTS[0], ROBOTS[2]):
        case = OnGpu(robot.model().derive(), gpu)
        for count in batches:
            for function in FUNCTIONS:
                samples = in_turns(case.contestants(function, count), 3 if quick else 9)
                ns = {who: 1e9 * sample.median / count for who, sample in samples.items()}
                rows.append(
                    [robot.name, function, count, ns["gpu"], ns["cores"], ns["cores"] / ns["gpu"], ns.get("jax")]
                )
                if count == BATCHES[-1] and function in ("rhs", "jacobian"):
                    others = {f"lanes, {THREADS} cores": ns["cores"], "JAX": ns.get("jax")}
                    report.result(f"{robot.name}, {function}, {count:,} states, ns a state", ns["gpu"], others)
            us = {who: 1e6 * sample.median / count for who, sample in in_turns(case.runs(count), 3).items()}
            if count == BATCHES[-1]:
                cores = {f"lanes, {THREADS} cores": us["cores"]}
                report.result(f"{robot.name}, {count:,} runs of 0.1 s, us a run", us["gpu"], cores)
            runs.append([robot.name, count, us["gpu"], us["cores"], us["cores"] / us["gpu"]])
        report.most(f"{robot.name}: results of the GPU beside the module", case.error, 1e-12)
    sides = ("GPU", f"lanes, {THREADS} cores", "times faster")
    report.table(
        "ns of a state, data on the GPU", ("robot", "function", "states", *sides, "JAX, vmap on the GPU"), rows
    )
    report.table("us of a run of 0.1 s by DOP853, copies included", ("robot", "runs", *sides), runs)
    report.note(
        f"The processors: all cores, or one where that is quicker, tried up to {SMALL:,} states.",
        f"GPU: {gpu.device.name}; medians; each batch is launched {LAUNCHES} times in a row, from Python.",
    )
