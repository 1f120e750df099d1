"""Stage describe, one entry of the constraints section: its keys -> coordinates, markers and dimensions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ..frames import Marker
from ..graph.core import Expr
from .build_cam_points import Contacts
from .build_joints import Declared
from .coordinates import Found, find_coordinate
from .description import Entry, items
from .fields import Fields
from .mechanism import JointSpec
from .reading import Reader


@dataclass
class Surroundings:
    """What constraints refer to."""

    reader: Reader
    declared: Sequence[Declared]
    joints: Sequence[JointSpec]
    contacts: Contacts
    bodies: int

    def carrier(self, coordinate: Found) -> int | None:
        """The body from which a coordinate is measured, bodies that are welded together counting as one."""
        spec = next((j for j in self.joints if j.name == coordinate.joint), None)
        return None if spec is None else self.rigid(spec.predecessor.body)

    def carried(self, coordinate: Found) -> int | None:
        """The body that a coordinate moves."""
        spec = next((j for j in self.joints if j.name == coordinate.joint), None)
        return None if spec is None else self.rigid(spec.successor.body)

    def rigid(self, body: int) -> int:
        """The least index of the bodies welded to one."""
        group = {body}
        while True:
            more = {
                end
                for j in self.joints
                if not j.coordinates
                for end, other in (
                    (j.predecessor.body, j.successor.body),
                    (j.successor.body, j.predecessor.body),
                )
                if other in group
            }
            if more <= group:
                return min(group)
            group |= more


_A = {"length": "a length", "angle": "an angle"}


class Element:
    """One entry on its way to a constraint; parts are None or a stand-in where they are at fault."""

    def __init__(self, around: Surroundings, entry: Entry) -> None:
        self.around, self.entry = around, entry
        self.reader, self.faults = around.reader, around.reader.faults
        self.name, self.path, self.values = str(entry.name), entry.path, entry.values
        self.fields: Fields = {}

    def law(self, key: str, local: dict[str, Expr] | None = None) -> Expr:
        """A scalar, the default if it is not given."""
        field = self.fields[key]
        return self.reader.expression(f"{self.path}.{key}", self.values.get(key, field.default), field.level, local)

    def positive(self, key: str) -> Expr:
        """A size; a number that is not greater than 0 is a fault."""
        return self.size(f"{self.path}.{key}", self.values.get(key))

    def size(self, path: str, value: Any) -> Expr:
        """A size, from a value."""
        expression = self.reader.expression(path, value)
        if expression.value is not None and expression.value <= 0:
            self.faults.add(path, f"is {expression.value:g}", "give a size greater than 0")
        return expression

    def sizes(self, key: str) -> tuple[Expr, Expr] | None:
        """Two sizes."""
        parts = items(self.values[key])
        if parts is None or len(parts) != 2:
            self.reader.wrong(f"{self.path}.{key}", self.values[key], "two")
            return None
        a, b = (self.size(f"{self.path}.{key}[{k}]", part) for k, part in enumerate(parts))
        return a, b

    def flag(self, key: str) -> bool:
        """True or false."""
        value = self.values.get(key, self.fields[key].default)
        if not isinstance(value, bool):
            self.reader.wrong(f"{self.path}.{key}", value, "flag")
            return False
        return value

    def choice(self, key: str) -> str:
        """One of the words of a key."""
        field = self.fields[key]
        if key not in self.values:
            return str(field.default)
        return self.reader.choice(f"{self.path}.{key}", self.values[key], field)

    def marker(self, key: str) -> Marker | None:
        """A marker."""
        return self.reader.marker(f"{self.path}.{key}", self.values.get(key, self.fields[key].default))

    def refuse(self, key: str, why: str) -> None:
        """Note a key that has no meaning beside the others."""
        if key in self.values:
            self.faults.add(f"{self.path}.{key}", why, "leave it out")

    def coordinate(self, key: str, kind: str = "") -> Found | None:
        """The coordinate that a key names, of the given kind."""
        return self.find(f"{self.path}.{key}", self.values[key], kind)

    def find(self, path: str, value: Any, kind: str = "") -> Found | None:
        """A coordinate from the name of its joint, or its own."""
        found = find_coordinate(self.reader, self.around.declared, path, value)
        if found is not None and kind and found.joint is not None and found.kind != kind:
            self.faults.add(path, f"the coordinate {found.name!r} is {_A[found.kind]}", f"give one that is {_A[kind]}")
            return None
        return found

    def pair(self, key: str, kind: str) -> tuple[Found, Found] | None:
        """Two different coordinates, measured from one body."""
        parts = items(self.values[key])
        path = f"{self.path}.{key}"
        if parts is None or len(parts) != 2:
            self.reader.wrong(path, self.values[key], "joints")
            return None
        a, b = (self.find(f"{path}[{k}]", part, kind) for k, part in enumerate(parts))
        if a is None or b is None:
            return None
        if a.name == b.name:
            self.faults.add(path, f"{a.name!r} is named twice", "name two coordinates")
            return None
        self.same_carrier(path, a, b)
        return a, b

    def same_carrier(self, path: str, a: Found, b: Found) -> None:
        """Note two coordinates that are measured from different bodies."""
        first, second = self.around.carrier(a), self.around.carrier(b)
        if first is None or second is None or first == second:
            return
        message = f"{a.name!r} and {b.name!r} are not measured from the same body"
        remedy = "both joints must have the part that carries the two axes as predecessor; for a carrier that turns "
        self.faults.add(path, message, remedy + "use planetary, or a coupling")

    def symbol(self, found: Found) -> Expr:
        """The symbol of a coordinate."""
        return self.reader.graph.symbol(found.name)
