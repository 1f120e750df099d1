"""Derivatives of robots and of loops: operations and time beside Pinocchio and CasADi, whose numbers are compared."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pinocchio as pin

from eomgen import pipeline
from eomgen.toolchain.compiler import Options, compile_flags, find_compiler

from .call import compile_call_loop, over_kernel
from .casadi_recursions import write_derivatives
from .large_loops import closed_chain, four_bars
from .report import Report, Table
from .robot_calls import ROBOTS as FORWARD
from .robot_calls import Robot, in_turns, load, load_pinocchio
from .robot_kernels import Timed, timed

TITLE = "derivatives of robots beside Pinocchio and CasADi, and of loops"
ROBOTS = (
    *(robot for robot in FORWARD if robot.name in ("Panda", "ANYmal")),
    Robot("tiago", "tiago_description/robots/tiago_no_hand.urdf"),
    Robot("G1", "g1_description/urdf/g1_29dof_rev_1_0.urdf", True),
    Robot("Talos", "talos_data/robots/talos_reduced.urdf", True),
)
WITH_CASADI = ("Panda", "ANYmal")  #: compiling CasADi's text of the others takes minutes
KERNELS = ("inverse_dynamics_derivatives", "jacobian")
AGREED = 1e-9  #: largest difference from a peer, relative to the largest number


class Call:
    """A kernel behind its address, in a loop in C."""

    def __init__(self, loop: Any, address: Any, pointers: list[Any], arrays: Any) -> None:
        self.loop, self.address, self.pointers, self.arrays = loop, address, pointers, arrays

    def __call__(self, calls: int) -> float:
        """Nanoseconds of one."""
        return float(self.loop(self.address, ctypes.c_long(calls), *self.pointers))


def ours(loop: Any, module: Any, kernel: str, x: np.ndarray) -> tuple[Call, np.ndarray]:
    """A kernel of a module and where it writes."""
    out = np.zeros(int(np.prod(module.layout.shape(kernel))))
    address, *pointers, arrays = over_kernel(module, kernel, x, out)
    return Call(loop, address, pointers, arrays), out


def of_casadi(loop: Any, folder: Path, source: str, x: np.ndarray, size: int) -> tuple[Call, np.ndarray]:
    """CasADi's text, compiled with the flags of our own."""
    adapter = """
static double work[1000000];
int kernel(double t, const double *x, const double *u, const double *c, double *out, double *w)
{
    const double *arguments[2] = {x};
    double *results[2] = {out};
    (void)t, (void)u, (void)c, (void)w;
    return f(arguments, results, 0, work, 0);
}
"""
    folder.mkdir()
    text, library = folder / "f.c", folder / "f.so"
    text.write_text(source + adapter, encoding="utf-8")
    compiler = find_compiler()
    flags = compile_flags(Options(), compiler, 0)
    subprocess.run([*compiler.command, *flags, "-shared", str(text), "-lm", "-o", str(library)], check=True)
    code = ctypes.CDLL(str(library))
    x, out = np.array(x), np.zeros(size)
    arrays = (x, np.zeros(1), np.zeros(1), out, np.zeros(1))
    pointers = [ctypes.c_void_p(a.ctypes.data) for a in arrays]
    return Call(loop, ctypes.cast(code.kernel, ctypes.c_void_p), pointers, (*arrays, code)), out


def of_pinocchio(model: Any, n: int) -> dict[str, Timed]:
    """computeRNEADerivatives and computeABADerivatives."""
    data, q, v, a = model.createData(), pin.neutral(model), 0.3 * np.ones(n), 0.2 * np.ones(n)
    return {
        "inverse_dynamics_derivatives": timed(lambda: pin.computeRNEADerivatives(model, data, q, v, a)),
        "jacobian": timed(lambda: pin.computeABADerivatives(model, data, q, v, a)),
    }


def arguments(model: Any, seed: int = 0) -> dict[str, np.ndarray]:
    """What the kernels take."""
    random = np.random.default_rng(seed)
    n_q, n = model.nq, model.nv
    q = random.uniform(-1, 1, n_q)
    v, a = random.uniform(-1, 1, (2, n))
    return {KERNELS[0]: np.concatenate([q, v, a]), KERNELS[1]: np.concatenate([q, v])}


def contest(robot: Robot, loop: Any, folder: Path, rounds: int, burst: float) -> dict[str, Any]:
    """By kernel operations, nanoseconds of each contestant, and the largest difference from CasADi."""
    theirs, beside = load_pinocchio(robot), robot.name in WITH_CASADI
    equations = load(robot, mimic="independent").derive()
    counts = pipeline.build(equations, "c", list(KERNELS)).counts
    module = equations.compile(kernels=[*KERNELS, "rhs", "mass_matrix"])
    given, texts = arguments(theirs), write_derivatives(theirs) if beside else {}
    peers, empty = of_pinocchio(theirs, theirs.nv), of_pinocchio(pin.Model(), 0)
    found: dict[str, Any] = {"n": module.n_v, "floating": robot.floating}
    for kernel in KERNELS:
        contestants: dict[str, Timed] = {}
        x = np.resize(given[kernel], module.layout.inputs(kernel))
        contestants["eomgen"], mine = ours(loop, module, kernel, x)
        entry = found[kernel] = {"operations": counts[kernel].total if kernel in counts else None}
        if kernel in texts:
            z, n_x = given[kernel], theirs.nq + theirs.nv
            if kernel == KERNELS[1]:
                z = np.concatenate([z[:n_x], np.zeros(theirs.nv), z[n_x:]])
            made = folder / f"{robot.name}_{kernel}"
            contestants["CasADi"], other = of_casadi(loop, made, texts[kernel].source, z, 2 * len(mine) + 64)
            entry["CasADi operations"] = texts[kernel].operations
        if kernel in peers:
            contestants["Pinocchio"], contestants["a call"] = peers[kernel], empty[kernel]
        times = entry["times"] = {who: sample.best for who, sample in in_turns(contestants, rounds, burst).items()}
        if kernel in peers:
            times["Pinocchio"] -= times.pop("a call")
        if kernel in texts and not robot.floating:  # only there both have the same coordinates
            entry["difference"] = float(np.abs(mine - other[: len(mine)]).max() / np.abs(mine).max())
            assert entry["difference"] < AGREED, (kernel, entry)
    return found


def of_loops(quick: bool, loop: Any, rounds: int, burst: float) -> list[list[Any]]:
    """Closed chains and rows of four-bars: operations of the state and of a column, and time of the whole Jacobian."""
    cases = {"closed chain of 20": closed_chain(20, True, False)}
    if not quick:
        cases |= {f"closed chain of {n}": closed_chain(n, True, False) for n in (40, 100)}
        cases["20 four-bars"] = four_bars(20)
    rows = []
    for name, model in cases.items():
        equations = model.derive()
        counts = pipeline.build(equations, "c", ["rhs", "jacobian"]).counts
        module = equations.compile()
        x = module.x0()
        contestants = {kernel: ours(loop, module, kernel, x)[0] for kernel in ("rhs", "jacobian")}
        times = {who: sample.best for who, sample in in_turns(contestants, rounds, burst).items()}
        each = [counts[block].total for block in ("loop_slopes", "slopes_by_position", "slopes_by_velocity")]
        rows.append([name, module.n_v, module.n_dof, *each, times["rhs"], times["jacobian"]])
    return rows


def run(quick: bool) -> Report:
    """Robots of example-robot-data, then loops."""
    rounds, burst = (3, 2e-4) if quick else (40, 1e-3)
    robots = ROBOTS[:1] if quick else ROBOTS
    rows: dict[str, list[list[Any]]] = {kernel: [] for kernel in KERNELS}
    details: dict[str, Any] = {}
    with TemporaryDirectory() as folder:
        loop = compile_call_loop(Path(folder))
        for robot in robots:
            name = robot.name
            found = details[name] = contest(robot, loop, Path(folder), rounds, burst)
            for kernel, table in rows.items():
                one = found[kernel]
                times, own = one["times"], one["times"]["eomgen"]
                row = [name + "*" * found["floating"], found["n"], one["operations"], own]
                row += [one.get("CasADi operations"), times.get("CasADi")]
                row += [times["Pinocchio"], times["Pinocchio"] / own]
                row.append(times["CasADi"] / own if "CasADi" in times else None)
                table.append(row)
        loops = of_loops(quick, loop, rounds, burst)
    head: tuple[str, ...] = ("robot", "n", "operations", "ns", "CasADi, operations", "CasADi, ns")
    tables = [
        Table(f"{k}, ns", (*head, "Pinocchio, ns", "Pinocchio over ours", "CasADi over ours"), rows[k]) for k in KERNELS
    ]
    columns = ("mechanism", "n", "freedoms", "state", "column of q", "column of v", "rhs, ns", "jacobian, ns")
    tables.append(Table("Jacobians of loops: operations of the state once and of a column, ns", columns, loops))
    notes = (
        "Least of many bursts in turns: ours and CasADi's text in a loop in C, same compiler and flags; of Pinocchio",
        "the wheel from Python, less the same call of a model without joints.  * floats.  Jacobians without operations",
        "are solved in loops with the factor of M.  CasADi: Newton-Euler and recursions in link axes, SX, its cse.",
        "Of the Panda CasADi's numbers are compared, to 1e-9.",
    )
    return Report(tuple(tables), (), notes, details)
