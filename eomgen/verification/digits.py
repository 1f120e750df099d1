"""Stage verification, digits: expressions -> their values with 50 digits and more, by mpmath.

Digits to spare make differences exact enough to judge derivatives: of a step 1e-16 in 60 digits a central difference
has 30 of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from math import factorial
from typing import Any

import numpy as np

from ..base.operations import OPERATIONS
from ..errors import MissingDependencyError
from ..graph.core import Expr
from ..graph.pair_calls import PairCall
from ..graph.traverse import common_graph, reachable

DIGITS = 60
FIRST = "1e-16"  #: step of first differences: truncation 1e-32, rounding 1e-44
SECOND = "1e-12"  #: step of second differences: truncation 1e-24, rounding 1e-36

Number = Any  # mpmath's mpf
Numbers = list[Number]


def context() -> Any:
    """Arithmetic of mpmath with :data:`DIGITS`, apart from that of the user.

    Raises
    ------
    MissingDependencyError
    """
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

    Parameters
    ----------
    mp : context
    outputs : sequence of Expr
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
                    call = _flat(function, loops[function.function])
                else:
                    call = _Local(mp, function, orders)
                self._steps.append((None, call, tuple(slot[k] for k in args)))

    def __call__(self, values: Mapping[str, Number]) -> Numbers:
        """Values of the outputs."""
        data: Numbers = []
        for name, operation, args in self._steps:
            if name is not None:
                data.append(values[name])
            elif args:
                data.append(operation(*(data[k] for k in args)))
            else:
                data.append(operation)
        return [data[k] for k in self._outputs]


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
        from ..numeric.user_functions import up_to

        self.centre, self.terms = centre, []
        for total in range(3):
            for powers in up_to(self.function.arity, total):
                orders = tuple(a + b for a, b in zip(self.orders, powers, strict=True))
                highest = self.function.highest
                if highest is None or max(orders) <= highest:
                    value = self.function.implementation(orders)(*centre)
                    self.terms.append((powers, self.mp.mpf(float(value))))


def solve(matrix: list[Numbers], right: list[Numbers]) -> list[Numbers]:
    """Solutions of A X = Y by elimination with row pivots.

    Parameters
    ----------
    matrix : n rows of n numbers
    right : n rows of k numbers

    Raises
    ------
    ZeroDivisionError
        A is singular.
    """
    n = len(matrix)
    rows = [[*a, *b] for a, b in zip(matrix, right, strict=True)]
    for k in range(n):
        best = max(range(k, n), key=lambda i: abs(rows[i][k]))
        rows[k], rows[best] = rows[best], rows[k]
        pivot = rows[k]
        for i in range(k + 1, n):
            if rows[i][k]:
                factor = rows[i][k] / pivot[k]
                rows[i] = [
                    *rows[i][: k + 1],
                    *(x - factor * y if y else x for x, y in zip(rows[i][k + 1 :], pivot[k + 1 :], strict=True)),
                ]
    solution: list[Numbers] = [[] for _ in range(n)]
    for i in reversed(range(n)):
        row = rows[i]
        values = row[n:]
        for j in range(i + 1, n):
            if row[j]:
                values = [x - row[j] * y for x, y in zip(values, solution[j], strict=True)]
        solution[i] = [x / row[i] for x in values]
    return solution


def _flat(call: PairCall, loops: Any) -> Any:
    """A node of a sum over pairs on numbers of many digits."""
    return call.on_numbers(loops)


def _each(mp: Any, outputs: list[Expr], names: Sequence[str]) -> Any:
    """The law of a pair on arrays of such numbers: one pair after the other."""
    evaluate = Digits(mp, outputs)

    def value(given: Sequence[Any]) -> list[Any]:
        rows = np.broadcast_arrays(*given)
        shape = rows[0].shape
        found = [evaluate(dict(zip(names, one, strict=True))) for one in zip(*(r.ravel() for r in rows), strict=True)]
        made = np.empty((len(outputs), len(found)), dtype=object)
        for k, column in enumerate(found):
            made[:, k] = column
        return [row.reshape(shape) for row in made]

    return value
