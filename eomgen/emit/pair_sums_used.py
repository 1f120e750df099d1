"""Stage emit: a program -> the sums over pairs of shapes that its blocks use, and what of them."""

from __future__ import annotations

from ..errors import UsageError
from ..graph.pair_calls import PairFunction, pair_call
from ..graph.traverse import reachable
from ..program import Program


def used_sums(program: Program) -> list[tuple[PairFunction, bool]]:
    """The sums, by name, and whether their derivatives are used."""
    graph = program.graph
    roots = [y.id for block in program.blocks for y in (*block.outputs, *block.checks)]
    operations = {graph.nodes[i][0] for i in reachable(graph, roots)} & set(graph.calls)
    calls = [call for operation in sorted(operations) if (call := pair_call(graph, operation)) is not None]
    functions = {call.function.name: call.function for call in calls}
    sloped = {call.function.name for call in calls if call.part == "slope"}
    return [(functions[name], name in sloped) for name in sorted(functions)]


def refuse_sums(program: Program, target: str) -> None:
    """Refuse contacts between groups where a target has no form for them.

    Raises
    ------
    UsageError
    """
    names = sorted({function.element for function, _ in used_sums(program)})
    if names:
        raise UsageError(
            f"{target} has no contacts between groups of shapes (here {', '.join(names)}); use target c, cython or "
            "numpy, or describe each pair by point_plane, sphere_plane or sphere_sphere"
        )
