"""Stage graph: expressions and replacements -> expressions with the replacements made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from .core import Expr
from .traverse import common_graph, marked_again, reachable

FEW = 256  #: nodes that are not worth parts of their own


def substitute(outputs: Sequence[Expr], mapping: Mapping[Expr, Expr]) -> list[Expr]:
    """Replace nodes (symbols or whole subexpressions) everywhere in the outputs, all at once.

    Parameters
    ----------
    outputs : sequence of Expr
        Expressions of one graph.
    mapping : mapping of Expr to Expr
        Node -> replacement.  Replacements are not searched again, so ``{x: y, y: x}`` exchanges x and y.

    Returns
    -------
    list of Expr
        One per output, simplified as all new nodes are.
    """
    graph = common_graph(outputs, list(mapping), list(mapping.values()))
    if graph is None:
        return []
    nodes, make = graph.nodes, graph.make
    new = {old.id: replacement.id for old, replacement in mapping.items()}
    replaced = frozenset(new)
    order = reachable(graph, (y.id for y in outputs), stop=replaced)
    for part in [order] if len(order) < FEW else marked_again(graph, order):
        for i in part:
            node = nodes[i]
            if i in replaced or node[0] in ("const", "sym"):
                continue
            old: tuple[int, ...] = node[1:]
            for k in old:
                if k in new:
                    new[i] = make(node[0], *[new.get(j, j) for j in old])
                    break
    return [Expr(graph, new.get(y.id, y.id)) for y in outputs]


def symbols_of(outputs: Sequence[Expr]) -> set[str]:
    """Names of all symbols the outputs depend on."""
    graph = common_graph(outputs)
    if graph is None:
        return set()
    nodes = graph.nodes
    return {nodes[i][1] for i in reachable(graph, (y.id for y in outputs)) if nodes[i][0] == "sym"}
