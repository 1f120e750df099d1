"""Stage verification, rounding: expressions at doubles -> their values, and how far rounding can have moved each.

A running error analysis (N. J. Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed. 2002, sec. 3.3): every
operation adds its own rounding to what its operands bring.  The generated code may form a node in another way than the
graph says (a product by a reciprocal, a fused multiplication, sine and cosine of a sum from those of its parts, a
vector library's sine); :data:`UNIT` is what one node may be off by for all of these together.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ..graph.core import Expr
from ..graph.elementary import ELEMENTARY, Elementary
from ..graph.evaluate import FUNCTIONS
from ..graph.traverse import common_graph, reachable
from ..limits.rounding import EPS
from ..limits.verification import NUDGE
from ..numeric.scales import Array

#: Relative rounding of one node: at most three roundings to nearest (a reciprocal, a product, a sum), and one unit in
#: the last place, 2 roundings, of a function; 4 half units each way.
UNIT = 2.0 * EPS
TURN = 2.0 * UNIT  #: absolute error of a sine or cosine formed from those of the parts of a sum: two products, a sum
#: Relative error of constants that are formed in doubles while the graph is made and count as exact in it: turns by
#: given angles, products of them along fixed parts, inertias in link axes.
FOLDED = 16.0 * EPS

Pair = tuple[Array, Array]  # value, bound of its error
Rule = Callable[..., tuple[Any, Any]]


def _multiply(a: Pair, b: Pair) -> tuple[Any, Any]:
    v = a[0] * b[0]
    return v, abs(a[0]) * b[1] + abs(b[0]) * a[1] + a[1] * b[1] + UNIT * abs(v)


def _divide(a: Pair, b: Pair) -> tuple[Any, Any]:
    v = a[0] / b[0]
    return v, (a[1] + abs(v) * b[1]) / abs(b[0]) + UNIT * abs(v)


def _power(a: Pair, b: Pair) -> tuple[Any, Any]:
    v = np.power(a[0], b[0])
    slope = np.where(a[1] > 0.0, abs(b[0] * np.power(a[0], b[0] - 1.0)), 0.0)
    other = np.where(b[1] > 0.0, abs(v * np.log(abs(a[0]))), 0.0)
    return v, slope * a[1] + other * b[1] + UNIT * (2.0 + abs(b[0])) * abs(v)  # repeated products where b is whole


def _root(a: Pair) -> tuple[Any, Any]:
    v = np.sqrt(a[0])
    return v, np.minimum(0.5 * a[1] / v if np.all(v > 0.0) else np.inf, np.sqrt(a[1])) + UNIT * v


def _arc(a: Pair, b: Pair) -> tuple[Any, Any]:
    v, square = np.arctan2(a[0], b[0]), a[0] * a[0] + b[0] * b[0]
    return v, (abs(b[0]) * a[1] + abs(a[0]) * b[1]) / square + UNIT * abs(v)


def _smooth(function: Elementary, floor: float) -> Rule:
    """A function of one argument by its slope; ``floor`` is an absolute error of its own."""

    def rule(a: Pair) -> tuple[Any, Any]:
        v = getattr(np, function.array)(a[0])
        return v, abs(function.rate(a[0], v)) * a[1] + UNIT * abs(v) + floor

    return rule


RULES: dict[str, Rule] = {
    "add": lambda a, b: (a[0] + b[0], a[1] + b[1] + UNIT * abs(a[0] + b[0])),
    "sub": lambda a, b: (a[0] - b[0], a[1] + b[1] + UNIT * abs(a[0] - b[0])),
    "mul": _multiply,
    "div": _divide,
    "neg": lambda a: (-a[0], a[1]),
    "pow": _power,
    "sqrt": _root,
    **{name: _smooth(f, TURN if name in ("sin", "cos") else 0.0) for name, f in ELEMENTARY.items()},
    "atan2": _arc,
    "abs": lambda a: (abs(a[0]), a[1]),
    "min": lambda a, b: (np.minimum(a[0], b[0]), np.maximum(a[1], b[1])),
    "max": lambda a, b: (np.maximum(a[0], b[0]), np.maximum(a[1], b[1])),
    "select": lambda c, a, b: (np.where(c[0] != 0.0, a[0], b[0]), np.where(c[0] != 0.0, a[1], b[1])),
}
EXACT = ("sign", "lt", "le", "eq", "not", "and", "or")  #: whose results are whole numbers


def bounded(outputs: Sequence[Expr], values: Mapping[str, Array], count: int) -> Pair:
    """Evaluate expressions at several states, with bounds of rounding.

    Parameters
    ----------
    outputs : sequence of n Expr
    values : mapping of str to (k,) array
        Of every symbol that is needed, taken as exact.
    count : int
        Number of states k.

    Returns
    -------
    values, bounds : (n, k) arrays
        In double arithmetic, and the most by which any other order of the same operations can differ from the exact
        value, to first order.
    """
    graph = common_graph(outputs)
    none = np.zeros(count)
    if graph is None:
        return np.zeros((0, count)), np.zeros((0, count))
    found: dict[int, Pair] = {}
    with np.errstate(all="ignore"):
        for i in reachable(graph, (y.id for y in outputs)):
            operation, *args = graph.nodes[i]
            if operation == "const":
                found[i] = np.full(count, float(args[0])), none
            elif operation == "sym":
                found[i] = np.broadcast_to(np.asarray(values[args[0]], dtype=float), (count,)), none
            elif operation in EXACT:
                found[i] = FUNCTIONS[operation][1](*(found[k][0] for k in args)), none
            elif operation in RULES:
                found[i] = RULES[operation](*(found[k] for k in args))
            else:
                function, orders = graph.calls[operation]
                found[i] = _called(function.implementation(orders), [found[k] for k in args])
    return np.array([found[y.id][0] for y in outputs]), np.array([found[y.id][1] for y in outputs])


def _called(function: Callable[..., Any], given: Sequence[Pair]) -> tuple[Any, Any]:
    """A declared function; its slopes are estimated by differences."""
    at = [a for a, _ in given]
    value = np.asarray(function(*at), dtype=float)
    bound = 8.0 * UNIT * abs(value)  # a cubic and its weights
    for k, (a, error) in enumerate(given):
        shift = NUDGE * (1.0 + abs(a))
        up, down = (np.asarray(function(*at[:k], a + s, *at[k + 1 :]), dtype=float) for s in (shift, -shift))
        bound = bound + abs(up - down) / (2.0 * shift) * error
    return value, bound
