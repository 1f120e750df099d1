"""The equations of a model -> the rates of inputs they need, as inputs of their own.

Where an input u stands in what is differentiated by time (dL/dv of a Lagrangian, constraints, the gap of an impact,
q' = N v + b of given equations), u' and u'' stand in the equations of motion.  They are further inputs ``u_dot`` and
``u_ddot``, 0 unless given: a run that is given u as a number, text or table fills them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ..base.notation import chains, rate_of, split_rate
from ..base.operations import CONDITION, operations_with
from ..elements.constraints import Driver, Equation
from ..elements.constraints.constraint import POSITION, Constraint
from ..expr.core import Expr, Graph, reachable, substitute, symbols_of
from ..expr.differentiate import gradient, jvp
from ..expr.identity import vanishes
from .mechanism import Event, GivenEquations, Input, Lagrangian, Output, Switched
from .values import Reader

#: Expressions, how often they are differentiated by time, what they are, and where they stand.
Differentiated = tuple[list[Expr], int, str, str | None]


def jumps_in_time(expressions: Sequence[Expr]) -> bool:
    """Whether an expression jumps where a comparison, linear in t and free of coordinates, changes.

    Comparisons that are not linear in t, or that look at coordinates, are not judged.
    """
    if not expressions:
        return False
    graph = expressions[0].graph
    t = graph.symbol("t")
    compared = operations_with(lambda row: row.kind == CONDITION and row.jumps)
    for i in reachable(graph, [x.id for x in expressions]):
        operation, *operands = graph.nodes[i]
        if operation not in compared:
            continue
        apart = Expr(graph, operands[0]) - Expr(graph, operands[1])
        slope = gradient(apart, [t])[0]
        if slope.is_zero or "t" in symbols_of([slope]):
            continue
        when = t - apart / slope  # without t: apart is linear in it
        before, after = (substitute(list(expressions), {Expr(graph, i): x}) for x in (graph.zero, graph.one))
        changes = [a - b for a, b in zip(after, before, strict=True)]
        there = substitute(changes, {t: substitute([when], {t: graph.zero})[0]})
        if not all(vanishes(there, pieces=True, unknown=True)):
            return True
    return False


def clock(graph: Graph, inputs: Sequence[Input]) -> dict[Expr, Expr]:
    """The direction of d/dt of what is prescribed: t' = 1, and the rate of every input."""
    rates = {graph.symbol(u.name): graph.symbol(rate_of(u.name)) for u in inputs}
    return {graph.symbol("t"): graph.one, **rates}


def add_rates(reader: Reader, inputs: tuple[Input, ...], differentiated: Sequence[Differentiated]) -> tuple[Input, ...]:
    """The inputs, and those rates of them that the equations need; all rates with their expressions over time.

    A rate that is declared as an input already stays where it is.  Faults are noted: a name that is taken, a rate that
    would need accelerations.
    """
    needed: dict[str, str] = {}
    for expressions, _, why, place in differentiated:
        if place is not None and jumps_in_time(expressions):
            message = f"{why} must have a derivative by time, and a condition on t makes it jump"
            reader.fault(
                place, message, "such a jump is an impact: write it smoothly, or as an event with a reset", "EG-JUMP"
            )
    for expressions, times, why, _ in differentiated:
        for name in sorted(symbols_of(expressions) & {u.name for u in inputs}):
            for k in range(1, times + 1):
                needed.setdefault(rate_of(name, k), f"input {name!r}, whose rate {why} needs")
    own = {u.name for u in inputs}
    added = []
    for rate, why in needed.items():
        if rate in own:
            continue
        base = next(u for u in inputs if split_rate(u.name)[0] == split_rate(rate)[0])
        kind = reader.names.kinds.get(rate)
        if kind is not None:
            message = f"the name is reserved for the rate of {why}"
            reader.fault(reader.names.places[rate], message, f"rename the {kind}, or the input", "EG-NAME-TAKEN")
            continue
        reader.names.declare("input", rate, f"inputs.{base.name}")
        unit = f"{base.unit}/s^{k}" if (k := split_rate(rate)[1]) > 1 else f"{base.unit}/s"
        doc = f"rate of {base.name}" if k == 1 else f"derivative {k} of {base.name} by time"
        added.append(Input(rate, 0.0, unit if base.unit else "", doc))
    return _with_signals(reader, (*inputs, *added))


def list_differentiated(
    reader: Reader,
    lagrangian: Lagrangian | None,
    given: GivenEquations | None,
    constraints: Sequence[Constraint],
    switched: Sequence[Switched],
    events: Sequence[Event],
    outputs: Sequence[Output],
) -> list[Differentiated]:
    """Expressions that the equations differentiate by time.

    The place is None for drivers, whose jumps are told by the runs that they lead, and for constraints that close for a
    time, whose errors die away.
    """
    symbol = reader.graph.symbol
    found: list[Differentiated] = []
    if lagrangian is not None:
        v = [symbol(f"{name}_dot") for name in lagrangian.coordinates]
        found.append((gradient(lagrangian.expression, v), 1, "d/dt (dL/dq_dot)", "lagrangian"))
    if given is not None:
        rates = {f"{name}_dot" for name in given.coordinates} | set(given.velocities)
        positions = [e for e in given.constraints if symbols_of([e]).isdisjoint(rates)]
        velocities = [e for e in given.constraints if not symbols_of([e]).isdisjoint(rates)]
        section = f"{'equations' if lagrangian is None else 'lagrangian'}.constraints"
        found += [(positions, 2, "a constraint", section), (velocities, 1, "a constraint of velocities", section)]
    if given is not None and lagrangian is None:
        seconds = {f"{name}_ddot" for name in given.coordinates}
        shown = not symbols_of([o.expression for o in outputs]).isdisjoint(seconds)
        if positions or shown:
            found.append((list(given.rates), 1, "q'' of the given rates", "equations.rates"))
    for_a_time = [switch.constraint for switch in switched if switch.constraint is not None]
    for c in (*constraints, *for_a_time):
        if isinstance(c, Driver):
            found.append(([c.value], 2, f"the driver {c.name!r}", None))
        elif isinstance(c, Equation):
            times = 2 if c.level == POSITION else 1
            place = None if c in for_a_time else f"constraints.{c.name}"
            found.append(([c.expression], times, f"the constraint {c.name!r}", place))
    hits = [e for e in events if e.restitution is not None]
    found += [([e.expression], 1, f"the gap {e.name!r}", f"events.{e.name}") for e in hits]
    return found


def _with_signals(reader: Reader, inputs: tuple[Input, ...]) -> tuple[Input, ...]:
    """Rates of inputs with an expression over time get its derivative, where they have none of their own."""
    signals = {u.name: u.signal for u in inputs if u.signal is not None}
    for base, rates in chains([u.name for u in inputs]).items():
        last = base
        for rate in rates if base in signals else ():
            if rate not in signals:
                found: Expr | None = signals[last]
                for k in range(split_rate(rate)[1] - split_rate(last)[1]):
                    found = None if found is None else _rate_of_signal(reader, found, last, k)
                if found is None:
                    return inputs
                signals[rate] = found
            last = rate
    return tuple(replace(u, signal=signals[u.name]) if u.name in signals else u for u in inputs)


def _rate_of_signal(reader: Reader, signal: Expr, name: str, order: int) -> Expr | None:
    """The derivative by time of an expression of t, coordinates, velocities and parameters; faults are noted."""
    kinds, symbol = reader.names.kinds, reader.graph.symbol
    along: Mapping[str, str] = {
        n: f"{n}_dot" for n in symbols_of([signal]) if kinds.get(n) not in ("time", "parameter", None)
    }
    for state in sorted(along):
        if kinds.get(along[state]) != "velocity":
            message = (
                f"{rate_of(name, order + 1)} is needed, but the signal depends on {state!r}, whose rate is not "
                "a velocity"
            )
            reader.fault(f"inputs.{name}.signal", message, "write it in t and parameters", "EG-UNSUPPORTED")
            return None
    direction = {symbol(n): symbol(rate) for n, rate in along.items()}
    return jvp([signal], {symbol("t"): reader.graph.one, **direction})[0]
