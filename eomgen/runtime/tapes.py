"""Stage runtime: an expression as a tape, which compiled loops play -> a function of (t, x) for all others."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.operations import OPERATIONS, operations_with
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
        return bends(op for op, *_ in self.tape[0])

    def function(self, p: Array) -> Callable[[float, Array], float]:
        """f(t, x) at given parameters (n_p,)."""
        play = _player(self.tape, p)
        return lambda t, x: play(t, x)[0]

    def switches(self, p: Array) -> Callable[[float, Array], list[float]]:
        """What changes its sign where a condition does: a - b of each comparison of a with b, and a of sign(a)."""
        code, numbers, _ = self.tape
        own = [(OPERATIONS[op].arity, a, b) for op, a, b, _ in code if jumps(op)]
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


def bends(operations: Iterable[str]) -> bool:
    """Whether one of them may jump or bend."""
    return not operations_with(lambda row: row.bends).isdisjoint(operations)


def jumps(operation: str) -> bool:
    """Whether it jumps where what it compares is equal."""
    return operation in OPERATIONS and OPERATIONS[operation].jumps


def play_arrays(tape: Sequence[Any], p: Array, x: Array) -> list[Any]:
    """The results of a tape at parameters (n_p,) or (n_p, k) and at x (n, k), each a number or an array (k,)."""
    code, numbers, out = tape
    leaves = {"const": numbers, "p": p, "x": x}
    results: list[Any] = []
    with np.errstate(all="ignore"):
        for op, a, b, c in code:
            if op in leaves:
                results.append(np.asarray(leaves[op][a], dtype=float))
            else:
                row = OPERATIONS[op]
                results.append(row.array(*(results[a], results[b], results[c])[: row.arity]))
    return [results[k] for k in out]


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
