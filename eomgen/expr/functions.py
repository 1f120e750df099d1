"""Functions of the user (tables, native code) -> their values at floats or arrays; their calls as nodes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ModelError, Problem
from .records import Record

# -- values ------------------------------------------------------------------------------------------------------------

# Every evaluator is called with the arguments and then one order of derivative for each argument.  The graph's
# evaluator and the ``numpy`` target use them as they are; the C target writes the same arithmetic.


Value = Any  # float or ndarray
Numbers = Sequence[float] | np.ndarray
Orders = tuple[int, ...]


def pieces(knots: np.ndarray, x: Value) -> Any:
    """Piece of each x: 0 before the first knot, k between knots k - 1 and k, n beyond the last of n knots."""
    return np.searchsorted(knots[:-1], x, side="right") + (x > knots[-1])


class Curve:
    """A piecewise cubic of one variable between n knots, strictly increasing.

    Each of n + 1 rows of coefficients is a piece, highest power first: before the first knot, between knots, beyond the
    last; powers of the distance from the knot to the left (the first knot for the first piece).  With a period,
    arguments are brought into ``[knots[0], knots[0] + period]`` first.
    """

    def __init__(
        self, knots: Numbers, coefficients: Sequence[Sequence[float]] | np.ndarray, period: float | None = None
    ) -> None:
        self.knots = np.array(knots, dtype=float)
        self.coefficients = np.array(coefficients, dtype=float)
        self.period = period

    def __call__(self, x: Value, order: int = 0) -> Value:
        with np.errstate(all="ignore"):
            if self.period is not None:
                x = x - self.period * np.floor((x - self.knots[0]) / self.period)
                k = np.clip(pieces(self.knots, x), 1, len(self.knots) - 1)
            else:
                k = pieces(self.knots, x)
            return cubic(x - self.knots[np.maximum(k - 1, 0)], np.moveaxis(self.coefficients[k], -1, 0), order)


class Surface:
    """A piecewise bicubic of two variables on a grid of lines x and y, strictly increasing.

    ``nodes`` (n_x, n_y, 4) are f, df/dx, df/dy and d2f/dxdy at the grid points.  With slope 1 it goes on linearly
    beyond the grid, with 0 it keeps the value of its edge.
    """

    def __init__(self, x: Numbers, y: Numbers, nodes: Any, slope: float = 1.0) -> None:
        self.x, self.y = np.array(x, dtype=float), np.array(y, dtype=float)
        self.nodes = np.array(nodes, dtype=float).reshape(len(self.x), len(self.y), 4)
        self.slope = slope

    def __call__(self, x: Value, y: Value, order_x: int = 0, order_y: int = 0) -> Value:
        with np.errstate(all="ignore"):
            x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
            (i, i1), (j, j1) = _between(self.x, x), _between(self.y, y)
            low, high = (
                [*np.moveaxis(self.nodes[line, j], -1, 0), *np.moveaxis(self.nodes[line, j1], -1, 0)]
                for line in (i, i1)
            )
            along_x, along_y = (x, self.x[i], self.x[i1]), (y, self.y[j], self.y[j1])
            return bicubic(along_x, along_y, low, high, self.slope, order_x, order_y)


def _between(lines: np.ndarray, x: np.ndarray) -> tuple[Any, Any]:
    """Lower and upper grid line of each x, the same one outside."""
    k = pieces(lines, x)
    return np.maximum(k - 1, 0), np.minimum(k, len(lines) - 1)


# What follows is written into modules for CasADi and JAX as it stands, whose ``np`` has these functions too.


def cubic(h: Value, row: Sequence[Value], order: int) -> Value:
    """A cubic, or a derivative of it, at the distance h from its left end."""
    a, b, c, d = row
    if order == 0:
        return ((a * h + b) * h + c) * h + d
    if order == 1:
        return (3.0 * a * h + 2.0 * b) * h + c
    if order == 2:
        return 6.0 * a * h + 2.0 * b
    return 6.0 * a + 0.0 * h if order == 3 else 0.0 * h


def hermite(x: Value, x0: Value, x1: Value, slope: float, order: int) -> list[Value]:
    """Weights of a value, of a difference of values, and of the slopes at both ends; outside, of the edge."""
    inside = np.less(x0, x1)
    h = x - x0
    length = np.where(inside, x1 - x0, 1.0)
    s = h / length
    none = 0.0 * s
    if order == 0:
        w = (1.0 + none, s * s * (3.0 - 2.0 * s), h * (1.0 - s) * (1.0 - s), h * s * (s - 1.0))
        beyond = (1.0 + none, none, slope * h, none)
    elif order == 1:
        w = (none, 6.0 * s * (1.0 - s) / length, (1.0 - s) * (1.0 - 3.0 * s), s * (3.0 * s - 2.0))
        beyond = (none, none, slope + none, none)
    elif order == 2:
        w = (none, 6.0 * (1.0 - 2.0 * s) / (length * length), (6.0 * s - 4.0) / length, (6.0 * s - 2.0) / length)
        beyond = (none, none, none, none)
    else:
        size = 1.0 if order == 3 else 0.0
        square = 6.0 * size / (length * length) + none
        w = (none, -12.0 * size / (length * length * length) + none, square, square)
        beyond = (none, none, none, none)
    return [np.where(inside, a, b) for a, b in zip(w, beyond, strict=True)]


def combined(w: Sequence[Value], f: Value, slope: Value, g: Value, slope_g: Value) -> Value:
    """What the weights make of the values and slopes at both ends."""
    return w[0] * f + w[1] * (g - f) + w[2] * slope + w[3] * slope_g


def bicubic(
    x: tuple[Value, Value, Value], y: tuple[Value, Value, Value], low: Sequence[Value], high: Sequence[Value],
    slope: float, order_x: int, order_y: int,
) -> Value:  # fmt: skip
    """A value from the four nodes around; low and high hold those of the lower and upper line along x."""
    along_x, along_y = hermite(*x, slope, order_x), hermite(*y, slope, order_y)
    corners = []
    for k in (0, 4):
        (f, fx, fy, fxy), (g, gx, gy, gxy) = low[k : k + 4], high[k : k + 4]
        corners += [combined(along_x, f, fx, g, gx), combined(along_x, fy, fxy, gy, gxy)]
    return combined(along_y, *corners)


def base_orders(orders: Orders, known: Sequence[Orders]) -> Orders:
    """The derivative among those known from which ``orders`` takes the fewest differences."""
    below = [b for b in known if all(i <= j for i, j in zip(b, orders, strict=True))]
    return max(below, key=lambda b: (sum(b), b))


def difference_step(differences: int) -> float:
    """Relative step of nested central differences: balances their truncation, step^2, with rounding, eps/step^k."""
    return float(np.finfo(float).eps ** (1.0 / (differences + 2)))


def first_excess(orders: Orders, base: Orders) -> int:
    """The first argument in which ``orders`` exceeds ``base``."""
    return next(i for i, (a, b) in enumerate(zip(orders, base, strict=True)) if a > b)


def lowered(orders: Orders, i: int) -> Orders:
    """The orders with one derivative less along argument i."""
    return (*orders[:i], orders[i] - 1, *orders[i + 1 :])


class PythonFallback:
    """The Python side of a function written in C: its value, under ``(0, ...)``, and the derivatives that are known.

    These are called with floats, one point at a time, or with whole arrays if they are NumPy ufuncs.  Other derivatives
    are central differences of them.
    """

    def __init__(self, functions: Mapping[Orders, Callable[..., Any]]) -> None:
        self.functions = dict(functions)
        self.arity = len(next(iter(functions)))
        self._calls = {orders: _elementwise(f) for orders, f in functions.items()}

    def __call__(self, *values: Value) -> Value:
        arguments, orders = values[: self.arity], tuple(values[self.arity :]) or (0,) * self.arity
        base = base_orders(orders, list(self._calls))
        with np.errstate(all="ignore"):
            return self._difference(arguments, orders, base, difference_step(sum(orders) - sum(base)))

    def _difference(self, arguments: tuple[Value, ...], orders: Orders, base: Orders, step: float) -> Value:
        if orders == base:
            return self._calls[base](*arguments)
        i = first_excess(orders, base)
        below, x = lowered(orders, i), arguments[i]
        h = step * np.maximum(1.0, np.abs(x))
        up, down = x + h, x - h
        f = self._difference((*arguments[:i], up, *arguments[i + 1 :]), below, base, step)
        g = self._difference((*arguments[:i], down, *arguments[i + 1 :]), below, base, step)
        return (f - g) / (up - down)


def _elementwise(function: Callable[..., Any]) -> Callable[..., Any]:
    if isinstance(function, np.ufunc):
        return function

    def pointwise(*values: Any) -> float:
        try:
            return float(function(*map(float, values)))
        except (ValueError, ZeroDivisionError, OverflowError):  # outside its domain, as a C function says it
            return float("nan")

    mapped = np.vectorize(pointwise, otypes=[float])

    def apply(*values: Any) -> Any:
        return mapped(*values) if any(np.ndim(x) for x in values) else pointwise(*values)

    return apply


def up_to(arity: int, total: int) -> Iterator[Orders]:
    """All orders of ``arity`` arguments with the given total, in falling order."""
    if arity == 1:
        yield (total,)
        return
    for first in range(total, -1, -1):
        for rest in up_to(arity - 1, total - first):
            yield (first, *rest)


# -- calls -------------------------------------------------------------------------------------------------------------

# A call is a node whose operation is the text ``name(orders)``: ``spring(0)`` is the value of the function ``spring``
# of one argument, ``map(1,0)`` the derivative of ``map`` along its first.  The chain rule raises the orders.


class NativeCode(Record):
    """A function in C."""

    file: str  #: name of the source file, for messages
    text: str
    names: tuple[tuple[Orders, str], ...]  #: C functions of the value and of the derivatives that the source has


@dataclass(frozen=True, eq=False)
class Function:
    """A function that expressions may call."""

    name: str
    arity: int
    evaluator: (
        Curve | Surface | PythonFallback | None
    )  #: its values in NumPy; None for native code without a Python fallback
    native: NativeCode | None = None  #: its C source, if it is no table
    place: tuple[str, int] = ("", 0)  #: file and line where a model file declares it, for messages
    lists = item = False  # as :class:`~eomgen.contact.pairs.PairCall` says of itself

    @property
    def highest(self) -> int | None:
        """Highest order of derivative that does not vanish; None if there is no such limit."""
        return 3 if self.native is None else None

    def operation(self, orders: Orders) -> str:
        """The operation of a call."""
        return f"{self.name}({','.join(map(str, orders))})"

    def counted(self, operation: str) -> str:
        """The name under which a call is counted; empty where it is no operation."""
        return operation

    def implementation(self, orders: Orders) -> Callable[..., Any]:
        """The value or a derivative as a function of floats or arrays."""
        return lambda *arguments: self.require_evaluator()(*arguments, *orders)

    def require_evaluator(self) -> Curve | Surface | PythonFallback:
        """The evaluator in NumPy; ModelError of native code without a Python fallback."""
        if self.evaluator is None:
            message = "is a C function without a Python version, and must be evaluated in NumPy here"
            remedy = (
                "give the Python version under python; it is not needed for target cython or c if masses, constraints "
                "and initial values do not call the function"
            )
            raise ModelError([Problem(f"functions.{self.name}", message, remedy, *self.place, code="EG-MISSING")])
        return self.evaluator


def raised(orders: Orders, i: int) -> Orders:
    """The orders with one derivative more along argument i."""
    return (*orders[:i], orders[i] + 1, *orders[i + 1 :])
