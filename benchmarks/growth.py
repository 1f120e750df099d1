"""Operations of energies and inverse dynamics as a chain grows: they must grow linearly."""

from __future__ import annotations

from time import perf_counter
from typing import Any

from eomgen import pipeline
from eomgen.codegen.c import emit_c
from eomgen.expr.schedule import count

from .models import chain, spatial_chain
from .report import Limit, Report, Table
from .tasks import METHODS

TITLE = "growth of operations with the length of a chain"
PARTS = ("energies", "inverse dynamics")


def operations(n: int, method: str) -> dict[str, int]:
    """Operations of energies and of inverse dynamics of a chain of n links."""
    tree = chain(n).derive(method).tree
    energies = [tree.kinetic_energy, tree.potential_energy]
    return {"energies": count(energies).total, "inverse dynamics": count(tree.inverse_dynamics).total}


def seconds_to_emit(n: int) -> float:
    """Time from a spatial chain of n bodies to the C text of its right-hand side."""
    model = spatial_chain(n)
    start = perf_counter()
    emit_c(pipeline.build(model.derive(), "c", ["rhs"]))
    return perf_counter() - start


def run(quick: bool) -> Report:
    """Count at two lengths, one twice the other."""
    short = 25 if quick else 100
    rows: list[list[Any]] = []
    limits = []
    details: dict[str, Any] = {}
    for method in METHODS:
        single, double = operations(short, method), operations(2 * short, method)
        details[method] = {str(short): single, str(2 * short): double}
        for part in PARTS:
            ratio = double[part] / single[part]
            rows.append([f"{part}, {method}", single[part], double[part], ratio, double[part] / (2 * short)])
            limits.append(Limit(f"growth of {part}, {method}, when links double", ratio, 2.1))
    times = {n: min(seconds_to_emit(n) for _ in range(3)) for n in (short // 2, short, 2 * short)}
    details["seconds to derive and emit"] = {str(n): seconds for n, seconds in times.items()}
    limits.append(Limit(f"{short} bodies in space are derived and emitted in, best,", times[short], 2.0, "s"))
    columns = ("operations of", f"{short} links", f"{2 * short} links", "ratio", "per link")
    notes = (
        "Angles between neighbours, every parameter a symbol; work that depends on parameters only is included.",
        "How SymPy fares in these angles when links double: see the derive benchmark.",
    )
    emitted = Table(
        "right-hand side in C", ("bodies in space", "best s"), [[n, seconds] for n, seconds in times.items()]
    )
    return Report((Table("operations", columns, rows), emitted), tuple(limits), notes, details)
