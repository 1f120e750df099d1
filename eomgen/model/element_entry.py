"""One entry of a section of elements: its keys -> expressions, markers, coordinates, bodies, contact points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from ..base.value_rules import TURN
from ..elements.constraints import Constraint
from ..elements.constraints.cams import Profile
from ..elements.element_type import ElementType, Entry, Types
from ..elements.forces import FORCES
from ..elements.kinds import Law
from ..errors import ModelError
from ..expr.core import symbols_of
from ..expr.shown import quoted, shown
from .checks import check_keys, check_names
from .description import DescribedEntry
from .mechanism import STATE_RATE, FirstOrderState
from .names import nearest
from .printed_names import take_latex
from .requirements import Requirements
from .sympy_face import name_of
from .values import Reader


def declare_contacts(reader: Reader, entries: list[DescribedEntry]) -> None:
    """Take the polar angles of all contact points of cams into the namespace."""
    for entry in entries:
        kind, shape = entry.values.get("type"), entry.values.get("shape")
        found = kind == "cam_contact" and "contour" in entry.values and shape in ("roller", "flat_face")
        if found and isinstance(entry.name, str):
            given = entry.values.get("coordinate")
            name = f"{entry.name}_contact" if given is None else name_of(given)
            path = entry.path if given is None else f"{entry.path}.coordinate"
            reader.names.declare("coordinate", name, path)
            reader.contacts[entry.path] = str(name)
            take_latex(reader, f"{entry.path}.latex", name, entry.values.get("latex", ""))


def check_turns(constraints: Sequence[Constraint], requirements: Requirements) -> None:
    """Note periodic profiles that jump where a turn ends, as far as the values of parameters tell."""
    for constraint in constraints:
        for own in fields(constraint):
            profile = getattr(constraint, own.name)
            turn = profile.over_a_turn() if isinstance(profile, Profile) else None
            if turn is None:
                continue
            laws, angle = turn
            where = " at the declared values" if symbols_of(laws) - {angle} else ""
            try:
                requirements.judge(f"constraints.{constraint.name}.{own.name}", TURN, laws, (), [angle], where)
            except ModelError:  # native code without a twin in Python
                continue


def own_states(
    reader: Reader, entries: list[DescribedEntry]
) -> tuple[tuple[FirstOrderState, ...], dict[str, tuple[str, str]]]:
    """Take in the states of force elements, which begin at 0: the states, and what the symbols of their rates are."""
    states: list[FirstOrderState] = []
    rates: dict[str, tuple[str, str]] = {}
    for entry in entries:
        kind: Any = entry.values.get("type")
        known = isinstance(kind, str) and kind in FORCES and isinstance(entry.name, str)
        for k, (suffix, unit) in enumerate(FORCES[kind].states(entry.values).items() if known else ()):
            name = f"{entry.name}_{suffix}"
            if reader.names.declare("state", name, entry.path):
                rate = f"rate of {name}"
                rates[rate] = (f"{STATE_RATE}{k}", str(entry.name))
                states.append(FirstOrderState(name, reader.graph.symbol(rate), unit, f"state of {entry.name}"))
    return tuple(states), rates


def _keys_of_law(found: ElementType) -> set[str]:
    """The keys of a type that belong to its law: those that follow the key ``law``, and that key."""
    keys = list(found.keys)
    return set(keys[keys.index("law") :])


def _type_of(e: Entry, what: str, types: Types) -> ElementType | None:
    """The type, if the entry has one and says in one way what it acts on; its keys are checked."""
    if e.at_fault():
        return None
    given = e.values.get("type")
    if not isinstance(given, str) or given not in types:
        message = "is missing" if given is None else f"no {what} of type {quoted(given)}"
        e.fault("type", message, nearest(shown(given), types, "types"), "EG-CHOICE")
        return None
    found = types[given]
    if _misunderstood(e, found):
        return None
    e.found, e.fields = found, found.fields(what, types)
    if isinstance(found.keys.get("law"), Law) and not e.values.keys() & _keys_of_law(found):
        e.fault("", "has no law", "give law: {stiffness: ...} and what else the law has", "EG-MISSING")
        return None
    check_keys(e.path, e.values, e.fields, e.reader.faults)
    present = [key for key in found.one_of if key in e.values]
    if found.one_of and len(present) != 1:
        message = f"{' or '.join(found.one_of)} is missing"
        if present:
            message = f"{'both ' * (len(present) == 2)}{', '.join(present[:-1])} and {present[-1]} are given"
        e.fault("", message, f"give one of {', '.join(found.one_of)}")
        return None
    return found


def _misunderstood(e: Entry, found: ElementType) -> bool:
    """Note a joint where a marker is asked for, with what people who give one want."""
    if not found.remedies:
        return False
    names = {name for joint in e.reader.joints for name in (joint.entry.name, *joint.coordinates)}
    for key, remedy in found.remedies.items():
        given = "joint" if "joint" in e.values and "joint" not in found.keys else key
        named = e.values.get(given)
        if given == "joint" or (isinstance(named, str) and named in names and named not in e.reader.markers):
            e.fault(given, f"a {found.name} acts at a marker, and {named!r} is not a marker", remedy, "EG-TYPE")
            return True
    return False


def build_elements(reader: Reader, what: str, entries: list[DescribedEntry], types: Types) -> tuple[Any, ...]:
    """Elements of all entries without faults; the faults are noted."""
    usable = check_names(entries, what, reader.faults)
    made = [_build(Entry(reader, str(e.name), e.path, e.values), what, types) for e in usable]
    return tuple(element for element in made if element is not None)


def _build(e: Entry, what: str, types: Types) -> Any:
    found = _type_of(e, what, types)
    element = None if found is None or found.read is None else found.read(e)
    return None if e.at_fault() else element
