"""Robots of PyPI packages: operations, differences from Pinocchio and MuJoCo, and time a call beside Pinocchio's."""

from __future__ import annotations

import sys
from pathlib import Path
from time import perf_counter
from typing import Any

from .report import Limit, Report, Table

METHODS = ("embedding", "recursive")  # the two forms of a right-hand side; the tests judge lagrange as well
TITLE = "robots from URDF and MJCF against Pinocchio and MuJoCo"
COUNTED = {"embedding": "mass_matrix and bias", "recursive": "accelerations"}
ROTATION = "euler_parameters"
TESTS = Path(__file__).parents[1] / "tests"


def compare(model: Any, judge: Any, states: int) -> dict[str, dict[str, Any]]:
    """By method: operations, largest relative difference in C and in NumPy, seconds to derive and compile."""
    from robot_comparison import Compiled, largest_differences

    found: dict[str, dict[str, Any]] = {}
    for method in METHODS:
        start = perf_counter()
        equations = model.derive(method)
        derived = perf_counter()
        compiled = Compiled(equations)
        done = perf_counter()
        drawn = judge.states(compiled.module, states, seed=1)
        found[method] = {
            "n": compiled.module.n_v,
            "operations": equations.operations[COUNTED[method]].total,
            "differences": largest_differences(model, compiled, drawn),
            "evaluator": max(largest_differences(model, Compiled(equations, "numpy"), drawn).values()),
            "derive": derived - start,
            "compile": done - derived,
            "forward dynamics": call_time(compiled.module),
            "judge's forward dynamics": judge.call_time() if hasattr(judge, "call_time") else None,
        }
    return found


def call_time(module: Any) -> float:
    """Nanoseconds of one right-hand side, the best of several rounds."""
    import numpy as np

    x, out = 0.1 * np.ones(module.n_x), np.empty(module.n_x)
    rhs = module.rhs
    best = float("inf")
    for _ in range(7):
        start = perf_counter()
        for _ in range(300):
            rhs(0.0, x, out=out)
        best = min(best, (perf_counter() - start) / 300)
    return 1e9 * best


def rows_of(name: str, base: str, found: dict[str, dict[str, Any]]) -> list[list[Any]]:
    """One line for each method."""
    rows = []
    for method, r in found.items():
        d = r["differences"] | {"poses": max(r["differences"]["frames"], r["differences"]["com"])}
        row: list[Any] = [f"{name}{base}", method, r["n"], r["operations"]]
        row += [f"{d[key]:.0e}" for key in ("M", "h", "inverse", "forward", "poses")]
        judge = r["judge's forward dynamics"]
        row += [f"{r['evaluator']:.0e}", r["derive"], r["compile"], round(r["forward dynamics"])]
        rows.append([*row, None if judge is None else round(judge)])
    return rows


def run(quick: bool) -> Report:
    """Every robot by every method, 20 random states each."""
    if str(TESTS) not in sys.path:
        sys.path.insert(0, str(TESTS))
    import eomgen as eg

    try:
        import mujoco_judge
        import pinocchio_judge
        from shipped_robots import mjcf_models, urdf_robots
    except ImportError as error:
        raise SystemExit(f"the robots benchmark needs the test extra (pip install -e '.[test]'): {error}") from None

    states = 3 if quick else 20
    details: dict[str, Any] = {}
    urdf, mjcf = list(urdf_robots().items()), list(mjcf_models().items())
    if quick:
        urdf, mjcf = urdf[:2], mjcf[:1]
    tables: list[list[list[Any]]] = [[], []]
    eg.load(urdf[0][1][0]).compile(kernels=["mass_matrix"])  # what all modules share is compiled before
    for name, (path, floating) in urdf:
        model = eg.load(path, floating=floating, actuate=True, rotation=ROTATION)
        details[name] = compare(model, pinocchio_judge.Judge(path, floating, model), states)
        tables[0] += rows_of(name, "*" if floating else "", details[name])
    for name, (path, assets) in mjcf:
        model = eg.load(path, assets=str(assets), rotation=ROTATION)
        details[f"{name} (MJCF)"] = compare(model, mujoco_judge.Judge(path, model), states)
        tables[1] += rows_of(name, "", details[f"{name} (MJCF)"])
    columns = (
        "robot",
        "method",
        "n",
        "ops",
        "M",
        "bias",
        "inverse",
        "forward",
        "poses",
        "eval.",
        "derive",
        "compile",
        "rhs ns",
        "aba ns",
    )
    worst = max(max(*r["differences"].values(), r["evaluator"]) for found in details.values() for r in found.values())
    limits = [Limit("largest relative difference from the judges", worst, 1e-9)]
    if not quick:
        limits.append(Limit("URDF robots", len(urdf), 25, at_least=True))
        limits.append(Limit("MJCF models", len(mjcf), 5, at_least=True))
    notes = (
        f"Largest relative differences over {states} random states, in C; NumPy's largest beside them.",
        "* floats: n velocities with six of its base (Euler parameters).  Inertias are numbers.",
        "ops: of mass matrix and bias (embedding), of the accelerations (recursive).",
        "poses: link frames and centre of mass (m); derive and compile (six kernels, default options) in s.",
        "rhs: forward dynamics, a call from Python into a given array; aba: Pinocchio's, a call from Python.",
    )
    titles = ("URDF robots against Pinocchio", "MJCF models against MuJoCo")
    shown = tuple(Table(title, columns, rows) for title, rows in zip(titles, tables, strict=True))
    return Report(shown, tuple(limits), notes, details)
