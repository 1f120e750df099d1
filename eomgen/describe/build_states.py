"""Stage describe, states: entries of the section ``states`` -> States of the mechanism and their initial values."""

from __future__ import annotations

from ..forces import FORCES
from ..graph.core import Expr
from .build_quantities import in_si, read_described
from .description import DescribedEntry
from .fields import LAW, STATE
from .mechanism import STATE_RATE, FirstOrderState
from .values import Reader, is_number


def declare_states(reader: Reader, entries: list[DescribedEntry], bare: bool) -> list[DescribedEntry]:
    """Take in the names of all states before any expression is read; those that can be used are returned.

    Parameters
    ----------
    bare : bool
        Whether a Lagrangian or equations came instead of bodies and joints, which have no states beside them.
    """
    if entries and bare:
        message = "a bare Lagrangian, or equations, have no states beside them"
        reader.faults.add(
            "states", message, "write them as velocities of from_equations, or describe bodies and joints"
        )
    usable = []
    for entry in entries:
        if isinstance(entry.name, str) and entry.name.endswith("_dot"):
            remedy = "choose a name that does not end in _dot"
            reader.faults.add(entry.path, f"{entry.name!r} is the name of a rate, not of a state", remedy)
        if reader.names.declare("state", entry.name, entry.path):
            usable.append(entry)
    return usable


def states_of(entry: DescribedEntry) -> dict[str, str]:
    """Names of the states that a force element has of its own, and their units."""
    kind = entry.values.get("type")
    if not isinstance(kind, str) or kind not in FORCES or not isinstance(entry.name, str):
        return {}
    return {f"{entry.name}_{suffix}": unit for suffix, unit in FORCES[kind].states(entry.values).items()}


def own_states(
    reader: Reader, entries: list[DescribedEntry]
) -> tuple[tuple[FirstOrderState, ...], dict[str, tuple[str, str]]]:
    """Take in the states of force elements, which begin at 0: the states, and what the symbols of their rates are."""
    states: list[FirstOrderState] = []
    rates: dict[str, tuple[str, str]] = {}
    for entry in entries:
        for k, (name, unit) in enumerate(states_of(entry).items()):
            if reader.names.declare("state", name, entry.path):
                rate = f"rate of {name}"
                rates[rate] = (f"{STATE_RATE}{k}", str(entry.name))
                states.append(FirstOrderState(name, reader.graph.symbol(rate), unit, f"state of {entry.name}"))
    return tuple(states), rates


def build_states(reader: Reader, entries: list[DescribedEntry]) -> tuple[tuple[FirstOrderState, ...], dict[str, Expr]]:
    """The states in the order of their declaration, and their initial values by name; faults are noted."""
    states: list[FirstOrderState] = []
    initial: dict[str, Expr] = {}
    for entry in entries:
        unit, doc = read_described(reader, entry, STATE)
        given = entry.values.get("rate")
        rate = reader.stand_in if given is None else reader.expression(f"{entry.path}.rate", given, LAW)
        start, path = entry.values.get("initial"), f"{entry.path}.initial"
        if is_number(start):
            value = in_si(reader, path, reader.number(path, start), unit)
            initial[entry.name] = reader.graph.constant(0.0 if value is None else value)
        elif start is not None:
            initial[entry.name] = reader.expression(path, start)
        states.append(FirstOrderState(str(entry.name), rate, unit.si, doc))
    return tuple(states), initial
