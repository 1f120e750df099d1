"""Closed tracks of 40 to 320 links round wheels, and the tracked excavator: derivation, compilation, calls and runs."""

from __future__ import annotations

import os
import sys
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import Any
from unittest.mock import patch

import numpy as np

import eomgen as eg
from eomgen import pipeline
from eomgen.codegen.c import emit_c

from .measure import work
from .report import Limit, Report, Table
from .robot_calls import in_turns

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
from tracked_excavator import Track, build, undercarriage

TITLE = "tracks of many links"
DRIVE = {"speed": ([0.0, 1.0], [0.0, 3.0])}


def track(links: int) -> eg.Model:
    """A track of so many links, with a roller for six of them, under a frame."""
    m = eg.Model(f"track_{links}", gravity=(0, -9.81, 0))
    undercarriage(m, Track(links=links, rollers=links // 6), 400.0 * links, {"zz": 20.0 * links**2})
    return m


def timed(calls: int, call: Any) -> float:
    """Nanoseconds of one of so many calls."""
    start = perf_counter()
    for _ in range(calls):
        call()
    return 1e9 * (perf_counter() - start) / calls


class Built:
    """A model, derived and compiled with an empty cache, and what that took."""

    def __init__(self, model: eg.Model) -> None:
        start, wall = work(), perf_counter()
        equations = model.derive()
        self.derive = work() - start
        self.module = equations.compile()
        self.seconds, self.wall = work() - start, perf_counter() - wall
        sources = emit_c(pipeline.build(equations, "c"))
        self.text = sum(map(len, sources.values())) / 1e6
        self.pairs = sum(len(text) for name, text in sources.items() if "_pairs_" in name) / 1e6
        mod, x = self.module, self.module.x0()
        x[mod.n_q :] = 0.01 * np.sin(np.arange(mod.n_x - mod.n_q))
        x, out = mod.project(x), np.empty(mod.n_x)
        calls = {
            "rhs": lambda n: timed(n, lambda: mod.rhs(0.0, x, out=out)),
            "project": lambda n: timed(n, lambda: mod.project(x)),
            "jacobian": lambda n: timed(n, lambda: mod.jacobian(0.0, x)),
        }
        self.us = {name: sample.median / 1000 for name, sample in in_turns(calls, 7, 0.05).items()}


def runs(built: Built, seconds: float) -> list[list[Any]]:
    """Real-time factors of methods on a drive from rest."""
    rows = []
    for method in ("RK23", "RK45", "DOP853", "Radau"):
        start = process_time()
        run = built.module.simulate((0, seconds), inputs=DRIVE, method=method, rtol=1e-4, atol=1e-5)
        rows.append([method, seconds / (process_time() - start), len(run.t), run.nfev, float(run["x"][-1])])
    return rows


def run(quick: bool) -> Report:
    """Measure with an empty cache."""
    with TemporaryDirectory() as folder, patch.dict(os.environ, {"EOMGEN_CACHE_DIR": folder}):
        return measured(quick)


def measured(quick: bool) -> Report:
    """Tracks, then the machine."""
    limits, rows = [], []
    for links in (40, 80) if quick else (40, 80, 160, 320):
        built = Built(track(links))
        us = built.us
        rows.append([links, built.module.n_x, built.derive, built.seconds, built.text, built.pairs,
                     us["rhs"], us["project"], us["jacobian"] / 1000])  # fmt: skip
    limits.append(Limit(f"a call of {rows[-1][0]} links over one of 40", rows[-1][6] / rows[0][6], 10.0))
    limits.append(Limit(f"text of contacts of {rows[-1][0]} links over 40", rows[-1][5] / rows[0][5], 1.05))
    for column, what in ((2, "derive"), (6, "rhs"), (7, "project")):
        growth = max(b[column] / a[column] / (b[0] / a[0]) for a, b in pairwise(rows))
        limits.append(Limit(f"{what}, growth over that of links", growth, 1.4))
    head = ("links", "n_x", "derive s", "with compilation, CPU s", "text MB", "of contacts MB", "rhs us", "project us",
            "jacobian ms")  # fmt: skip
    machine = Built(build())
    limits.append(Limit("excavator, derived and compiled", machine.wall, 30.0, "s"))
    found = runs(machine, 0.5 if quick else 5.0)
    limits.append(Limit("excavator at 1e-4, of real time", max(row[1] for row in found), 0.2, at_least=True))
    tables = (
        Table("closed tracks", head, rows),
        Table(
            "excavator, 49 links, from rest to 0.95 m/s", ("method", "of real time", "steps", "calls", "way m"), found
        ),
    )
    mine = f"n_x {machine.module.n_x}, rhs {machine.us['rhs']:.1f} us, jacobian {machine.us['jacobian'] / 1000:.1f} ms"
    notes = (
        "Derivation and compilation take CPU seconds of this process and the compilers, all functions of a model.",
        f"The excavator: {mine}, {machine.seconds:.1f} s of CPU to derive and compile.",
    )
    return Report(tables, tuple(limits), notes, {"tracks": rows, "runs": found})
