"""Swing-up of a pole on a cart by direct collocation: eomgen's equations in CasADi beside opty, the same program.

opty (J. K. Moore, A. J. van den Bogert, opty: Software for trajectory optimization and parameter identification using
direct collocation, JOSS 3 (2018), 300) takes equations of motion of SymPy and writes C for the program's functions.  It
is not among the packages of the tests: ``pip install opty cyipopt`` in an environment of its own, which may need
``apt install coinor-libipopt-dev pkg-config``; then ``python -m benchmarks.run swing_up``.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

import eomgen as eg

from .report import Report, Table

TITLE = "swing-up of a pole on a cart: CasADi with eomgen's equations, and opty"
END, MOST, TRACK = 2.5, 20.0, 1.5  #: s, N, m
VALUES = {"m_cart": 1.0, "m_pole": 0.1, "h": 0.5, "g": 9.81}
ALIKE = 1e-6  #: of the costs; both minimise the same function of the same unknowns


def guess(n: int) -> np.ndarray:
    """Where both begin: the angle falls evenly, all else is at rest; s, phi, s', phi', F, each at n + 1 times."""
    start = np.zeros((5, n + 1))
    start[1] = np.linspace(np.pi, 0.0, n + 1)
    return start


def by_casadi(n: int) -> tuple[float, Callable[[], dict[str, Any]]]:
    """Seconds from the model to the program, and what solves it; midpoint rule, force linear between the nodes."""
    import casadi as ca

    began = perf_counter()
    model = eg.load_example("cart_pendulum").derive().to_casadi()
    assert dict(zip(model.p_names, np.array(model.p_values).ravel().tolist(), strict=True)) == VALUES
    h, opti = END / n, ca.Opti()
    x, force = opti.variable(4, n + 1), opti.variable(1, n + 1)
    between = (force[:, :-1] + force[:, 1:]) / 2
    rates = model.rhs.map(n)(0, (x[:, :-1] + x[:, 1:]) / 2, between, ca.repmat(ca.DM(model.p_values), 1, n))
    opti.subject_to(ca.vec(x[:, 1:] - x[:, :-1] - h * rates) == 0)
    opti.subject_to(x[:, 0] == [0, np.pi, 0, 0])
    opti.subject_to(x[:, -1] == 0)
    opti.subject_to(opti.bounded(-MOST, force.T, MOST))
    opti.subject_to(opti.bounded(-TRACK, x[0, :].T, TRACK))
    opti.minimize(h * ca.sumsqr(between))
    first = guess(n)
    opti.set_initial(x, first[:4])
    opti.set_initial(force, first[4:])
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "tol": 1e-8})
    prepared = perf_counter() - began

    def solve() -> dict[str, Any]:
        start = perf_counter()
        found = opti.solve()
        seconds = perf_counter() - start
        return {
            "cost": float(found.value(opti.f)),
            "reached": True,
            "states": np.array(found.value(x)),
            "solve": seconds,
        }

    return prepared, solve


def by_opty(n: int) -> tuple[float, Callable[[], dict[str, Any]]]:
    """The same with the equations of motion written for SymPy by hand (Barto and others 1983, uniform pole)."""
    import sympy as sm
    from opty import Problem

    began = perf_counter()
    t = sm.Symbol("t")
    s, phi, sd, phid, F = (sm.Function(name)(t) for name in ("s", "phi", "sd", "phid", "F"))
    M, m, h, g = sm.symbols("M m h g")
    I = m * h**2 / 3 + m * h**2
    equations = sm.Matrix(
        [
            s.diff(t) - sd,
            phi.diff(t) - phid,
            (M + m) * sd.diff(t) - m * h * sm.cos(phi) * phid.diff(t) + m * h * sm.sin(phi) * phid**2 - F,
            I * phid.diff(t) - m * h * sm.cos(phi) * sd.diff(t) - m * g * h * sm.sin(phi),
        ]
    )
    h_t, first = END / n, slice(4 * (n + 1), 5 * (n + 1))

    def cost(free: np.ndarray) -> float:
        u = free[first]
        return float(h_t * (((u[:-1] + u[1:]) / 2) ** 2).sum())

    def slope(free: np.ndarray) -> np.ndarray:
        u, result = free[first], np.zeros_like(free)
        part = h_t * (u[:-1] + u[1:]) / 2
        result[first][:-1] += part
        result[first][1:] += part
        return result

    ends = (s.func(0.0), phi.func(0.0) - sm.pi, sd.func(0.0), phid.func(0.0),
            s.func(END), phi.func(END), sd.func(END), phid.func(END))  # fmt: skip
    known = {M: VALUES["m_cart"], m: VALUES["m_pole"], h: VALUES["h"], g: VALUES["g"]}
    problem = Problem(
        cost, slope, equations, (s, phi, sd, phid), n + 1, h_t, known_parameter_map=known, instance_constraints=ends,
        bounds={F: (-MOST, MOST), s: (-TRACK, TRACK)}, integration_method="midpoint", time_symbol=t,
    )  # fmt: skip
    problem.add_option("print_level", 0)
    problem.add_option("tol", 1e-8)
    prepared = perf_counter() - began

    def solve() -> dict[str, Any]:
        start = perf_counter()
        free, info = problem.solve(guess(n).ravel())
        seconds = perf_counter() - start
        if info["status"] not in (0, 1):  # 1: to IPOPT's acceptable tolerance, 1e-6, as without second derivatives
            raise RuntimeError(f"opty: {info['status_msg']!r}")
        return {
            "cost": float(info["obj_val"]),
            "reached": info["status"] == 0,
            "states": free[: 4 * (n + 1)].reshape(4, -1),
            "solve": seconds,
        }

    return prepared, solve


def run(quick: bool) -> Report:
    """Both on several meshes, in turns."""
    if find_spec("opty") is None:
        raise RuntimeError("opty is not installed; pip install opty cyipopt, in an environment of its own")
    rows: list[list[Any]] = []
    details: dict[str, Any] = {}
    for n in (50,) if quick else (50, 100, 200):
        ways = {"CasADi": by_casadi(n), "opty": by_opty(n)}
        runs: dict[str, list[dict[str, Any]]] = {name: [] for name in ways}
        for _ in range(1 if quick else 5):
            for name, (_, solve) in ways.items():
                runs[name].append(solve())
        costs = [of[0]["cost"] for of in runs.values()]
        if not abs(costs[0] - costs[1]) <= ALIKE * costs[0]:
            raise RuntimeError(f"{n} intervals: the costs differ, {costs}")
        differ = float(np.abs(runs["CasADi"][0]["states"] - runs["opty"][0]["states"]).max())
        for name, (prepared, _) in ways.items():
            seconds = median(one["solve"] for one in runs[name])
            reached = "yes" if runs[name][0]["reached"] else "1e-6"
            rows.append([n, name, runs[name][0]["cost"], prepared, seconds, reached, differ])
        details[str(n)] = {name: [one["solve"] for one in of] for name, of in runs.items()}
    columns = (
        "intervals",
        "by",
        "integral of F^2, N^2 s",
        "to prepare, s",
        "to solve, s",
        "tolerance met",
        "states differ by",
    )
    notes = (
        "the same program: midpoint rule, nodes, limits, tolerance 1e-8 and first guess; medians of five, in turns",
        "to prepare: from the model to the program; opty compiles C for each mesh, CasADi evaluates its graphs itself",
        "each with the IPOPT that it comes with or finds; both with MUMPS",
    )
    return Report((Table(TITLE, columns, rows),), (), notes, details)
