"""Operations of energies and inverse dynamics as a chain grows: they must grow linearly."""

from __future__ import annotations

from typing import Any

from eomgen.graph.count import count

from .models import chain
from .report import Limit, Report, Table
from .tasks import METHODS

TITLE = "growth of operations with the length of a chain"
PARTS = ("energies", "inverse dynamics")


def operations(n: int, method: str) -> dict[str, int]:
    """Operations of energies and of inverse dynamics of a chain of n links."""
    tree = chain(n).derive(method).tree
    energies = [tree.kinetic_energy, tree.potential_energy]
    return {"energies": count(energies).total, "inverse dynamics": count(tree.inverse_dynamics).total}


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
    columns = ("operations of", f"{short} links", f"{2 * short} links", "ratio", "per link")
    notes = (
        "Angles between neighbours, every parameter a symbol; work that depends on parameters only is included.",
        "How SymPy fares in these angles when links double: see the derive benchmark.",
    )
    return Report((Table("operations", columns, rows),), tuple(limits), notes, details)
