"""Whole processes from start to result: ``eomgen run`` with an empty and a filled cache, beside SymPy."""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .measure import Sample, in_fresh_process, run_process, seconds_of
from .models import EXAMPLES
from .report import Limit, Report, Table

TITLE = "latency of a whole process"
MODELS = ("slider_crank", "double_pendulum")
IMPORTS = ("numpy", "scipy.integrate", "click", "rich.console", "ruamel.yaml", "jinja2", "eomgen.cli")


@contextmanager
def cold_cache() -> Iterator[dict[str, str]]:
    """Environment of a process whose cache is a new empty folder."""
    with tempfile.TemporaryDirectory(prefix="eomgen-bench-") as folder:
        yield {"EOMGEN_CACHE_DIR": folder}


def run(quick: bool) -> Report:
    """Time processes, then break one of each down into stages and imports."""
    colds, warms = (1, 2) if quick else (3, 7)
    samples: dict[str, dict[str, Sample]] = {}
    stages: dict[str, dict[str, dict[str, float]]] = {}
    imports: dict[str, float] = {}
    for model in MODELS:
        cold = []
        for _ in range(colds - 1):
            with cold_cache() as environment:
                cold.append(_seconds(model, environment))
        with cold_cache() as environment:
            first = _stages(model, environment)
        with cold_cache() as environment:
            cold.append(_seconds(model, environment))
            warm = [_seconds(model, environment) for _ in range(warms)]
            stages[model] = {"cold": first, "warm": _stages(model, environment)}
            imports = imports or _imports(model, environment)
        samples[model] = {"cold": Sample(tuple(cold)), "warm": Sample(tuple(warm))}
    peer_stages: list[dict[str, float]] = []
    peer = Sample(tuple(seconds_of(lambda: peer_stages.append(_peer())) for _ in range(1 if quick else 3)))

    rows: list[list[Any]] = []
    for model, found in samples.items():
        for state, sample in found.items():
            ratio = peer.median / sample.median if model == "double_pendulum" else None
            rows.append([f"eomgen run {model}, {state} cache", sample.median, sample.best, ratio])
    rows.append(["SymPy, lambdify, solve_ivp: double_pendulum", peer.median, peer.best, None])
    names = list(dict.fromkeys(name for found in stages.values() for s in found.values() for name in s))
    columns = [(model, state) for model in MODELS for state in ("cold", "warm")]
    split = [[name, *(stages[m][s].get(name) for m, s in columns)] for name in names]
    tables = (
        Table("whole process", ("process", "median s", "best s", "SymPy's over it"), rows),
        Table("stages, seconds", ("stage", *(f"{m} {s}" for m, s in columns)), split),
        Table("imports of a warm run, seconds", ("module and what it pulls in", "s"), [[*x] for x in imports.items()]),
    )
    crank = samples["slider_crank"]
    limits = (
        Limit("slider-crank from a cold cache", crank["cold"].median, 8, "s"),
        Limit("slider-crank from a warm cache", crank["warm"].median, 1.5, "s"),
    )
    notes = (
        "5 s of the slider-crank (a closed loop), 10 s of the double pendulum; SymPy takes KanesMethod for the latter,",
        "solves and lambdifies it with cse to plain math, and integrates at the same tolerances.",
        "'process' is the wall time of the run whose stages are shown; some stages are parts of others.",
    )
    details = {
        "processes": {m: {s: x.as_dict() for s, x in found.items()} for m, found in samples.items()},
        "stages": stages,
        "imports": imports,
        "sympy": {"process": peer.as_dict(), "stages": peer_stages},
    }
    return Report(tables, limits, notes, details)


def _command(model: str, *options: str) -> list[str]:
    return [str(Path(sys.executable).with_name("eomgen")), "run", str(EXAMPLES / f"{model}.yaml"), *options]


def _seconds(model: str, environment: Mapping[str, str]) -> float:
    return seconds_of(lambda: run_process(_command(model), environment))


def _stages(model: str, environment: Mapping[str, str]) -> dict[str, float]:
    """Seconds by stage as ``eomgen run --json`` tells them, and of the whole process."""
    output: list[str] = []
    total = seconds_of(lambda: output.append(run_process(_command(model, "--json"), environment).stdout))
    seconds: dict[str, float] = json.loads(output[0])["seconds"]
    return {**seconds, "process": total}


def _imports(model: str, environment: Mapping[str, str]) -> dict[str, float]:
    """Cumulative seconds of the larger imports of a warm run, from ``-X importtime`` (which slows them somewhat)."""
    command = [sys.executable, "-X", "importtime", *_command(model)]
    found: dict[str, float] = {}
    for line in run_process(command, environment).stderr.splitlines():
        if line.startswith("import time:") and line.count("|") == 2:
            _, cumulative, name = line.split("|")
            if name.strip() in IMPORTS or name.strip() == "sympy":
                found[name.strip()] = int(cumulative) / 1e6
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def _peer() -> dict[str, float]:
    result: dict[str, float] = in_fresh_process("run_double_pendulum_sympy")
    return result
