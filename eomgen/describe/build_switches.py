"""Constraints that close and open: their keys -> a state 1 or 0, events, and the constraint apart.

A constraint of that kind is no equation of the mechanism; it acts by a force while its state is 1.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..constraints import Constraint
from ..elements import kinds
from ..graph.core import Expr, Graph, symbols_of
from ..graph.shown import quoted
from .build_events import instant
from .description import DescribedEntry, items
from .mechanism import Event, FirstOrderState, Switched
from .names import nearest
from .read_shapes import positive
from .values import Reader

CLOSED, CLOSES, OPENS = "_closed", "_closes", "_opens"  #: what follows the constraint's name: its state and events
KEYS = ("closes", "opens", "closed")


def is_switched(entry: DescribedEntry) -> bool:
    """Whether a constraint closes or opens."""
    return isinstance(entry.name, str) and not entry.values.keys().isdisjoint(KEYS)


def declare_switches(reader: Reader, entries: Sequence[DescribedEntry]) -> list[DescribedEntry]:
    """Take in the names of states and events; the entries that have them."""
    found = [entry for entry in entries if is_switched(entry)]
    for entry in found:
        reader.names.declare("state", f"{entry.name}{CLOSED}", entry.path)
        for key, suffix in (("closes", CLOSES), ("opens", OPENS)):
            if key in entry.values:
                reader.names.declare("event", f"{entry.name}{suffix}", entry.path)
    return found


def build_switches(
    reader: Reader, entries: Sequence[DescribedEntry], constraints: Sequence[Constraint]
) -> tuple[Switched, ...]:
    """The constraints that close and open, with what makes them do so."""
    names = [str(entry.name) for entry in entries]
    made = {constraint.name: constraint for constraint in constraints}
    found = []
    for entry in entries:
        path, values = entry.path, entry.values
        closed = values.get("closed", "closes" not in values)
        releases = _released(reader, entry, names)
        rate = reader.expression(f"{path}.stabilisation", values.get("stabilisation", 10))
        positive(reader, f"{path}.stabilisation", rate)
        switch = Switched(
            made.get(str(entry.name)), f"{entry.name}{CLOSED}", reader.flag(f"{path}.closed", closed), rate,
            tuple(f"{name}{CLOSED}" for name in releases),
        )  # fmt: skip
        found.append(switch)
    return tuple(found)


def _released(reader: Reader, entry: DescribedEntry, names: Sequence[str]) -> list[str]:
    """The constraints that let go; one name counts as a list of one."""
    path, given = f"{entry.path}.releases", entry.values.get("releases")
    if given is None:
        return []
    listed = [given] if isinstance(given, str) else items(given)
    if listed is None:
        reader.wrong(path, given, kinds.SomeNames)
        return []
    for k, name in enumerate(listed):
        if name not in names or name == entry.name:
            remedy = nearest(str(name), [n for n in names if n != entry.name], "that close and open")
            place = path if isinstance(given, str) else f"{path}[{k}]"
            reader.faults.add(place, f"{name!r} is no other constraint that opens", remedy, "EG-NAME-UNKNOWN")
    return [str(name) for name in listed]


def states_of_switches(reader: Reader, switched: Sequence[Switched]) -> tuple[FirstOrderState, ...]:
    """1 while a constraint holds."""
    zero = reader.graph.zero
    return tuple(FirstOrderState(s.state, zero, doc=f"1 while {s.state.removesuffix(CLOSED)} holds") for s in switched)


def begun_switches(graph: Graph, switched: Sequence[Switched]) -> dict[str, Expr]:
    """Where they start."""
    return {s.state: graph.one if s.closed else graph.zero for s in switched}


def events_of_switches(
    reader: Reader, entries: Sequence[DescribedEntry], switched: Sequence[Switched]
) -> tuple[Event, ...]:
    """What closes and opens them; velocities after an impact follow when the mechanism is known."""
    graph, events = reader.graph, []
    for entry, switch in zip(entries, switched, strict=True):
        state = graph.symbol(switch.state)
        holds = graph.apply("lt", 0.5, state)
        if "closes" in entry.values:
            gap = _falling(reader, f"{entry.path}.closes", entry.values["closes"])
            reset: list[tuple[str, Expr]] = [(name, graph.zero) for name in switch.releases]
            reset.append((switch.state, graph.one))
            gap = graph.apply("select", holds, graph.one, gap)
            events.append(Event(f"{entry.name}{CLOSES}", gap, 0, -1, tuple(reset), None, f"{entry.name} closes"))
        if "opens" in entry.values:
            left = _falling(reader, f"{entry.path}.opens", entry.values["opens"])
            left = graph.apply("select", holds, left, graph.one)
            reset = [(switch.state, graph.zero)]
            events.append(Event(f"{entry.name}{OPENS}", left, 0, -1, tuple(reset), None, f"{entry.name} opens"))
    return tuple(events)


def _falling(reader: Reader, path: str, value: object) -> Expr:
    """An expression that can fall to 0."""
    before = len(reader.faults.problems)
    found = instant(reader, path, value)
    if len(reader.faults.problems) > before:
        return found
    remedy = "write an expression that falls to 0 there: 1 - t for the time t = 1"
    if found.node[0] in ("lt", "le", "eq", "not", "and", "or"):
        reader.faults.add(
            path, f"{quoted(value, 80)} is a comparison, which does not fall to 0 but jumps", remedy, "EG-EXPRESSION"
        )
    elif symbols_of([found]) <= {*reader.names.of("parameter")}:
        reader.faults.add(
            path, f"{quoted(value, 80)} is constant, so that it never falls to 0", remedy, "EG-EXPRESSION"
        )
    return found
