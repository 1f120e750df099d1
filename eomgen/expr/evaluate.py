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
Function = Callable[..., Any]


class Evaluator:
    """A schedule that evaluates the same expressions again and again.

    ``names`` are the symbols that will be given, at least those that the outputs depend on; UsageError otherwise.
    """

    def __init__(self, outputs: Sequence[Expr], names: Sequence[str]) -> None:
        self.names = tuple(names)
        graph = common_graph(outputs)
        order = reachable(graph, (y.id for y in outputs)) if graph is not None else []
        nodes, calls = (graph.nodes, graph.calls) if graph is not None else ([], {})
        place = {name: k for k, name in enumerate(self.names)}
        self._constants: list[float] = []
        slots: dict[int, int] = {}
        rest: list[int] = []
        for i in order:
            kind, *args = nodes[i]
            if kind == "const":
                slots[i] = len(self.names) + len(self._constants)
                self._constants.append(args[0])
            elif kind == "sym":
                slots[i] = place.get(args[0], -1)
            else:
                rest.append(i)
        self._used = set(slots.values())
        if -1 in self._used:
            unknown = sorted(nodes[i][1] for i, slot in slots.items() if slot < 0)
            raise incomplete(f"no value for {', '.join(unknown)}")
        first = len(self.names) + len(self._constants)
        functions = {name: (row.value, row.array) for name, row in OPERATIONS.items()}
        for operation, (function, orders) in calls.items():
            functions[operation] = (function.implementation(orders),) * 2
        #: of each step its function of floats and of arrays, its first operands (the second is -1 where there is none)
        #: and those beyond two
        self._steps: list[tuple[Function, Function, int, int, list[int]]] = []
        last, none = dict[int, int](), list[int]()
        for step, i in enumerate(rest):
            operation, *args = nodes[i]
            a = slots[args[0]]
            b = slots[args[1]] if len(args) > 1 else -1
            others = [slots[k] for k in args[2:]] if len(args) > 2 else none
            for slot in others:
                last[slot] = step
            last[a] = last[b] = step
            self._steps.append((*functions[operation], a, b, others))
            slots[i] = first + step
        self._outputs = [slots[y.id] for y in outputs]
        keep = {*self._outputs, -1, *range(first)}
        self._dead: dict[int, list[int]] = {}  # slots not needed after a step
        for slot, k in last.items():
            if slot not in keep:
                self._dead.setdefault(k, []).append(slot)

    def __call__(self, values: Mapping[str, Value] | Sequence[Value] | np.ndarray) -> list[Value]:
        """Values of the outputs, those that depend on no array as floats.

        What is given are numbers, or arrays that broadcast against each other, by name or in the order of ``names``.
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
        for function, array, a, b, others in self._steps:
            try:
                if b < 0:
                    append(function(data[a]))
                elif not others:
                    append(function(data[a], data[b]))
                else:
                    append(function(data[a], data[b], *[data[k] for k in others]))
            except (ValueError, ArithmeticError):  # NumPy knows the infinity or NaN it should be
                with np.errstate(all="ignore"):
                    append(float(array(*(np.float64(data[k]) for k in (a, b, *others) if k >= 0))))
        return [data[s] for s in self._outputs]

    def _on_arrays(self, data: list[Value]) -> list[Value]:
        with np.errstate(all="ignore"):
            for k, (_, function, a, b, others) in enumerate(self._steps):
                rest = [data[s] for s in others] if others else others
                data.append(function(data[a]) if b < 0 else function(data[a], data[b], *rest))
                for s in self._dead.get(k, ()):
                    data[s] = None
        result = (data[s] for s in self._outputs)  # of a sum over pairs a list
        return [x if isinstance(x, list) or np.ndim(x) else float(x) for x in result]


def evaluate(outputs: Sequence[Expr], values: Mapping[str, Value]) -> list[Value]:
    """Values of the outputs at numbers or arrays by name, as of :class:`Evaluator`; other names are ignored.

    Raises
    ------
    UsageError
        A symbol has no value.
    """
    used = symbols_of(outputs)  # of many values a small expression needs few
    needed = {name: value for name, value in values.items() if name in used}
    return Evaluator(outputs, list(needed))(needed)
