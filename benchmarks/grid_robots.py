"""The robots of GRiD's published table: inverse and forward dynamics and their gradients, beside Pinocchio here.

B. Plancher, S. Neuman, R. Ghosal, S. Kuindersma, V. Janapa Reddi, GRiD: GPU-Accelerated Rigid Body Dynamics with
Analytical Gradients, ICRA 2022.  The URDF files are those of the folder urdfs of github.com/robot-acceleration/
GRiDBenchmarks; the environment variable EOMGEN_GRID_URDFS says where they are.
"""

from __future__ import annotations

import ctypes
import os
import re
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import eomgen as eg

from .call import compile_call_loop, over_kernel
from .report import Limit, Report, Table
from .robot_calls import in_turns
from .robot_kernels import timed

TITLE = "GRiD's table: iiwa, HyQ, Atlas"
FOLDER = "EOMGEN_GRID_URDFS"
#: Microseconds of one call as published (README of GRiDBenchmarks): Pinocchio's generated code on an Intel Core
#: i7-10700K at 3.8 GHz, and GRiD on an NVIDIA RTX 3080, transfers included.
PUBLISHED = {
    "iiwa": {"ID": (0.3, 3.0), "FD": (0.9, 7.7), "ID gradient": (1.4, 6.3), "FD gradient": (2.9, 12.9)},
    "hyq": {"ID": (0.3, 3.2), "FD": (1.2, 6.9), "ID gradient": (2.1, 5.8), "FD gradient": (4.3, 11.0)},
    "atlas": {"ID": (1.1, 8.0), "FD": (5.3, 22.4), "ID gradient": (9.8, 19.5), "FD gradient": (20.9, 42.1)},
}
KERNELS = {"ID": "inverse_dynamics", "FD": "rhs"}
KERNELS |= {"ID gradient": "inverse_dynamics_derivatives", "FD gradient": "jacobian"}
FASTER, SAME = 1.0, 1e-10


class Both:
    """A robot in eomgen and in Pinocchio, at one state; without the damping of its joints, which GRiD leaves out."""

    def __init__(self, given: Path, path: Path, loop: Any) -> None:
        self.pin = pin = import_module("pinocchio")
        path.write_text(re.sub(r"<dynamics[^>]*>", "", given.read_text(encoding="utf-8")), encoding="utf-8")
        model = eg.load(path, actuate=True, check_inertia="note")  # Atlas has tensors of no body
        self.module = module = model.compile(kernels=list(KERNELS.values()))
        self.loop, self.model = loop, pin.buildModelFromUrdf(str(path))
        names = [model.renamed.get("joints", {}).get(name, name) for name in list(self.model.names)[1:]]
        self.order = [module.q_names.index(name) for name in names]
        n, pick = module.n_v, np.random.default_rng(7)
        self.q, self.v, self.a = 0.3 + pick.uniform(-0.5, 0.5, n), pick.uniform(-1, 1, n), pick.uniform(-1, 1, n)
        x = np.concatenate([self.q, self.v])
        self.given = {
            "ID": np.concatenate([x, self.a]), "FD": x, "FD gradient": x, "ID gradient": np.concatenate([x, self.a]),
        }  # fmt: skip
        sizes = {"ID": n, "FD": 2 * n, "ID gradient": 3 * n * n, "FD gradient": 4 * n * n}
        self.out = {what: np.empty(size) for what, size in sizes.items()}

    def ours(self, what: str) -> Callable[[int], float]:
        """Nanoseconds of a call of the kernel in C."""
        address, *pointers, kept = over_kernel(self.module, KERNELS[what], self.given[what], self.out[what])
        return lambda calls: float(self.loop(address, ctypes.c_long(calls), *pointers)) + 0.0 * len(kept)

    def theirs(self, what: str, model: Any) -> Callable[[], Any]:
        """The call of Pinocchio."""
        pin, data = self.pin, model.createData()
        q, v, a = (x[self.order] if model.nv else np.zeros(0) for x in (self.q, self.v, self.a))
        still = np.zeros(model.nv)
        calls = {
            "ID": lambda: pin.rnea(model, data, q, v, a),
            "FD": lambda: pin.aba(model, data, q, v, still),
            "ID gradient": lambda: pin.computeRNEADerivatives(model, data, q, v, a),
            "FD gradient": lambda: pin.computeABADerivatives(model, data, q, v, still),
        }
        return calls[what]

    def difference(self, what: str) -> float:
        """The largest between both results, over the largest number."""
        n, order = self.module.n_v, np.array(self.order)
        found, here = self.out[what], np.ix_(self.order, self.order)
        call = self.theirs(what, self.model)  # holds the arrays of the result
        their = call()
        if what == "ID":
            pairs = [(found[order], their)]
        elif what == "FD":
            pairs = [(found[n:][order], their)]
        else:
            block = found.reshape(n, 3 * n) if what == "ID gradient" else found.reshape(2 * n, 2 * n)[n:]
            pairs = [(block[:, :n][here], their[0]), (block[:, n:][here], their[1])]
        return max(float(np.abs(one - np.array(other)).max() / np.abs(other).max()) for one, other in pairs)


def run(quick: bool) -> Report:
    """All twelve in turns; the first robot alone if it is to be quick."""
    folder = os.environ.get(FOLDER)
    if folder is None:
        raise RuntimeError(
            f"set {FOLDER} to the folder urdfs of github.com/robot-acceleration/GRiDBenchmarks, "
            "which has iiwa.urdf, hyq.urdf and atlas.urdf"
        )
    rounds, burst = (3, 2e-4) if quick else (100, 2e-3)
    rows: list[list[Any]] = []
    limits: list[Limit] = []
    details: dict[str, Any] = {}
    with TemporaryDirectory() as place:
        loop = compile_call_loop(Path(place))
        for robot in [*PUBLISHED][:1] if quick else PUBLISHED:
            both = Both(Path(folder) / f"{robot}.urdf", Path(place) / f"{robot}.urdf", loop)
            empty = both.pin.Model()
            for what, (cpu, gpu) in PUBLISHED[robot].items():
                actions = {
                    "eomgen": both.ours(what), "Pinocchio": timed(both.theirs(what, both.model)),
                    "a call": timed(both.theirs(what, empty)),
                }  # fmt: skip
                best = {who: sample.best / 1000 for who, sample in in_turns(actions, rounds, burst).items()}
                own, peer, difference = best["eomgen"], best["Pinocchio"] - best["a call"], both.difference(what)
                rows.append([robot, what, cpu, gpu, peer, own, peer / own, cpu / own, gpu / own])
                details[f"{robot}, {what}"] = {"us": best, "difference": difference}
                limits.append(Limit(f"{robot}, {what}: difference from Pinocchio", difference, SAME))
                if not quick:
                    limits.append(Limit(f"{robot}, {what}: Pinocchio over ours", peer / own, FASTER, at_least=True))
    columns = ("robot", "what", "published CPU", "published GPU", "Pinocchio here", "eomgen here", "Pinocchio over",
               "published CPU over", "published GPU over")  # fmt: skip
    notes = (
        "Published: Pinocchio's generated code on an Intel Core i7-10700K at 3.8 GHz, GRiD on an RTX 3080, one call.",
        "Here: ours in a loop in C, default flags; Pinocchio's wheel (rnea, aba, computeRNEADerivatives,",
        "computeABADerivatives) from Python, less the same call of a model without joints. Least of bursts in turns.",
        "ID gradient: inverse_dynamics_derivatives, which fills d(M a + h)/da = M too; so does Pinocchio's.",
    )
    return Report((Table("one call, us", columns, rows),), tuple(limits), notes, details)
