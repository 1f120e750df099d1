"""Stage verification, visits: a plain description -> a copy in which a visitor has changed scalars, markers and names.

The table of fields says what each key holds, so a change states only what it does to a scalar, a marker, a coordinate.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from ...describe.description import GROUND_NAME, DescribedEntry, Description
from ...describe.fields import EQUATIONS, LAGRANGIAN, Fields, fields_of


class Slot(NamedTuple):
    """Where a scalar stands: section, type of the entry, key, place within it, and the entry itself."""

    section: str
    type: str
    key: str
    place: tuple[Any, ...] = ()
    entry: DescribedEntry | None = None

    def at(self, *index: Any) -> Slot:
        """A place within this one."""
        return self._replace(place=(*self.place, *index))

    def named(self, key: str) -> Slot:
        """A key within this place, for placements, solids and points."""
        return self._replace(key=key, place=())


class Visitor:
    """What a change does to each kind of value; nothing unless a method is overridden."""

    def scalar(self, value: Any, slot: Slot) -> Any:
        """A number or an expression."""
        return value

    def body(self, name: str) -> str:
        """The name of a body."""
        return name

    def coordinate(self, name: str) -> str:
        """The name of a joint or coordinate that is referred to."""
        return name

    def placement(self, body: str, placed: Mapping[str, Any], slot: Slot) -> dict[str, Any]:
        """``at`` and ``rpy`` in a body."""
        return {key: self.vector(value, slot.named(key)) for key, value in placed.items()}

    def marker(self, reference: Any, slot: Slot) -> Any:
        """A reference to a marker: a text, or a mapping of body, at, rpy."""
        if isinstance(reference, str):
            body, dot, name = reference.partition(".")
            return self.body(body) + dot + name
        placed = {key: value for key, value in reference.items() if key != "body"}
        return {"body": self.body(reference["body"]), **self.placement(reference["body"], placed, slot)}

    def vector(self, value: Any, slot: Slot) -> Any:
        """A list of scalars, of any depth."""
        if isinstance(value, list | tuple):
            return [self.vector(part, slot.at(k)) for k, part in enumerate(value)]
        return self.scalar(value, slot)


def visit(description: Description, visitor: Visitor) -> Description:
    """The description as a visitor changes it."""
    made = Description(values=dict(description.values), notes=list(description.notes))
    for section, entries in description.sections.items():
        made.sections[section] = [_entry(section, entry, visitor) for entry in entries]
    values = made.values
    if "gravity" in values:
        values["gravity"] = visitor.vector(values["gravity"], Slot("", "", "gravity"))
    for key in ("initial", "guess"):
        if key in values:
            values[key] = {
                visitor.coordinate(name): visitor.scalar(value, Slot("", "", key, (name,)))
                for name, value in values[key].items()
            }
    if "independent" in values:
        values["independent"] = [visitor.coordinate(name) for name in values["independent"]]
    for key, fields in (("lagrangian", LAGRANGIAN), ("equations", EQUATIONS)):
        if values.get(key) is not None:
            values[key] = _values(values[key], fields, Slot(key, "", ""), visitor)
    return made


def copied(description: Description) -> Description:
    """A copy whose entries can be changed without changing the original's."""
    return visit(description, Visitor())


def _entry(section: str, entry: DescribedEntry, visitor: Visitor) -> DescribedEntry:
    slot = Slot(section, str(entry.values.get("type", "")), "", (), entry)
    values = _values(entry.values, fields_of(section, entry.values), slot, visitor)
    return DescribedEntry(entry.name, values, entry.path, entry.trusted, entry.folder)


def _values(values: Mapping[str, Any], fields: Fields, slot: Slot, visitor: Visitor) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for key, value in values.items():
        kind = fields[key].kind if key in fields else ""
        result[key] = value if value is None else _value(value, kind, slot._replace(key=key), visitor)
    return result


_SCALARS = ("expression", "expressions", "vector", "value", "two", "radii", "shape", "matrix", "matrix6")


def _value(value: Any, kind: str, slot: Slot, visitor: Visitor) -> Any:
    if kind in _SCALARS:
        return visitor.vector(value, slot)
    if kind == "marker":
        return visitor.marker(value, slot)
    if kind == "pair":
        return [visitor.marker(part, slot) for part in value]
    if kind == "joint" or (kind == "name" and slot.key == "coordinate"):
        return visitor.coordinate(value)
    if kind == "joints" or (kind == "names" and slot.key in ("coordinates", "velocities")):
        return [visitor.coordinate(part) for part in ([value] if isinstance(value, str) else value)]
    if kind in ("factors", "rates", "forces") and isinstance(value, Mapping):
        return {visitor.coordinate(name): visitor.scalar(part, slot.at(name)) for name, part in value.items()}
    if kind in ("wheels", "inertia") and isinstance(value, Mapping):
        return {name: visitor.scalar(part, slot.at(name)) for name, part in value.items()}
    if kind in ("inertia", "forces"):
        return visitor.vector(value, slot)
    if kind == "body":
        return visitor.body(value)
    if kind == "via":
        return [_via(part, slot, visitor) for part in value]
    if kind in ("markers", "solids", "points", "about") and slot.entry is not None:
        return _part(value, kind, slot, slot.entry.name, visitor)
    return value


def _via(part: Any, slot: Slot, visitor: Visitor) -> Any:
    if isinstance(part, Mapping) and "around" in part:
        radius = visitor.scalar(part["radius"], slot.named("radius"))
        return {**part, "around": visitor.marker(part["around"], slot), "radius": radius}
    return visitor.marker(part, slot)


def _part(value: Any, kind: str, slot: Slot, body: str, visitor: Visitor) -> Any:
    if kind == "about":
        return value if isinstance(value, str) else visitor.vector(value, slot)
    if kind == "markers":
        return {name: visitor.placement(body, placed, slot) for name, placed in value.items()}
    result = []
    for part in value:
        own = {k: v for k, v in part.items() if k not in ("at", "rpy", "type", "axis", "subtract", "file")}
        rest = {k: v for k, v in part.items() if k in ("type", "axis", "subtract", "file")}
        placed = {k: v for k, v in part.items() if k in ("at", "rpy")}
        own = {k: visitor.vector(v, slot.named(k)) for k, v in own.items()}
        result.append({**rest, **own, **visitor.placement(body, placed, slot)})
    return result


def bodies_of(description: Description) -> list[DescribedEntry]:
    """Entries of bodies, ground aside."""
    return [entry for entry in description.sections["bodies"] if entry.name != GROUND_NAME]
