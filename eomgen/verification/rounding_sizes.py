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

from ..base.algebra import Array
from ..base.limits.analyses import NUDGE, PAIR_ROUNDING
from ..base.limits.numbers import EPS
from ..base.operations import OPERATIONS, Operation
from ..graph.core import Expr
from ..graph.pair_calls import PairCall
from ..graph.traverse import common_graph, reachable

#: Relative rounding of one node: at most three roundings to nearest (a reciprocal, a product, a sum), and one unit in
#: the last place, 2 roundings, of a function; 4 half units each way.
UNIT = 2.0 * EPS
#: Relative error of constants that are formed in doubles while the graph is made and count as exact in it: turns by
#: given angles, products of them along fixed parts, inertias in link axes.
FOLDED = 16.0 * EPS

Pair = tuple[Array, Array]  # value, bound of its error


def _apply(row: Operation, given: Sequence[Pair]) -> Pair:
    """An operation and its bound: of first order where the row does not know better, and its own rounding."""
    x, e = [a for a, _ in given], [error for _, error in given]
    y = row.array(*x)
    if row.error is not None:
        bound = row.error(y, x, e)
    else:
        slopes = zip(row.rates, e, strict=True) if row.rates else ()
        bound = sum((np.where(error > 0.0, rate(y, *x) * error, 0.0) for rate, error in slopes), np.zeros_like(y))
    return y, bound if row.exact else bound + UNIT * row.rounding(y, *x)


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
            elif operation in OPERATIONS:
                found[i] = _apply(OPERATIONS[operation], [found[k] for k in args])
            else:
                function, orders = graph.calls[operation]
                if isinstance(function, PairCall):
                    found[i] = _of_pairs(function, [found[k] for k in args])
                    continue
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


def _of_pairs(call: PairCall, given: Sequence[Any]) -> Any:
    """A node of a sum over pairs: lists of values and bounds, whose slopes are estimated by differences."""
    if call.part == "given":
        return list(given)
    if call.part == "item":
        return given[0][call.numbers[0]]
    operands = [*given[0], *given[1:]]  # of a slope the rates follow
    function = call.implementation(())
    count = len(given[0])

    def value(at: Sequence[Any]) -> np.ndarray:
        return np.asarray(function(list(at[:count]), *at[count:]), dtype=float)

    at = [a for a, _ in operands]
    found = value(at)
    size = abs(found)  # a component of a body's force or moment may be what is left of the others
    wrenches = 6 * call.function.bodies
    size[:wrenches] = np.repeat(size[:wrenches].reshape(-1, 6, *size.shape[1:]).max(axis=1), 6, axis=0)
    bounds = PAIR_ROUNDING * UNIT * size
    for k, (a, own) in enumerate(operands):
        error = own + PAIR_ROUNDING * UNIT * abs(a)
        if np.any(error):
            shift = NUDGE * (1.0 + abs(a))
            up, down = (value([*at[:k], a + s, *at[k + 1 :]]) for s in (shift, -shift))
            bounds = bounds + abs(up - down) / (2.0 * shift) * error
    return list(zip(found, bounds, strict=True))
