"""Stage describe, visits: a description of texts and numbers -> a copy in which scalars, markers and names are changed.

The table of fields says what each key holds, so a change states only what it does to a scalar, a marker, a coordinate.
What does not have the form of its key stays as it is; the check of the model tells it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from ..base.names import place_of_marker
from .description import DescribedEntry, Description
from .fields import EQUATIONS, LAGRANGIAN, MARKER, Field, Fields, fields_of


class Slot(NamedTuple):
    """Where a scalar stands: section, type of the entry, key, place within it, the entry, and the field of the key."""

    section: str
    type: str
    key: str
    place: tuple[Any, ...] = ()
    entry: DescribedEntry | None = None
    field: Field | None = None

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

    def latex(self, text: Any) -> Any:
        """How a name is printed."""
        return text

    def placement(self, body: str, placed: Mapping[str, Any], slot: Slot) -> dict[str, Any]:
        """``at`` and ``rpy`` in a body."""
        return {key: value if key == "axes" else self.vector(value, slot.named(key)) for key, value in placed.items()}

    def marker(self, reference: Any, slot: Slot) -> Any:
        """A reference to a marker: a text, or a mapping of body, at, rpy."""
        if isinstance(reference, str):
            body, dot, name = reference.partition(".")
            return self.body(body) + dot + name
        if not isinstance(reference, Mapping) or not isinstance(reference.get("body"), str):
            return reference
        placed = {key: value for key, value in reference.items() if key != "body"}
        return {"body": self.body(reference["body"]), **self.placement(reference["body"], placed, slot)}

    def vector(self, value: Any, slot: Slot) -> Any:
        """A list of scalars, of any depth."""
        if isinstance(value, list | tuple):
            return [self.vector(part, slot.at(k)) for k, part in enumerate(value)]
        return self.scalar(value, slot)


def visit(description: Description, visitor: Visitor) -> Description:
    """The description as a visitor changes it."""
    made = replace(description, values=dict(description.values), notes=list(description.notes))
    made.sections = {
        section: [visit_entry(section, entry, visitor) for entry in entries]
        for section, entries in description.sections.items()
    }
    values = made.values
    if "gravity" in values:
        values["gravity"] = visitor.vector(values["gravity"], Slot("", "", "gravity"))
    for key in ("initial", "guess"):
        if isinstance(values.get(key), Mapping):
            values[key] = {
                started(name, visitor.coordinate, visitor, slot): visitor.scalar(value, slot)
                for name, value, slot in ((n, x, Slot("", "", key, (n,))) for n, x in values[key].items())
            }
    if isinstance(values.get("independent"), list | tuple):
        values["independent"] = [_named(name, visitor.coordinate) for name in values["independent"]]
    for key, fields in (("lagrangian", LAGRANGIAN), ("equations", EQUATIONS)):
        if isinstance(values.get(key), Mapping):
            values[key] = _values(values[key], fields, Slot(key, "", ""), visitor)
    return made


def started(name: Any, change: Callable[[str], str], visitor: Visitor, slot: Slot) -> Any:
    """The name of an initial value or a guess: a place of a marker, or what else changes by ``change``."""
    if place := place_of_marker(name):
        return f"{place[0]}({visitor.marker(place[1], slot)})"
    return _named(name, change)


def _named(name: Any, change: Callable[[str], str]) -> Any:
    return change(name) if isinstance(name, str) else name


def copied(description: Description) -> Description:
    """A copy whose entries can be changed without changing the original's."""
    return visit(description, Visitor())


def visit_entry(section: str, entry: DescribedEntry, visitor: Visitor) -> DescribedEntry:
    """An entry of a section as a visitor changes it."""
    slot = Slot(section, str(entry.values.get("type", "")), "", (), entry)
    values = _values(entry.values, fields_of(section, entry.values), slot, visitor)
    return replace(entry, values=values)


def _values(values: Mapping[str, Any], fields: Fields, slot: Slot, visitor: Visitor) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for key, value in values.items():
        field = fields.get(key)
        place = slot._replace(key=key, field=field)
        result[key] = value if value is None or field is None else _value(value, field.kind, place, visitor)
    return result


_SCALARS = ("expression", "expressions", "vector", "value", "two", "radii", "shape", "matrix", "matrix6")


def _value(value: Any, kind: str, slot: Slot, visitor: Visitor) -> Any:
    listed = isinstance(value, list | tuple)
    if kind in _SCALARS:
        return visitor.vector(value, slot)
    if kind == "marker":
        return visitor.marker(value, slot)
    if kind == "pair":
        return [visitor.marker(part, slot) for part in value] if listed else value
    if kind == "joint" or (kind == "name" and slot.key == "coordinate"):
        return _named(value, visitor.coordinate)
    if kind == "joints" or (kind == "names" and slot.key in ("coordinates", "velocities")):
        names = [value] if isinstance(value, str) else value if listed else None
        return value if names is None else [_named(part, visitor.coordinate) for part in names]
    if kind == "some_names" and (listed or isinstance(value, str)):
        ending = "_closed" if slot.key == "releases" else ""  # constraints go by the names of their states
        names = value if listed else [value]
        return [_named(f"{part}{ending}", visitor.coordinate).removesuffix(ending) for part in names]
    if kind in ("factors", "rates", "forces") and isinstance(value, Mapping):
        return {_named(name, visitor.coordinate): visitor.scalar(part, slot.at(name)) for name, part in value.items()}
    if kind in ("wheels", "inertia") and isinstance(value, Mapping):
        return {name: visitor.scalar(part, slot.at(name)) for name, part in value.items()}
    if kind in ("inertia", "forces"):
        return visitor.vector(value, slot)
    if kind in ("latex", "latexes"):
        if isinstance(value, Mapping):
            return {_named(name, visitor.coordinate): visitor.latex(part) for name, part in value.items()}
        return [visitor.latex(part) for part in value] if listed else visitor.latex(value)
    if kind == "body":
        return _named(value, visitor.body)
    if kind == "shapes":
        return [_shape(part, slot, visitor) for part in ([value] if isinstance(value, Mapping) else value or ())]
    if kind == "via":
        return [_via(part, slot, visitor) for part in value] if listed else value
    if kind in ("markers", "solids", "points", "about", "display") and slot.entry is not None:
        return _part(value, kind, slot, slot.entry.name, visitor)
    return value


def _shape(part: Any, slot: Slot, visitor: Visitor) -> Any:
    if not isinstance(part, Mapping):
        return part
    made = {k: v if k == "shape" else visitor.vector(v, slot.named(k)) for k, v in part.items() if k != "on"}
    on = part.get("on")
    if isinstance(on, list | tuple):
        return {**made, "on": [visitor.marker(one, slot) for one in on]}
    return made if on is None else {**made, "on": visitor.marker(on, slot)}


def _via(part: Any, slot: Slot, visitor: Visitor) -> Any:
    if isinstance(part, Mapping) and "around" in part:
        made = {**part, "around": visitor.marker(part["around"], slot)}
        sizes = [key for key in ("radius", "friction", "smoothing") if key in part]
        return made | {key: visitor.scalar(part[key], slot.named(key)) for key in sizes}
    return visitor.marker(part, slot)


#: Keys of solids, points and shapes that are words, not scalars.
_WORDS = ("type", "axis", "subtract", "file", "shape")


def _part(value: Any, kind: str, slot: Slot, body: str, visitor: Visitor) -> Any:
    if kind == "about":
        return value if isinstance(value, str) else visitor.vector(value, slot)
    if kind == "markers":
        pairs = value.items() if isinstance(value, Mapping) else value if isinstance(value, list) else ()
        try:
            return {name: _placed(body, placed, slot, visitor) for name, placed in pairs}
        except (TypeError, ValueError):  # no pairs, or names that are no names
            return value
    if not isinstance(value, list | tuple):
        return value
    result: list[Any] = []
    for part in value:
        if not isinstance(part, Mapping):
            result.append(part)
            continue
        words = {k: v for k, v in part.items() if k in _WORDS}
        placed = {k: v for k, v in part.items() if k in MARKER}
        own = {k: visitor.vector(v, slot.named(k)) for k, v in part.items() if k not in words and k not in placed}
        result.append({**words, **own, **visitor.placement(body, placed, slot)})
    return result


def _placed(body: str, placed: Any, slot: Slot, visitor: Visitor) -> Any:
    """The place of a named marker: a mapping, or its position alone."""
    if isinstance(placed, Mapping):
        return visitor.placement(body, placed, slot)
    return visitor.placement(body, {"at": placed}, slot)
