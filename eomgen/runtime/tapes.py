"""An expression as a tape, which compiled loops play -> its values, slopes and conditions at any time and state."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.operations import OPERATIONS, operations_with

#: (operation, operands) one after the other, the numbers among them, and the instructions handed out.
Tape = tuple[list[tuple[str, int, int, int]], list[float], list[int]]


class Expression:
    """An input, or the value of an event, by an expression of time, coordinates, velocities and parameters.

    Parameters
    ----------
    text : str
        As results and messages name it.
    tape : list
        As :mod:`eomgen.expr.schedule` makes them.
    slopes : callable
        Places of the derivatives that do not vanish, among those by t, x and p, and their tape.
    rate : callable, optional
        (name, rate) -> the derivative by time along the motion, of an input called ``name``.
    """

    def __init__(
        self,
        text: str,
        tape: Sequence[Any],
        slopes: Callable[[], Sequence[Any]],
        rate: Callable[[str, str], Expression] | None = None,
    ) -> None:
        code, numbers, out = tape
        self.text, self.rate, self._slopes = text, rate, slopes
        self.tape: Tape = [(str(op), int(a), int(b), int(c)) for op, a, b, c in code], list(numbers), list(out)
        #: whether it reads the state
        self.depends_on_state = any(op == "x" for op, *_ in self.tape[0])
        #: whether it has conditions, at which it may jump or bend
        self.branches = not operations_with(lambda row: row.bends).isdisjoint(op for op, *_ in self.tape[0])

    def function(self, p: Array) -> Callable[[float, Array], float]:
        """f(t, x) at given parameters (n_p,)."""
        play = player(self.tape, p)
        return lambda t, x: play(t, x)[0]

    def switches(self, p: Array) -> Callable[[float, Array], list[float]]:
        """What changes its sign where a condition does: a - b of each comparison of a with b, and a of sign(a)."""
        code, numbers, _ = self.tape
        own = [(OPERATIONS[op].arity, a, b) for op, a, b, _ in code if op in OPERATIONS and OPERATIONS[op].jumps]
        added = [("sub", a, b, 0) for arity, a, b in own if arity == 2]
        out = [*range(len(code), len(code) + len(added)), *(a for arity, a, _ in own if arity == 1)]
        return player(([*code, *added], numbers, out), p)

    def slopes(self, p: Array) -> Callable[[float, Array], Array]:
        """Its derivatives (1 + n_x + n_p,) by t, x and p, as f(t, x) at given parameters (n_p,)."""
        places, tape = self._derived
        play = player(tape, p)

        def slopes(t: float, x: Array) -> Array:
            result = np.zeros(1 + len(x) + len(p))
            result[places] = play(t, x)
            return result

        return slopes

    @cached_property
    def _derived(self) -> tuple[list[int], Sequence[Any]]:
        places, tape = self._slopes()
        return [int(k) for k in places], tape


def joined(tapes: Iterable[Tape]) -> Tape:
    """One tape with the results of several."""
    code: list[tuple[str, int, int, int]] = []
    numbers: list[float] = []
    out: list[int] = []
    for own_code, own_numbers, own_out in tapes:
        start, first = len(code), len(numbers)
        for op, a, b, c in own_code:
            operands = (a + start, b + start, c + start) if op in OPERATIONS else (a + first * (op == "const"), b, c)
            code.append((op, *operands))
        numbers += own_numbers
        out += [start + k for k in own_out]
    return code, numbers, out


def player(tape: Sequence[Any], p: Array) -> Callable[[float, Array], list[float]]:
    """The results of a tape at time t and state x, and at given parameters (n_p,)."""
    code, numbers, out = tape
    fixed = {"const": numbers, "p": p.tolist()}
    first = [fixed[op][a] if op in fixed else 0.0 for op, a, _, _ in code]
    times = [k for k, (op, *_) in enumerate(code) if op == "t"]
    states = [(k, a) for k, (op, a, _, _) in enumerate(code) if op == "x"]
    steps = [(k, row := OPERATIONS[op], at[: row.arity]) for k, (op, *at) in enumerate(code) if op in OPERATIONS]

    def play(t: float, x: Array) -> list[float]:
        results = first.copy()
        for k in times:
            results[k] = t
        for k, a in states:
            results[k] = float(x[a])
        for k, row, at in steps:
            operands = [results[i] for i in at]
            try:
                results[k] = float(row.value(*operands))
            except (ArithmeticError, ValueError):  # outside of its domain, or infinite: as C has it
                with np.errstate(all="ignore"):
                    results[k] = float(row.array(*operands))
        return [results[k] for k in out]

    return play
