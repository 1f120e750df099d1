"""Stage program, pieces of laws: |N|, max(0, N), N (N > 0) -> the smooth laws that they are made of.

Where a law bends, another piece of it holds at another N, with other slopes.  A piece takes one side of every choice
that depends on reactions, wherever in the law it stands; a condition counts as 0 or 1 in all places at once.  A choice
that keeps a root or a quotient in its domain, inside a branch of the same condition, stays as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ..base.operations import CONDITION, operations_with
from ..graph.core import Expr, Graph
from ..graph.substitute import substitute
from ..graph.traverse import reachable

#: Most pieces of one law: what is written out grows with them.
MANY = 64

_CONDITIONS = operations_with(lambda row: row.kind == CONDITION)
_FRAGILE = operations_with(lambda row: row.fragile)
_BENDS = {"abs", "sign", "max", "min", "select"} | _CONDITIONS  #: what has two sides


def pieces_of(law: Expr, speaks: Callable[[str], bool]) -> list[Expr] | None:
    """The smooth pieces of a law that depend on symbols of which one speaks; None where there are too many."""
    found: dict[Expr, None] = {}
    waiting: list[tuple[Expr, frozenset[int]]] = [(law, frozenset())]
    while waiting:
        x, decided = waiting.pop()
        dependent = dependent_on([x], speaks)
        choice = _next_choice(x, dependent, decided)
        if choice is not None:
            waiting += [(side, decided | {choice.id}) for side in _sides(x, choice, dependent)]
        elif x.id in dependent and -x not in found:
            found[x] = None
        if len(found) + len(waiting) > MANY:
            return None
    return list(found)


def dependent_on(entries: Sequence[Expr], speaks: Callable[[str], bool]) -> set[int]:
    """Ids of all nodes that depend on such symbols."""
    found: set[int] = set()
    for graph in {entry.graph for entry in entries}:
        for i in reachable(graph, [entry.id for entry in entries]):
            node = graph.nodes[i]
            inner = speaks(node[1]) if node[0] == "sym" else node[0] != "const" and not found.isdisjoint(node[1:])
            if inner:
                found.add(i)
    return found


def _next_choice(x: Expr, dependent: set[int], decided: frozenset[int]) -> Expr | None:
    """The choice to take a side of: of a condition, what it is made of comes first."""
    nodes = x.graph.nodes

    def open_in(roots: Sequence[int]) -> list[int]:
        found = []
        for i in reachable(x.graph, roots):
            if i in dependent and i not in decided and nodes[i][0] in _BENDS:
                by = nodes[i][1]
                if nodes[i][0] != "select" or (by in dependent and by not in decided):
                    found.append(i)
        return found

    every = open_in([x.id])
    if not every:
        return None
    top = max(every)
    operation, *operands = nodes[top]
    first = []
    if operation == "select":
        first = open_in(operands[:1])
    elif operation in _CONDITIONS:
        first = open_in(operands)
    return Expr(x.graph, min(first) if first else top)


def _sides(x: Expr, choice: Expr, dependent: set[int]) -> list[Expr]:
    """An expression with either side of a choice."""
    graph = x.graph
    operation, *operands = choice.node
    if operation in _CONDITIONS or operation == "sign":
        low = -1.0 if operation == "sign" else 0.0
        return [_with_condition(x, choice, value, dependent) for value in (1.0, low)]
    inner = Expr(graph, operands[-1])
    sides = [inner, -inner] if operation == "abs" else [Expr(graph, operands[-2]), inner]
    return [substitute([x], {choice: side})[0] for side in sides]


def _with_condition(x: Expr, condition: Expr, value: float, dependent: set[int]) -> Expr:
    graph = x.graph
    mapping = {condition: graph.lift(value)}
    for i in reachable(graph, [x.id]):
        node = graph.nodes[i]
        if node[0] == "select" and node[1] == condition.id:
            side = node[2] if value else node[3]
            if _keeps_domain(graph, side, condition.id, dependent):
                mapping[Expr(graph, i)] = Expr(graph, side)
    return substitute([x], mapping)[0]


def _keeps_domain(graph: Graph, side: int, condition: int, dependent: set[int]) -> bool:
    """Whether a branch asks for its condition again, with roots or quotients of what depends on reactions."""
    below = [graph.nodes[i] for i in reachable(graph, [side]) if i in dependent]
    again = any(node[0] == "select" and node[1] == condition for node in below)
    return again and any(node[0] in _FRAGILE and not dependent.isdisjoint(node[-1:]) for node in below)
