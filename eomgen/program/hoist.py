"""Stage program: blocks -> the values that depend on parameters only, computed once per parameter set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..graph.core import Expr, Graph
from ..graph.count import Operations, count
from ..graph.traverse import LEAVES, reachable


def hoist(graph: Graph, roots: Sequence[Expr], parameters: Sequence[str]) -> tuple[tuple[Expr, ...], frozenset[int]]:
    """Find the maximal operations of parameters only.

    Returns
    -------
    hoisted : tuple of Expr
        Operations of parameters and numbers only that something else uses, ascending by id.
    parameter_only : frozenset of int
        Ids of all operations of parameters and numbers only.
    """
    nodes = graph.nodes
    names = frozenset(parameters)
    fixed: set[int] = set()  # leaves included
    inner: set[int] = set()
    hoisted: set[int] = set()
    for i in reachable(graph, (y.id for y in roots)):
        node = nodes[i]
        if node[0] in LEAVES:
            if node[0] == "const" or node[1] in names:
                fixed.add(i)
        elif all(k in fixed for k in node[1:]):
            fixed.add(i)
            inner.add(i)
        else:
            hoisted.update(k for k in node[1:] if k in inner)
    hoisted.update(y.id for y in roots if y.id in inner)
    return tuple(Expr(graph, i) for i in sorted(hoisted)), frozenset(inner)


def count_apart(outputs: Sequence[Expr], parameter_only: frozenset[int]) -> Operations:
    """Operations of the outputs without those of parameters only."""
    if not outputs:
        return Operations()
    graph = outputs[0].graph
    used = reachable(graph, (y.id for y in outputs))
    every, apart = count(outputs), count([Expr(graph, i) for i in used if i in parameter_only])
    return Operations(
        every.multiplications - apart.multiplications,
        every.additions - apart.additions,
        every.divisions - apart.divisions,
        every.negations - apart.negations,
        _difference(every.functions, apart.functions),
        _difference(every.choices, apart.choices),
    )


def _difference(a: Mapping[str, int], b: Mapping[str, int]) -> dict[str, int]:
    return {name: n - b.get(name, 0) for name, n in a.items() if n != b.get(name, 0)}
