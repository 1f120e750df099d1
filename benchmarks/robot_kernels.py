"""Mass matrix and inverse dynamics of robots: what ``auto`` took beside each of our methods and beside Pinocchio."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np

import eomgen as eg
from eomgen.expr.schedule import count

from .call import compile_call_loop, over_kernel
from .report import Limit, Report, Table
from .robot_calls import in_turns

TITLE = "mass matrix and inverse dynamics of robots"
KERNELS = ("mass_matrix", "inverse_dynamics")
METHODS = ("auto", "embedding", "recursive")
#: How much slower than the best of our methods ``auto`` may be, and what Pinocchio takes at least of our time.
SLOWER, FASTER = 1.05, 1.0
Timed = Callable[[int], float]


def timed(call: Callable[[], Any]) -> Timed:
    """Nanoseconds of one of so many calls."""

    def measure(calls: int) -> float:
        start = perf_counter()
        for _ in range(calls):
            call()
        return (perf_counter() - start) / calls * 1e9

    return measure


class Ours:
    """A kernel of a module in a loop in C."""

    def __init__(self, loop: Any, module: Any, kernel: str) -> None:
        q, v, a = 0.1 * np.ones(module.n_q), 0.3 * np.ones(module.n_v), 0.2 * np.ones(module.n_v)
        x, size = (q, module.n_v**2) if kernel == KERNELS[0] else (np.concatenate([q, v, a]), module.n_v)
        self.loop = loop
        self.address, *self.pointers, self.arrays = over_kernel(module, kernel, x, np.empty(size))

    def __call__(self, calls: int) -> float:
        """Nanoseconds a call."""
        return float(self.loop(self.address, ctypes.c_long(calls), *self.pointers))


def of_pinocchio(model: Any) -> dict[str, Timed]:
    """Pinocchio's crba and rnea."""
    import pinocchio as pin

    data, q, v = model.createData(), pin.neutral(model), 0.3 * np.ones(model.nv)
    a = 0.2 * np.ones(model.nv)
    calls = (lambda: pin.crba(model, data, q), lambda: pin.rnea(model, data, q, v, a))
    return dict(zip(KERNELS, map(timed, calls), strict=True))


def operations(equations: Any) -> dict[str, int]:
    """Multiplications, additions and divisions of both kernels."""
    tree = equations.tree
    mass = [x for i, row in enumerate(tree.mass_matrix) for x in row[: i + 1]]
    return dict(zip(KERNELS, (count(mass).total, count(list(tree.inverse_dynamics)).total), strict=True))


def contest(path: Path, floating: bool, loop: Any, rounds: int, burst: float) -> dict[str, Any]:
    """Velocities, operations, and by kernel the least nanoseconds of each contestant."""
    import pinocchio as pin

    contestants: dict[str, dict[str, Timed]] = {}
    found: dict[str, Any] = {"operations": {}}
    for method in METHODS:
        model = eg.load(path, floating=floating, actuate=True, rotation="euler_parameters")
        equations = model.derive(method)
        module = equations.compile(kernels=list(KERNELS))
        contestants[method] = {kernel: Ours(loop, module, kernel) for kernel in KERNELS}
        found["n"], found["operations"][method] = module.n_v, operations(equations)
    root = (pin.JointModelFreeFlyer(),) if floating else ()
    contestants["Pinocchio"] = of_pinocchio(pin.buildModelFromUrdf(str(path), *root))
    contestants["a call"] = of_pinocchio(pin.Model())
    for kernel in KERNELS:
        samples = in_turns({who: calls[kernel] for who, calls in contestants.items()}, rounds, burst)
        best = {who: sample.best for who, sample in samples.items()}
        best["Pinocchio"] -= best.pop("a call")
        found[kernel] = best
    return found


def run(quick: bool) -> Report:
    """Every robot of example-robot-data, each contestant in turns."""
    from shipped_robots import EXAMPLES as FOLDER
    from shipped_robots import URDF

    robots = dict([*URDF.items()][1:3]) if quick else URDF
    rounds, burst = (3, 2e-4) if quick else (60, 1e-3)
    rows: dict[str, list[list[Any]]] = {kernel: [] for kernel in KERNELS}
    details: dict[str, Any] = {}
    worst = dict.fromkeys(KERNELS, 0.0)
    least = dict.fromkeys(KERNELS, np.inf)
    with TemporaryDirectory() as folder:
        loop = compile_call_loop(Path(folder))
        for name, (file, floating) in robots.items():
            found = details[name] = contest(FOLDER / file, floating, loop, rounds, burst)
            for kernel in KERNELS:
                times, counts = found[kernel], {who: each[kernel] for who, each in found["operations"].items()}
                others = [who for who in METHODS[1:] if counts[who] != counts["auto"]]  # else it is the same code
                own = times["auto"]
                beside, peer = max(own / times[who] for who in [*others, "auto"]), times["Pinocchio"] / own
                worst[kernel], least[kernel] = max(worst[kernel], beside), min(least[kernel], peer)
                each = [x for who in METHODS for x in (counts[who], times[who])]
                rows[kernel].append([name + "*" * floating, found["n"], *each, times["Pinocchio"], beside, peer])
    columns = ("robot", "n", *(x for who in METHODS for x in (f"{who}, operations", "ns")), "Pinocchio, ns")
    columns += ("auto over best", "Pinocchio over auto")
    tables = tuple(Table(f"{kernel}, ns", columns, rows[kernel]) for kernel in KERNELS)
    limits = [
        *(Limit(f"{kernel}, auto over the best of our methods", worst[kernel], SLOWER) for kernel in KERNELS),
        *(Limit(f"{kernel}, Pinocchio over auto", least[kernel], FASTER, at_least=True) for kernel in KERNELS),
    ]
    notes = (
        "Least of many bursts in turns: ours in a loop in C; crba and rnea of Pinocchio's wheel from Python, less",
        "the same call of a model without joints.  * floats.  Inertias are numbers; default flags.",
        "Of as many operations as auto's is the same code; over best: over the others.  The lower triangle is counted.",
    )
    return Report(tables, () if quick else tuple(limits), notes, details)
