"""Closed loops: the slider-crank beside its closed form in C, and chains of loops as they grow (IFToMM A02)."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import eomgen as eg
from eomgen import pipeline
from eomgen.codegen.c import emit_c
from eomgen.toolchain.compiler import Options, compile_flags, find_compiler

from .linkages import n_four_bar
from .models import EXAMPLES
from .report import Limit, Report, Table

TITLE = "closed loops: one right-hand side, and chains of loops"
BLOCKS = ("closing", "dynamics")


def beside_closed_form(repeats: int) -> tuple[float, float, float]:
    """Nanoseconds of the closed form and of the generated function (best of turns), and how far they differ."""
    sources = emit_c(pipeline.build(eg.load(EXAMPLES / "slider_crank.yaml").derive(), "c", ["rhs"]))
    compiler = find_compiler()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, text in sources.items():
            (folder / file).write_text(text, encoding="utf-8")
        ours, theirs = folder / "slider_crank.c", Path(__file__).with_suffix("").parent / "slider_crank.c"
        flags = compile_flags(Options(), compiler, ours.stat().st_size)
        program = folder / "timing"
        files = [str(theirs), *(str(folder / file) for file in sources if file.endswith(".c") and "_lanes" not in file)]
        files += ["-DEOMGEN_LANES=0", "-I", name, "-lm", "-o", str(program)]
        subprocess.run([*compiler.command, *flags, *files], check=True)
        found = [subprocess.run([program], check=True, capture_output=True, text=True) for _ in range(repeats)]
    rows = [tuple(map(float, run.stdout.split())) for run in found]
    closed, generated, difference = (np.array(column) for column in zip(*rows, strict=True))
    best = int(np.argmin(closed + generated))
    return float(closed[best]), float(generated[best]), float(difference.max())


def tip(n: int, times: np.ndarray) -> np.ndarray:
    """The first tip (2, n_t) by the closed equation of a row of parallelograms."""
    slope = 9.81 * ((n + 1) / 2 + n) / ((n + 1) / 3 + n)
    start, options = [np.pi / 2, -1.0], {"t_eval": times, "rtol": 3e-14, "atol": 1e-15}
    angle = solve_ivp(lambda t, y: [y[1], -slope * np.cos(y[0])], (0, times[-1]), start, "DOP853", **options).y[0]
    return np.array([np.cos(angle), np.sin(angle)])


def chain_of(n: int) -> dict[str, float]:
    """Operations of the right-hand side, and 10 s simulated at the default tolerances."""
    equations = n_four_bar(n).derive(independent=["theta0"])
    counts = pipeline.build(equations, "c", ["rhs"]).counts
    mod = equations.compile()
    mod.simulate((0, 0.1))
    start = perf_counter()
    run = mod.simulate((0, 10))
    seconds = perf_counter() - start
    energy = mod.energy(run.x)
    x = mod.x0()
    calls = []
    for _ in range(5):
        start = perf_counter()
        for _ in range(200):
            mod.rhs(0.0, x)
        calls.append((perf_counter() - start) / 200)
    return {
        "operations": sum(counts[b].multiplications + counts[b].additions + counts[b].divisions for b in BLOCKS),
        "seconds": seconds,
        "microseconds of rhs": 1e6 * min(calls),
        "error": float(np.abs(np.array([run["x"], run["y"]]) - tip(n, run.t)).max()),
        "energy": float(np.ptp(np.sum(energy, axis=0))),
        "residual": run.residuals.position,
    }


def run(quick: bool) -> Report:
    """Time and count."""
    closed, generated, difference = beside_closed_form(1 if quick else 5)
    sizes = (1, 5, 10) if quick else (1, 2, 5, 10, 20, 40)
    found = {n: chain_of(n) for n in sizes}
    rows: list[list[Any]] = [
        [n, x["operations"] / n, x["microseconds of rhs"], x["seconds"], x["error"], x["energy"], x["residual"]]
        for n, x in found.items()
    ]
    growth = found[sizes[-1]]["operations"] / sizes[-1] / (found[5]["operations"] / 5)
    limits = (
        Limit("the slider-crank takes, over its closed form,", generated / closed, 5.0),
        Limit("accelerations of both differ by, relative to 100 rad/s^2,", difference / 100.0, 1e-9),
        Limit(f"operations per loop, {sizes[-1]} loops over 5,", growth, 1.1),
        Limit("error of the tip after change points,", max(x["error"] for x in found.values()), 1e-3, "m"),
    )
    notes = (
        "The closed form has two states and no loop to close: it is written by hand for this linkage alone.",
        "From 9 velocities on, configurations of lost rank are passed in the same code, which takes more operations.",
        "A02 allows errors of 1e-3 (its high precision). OpenSim 3.2 took 0.455 s for N = 2 and 10 s (Intel i5-4570,",
        "rehabenggroup.github.io/MBSbenchmarksInOpenSim): another machine, so a note and no comparison.",
    )
    single = Table("slider-crank", ("what", "best ns"), [["closed form in C", closed], ["generated", generated]])
    headings = ("loops", "operations per loop", "rhs us", "10 s in s", "error m", "energy drift J", "residual")
    details = {"closed form ns": closed, "generated ns": generated, "chains": {str(n): x for n, x in found.items()}}
    return Report((single, Table("N-four-bar", headings, rows)), limits, notes, details)
