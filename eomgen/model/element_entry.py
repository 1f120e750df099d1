"""One entry of a section of elements: its keys -> expressions, markers, coordinates, bodies, contact points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

from ..base.value_rules import TURN
from ..elements.constraints import Constraint
from ..elements.constraints.cams import Profile
from ..elements.element_type import ElementType, Entry, Found, Meaning, Types
from ..elements.forces import FORCES
from ..elements.frames import Frame, Marker
from ..elements.joints import JOINTS
from ..elements.kinds import Law
from ..errors import ModelError
from ..expr import vectors as vec
from ..expr.core import Expr, symbols_of
from ..expr.shown import quoted, shown
from .build_joints import Declared
from .checks import check_keys, check_names
from .description import DescribedEntry
from .mechanism import STATE_RATE, Body, FirstOrderState, JointSpec
from .names import nearest
from .printed_names import take_latex
from .quantities import TURNING, Named
from .requirements import Requirements
from .scope import ENERGIES, RATES
from .sympy_face import name_of
from .values import Reader


@dataclass
class Contacts:
    """Contact points: the coordinate of each by the path of its entry, and the bodies and joints made for them."""

    coordinates: dict[str, str] = field(default_factory=dict)
    bodies: list[Body] = field(default_factory=list)
    joints: list[JointSpec] = field(default_factory=list)

    def place(self, reader: Reader, entry: DescribedEntry, cam: Marker, index: int) -> Marker | None:
        """A marker at a cam's axis on a new body ``index`` without mass, whose x axis points to the contact point."""
        graph, name = reader.graph, f"{entry.name}_contact"
        if name in reader.bodies:
            message = f"the contact point needs a body named {name!r}, and there is one already"
            reader.faults.add(entry.path, message, "rename one of them", "EG-NAME-TAKEN")
            return None
        o = vec.zero(graph)
        point = Marker(index, Frame(reader.identity, o), name)
        coordinate = self.coordinates[entry.path]
        self.bodies.append(Body(name, graph.zero, o, (o, o, o)))
        self.joints.append(JointSpec(name, JOINTS["revolute"](), cam, point, (coordinate,), False))
        return point


def needs_point(values: dict[str, Any]) -> bool:
    """Whether a cam's contact is found by an angle of its own."""
    return (
        values.get("type") == "cam_contact" and "contour" in values and values.get("shape") in ("roller", "flat_face")
    )


def declare_contacts(reader: Reader, entries: list[DescribedEntry]) -> Contacts:
    """Take the polar angles of all contact points into the namespace."""
    contacts = Contacts()
    for entry in entries:
        if needs_point(entry.values) and isinstance(entry.name, str):
            given = entry.values.get("coordinate")
            name = f"{entry.name}_contact" if given is None else name_of(given)
            path = entry.path if given is None else f"{entry.path}.coordinate"
            reader.names.declare("coordinate", name, path)
            contacts.coordinates[entry.path] = str(name)
            take_latex(reader, f"{entry.path}.latex", name, entry.values.get("latex", ""))
    return contacts


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


_LEVELS = ("coordinate", "velocity", "acceleration")  #: kinds of names of motions
_OF_PARAMETERS = ("rate", "rate of rate")  #: those of Euler parameters


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


class ElementEntry(Entry):
    """The reader of one entry of a model."""

    def __init__(self, around: Surroundings, entry: DescribedEntry) -> None:
        super().__init__(around.reader, str(entry.name), entry.path, entry.values)
        self.around, self.entry = around, entry

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
        if isinstance(found.keys.get("law"), Law) and not self.values.keys() & _keys_of_law(found):
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

    def states(self) -> tuple[Expr, ...]:
        return tuple(self.graph.symbol(name) for name in states_of(self.entry))

    def velocities(self, key: str) -> tuple[tuple[str, Expr, str], ...] | None:
        if key not in self.values:
            return None
        value = self.values[key]
        joint = next((one for one in self.around.joints if isinstance(value, str) and one.entry.name == value), None)
        if joint is None:
            found = self.reader.coordinate(self._at(key), value)
            return None if found is None else ((found.name, self.graph.symbol(f"{found.name}_dot"), found.kind),)
        names = joint.coordinates
        rates = [(names[v.of], f"{names[v.of]}_dot") if v.of is not None else (value + v.suffix,) * 2
                 for v in joint.joint.velocities]  # fmt: skip
        kinds = [velocity.kind for velocity in joint.joint.velocities]
        if not rates:
            self.fault(key, f"{value!r} has no coordinates to lock", "name a joint that has", "EG-REFERENCE")
        return tuple((label, self.graph.symbol(rate), k) for (label, rate), k in zip(rates, kinds, strict=True))

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
        if (asked := Named.parse(name)) is not None and asked.carried:
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

    def table_kind(self, function: str) -> str | None:
        entries = self.reader.description.sections["functions"]
        return next((e.values.get("kind", "cubic") for e in entries if e.name == function and "x" in e.values), None)

    def contact_point(self, axis: Marker) -> tuple[Marker, Expr] | None:
        contacts = self.around.contacts
        point = contacts.place(self.reader, self.entry, axis, len(self.around.bodies) + len(contacts.bodies))
        return None if point is None else (point, self.graph.symbol(contacts.coordinates[self.path]))


def build_elements(around: Surroundings, what: str, entries: list[DescribedEntry], types: Types) -> tuple[Any, ...]:
    """Elements of all entries without faults; the faults are noted."""
    made = [_build(ElementEntry(around, e), what, types) for e in check_names(entries, what, around.reader.faults)]
    return tuple(element for element in made if element is not None)


def _build(e: ElementEntry, what: str, types: Types) -> Any:
    found = e.type_of(what, types)
    element = None if found is None or found.read is None else found.read(e)
    return None if e.at_fault() else element
