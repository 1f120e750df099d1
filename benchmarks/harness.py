"""What all benchmarks share: calls timed in turns, separate processes, limits, and the page of results."""

from __future__ import annotations

import json
import os
import platform
import resource
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import date
from functools import partial
from importlib.metadata import version
from pathlib import Path
from time import perf_counter, process_time
from typing import Any
from unittest.mock import patch

import numpy as np
from rich.console import Console
from rich.table import Table as RichTable

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"
sys.path += [str(ROOT / "tests"), str(EXAMPLES)]  # judges and lists of robots; the excavator
#: Seconds of one of so many calls.
Timed = Callable[[int], float]


# -- timing ------------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Sample:
    """Repeated measurements of one quantity: in tables the middle one, or the least, which disturbs the least."""

    values: tuple[float, ...]

    @property
    def median(self) -> float:
        """The middle value."""
        return statistics.median(self.values)

    @property
    def best(self) -> float:
        """The smallest value."""
        return min(self.values)


def timed(call: Callable[[], Any], clock: Callable[[], float] = perf_counter) -> Timed:
    """Seconds of one of so many calls in a row."""

    def measure(calls: int) -> float:
        start = clock()
        for _ in range(calls):
            call()
        return (clock() - start) / calls

    return measure


def in_turns(actions: Mapping[str, Timed], rounds: int, burst: float = 0.0) -> dict[str, Sample]:
    """Seconds a call: one contestant after the other, so that a disturbance meets all; bursts (s), or single calls."""
    calls = {who: max(3, int(burst / action(10))) if burst else 1 for who, action in actions.items()}
    values: dict[str, list[float]] = {who: [] for who in actions}
    for _ in range(rounds):
        for who, action in actions.items():
            values[who].append(action(calls[who]))
    return {who: Sample(tuple(found)) for who, found in values.items()}


def work() -> float:
    """CPU seconds so far of this process and of those it has waited for: of compilers, too."""
    return process_time() + resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime


def spent(action: Callable[[], Any], clock: Callable[[], float] = perf_counter) -> tuple[Any, float]:
    """What an action gives, and its seconds."""
    start = clock()
    return action(), clock() - start


@contextmanager
def cold_cache() -> Iterator[dict[str, str]]:
    """An empty cache for this process, and for others as their environment."""
    with tempfile.TemporaryDirectory(prefix="eomgen-bench-") as folder:
        environment = {"EOMGEN_CACHE_DIR": folder}
        with patch.dict(os.environ, environment):
            yield environment


@dataclass(frozen=True)
class Finished:
    """A process that has ended well: seconds that passed, and that it and its children computed."""

    stdout: str
    stderr: str
    wall: float
    cpu: float


def run_process(command: Sequence[str], environment: Mapping[str, str] | None = None) -> Finished:
    """Run a command to its end from the project's root; RuntimeError with the end of its messages if it fails."""
    inherited = {**os.environ, **(environment or {})}
    inherited.pop("PYTHONDONTWRITEBYTECODE", None)  # installed programs have their bytecode beside their modules
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), perf_counter()
    done = subprocess.run(command, cwd=ROOT, env=inherited, capture_output=True, text=True, check=False)
    wall, after = perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} exited with {done.returncode}:\n{done.stderr[-3000:]}")
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Finished(done.stdout, done.stderr, wall, cpu)


def in_fresh_process(task: str, *arguments: Any) -> Any:
    """Run a task of :mod:`benchmarks.tasks` in a new interpreter; what it returns comes back through JSON."""
    command = [sys.executable, "-m", "benchmarks.tasks", task, json.dumps(arguments)]
    return json.loads(run_process(command).stdout.splitlines()[-1])


# -- reports -----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Limit:
    """A number that was promised: at most ``bound``, or at least with ``at_least``."""

    what: str
    value: float
    bound: float
    unit: str = ""
    at_least: bool = False

    @property
    def met(self) -> bool:
        """Is the promise kept?"""
        return self.value >= self.bound if self.at_least else self.value <= self.bound

    def __str__(self) -> str:
        verdict, sign = "met" if self.met else "MISSED", "at least" if self.at_least else "at most"
        return (
            f"{verdict}: {self.what} {number(self.value)}{self.unit and ' '}{self.unit} ({sign} {number(self.bound)})"
        )


class Report:
    """What one benchmark measured: results for the page; tables (title, columns, rows), limits and notes in full."""

    def __init__(self) -> None:
        self.results: list[tuple[str, float, Mapping[str, float | None]]] = []
        self.tables: list[tuple[str, Sequence[str], Sequence[Sequence[Any]]]] = []
        self.limits: list[Limit] = []
        self.notes: list[str] = []

    def result(self, task: str, ours: float, others: Mapping[str, float | None] | None = None) -> None:
        """Add a row of the page: a task with its unit, eomgen's number, and those of others."""
        self.results.append((task, ours, others or {}))

    def table(self, title: str, columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
        """Add a table."""
        self.tables.append((title, columns, rows))

    def most(self, what: str, value: float, bound: float, unit: str = "") -> None:
        """Judge a number that is at most a bound."""
        self.limits.append(Limit(what, value, bound, unit))

    def least(self, what: str, value: float, bound: float, unit: str = "") -> None:
        """Judge a number that is at least a bound."""
        self.limits.append(Limit(what, value, bound, unit, at_least=True))

    def note(self, *sentences: str) -> None:
        """Add what the rows mean."""
        self.notes += sentences

    def show(self, console: Console) -> None:
        """Print it."""
        for title, columns, rows in self.tables:
            drawn = RichTable(title=title, title_justify="left")
            for k, column in enumerate(columns):
                drawn.add_column(column, justify="right" if k else "left")
            for row in rows:
                drawn.add_row(*map(number, row))
            console.print(drawn)
        for note in self.notes:
            console.print(f"  {note}", style="dim", highlight=False)
        for limit in self.limits:
            console.print(f"  {limit}", style="green" if limit.met else "bold red", highlight=False)

    def rows(self, name: str, measured: str) -> list[str]:
        """Its rows of the page: results, and the limits that are missed."""
        rows = []
        for task, ours, others in self.results:
            beside = "; ".join(f"{who} {number(x)} ({number(x / ours)})" for who, x in others.items() if x is not None)
            rows.append(f"| {name} | {task} | {number(ours)} | {beside} | {measured} |")
        missed = [str(limit).removeprefix("MISSED: ") for limit in self.limits if not limit.met]
        if missed:
            met = f"{len(self.limits) - len(missed)} of {len(self.limits)} limits met"
            rows.append(f"| {name} | {met} | | missed: {'; '.join(missed)} | {measured} |")
        return rows


def number(value: Any) -> str:
    """Three significant digits, in plain notation where that is readable; integers and texts as they are."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return "" if value is None else str(value)
    if isinstance(value, int):
        return f"{value:,}"
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"


HEAD = "# Results of the benchmarks\n\n| benchmark | task | eomgen | others (over eomgen's) | measured |\n"
RULE = "|---|---|---:|---|---|"
#: Name -> title and the function that fills a report, at small sizes if ``quick``.
BENCHMARKS: dict[str, tuple[str, Callable[[Report, bool], None]]] = {}


def benchmark(name: str, title: str) -> Callable[[Callable[[Report, bool], None]], Callable[[Report, bool], None]]:
    """Register a benchmark under its name."""

    def register(function: Callable[[Report, bool], None]) -> Callable[[Report, bool], None]:
        BENCHMARKS[name] = title, function
        return function

    return register


def write(page: Path, name: str, report: Report, machine: str) -> None:
    """Put a report into the page of results, in the place of the last one of that name from such a processor."""
    head, _, below = (page.read_text(encoding="utf-8") if page.exists() else HEAD).partition(RULE)
    rows, machines = ([line for line in below.splitlines() if line.startswith(mark)] for mark in ("| ", "- "))
    letters = {line[5:].partition(", Python")[0]: line[2] for line in machines}
    letter = letters.setdefault(machine.partition(", Python")[0], "ABCDEFGHIJ"[len(letters)])
    others = [row for row in rows if not (row.startswith(f"| {name} |") and row.endswith(f" {letter} |"))]
    rows = report.rows(name, f"{date.today()} {letter}") + others
    rows.sort(key=lambda row: list(BENCHMARKS).index(row.split(" ")[1]))
    machines = sorted([*(line for line in machines if line[2] != letter), f"- {letter}: {machine}"])
    page.parent.mkdir(parents=True, exist_ok=True)
    page.write_text("\n".join([f"{head}{RULE}", *rows, "", *machines, ""]), encoding="utf-8")


# -- the machine -------------------------------------------------------------------------------------------------------
def calibrate() -> dict[str, float]:
    """Nanoseconds of a pass of a Python loop and of a sine in NumPy, and median over least, 1 on a quiet machine."""
    angles = np.linspace(0.0, 1.0, 50_000)
    found = in_turns({"Python loop": timed(_loop), "NumPy sine": timed(partial(np.sin, angles))}, 9)
    disturbance = max(sample.median / sample.best for sample in found.values())
    return {who: sample.best / 50_000 * 1e9 for who, sample in found.items()} | {"disturbance": disturbance}


def _loop() -> float:
    x = 0.0
    for _ in range(50_000):
        x = x * 0.5 + 1.0
    return x


def describe_machine() -> str:
    """Processor and versions that the numbers depend on."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        model = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "")
    except OSError:
        model = ""
    packages = ", ".join(f"{name} {version(name)}" for name in ("eomgen", "sympy", "numpy", "scipy"))
    return f"{model or platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, {packages}"
