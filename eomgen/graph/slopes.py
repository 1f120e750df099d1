"""Stage graph: a node -> its partial derivatives with respect to its operands."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from .core import Graph
from .elementary import ELEMENTARY, over
from .functions import raised

#: Operations that take one of several branches; what a branch not taken does must not leak into the derivative.
BRANCHING = frozenset({"select", "min", "max"})
#: Operations whose derivative is zero wherever it exists.
FLAT = frozenset({"sign", "lt", "le", "eq", "not", "and", "or"})


def _square(g: Graph, a: int) -> int:
    return g.mul(a, a)


#: Slope of y = f(a) of each function of one operand, from (graph, id of y, id of a).
SLOPES: dict[str, Callable[[Graph, int, int], int]] = {
    **{name: f.slope for name, f in ELEMENTARY.items()},
    "sqrt": lambda g, y, a: g.div(g.constant(0.5).id, y),
    "abs": lambda g, y, a: g.make("sign", a),
}


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
    operation, a = node[0], node[1]
    if operation in g.calls:
        return _call_partials(g, node, active)
    zero = g.zero.id
    slope = SLOPES.get(operation)
    if slope is not None:
        return [slope(g, i, a)]
    b = node[2]
    if operation == "mul":
        return [b, a]
    if operation == "div":
        if not active[1]:
            return [over(g, b), zero]
        r = over(g, b)
        return [r, g.neg(g.mul(i, r))]
    if operation == "pow":  # b a^(b-1), y log a
        base = g.mul(b, g.make("pow", a, g.sub(b, g.one.id))) if active[0] else zero
        return [base, g.mul(i, g.make("log", a)) if active[1] else zero]
    if operation == "atan2":  # a = opposite, b = adjacent
        r = over(g, g.add(_square(g, a), _square(g, b)))
        return [g.mul(b, r), g.neg(g.mul(a, r))]
    raise ValueError(f"operation {operation!r} has no derivative")


def choice(g: Graph, i: int) -> tuple[int, int, int]:
    """A branching node as (condition, operand if true, operand if false)."""
    node = g.nodes[i]
    if node[0] == "select":
        return node[1], node[2], node[3]
    a, b = node[1], node[2]
    return (g.make("le", a, b) if node[0] == "min" else g.make("le", b, a)), a, b


def _call_partials(g: Graph, node: tuple[Any, ...], active: Sequence[bool]) -> list[int]:
    """Partial derivatives of a call with respect to its arguments (zero where not active)."""
    function, orders = g.calls[node[0]]
    return [g.call(function, raised(orders, i), node[1:]) if wanted else g.zero.id for i, wanted in enumerate(active)]
