"""Entries of joints, forces and constraints -> coordinate names in the namespace, then JointSpecs and elements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

from ..base.value_rules import TURN
from ..elements.constraints.constraint import SWITCHING, Constraint
from ..elements.element_type import ElementType, Entry, Types
from ..elements.forces import FORCES
from ..elements.frames import TURNS, turn_matrix
from ..elements.joints import DATA, JOINTS, Joint
from ..elements.kinds import Scalar
from ..errors import ModelError
from ..expr.core import symbols_of
from ..expr.records import Record
from .checks import check_keys, check_names
from .description import DescribedEntry, Description, items
from .mechanism import FirstOrderState, JointSpec
from .quantities import Measure, Quantity
from .requirements import Requirements
from .sympy_face import name_of
from .values import Reader, take_coordinates_latex, take_latex

WELD = "weld"


def with_locks(description: Description) -> Description:
    """The description with a constraint for each joint that closes and opens; the same one where there is none."""
    joints = [_lock_of(entry) for entry in description.sections["joints"]]
    added = [constraint for _, constraint in joints if constraint is not None]
    if not added:
        return description
    sections = description.sections | {
        "joints": [joint for joint, _ in joints if joint is not None],
        "constraints": [*description.sections["constraints"], *added],
    }
    return replace(description, sections=sections)


def _lock_of(entry: DescribedEntry) -> tuple[DescribedEntry | None, DescribedEntry | None]:
    """What of an entry remains a joint, and what is a constraint."""
    kind: Any = entry.values.get("type")
    switching = {key: value for key, value in entry.values.items() if key in SWITCHING}
    if not switching or not isinstance(kind, str) or kind not in JOINTS:
        return entry, None
    rest = {key: value for key, value in entry.values.items() if key not in SWITCHING}
    if kind == WELD:
        lock = {"axes": "xyz", "turning": "xyz", **{key: x for key, x in rest.items() if key != "type"}}
        return None, replace(entry, values={"type": "hold", **lock, **switching})
    if not JOINTS[kind].kind.coordinates:
        return entry, None
    return replace(entry, values=rest), replace(entry, values={"type": "lock", "joint": entry.name, **switching})


class Declared(Record):
    """A joint whose type and coordinates are known, before its markers and expressions are looked up."""

    entry: Entry
    joint: Joint
    coordinates: tuple[str, ...]
    named: bool


def coordinate_names(
    type_name: str, name: str, values: dict[str, Any], joint: Joint | None = None
) -> tuple[tuple[Any, ...], bool]:
    """Names of a joint's coordinates as given or by default, and whether they were given."""
    if "coordinate" in values:
        return (name_of(values["coordinate"]),), True
    if "coordinates" in values:
        raw = values["coordinates"]
        listed = [raw] if isinstance(raw, str) else items(raw)
        return tuple(name_of(x) for x in listed or ()), True
    return tuple(name + c.suffix for c in (joint or sketch(type_name, values)).coordinates), False


def sketch(type_name: str, values: Mapping[str, Any]) -> Joint:
    """A joint from its raw keys, whose faults are told elsewhere."""
    kind: type[Joint] = JOINTS[type_name].kind
    raw = {key: values[key] for key in kind.options if isinstance(values.get(key), str)}
    return kind(**{key: field.default for key, field in kind.options.items()} | raw)


def declare_coordinates(reader: Reader, entries: list[DescribedEntry]) -> list[Declared]:
    """Check types, keys and coordinates of all joints and take the coordinates into the namespace."""
    result = []
    for entry in check_names(entries, "joint", reader.faults):
        e = Entry(reader, entry.name, entry.path, entry.values)
        element, path = _type_of(e, "joint", JOINTS), e.path
        if element is None:  # its coordinates are known all the same, so that their users are not at fault too
            for key in ("coordinate", "coordinates"):
                if key in e.values:
                    for name in coordinate_names("", e.name, {key: e.values[key]})[0]:
                        reader.names.declare("coordinate", name, f"{path}.{key}")
            continue
        joint = _without_expressions(e, element.kind)
        names, named = coordinate_names(element.name, e.name, e.values, joint)
        count = len(joint.coordinates)
        if named:
            path += ".coordinate" if "coordinate" in e.values else ".coordinates"
        if len(names) != count:
            remedy = f"name all {count}, in the order {', '.join(c.suffix.strip('_') for c in joint.coordinates)}"
            plural = "" if len(names) == 1 else "s"
            reader.fault(path, f"{len(names)} name{plural} for a joint of {count} coordinates", remedy, "EG-SHAPE")
        for k, name in enumerate(names):
            parameter = k < count and joint.coordinates[k].kind == "parameter"
            reader.names.declare("parameter of rotation" if parameter else "coordinate", name, path)
        rates = [e.name + velocity.suffix for velocity in joint.velocities if velocity.of is None]
        if "latex" in e.values and count and len(names) == count:
            others = [f"{name}_dot" for name in names] + rates
            take_coordinates_latex(reader, f"{e.path}.latex", names, e.values["latex"], others)
        for name in rates:
            reader.names.declare("velocity", name, e.path)
        if len(names) == count:
            result.append(Declared(e, joint, tuple(str(n) for n in names), named))
    return result


def _without_expressions(e: Entry, kind: type[Joint]) -> Joint:
    """The joint with stand-ins for options that are expressions, whose names are not all known yet."""
    if {"coordinate", "coordinates"} <= e.values.keys():
        e.fault("coordinates", "coordinate is given too", "leave out one of them")
    options = {
        key: e.fields[key].absent(e.reader) if isinstance(e.fields[key], Scalar) else e[key] for key in kind.options
    }
    if options.get("rotation") == "euler_parameters" and "sequence" in e.values:
        remedy = "leave out sequence, or choose rotation: euler_angles"
        e.fault("sequence", "Euler parameters have no sequence", remedy)
    return kind(**options)


def build_joints(reader: Reader, declared: list[Declared]) -> tuple[JointSpec, ...]:
    """Look up the markers of joints and turn them so that the axis is their z; joints with faults are left out."""
    result = []
    for joint in declared:
        e, names = joint.entry, joint.coordinates
        pair = e.pair()
        expressions = [key for key, field in joint.joint.options.items() if isinstance(field, Scalar)]
        values = {key: e.read(key, names[: e.fields[key].own]) for key in expressions if key in e.values}
        columns = reader.axis(f"{e.path}.axis", e.values["axis"]) if "axis" in e.values else TURNS["z"]
        if "axes" in e.values:
            if "axis" in e.values:
                e.fault("axes", "axis is given too", "leave out one of them")
            columns = reader.axes(f"{e.path}.axes", e.values["axes"])
        if pair is None:
            continue
        if pair[0].body == pair[1].body:
            message = f"{pair[0].label} and {pair[1].label} are on the same body"
            e.fault("between", message, "connect two bodies, or a body and ground", "EG-REFERENCE")
            continue
        if columns != TURNS["z"]:
            turn = turn_matrix(reader.graph, columns)
            pair = (pair[0].turned(turn), pair[1].turned(turn))
        data = {key: x for key in DATA if key in e.values and key in e.fields and (x := e.read(key, names)) is not None}
        kind = replace(joint.joint, **values)
        result.append(JointSpec(e.name, kind, *pair, names, joint.named, axes=columns, **data))
    return tuple(result)


# -- forces and constraints --------------------------------------------------------------------------------------------


def declare_contacts(reader: Reader, entries: list[DescribedEntry]) -> None:
    """Take the polar angles of all contact points of cams into the namespace."""
    for entry in entries:
        kind, shape = entry.values.get("type"), entry.values.get("shape")
        result = kind == "cam_contact" and "contour" in entry.values and shape in ("roller", "flat_face")
        if result and isinstance(entry.name, str):
            raw = entry.values.get("coordinate")
            name = f"{entry.name}_contact" if raw is None else name_of(raw)
            path = entry.path if raw is None else f"{entry.path}.coordinate"
            reader.names.declare("coordinate", name, path)
            reader.contacts[entry.path] = str(name)
            take_latex(reader, f"{entry.path}.latex", name, entry.values.get("latex", ""))


def check_turns(constraints: Sequence[Constraint], requirements: Requirements) -> None:
    """Note periodic profiles that jump where a turn ends, as far as the values of parameters tell."""
    for constraint in constraints:
        for field in fields(constraint):
            profile = getattr(constraint, field.name)
            if (turn := profile.over_a_turn() if hasattr(profile, "over_a_turn") else None) is None:
                continue
            laws, angle = turn
            where = " at the declared values" if symbols_of(laws) - {angle} else ""
            try:
                requirements.judge(f"constraints.{constraint.name}.{field.name}", TURN, laws, (), [angle], where)
            except ModelError:  # native code without a Python fallback
                continue


def element_states(
    reader: Reader, entries: list[DescribedEntry]
) -> tuple[tuple[FirstOrderState, ...], dict[str, Quantity]]:
    """Take in the states of force elements, which begin at 0: the states, and what the symbols of their rates are."""
    states: list[FirstOrderState] = []
    rates: dict[str, Quantity] = {}
    for entry in entries:
        kind: Any = entry.values.get("type")
        known = isinstance(kind, str) and kind in FORCES and isinstance(entry.name, str)
        for k, (suffix, unit) in enumerate(FORCES[kind].states(entry.values).items() if known else ()):
            name = f"{entry.name}_{suffix}"
            if reader.names.declare("state", name, entry.path):
                rate = f"rate of {name}"
                rates[rate] = Quantity(Measure.STATE_RATE, str(k), element=str(entry.name))
                states.append(FirstOrderState(name, reader.graph.symbol(rate), unit, f"state of {entry.name}"))
    return tuple(states), rates


def _type_of(e: Entry, what: str, types: Types) -> ElementType | None:
    """The type, if the entry has one and says in one way what it acts on; its keys are checked.

    Of a joint a key that other joints have is reported as such.
    """
    if e.at_fault():
        return None
    raw = e.reader.type_of(e.path, e.values, types, what)
    if not raw:
        return None
    result = types[raw]
    if _misunderstood(e, result):
        return None
    e.element_type, e.fields = result, result.fields(what, types)
    others = {key for one in types.values() for key in one.keys} if what == "joint" else ()
    check_keys(e.path, e.values, e.fields, e.reader.faults, f"a {raw} joint", others)
    present = [key for key in result.one_of if key in e.values]
    if result.one_of and len(present) != 1:
        message = f"{' or '.join(result.one_of)} is missing"
        if present:
            message = f"{'both ' * (len(present) == 2)}{', '.join(present[:-1])} and {present[-1]} are given"
        e.fault("", message, f"give one of {', '.join(result.one_of)}")
        return None
    return result


def _misunderstood(e: Entry, element: ElementType) -> bool:
    """Note a joint where a marker is asked for, with what people who give one want."""
    if not element.remedies:
        return False
    names = {name for joint in e.reader.joints for name in (joint.entry.name, *joint.coordinates)}
    for key, remedy in element.remedies.items():
        raw = "joint" if "joint" in e.values and "joint" not in element.keys else key
        named = e.values.get(raw)
        if raw == "joint" or (isinstance(named, str) and named in names and named not in e.reader.markers):
            e.fault(raw, f"a {element.name} acts at a marker, and {named!r} is not a marker", remedy, "EG-TYPE")
            return True
    return False


def build_elements(reader: Reader, what: str, entries: list[DescribedEntry], types: Types) -> tuple[Any, ...]:
    """Elements of all entries without faults; the faults are noted."""
    made = []
    for entry in check_names(entries, what, reader.faults):
        e = Entry(reader, str(entry.name), entry.path, entry.values)
        element_type = _type_of(e, what, types)
        element = None if element_type is None else element_type.read(e)
        made += [] if element is None or e.at_fault() else [element]
    return tuple(made)
