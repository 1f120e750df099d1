"""Stage graph: roots -> the ids of the nodes they are made of, in topological order."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Container, Iterable, Iterator, Sequence
from operator import itemgetter

from .core import Expr, Graph
from .nodes import Node

LEAVES = frozenset({"const", "sym"})
MANY = 100  #: so many roots are those of a big model: what they are made of is asked for again and again
KEPT = 12  #: answers kept


def operands(node: Node) -> tuple[int, ...]:
    """The operand ids of a node; none for constants and symbols."""
    return () if node[0] in LEAVES else node[1:]


def reachable(graph: Graph, roots: Iterable[int], stop: Container[int] = ()) -> list[int]:
    """Ids of all nodes that the roots are made of, the roots included, ascending.

    Operands have smaller ids than the nodes that use them, so every node comes after its operands.  The operands of
    nodes in ``stop`` are not entered.
    """
    nodes = graph.nodes
    seen = set(roots)
    key = None if stop or len(seen) < MANY else frozenset(seen)
    if key is not None and key in graph.reached:
        return list(graph.reached[key])
    stack = list(seen)
    while stack:
        i = stack.pop()
        if stop and i in stop:
            continue
        node = nodes[i]
        if len(node) == 3:  # most nodes: two operands, without a loop
            _, a, b = node
            if a not in seen:
                seen.add(a)
                stack.append(a)
            if b not in seen:
                seen.add(b)
                stack.append(b)
        elif node[0] not in LEAVES:
            for k in node[1:]:
                if k not in seen:
                    seen.add(k)
                    stack.append(k)
    found = sorted(seen)
    if key is not None:
        if len(graph.reached) >= KEPT:
            graph.reached.pop(next(iter(graph.reached)))
        graph.reached[key] = list(found)
    return found


def parts(graph: Graph, ids: Sequence[int]) -> list[tuple[int, Sequence[int]]]:
    """Ids in ascending order, cut where the graph has marks, each with the number of its pass; none is empty."""
    found: list[tuple[int, Sequence[int]]] = []
    marks, start = graph.marks, 0
    while start < len(ids):
        following = bisect_right(marks, ids[start], key=itemgetter(0))
        number = marks[following - 1][1] if following else 0
        end = bisect_left(ids, marks[following][0], start) if following < len(marks) else len(ids)
        found.append((number, ids[start:end]))
        start = end
    return found


def marked_again(graph: Graph, ids: Sequence[int], backwards: bool = False) -> Iterator[Sequence[int]]:
    """Ids in ascending order by parts, the last first if asked; what is made of each is a part of its own."""
    passes: dict[int, int] = {0: 0}
    found = parts(graph, ids)
    for number, part in reversed(found) if backwards else found:
        if number not in passes:
            passes[number] = graph.begin_pass()
        graph.mark(passes[number])
        yield part
    graph.mark()


def common_graph(*groups: Sequence[Expr]) -> Graph | None:
    """The one graph of all these expressions, None if there are none.

    Raises
    ------
    ValueError
        Expressions of different graphs.
    """
    graph: Graph | None = None
    for group in groups:
        for x in group:
            if graph is None:
                graph = x.graph
            elif x.graph is not graph:
                raise ValueError("expressions of different graphs cannot be used together")
    return graph
