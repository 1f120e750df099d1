"""An expression as text, given for one run -> a tape, with its rate and slopes as tapes; nothing is ever executed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from ..errors import cannot
from ..expr.core import Expr, Graph, symbols_of
from ..expr.differentiate import gradient, jvp
from ..expr.schedule import Tape, record_tape
from .expressions import parse
from .visit import rewritten


class Names(NamedTuple):
    """What a text may name."""

    x: Sequence[str]  #: states, in order
    p: Sequence[str]  #: parameters, in order
    moving: Mapping[str, str]  #: coordinate -> the state that is its rate
    plain: Callable[[str], str]  #: ``leg1.hip`` of an instance of a component -> ``leg1_hip``


class RecordedText(NamedTuple):
    """An expression of time, states and parameters as plain data."""

    tape: Tape
    #: Places of the derivatives that do not vanish, among those by t, x and p, and their tape.
    slopes: Callable[[], tuple[list[int], Tape]]
    #: (name, rate) -> the derivative along the motion, which must not need accelerations.
    rate: Callable[[str, str], RecordedText]


def record_text(text: str, names: Names, unknown: Callable[[str], Exception]) -> RecordedText:
    """An expression as in a model file, ``"theta - pi/2"``; ExpressionError if it is none."""
    graph, known = Graph(), ("t", *names.x, *names.p)

    def resolve(name: str) -> Expr:
        if name not in known:
            raise unknown(name)
        return graph.symbol(name)

    return _record(text, names, parse(rewritten(text, names.plain), graph, resolve))


def _record(text: str, names: Names, expression: Expr) -> RecordedText:
    graph = expression.graph
    places = {name: ("x", k) for k, name in enumerate(names.x)} | {name: ("p", k) for k, name in enumerate(names.p)}
    places["t"] = ("t", 0)

    def slopes() -> tuple[list[int], Tape]:
        every = gradient(expression, [graph.symbol(name) for name in ("t", *names.x, *names.p)])
        kept = {k: slope for k, slope in enumerate(every) if not slope.is_zero}
        return list(kept), record_tape(list(kept.values()), places.__getitem__)

    def rate(name: str, rate: str) -> RecordedText:
        states = sorted(symbols_of([expression]) & set(names.x))
        for state in states:
            if state not in names.moving:
                raise cannot(
                    f"input {name}: the equations need its rate {rate}, but the rate of {text!r} contains that "
                    f"of {state}, an acceleration; write {name} in t and parameters, or give {rate} too"
                )
        along = {graph.symbol(q): graph.symbol(names.moving[q]) for q in states}
        derivative = jvp([expression], {graph.symbol("t"): graph.one, **along})[0]
        return _record(f"d/dt ({text})", names, derivative)

    return RecordedText(record_tape([expression], places.__getitem__), slopes, rate)
