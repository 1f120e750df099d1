"""How things are timed: repeats and medians, fresh processes, and a calibration of the machine."""

from __future__ import annotations

import json
import os
import platform
import resource
import statistics
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from math import inf
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]


@dataclass(frozen=True)
class Sample:
    """Repeated measurements of one quantity."""

    values: tuple[float, ...]

    @property
    def median(self) -> float:
        """The middle value: what tables show."""
        return statistics.median(self.values)

    @property
    def best(self) -> float:
        """The smallest value: what an undisturbed machine would have shown more often."""
        return min(self.values)

    @property
    def spread(self) -> float:
        """Largest over smallest value: near 1 on a quiet machine."""
        return max(self.values) / min(self.values) if min(self.values) else inf

    def as_dict(self) -> dict[str, Any]:
        """For the results file."""
        return {"median": self.median, "best": self.best, "spread": self.spread, "values": list(self.values)}


def interleaved(repeats: int, **actions: Callable[[], float]) -> dict[str, Sample]:
    """Take turns between actions, so that a disturbance of the machine meets all of them; each returns its seconds."""
    values: dict[str, list[float]] = {name: [] for name in actions}
    for _ in range(repeats):
        for name, action in actions.items():
            values[name].append(action())
    return {name: Sample(tuple(found)) for name, found in values.items()}


def seconds_of(action: Callable[[], Any]) -> float:
    """Wall time of one call."""
    start = perf_counter()
    action()
    return perf_counter() - start


def work() -> float:
    """CPU seconds so far of this process and of those it has waited for: of compilers, too."""
    return process_time() + resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime


def seconds_per_call(call: Callable[[], Any], budget: float) -> float:
    """Wall time per call, of a loop that lasts about ``budget`` seconds."""
    number, elapsed = 1, 0.0
    while elapsed < budget / 4:
        number *= 2
        loop = range(number)
        start = perf_counter()
        for _ in loop:
            call()
        elapsed = perf_counter() - start
    return elapsed / number


@dataclass(frozen=True)
class Finished:
    """A process that has ended well.

    Attributes
    ----------
    stdout, stderr : str
    wall, cpu : float
        Seconds that passed, and seconds that it and its children computed: the latter hardly depends on what else the
        machine is doing.
    """

    stdout: str
    stderr: str
    wall: float
    cpu: float


def in_fresh_process(task: str, *arguments: Any, environment: Mapping[str, str] | None = None) -> Any:
    """Run a task of :mod:`benchmarks.tasks` in a new interpreter; what it returns comes back through JSON."""
    command = [sys.executable, "-m", "benchmarks.tasks", task, json.dumps(arguments)]
    return json.loads(run_process(command, environment).stdout.splitlines()[-1])


def run_process(command: Sequence[str], environment: Mapping[str, str] | None = None) -> Finished:
    """Run a command to its end from the project's root.

    Raises
    ------
    RuntimeError
        It failed; the message holds the end of its standard error.
    """
    inherited = {**os.environ, **(environment or {})}
    # What an installed program has: bytecode beside its modules. Python writes it when it first imports them.
    inherited.pop("PYTHONDONTWRITEBYTECODE", None)
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), perf_counter()
    done = subprocess.run(command, cwd=ROOT, env=inherited, capture_output=True, text=True, check=False)
    wall, after = perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} exited with {done.returncode}:\n{done.stderr[-3000:]}")
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Finished(done.stdout, done.stderr, wall, cpu)


def calibrate() -> dict[str, float]:
    """How fast this machine is now: compare runs only where these are alike.

    Returns
    -------
    dict
        Nanoseconds of one pass of a plain Python loop and of one sine in NumPy, the least of several tries, and the
        median over the least (1 on a quiet machine).
    """
    angles = np.linspace(0.0, 1.0, 50_000)
    sample = interleaved(9, python=lambda: seconds_of(_loop), sine=lambda: seconds_of(lambda: np.sin(angles)))
    return {
        "python_loop_ns": sample["python"].best / 50_000 * 1e9,
        "numpy_sin_ns": sample["sine"].best / angles.size * 1e9,
        "disturbance": max(s.median / s.best for s in sample.values()),
    }


def _loop() -> float:
    x = 0.0
    for _ in range(50_000):
        x = x * 0.5 + 1.0
    return x


def describe_machine() -> dict[str, Any]:
    """Processor and versions that the numbers depend on."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        model = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "")
    except OSError:
        model = ""
    packages = ("eomgen", "sympy", "numpy", "scipy", "cython")
    return {
        "processor": model or platform.machine(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        **{name: version(name) for name in packages},
    }
