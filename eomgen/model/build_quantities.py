"""Entries of parameters, inputs, outputs, states and events, constraints that close and open -> what they are in SI."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..base.operations import OPERATIONS
from ..base.value_rules import POSITIVE
from ..elements import kinds
from ..elements.constraints.constraint import SWITCHING, Constraint, event_of, is_switched, state_of
from ..elements.dimensions import NONE
from ..elements.element_type import Entry
from ..elements.kinds import LAW, MOTION, OUTPUT, Fields
from ..expr.core import LEAVES, Expr, is_comparison, reachable, substitute, symbols_of
from ..expr.texts import printed, quoted
from .checks import check_keys
from .description import DescribedEntry, items
from .fields import EVENT, INPUT, OUTPUT_FIELDS, PARAMETER, STATE
from .mechanism import Clock, Event, FirstOrderState, Input, Output, Parameter, Switched
from .names import names_of_acceleration, nearest
from .sympy_face import in_order
from .units import Unit, UnitError, read_unit
from .values import Reader, is_number, take_latex


def read_described(reader: Reader, entry: DescribedEntry, fields: Fields) -> tuple[Unit, str]:
    """Unit and doc of an entry, its keys checked."""
    check_keys(entry.path, entry.values, fields, reader.faults)
    text, doc = (reader.text(f"{entry.path}.{key}", entry.values.get(key, "")) for key in ("unit", "doc"))
    take_latex(reader, f"{entry.path}.latex", entry.name, entry.values.get("latex", ""))
    try:
        unit = read_unit(text)
    except UnitError as error:
        reader.fault(f"{entry.path}.unit", str(error), error.remedy, "EG-UNIT")
        return Unit(NONE), doc
    if text:
        reader.units[entry.path] = unit
    return unit, doc


def in_si(reader: Reader, path: str, value: float | None, unit: Unit) -> float | None:
    """A value in SI units; one that no double holds there is a fault."""
    if value is None or unit.size == 1.0:
        return value
    result = value * unit.size
    if not math.isfinite(result) or (value != 0.0 and abs(result) < sys.float_info.min):
        remedy = "check the value and its unit"
        reader.fault(
            path, f"{value:g} {unit.text} in {unit.si} is outside the range of double precision", remedy, "EG-UNIT"
        )
        return None
    return result


def read_parameter(reader: Reader, entry: DescribedEntry) -> Parameter:
    """The parameter of an entry."""
    return Parameter(str(entry.name), *_declared(reader, entry, "parameter", PARAMETER))


def read_input(reader: Reader, entry: DescribedEntry) -> Input:
    """The input of an entry, without its expression over time."""
    value, unit, doc = _declared(reader, entry, "input", INPUT)
    return Input(str(entry.name), value or 0.0, unit, doc)


def _declared(reader: Reader, entry: DescribedEntry, kind: str, fields: Fields) -> tuple[float | None, str, str]:
    """Value, SI unit and doc of an entry whose name is declared."""
    reader.names.declare(kind, entry.name, entry.path)
    unit, doc = read_described(reader, entry, fields)
    raw, path = entry.values.get("value"), f"{entry.path}.value"
    value = None if raw is None else reader.number(path, raw)
    return in_si(reader, path, value, unit), unit.si, doc


def with_signal(reader: Reader, declared: Input, entry: DescribedEntry) -> Input:
    """The input with its expression over time, read when all coordinates are known."""
    if entry.values.get("signal") is None:
        return declared
    path = f"{entry.path}.signal"
    expression = reader.expression(path, entry.values["signal"], MOTION)
    for name in sorted(symbols_of([expression])):
        if reader.names.kinds.get(name) == "input":
            remedy = "allowed are t, coordinates, velocities and parameters"
            reader.fault(path, f"the input {name!r} cannot be used here", remedy, "EG-REFERENCE")
    if any(reader.graph.nodes[i][0] not in (*OPERATIONS, *LEAVES) for i in reachable(reader.graph, [expression.id])):
        reader.fault(path, "a function of the model cannot be used here", "write out its expression", "EG-REFERENCE")
    return replace(declared, signal=expression)


class Outputs:
    """The outputs of a model; force laws, events and other outputs may use them by name.

    Their names are taken in at once and their expressions read when they are asked for, since the outputs that one
    depends on may stand after it.
    """

    def __init__(self, reader: Reader, entries: list[DescribedEntry]) -> None:
        self._reader, self._entries = reader, entries
        self._places: dict[str, int] = {}
        self._read: dict[int, tuple[Output, Expr]] = {}
        self._open: list[int] = []  # those being read, each asked for by the one before
        for k, entry in enumerate(entries):
            kind = reader.names.kinds.get(entry.name) if isinstance(entry.name, str) else None
            if entry.name in self._places:
                reader.fault(entry.path, "the name is given to two outputs", "rename one", "EG-NAME-TAKEN")
            elif kind not in _REPEATED:
                reader.names.declare("output", entry.name, entry.path)
            if isinstance(entry.name, str):
                self._places.setdefault(entry.name, k)
        reader.output = self.expression

    def all(self) -> tuple[Output, ...]:
        """All outputs, in the order of their declaration."""
        return tuple(self._at(k)[0] for k in range(len(self._entries)))

    def expression(self, name: str) -> Expr:
        """The expression of the output with this name, in SI units."""
        return self._at(self._places[name])[1] if name in self._places else self._reader.stand_in

    def _at(self, k: int) -> tuple[Output, Expr]:
        if k in self._open:
            round_trip = [*self._open[self._open.index(k) :], k]
            message = f"depends on itself: {' -> '.join(str(self._entries[i].name) for i in round_trip)}"
            self._reader.fault(self._entries[k].path, message, "write one of them without the others", "EG-CIRCLE")
            return Output(str(self._entries[k].name), self._reader.stand_in), self._reader.stand_in
        if k not in self._read:
            self._open.append(k)
            self._read[k] = self._output(self._entries[k])
            self._open.pop()
        return self._read[k]

    def _output(self, entry: DescribedEntry) -> tuple[Output, Expr]:
        reader, faults, path = self._reader, self._reader.faults, entry.path
        unit, doc = read_described(reader, entry, OUTPUT_FIELDS)
        expression: Expr = reader.stand_in
        if "expression" in entry.values:
            expression = reader.expression(f"{path}.expression", entry.values["expression"], OUTPUT)
        if unit.size != 1.0 and expression.value is not None:
            remedy = "use a parameter with a unit"
            faults.add(f"{path}.unit", "the expression is a number whose unit is not known", remedy, "EG-UNIT")
        kind = reader.names.kinds.get(entry.name) if isinstance(entry.name, str) else None
        if kind in _REPEATED:
            if expression != reader.graph.symbol(entry.name):
                message = f"{entry.name!r} is a {kind}"
                faults.add(path, message, f"an output of that name must be {entry.name} itself", "EG-NAME-TAKEN")
            elif unit.size != 1.0:
                remedy = f"leave the unit out, or give the output in {unit.text} another name"
                faults.add(f"{path}.unit", f"{entry.name!r} is a {kind}, which is in SI units", remedy, "EG-UNIT")
        raw = expression / unit.size if unit.size != 1.0 else expression
        return Output(str(entry.name), raw, unit.text, doc, f"{path}.expression" in reader.of_velocities), expression


#: Kinds of names that an output may repeat.
_REPEATED = ("coordinate", "velocity", "acceleration", "multiplier")


# -- states, events, switches ------------------------------------------------------------------------------------------


def read_event(reader: Reader, entry: DescribedEntry) -> Event:
    """The event of an entry; faults are noted."""
    path, values = entry.path, entry.values
    reader.names.declare("event", entry.name, path)
    check_keys(path, values, EVENT, reader.faults)
    expression = reader.stand_in
    if "expression" in values:
        expression = instant(reader, f"{path}.expression", values["expression"])
        if is_comparison(expression):
            message, remedy = "is a comparison, which has no zero", "give the difference of its sides: a - b for a > b"
            reader.fault(f"{path}.expression", message, remedy, "EG-EVENT")
    e = Entry(reader, str(entry.name), path, values)
    e.fields = EVENT
    direction = e["direction"]
    reset = _reset(reader, f"{path}.reset", {} if values.get("reset") is None else values["reset"])
    restitution = None
    if values.get("restitution") is not None:
        restitution = reader.number(f"{path}.restitution", values["restitution"])
        if restitution is not None and not 0.0 <= restitution <= 1.0:
            reader.fault(f"{path}.restitution", f"{restitution:g} is not between 0 and 1", code="EG-RANGE")
        if reset:
            reader.fault(f"{path}.reset", "is given beside a restitution", "give one of the two", "EG-CONFLICT")
        if direction == 1:
            message = "with a restitution only a falling value (a gap that closes) is an impact"
            reader.fault(f"{path}.direction", message, "give -1, or leave it out", "EG-EVENT")
        direction = -1
    doc, terminal = e["doc"], e["terminal"]
    friction, slip = _friction(reader, path, values)
    return Event(e.name, expression, terminal, direction, reset, restitution, doc, friction, slip)


def _friction(reader: Reader, path: str, values: Mapping[str, Any]) -> tuple[float | None, tuple[str, ...]]:
    """The coefficient of friction of an impact, and the outputs that are its sliding velocities."""
    raw, slip = values.get("friction"), values.get("slip")
    if raw is None and slip is None:
        return None, ()
    if values.get("restitution") is None:
        what = "friction" if raw is not None else "slip"
        remedy = "give the restitution of the impact, from 0 to 1"
        reader.fault(
            f"{path}.{what}", "is given without a restitution, so that there is no impact", remedy, "EG-MISSING"
        )
    if raw is None or slip is None:
        missing, there = ("slip", "friction") if slip is None else ("friction", "slip")
        remedy = "slip: the output that is the sliding velocity" if slip is None else "friction: the coefficient"
        reader.fault(f"{path}.{there}", f"is given without {missing}", f"give {remedy}", "EG-MISSING")
        return None, ()
    friction = reader.number(f"{path}.friction", raw)
    if friction is not None and not friction >= 0.0:
        reader.fault(f"{path}.friction", f"{friction:g} is negative", "give 0 or more", "EG-RANGE")
    names = [slip] if isinstance(slip, str) else items(slip)
    outputs = [*reader.names.of("output")]
    if names is None or not 1 <= len(names) <= 2 or not all(isinstance(name, str) for name in names):
        reader.wrong(f"{path}.slip", slip, EVENT["slip"])
        return None, ()
    for name in names:
        if name not in outputs:
            remedy = nearest(name, outputs, "outputs")
            reader.fault(f"{path}.slip", f"no output {name!r} for the sliding velocity", remedy, "EG-NAME-UNKNOWN")
        elif (unit := reader.units.get(f"outputs.{name}")) is not None and unit.size != 1.0:
            message = f"the output {name!r} is in {unit.text}"
            reader.fault(f"{path}.slip", message, "give it in m/s, without a unit", "EG-UNIT")
    return friction, tuple(names)


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
                reader.fault(
                    path, f"{name!r} counts samples, and a sample would be missed or come twice", remedy, "EG-EVENT"
                )
            elif name in closed and value.value not in (0.0, 1.0):
                remedy = "give 1 to close the constraint, 0 to open it"
                reader.fault(
                    path, f"{name!r} is 1 while the constraint is closed and 0 while it is open", remedy, "EG-EVENT"
                )


def instant(reader: Reader, path: str, value: Any) -> Expr:
    """An expression of what is known of a state without solving for accelerations."""
    expression = reader.expression(path, value, OUTPUT)
    for name, what in names_of_acceleration(reader, symbols_of([expression])):
        remedy = (
            "allowed are t, parameters, inputs, coordinates, velocities, states, positions and velocities of markers"
        )
        reader.fault(path, f"the {what} {name!r} cannot be used in an event", remedy, "EG-REFERENCE")
    return expression


def _reset(reader: Reader, path: str, raw: Any) -> tuple[tuple[str, Expr], ...]:
    if not isinstance(raw, Mapping):
        reader.wrong(path, raw, kinds.Rates)
        return ()
    known = list(reader.names.of("coordinate", "velocity", "state"))
    result = []
    for name, value in in_order(raw, known):
        if name in known:
            result.append((str(name), instant(reader, f"{path}.{name}", value)))
        else:
            states = bool(reader.description.sections["states"])
            remedy = nearest(printed(name), known, f"coordinates and velocities{' and states' * states}")
            reader.fault(
                f"{path}.{name}", f"no coordinate or velocity{' or state' * states} {name!r}", remedy, "EG-NAME-UNKNOWN"
            )
    return tuple(result)


COUNTER, SAMPLED = "_samples", "_sampled"  #: what follows the name of a clock's first state


def group_by_clock(reader: Reader, entries: Sequence[DescribedEntry]) -> list[list[DescribedEntry]]:
    """Sampled states by period and offset as they are written, the first of which names their clock."""
    groups: dict[tuple[str, str], list[DescribedEntry]] = {}
    for entry in entries:
        if "sampled" in entry.values or ("period" in entry.values and "rate" not in entry.values):
            written = (_time_text(entry.values.get("period")), _time_text(entry.values.get("offset", 0)))
            groups.setdefault(written, []).append(entry)
    for first, *_ in groups.values():
        reader.names.declare("state", f"{first.name}{COUNTER}", first.path)
        reader.names.declare("event", f"{first.name}{SAMPLED}", first.path)
    return [*groups.values()]


def build_clocks(
    reader: Reader, groups: Sequence[Sequence[DescribedEntry]], new: Mapping[str, Expr]
) -> tuple[tuple[Clock, ...], tuple[Event, ...]]:
    """The clocks and their events; ``new`` has the new value of each sampled state."""
    graph, time = reader.graph, reader.graph.symbol("t")
    clocks, events = [], []
    for entries in groups:
        period, offset = _sampling_times(reader, entries)
        names = tuple(str(entry.name) for entry in entries)
        clock = Clock(names[0] + COUNTER, names[0] + SAMPLED, names, period, offset)
        count = graph.symbol(clock.counter)
        renewed: dict[Expr, Expr] = {}
        for name in names:
            renewed[graph.symbol(name)] = substitute([new[name]], renewed)[0]
        reset = (*((name, renewed[graph.symbol(name)]) for name in names), (clock.counter, count + 1.0))
        doc = f"a sampling time of {', '.join(names)}"
        events.append(Event(clock.event, time - (offset + count * period), 0, 1, reset, None, doc))
        clocks.append(clock)
    return tuple(clocks), tuple(events)


def _sampling_times(reader: Reader, entries: Sequence[DescribedEntry]) -> tuple[Expr, Expr]:
    """Period and offset of a clock, read in each entry so that each fault has its place."""
    result = []
    for entry in entries:
        path, raw = f"{entry.path}.period", entry.values.get("period")
        if raw is None:
            reader.faults.missing(path, "give the time from one sampling time to the next, in s")
        period = reader.stand_in if raw is None else reader.expression(path, raw)
        if raw is not None:
            remedy = "give the time between samples, in s"
            reader.requirements.inside(path, period, POSITIVE, remedy, "{:g} is not positive")
        result.append((period, reader.expression(f"{entry.path}.offset", entry.values.get("offset", 0.0))))
    return result[0]


def _time_text(raw: Any) -> str:
    """A number or expression as text, so that 0.010 and "0.01" are the same."""
    try:
        return repr(float(raw))
    except (TypeError, ValueError):
        return "".join(str(raw).split())


def declare_states(
    reader: Reader, entries: list[DescribedEntry], bare: bool
) -> tuple[list[DescribedEntry], list[list[DescribedEntry]]]:
    """Take in the names of all states before any expression is read: the usable entries, the sampled ones by clock.

    Bare equations, without bodies and joints, have no states beside them.
    """
    if entries and bare:
        message = "a bare Lagrangian, or equations, have no states beside them"
        remedy = "write them as velocities of from_equations, or describe bodies and joints"
        reader.fault("states", message, remedy, "EG-CONFLICT")
    usable = []
    for entry in entries:
        if isinstance(entry.name, str) and entry.name.endswith("_dot"):
            remedy = "choose a name that does not end in _dot"
            reader.fault(entry.path, f"{entry.name!r} is the name of a rate, not of a state", remedy, "EG-NAME-TAKEN")
        if reader.names.declare("state", entry.name, entry.path):
            usable.append(entry)
    return usable, group_by_clock(reader, usable)


def build_states(
    reader: Reader, entries: Sequence[DescribedEntry], groups: Sequence[Sequence[DescribedEntry]]
) -> tuple[tuple[FirstOrderState, ...], dict[str, Expr], tuple[Clock, ...], tuple[Event, ...]]:
    """The states, counters of clocks last, their initial values, clocks and an event for each; faults are noted."""
    states: list[FirstOrderState] = []
    initial: dict[str, Expr] = {}
    for entry in entries:
        unit, doc = read_described(reader, entry, STATE)
        start, path = entry.values.get("initial"), f"{entry.path}.initial"
        if is_number(start):
            value = in_si(reader, path, reader.number(path, start), unit)
            initial[entry.name] = reader.graph.constant(0.0 if value is None else value)
        elif start is not None:
            initial[entry.name] = reader.expression(path, start)
        rate, sampled = _motion(reader, entry)
        states.append(FirstOrderState(str(entry.name), rate, unit.si, doc, sampled))
    new = {state.name: state.sampled for state in states if state.sampled is not None}
    clocks, events = build_clocks(reader, groups, new)
    zero = reader.graph.zero
    counters = (FirstOrderState(c.counter, zero, doc=f"samples of {', '.join(c.states)} so far") for c in clocks)
    return (*states, *counters), initial, clocks, events


def _motion(reader: Reader, entry: DescribedEntry) -> tuple[Expr, Expr | None]:
    """The rate of a state, and its new value at sampling times if it is sampled."""
    values, path = entry.values, entry.path
    if "rate" in values and "sampled" in values:
        reader.fault(path, "has a rate and is sampled", "give rate, or sampled and period", "EG-CONFLICT")
    if "sampled" in values:
        return reader.graph.zero, reader.expression(f"{path}.sampled", values["sampled"], LAW)
    if "period" in values and "rate" not in values:  # a function of the run renews it
        return reader.graph.zero, reader.graph.symbol(str(entry.name))
    for key in ("period", "offset"):
        if key in values:
            reader.fault(
                f"{path}.{key}", "is a key of states that are sampled", "give sampled instead of rate", "EG-CONFLICT"
            )
    if values.get("rate") is None:
        reader.faults.missing(f"{path}.rate", "give the derivative of the state, or sampled and period")
        return reader.stand_in, None
    return reader.expression(f"{path}.rate", values["rate"], LAW), None


def declare_switches(reader: Reader, entries: Sequence[DescribedEntry]) -> list[DescribedEntry]:
    """Take in the names of states and events; the entries that have them."""
    result = [entry for entry in entries if isinstance(entry.name, str) and is_switched(entry.values)]
    for entry in result:
        reader.names.declare("state", state_of(entry.name), entry.path)
        for key in ("closes", "opens"):
            if key in entry.values:
                reader.names.declare("event", event_of(entry.name, key), entry.path)
    return result


def build_switches(
    reader: Reader, entries: Sequence[DescribedEntry], constraints: Sequence[Constraint]
) -> tuple[Switched, ...]:
    """The constraints that close and open, with what makes them do so."""
    names = [str(entry.name) for entry in entries]
    made = {constraint.name: constraint for constraint in constraints}
    result = []
    for entry in entries:
        path, values = entry.path, entry.values
        closed = values.get("closed", "closes" not in values)
        releases = _released(reader, entry, names)
        rate = reader.expression(f"{path}.stabilisation", values.get("stabilisation", 10))
        reader.requirements.inside(f"{path}.stabilisation", rate, POSITIVE, "must be greater than 0")
        state = (state_of(str(entry.name)), reader.flag(f"{path}.closed", closed), rate)
        result.append(Switched(made.get(str(entry.name)), *state, tuple(map(state_of, releases))))
    return tuple(result)


def _released(reader: Reader, entry: DescribedEntry, names: Sequence[str]) -> list[str]:
    """The constraints that let go; one name counts as a list of one."""
    path, raw = f"{entry.path}.releases", entry.values.get("releases")
    if raw is None:
        return []
    listed = SWITCHING["releases"].read(reader, path, raw) or []
    for k, name in enumerate(listed):
        if name not in names or name == entry.name:
            remedy = nearest(str(name), [n for n in names if n != entry.name], "that close and open")
            place = path if isinstance(raw, str) else f"{path}[{k}]"
            reader.fault(place, f"{name!r} is no other constraint that opens", remedy, "EG-NAME-UNKNOWN")
    return [str(name) for name in listed]


def events_of_switches(
    reader: Reader, entries: Sequence[DescribedEntry], switched: Sequence[Switched]
) -> tuple[Event, ...]:
    """What closes and opens them; velocities after an impact follow when the mechanism is known."""
    graph, events = reader.graph, []
    for entry, switch in zip(entries, switched, strict=True):
        closing = (*((name, graph.zero) for name in switch.releases), (switch.state, graph.one))
        for key, reset in (("closes", closing), ("opens", ((switch.state, graph.zero),))):
            if key in entry.values:
                left = _falling(reader, f"{entry.path}.{key}", entry.values[key])
                watched = (graph.one, left) if key == "closes" else (left, graph.one)
                zero = graph.apply("select", switch.holds, *watched)
                events.append(Event(event_of(entry.name, key), zero, 0, -1, reset, None, f"{entry.name} {key}"))
    return tuple(events)


def _falling(reader: Reader, path: str, value: object) -> Expr:
    """An expression that can fall to 0."""
    before = len(reader.faults.problems)
    result = instant(reader, path, value)
    if len(reader.faults.problems) > before:
        return result
    remedy = "write an expression that falls to 0 there: 1 - t for the time t = 1"
    if is_comparison(result):
        reader.fault(
            path, f"{quoted(value, 80)} is a comparison, which does not fall to 0 but jumps", remedy, "EG-EXPRESSION"
        )
    elif symbols_of([result]) <= {*reader.names.of("parameter")}:
        reader.fault(path, f"{quoted(value, 80)} is constant, so that it never falls to 0", remedy, "EG-EXPRESSION")
    return result
