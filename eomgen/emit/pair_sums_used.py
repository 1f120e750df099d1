"""Stage emit: a program -> the sums over pairs of shapes that its blocks use, and what of them."""

from __future__ import annotations

from typing import NamedTuple

from ..errors import cannot
from ..graph.pair_calls import PairFunction, pair_call
from ..graph.traverse import reachable
from ..program import Program
from ..program.loop_slopes import BY_BODIES


class UsedSum(NamedTuple):
    """A sum, and whether its value, its derivatives, the time in which shapes meet and near pairs are used."""

    function: PairFunction
    sums: bool
    slopes: bool
    meets: bool
    lists: bool


def used_sums(program: Program) -> list[UsedSum]:
    """The sums, by name."""
    graph = program.graph
    roots = [y.id for block in program.blocks for y in (*block.outputs, *block.checks)]
    operations = {graph.nodes[i][0] for i in reachable(graph, roots)} & set(graph.calls)
    calls = [call for operation in sorted(operations) if (call := pair_call(graph, operation)) is not None]
    functions = {call.function.name: call.function for call in calls}
    parts = {(call.function.name, call.part) for call in calls}
    return [
        UsedSum(functions[name], *((name, part) in parts for part in ("sum", "slope", "meeting", "spots")))
        for name in sorted(functions)
    ]


class SumAgain(NamedTuple):
    """A sum of which the Jacobian takes derivatives along one direction after another at one place."""

    function: PairFunction
    rated: frozenset[int]  #: numbers that have rates
    read: frozenset[int]  #: results that are read


def sums_again(program: Program) -> list[SumAgain]:
    """The sums of which the Jacobian takes derivatives along one direction after another at one place."""
    graph = program.graph
    roots = [y.id for block in program.blocks if block.name in BY_BODIES[1:] for y in block.outputs]
    places: dict[str, set[int]] = {}
    rated: dict[str, set[int]] = {}
    read: dict[str, set[int]] = {}
    functions: dict[str, PairFunction] = {}
    for operation, first, *_ in (graph.nodes[i] for i in reachable(graph, roots) if graph.nodes[i][0] in graph.calls):
        call = pair_call(graph, operation)
        if call is None:
            continue
        name = call.function.name
        if call.part == "slope":
            functions[name] = call.function
            places.setdefault(name, set()).add(first)
            rated.setdefault(name, set()).update(call.numbers)
        elif call.part == "item":
            read.setdefault(name, set()).update(call.numbers)
    return [
        SumAgain(functions[name], frozenset(rated[name]), frozenset(read.get(name, ())))
        for name in sorted(functions)
        if len(places[name]) == 1
    ]


def refuse_sums(program: Program, target: str) -> None:
    """Refuse contacts between groups where a target has no form for them.

    Raises
    ------
    UsageError
    """
    names = sorted({function.element for function, *_ in used_sums(program)})
    if names:
        raise cannot(
            f"{target} has no contacts between groups of shapes (here {', '.join(names)}); use target c, cython or "
            "numpy, or describe each pair by point_plane, sphere_plane or sphere_sphere"
        )
