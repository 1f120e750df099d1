"""Stage runtime: an expression as text -> a tape that compiled loops play, and a function of (t, x) for all others.

The text is read by the same parser as those of model files; nothing is ever executed.  A generated package has no
parser and refuses texts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ExpressionError, MissingDependencyError, UsageError
from ..numeric.scales import Array
from ..operations import OPERATIONS, operations_with
from .layout import Layout
from .near_names import unknown

if TYPE_CHECKING:
    from ..graph.core import Expr

#: (operation, operands) one after the other, the numbers among them, and the instructions handed out.
Tape = tuple[list[tuple[str, int, int, int]], list[float], list[int]]


class Formula:
    """An expression of time, coordinates, velocities and parameters, given for one run.

    Parameters
    ----------
    layout : Layout
    text : str
        As in a model file, e.g. ``"theta - pi/2"``.
    what : str
        Whose it is, for messages.
    beside : Formula, optional
        One whose graph it shares, so that both can be evaluated at once.
    """

    def __init__(self, layout: Layout, text: str, what: str, beside: Formula | None = None) -> None:
        try:
            from ..describe.expressions import parse
            from ..graph.core import Graph
            from ..graph.evaluate import compile_evaluator
            from ..graph.substitute import symbols_of
        except ImportError:
            raise MissingDependencyError(
                f"{what}: an expression as text needs eomgen to be read: pip install eomgen, or give a function f(t, x)"
            ) from None
        self.text, self.layout = text, layout
        graph: Graph = Graph() if beside is None else beside.expression.graph
        known = ("t", *layout.x, *layout.p)

        def resolve(name: str) -> Expr:
            if name not in known:
                raise unknown(f"name in {what}", name, known)
            return graph.symbol(name)

        try:
            self.expression: Expr = parse(text, graph, resolve)
        except ExpressionError as error:
            raise UsageError(f"{what}: {error}") from None
        self.depends_on_state = not symbols_of([self.expression]).isdisjoint(layout.x)
        self._evaluate = compile_evaluator([self.expression], known)

    @cached_property
    def branches(self) -> bool:
        """Whether it has conditions, at which it may jump or bend."""
        from ..graph.traverse import reachable

        graph = self.expression.graph
        return _bends(graph.nodes[i][0] for i in reachable(graph, [self.expression.id]))

    def switches(self, p: Array) -> Callable[[float, Array], list[float]]:
        """What changes its sign where a condition does: a - b of each comparison of a with b, and a of sign(a)."""
        from ..graph.core import Expr
        from ..graph.evaluate import compile_evaluator
        from ..graph.traverse import reachable

        graph, found = self.expression.graph, []
        for i in reachable(graph, [self.expression.id]):
            node = graph.nodes[i]
            if _jumps(node[0]):
                found.append(Expr(graph, graph.sub(*node[1:]) if len(node) == 3 else node[1]))
        evaluate, values = compile_evaluator(found, ("t", *self.layout.x, *self.layout.p)), p.tolist()
        return lambda t, x: [float(value) for value in evaluate([t, *np.asarray(x).tolist(), *values])]

    def derivative(self, name: str, rate: str) -> Formula:
        """The derivative by time along the motion, of an input that is called ``name``.

        Raises
        ------
        UsageError
            It would need accelerations.
        """
        from ..graph.differentiate import jvp
        from ..graph.evaluate import compile_evaluator
        from ..graph.substitute import symbols_of

        layout, graph = self.layout, self.expression.graph
        moving = dict(zip(layout.velocity_labels, layout.v, strict=True))
        states = sorted(symbols_of([self.expression]) & set(layout.x))
        for state in states:
            if state not in layout.q or state not in moving:
                raise UsageError(
                    f"input {name}: the equations need its rate {rate}, and that of {self.text!r} depends on the rate "
                    f"of {state}, which is an acceleration; write {name} in t and parameters, or give {rate} beside it"
                )
        along = {graph.symbol(q): graph.symbol(moving[q]) for q in states}
        other = object.__new__(type(self))
        other.layout, other.text = layout, f"d/dt ({self.text})"
        other.expression = jvp([self.expression], {graph.symbol("t"): graph.one, **along})[0]
        other.depends_on_state = not symbols_of([other.expression]).isdisjoint(layout.x)
        other._evaluate = compile_evaluator([other.expression], ("t", *layout.x, *layout.p))
        return other

    def function(self, p: Array) -> Callable[[float, Array], float]:
        """f(t, x) at given parameters (n_p,)."""
        evaluate, values = self._evaluate, p.tolist()
        return lambda t, x: float(evaluate([t, *np.asarray(x).tolist(), *values])[0])

    def slopes(self, p: Array) -> Callable[[float, Array], Array]:
        """Its derivatives (1 + n_x + n_p,) by t, x and p, as f(t, x) at given parameters (n_p,)."""
        from ..graph.differentiate import gradient
        from ..graph.evaluate import compile_evaluator

        graph, known = self.expression.graph, ("t", *self.layout.x, *self.layout.p)
        evaluate = compile_evaluator(gradient(self.expression, [graph.symbol(name) for name in known]), known)
        values = p.tolist()
        return lambda t, x: np.array(evaluate([t, *np.asarray(x).tolist(), *values]), dtype=float)


def values_together(formulas: Sequence[Formula], p: Array) -> Callable[[float, Array], list[float]]:
    """f(t, x) -> the values of formulas of one graph at given parameters (n_p,), in one pass."""
    from ..graph.evaluate import compile_evaluator

    layout, values = formulas[0].layout, p.tolist()
    evaluate = compile_evaluator([formula.expression for formula in formulas], ("t", *layout.x, *layout.p))
    return lambda t, x: evaluate([t, *np.asarray(x).tolist(), *values])


def record_tape(formulas: Sequence[Formula]) -> Tape:
    """One tape for several expressions."""
    from ..graph.tape import record_tape as record

    layout = formulas[0].layout

    def place(name: str) -> tuple[str, int]:
        for kind, names in (("x", layout.x), ("p", layout.p)):
            if name in names:
                return kind, names.index(name)
        return "t", 0

    return record([formula.expression for formula in formulas], place)


class DeclaredSignal:
    """An input's expression over time that the model itself declares, as its metadata hold it.

    Parameters
    ----------
    tape : list
        As :mod:`eomgen.graph.tape` makes them.
    slopes : list, optional
        Places of the derivatives that do not vanish, among those by t, x and p, and their tape.
    """

    def __init__(self, tape: Sequence[Any], slopes: Sequence[Any] = ((), ((), (), ()))) -> None:
        self.tape = _tape(tape)
        self.places, self.derived = [int(k) for k in slopes[0]], _tape(slopes[1])
        self.depends_on_state = any(op == "x" for op, *_ in self.tape[0])
        self.branches = _bends(op for op, *_ in self.tape[0])

    def function(self, p: Array) -> Callable[[float, Array], float]:
        """f(t, x) at given parameters (n_p,)."""
        play = _player(self.tape, p)
        return lambda t, x: play(t, x)[0]

    def switches(self, p: Array) -> Callable[[float, Array], list[float]]:
        """What changes its sign where a condition does: a - b of each comparison of a with b, and a of sign(a)."""
        code, numbers, _ = self.tape
        own = [(OPERATIONS[op].arity, a, b) for op, a, b, _ in code if _jumps(op)]
        added = [("sub", a, b, 0) for arity, a, b in own if arity == 2]
        out = [*range(len(code), len(code) + len(added)), *(a for arity, a, _ in own if arity == 1)]
        return _player(([*code, *added], numbers, out), p)

    def slopes(self, p: Array) -> Callable[[float, Array], Array]:
        """Its derivatives (1 + n_x + n_p,) by t, x and p, as f(t, x) at given parameters (n_p,)."""
        play = _player(self.derived, p)

        def slopes(t: float, x: Array) -> Array:
            result = np.zeros(1 + len(x) + len(p))
            result[self.places] = play(t, x)
            return result

        return slopes


def _bends(operations: Iterable[str]) -> bool:
    """Whether one of them may jump or bend."""
    return not operations_with(lambda row: row.bends).isdisjoint(operations)


def _jumps(operation: str) -> bool:
    """Whether it jumps where what it compares is equal."""
    return operation in OPERATIONS and OPERATIONS[operation].jumps


def _tape(given: Sequence[Any]) -> Tape:
    code, numbers, out = given
    return [(str(op), int(a), int(b), int(c)) for op, a, b, c in code], list(numbers), list(out)


def _player(tape: Tape, p: Array) -> Callable[[float, Array], list[float]]:
    """The results of a tape at time t and state x."""
    code, numbers, out = tape
    leaves = {"const": numbers, "p": p.tolist()}

    def play(t: float, x: Array) -> list[float]:
        results: list[float] = []
        for op, a, b, c in code:
            if op == "t":
                value = t
            elif op == "x":
                value = float(x[a])
            elif op in leaves:
                value = leaves[op][a]
            else:
                row = OPERATIONS[op]
                operands = (results[a], results[b], results[c])[: row.arity]
                try:
                    value = row.value(*operands)
                except (ArithmeticError, ValueError):  # outside of its domain, or infinite: as C has it
                    with np.errstate(all="ignore"):
                        value = row.array(*operands)
            results.append(float(value))
        return [results[k] for k in out]

    return play


def is_formula(value: Any) -> bool:
    """Whether what a user gives is an expression as text."""
    return isinstance(value, str)
