"""Stage runtime: an expression as a tape, which compiled loops play -> a function of (t, x) for all others."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..numeric.scales import Array
from .input_kinds import Expressed

#: (operation, operands) one after the other, the numbers among them, and the instructions handed out.
Tape = tuple[list[tuple[str, int, int, int]], list[float], list[int]]


class DeclaredSignal(Expressed):
    """An input's expression over time that the model itself declares, as its metadata hold it.

    Parameters
    ----------
    tape : list
        As :mod:`eomgen.graph.tape` makes them.
    slopes : list, optional
        Places of the derivatives that do not vanish, among those by t, x and p, and their tape.
    """

    text = "declared by the model"

    def __init__(self, tape: Sequence[Any], slopes: Sequence[Any] = ((), ((), (), ()))) -> None:
        self._tape = _tape(tape)
        self.places, self.derived = [int(k) for k in slopes[0]], _tape(slopes[1])
        self.depends_on_state = any(op == "x" for op, *_ in self.tape[0])

    @property
    def tape(self) -> Tape:
        """As the compiled loop plays it."""
        return self._tape

    @property
    def branches(self) -> bool:
        """Whether it has conditions, at which it may jump or bend."""
        return not {op for op, *_ in self.tape[0]}.isdisjoint(BRANCHING)

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
