"""From derived equations of a long chain to its compiled and loaded ``rhs``, by stage."""

from __future__ import annotations

from typing import Any

from .latency import cold_cache
from .measure import Sample, in_fresh_process
from .report import Limit, Report, Table

TITLE = "compilation of rhs alone"


def run(quick: bool) -> Report:
    """Compile in fresh processes from an empty cache, and with only the model-independent layer in it."""
    links = 10 if quick else 100
    repeats = 1 if quick else 3
    found: dict[str, list[dict[str, float]]] = {"empty cache": [], "layer ready": []}
    for _ in range(repeats):
        for label, results in found.items():
            with cold_cache() as environment:
                results.append(
                    in_fresh_process("compile_chain", links, label == "layer ready", environment=environment)
                )
    rows: list[list[Any]] = []
    for stage in found["empty cache"][0]:
        samples = [Sample(tuple(r[stage] for r in results)).median for results in found.values()]
        rows.append([stage, *samples])
    total = Sample(tuple(r["total"] for r in found["empty cache"]))
    limits = [Limit(f"rhs of {links} links compiles from an empty cache in, best,", total.best, 10, "s")]
    notes = (
        "Default flags; every parameter a symbol; 'layer ready': the Cython layer was compiled for another model.",
        "No peer: SymPy's equations of a chain this long are out of reach. 'derive' is not part of the total.",
    )
    return Report((Table(f"{links} links", ("stage", *found), rows),), tuple(limits), notes, dict(found))
