"""Stage runtime: an expression as text -> a tape that compiled loops play, and a function of (t, x) for all others.

The text is read by the same parser as those of model files; nothing is ever executed.  A generated package has no
parser and refuses texts.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ExpressionError, MissingDependencyError, UsageError
from ..numeric.scales import Array
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
        return any(graph.nodes[i][0] in BRANCHING for i in reachable(graph, [self.expression.id]))

    def switches(self, p: Array) -> Callable[[float, Array], list[float]]:
        """What changes its sign where a condition does: a - b of each comparison of a with b, and a of sign(a)."""
        from ..graph.core import Expr
        from ..graph.evaluate import compile_evaluator
        from ..graph.traverse import reachable

        graph, found = self.expression.graph, []
        for i in reachable(graph, [self.expression.id]):
            node = graph.nodes[i]
            if node[0] in SWITCHING:
                found.append(Expr(graph, graph.sub(*node[1:3]) if node[0] != "sign" else node[1]))
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
        self.branches = not {op for op, *_ in self.tape[0]}.isdisjoint(BRANCHING)

    def function(self, p: Array) -> Callable[[float, Array], float]:
        """f(t, x) at given parameters (n_p,)."""
        play = _player(self.tape, p)
        return lambda t, x: play(t, x)[0]

    def switches(self, p: Array) -> Callable[[float, Array], list[float]]:
        """What changes its sign where a condition does: a - b of each comparison of a with b, and a of sign(a)."""
        code, numbers, _ = self.tape
        own = [(op, a, b) for op, a, b, _ in code if op in SWITCHING]
        added = [("sub", a, b, 0) for op, a, b in own if op != "sign"]
        out = [*range(len(code), len(code) + len(added)), *(a for op, a, _ in own if op == "sign")]
        return _player(([*code, *added], numbers, out), p)

    def slopes(self, p: Array) -> Callable[[float, Array], Array]:
        """Its derivatives (1 + n_x + n_p,) by t, x and p, as f(t, x) at given parameters (n_p,)."""
        play = _player(self.derived, p)

        def slopes(t: float, x: Array) -> Array:
            result = np.zeros(1 + len(x) + len(p))
            result[self.places] = play(t, x)
            return result

        return slopes


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
                operands = (results[a], results[b], results[c])
                try:
                    value = OPERATIONS[op](*operands)
                except (ArithmeticError, ValueError):  # outside of its domain, or infinite: as C has it
                    with np.errstate(all="ignore"):
                        value = BEYOND[op](*operands)
            results.append(float(value))
        return [results[k] for k in out]

    return play


def _one(function: Callable[[float], float]) -> Callable[[float, float, float], float]:
    return lambda a, b, c: function(a)


def _two(function: Callable[[float, float], float]) -> Callable[[float, float, float], float]:
    return lambda a, b, c: function(a, b)


#: Functions of one argument, by the names of math.h.
FUNCTIONS = (
    *("sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"),
    *("asinh", "acosh", "atanh"),
)
#: What each operation of a tape does, as tape.c does it.
OPERATIONS: dict[str, Callable[[float, float, float], float]] = {
    "add": lambda a, b, c: a + b,
    "sub": lambda a, b, c: a - b,
    "mul": lambda a, b, c: a * b,
    "div": lambda a, b, c: a / b,
    "neg": lambda a, b, c: -a,
    "pow": _two(math.pow),
    "atan2": _two(math.atan2),
    "abs": _one(abs),
    "sign": lambda a, b, c: a if a != a else (a > 0) - (a < 0),
    "min": lambda a, b, c: a if a <= b or a != a else b,
    "max": lambda a, b, c: a if a >= b or a != a else b,
    "lt": lambda a, b, c: a < b,
    "le": lambda a, b, c: a <= b,
    "eq": lambda a, b, c: a == b,
    "not": lambda a, b, c: not a,
    "and": lambda a, b, c: bool(a) and bool(b),
    "or": lambda a, b, c: bool(a) or bool(b),
    "select": lambda a, b, c: b if a else c,
}
OPERATIONS |= {name: _one(getattr(math, name)) for name in FUNCTIONS}
#: The same where Python raises what C has a value for: log(0), 1/0, exp(1000).
BEYOND: dict[str, Callable[[float, float, float], float]] = {
    "div": lambda a, b, c: float(np.divide(a, b)),
    "pow": lambda a, b, c: float(np.power(a, b)),
} | {name: _one(getattr(np, re.sub("^a", "arc", name))) for name in FUNCTIONS}


#: Operations at which an expression may jump or bend.
BRANCHING = ("abs", "sign", "min", "max", "lt", "le", "eq", "not", "and", "or", "select")
#: Those that jump where what they compare is equal.
SWITCHING = ("sign", "lt", "le", "eq")


def is_formula(value: Any) -> bool:
    """Whether what a user gives is an expression as text."""
    return isinstance(value, str)
