"""Force elements, reactions: the symbols by which laws speak of the force and moment that a joint carries."""

from __future__ import annotations

import re

from ..graph.core import Expr, Graph

_SYMBOL = re.compile(r"reaction\((.+)\)\[([0-5])\]\Z")


def reaction_symbol(graph: Graph, joint: str, k: int) -> Expr:
    """Force (k = 0, 1, 2) or moment (3, 4, 5) that P exerts on S at S, along the axes of S (N, N m)."""
    return graph.symbol(f"reaction({joint})[{k}]")


def reaction_of(symbol: str) -> tuple[str, int] | None:
    """Joint and component of such a symbol's name; None for other names."""
    found = _SYMBOL.match(symbol)
    return (found[1], int(found[2])) if found else None
