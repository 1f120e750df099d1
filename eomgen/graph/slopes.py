"""Stage graph: a node -> its partial derivatives with respect to its operands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..operations import OPERATIONS
from .core import Graph
from .functions import raised


def half_power_slope(g: Graph, a: int, b: int) -> tuple[int, int] | None:
    """Where a b is c^n sqrt(c), n = 1, 2, ...: c and the slope by it, (n + 1/2) c^(n-1) sqrt(c); else None.

    By the product rule the slope at c = 0 would be 0 times infinity.
    """
    for root, rest in ((a, b), (b, a)):
        if g.nodes[root][0] == "sqrt":
            c = g.nodes[root][1]
            n = _exponent(g, rest, c)
            if n:
                power = g.make("pow", c, g.constant(n - 1.0).id)
                return c, g.mul(g.constant(n + 0.5).id, g.mul(power, root))
    return None


def _exponent(g: Graph, i: int, base: int) -> int:
    """n where node i is the product base^n, else 0."""
    if i == base:
        return 1
    node = g.nodes[i]
    if node[0] != "mul":
        return 0
    first = _exponent(g, node[1], base)
    second = first and (first if node[1] == node[2] else _exponent(g, node[2], base))
    return first + second if second else 0


def partials(g: Graph, i: int, active: Sequence[bool]) -> list[int]:
    """Partial derivatives of a smooth node with respect to its operands (zero where not active)."""
    node = g.nodes[i]
    if node[0] in g.calls:
        return _call_partials(g, node, active)
    slopes = zip(OPERATIONS[node[0]].slopes, active, strict=True)
    return [slope(g, i, *node[1:]) if wanted else g.zero.id for slope, wanted in slopes]


def _call_partials(g: Graph, node: tuple[Any, ...], active: Sequence[bool]) -> list[int]:
    """Partial derivatives of a call with respect to its arguments (zero where not active)."""
    function, orders = g.calls[node[0]]
    return [g.call(function, raised(orders, i), node[1:]) if wanted else g.zero.id for i, wanted in enumerate(active)]
