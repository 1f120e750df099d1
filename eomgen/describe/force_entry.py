"""Stage describe, one entry of the forces section: its keys -> laws, vectors, markers and paths."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from ..forces import JointCoordinate, Line, Path, Route, Turn
from ..frames import Marker
from ..graph.core import Expr
from ..graph.evaluate import evaluate
from ..graph.shown import quoted, shown
from ..graph.substitute import symbols_of
from ..graph.vectors import Vec3
from .build_joints import Declared
from .build_paths import read_via
from .checks import check_keys
from .coordinates import find_coordinate
from .description import Entry
from .field import Field
from .force_fields import FORCE, ONE_OF, force_fields
from .mechanism import Body
from .names import nearest
from .reading import Reader


class Context(NamedTuple):
    """What force elements look up besides names: the bodies, and the declared values of parameters."""

    bodies: Sequence[Body]
    values: Mapping[str, float]


class ForceEntry:
    """One entry of the section on its way to a force element.

    Its methods read one key each and note what is wrong with it; they return None, or a stand-in, when it is at fault.
    """

    def __init__(self, reader: Reader, entry: Entry, joints: Sequence[Declared], context: Context) -> None:
        self.reader, self.entry, self.joints, self.context = reader, entry, joints, context
        self.name, self.values = entry.name, entry.values

    def known_type(self) -> str | None:
        """The type, if the entry has one and its keys are those of the type."""
        faults, path = self.reader.faults, self.entry.path
        if faults.under(path):
            return None
        given = self.values.get("type")
        if not isinstance(given, str) or given not in FORCE:
            message = "is missing" if given is None else f"no force of type {quoted(given)}"
            faults.add(f"{path}.type", message, nearest(shown(given), FORCE, "types"))
            return None
        if given == "force" and self._on_a_joint():
            return None
        self.fields = force_fields(given)
        check_keys(path, self.values, self.fields, faults)
        present = [key for key in ONE_OF.get(given, ()) if key in self.values]
        if given in ONE_OF and len(present) != 1:
            message = "says twice what it acts on" if present else "does not say what it acts on"
            faults.add(path, message, f"give {' or '.join(ONE_OF[given])}")
            return None
        return given

    def _on_a_joint(self) -> bool:
        """Note a force that names a joint instead of a point."""
        names = {name for joint in self.joints for name in (joint.entry.name, *joint.coordinates)}
        key = "joint" if "joint" in self.values else "marker"
        named = self.values.get(key)
        wrong = key == "joint" or (isinstance(named, str) and named in names and named not in self.reader.markers)
        if wrong:
            remedy = "along a joint's coordinate take torque or actuator, in N where it is a length and N m on an angle"
            self.fault(key, f"a force acts at a marker, and {named!r} is not one", remedy)
        return wrong

    def fault(self, key: str, message: str, remedy: str = "") -> None:
        """Note a fault of one key."""
        self.reader.faults.add(f"{self.entry.path}.{key}", message, remedy)

    # -- laws -----------------------------------------------------------------------------------------------------
    def law(self, key: str, local: Mapping[str, Expr] | None = None) -> Expr:
        """An expression, or the default of its key; ``local`` are names that only it knows."""
        field = self.fields[key]
        value = self.values.get(key, field.default)
        if value is None and key not in self.values:
            return self.reader.stand_in  # missing, noted already
        return self.reader.expression(f"{self.entry.path}.{key}", value, field.level, local, exclusive=True)

    def given(self, key: str) -> Expr | None:
        """An expression if the key is there."""
        return self.law(key) if key in self.values else None

    def positive(self, key: str) -> Expr:
        """An expression that must be greater than 0 at the declared values of parameters."""
        value = self.law(key)
        self.judge(key, value, lambda x: x > 0, "must be greater than 0")
        return value

    def judge(self, key: str, value: Expr, right: Callable[[float], bool], rule: str) -> None:
        """Note an expression whose number, as far as the declared values of parameters tell, breaks a rule."""
        if symbols_of([value]) <= self.context.values.keys():
            number = float(evaluate([value], self.context.values)[0])
            if not right(number):
                self.fault(key, f"is {number:g}", rule)

    def vector(self, key: str) -> Vec3:
        """Three expressions."""
        if key not in self.values:
            return (self.reader.stand_in,) * 3
        return self.reader.vector(f"{self.entry.path}.{key}", self.values[key], self.fields[key].level)

    def choice(self, key: str) -> str:
        """One of the words of a key."""
        field: Field = self.fields[key]
        if key not in self.values:
            return str(field.default)
        return self.reader.choice(f"{self.entry.path}.{key}", self.values[key], field)

    # -- geometry -------------------------------------------------------------------------------------------------
    def pair(self) -> tuple[Marker, Marker] | None:
        """The two markers of ``between``."""
        if "between" not in self.values:
            return None
        return self.reader.pair(f"{self.entry.path}.between", self.values["between"])

    def line(self) -> Path | None:
        """The line between two markers, or a path over what ``via`` lists."""
        pair = self.pair()
        via = read_via(self.reader, f"{self.entry.path}.via", self.values.get("via", ()))
        if pair is None or via is None:
            return None
        return Route(*pair, via) if via else Line(*pair)

    def rotation(self) -> Path | None:
        """A relative angle: of a joint, or between two markers."""
        if "joint" in self.values:
            return self.coordinate(angle=True)
        pair = self.pair()
        return None if pair is None else Turn(*pair)

    def joint_or_line(self) -> Path | None:
        """A joint's coordinate, or a line or path between markers."""
        if "joint" in self.values and "via" in self.values:
            self.fault("via", "a joint's coordinate has no path", "leave it out, or give between")
        return self.coordinate() if "joint" in self.values else self.line()

    def coordinate(self, angle: bool = False) -> Path | None:
        """The coordinate meant by ``joint``: of a joint of one degree, or named itself."""
        path, faults = f"{self.entry.path}.joint", self.reader.faults
        if "joint" not in self.values:
            return None
        found = find_coordinate(self.reader, self.joints, path, self.values["joint"])
        if found is None:
            return None
        name, kind, _ = found
        if kind == "parameter":
            remedy = "give the torque as a vector on the body: body: <body>, value: [x, y, z]"
            faults.add(path, f"{name!r} is an Euler parameter, which takes no torque", remedy)
            return None
        if angle and kind != "angle":
            faults.add(path, f"the coordinate {name!r} is a {kind}", "a torsional element acts on an angle")
            return None
        return JointCoordinate(name)
