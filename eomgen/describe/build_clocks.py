"""Stage describe, sampling: states with ``sampled`` and ``period`` -> Clocks, and the events that renew the values.

States of one period and offset have one clock.  At its times they are renewed in the order of their declaration, and
each takes those renewed before it at their new values, as lines of a program do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from ..base.value_rules import POSITIVE
from ..graph.core import Expr
from ..graph.substitute import substitute
from .description import DescribedEntry
from .mechanism import Clock, Event
from .values import Reader

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
            written = (_text(entry.values.get("period")), _text(entry.values.get("offset", 0)))
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
        period, offset = _times(reader, timing)
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


def _times(reader: Reader, timing: Timing) -> tuple[Expr, Expr]:
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


def _text(given: Any) -> str:
    """A number or expression as text, so that 0.010 and "0.01" are the same."""
    try:
        return repr(float(given))
    except (TypeError, ValueError):
        return "".join(str(given).split())
