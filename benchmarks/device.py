"""Batches and ensembles on a GPU: time of a state beside eomgen's own lanes on all cores and JAX's vmap on the GPU."""

from __future__ import annotations

import os
import re
from concurrent.futures import ThreadPoolExecutor
from time import perf_counter
from typing import Any

import numpy as np

from .lanes import ROBOTS, robot
from .measure import interleaved, seconds_of
from .report import Limit, Report, Table

TITLE = "many states on a GPU"
NAMES = ("Panda", "Talos")
BATCHES = (256, 1024, 4096, 16_384, 65_536)
FUNCTIONS = ("rhs", "mass_matrix", "inverse_dynamics", "jacobian")
WITH_JAX = {("Panda", 4096), ("Panda", 65_536)}  #: what XLA compiles as well
ALIKE = 1e-12
LAUNCHES = 20
SMALL = 4096  #: states that one processor may be through with before others have begun
SPAN = 0.1  #: seconds of the runs
ARCHITECTURE = "sm_90"
TIMED = ("rhs", "jacobian")


class OnGpu:
    """A robot on the GPU and on the processor; results are compared before they are timed."""

    def __init__(self, name: str, gpu: Any) -> None:
        equations = robot(*ROBOTS[name][:2]).derive()
        self.module, self.model = equations.compile(), equations.to_cuda(gpu)
        self.name, self.gpu, self.error, self.threads = name, gpu, 0.0, os.cpu_count() or 1
        self.pool = ThreadPoolExecutor(self.threads)

    def states(self, count: int) -> list[np.ndarray]:
        """q, v, a of many states."""
        random, start = np.random.default_rng(0), self.module.x0()
        x = start[:, None] + 0.3 * random.normal(size=(start.size, count))
        x = x if not self.module.layout.quaternion_slots else np.asarray(self.module.project(x))
        return [x[: self.module.n_q], x[self.module.n_q :], random.normal(size=(self.module.n_v, count))]

    def given(self, function: str, count: int) -> list[np.ndarray]:
        """The arguments of a function but for the time."""
        q, v, a = self.states(count)
        return {"mass_matrix": [q], "inverse_dynamics": [q, v, a]}.get(function, [np.concatenate([q, v])])

    def contestants(self, function: str, count: int) -> dict[str, Any]:
        """name -> seconds of one batch, as functions."""
        first = [0.0] if function in TIMED else []
        given = self.given(function, count)
        there = [self.gpu.put(array) for array in given]
        on_gpu, here = getattr(self.model, function), getattr(self.module, function)
        wanted = np.asarray(here(*first, *given))
        found = on_gpu(*first, *there).numpy()
        error = float(np.abs(found - wanted).max() / np.abs(wanted).max())
        self.error = max(self.error, error)
        blocks = np.array_split(np.arange(count), self.threads)
        parts = [[np.ascontiguousarray(array[:, block]) for array in given] for block in blocks if block.size]

        def gpu() -> float:
            self.gpu.stream.sync()
            start = perf_counter()
            for _ in range(LAUNCHES):
                on_gpu(*first, *there)
            self.gpu.stream.sync()
            return (perf_counter() - start) / LAUNCHES

        def cores() -> float:
            """All of them, or one: a small batch is through before the others have begun."""
            found = seconds_of(lambda: list(self.pool.map(lambda part: here(*first, *part), parts)))
            return min(found, seconds_of(lambda: here(*first, *given))) if count <= SMALL else found

        traced = function == "rhs" and (self.name, count) in WITH_JAX
        return {"gpu": gpu, "cores": cores, **(_with_jax(self.module, wanted, given[0]) if traced else {})}

    def runs(self, count: int) -> dict[str, Any]:
        """The same of an ensemble by DOP853."""
        q, v, _ = self.states(count)
        x0, options = np.concatenate([q, v]), {"method": "DOP853", "rtol": 1e-8, "atol": 1e-8}
        return {
            "gpu": lambda: seconds_of(lambda: self.model.simulate_many((0.0, SPAN), x0, **options)),
            "cores": lambda: seconds_of(lambda: self.module.simulate_many((0.0, SPAN), x0, progress=False, **options)),
        }


def _with_jax(module: Any, wanted: np.ndarray, x: np.ndarray) -> dict[str, Any]:
    """JAX on the same GPU; nothing where JAX or its GPU is not there."""
    try:
        import jax

        if jax.default_backend() != "gpu":
            return {}
    except ImportError:
        return {}
    traced = robot(*ROBOTS[module.name.capitalize()][:2]).derive().to_jax()
    call = jax.jit(jax.vmap(lambda x: traced.rhs(0.0, x), in_axes=1, out_axes=1))
    states = jax.numpy.array(x)
    if not np.allclose(call(states), wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max()):
        raise RuntimeError(f"{module.name}: JAX differs")
    return {"jax": lambda: seconds_of(lambda: call(states).block_until_ready())}


def registers(quick: bool) -> Table | None:
    """What the machine code needs, which NVRTC tells without a GPU; None without NVRTC."""
    from eomgen import pipeline
    from eomgen.codegen.targets.cuda import emit_device_text
    from eomgen.errors import MissingDependencyError
    from eomgen.runtime.device.cuda_device import compile_with_log

    rows = []
    for name in NAMES[:1] if quick else NAMES:
        text = emit_device_text(pipeline.build(robot(*ROBOTS[name][:2]).derive(), "cuda"))
        for what in FUNCTIONS[:1] if quick else (*FUNCTIONS, "dop853", "rk4"):
            runs = what in ("dop853", "rk4")
            macros = [f"EOMGEN_WANT_{want}" for want in (what.upper(), *(("RUNS",) if runs else ()))]
            start = perf_counter()
            try:
                code, log = compile_with_log(text, ARCHITECTURE, macros, ["--ptxas-options=-v"])
            except MissingDependencyError:
                return None
            needed = resources(log, f"_{what}_{'runs' if runs else 'batch'}")
            rows.append([name, what, *needed, len(code) // 1000, round(perf_counter() - start, 1)])
    columns = ("robot", "kernel", "registers", "stack, bytes", "bytes spilled", "code, kB", "compiled in s")
    return Table(f"machine code for {ARCHITECTURE}", columns, rows)


def resources(log: str, kernel: str) -> tuple[int | None, int | None, int | None]:
    """Registers, bytes of stack in all, bytes of spill stores in the kernel and what it calls; None if not told."""
    parts = re.split(r"Compiling entry function '(\w+)'", log)
    told = [text for name, text in zip(parts[1::2], parts[2::2], strict=True) if name.endswith(kernel)]
    if not told:  # some versions of NVRTC say nothing
        return None, None, None
    entry = told[0]
    used = re.search(r"Used (\d+) registers", entry)
    stack = re.search(r"(\d+) bytes cumulative stack size", entry)
    spilled = sum(int(n) for n in re.findall(r"(\d+) bytes spill stores", entry))
    assert used is not None
    return int(used[1]), int(stack[1]) if stack else 0, spilled


def run(quick: bool) -> Report:
    """Compare and time where there is a GPU; else tell what the machine code needs."""
    from eomgen.errors import EomgenError
    from eomgen.runtime.device.cuda_device import CudaDevice

    code = registers(quick)
    tables = [] if code is None else [code]
    notes = [] if code is not None else ["NVRTC is not installed (the extra cuda), so nothing was compiled"]
    try:
        gpu = CudaDevice()
    except EomgenError as error:
        return Report(tuple(tables), (), (*notes, f"NO GPU: nothing was run or timed ({error})"))
    rows, runs, errors = [], [], {}
    batches = BATCHES[:1] if quick else BATCHES
    for name in NAMES[:1] if quick else NAMES:
        case = OnGpu(name, gpu)
        for function in FUNCTIONS:
            for count in batches:
                samples = interleaved(3 if quick else 9, **case.contestants(function, count))
                ns = {way: sample.median / count * 1e9 for way, sample in samples.items()}
                rows.append([name, function, count, ns["gpu"], ns["cores"], ns["cores"] / ns["gpu"], ns.get("jax")])
        for count in batches:
            samples = interleaved(3, **case.runs(count))
            us = {way: sample.median / count * 1e6 for way, sample in samples.items()}
            runs.append([name, count, us["gpu"], us["cores"], us["cores"] / us["gpu"]])
        errors[name] = case.error
    cores = os.cpu_count()
    tables += [
        Table("ns of a state, data on the GPU", ("robot", "function", "states", "GPU", f"lanes, {cores} cores",
              "times faster", "JAX, vmap on the GPU"), rows),
        Table(f"us of a run of {SPAN} s by DOP853, copies included", ("robot", "runs", "GPU", f"lanes, {cores} cores",
              "times faster"), runs),
    ]  # fmt: skip
    limits = tuple(
        Limit(f"{name}: results of the GPU beside the module", error, ALIKE) for name, error in errors.items()
    )
    notes.append(f"the processors: all cores, or one where that is quicker, tried up to {SMALL:,} states")
    notes.append(f"GPU: {gpu.device.name}; medians; each batch is launched {LAUNCHES} times in a row, from Python")
    return Report(tuple(tables), limits, tuple(notes), {"errors": errors})
