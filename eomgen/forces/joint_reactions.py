"""Force elements, reactions: the symbols by which laws speak of what a joint, or an equation of constraint, carries."""

from __future__ import annotations

import re

from ..graph.core import Expr, Graph

_MULTIPLIER = re.compile(r"multiplier\((.+)\)\Z")
_SYMBOL = re.compile(r"reaction\((.+)\)\[([0-5])\]\Z")


def reaction_symbol(graph: Graph, joint: str, k: int) -> Expr:
    """Force (k = 0, 1, 2) or moment (3, 4, 5) that P exerts on S at S, along the axes of S (N, N m)."""
    return graph.symbol(f"reaction({joint})[{k}]")


def reaction_of(symbol: str) -> tuple[str, int] | None:
    """Joint and component of such a symbol's name; None for other names."""
    found = _SYMBOL.match(symbol)
    return (found[1], int(found[2])) if found else None


def multiplier_of(symbol: str) -> str | None:
    """Equation, or element of one equation, of the symbol of a multiplier, ``multiplier(mesh.ratio)``; else None."""
    found = _MULTIPLIER.match(symbol)
    return found[1] if found else None


def is_carried(symbol: str) -> bool:
    """Whether a symbol stands for a reaction or a multiplier."""
    return symbol.endswith((")", "]")) and (reaction_of(symbol) is not None or multiplier_of(symbol) is not None)
