"""Random stiff and soft equilibria: those that plain Newton, SciPy's hybr and lm find, and those that we find."""

from __future__ import annotations

from collections.abc import Callable
from time import process_time
from typing import Any, NamedTuple

import numpy as np
import scipy.optimize

import eomgen as eg

from .report import Limit, Report, Table
from .rest_models import FAMILIES

TITLE = "equilibria"
EACH = 30  #: of every family
PEERS = ("newton", "hybr", "lm")
BALANCED = 1e-9  #: what may be left of a balance, relative to the terms of its row
TELLS = 1e-8  #: part of the stiffness that central differences tell from zero
SINGULAR = 1e12  #: condition of the mass matrix above which coordinates are singular

Array = Any


class Balance:
    """The equations of balance of one module as they stand: no step, scale or projection of ours.

    Unknowns are the coordinates of the tree and a multiplier for each independent constraint row; equations are
    h + C_q^T l = 0, C = 0, and e^T e = 1 for Euler parameters.
    """

    def __init__(self, module: Any) -> None:
        self.module, self.n_q = module, module.n_q
        kinds = module.layout.coordinate_kinds
        turned = [k for k, kind in enumerate(kinds) if kind == "parameter"]
        self.fours = [turned[k : k + 4] for k in range(0, len(turned), 4)]

    def __call__(self, z: Array) -> Array:
        """The residual (n,) at z (n,)."""
        q, l = z[: self.n_q], z[self.n_q :]
        x = np.concatenate([q, np.zeros(self.module.n_v)])
        force = self.module.bias(0.0, x)
        if len(l):
            force = force + self.module.constraint_jacobian(q).T @ l
        lengths = [q[four] @ q[four] - 1.0 for four in self.fours]
        return np.concatenate([force, self.module.constraints(q) if len(l) else np.zeros(0), lengths])

    def start(self, q: Array) -> Array:
        """The unknowns at a position, with the multipliers that fit best."""
        x = np.concatenate([q, np.zeros(self.module.n_v)])
        rows = self.module.constraint_jacobian(q)
        l = np.linalg.lstsq(rows.T, -self.module.bias(0.0, x), rcond=None)[0] if len(rows) else np.zeros(0)
        return np.concatenate([q, l])

    def slopes(self, z: Array) -> Array:
        """Its derivative (n, n) by central differences."""
        columns = []
        for k in range(len(z)):
            h = 1e-6 * max(1.0, abs(z[k]))
            above, below = z.copy(), z.copy()
            above[k] += h
            below[k] -= h
            columns.append((self(above) - self(below)) / (2.0 * h))
        return np.array(columns).T

    def holds(self, z: Array) -> bool:
        """Whether z solves the equations, relative to what a change of the unknowns by themselves does to each.

        Where Euler angles are singular forces do no work along them, and nothing is known of balance.
        """
        if not np.isfinite(z).all() or np.abs(z[: self.n_q]).max() > 1e6:
            return False
        if np.linalg.cond(self.module.mass_matrix(z[: self.n_q])) > SINGULAR:
            return False
        residual = self(z)
        terms = np.abs(self.slopes(z)) @ np.maximum(1.0, np.abs(z))
        return bool(np.isfinite(residual).all() and (np.abs(residual) <= BALANCED * terms).all())

    def lowest(self, z: Array) -> float:
        """Lowest eigenvalue of the stiffness along what the constraints leave free, in units of the highest magnitude.

        The stiffness is symmetric where forces have a potential.
        """
        q, layout = z[: self.n_q], self.module.layout
        along = self.slopes(z)[: self.module.n_v, : self.n_q] @ layout.scales.rates(q, np.eye(self.module.n_v))
        rows = self.module.constraint_jacobian(q)
        free = np.linalg.svd(rows)[2][len(rows) :].T if len(rows) else np.eye(self.module.n_v)
        values = np.linalg.eigvalsh(0.5 * free.T @ (along + along.T) @ free)
        return float(values[0] / np.abs(values).max()) if values.size else 1.0

    def by_newton(self, z: Array) -> Array:
        """Plain Newton: whole steps."""
        for _ in range(100):
            step = np.linalg.solve(self.slopes(z), -self(z))
            z = z + step
            if not np.isfinite(z).all() or np.abs(step).max() <= 1e-12 * max(1.0, np.abs(z).max()):
                break
        return z

    def by_scipy(self, z: Array, method: str) -> Array:
        """``scipy.optimize.root`` with its own scaling."""
        most = {"maxiter" if method == "lm" else "maxfev": 2000}
        return scipy.optimize.root(self, z, jac=self.slopes, method=method, tol=1e-12, options=most).x


class Case(NamedTuple):
    """One random mechanism: who found an equilibrium from the same start."""

    family: str
    number: int
    peers: dict[str, bool]
    ours: bool
    seconds: float
    why: str
    stability: str
    agrees: bool  #: the verdict of stability with the sign of the stiffness, where differences tell it


def judge(family: str, number: int) -> Case:
    """One random mechanism of a family."""
    module = FAMILIES[family](np.random.default_rng([number, len(family)])).compile(target="numpy")
    balance, q = Balance(module), module.assemble()
    solvers: dict[str, Callable[[Array], Array]] = {"newton": balance.by_newton}
    solvers |= {name: (lambda z, name=name: balance.by_scipy(z, name)) for name in PEERS[1:]}
    peers = {}
    with np.errstate(all="ignore"):
        for name, solve in solvers.items():
            try:
                peers[name] = balance.holds(solve(balance.start(q)))
            except (np.linalg.LinAlgError, eg.EomgenError, ValueError):
                peers[name] = False
    begin, why, stability, agrees = process_time(), "", "", True
    try:
        found = module.equilibrium(q)
        z, stability = balance.start(found.q), found.stability
        ours, lowest = balance.holds(z) and found.linear.is_equilibrium, balance.lowest(z)
        agrees = abs(lowest) < TELLS or (lowest < 0.0) == (stability == "unstable")
        why = "" if ours else "what was returned is no equilibrium"
    except eg.EquilibriumError as error:
        ours, why = False, str(error)
    return Case(family, number, peers, ours, process_time() - begin, why, stability, agrees)


def run(quick: bool) -> Report:
    """Every family, each from one start."""
    cases = [judge(family, k) for family in FAMILIES for k in range(4 if quick else EACH)]
    rows: list[list[Any]] = []
    for family in FAMILIES:
        own = [case for case in cases if case.family == family]
        counts = [sum(case.peers[name] for case in own) for name in PEERS]
        lost = sum(not case.ours and any(case.peers.values()) for case in own)
        times = [1e3 * case.seconds for case in own]
        rows.append([family, len(own), *counts, sum(case.ours for case in own), lost, np.median(times), max(times)])
    lost = sum(not case.ours and any(case.peers.values()) for case in cases)
    wrong = sum(not case.agrees for case in cases)
    notes = (
        "Newton with whole steps, SciPy's hybr and lm solve the bare equations of balance from the same start.",
        f"Found is what leaves {BALANCED:g} of the terms of each equation. Lost: found by one of them and not by us.",
    )
    columns = ("family", "cases", *PEERS, "ours", "lost", "median ms", "longest ms")
    details = {"lost": [case._asdict() for case in cases if not case.ours]}
    return Report(
        (Table("equilibria", columns, rows),),
        (Limit("lost", lost, 0), Limit("stability that the stiffness contradicts", wrong, 0)),
        notes,
        details,
    )
