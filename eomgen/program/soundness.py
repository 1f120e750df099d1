"""Stage program, force elements that can fail: Kinematics -> flags that are 1 where an element's loads are finite."""

from __future__ import annotations

from ..base.operations import operations_with
from ..graph.core import Expr
from ..graph.traverse import reachable
from ..kinematics import Kinematics
from ..kinematics.kinematics import ForceTerms

LARGEST = 1e300


def flag_forces(kinematics: Kinematics) -> list[tuple[str, Expr]]:
    """Names of the elements whose loads need not be finite, and flags of (t, q, v, u): 1 where they are, else 0."""
    found = []
    for terms in kinematics.forces:
        total = _size(terms)
        if total is not None:
            finite = total.graph.apply("lt", total, LARGEST)  # false for what is not a number
            found.append((terms.force.name, finite))
    return found


def not_finite_where(kinematics: Kinematics) -> dict[str, str]:
    """Elements whose types know where their loads are not finite, and where that is."""
    return {x.force.name: x.force.not_finite_where for x in kinematics.forces if x.force.not_finite_where}


def _size(terms: ForceTerms) -> Expr | None:
    """Sum of the sizes of all entries, None if it is finite wherever the state is."""
    entries: list[Expr] = []
    for load in terms.marker_loads:
        entries += [*load.force, *load.torque]
    entries += [load.value for load in terms.coordinate_loads]
    if not entries:
        return None
    graph = entries[0].graph
    fragile = operations_with(lambda row: row.fragile)
    if not any(graph.nodes[i][0] in fragile for i in reachable(graph, [e.id for e in entries])):
        return None
    total = graph.zero
    for entry in entries:
        total = total + graph.apply("abs", entry)
    return total
