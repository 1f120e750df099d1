"""Stage describe, one entry of a section of elements: its keys -> expressions, markers, coordinates, bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from ..base.value_rules import POSITIVE, Allowed
from ..elements.element_type import ElementType, Types
from ..elements.entry import Found, Meaning
from ..elements.field import Fields
from ..forces.contact_shapes import ContactShape
from ..frames import Marker, WrapCylinder
from ..graph.core import Expr
from ..graph.shown import quoted, shown
from ..graph.vectors import Vec3
from .build_cam_points import Contacts
from .build_joints import Declared
from .checks import check_keys
from .coordinates import find_coordinate
from .description import DescribedEntry, items
from .element_states import states_of
from .fields import CYLINDER
from .marker_quantities import element_quantity
from .mechanism import TURNING, Body, JointSpec
from .names import nearest
from .read_shapes import read_shapes
from .scope import ENERGIES, RATES
from .values import Reader

_LEVELS = ("coordinate", "velocity", "acceleration")  #: kinds of names of motions
_OF_PARAMETERS = ("rate", "rate of rate")  #: those of Euler parameters
_A = {"length": "a length", "angle": "an angle"}


def _keys_of_law(found: ElementType) -> set[str]:
    """The keys of a type that belong to its law: those that follow the key ``law``, and that key."""
    keys = list(found.keys)
    return set(keys[keys.index("law") :])


class Surroundings(NamedTuple):
    """What the entries of a section look up; ``contacts`` takes in bodies and joints of contact points."""

    reader: Reader
    joints: Sequence[Declared]
    specs: Sequence[JointSpec]
    bodies: Sequence[Body]
    contacts: Contacts


class ElementEntry:
    """The reader of :class:`~..elements.entry.Entry`, which says what its methods do."""

    def __init__(self, around: Surroundings, entry: DescribedEntry) -> None:
        self.around, self.entry, self.reader = around, entry, around.reader
        self.name, self.path, self.values = str(entry.name), entry.path, entry.values
        self.graph, self.stand_in = self.reader.graph, self.reader.stand_in
        self.fields: Fields = {}

    def type_of(self, what: str, types: Types) -> ElementType | None:
        """The type, if the entry has one and says in one way what it acts on; its keys are checked."""
        if self.at_fault():
            return None
        given = self.values.get("type")
        if not isinstance(given, str) or given not in types:
            message = "is missing" if given is None else f"no {what} of type {quoted(given)}"
            self.fault("type", message, nearest(shown(given), types, "types"), "EG-CHOICE")
            return None
        found = types[given]
        if self._misunderstood(found):
            return None
        self.fields = found.fields(what, types)
        if "law" in found.keys and found.keys["law"].kind == "law" and not self.values.keys() & _keys_of_law(found):
            self.fault("", "has no law", "give law: {stiffness: ...} and what else the law has", "EG-MISSING")
            return None
        check_keys(self.path, self.values, self.fields, self.reader.faults)
        present = [key for key in found.one_of if key in self.values]
        if found.one_of and len(present) != 1:
            message = f"{' or '.join(found.one_of)} is missing"
            if present:
                message = f"{'both ' * (len(present) == 2)}{', '.join(present[:-1])} and {present[-1]} are given"
            self.fault("", message, f"give one of {', '.join(found.one_of)}")
            return None
        return found

    def _misunderstood(self, found: ElementType) -> bool:
        """Note a joint where a marker is asked for, with what people who give one want."""
        if not found.remedies:
            return False
        names = {name for joint in self.around.joints for name in (joint.entry.name, *joint.coordinates)}
        for key, remedy in found.remedies.items():
            given = "joint" if "joint" in self.values and "joint" not in found.keys else key
            named = self.values.get(given)
            if given == "joint" or (isinstance(named, str) and named in names and named not in self.reader.markers):
                self.fault(given, f"a {found.name} acts at a marker, and {named!r} is not a marker", remedy, "EG-TYPE")
                return True
        return False

    # -- faults ---------------------------------------------------------------------------------------------------
    def _at(self, key: str) -> str:
        return f"{self.path}.{key}" if key else self.path

    def fault(self, key: str, message: str, remedy: str = "", code: str = "EG-CONFLICT") -> None:
        self.reader.faults.add(self._at(key), message, remedy, code)

    def missing(self, key: str, remedy: str) -> None:
        self.reader.faults.missing(self._at(key), remedy)

    def at_fault(self, key: str = "") -> bool:
        return bool(self.reader.faults.under(self._at(key)))

    def refuse(self, key: str, why: str) -> None:
        if key in self.values:
            self.fault(key, why, "leave it out")

    def require(self, key: str, value: Expr, allowed: Allowed, rule: str, message: str = "") -> None:
        self.reader.requirements.inside(self._at(key), value, allowed, rule, message)

    def judge(
        self, key: str, rule: str, values: Sequence[Expr], data: Sequence[Any] = (), local: Sequence[str] = ()
    ) -> None:
        self.reader.requirements.judge(self._at(key), rule, values, data, local)

    # -- values ---------------------------------------------------------------------------------------------------
    def law(self, key: str, local: Mapping[str, Expr] | None = None, exclusive: bool = True) -> Expr:
        field = self.fields[key]
        value = self.values.get(key, field.default)
        if value is None and key not in self.values:
            return self.stand_in  # missing, noted already
        return self.reader.expression(self._at(key), value, field.level, local, exclusive)

    def given(self, key: str) -> Expr | None:
        return self.law(key) if key in self.values else None

    def positive(self, key: str) -> Expr:
        value = self.law(key)
        self.reader.requirements.positive(self._at(key), value)
        return value

    def several(self, key: str, count: int) -> tuple[Expr, ...] | None:
        if key not in self.values:
            return None
        parts = items(self.values[key])
        if parts is None or len(parts) != count:
            self.reader.wrong(self._at(key), self.values[key], self.fields[key].kind)
            return None
        return tuple(self.reader.expression(f"{self._at(key)}[{k}]", part) for k, part in enumerate(parts))

    def sizes(self, key: str, names: Sequence[str]) -> dict[str, Expr] | None:
        given, path = self.values.get(key), self._at(key)
        if not isinstance(given, Mapping):
            if key in self.values:
                self.reader.wrong(path, given, self.fields[key].kind)
            return None
        for name in given:
            if name not in names:
                self.fault(f"{key}.{name}", "unknown key", nearest(str(name), names, "allowed"), "EG-NAME-UNKNOWN")
        found = {name: self.reader.expression(f"{path}.{name}", given[name]) for name in names if name in given}
        for name, size in found.items():
            self.require(f"{key}.{name}", size, POSITIVE, "give a size greater than 0")
        return found

    def vector(self, key: str) -> Vec3:
        if key not in self.values:
            return (self.stand_in,) * 3
        return self.reader.vector(self._at(key), self.values[key], self.fields[key].level)

    def matrix(self, key: str, size: int) -> tuple[tuple[Expr, ...], ...] | None:
        path, field, zero = self._at(key), self.fields[key], self.graph.zero
        value: Any = self.values.get(key, field.default)
        if value is None:
            return None
        listed = items(value) or ()
        rows = [items(part) for part in listed] if len(listed) == size else []
        if rows and all(row is None for row in rows):
            diagonal = [self.reader.expression(f"{path}[{k}]", x, field.level) for k, x in enumerate(listed)]
            return tuple(tuple(x if i == j else zero for j in range(size)) for i, x in enumerate(diagonal))
        if rows and all(row is not None and len(row) == size for row in rows):
            return tuple(
                tuple(self.reader.expression(f"{path}[{i}][{j}]", x, field.level) for j, x in enumerate(row or ()))
                for i, row in enumerate(rows)
            )
        self.reader.wrong(path, value, field.kind)
        return None

    def choice(self, key: str) -> str:
        field = self.fields[key]
        if key not in self.values:
            return str(field.default)
        return self.reader.choice(self._at(key), self.values[key], field)

    def flag(self, key: str) -> bool:
        value = self.values.get(key, self.fields[key].default)
        if not isinstance(value, bool):
            self.reader.wrong(self._at(key), value, "flag")
            return False
        return value

    def states(self) -> tuple[Expr, ...]:
        return tuple(self.graph.symbol(name) for name in states_of(self.entry))

    # -- parts of the mechanism -----------------------------------------------------------------------------------
    def marker(self, key: str) -> Marker | None:
        value = self.values.get(key, self.fields[key].default)
        return None if value is None and key not in self.values else self.reader.marker(self._at(key), value)

    def pair(self, key: str = "between") -> tuple[Marker, Marker] | None:
        return self.reader.pair(self._at(key), self.values[key]) if key in self.values else None

    def axis(self, key: str) -> Vec3:
        columns = self.reader.axis(self._at(key), self.values.get(key, self.fields[key].default))
        x, y, z = (self.graph.constant(value) for value in columns[2])
        return x, y, z

    def via(self, key: str = "via") -> Sequence[Marker | WrapCylinder] | None:
        value = self.values.get(key, ())
        listed, found = items(value), list[Marker | WrapCylinder]()
        if listed is None:
            self.reader.wrong(self._at(key), value, "via")
            return None
        for k, item in enumerate(listed):
            stop = self._stop(f"{self._at(key)}[{k}]", item)
            if isinstance(stop, WrapCylinder) and found and isinstance(found[-1], WrapCylinder):
                remedy = "put a marker between the two cylinders"
                self.fault(f"{key}[{k}]", "follows another cylinder directly", remedy)
            if stop is not None:
                found.append(stop)
        return None if self.at_fault(key) else found

    def _stop(self, path: str, value: Any) -> Marker | WrapCylinder | None:
        reader = self.reader
        if not (isinstance(value, Mapping) and "body" not in value):
            return reader.marker(path, value)
        check_keys(path, value, CYLINDER, reader.faults)
        if "around" not in value or "radius" not in value:
            return None
        marker = reader.marker(f"{path}.around", value["around"])
        radius = reader.expression(f"{path}.radius", value["radius"])
        reader.requirements.positive(f"{path}.radius", radius)
        field = CYLINDER["sense"]
        sense = reader.choice(f"{path}.sense", value.get("sense", field.default), field)
        rubbing = self._rubbing(path, value)
        return None if marker is None else WrapCylinder(marker, radius, 1 if sense == "positive" else -1, *rubbing)

    def _rubbing(self, path: str, value: Mapping[str, Any]) -> tuple[Expr | None, Expr | None]:
        """Friction of a rope on a cylinder, and the velocity below which it is smoothed; neither where it is smooth."""
        keys = ("friction", "smoothing")
        missing = [key for key in keys if key not in value]
        if missing:
            if len(missing) == 1:
                remedy = "give friction and smoothing together, or neither"
                self.reader.faults.missing(f"{path}.{missing[0]}", remedy)
            return None, None
        friction, smoothing = (self.reader.expression(f"{path}.{key}", value[key]) for key in keys)
        self.reader.requirements.positive(f"{path}.friction", friction, or_zero=True)
        self.reader.requirements.positive(f"{path}.smoothing", smoothing)
        return friction, smoothing

    def shapes(self, key: str) -> tuple[ContactShape, ...] | None:
        return read_shapes(self.reader, self._at(key), self.values[key]) if key in self.values else None

    def body(self, key: str = "body") -> tuple[int, Body] | None:
        given, own = self.values.get(key), {body.name: k for k, body in enumerate(self.around.bodies)}
        if given is None:
            return None
        if not isinstance(given, str) or given not in own:
            if not self.reader.faults.under(f"bodies.{given}"):
                self.fault(key, f"no body {quoted(given)}", nearest(shown(given), own, "bodies"), "EG-NAME-UNKNOWN")
            return None
        return own[given], self.around.bodies[own[given]]

    # -- coordinates and names ------------------------------------------------------------------------------------
    def coordinate(self, key: str = "joint", kind: str = "") -> Found | None:
        return self._find(key, self.values[key], kind) if key in self.values else None

    def _find(self, key: str, value: Any, kind: str = "") -> Found | None:
        """A coordinate from the name of its joint, or its own."""
        found = find_coordinate(self.reader, self.around.joints, self._at(key), value)
        if found is not None and kind and found.joint is not None and found.kind != kind:
            remedy = f"name a coordinate that is {_A[kind]}"
            self.fault(key, f"the coordinate {found.name!r} is {_A[found.kind]}", remedy, "EG-REFERENCE")
            return None
        return found

    def symbol(self, found: Found) -> Expr:
        return self.graph.symbol(found.name)

    def velocities(self, key: str) -> tuple[tuple[str, Expr, str], ...] | None:
        if key not in self.values:
            return None
        value = self.values[key]
        joint = next((one for one in self.around.joints if isinstance(value, str) and one.entry.name == value), None)
        if joint is None:
            found = self._find(key, value)
            return None if found is None else ((found.name, self.graph.symbol(f"{found.name}_dot"), found.kind),)
        names = joint.coordinates
        rates = [(names[v.of], f"{names[v.of]}_dot") if v.of is not None else (value + v.suffix,) * 2
                 for v in joint.joint.velocities]  # fmt: skip
        kinds = [velocity.kind for velocity in joint.joint.velocities]
        if not rates:
            self.fault(key, f"{value!r} has no coordinates to lock", "name a joint that has", "EG-REFERENCE")
        return tuple((label, self.graph.symbol(rate), k) for (label, rate), k in zip(rates, kinds, strict=True))

    def two_coordinates(self, key: str, kind: str = "") -> tuple[Found, Found] | None:
        if key not in self.values:
            return None
        parts = items(self.values[key])
        if parts is None or len(parts) != 2:
            self.reader.wrong(self._at(key), self.values[key], self.fields[key].kind)
            return None
        a, b = (self._find(f"{key}[{k}]", part, kind) for k, part in enumerate(parts))
        if a is None or b is None:
            return None
        if a.name == b.name:
            self.fault(key, f"{a.name!r} is named twice", "name two different coordinates")
            return None
        self.require_one_carrier(key, a, b)
        return a, b

    def factors(self, key: str) -> list[tuple[Found, Expr]] | None:
        given, terms = self.values.get(key), list[tuple[Found, Expr]]()
        if not isinstance(given, Mapping) or not given:
            self.reader.wrong(self._at(key), given, self.fields[key].kind)
            return None
        for name, value in sorted(given.items(), key=lambda pair: str(pair[0])):
            found = self._find(f"{key}.{name}", name)
            factor = self.reader.expression(f"{self._at(key)}.{name}", value)
            if found is not None:
                if any(found.name == other.name for other, _ in terms):
                    self.fault(
                        f"{key}.{name}", f"{found.name!r} is named twice", "name it once, with the sum of its factors"
                    )
                terms.append((found, factor))
        return terms

    def require_one_carrier(self, key: str, a: Found, b: Found) -> None:
        first, second = self.carrier(a), self.carrier(b)
        if first is None or second is None or first == second:
            return
        message = f"{a.name!r} and {b.name!r} are not measured from the same body"
        remedy = "give both joints the body that carries the two axes as predecessor; for a carrier that turns "
        self.fault(key, message, remedy + "use planetary, or a coupling", "EG-REFERENCE")

    def carrier(self, coordinate: Found) -> int | None:
        spec = self._spec(coordinate)
        return None if spec is None else self._rigid(spec.predecessor.body)

    def carried(self, coordinate: Found) -> int | None:
        spec = self._spec(coordinate)
        return None if spec is None else self._rigid(spec.successor.body)

    def _spec(self, coordinate: Found) -> JointSpec | None:
        return next((joint for joint in self.around.specs if joint.name == coordinate.joint), None)

    def _rigid(self, body: int) -> int:
        """The least index of the bodies welded to one."""
        group, before = {body}, 0
        while len(group) > before:
            before = len(group)
            for joint in self.around.specs:
                ends = {joint.predecessor.body, joint.successor.body}
                if not joint.coordinates and ends & group:
                    group |= ends
        return min(group)

    def meaning(self, name: str) -> Meaning:
        kind, place = self.reader.names.kinds.get(name, ""), self.reader.quantities.get(name)
        if place is not None:
            turns = place.level in TURNING or (place.axis == 3 and place.level < 2)
            return Meaning("marker", place.order, "angle" if turns else "length")
        if name in (f"{energy}()" for energy in ENERGIES):
            return Meaning("energy")
        if (asked := element_quantity(name)) is not None and asked.carried:
            return Meaning("reaction" if asked.part else "multiplier")
        if asked is not None:  # whether a force moves with velocities is known once its law is
            return Meaning("element", 1 if asked.name == "rate" else 0, "length")
        if kind in _OF_PARAMETERS:
            return Meaning(kind, _OF_PARAMETERS.index(kind) + 1, "angle")
        if kind not in _LEVELS:
            return Meaning(kind)
        level = _LEVELS.index(kind)
        of = name.removesuffix(RATES[level])
        kinds = {c: k.kind for j in self.around.joints for c, k in zip(j.coordinates, j.joint.coordinates, strict=True)}
        return Meaning(kind, level, "length" if kinds.get(of) == "length" else "angle")

    def known(self, kind: str) -> list[str]:
        return [*self.reader.names.of(kind)]

    def table_kind(self, function: str) -> str | None:
        entries = self.reader.description.sections["functions"]
        return next((e.values.get("kind", "cubic") for e in entries if e.name == function and "x" in e.values), None)

    def contact_point(self, axis: Marker) -> tuple[Marker, Expr] | None:
        contacts = self.around.contacts
        point = contacts.place(self.reader, self.entry, axis, len(self.around.bodies) + len(contacts.bodies))
        return None if point is None else (point, self.graph.symbol(contacts.coordinates[self.path]))
