"""A description of texts and numbers -> a copy in which scalars, markers and names are changed.

The kind of each key says what it holds (:meth:`~eomgen.elements.kinds.Field.map`), so a change states only what it does
to a scalar, a marker, a coordinate.  What does not have the form of its key stays as it is; the check of the model
tells it.  Texts are changed by their tokens, never evaluated as code.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from ..base.texts import place_of_marker
from ..base.texts import undotted as undotted_name
from ..elements.kinds import Field, Fields
from .description import DescribedEntry, Description
from .fields import EQUATIONS, LAGRANGIAN, fields_of
from .quantities import IN_TEXT, Named

_TOKEN = re.compile(
    r"(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    rf"|(?P<quantity>{IN_TEXT})"
    r"|(?P<name>[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)"
)
_ATOM = re.compile(r"[A-Za-z0-9_.]+\Z")


def rewritten(value: Any, name: Callable[[str], str], quantity: Callable[[Named], str] = str) -> Any:
    """A value with every name and quantity (``vx(rod.tip)``, ``force(k1)``) replaced; numbers stay."""

    def one(result: re.Match[str]) -> str:
        if result["number"] is not None:
            return result[0]
        if result["name"] is not None:
            return name(result[0])
        read = Named.parse(result[0])
        return result[0] if read is None else quantity(read)  # a fault is told where the text is read

    return _TOKEN.sub(one, value) if isinstance(value, str) else value


def in_brackets(text: str) -> str:
    """A text so that it can stand in the place of a name."""
    return text if _ATOM.match(text) else f"({text})"


def names_of(value: Any) -> set[str]:
    """Names in a text, markers aside."""
    return {result[0] for result in _TOKEN.finditer(value) if result["name"]} if isinstance(value, str) else set()


class Visitor:
    """What a change does to each kind of value; nothing unless a method is overridden.

    ``entry`` is the entry of which a value is changed, ``field`` its key of the name ``key``.
    """

    entry: DescribedEntry | None = None
    key = ""
    field: Field | None = None

    def scalar(self, value: Any) -> Any:
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

    def placement(self, body: str, placed: Mapping[str, Any]) -> dict[str, Any]:
        """``at`` and ``rpy`` in a body."""
        made = {key: x if key == "axes" else self.vector(x) for key, x in placed.items()}
        return made | ({"on": self.placement(body, placed["on"])} if isinstance(placed.get("on"), Mapping) else {})

    def marker(self, reference: Any) -> Any:
        """A reference to a marker: a text, or a mapping of body, at, rpy."""
        if isinstance(reference, str):
            body, dot, name = reference.partition(".")
            return self.body(body) + dot + name
        if not isinstance(reference, Mapping) or not isinstance(reference.get("body"), str):
            return reference
        placed = {key: value for key, value in reference.items() if key != "body"}
        return {"body": self.body(reference["body"]), **self.placement(reference["body"], placed)}

    def vector(self, value: Any) -> Any:
        """Lists and mappings of scalars, of any depth."""
        if isinstance(value, Mapping):
            return {key: self.vector(part) for key, part in value.items()}
        return [self.vector(part) for part in value] if isinstance(value, list | tuple) else self.scalar(value)


def started(name: Any, change: Callable[[str], str], visitor: Visitor) -> Any:
    """The name of an initial value or a guess: a place of a marker, or what else changes by ``change``."""
    if place := place_of_marker(name):
        return f"{place[0]}({visitor.marker(place[1])})"
    return _named(name, change)


def _named(name: Any, change: Callable[[str], str]) -> Any:
    return change(name) if isinstance(name, str) else name


def visit_entry(section: str, entry: DescribedEntry, visitor: Visitor) -> DescribedEntry:
    """An entry of a section as a visitor changes it."""
    visitor.entry = entry
    values = _values(entry.values, fields_of(section, entry.values), visitor)
    visitor.entry = None
    return replace(entry, values=values)


def _values(values: Mapping[str, Any], fields: Fields, visitor: Visitor) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for key, value in values.items():
        visitor.key, visitor.field = key, fields.get(key)
        result[key] = value if value is None or visitor.field is None else visitor.field.map(value, visitor)
    visitor.field = None
    return result


class Undotted(Visitor):
    """Names with a dot after an instance as the model has them; ``instances`` has the prefix of each."""

    def __init__(self, instances: Mapping[str, str]) -> None:
        self.instances = instances

    def coordinate(self, name: str) -> str:
        """A name whose first part is an instance: its prefix and the rest, instances within instances too."""
        return undotted_name(name, self.instances)

    body = coordinate

    def scalar(self, value: Any) -> Any:
        if not isinstance(value, str) or "." not in value:
            return value
        return rewritten(value, self.coordinate, lambda quantity: str(quantity.renamed(self.coordinate)))

    def marker(self, reference: Any) -> Any:
        return self.coordinate(reference) if isinstance(reference, str) else super().marker(reference)


def undotted(description: Description) -> Description:
    """The description with every ``leg1.hip`` written ``leg1_hip``; the same one where it has no instances."""
    if not description.instances:
        return description
    visitor = Undotted(description.instances)
    made = replace(description, values=dict(description.values), notes=list(description.notes))
    made.sections = {
        section: [visit_entry(section, entry, visitor) for entry in entries]
        for section, entries in description.sections.items()
    }
    made.bindings = [one._replace(text=visitor.scalar(one.text)) for one in description.bindings]
    values = made.values
    if "gravity" in values:
        values["gravity"] = visitor.vector(values["gravity"])
    for key in ("initial", "guess"):
        if isinstance(values.get(key), Mapping):
            values[key] = {started(n, visitor.coordinate, visitor): visitor.scalar(x) for n, x in values[key].items()}
    if isinstance(values.get("independent"), list | tuple):
        values["independent"] = [_named(name, visitor.coordinate) for name in values["independent"]]
    for key, fields in (("lagrangian", LAGRANGIAN), ("equations", EQUATIONS)):
        if isinstance(values.get(key), Mapping):
            values[key] = _values(values[key], fields, visitor)
    return made
