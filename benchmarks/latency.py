"""Whole processes from start to result: ``eomgen run`` of new and known models, an exported module, beside SymPy."""

from __future__ import annotations

import json
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from .measure import Finished, Sample, run_process
from .models import EXAMPLES
from .report import Limit, Report, Table

TITLE = "latency of a whole process"
FEW = 5  #: runs of each further peer
MODELS = ("slider_crank", "double_pendulum")
EXPORTED = "import slider_crank; run = slider_crank.simulate(10.0); assert run.t[-1] == 10.0 and len(run) > 100"
OF_EXPORTED = "exported slider_crank, imported and run for 10 s"
#: What was promised: seconds of a model that is new and of one that is known, and how many times a bare
#: ``import numpy`` an exported module takes for 10 s of motion.
NEW, KNOWN, TIMES = 1.2, 0.6, 2.5
PEER = "SymPy, lambdify, solve_ivp: double_pendulum"
#: Further peers: label -> package, task and its arguments; those that are installed run.
PEERS = {
    "PyDy, lambdify, odeint: double_pendulum": ("pydy", "run_double_pendulum_pydy", '["lambdify"]'),
    "PyDy, Cython, odeint: double_pendulum": ("pydy", "run_double_pendulum_pydy", '["cython"]'),
    "CasADi, cvodes: double_pendulum by hand": ("casadi", "run_double_pendulum_casadi", "[]"),
}


@contextmanager
def cold_cache() -> Iterator[dict[str, str]]:
    """Environment of a process whose cache is a new empty folder."""
    with tempfile.TemporaryDirectory(prefix="eomgen-bench-") as folder:
        yield {"EOMGEN_CACHE_DIR": folder}


def export(folder: Path) -> None:
    """Generate the slider-crank's package into a folder and install it there."""
    eomgen = str(Path(sys.executable).with_name("eomgen"))
    run_process([eomgen, "generate", str(EXAMPLES / "slider_crank.yaml"), "--out", str(folder)])
    build = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]
    run_process([*build, "--target", str(folder / "installed"), str(folder / "slider_crank")])


def run(quick: bool) -> Report:
    """Time processes in turns, then break one of each kind down into stages and imports."""
    with tempfile.TemporaryDirectory(prefix="eomgen-bench-") as folder:
        place = Path(folder)
        export(place)
        return _measure(1 if quick else 15, {"PYTHONPATH": str(place / "installed")})


def _measure(repeats: int, exported: dict[str, str]) -> Report:
    found: dict[str, list[Finished]] = {}
    stages: dict[str, dict[str, float]] = {}
    imports: dict[str, float] = {}
    for repeat in range(repeats + 1):  # the first round makes bytecode, and is not counted
        took: dict[str, Finished] = {}
        for model in MODELS:
            with cold_cache() as environment:
                took[f"eomgen run {model}, new"] = _run(model, environment)
                took[f"eomgen run {model}, known"] = _run(model, environment)
                if repeat == repeats:
                    stages[f"{model}, known"] = _stages(model, environment)
                    imports = imports or _imports(model, environment)
        took[OF_EXPORTED] = run_process([sys.executable, "-c", EXPORTED], exported)
        took["import numpy"] = run_process([sys.executable, "-c", "import numpy"])
        if repeat:
            for who, done in took.items():
                found.setdefault(who, []).append(done)
        for label, (package, task, arguments) in {PEER: ("sympy", "run_double_pendulum_sympy", "[]"), **PEERS}.items():
            if find_spec(package) is not None and (label == PEER or repeat <= FEW):
                peer = run_process([sys.executable, "-m", "benchmarks.tasks", task, arguments])
                if repeat:
                    found.setdefault(label, []).append(peer)
    for model in MODELS:
        with cold_cache() as environment:
            stages[f"{model}, new"] = _stages(model, environment)
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
        Table("imports of a run of a known model, seconds", ("modules of", "s"), [[*x] for x in imports.items()]),
    )
    ratio = wall[OF_EXPORTED].median / wall["import numpy"].median
    limits = (
        Limit("slider-crank, new, median,", wall["eomgen run slider_crank, new"].median, NEW, "s"),
        Limit("slider-crank, known, median,", wall["eomgen run slider_crank, known"].median, KNOWN, "s"),
        Limit("exported slider-crank, 10 s of motion, over a bare import of NumPy,", ratio, TIMES),
    )
    notes = (
        "5 s of the slider-crank (a closed loop), 10 s of the double pendulum; SymPy takes KanesMethod for the latter,",
        "solves and lambdifies it with cse to plain math, and integrates at the same tolerances, as the others do.",
        "new: the cache is empty; known: it holds the model.",
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
