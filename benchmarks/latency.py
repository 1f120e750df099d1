"""Whole processes from start to result: ``eomgen run`` with an empty and a filled cache, beside SymPy."""

from __future__ import annotations

import json
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .measure import Finished, Sample, run_process
from .models import EXAMPLES
from .report import Limit, Report, Table

TITLE = "latency of a whole process"
MODELS = ("slider_crank", "double_pendulum")
PEER = "SymPy, lambdify, solve_ivp: double_pendulum"


@contextmanager
def cold_cache() -> Iterator[dict[str, str]]:
    """Environment of a process whose cache is a new empty folder."""
    with tempfile.TemporaryDirectory(prefix="eomgen-bench-") as folder:
        yield {"EOMGEN_CACHE_DIR": folder}


def run(quick: bool) -> Report:
    """Time processes in turns, then break one of each kind down into stages and imports."""
    repeats = 1 if quick else 5
    found: dict[str, list[Finished]] = {}
    stages: dict[str, dict[str, float]] = {}
    imports: dict[str, float] = {}
    for repeat in range(repeats + 1):  # the first round makes bytecode, and is not counted
        for model in MODELS:
            with cold_cache() as environment:
                cold, warm = (_run(model, environment) for _ in range(2))
                if repeat == repeats:
                    stages[f"{model}, warm"] = _stages(model, environment)
                    imports = imports or _imports(model, environment)
            if repeat:
                found.setdefault(f"eomgen run {model}, cold cache", []).append(cold)
                found.setdefault(f"eomgen run {model}, warm cache", []).append(warm)
        peer = run_process([sys.executable, "-m", "benchmarks.tasks", "run_double_pendulum_sympy", "[]"])
        if repeat:
            found.setdefault(PEER, []).append(peer)
    for model in MODELS:
        with cold_cache() as environment:
            stages[f"{model}, cold"] = _stages(model, environment)
    stages["double_pendulum, SymPy"] = json.loads(found[PEER][-1].stdout) | {"process": found[PEER][-1].wall}

    wall = {who: Sample(tuple(p.wall for p in processes)) for who, processes in found.items()}
    cpu = {who: Sample(tuple(p.cpu for p in processes)) for who, processes in found.items()}
    rows: list[list[Any]] = []
    for who, sample in wall.items():
        ratio = wall[PEER].median / sample.median if "double_pendulum" in who and who != PEER else None
        rows.append([who, sample.median, sample.best, cpu[who].median, ratio])
    names = list(dict.fromkeys(name for split in stages.values() for name in split))
    columns = sorted(stages, reverse=True)
    split = [[name, *(stages[column].get(name) for column in columns)] for name in names]
    tables = (
        Table("whole process, seconds", ("process", "median", "best", "cpu", "SymPy's over it"), rows),
        Table("stages, seconds", ("stage", *columns), split),
        Table("imports of a warm run, seconds", ("modules of", "s"), [[*x] for x in imports.items()]),
    )
    limits = (
        Limit("slider-crank from a cold cache, best,", wall["eomgen run slider_crank, cold cache"].best, 8, "s"),
        Limit("slider-crank from a warm cache, best,", wall["eomgen run slider_crank, warm cache"].best, 1.5, "s"),
    )
    notes = (
        "5 s of the slider-crank (a closed loop), 10 s of the double pendulum; SymPy takes KanesMethod for the latter,",
        "solves and lambdifies it with cse to plain math, and integrates at the same tolerances.",
        "cpu: computed by the process and its children, on all cores; hardly depends on what else the machine does.",
        "'process' is the wall time of the run whose stages are shown; what is not in a stage is imports and output.",
    )
    details = {
        "wall": {who: sample.as_dict() for who, sample in wall.items()},
        "cpu": {who: sample.as_dict() for who, sample in cpu.items()},
        "stages": stages,
        "imports": imports,
    }
    return Report(tables, limits, notes, details)


def _run(model: str, environment: Mapping[str, str], *options: str) -> Finished:
    program = str(Path(sys.executable).with_name("eomgen"))
    return run_process([program, "run", str(EXAMPLES / f"{model}.yaml"), *options], environment)


def _stages(model: str, environment: Mapping[str, str]) -> dict[str, float]:
    """Seconds by stage as ``eomgen run --json`` tells them, and of the whole process."""
    done = _run(model, environment, "--json")
    seconds: dict[str, float] = json.loads(done.stdout)["seconds"]
    return {**seconds, "process": done.wall}


def _imports(model: str, environment: Mapping[str, str]) -> dict[str, float]:
    """Seconds a warm run spends importing each package's own modules, the ten largest (measuring slows them)."""
    done = _run(model, {**environment, "PYTHONPROFILEIMPORTTIME": "1"})
    found: Counter[str] = Counter()
    for line in done.stderr.splitlines():
        if line.startswith("import time:") and line.count("|") == 2:
            alone, _, name = line.removeprefix("import time:").split("|")
            if alone.strip().isdigit():
                found[name.strip().split(".")[0]] += int(alone)
    return {name: microseconds / 1e6 for name, microseconds in found.most_common(10)}
