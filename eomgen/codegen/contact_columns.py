"""The columns of a tree's Jacobian that belong to states of contacts, from their pairs alone.

A state of a pair of shapes, or of a cell of soil, acts on bodies by what its pairs exert, and otherwise on the states
of its own pair.  So the rows of states follow from as many directions as a pair has states, all pairs at a time (A. R.
Curtis, M. J. D. Powell, J. K. Reid, J. Inst. Maths Applics 13 (1974) 117-119), and the rows of bodies from the pairs
that are near: what one exerts by its own states, times what wrenches on bodies make of the residual.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ..contact.pair_sums import POSE, WRENCH
from ..contact.pairs import PairFunction, pair_call
from ..expr.core import Expr, Graph, reachable, substitute, symbols_of
from ..expr.differentiate import jvp
from .terms import SystemTerms

LEAST = 48  #: states of contacts from which the driver is worth its text
LOADED = -1  #: in a set of velocities: what a body gets


class StatedSum(NamedTuple):
    """A sum over pairs that have states."""

    function: PairFunction
    places: tuple[int, ...]  #: which operands before the states are expressions
    slots: tuple[int, ...]  #: of each state the velocity, -1 of a number that is only summed


class ContactColumns(NamedTuple):
    """Which columns these are, and what the driver needs."""

    sums: tuple[StatedSum, ...]
    groups: tuple[tuple[int, ...], ...]  #: states, as numbers of velocities, that may be seeded at a time
    rows: dict[int, tuple[int, ...]]  #: state -> the states whose rates depend on it
    operands: tuple[Expr, ...]  #: those of the places of all sums
    loads: tuple[str, ...]  #: symbols of the wrenches of all bodies of all sums
    along: tuple[Expr, ...]  #: the bodies' residual along these wrenches

    def block(self, name: str, terms: SystemTerms) -> tuple[str, list[Expr]]:
        """Ports and outputs of one of the blocks."""
        if name == "contact_terms":  # M of bodies lower packed, h
            lower = [terms.mass_matrix[i][k] for i in range(terms.n_v - terms.n_states) for k in range(i + 1)]
            return "q v", [*lower, *terms.bias]
        return ("q v", [*self.operands]) if name == "contact_operands" else ("q v a multipliers loads", [*self.along])


def contact_columns(terms: SystemTerms) -> ContactColumns | None:
    """The columns of states of contacts, or None where they are few, or where the states act in other ways too."""
    graph, n, begun = terms.graph, terms.n_v, terms.n_v - terms.n_states
    if terms.n_c or terms.n_states < LEAST or terms.by_columns or terms.system or terms.general_rates:
        return None
    index = {graph.symbol(name).id: k for k, name in enumerate(terms.v) if k >= begun}
    residual = list(terms.inverse_dynamics)
    order = reachable(graph, [y.id for y in residual])
    sums: list[StatedSum] = []
    operands: list[Expr] = []
    for i in order:
        call = pair_call(graph, graph.nodes[i][0])
        if call is None or call.part != "sum" or not call.function.states:
            continue
        function, arguments = call.function, graph.nodes[graph.nodes[i][1]][1:]
        start, first = POSE * function.bodies, function.first_state
        places = tuple(k for k in range(first) if k < start or function.data[k - start] is None)
        sums.append(StatedSum(function, places, tuple(index.get(k, -1) for k in arguments[first:])))
        operands += [Expr(graph, arguments[k]) for k in places]
    if len({one.function.name for one in sums}) < len(sums):
        return None
    result = _dependences(graph, order, sums, index)
    if result is None or any(result.get(y.id, frozenset()) - {LOADED} for y in residual[:begun]):
        return None
    rows: dict[int, list[int]] = {k: [] for one in sums for k in one.slots if k >= 0}
    for k in range(begun, n):
        on = result.get(residual[k].id, frozenset())
        if LOADED in on:
            return None
        for column in on:
            rows[column].append(k)
    groups = _groups(rows)
    if len(rows) < LEAST or 4 * len(groups) > len(rows):
        return None
    loads, along = _along(graph, residual[:begun], order, sums)
    if along is None:
        return None
    return ContactColumns(tuple(sums), groups, {k: tuple(v) for k, v in rows.items()}, tuple(operands), loads, along)


def _dependences(
    graph: Graph, order: Sequence[int], sums: Sequence[StatedSum], index: dict[int, int]
) -> dict[int, frozenset[int]] | None:
    """The states of pairs that nodes depend on but for what pairs exert on bodies; None where that is not known."""
    slots = {one.function.name: one.slots for one in sums}
    states = {k for one in sums for k in one.slots}
    result: dict[int, frozenset[int]] = {i: frozenset([k]) for i, k in index.items() if k in states}
    for i in order:
        operation, *operands = graph.nodes[i]
        call = pair_call(graph, operation)
        if call is not None:
            function = call.function
            if call.part not in ("given", "sum", "item"):
                return None
            if call.part != "item" or not function.states:
                continue
            number = call.numbers[0]
            if number == WRENCH * function.bodies:
                return None
            if number < WRENCH * function.bodies:
                result[i] = frozenset([LOADED])
                continue
            each = min(kind.states for kind in function.kinds)
            first = (number - WRENCH * function.bodies - 1) // each * each
            result[i] = frozenset(slots[function.name][first : first + each]) - {-1}
        elif operation not in ("const", "sym"):
            sets = {result[k] for k in operands if k in result}
            if sets:
                result[i] = next(iter(sets)) if len(sets) == 1 else frozenset().union(*sets)
    return result


def _groups(rows: dict[int, list[int]]) -> tuple[tuple[int, ...], ...]:
    """Columns that share no row, each in the first group that it fits in."""
    groups: list[list[int]] = []
    taken: list[set[int]] = []
    for column, entries in rows.items():
        at = next((k for k, used in enumerate(taken) if used.isdisjoint(entries)), len(groups))
        if at == len(groups):
            groups.append([])
            taken.append(set())
        groups[at].append(column)
        taken[at].update(entries)
    return tuple(map(tuple, groups))


def _along(
    graph: Graph, residual: Sequence[Expr], order: Sequence[int], sums: Sequence[StatedSum]
) -> tuple[tuple[str, ...], tuple[Expr, ...] | None]:
    """Symbols of wrenches, and the residual along them: None where their effect depends on themselves."""
    starts: dict[str, int] = {}
    total = 0
    for one in sums:
        starts[one.function.name] = total
        total += WRENCH * one.function.bodies
    symbols = [graph.symbol(f"load[{k}]") for k in range(total)]
    seeds = [graph.symbol(f"d(load[{k}])") for k in range(total)]
    mapping: dict[Expr, Expr] = {}
    for i in order:
        call = pair_call(graph, graph.nodes[i][0])
        if call is None or call.part != "item" or call.function.name not in starts:
            continue
        if call.numbers[0] < WRENCH * call.function.bodies:
            mapping[Expr(graph, i)] = symbols[starts[call.function.name] + call.numbers[0]]
    along = jvp(substitute(residual, mapping), dict(zip(symbols, seeds, strict=True)))
    names = tuple(f"d(load[{k}])" for k in range(total))
    independent = symbols_of(along).isdisjoint(f"load[{k}]" for k in range(total))
    return names, tuple(along) if independent else None
