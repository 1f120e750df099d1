"""Time to derive planar chains, beside SymPy's KanesMethod."""

from __future__ import annotations

from typing import Any

import numpy as np

from .measure import Sample, in_fresh_process
from .report import Limit, Report, Table
from .tasks import METHODS

TITLE = "derivation of planar chains"
PATIENCE = 12.0  # seconds of a peer's derivation beyond which it is measured once


def run(quick: bool) -> Report:
    """Derive chains in fresh processes, eomgen and SymPy in turns."""
    found = {n: _measure(n, repeats=1 if quick else 3) for n in ((3,) if quick else (5, 10, 20))}
    rows: list[list[Any]] = []
    for n, measured in found.items():
        ours = measured["eomgen embedding"][0].median
        for who, (sample, operations) in measured.items():
            ratio = sample.median / ours if who.startswith("SymPy") else None
            rows.append([f"{n} links, {who}", sample.median, sample.best, ratio, operations])
    difference = largest_difference(3 if quick else 5)
    limits = [Limit("SymPy and eomgen differ in accelerations by", difference, 1e-11)]
    if not quick:
        peer = found[20]["SymPy, absolute angles"][0].median
        for method in METHODS:
            ours = found[20][f"eomgen {method}"][0].median
            limits.append(Limit(f"SymPy's time over {method}'s, 20 links,", peer / ours, 100, at_least=True))
    details = {
        str(n): {who: {**sample.as_dict(), "operations": count} for who, (sample, count) in measured.items()}
        for n, measured in found.items()
    }
    columns = ("chain", "median s", "best s", "over embedding", "operations of M and bias")
    notes = (
        "Ours: Model through the public interface to derived equations, in the angles between neighbours.",
        "SymPy: frames and points to mass_matrix and forcing, in absolute angles, its best case, and in ours.",
        "Every mass, length, centre, inertia and gravity is a symbol; fresh processes, imports left out.",
        "Operations: ours as derived (multiplications, additions, divisions); SymPy's after cse, to 10 links.",
    )
    return Report((Table("derivation", columns, rows),), tuple(limits), notes, details)


def _measure(n: int, repeats: int) -> dict[str, tuple[Sample, int | None]]:
    """Samples and operations of each contestant for n links."""
    tasks: dict[str, tuple[Any, ...]] = {f"eomgen {method}": ("derive_chain", n, method) for method in METHODS}
    tasks["SymPy, absolute angles"] = ("derive_chain_sympy", n, True, n <= 10)
    if n <= 10:
        tasks["SymPy, relative angles"] = ("derive_chain_sympy", n, False, n <= 10)
    seconds: dict[str, list[float]] = {who: [] for who in tasks}
    operations: dict[str, int | None] = {}
    for _ in range(repeats):
        for who, (task, *arguments) in tasks.items():
            if seconds[who] and seconds[who][0] > PATIENCE:
                continue
            result = in_fresh_process(task, *arguments)
            seconds[who].append(result["seconds"])
            operations[who] = result["operations"]
    return {who: (Sample(tuple(values)), operations[who]) for who, values in seconds.items()}


def largest_difference(n: int) -> float:
    """Angular accelerations at one state, ours against SymPy's: largest difference over the largest of them.

    Both start from the same absolute angles and rates, and are compared in absolute accelerations.
    """
    import sympy as sm

    from eomgen.expr.evaluate import evaluate

    from . import models, peers

    angle, rate = np.linspace(0.3, 1.9, n), np.linspace(-1.2, 2.0, n)
    values = models.chain_values(n)
    kane = peers.chain(n)
    function = sm.lambdify([kane.q, kane.u, kane.parameters], [kane.mass_matrix, kane.forcing], cse=True)
    mass, forcing = function(angle, rate, [values[p.name] for p in kane.parameters])
    theirs = np.linalg.solve(mass, np.ravel(forcing))

    # parts.tree is what eqs.mass_matrix is raised from; evaluating the graph spares a detour through SymPy
    tree = models.chain(n).derive().tree
    relative = {f"q{k + 1}": x for k, x in enumerate(np.diff(angle, prepend=0.0))}
    relative |= {f"q{k + 1}_dot": x for k, x in enumerate(np.diff(rate, prepend=0.0))}
    flat = evaluate([x for row in tree.mass_matrix for x in row] + list(tree.bias), values | relative)
    ours = np.cumsum(np.linalg.solve(np.reshape(flat[: n * n], (n, n)), -np.array(flat[n * n :])))
    return float(np.abs(ours - theirs).max() / np.abs(theirs).max())
