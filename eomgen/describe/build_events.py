"""Entries of the section ``events`` -> Events of the mechanism, with their resets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..base.operations import CONDITION, operations_with
from ..elements import kinds
from ..elements.kinds import OUTPUT
from ..graph.core import Expr, symbols_of
from ..graph.shown import shown
from .checks import check_keys
from .description import DescribedEntry, items
from .fields import EVENT
from .mechanism import Clock, Event, Switched
from .names import nearest
from .scope import late_names
from .sympy_face import in_order
from .values import Reader, is_number


def build_events(reader: Reader, entries: list[DescribedEntry]) -> tuple[Event, ...]:
    """Events in the order of their declaration; faults are noted."""
    return tuple(_event(reader, entry) for entry in entries)


def _event(reader: Reader, entry: DescribedEntry) -> Event:
    path, values = entry.path, entry.values
    reader.names.declare("event", entry.name, path)
    check_keys(path, values, EVENT, reader.faults)
    expression = reader.stand_in
    if "expression" in values:
        expression = instant(reader, f"{path}.expression", values["expression"])
        if expression.node[0] in operations_with(lambda row: row.kind == CONDITION):
            message, remedy = "is a comparison, which has no zero", "give the difference of its sides: a - b for a > b"
            reader.faults.add(f"{path}.expression", message, remedy, "EG-EVENT")
    direction = values.get("direction", 0)
    if not is_number(direction) or direction not in (-1, 0, 1):
        remedy = "give 1 for a rising, -1 for a falling value, 0 for both"
        reader.faults.add(f"{path}.direction", f"{direction!r} is not 1, -1 or 0", remedy, "EG-CHOICE")
        direction = 0
    reset = _reset(reader, f"{path}.reset", {} if values.get("reset") is None else values["reset"])
    restitution = None
    if values.get("restitution") is not None:
        restitution = reader.number(f"{path}.restitution", values["restitution"])
        if restitution is not None and not 0.0 <= restitution <= 1.0:
            reader.faults.add(f"{path}.restitution", f"{restitution:g} is not between 0 and 1", code="EG-RANGE")
        if reset:
            reader.faults.add(f"{path}.reset", "is given beside a restitution", "give one of the two", "EG-CONFLICT")
        if direction == 1:
            message = "with a restitution only a falling value (a gap that closes) is an impact"
            reader.faults.add(f"{path}.direction", message, "give -1, or leave it out", "EG-EVENT")
        direction = -1
    doc = reader.text(f"{path}.doc", values.get("doc", ""))
    terminal = _times(reader, f"{path}.terminal", values.get("terminal", False))
    friction, slip = _friction(reader, path, values)
    return Event(str(entry.name), expression, terminal, int(direction), reset, restitution, doc, friction, slip)


def _friction(reader: Reader, path: str, values: Mapping[str, Any]) -> tuple[float | None, tuple[str, ...]]:
    """The coefficient of friction of an impact, and the outputs that are its sliding velocities."""
    given, slip = values.get("friction"), values.get("slip")
    if given is None and slip is None:
        return None, ()
    if values.get("restitution") is None:
        what = "friction" if given is not None else "slip"
        remedy = "give the restitution of the impact, from 0 to 1"
        reader.faults.add(
            f"{path}.{what}", "is given without a restitution, so that there is no impact", remedy, "EG-MISSING"
        )
    if given is None or slip is None:
        missing, there = ("slip", "friction") if slip is None else ("friction", "slip")
        remedy = "slip: the output that is the sliding velocity" if slip is None else "friction: the coefficient"
        reader.faults.add(f"{path}.{there}", f"is given without {missing}", f"give {remedy}", "EG-MISSING")
        return None, ()
    friction = reader.number(f"{path}.friction", given)
    if friction is not None and not friction >= 0.0:
        reader.faults.add(f"{path}.friction", f"{friction:g} is negative", "give 0 or more", "EG-RANGE")
    names = [slip] if isinstance(slip, str) else items(slip)
    outputs = [*reader.names.of("output")]
    if names is None or not 1 <= len(names) <= 2 or not all(isinstance(name, str) for name in names):
        reader.wrong(f"{path}.slip", slip, kinds.SomeNames)
        return None, ()
    for name in names:
        if name not in outputs:
            remedy = nearest(name, outputs, "outputs")
            reader.faults.add(f"{path}.slip", f"no output {name!r} for the sliding velocity", remedy, "EG-NAME-UNKNOWN")
        elif (unit := reader.units.get(f"outputs.{name}")) is not None and unit.size != 1.0:
            reader.faults.add(
                f"{path}.slip", f"the output {name!r} is in {unit.text}", "give it in m/s, without a unit", "EG-UNIT"
            )
    return friction, tuple(names)


def _times(reader: Reader, path: str, value: Any) -> int:
    if isinstance(value, bool) or value is None:
        return int(bool(value))
    if isinstance(value, int) and value > 0:
        return value
    reader.wrong(path, value, kinds.Times)
    return 0


def check_resets(
    reader: Reader, events: Sequence[Event], clocks: Sequence[Clock], switched: Sequence[Switched]
) -> None:
    """Note new values of states that count samples, and others than 0 and 1 of whether a constraint is closed."""
    counters = {clock.counter: clock.states for clock in clocks}
    closed = {switch.state for switch in switched}
    for event in events:
        for name, value in event.reset:
            path = f"events.{event.name}.reset.{name}"
            if name in counters:
                remedy = f"reset {', '.join(counters[name])}, or declare them with another period or offset"
                reader.faults.add(
                    path, f"{name!r} counts samples, and a sample would be missed or come twice", remedy, "EG-EVENT"
                )
            elif name in closed and value.value not in (0.0, 1.0):
                remedy = "give 1 to close the constraint, 0 to open it"
                reader.faults.add(
                    path, f"{name!r} is 1 while the constraint is closed and 0 while it is open", remedy, "EG-EVENT"
                )


def instant(reader: Reader, path: str, value: Any) -> Expr:
    """An expression of what is known of a state without solving for accelerations."""
    expression = reader.expression(path, value, OUTPUT)
    for name, what in late_names(reader.names, symbols_of([expression])):
        remedy = (
            "allowed are t, parameters, inputs, coordinates, velocities, states, positions and velocities of markers"
        )
        reader.faults.add(path, f"the {what} {name!r} cannot be used in an event", remedy, "EG-REFERENCE")
    return expression


def _reset(reader: Reader, path: str, given: Any) -> tuple[tuple[str, Expr], ...]:
    if not isinstance(given, Mapping):
        reader.wrong(path, given, kinds.Rates)
        return ()
    known = list(reader.names.of("coordinate", "velocity", "state"))
    result = []
    for name, value in in_order(given, known):
        if name in known:
            result.append((str(name), instant(reader, f"{path}.{name}", value)))
        else:
            states = bool(reader.description.sections["states"])
            remedy = nearest(shown(name), known, f"coordinates and velocities{' and states' * states}")
            reader.faults.add(
                f"{path}.{name}", f"no coordinate or velocity{' or state' * states} {name!r}", remedy, "EG-NAME-UNKNOWN"
            )
    return tuple(result)
