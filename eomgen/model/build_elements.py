"""Entries of joints, forces and constraints -> coordinate names in the namespace, then JointSpecs and elements."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

from ..base.value_rules import TURN
from ..elements import kinds
from ..elements.constraints import Constraint
from ..elements.constraints.cams import Profile
from ..elements.constraints.switching import SWITCHING
from ..elements.element_type import ElementType, Entry, Types
from ..elements.forces import FORCES
from ..elements.joints import JOINTS, Joint
from ..elements.kinds import LIMITS, Scalar
from ..errors import ModelError
from ..expr.core import symbols_of
from ..expr.records import dataclass
from .checks import check_keys, check_names
from .description import DescribedEntry, Description, items
from .fields import JOINT_DATA, joint_fields
from .mechanism import STATE_RATE, FirstOrderState, JointSpec
from .placement import TURNS, turn_matrix
from .requirements import Requirements
from .sympy_face import name_of
from .values import Reader, take_coordinates_latex, take_latex

Limits = tuple[tuple[str, float], ...]  #: (key, value) of what is limited


def limits_nothing(key: str, value: Any) -> bool:
    """Whether a limit is the infinity that no value passes, as URDF and MJCF files write it."""
    return isinstance(value, int | float) and value == (-math.inf if key == "lower" else math.inf)


def read_limits(reader: Reader, path: str, raw: Any, coordinates: Sequence[str]) -> tuple[Limits, ...]:
    """Limits of each coordinate of a joint.

    A mapping of ``lower``, ``upper``, ``velocity`` and ``effort``, each a number, or a list of one for each coordinate.
    """
    if not isinstance(raw, Mapping):
        reader.wrong(path, raw, kinds.Limits)
        return tuple(() for _ in coordinates)
    check_keys(path, raw, LIMITS, reader.faults)
    result: list[list[tuple[str, float]]] = [[] for _ in coordinates]
    for key in LIMITS:
        if key not in raw or raw[key] is None:
            continue
        listed = items(raw[key])
        values = [raw[key]] if listed is None else listed
        if len(values) != len(coordinates):
            message = f"{len(values)} values for {len(coordinates)} coordinates"
            reader.fault(f"{path}.{key}", message, f"give one for each: {', '.join(coordinates)}", "EG-SHAPE")
            continue
        for k, value in enumerate(values):
            place = f"{path}.{key}" if listed is None else f"{path}.{key}[{k}]"
            number = None if value is None or limits_nothing(key, value) else reader.number(place, value)
            if number is not None and number < 0 and key in ("velocity", "effort"):
                reader.fault(place, f"is {number:g}", "give the largest size, 0 or positive", "EG-RANGE")
            elif number is not None:
                result[k].append((key, number))
    for name, collected in zip(coordinates, result, strict=True):
        limits = dict(collected)
        if limits.get("lower", -math.inf) > limits.get("upper", math.inf):
            message = f"lower {limits['lower']:g} is above upper {limits['upper']:g} for {name!r}"
            reader.fault(path, message, "exchange them", "EG-RANGE")
    return tuple(tuple(collected) for collected in result)


def read_dry_friction(reader: Reader, path: str, raw: Any) -> float:
    """Coulomb friction of a joint (N m or N), as data."""
    value = reader.number(path, raw)
    if value is not None and value < 0:
        reader.fault(path, f"is {value:g}", "friction must be 0 or positive", "EG-RANGE")
    return value or 0.0


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
    own = {key: value for key, value in entry.values.items() if key in SWITCHING}
    if not own or not isinstance(kind, str) or kind not in JOINTS:
        return entry, None
    rest = {key: value for key, value in entry.values.items() if key not in SWITCHING}
    if kind == WELD:
        held = {"axes": "xyz", "turning": "xyz", **{key: x for key, x in rest.items() if key != "type"}}
        return None, replace(entry, values={"type": "hold", **held, **own})
    if not JOINTS[kind].coordinates:
        return entry, None
    return replace(entry, values=rest), replace(entry, values={"type": "lock", "joint": entry.name, **own})


@dataclass(frozen=True)
class Declared:
    """A joint whose type and coordinates are known, before its markers and expressions are looked up."""

    entry: DescribedEntry
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
    kind = JOINTS[type_name]
    raw = {key: values[key] for key in kind.options if isinstance(values.get(key), str)}
    return kind(**{key: field.default for key, field in kind.options.items()} | raw)


def declare_coordinates(reader: Reader, entries: list[DescribedEntry]) -> list[Declared]:
    """Check types, keys and coordinates of all joints and take the coordinates into the namespace."""
    result = []
    for entry in check_names(entries, "joint", reader.faults):
        at_fault = reader.faults.under(entry.path)
        type_name = "" if at_fault else reader.type_of(entry.path, entry.values, JOINTS, "joint")
        if not type_name:  # its coordinates are known all the same, so that their users are not at fault too
            for key in ("coordinate", "coordinates"):
                if key in entry.values:
                    for name in coordinate_names("", entry.name, {key: entry.values[key]})[0]:
                        reader.names.declare("coordinate", name, f"{entry.path}.{key}")
            continue
        joint = _joint(reader, entry, type_name)
        names, named = coordinate_names(type_name, entry.name, entry.values, joint)
        count = len(joint.coordinates)
        path = entry.path
        if named:
            path += ".coordinate" if "coordinate" in entry.values else ".coordinates"
        if len(names) != count:
            remedy = f"name all {count}, in the order {', '.join(c.suffix.strip('_') for c in joint.coordinates)}"
            plural = "" if len(names) == 1 else "s"
            reader.fault(path, f"{len(names)} name{plural} for a joint of {count} coordinates", remedy, "EG-SHAPE")
        for k, name in enumerate(names):
            parameter = k < count and joint.coordinates[k].kind == "parameter"
            reader.names.declare("parameter of rotation" if parameter else "coordinate", name, path)
        if "latex" in entry.values and count and len(names) == count:
            others = [f"{name}_dot" for name in names] + [
                entry.name + w.suffix for w in joint.velocities if w.of is None
            ]
            take_coordinates_latex(reader, f"{entry.path}.latex", names, entry.values["latex"], others)
        for velocity in joint.velocities:
            if velocity.of is None:
                reader.names.declare("velocity", entry.name + velocity.suffix, entry.path)
        if len(names) == count:
            result.append(Declared(entry, joint, tuple(str(n) for n in names), named))
    return result


def build_joints(reader: Reader, declared: list[Declared]) -> tuple[JointSpec, ...]:
    """Look up the markers of joints and turn them so that the axis is their z; joints with faults are left out."""
    result = []
    for joint in declared:
        path, values = joint.entry.path, joint.entry.values
        pair = reader.pair(f"{path}.between", values["between"]) if "between" in values else None
        kind = _with_expressions(reader, joint)
        columns = reader.axis(f"{path}.axis", values["axis"]) if "axis" in values else TURNS["z"]
        if "axes" in values:
            if "axis" in values:
                reader.fault(f"{path}.axes", "axis is given too", "leave out one of them", "EG-CONFLICT")
            columns = reader.axes(f"{path}.axes", values["axes"])
        if pair is None:
            continue
        if pair[0].body == pair[1].body:
            message = f"{pair[0].label} and {pair[1].label} are on the same body"
            reader.fault(f"{path}.between", message, "connect two bodies, or a body and ground", "EG-REFERENCE")
            continue
        if columns != TURNS["z"]:
            turn = turn_matrix(reader.graph, columns)
            pair = (pair[0].turned(turn), pair[1].turned(turn))
        spec = JointSpec(joint.entry.name, kind, *pair, joint.coordinates, joint.named, axes=columns)
        result.append(_with_data(reader, spec, path, values))
    return tuple(result)


def _with_data(reader: Reader, spec: JointSpec, path: str, values: dict[str, Any]) -> JointSpec:
    """Limits, dry friction and armature of a joint."""
    data: dict[str, Any] = {}
    if spec.coordinates and "limits" in values:
        data["limits"] = read_limits(reader, f"{path}.limits", values["limits"], spec.coordinates)
    if len(spec.coordinates) == 1 and "dry_friction" in values:
        data["dry_friction"] = read_dry_friction(reader, f"{path}.dry_friction", values["dry_friction"])
    if len(spec.coordinates) == 1 and "armature" in values:
        data["armature"] = JOINT_DATA["armature"].read(reader, f"{path}.armature", values["armature"])
    return replace(spec, **data) if data else spec


def _joint(reader: Reader, entry: DescribedEntry, type_name: str) -> Joint:
    """The joint itself, with its options; keys are checked."""
    fields = joint_fields(type_name)
    others = set[str]().union(*map(joint_fields, JOINTS)) if entry.values.keys() - fields.keys() else ()
    check_keys(entry.path, entry.values, fields, reader.faults, f"a {type_name} joint", others)
    if {"coordinate", "coordinates"} <= entry.values.keys():
        reader.fault(f"{entry.path}.coordinates", "coordinate is given too", "leave out one of them", "EG-CONFLICT")
    kind = JOINTS[type_name]
    options: dict[str, Any] = {}
    for option in kind.options:
        if isinstance(fields[option], Scalar):  # its names are not all known yet
            options[option] = fields[option].absent(reader)
        else:
            value = entry.values.get(option, fields[option].default)
            options[option] = fields[option].read(reader, f"{entry.path}.{option}", value)
    if options.get("rotation") == "euler_parameters" and "sequence" in entry.values:
        remedy = "leave out sequence, or choose rotation: euler_angles"
        reader.fault(f"{entry.path}.sequence", "Euler parameters have no sequence", remedy, "EG-CONFLICT")
    return kind(**options)


def _with_expressions(reader: Reader, declared: Declared) -> Joint:
    """The joint with those of its options that are expressions."""
    joint, values = declared.joint, declared.entry.values
    result = {
        option: field.read(reader, f"{declared.entry.path}.{option}", values[option], declared.coordinates[: field.own])
        for option, field in joint.options.items()
        if isinstance(field, Scalar) and option in values
    }
    return replace(joint, **result)


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
        for own in fields(constraint):
            profile = getattr(constraint, own.name)
            turn = profile.over_a_turn() if isinstance(profile, Profile) else None
            if turn is None:
                continue
            laws, angle = turn
            where = " at the declared values" if symbols_of(laws) - {angle} else ""
            try:
                requirements.judge(f"constraints.{constraint.name}.{own.name}", TURN, laws, (), [angle], where)
            except ModelError:  # native code without a Python fallback
                continue


def element_states(
    reader: Reader, entries: list[DescribedEntry]
) -> tuple[tuple[FirstOrderState, ...], dict[str, tuple[str, str]]]:
    """Take in the states of force elements, which begin at 0: the states, and what the symbols of their rates are."""
    states: list[FirstOrderState] = []
    rates: dict[str, tuple[str, str]] = {}
    for entry in entries:
        kind: Any = entry.values.get("type")
        known = isinstance(kind, str) and kind in FORCES and isinstance(entry.name, str)
        for k, (suffix, unit) in enumerate(FORCES[kind].states(entry.values).items() if known else ()):
            name = f"{entry.name}_{suffix}"
            if reader.names.declare("state", name, entry.path):
                rate = f"rate of {name}"
                rates[rate] = (f"{STATE_RATE}{k}", str(entry.name))
                states.append(FirstOrderState(name, reader.graph.symbol(rate), unit, f"state of {entry.name}"))
    return tuple(states), rates


def _type_of(e: Entry, what: str, types: Types) -> ElementType | None:
    """The type, if the entry has one and says in one way what it acts on; its keys are checked."""
    if e.at_fault():
        return None
    raw = e.reader.type_of(e.path, e.values, types, what)
    if not raw:
        return None
    result = types[raw]
    if _misunderstood(e, result):
        return None
    e.element_type, e.fields = result, result.fields(what, types)
    check_keys(e.path, e.values, e.fields, e.reader.faults)
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
    usable = check_names(entries, what, reader.faults)
    made = [_build(Entry(reader, str(e.name), e.path, e.values), what, types) for e in usable]
    return tuple(element for element in made if element is not None)


def _build(e: Entry, what: str, types: Types) -> Any:
    result = _type_of(e, what, types)
    element = None if result is None or result.read is None else result.read(e)
    return None if e.at_fault() else element
