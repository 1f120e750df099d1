"""Stage describe, forces: entries of the forces section -> force elements (geometry times law)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ..forces import (
    Actuator,
    BodyTorque,
    Damper,
    Force,
    JointCoordinate,
    Line,
    Path,
    PointForce,
    Spring,
    Turn,
)
from ..graph.core import Expr
from ..graph.vectors import Vec3
from .build_joints import Declared
from .checks import check_keys, check_names
from .description import Entry
from .fields import FORCE, ONE_OF, Field, force_fields
from .names import nearest
from .reading import Reader
from .sympy_face import name_of


def build_forces(reader: Reader, entries: list[Entry], joints: Sequence[Declared]) -> tuple[Force, ...]:
    """Force elements of all entries without faults; the faults are noted."""
    usable = check_names(entries, "force", reader.faults)
    made = [_Element(reader, entry, joints).build() for entry in usable]
    return tuple(force for force in made if force is not None)


class _Element:
    """One entry of the section on its way to a force element."""

    def __init__(self, reader: Reader, entry: Entry, joints: Sequence[Declared]) -> None:
        self.reader, self.entry, self.joints = reader, entry, joints
        self.values = entry.values

    def build(self) -> Force | None:
        faults, path = self.reader.faults, self.entry.path
        if faults.under(path):
            return None
        given = self.values.get("type")
        if not isinstance(given, str) or given not in FORCE:
            message = "is missing" if given is None else f"no force of type {given!r}"
            faults.add(f"{path}.type", message, nearest(str(given), FORCE, "types"))
            return None
        self.fields = force_fields(given)
        check_keys(path, self.values, self.fields, faults)
        present = [key for key in ONE_OF.get(given, ()) if key in self.values]
        if given in ONE_OF and len(present) != 1:
            message = "says twice what it acts on" if present else "does not say what it acts on"
            faults.add(path, message, f"give {' or '.join(ONE_OF[given])}")
            return None
        result = BUILDERS[given](self)
        return None if faults.under(path) else result

    # -- parts; each is None or a stand-in when it is at fault ----------------------------------------------------
    def law(self, key: str) -> Expr:
        field = self.fields[key]
        value = self.values.get(key, field.default)
        if value is None and key not in self.values:
            return self.reader.stand_in  # missing, noted already
        return self.reader.expression(f"{self.entry.path}.{key}", value, field.level)

    def vector(self, key: str) -> Vec3:
        if key not in self.values:
            return (self.reader.stand_in,) * 3
        return self.reader.vector(f"{self.entry.path}.{key}", self.values[key], self.fields[key].level)

    def choice(self, key: str) -> str:
        field: Field = self.fields[key]
        if key not in self.values:
            return str(field.default)
        return self.reader.choice(f"{self.entry.path}.{key}", self.values[key], field)

    def line(self) -> Path | None:
        if "between" not in self.values:
            return None
        pair = self.reader.pair(f"{self.entry.path}.between", self.values["between"])
        return None if pair is None else Line(*pair)

    def rotation(self) -> Path | None:
        """A relative angle: of a joint, or between two markers."""
        if "joint" in self.values:
            return self.coordinate(angle=True)
        pair = self.reader.pair(f"{self.entry.path}.between", self.values["between"])
        return None if pair is None else Turn(*pair)

    def joint_or_line(self) -> Path | None:
        return self.coordinate() if "joint" in self.values else self.line()

    def coordinate(self, angle: bool = False) -> Path | None:
        """The coordinate meant by ``joint``: of a joint of one degree, or named itself."""
        path, faults = f"{self.entry.path}.joint", self.reader.faults
        if "joint" not in self.values:
            return None
        given = name_of(self.values["joint"])
        own = next((j for j in self.joints if j.entry.name == given), None)
        home = next((j for j in self.joints if given in j.coordinates), None)
        if own is not None and home is not None and own is not home:
            faults.add(path, f"{given!r} is a joint, and a coordinate of {home.entry.name!r}", "rename one of them")
            return None
        if own is not None and home is None and len(own.coordinates) != 1:
            names = ", ".join(own.coordinates) or "none"
            faults.add(path, f"joint {given!r} has {len(own.coordinates)} coordinates", f"name one of them: {names}")
            return None
        joint = home or own
        if joint is None:
            known = [j.entry.name for j in self.joints]
            known += [c for j in self.joints for c in j.coordinates if c not in known]
            if self.reader.faults.under(f"joints.{given}"):
                return None  # the joint itself is at fault, which is told already
            faults.add(path, f"no joint {given!r}", nearest(str(given), known, "joints and coordinates"))
            return None
        name = str(given) if home is not None else joint.coordinates[0]
        kind = joint.joint.coordinates[joint.coordinates.index(name)].kind
        if kind == "parameter":
            remedy = "give the torque as a vector on the body: body: <body>, value: [x, y, z]"
            faults.add(path, f"{name!r} is an Euler parameter, which takes no torque", remedy)
            return None
        if angle and kind != "angle":
            faults.add(path, f"the coordinate {name!r} is a {kind}", "a torsional element acts on an angle")
            return None
        return JointCoordinate(name)


def _point_force(e: _Element) -> Force | None:
    value, axes = e.vector("value"), e.choice("axes")
    marker = e.reader.marker(f"{e.entry.path}.marker", e.values["marker"]) if "marker" in e.values else None
    return None if marker is None else PointForce(e.entry.name, marker, value, axes)


def _torque(e: _Element) -> Force | None:
    if "joint" in e.values:
        if "axes" in e.values:
            e.reader.faults.add(f"{e.entry.path}.axes", "a torque on a joint has no axes", "leave it out")
        path, value = e.coordinate(), e.law("value")
        return None if path is None else Actuator(e.entry.name, path, value)
    marker = e.reader.marker(f"{e.entry.path}.body", e.values["body"])
    vector, axes = e.vector("value"), e.choice("axes")
    return None if marker is None else BodyTorque(e.entry.name, marker, vector, axes)


def _spring(path: Callable[[_Element], Path | None], rest: str) -> Callable[[_Element], Force | None]:
    def build(e: _Element) -> Force | None:
        where, stiffness, length = path(e), e.law("stiffness"), e.law(rest)
        return None if where is None else Spring(e.entry.name, where, stiffness, length)

    return build


def _damper(path: Callable[[_Element], Path | None], key: str) -> Callable[[_Element], Force | None]:
    def build(e: _Element) -> Force | None:
        where, damping = path(e), e.law(key)
        return None if where is None else Damper(e.entry.name, where, damping)

    return build


def _actuator(e: _Element) -> Force | None:
    where, value = e.joint_or_line(), e.law("value")
    return None if where is None else Actuator(e.entry.name, where, value)


#: How each type of :data:`~eomgen.describe.fields.FORCE` is made.
BUILDERS: dict[str, Callable[[_Element], Any]] = {
    "force": _point_force,
    "torque": _torque,
    "spring": _spring(_Element.line, "length"),
    "damper": _damper(_Element.line, "damping"),
    "torsional_spring": _spring(_Element.rotation, "angle"),
    "torsional_damper": _damper(_Element.rotation, "damping"),
    "friction": _damper(_Element.coordinate, "viscous"),
    "actuator": _actuator,
}
