"""Entries of the section ``states`` -> States of the mechanism and their initial values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from ..base.value_rules import POSITIVE
from ..elements.kinds import LAW
from ..graph.core import Expr, substitute
from .build_quantities import in_si, read_described
from .description import DescribedEntry
from .fields import STATE
from .mechanism import Clock, Event, FirstOrderState
from .values import Reader, is_number

COUNTER, EVENT = "_samples", "_sampled"  #: what follows the name of a clock's first state


class Timing(NamedTuple):
    """The sampled states of one period and offset, the first of which gives the clock its name."""

    entries: tuple[DescribedEntry, ...]

    @property
    def name(self) -> str:
        """The name of the first state."""
        return str(self.entries[0].name)


def group_by_clock(reader: Reader, entries: Sequence[DescribedEntry]) -> list[Timing]:
    """Sampled states by period and offset as they are written, the names of their clocks taken in."""
    groups: dict[tuple[str, str], list[DescribedEntry]] = {}
    for entry in entries:
        if "sampled" in entry.values or ("period" in entry.values and "rate" not in entry.values):
            written = (_shown_time(entry.values.get("period")), _shown_time(entry.values.get("offset", 0)))
            groups.setdefault(written, []).append(entry)
    timings = [Timing(tuple(group)) for group in groups.values()]
    for timing in timings:
        reader.names.declare("state", timing.name + COUNTER, timing.entries[0].path)
        reader.names.declare("event", timing.name + EVENT, timing.entries[0].path)
    return timings


def build_clocks(
    reader: Reader, timings: Sequence[Timing], new: Mapping[str, Expr]
) -> tuple[tuple[Clock, ...], tuple[Event, ...]]:
    """The clocks and their events.

    Parameters
    ----------
    new : mapping of str to Expr
        Sampled state -> its new value.
    """
    graph, time = reader.graph, reader.graph.symbol("t")
    clocks, events = [], []
    for timing in timings:
        period, offset = _sampling_times(reader, timing)
        names = tuple(str(entry.name) for entry in timing.entries)
        clock = Clock(timing.name + COUNTER, timing.name + EVENT, names, period, offset)
        count = graph.symbol(clock.counter)
        renewed: dict[Expr, Expr] = {}
        for name in names:
            renewed[graph.symbol(name)] = substitute([new[name]], renewed)[0]
        reset = (*((name, renewed[graph.symbol(name)]) for name in names), (clock.counter, count + 1.0))
        doc = f"a sampling time of {', '.join(names)}"
        events.append(Event(clock.event, time - (offset + count * period), 0, 1, reset, None, doc))
        clocks.append(clock)
    return tuple(clocks), tuple(events)


def _sampling_times(reader: Reader, timing: Timing) -> tuple[Expr, Expr]:
    """Period and offset of a clock, read in each entry so that each fault has its place."""
    found = []
    for entry in timing.entries:
        path, given = f"{entry.path}.period", entry.values.get("period")
        if given is None:
            reader.faults.missing(path, "give the time from one sampling time to the next, in s")
        period = reader.stand_in if given is None else reader.expression(path, given)
        if given is not None:
            remedy = "give the time between samples, in s"
            reader.requirements.inside(path, period, POSITIVE, remedy, "{:g} is not positive")
        found.append((period, reader.expression(f"{entry.path}.offset", entry.values.get("offset", 0.0))))
    return found[0]


def _shown_time(given: Any) -> str:
    """A number or expression as text, so that 0.010 and "0.01" are the same."""
    try:
        return repr(float(given))
    except (TypeError, ValueError):
        return "".join(str(given).split())


class DeclaredStates(NamedTuple):
    """The entries whose names are taken in, and those that are sampled by clock."""

    entries: list[DescribedEntry]
    timings: list[Timing]

    def __bool__(self) -> bool:
        return bool(self.entries)


class BuiltStates(NamedTuple):
    """The states in the order of their declaration, counters of clocks last, and what belongs to them."""

    states: tuple[FirstOrderState, ...]
    initial: dict[str, Expr]
    clocks: tuple[Clock, ...]
    events: tuple[Event, ...]  #: one a clock


def declare_states(reader: Reader, entries: list[DescribedEntry], bare: bool) -> DeclaredStates:
    """Take in the names of all states before any expression is read; those that can be used are returned.

    Parameters
    ----------
    bare : bool
        Whether a Lagrangian or equations came instead of bodies and joints, which have no states beside them.
    """
    if entries and bare:
        message = "a bare Lagrangian, or equations, have no states beside them"
        reader.faults.add(
            "states",
            message,
            "write them as velocities of from_equations, or describe bodies and joints",
            "EG-CONFLICT",
        )
    usable = []
    for entry in entries:
        if isinstance(entry.name, str) and entry.name.endswith("_dot"):
            remedy = "choose a name that does not end in _dot"
            reader.faults.add(
                entry.path, f"{entry.name!r} is the name of a rate, not of a state", remedy, "EG-NAME-TAKEN"
            )
        if reader.names.declare("state", entry.name, entry.path):
            usable.append(entry)
    return DeclaredStates(usable, group_by_clock(reader, usable))


def build_states(reader: Reader, declared: DeclaredStates) -> BuiltStates:
    """The states, their initial values and sampling; faults are noted."""
    states: list[FirstOrderState] = []
    initial: dict[str, Expr] = {}
    for entry in declared.entries:
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
    clocks, events = build_clocks(reader, declared.timings, new)
    zero = reader.graph.zero
    counters = (FirstOrderState(c.counter, zero, doc=f"samples of {', '.join(c.states)} so far") for c in clocks)
    return BuiltStates((*states, *counters), initial, clocks, events)


def _motion(reader: Reader, entry: DescribedEntry) -> tuple[Expr, Expr | None]:
    """The rate of a state, and its new value at sampling times if it is sampled."""
    values, path = entry.values, entry.path
    if "rate" in values and "sampled" in values:
        reader.faults.add(path, "has a rate and is sampled", "give rate, or sampled and period", "EG-CONFLICT")
    if "sampled" in values:
        return reader.graph.zero, reader.expression(f"{path}.sampled", values["sampled"], LAW)
    if "period" in values and "rate" not in values:  # a function of the run renews it
        return reader.graph.zero, reader.graph.symbol(str(entry.name))
    for key in ("period", "offset"):
        if key in values:
            reader.faults.add(
                f"{path}.{key}", "is a key of states that are sampled", "give sampled instead of rate", "EG-CONFLICT"
            )
    if values.get("rate") is None:
        reader.faults.missing(f"{path}.rate", "give the derivative of the state, or sampled and period")
        return reader.stand_in, None
    return reader.expression(f"{path}.rate", values["rate"], LAW), None
