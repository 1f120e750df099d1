"""The Panda arm with numeric parameters: time to derive, and operations by both methods."""

from __future__ import annotations

from typing import Any

from .measure import Sample, in_fresh_process
from .report import Limit, Report, Table
from .tasks import METHODS

TITLE = "Panda arm"
PARTS = ("mass_matrix", "bias", "mass_matrix and bias", "inverse_dynamics", "energy")


def run(quick: bool) -> Report:
    """Derive in fresh processes; SymPy once, as it takes long."""
    results = {m: [in_fresh_process("derive_panda", m) for _ in range(1 if quick else 5)] for m in METHODS}
    times = {method: Sample(tuple(r["seconds"] for r in found)) for method, found in results.items()}
    counts = {method: found[0]["operations"] for method, found in results.items()}
    rows: list[list[Any]] = [[f"eomgen {method}", times[method].median, None] for method in METHODS]
    details: dict[str, Any] = {m: {**times[m].as_dict(), "operations": counts[m]} for m in METHODS}
    if not quick:
        peer = in_fresh_process("derive_panda_sympy")["seconds"]
        rows.append(["SymPy KanesMethod", peer, peer / times["embedding"].median])
        details["sympy"] = peer
    limits = [Limit(f"{method} derives in, best,", times[method].best, 0.3, "s") for method in METHODS]
    limits.append(Limit("operations of inverse dynamics, lagrange,", counts["lagrange"]["inverse_dynamics"], 2000))
    limits += [Limit(f"operations of {p}, embedding,", counts["embedding"][p], 2000) for p in ("mass_matrix", "bias")]
    tables = (
        Table("derivation", ("Panda", "median s", "over embedding"), rows),
        Table("operations", ("part", *METHODS), [[part, *(counts[m][part] for m in METHODS)] for part in PARTS]),
    )
    notes = ("Seven revolute joints, every parameter a number; negations, sines and cosines are not counted.",)
    return Report(tables, tuple(limits), notes, details)
