"""From derived equations of a long chain to its compiled and loaded ``rhs``, by stage."""

from __future__ import annotations

from typing import Any

from .latency import cold_cache
from .measure import Sample, in_fresh_process
from .report import Limit, Report, Table

TITLE = "compilation of rhs alone"


def run(quick: bool) -> Report:
    """Compile in fresh processes from an empty cache."""
    links = 10 if quick else 100
    repeats = 1 if quick else 3
    results: list[dict[str, float]] = []
    for _ in range(repeats):
        with cold_cache() as environment:
            results.append(in_fresh_process("compile_chain", links, environment=environment))
    rows: list[list[Any]] = [[stage, Sample(tuple(r[stage] for r in results)).median] for stage in results[0]]
    total = Sample(tuple(r["total"] for r in results))
    limits = [Limit(f"rhs of {links} links compiles from an empty cache in, best,", total.best, 10, "s")]
    notes = (
        "Default flags; every parameter a symbol.",
        "No peer: SymPy's equations of a chain this long are out of reach. 'derive' is not part of the total.",
    )
    return Report((Table(f"{links} links", ("stage", "s"), rows),), tuple(limits), notes, {"empty cache": results})
