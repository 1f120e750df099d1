"""Stage describe, states of force elements: entries of forces -> the states that elements have of their own."""

from __future__ import annotations

from ..forces import FORCES
from .description import DescribedEntry
from .mechanism import STATE_RATE, FirstOrderState
from .values import Reader


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
