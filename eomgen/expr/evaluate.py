"""Expressions and numbers -> their values, in NumPy; the oracle for every target.

Numbers are evaluated as Python floats, arrays with NumPy's broadcasting.  Nothing raises and nothing warns: a division
by zero gives an infinity, a logarithm of a negative number NaN.  Both branches of ``select`` are evaluated and one is
taken, so what happens in the other never shows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ..base.operations import OPERATIONS
from ..errors import ill_shaped, incomplete
from .core import Expr, common_graph, reachable, symbols_of

Value = Any  # float or ndarray


def _pack(*values: Any) -> tuple[Any, ...]:
    return tuple(x for value in values for x in (value if isinstance(value, tuple) else (value,)))


class Evaluator:
    """A schedule that evaluates the same expressions again and again.

    Parameters
    ----------
    outputs : sequence of Expr
        Expressions of one graph.
    names : sequence of str
        Symbols that will be given, at least those the outputs depend on, in the order of values given as a sequence.

    Raises
    ------
    UsageError
        The outputs depend on a symbol that is not named.
    """

    def __init__(self, outputs: Sequence[Expr], names: Sequence[str]) -> None:
        self.names = tuple(names)
        graph = common_graph(outputs)
        order = reachable(graph, (y.id for y in outputs)) if graph is not None else []
        nodes = graph.nodes if graph is not None else []
        place = {name: k for k, name in enumerate(self.names)}
        self._constants: list[float] = []
        slots: dict[int, int] = {}
        used: set[int] = set()
        unknown: list[str] = []
        rest: list[int] = []
        for i in order:
            kind, *args = nodes[i]
            if kind == "const":
                slots[i] = len(self.names) + len(self._constants)
                self._constants.append(args[0])
            elif kind == "sym":
                slots[i] = place.get(args[0], -1)
                used.add(slots[i])
                if args[0] not in place:
                    unknown.append(args[0])
            else:
                rest.append(i)
        if unknown:
            raise incomplete(f"no value for {', '.join(sorted(unknown))}")
        first = len(self.names) + len(self._constants)
        self._steps: list[tuple[str, int, int, int]] = []  # operation and operand slots, -1 where there is none
        self._functions: dict[str, tuple[Callable[..., Any], Callable[..., Any]]]
        self._functions = {name: (row.value, row.array) for name, row in OPERATIONS.items()} | {"pack": (_pack, _pack)}
        for operation, (function, orders) in (graph.calls if graph is not None else {}).items():
            implementation = function.implementation(orders)
            self._functions[operation] = (implementation, implementation)
        last: dict[int, int] = {}
        steps = self._steps
        for i in rest:
            node = nodes[i]
            if len(node) == 3:  # most of them
                operation, k, j = node
                a, b = slots[k], slots[j]
                last[a] = last[b] = step = len(steps)
                steps.append((operation, a, b, -1))
                slots[i] = first + step
            else:
                slots[i] = self._add_step(node[0], [slots[j] for j in node[1:]], first, last)
        self._outputs = [slots[y.id] for y in outputs]
        keep = {*self._outputs, -1, *range(first)}
        self._dead: list[tuple[int, ...]] = [()] * len(self._steps)  # slots not needed after each step
        for s, k in last.items():
            if s not in keep:
                self._dead[k] = (*self._dead[k], s)
        self._scalar = [(self._functions[op][0], a, b, c) for op, a, b, c in self._steps]
        self._used = used

    def _add_step(self, operation: str, places: list[int], first: int, last: dict[int, int]) -> int:
        """Append a step, after steps that pack the arguments of a call of more than three; returns its slot."""
        if len(places) > 3:
            while len(places) > 1:  # in a balanced tree, so that the work is of the order of their number
                parts = [places[k : k + 3] for k in range(0, len(places), 3)]
                places = [self._add_step("pack", part, first, last) for part in parts]
        a, b, c = (*places, -1, -1)[:3]
        self._steps.append((operation, a, b, c))
        for s in places:
            last[s] = len(self._steps) - 1
        return first + len(self._steps) - 1

    def __call__(self, values: Mapping[str, Value] | Sequence[Value] | np.ndarray) -> list[Value]:
        """Evaluate.

        Parameters
        ----------
        values : mapping or sequence
            Numbers or arrays that broadcast against each other, by name or in the order of :attr:`names`.

        Returns
        -------
        list of float or ndarray
            One per output; an output that depends on no array is a float.
        """
        data, arrays = self._inputs(values)
        data.extend(self._constants)
        return self._on_arrays(data) if arrays else self._on_floats(data)

    def _inputs(self, values: Mapping[str, Value] | Sequence[Value] | np.ndarray) -> tuple[list[Value], bool]:
        if isinstance(values, Mapping):
            used = self._used
            absent = [n for k, n in enumerate(self.names) if k in used and n not in values]
            if absent:
                raise incomplete(f"no value for {', '.join(sorted(absent))}")
            data = [values.get(n, 0.0) if k in used else 0.0 for k, n in enumerate(self.names)]
        else:
            data = values.tolist() if isinstance(values, np.ndarray) and values.ndim == 1 else list(values)
            if len(data) != len(self.names):
                raise ill_shaped(f"{len(self.names)} values expected, not {len(data)}")
        arrays = False
        for k, x in enumerate(data):
            if type(x) is float:
                continue
            array = np.asarray(x, dtype=float)
            if array.ndim:
                data[k], arrays = array, True
            else:
                data[k] = float(array)
        return data, arrays

    def _on_floats(self, data: list[float]) -> list[Value]:
        append = data.append
        for k, (function, a, b, c) in enumerate(self._scalar):
            try:
                if b < 0:
                    append(function(data[a]))
                elif c < 0:
                    append(function(data[a], data[b]))
                else:
                    append(function(data[a], data[b], data[c]))
            except (ValueError, ArithmeticError):  # NumPy knows the infinity or NaN it should be
                with np.errstate(all="ignore"):
                    append(
                        float(
                            self._functions[self._steps[k][0]][1](*(np.float64(data[s]) for s in (a, b, c) if s >= 0))
                        )
                    )
        return [data[s] for s in self._outputs]

    def _on_arrays(self, data: list[Value]) -> list[Value]:
        append = data.append
        with np.errstate(all="ignore"):
            for (operation, a, b, c), dead in zip(self._steps, self._dead, strict=True):
                function = self._functions[operation][1]
                if b < 0:
                    append(function(data[a]))
                elif c < 0:
                    append(function(data[a], data[b]))
                else:
                    append(function(data[a], data[b], data[c]))
                for s in dead:
                    data[s] = None
        found = (data[s] for s in self._outputs)  # of a sum over pairs a list
        return [x if isinstance(x, list) or np.ndim(x) else float(x) for x in found]


def evaluate(outputs: Sequence[Expr], values: Mapping[str, Value]) -> list[Value]:
    """Values of the outputs at the given numbers or arrays (which broadcast against each other).

    Parameters
    ----------
    outputs : sequence of Expr
        Expressions of one graph.
    values : mapping of str to float or ndarray
        By symbol name; names that are not needed are ignored.

    Returns
    -------
    list of float or ndarray
        One per output; an output that depends on no array is a float.

    Raises
    ------
    UsageError
        A symbol has no value.
    """
    used = symbols_of(outputs)  # of many values a small expression needs few
    needed = {name: value for name, value in values.items() if name in used}
    return Evaluator(outputs, list(needed))(needed)
