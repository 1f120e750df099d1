"""Nanoseconds of one rhs call from Python, above the kernel in C and beside SymPy's lambdify of the same equations."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np

import eomgen as eg
from eomgen.runtime.kernels import eager
from eomgen.toolchain.compiler import find_compiler

from .measure import interleaved, seconds_per_call
from .models import EXAMPLES
from .peers import pendulum_rhs
from .report import Limit, Report, Table

TITLE = "one call of rhs from Python"
CALLS = 10_000
#: What a call adds to its kernel at most (ns): into an array that is there, and into a new one.
ABOVE = {"out=": 100, "a new array": 180}
#: What parameters and inputs given with a call add to it at most (ns), and the start of a run (us).
WITH_BOTH, START = 60, 15
#: A run that takes one step: all but its start is a few evaluations.
SHORT = (0.0, 1e-9)


def compile_call_loop(folder: Path) -> Any:
    """The loop in C over a kernel: its address, calls, x, u, constants, result, work -> nanoseconds a call."""
    library, source = folder / "call_loop.so", Path(__file__).with_name("call_loop.c")
    command = [*find_compiler().command, "-O2", "-shared", "-fPIC", str(source), "-o", str(library)]
    subprocess.run(command, check=True)
    measure = ctypes.CDLL(str(library)).measure
    measure.restype = ctypes.c_double
    return measure


def over_kernel(module: Any, name: str, x: np.ndarray, out: np.ndarray) -> list[Any]:
    """What the loop takes for a kernel of a module besides the number of calls, and the arrays to be kept."""
    core, context = eager(module.core), module.kernels.context
    x = np.array(x)  # of its own, in one piece
    arrays = (x, context.u, context.c, out, np.empty(max(core.sizes["n_work"], 1)))
    return [ctypes.c_void_p(core.address(name)), *(ctypes.c_void_p(a.ctypes.data) for a in arrays), arrays]


class Above:
    """Calls of a module's rhs as users make them, held against a loop in C over the same kernel."""

    def __init__(self, module: Any, x: np.ndarray, folder: Path) -> None:
        self.module, self.x, self.out, self.loop = module, x, np.empty_like(x), compile_call_loop(folder)
        address, *pointers, self.arrays = over_kernel(module, "rhs", x, self.out)
        self.given = [address, ctypes.c_long(CALLS), *pointers]

    def kernel(self) -> float:
        """Seconds of one call in C."""
        return float(self.loop(*self.given)) * 1e-9

    def into(self) -> float:
        """Seconds of one turn of a loop that calls ``mod.rhs(t, x, out=out)``."""
        module, x, out = self.module, self.x, self.out
        start = perf_counter()
        for _ in range(CALLS):
            module.rhs(0.0, x, out=out)
        return (perf_counter() - start) / CALLS

    def new(self) -> float:
        """The same of ``mod.rhs(t, x)``."""
        module, x = self.module, self.x
        start = perf_counter()
        for _ in range(CALLS):
            module.rhs(0.0, x)
        return (perf_counter() - start) / CALLS

    def with_both(self) -> float:
        """The same of ``mod.rhs(t, x, p=p, u=u, out=out)``."""
        module, x, out, p, u = self.module, self.x, self.out, self.module.p, self.module.u
        start = perf_counter()
        for _ in range(CALLS):
            module.rhs(0.0, x, p=p, u=u, out=out)
        return (perf_counter() - start) / CALLS

    def begin(self) -> float:
        """The same of ``mod.simulate`` over one short step from the declared start."""
        module = self.module
        start = perf_counter()
        for _ in range(CALLS // 100):
            module.simulate(SHORT)
        return (perf_counter() - start) / (CALLS // 100)

    def measure(self, repeats: int) -> dict[str, Any]:
        """Samples in turns, and the nanoseconds above the kernel of the best of each (the loop itself included)."""
        actions = {"kernel": self.kernel, "into": self.into, "new": self.new, "both": self.with_both}
        samples = interleaved(repeats, **actions, begin=self.begin)
        best = {name: sample.best for name, sample in samples.items()}
        above = {way: (best[name] - best["kernel"]) * 1e9 for way, name in zip(ABOVE, ("into", "new"), strict=True)}
        both = (best["both"] - best["into"]) * 1e9
        return {"samples": samples, "above": above, "both": both, "begin": best["begin"] * 1e6}


def run(quick: bool) -> Report:
    """Time calls in turns; the pendulum's result is compared with SymPy's first."""
    budget, repeats, turns = (0.02, 2, 5) if quick else (0.2, 9, 200)
    crank = eg.load(EXAMPLES / "slider_crank.yaml").compile()
    pendulum = eg.load(EXAMPLES / "double_pendulum.yaml").compile()
    x_crank, x = crank.x0(), np.array([0.7, -0.4, 1.1, 2.3])
    if pendulum.x_names != ("theta1", "bend", "theta1_dot", "bend_dot"):
        raise RuntimeError(f"the state of the pendulum has another order: {pendulum.x_names}")
    lambdified = pendulum_rhs(dict(zip(pendulum.p_names, pendulum.p.tolist(), strict=True)))
    expected = np.array(lambdified(0.0, x))
    difference = float(np.abs(pendulum.rhs(0.0, x) - expected).max() / np.abs(expected).max())
    out_crank, out, numbers = np.empty_like(x_crank), np.empty_like(x), x.tolist()
    rhs, rhs_crank = pendulum.rhs, crank.rhs
    calls = {
        "double pendulum, out=": lambda: rhs(0.0, x, out=out),
        "double pendulum": lambda: rhs(0.0, x),
        "double pendulum, SymPy lambdify": lambda: lambdified(0.0, x),
        "double pendulum, SymPy lambdify on floats": lambda: lambdified(0.0, numbers),
        "slider-crank, out=": lambda: rhs_crank(0.0, x_crank, out=out_crank),
        "slider-crank": lambda: rhs_crank(0.0, x_crank),
        "slider-crank, minimal": lambda: minimal(0.0, x_minimal),
        "an empty lambda": lambda: None,
    }
    reduced = crank.minimal
    minimal, x_minimal = reduced.rhs, reduced.x0()
    actions = {name: lambda call=call: seconds_per_call(call, budget) for name, call in calls.items()}
    samples = interleaved(repeats, **actions)
    with TemporaryDirectory() as folder:
        cases = {
            "double pendulum": Above(pendulum, x, Path(folder)),
            "slider-crank": Above(crank, x_crank, Path(folder)),
        }
        held = {name: case.measure(turns) for name, case in cases.items()}
    base = samples["double pendulum"].median
    rows: list[list[Any]] = []
    for name, sample in samples.items():
        ratio = sample.median / base if "SymPy" in name else None
        rows.append([name, sample.median * 1e9, sample.best * 1e9, ratio])
    notes = (
        "Each includes the lambda around it (last row). SymPy's: solved symbolically, cse, plain math, numbers for the",
        "parameters, a list as result; ours: parameters variable, a NumPy array as result.",
        "Above the kernel: bests of many short loops over mod.rhs(t, x, ...), loop included, less that of a loop in C.",
        "The start of a run: simulate over 1 ns from the declared initial values, which is one step.",
        "The slider-crank's rhs projects onto the loop; its minimal form solves the loop by Newton from the last call.",
    )
    details = {name: sample.as_dict() for name, sample in samples.items()}
    details["above the kernel"] = {
        name: {key: found[key] for key in ("above", "both", "begin")} for name, found in held.items()
    }
    limits = [Limit("SymPy's accelerations of the pendulum differ by", difference, 1e-12)]
    limits += [
        Limit(f"{name}, {way}, above the kernel", found["above"][way], bound, "ns")
        for name, found in held.items()
        for way, bound in ABOVE.items()
    ]
    for name, found in held.items():
        limits.append(Limit(f"{name}, p=, u= and out=, above out= alone", found["both"], WITH_BOTH, "ns"))
        limits.append(Limit(f"{name}, start of a run", found["begin"], START, "us"))
    above = [
        [name, found["samples"]["kernel"].best * 1e9, *found["above"].values(), found["both"], found["begin"]]
        for name, found in held.items()
    ]
    tables = (
        Table("call", ("what", "median ns", "best ns", "over ours, allocating"), rows),
        Table(
            "above the kernel, ns, and the start of a run, us",
            ("model", "kernel in C", *ABOVE, "p=, u= above out=", "simulate, one step, us"),
            above,
        ),
    )
    return Report(tables, tuple(limits), notes, details)
