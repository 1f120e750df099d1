"""Checks without kinematics: keys by the table of fields, names, connection to ground."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from typing import Any

from ..base.texts import closest
from ..elements.constraints.constraint import IN_PLACE_OF_JOINTS, SWITCHING
from ..elements.element_type import Law
from ..elements.frames import GROUND
from ..elements.kinds import Fields
from .description import DescribedEntry, Faults
from .mechanism import Body, JointSpec
from .names import fault_of_name, nearest


def check_keys(
    path: str, values: Mapping[str, Any], fields: Fields, faults: Faults, of: str = "", others: Container[str] = ()
) -> None:
    """Note keys that a table does not know, those of ``others`` as what ``of`` has not, and required ones not given."""
    laws = {name: field.flat for name, field in fields.items() if isinstance(field, Law)}
    flat = [key for keys in laws.values() for key in keys]
    for key in values:
        if key in flat and key not in fields:
            home = next(name for name, keys in laws.items() if key in keys)
            message, remedy = f"belongs to {home}, and there is none", f"leave it out, or give {home}"
            faults.add(f"{path}.{key}", message, remedy, "EG-CONFLICT")
        elif key not in fields:
            message = f"{of} has no {key!r}" if key in others else "unknown key"
            remedy = IN_PLACE_OF_JOINTS if key in SWITCHING and key in others else unknown_key(key, fields, flat)
            faults.add(f"{path}.{key}", message, remedy, "EG-NAME-UNKNOWN")
    for key, field in fields.items():
        meant = (closest(one, fields) == [key] for one in values if one not in fields)
        if field.required and key not in values and not any(meant):
            faults.missing(f"{path}.{key}", f"give {field.says}")


def unknown_key(key: object, fields: Iterable[str], more: Iterable[str] = ()) -> str:
    """The remedy for a key that a table does not know; one of ``more`` may be what was meant."""
    remedy = nearest(str(key), fields, "allowed", more)
    if fault_of_name(key):  # the tail of a text that a comma cut
        remedy += "; inside { } a text with a comma needs quotes"
    return remedy


def check_names(entries: Sequence[DescribedEntry], what: str, faults: Faults) -> list[DescribedEntry]:
    """Note names that are no identifiers or used twice; returns the entries whose names can be used."""
    usable: list[DescribedEntry] = []
    seen: set[Any] = set()
    for entry in entries:
        fault = fault_of_name(entry.name)
        if fault:
            faults.add(entry.path, *fault, "EG-NAME-FORM")
            continue
        if entry.name in seen:
            message = f"the name is given to two {'bodies' if what == 'body' else f'{what}s'}"
            faults.add(entry.path, message, "rename one", "EG-NAME-TAKEN")
        else:
            usable.append(entry)
        seen.add(entry.name)
    return usable


#: Message and remedy for a body that only pure constraints (rods and the like) connect to ground.
UNHELD = (
    "only constraints without coordinates connect it to ground",
    "add a joint that has coordinates; if the body otherwise moves freely, use a joint of type free",
)


def check_connected(bodies: Sequence[Body], joints: Sequence[JointSpec], faults: Faults) -> None:
    """Note bodies that no chain of joints connects to ground."""
    reached = _reached([joint for joint in joints if joint.joint.role != "loop"])
    touched = _reached(joints)
    for k, body in enumerate(bodies):
        if k not in touched:
            remedy = "add a joint; for a body that moves freely use a joint of type free"
            faults.add(f"bodies.{body.name}", "no chain of joints connects it to ground", remedy, "EG-TOPOLOGY")
        elif k not in reached:
            faults.add(f"bodies.{body.name}", *UNHELD, code="EG-TOPOLOGY")


def _reached(joints: Sequence[JointSpec]) -> set[int]:
    """Bodies that these joints connect to ground."""
    neighbours: dict[int, list[int]] = {}
    for joint in joints:
        a, b = joint.predecessor.body, joint.successor.body
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    reached, waiting = {GROUND}, [GROUND]
    while waiting:
        for near in neighbours.get(waiting.pop(), ()):
            if near not in reached:
                reached.add(near)
                waiting.append(near)
    return reached
