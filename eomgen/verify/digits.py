"""Expressions -> their values with 50 digits, and how far rounding can have moved each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import factorial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..base.algebra import Array
from ..base.limits.numbers import EPS
from ..base.operations import OPERATIONS, Operation
from ..contact.pairs import PairCall
from ..errors import MissingDependencyError
from ..expr.core import Expr, common_graph, reachable
from .limits import NUDGE, PAIR_ROUNDING

# -- values by mpmath --------------------------------------------------------------------------------------------------

# Digits to spare make differences exact enough to judge derivatives: of a step 1e-16 in 60 digits a central difference
# has 30 of them.


DIGITS = 60
FIRST = "1e-16"  #: step of first differences: truncation 1e-32, rounding 1e-44
SECOND = "1e-12"  #: step of second differences: truncation 1e-24, rounding 1e-36

Number = Any  # mpmath's mpf
Numbers: TypeAlias = NDArray[np.object_]  #: arrays of these, of any shape


def array(values: Any) -> Numbers:
    """Numbers of many digits, in lists of lists, as an array."""
    return np.array(values, dtype=object)


def numbers(values: Any) -> Array:
    """Numbers of many digits as an array of doubles."""
    return np.asarray(values, dtype=float)


def context() -> Any:
    """Arithmetic of mpmath with :data:`DIGITS`, apart from that of the user."""
    try:
        from mpmath import MPContext  # type: ignore[import-untyped]
    except ImportError:
        message = "verify computes with 50 digits and needs mpmath for this (it comes with SymPy): pip install mpmath"
        raise MissingDependencyError(message) from None
    made = MPContext()
    made.dps = DIGITS
    return made


class Digits:
    """Expressions ready to be evaluated in many digits.

    A function that is declared from outside is known in doubles only.  It is taken as its Taylor polynomial of second
    order about the arguments of the first evaluation at a state, so that differences see a smooth function.
    """

    def __init__(self, mp: Any, outputs: Sequence[Expr]) -> None:
        self.mp = mp
        graph = common_graph(outputs)
        order = reachable(graph, (y.id for y in outputs)) if graph is not None else []
        slot = {i: k for k, i in enumerate(order)}
        self._outputs = [slot[y.id] for y in outputs]
        self._steps: list[tuple[str | None, Any, tuple[int, ...]]] = []  # name of a symbol, or operation and operands
        loops: dict[Any, Any] = {}
        for i in order:
            assert graph is not None
            operation, *args = graph.nodes[i]
            if operation == "sym":
                self._steps.append((args[0], None, ()))
            elif operation == "const":
                self._steps.append((None, mp.mpf(args[0]), ()))
            elif operation in OPERATIONS:
                row = OPERATIONS[operation]
                self._steps.append((None, getattr(mp, row.digits, row.value), tuple(slot[k] for k in args)))
            else:
                function, orders = graph.calls[operation]
                if isinstance(function, PairCall):
                    if function.function not in loops:
                        loops[function.function] = function.function.evaluator(partial(_each, mp))
                    call = function.on_numbers(loops[function.function])
                else:
                    call = _Local(mp, function, orders)
                self._steps.append((None, call, tuple(slot[k] for k in args)))

    def __call__(self, values: Mapping[str, Number]) -> Numbers:
        data: list[Number] = []
        for name, operation, args in self._steps:
            if name is not None:
                data.append(values[name])
            elif args:
                data.append(operation(*(data[k] for k in args)))
            else:
                data.append(operation)
        return array([data[k] for k in self._outputs])


class _Local:
    """A declared function near a point."""

    NEAR = 1e-6

    def __init__(self, mp: Any, function: Any, orders: tuple[int, ...]) -> None:
        self.mp, self.function, self.orders = mp, function, orders
        self.centre: list[float] | None = None
        self.terms: list[tuple[tuple[int, ...], Any]] = []

    def __call__(self, *x: Number) -> Number:
        if self.centre is None or max(abs(float(a - b)) for a, b in zip(x, self.centre, strict=True)) > self.NEAR:
            self._expand([float(a) for a in x])
        assert self.centre is not None
        steps = [a - b for a, b in zip(x, self.centre, strict=True)]
        total = self.mp.mpf(0)
        for powers, value in self.terms:
            term = value
            for step, power in zip(steps, powers, strict=True):
                if power:
                    term = term * step**power / factorial(power)
            total += term
        return total

    def _expand(self, centre: list[float]) -> None:
        from ..expr.functions import up_to

        self.centre, self.terms = centre, []
        for total in range(3):
            for powers in up_to(self.function.arity, total):
                orders = tuple(a + b for a, b in zip(self.orders, powers, strict=True))
                highest = self.function.highest
                if highest is None or max(orders) <= highest:
                    value = self.function.implementation(orders)(*centre)
                    self.terms.append((powers, self.mp.mpf(float(value))))


def solve(A: Numbers, y: Numbers) -> Numbers:
    """The x (n,) with A x = y, by elimination with row pivots.

    Raises
    ------
    ZeroDivisionError
        A is singular.
    """
    n, rows = len(A), np.column_stack([A, y])
    for k in range(n):
        best = k + int(abs(rows[k:, k]).argmax())
        rows[[k, best]] = rows[[best, k]]
        for row in rows[k + 1 :]:
            if row[k]:
                row[k + 1 :] -= row[k] / rows[k, k] * rows[k, k + 1 :]
    x = rows[:, n]
    for i in reversed(range(n)):
        x[i] = (x[i] - rows[i, i + 1 : n] @ x[i + 1 :]) / rows[i, i]
    return x


def _each(mp: Any, outputs: list[Expr], names: Sequence[str]) -> Any:
    """The law of a pair on arrays of such numbers: one pair after the other."""
    evaluate = Digits(mp, outputs)

    def value(raw: Sequence[Any]) -> list[Any]:
        rows = np.broadcast_arrays(*raw)
        shape = rows[0].shape
        result = [evaluate(dict(zip(names, one, strict=True))) for one in zip(*(r.ravel() for r in rows), strict=True)]
        made = np.empty((len(outputs), len(result)), dtype=object)
        for k, column in enumerate(result):
            made[:, k] = column
        return [row.reshape(shape) for row in made]

    return value


# -- sizes of rounding -------------------------------------------------------------------------------------------------

# A running error analysis (N. J. Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed. 2002, sec. 3.3): every
# operation adds its own rounding to what its operands bring. The generated code may form a node in another way than the
# graph says (a product by a reciprocal, a fused multiplication, sine and cosine of a sum from those of its parts, a
# vector library's sine); :data:`UNIT` is what one node may be off by for all of these together.


#: Relative rounding of one node: at most three roundings to nearest (a reciprocal, a product, a sum), and one unit in
#: the last place, 2 roundings, of a function; 4 half units each way.
UNIT = 2.0 * EPS
#: Relative error of constants that are formed in doubles while the graph is made and count as exact in it: turns by
#: given angles, products of them along fixed parts, inertias in link axes.
FOLDED = 16.0 * EPS

Pair = tuple[Array, Array]  # value, bound of its error


def _apply(row: Operation, raw: Sequence[Pair]) -> Pair:
    """An operation and its bound: of first order where the row does not know better, and its own rounding."""
    x, e = [a for a, _ in raw], [error for _, error in raw]
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
    result: dict[int, Pair] = {}
    with np.errstate(all="ignore"):
        for i in reachable(graph, (y.id for y in outputs)):
            operation, *args = graph.nodes[i]
            if operation == "const":
                result[i] = np.full(count, float(args[0])), none
            elif operation == "sym":
                result[i] = np.broadcast_to(np.asarray(values[args[0]], dtype=float), (count,)), none
            elif operation in OPERATIONS:
                result[i] = _apply(OPERATIONS[operation], [result[k] for k in args])
            else:
                function, orders = graph.calls[operation]
                if isinstance(function, PairCall):
                    result[i] = _of_pairs(function, [result[k] for k in args])
                    continue
                result[i] = _called(function.implementation(orders), [result[k] for k in args])
    return np.array([result[y.id][0] for y in outputs]), np.array([result[y.id][1] for y in outputs])


def _called(function: Callable[..., Any], raw: Sequence[Pair]) -> tuple[Any, Any]:
    """A declared function; its slopes are estimated by differences."""
    at = [a for a, _ in raw]
    value = np.asarray(function(*at), dtype=float)
    bound = 8.0 * UNIT * abs(value)  # a cubic and its weights
    for k, (a, error) in enumerate(raw):
        shift = NUDGE * (1.0 + abs(a))
        up, down = (np.asarray(function(*at[:k], a + s, *at[k + 1 :]), dtype=float) for s in (shift, -shift))
        bound = bound + abs(up - down) / (2.0 * shift) * error
    return value, bound


def _of_pairs(call: PairCall, raw: Sequence[Any]) -> Any:
    """A node of a sum over pairs: lists of values and bounds, whose slopes are estimated by differences."""
    if call.part == "given":
        return list(raw)
    if call.part == "item":
        return raw[0][call.numbers[0]]
    operands = [*raw[0], *raw[1:]]  # of a slope the rates follow
    function = call.implementation(())
    count = len(raw[0])

    def value(at: Sequence[Any]) -> np.ndarray:
        return np.asarray(function(list(at[:count]), *at[count:]), dtype=float)

    at = [a for a, _ in operands]
    result = value(at)
    size = abs(result)  # a component of a body's force or moment may be what is left of the others
    wrenches = 6 * call.function.bodies
    size[:wrenches] = np.repeat(size[:wrenches].reshape(-1, 6, *size.shape[1:]).max(axis=1), 6, axis=0)
    bounds = PAIR_ROUNDING * UNIT * size
    for k, (a, operand) in enumerate(operands):
        error = operand + PAIR_ROUNDING * UNIT * abs(a)
        if np.any(error):
            shift = NUDGE * (1.0 + abs(a))
            up, down = (value([*at[:k], a + s, *at[k + 1 :]]) for s in (shift, -shift))
            bounds = bounds + abs(up - down) / (2.0 * shift) * error
    return list(zip(result, bounds, strict=True))
