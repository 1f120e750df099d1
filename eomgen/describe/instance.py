"""A component, a prefix, attachments and values -> the entries that it brings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ..errors import Problem
from .component_names import Attached, OwnNames, Renaming
from .description import GROUND_NAME, SECTIONS, DescribedEntry, Description, Faults, Origin
from .names import nearest
from .placed_on import is_constant
from .units import UnitError, read_unit
from .visit import Slot, Undotted, started, visit_entry

#: Notes a fault: path, message, remedy, code.
Fault = Callable[[str, str, str, str], None]

VALUE_KEYS = ("value", "unit")


class InstanceValue(NamedTuple):
    """What an instance gives for a parameter or an input."""

    value: Any
    unit: str | None = None  #: None for that of the component


def read_given(entry: DescribedEntry, given: Any, path: str, fault: Fault) -> InstanceValue | None:
    """A number or expression as it stands, or the value and unit of a mapping; None if that is at fault.

    Parameters
    ----------
    entry : DescribedEntry
        The parameter or input of the component.
    given
        As the instance has it.
    path : str
        Where that is.
    fault : callable
    """
    if not isinstance(given, Mapping):
        return InstanceValue(given)
    for key in given:
        if key not in VALUE_KEYS:
            fault(f"{path}.{key}", f"no key {key!r}", nearest(str(key), VALUE_KEYS, "keys"), "EG-NAME-UNKNOWN")
            return None
    if given.get("value") is None:
        fault(path, f"{dict(given)!r} has no value", "write {value: 500, unit: mm}, or a number", "EG-MISSING")
        return None
    unit, own = given.get("unit"), entry.values.get("unit")
    if unit is None:
        return InstanceValue(given["value"])
    try:
        if not isinstance(unit, str):
            raise UnitError(f"{unit!r} is not a unit", "write a unit as text, as in mm")
        read = read_unit(unit)
        if isinstance(own, str) and own and read_unit(own).dimension != read.dimension:
            message = f"{unit!r} does not measure what {entry.name} is in: {own}"
            fault(f"{path}.unit", message, "give a unit like that", "EG-UNIT")
            return None
    except UnitError as error:
        fault(f"{path}.unit", str(error), error.remedy, "EG-UNIT")
        return None
    if not is_constant(given["value"]) and read.size != 1.0:
        remedy = "leave the unit out: parameters are in SI units, so the expression is too"
        fault(
            f"{path}.unit", f"{str(given['value'])!r} is an expression, and {unit} is not an SI unit", remedy, "EG-UNIT"
        )
        return None
    return InstanceValue(given["value"], unit)


@dataclass
class Component:
    """A part of a mechanism that models take in, as often as they like.

    Attributes
    ----------
    name : str
        How messages call it.
    place : str
        Dotted path of its entries in messages.
    description : Description
        Its entries, values numbers and texts; instances in it are expanded.
    attachments : tuple of str
        Names that stand for markers of the model.
    closed : bool
        Whether it knows no names but its own: it has a file of its own, or is a Model.
    """

    name: str
    place: str
    description: Description
    attachments: tuple[str, ...] = ()
    closed: bool = True

    def __post_init__(self) -> None:
        self.names = OwnNames(self.description)
        self.size = size_of(self.description) + 1
        self.given = {e.name: e for s in ("parameters", "inputs") for e in self.description.sections[s]}


def size_of(description: Description) -> int:
    """Number of entries and instances."""
    return sum(map(len, description.sections.values())) + len(description.instances)


@dataclass
class Instance:
    """One use of a component: its name, prefix, attachments by name, and values of parameters and inputs.

    ``places`` tells where in the instance's entry each value stands.
    """

    name: str
    prefix: str
    at: Mapping[str, Any] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)
    places: Mapping[str, str] = field(default_factory=dict)
    initial: Mapping[str, Any] = field(default_factory=dict)
    guess: Mapping[str, Any] = field(default_factory=dict)


def add_instance(target: Description, component: Component, instance: Instance, path: str, faults: Faults) -> None:
    """Add the entries of an instance to a description; what is wrong with it is noted at ``path``."""

    def told(place: str, message: str, remedy: str, code: str) -> None:
        """A fault of the component itself."""
        where = component.description.place(place)
        faults.take(Problem(f"{component.place}{place}", message, remedy, *where, code))

    attached = _attachments(target, component, instance, path, faults.add)
    values = _values(component, instance, path, faults.add, told)
    if attached is None or values is None:
        return
    numbers, texts, units = values
    origins = {
        f"{section}.{entry.name}": f"{section}.{instance.prefix}{entry.name}"
        for section, entries in component.description.sections.items()
        for entry in entries
    }
    renaming = Renaming(component.names, instance.prefix, texts, attached, component.closed, told)
    _copy_origins(target, component, instance, origins)
    for section in SECTIONS:
        for entry in component.description.sections[section]:
            if section == "bodies" and entry.name == GROUND_NAME:
                _add_to_ground(target, renaming, entry)
            elif section not in ("parameters", "inputs") or entry.name not in texts:
                made = visit_entry(section, entry, renaming)
                if section in ("parameters", "inputs") and entry.name in numbers:
                    made.values["value"] = numbers[entry.name]
                    made.values |= {"unit": units[entry.name]} if entry.name in units else {}
                made.name = f"{instance.prefix}{entry.name}"
                made.path = f"{section}.{made.name}"
                target.sections[section].append(made)
    for name, (body, placed) in renaming.markers.items():
        _add_marker(target, body, name, placed)
    _add_starts(target, component, instance, renaming)


def _split(place: str) -> tuple[str, str]:
    """``joints.hip`` and ``.axis`` of ``joints.hip.axis``."""
    section, _, rest = place.partition(".")
    name = rest.partition(".")[0].partition("[")[0]
    return f"{section}.{name}", rest[len(name) :]


def _attachments(
    target: Description, component: Component, instance: Instance, path: str, fault: Fault
) -> dict[str, Attached] | None:
    known = [*component.attachments, GROUND_NAME]
    found, sound = {GROUND_NAME: Attached(GROUND_NAME, GROUND_NAME, {})}, True
    for name in instance.at:
        if name not in known:
            message = f"{component.name} has no attachment {name!r}"
            fault(f"{path}.at.{name}", message, nearest(str(name), known, "it has"), "EG-NAME-UNKNOWN")
            sound = False
    for name in known:
        if name in instance.at:
            attached = _attached(target, instance.at[name])
            if attached is None:
                remedy = "give a body, body.marker, ground or {body, at, rpy}; the marker must be declared before"
                fault(f"{path}.at.{name}", f"{instance.at[name]!r} is not a marker", remedy, "EG-TYPE")
                sound = False
            else:
                found[name] = attached
        elif name != GROUND_NAME:
            remedy = "give a body, body.marker, ground or {body, at, rpy}"
            fault(f"{path}.at.{name}", f"the attachment {name!r} of {component.name} is missing", remedy, "EG-MISSING")
            sound = False
    return found if sound else None


def _attached(target: Description, reference: Any) -> Attached | None:
    plain = Undotted(target.instances).coordinate
    if isinstance(reference, Mapping):
        body = reference.get("body")
        placed = {key: value for key, value in reference.items() if key != "body"}
        return Attached({**reference, "body": plain(body)}, plain(body), placed) if isinstance(body, str) else None
    if not isinstance(reference, str):
        return None
    reference = plain(reference)
    body, dot, name = reference.partition(".")
    if not dot:
        return Attached(reference, body, {})
    for entry in target.sections["bodies"]:
        markers = entry.values.get("markers", {}) if entry.name == body else {}
        for marker, placed in markers.items() if isinstance(markers, Mapping) else markers:
            if marker == name:
                return Attached(reference, body, placed if isinstance(placed, Mapping) else {"at": placed})
    return None


def _values(
    component: Component, instance: Instance, path: str, fault: Fault, told: Fault
) -> tuple[dict[str, Any], dict[str, str], dict[str, str]] | None:
    """Numbers of parameters and inputs that stay, texts in the place of those that do not; units given with numbers."""
    sound = True
    for name in instance.values:
        if name not in component.given:
            remedy = nearest(str(name), component.given, "parameters and inputs")
            place = instance.places.get(name, name)
            fault(f"{path}.{place}", f"{component.name} has no parameter or input {name!r}", remedy, "EG-NAME-UNKNOWN")
            sound = False
    numbers, texts, units = dict[str, Any](), dict[str, str](), dict[str, str]()
    for name, entry in component.given.items():
        read = read_given(entry, instance.values.get(name), f"{path}.{instance.places.get(name, name)}", fault)
        if read is None:
            sound = False
            continue
        given = read.value
        if given is not None and is_constant(given):
            numbers[name] = given
            units |= {} if read.unit is None else {name: read.unit}
        elif given is not None:
            texts[name] = str(given)
        elif not is_constant(value := entry.values.get("value")):  # in parameters of its own that stand before it
            if _is_converted(entry.values.get("unit")):
                place = f"{entry.path}.unit"
                remedy = "give an SI unit: parameters are in SI units, so the expression is too"
                told(place, f"{str(value)!r} is an expression, and its unit is not an SI unit", remedy, "EG-UNIT")
                sound = False
            renaming = Renaming(component.names, instance.prefix, dict(texts), {}, component.closed, told)
            texts[name] = str(renaming.scalar(value, Slot("parameters", "", "value", (), entry)))
    return (numbers, texts, units) if sound else None


def _is_converted(unit: Any) -> bool:
    """Whether a value in this unit is not the same number in SI units."""
    try:
        return isinstance(unit, str) and read_unit(unit).size != 1.0
    except UnitError:  # told where the parameter is read
        return False


def _copy_origins(target: Description, component: Component, instance: Instance, origins: Mapping[str, str]) -> None:
    """Lines and origins of what the instance brings."""
    inner = component.description
    for key, new in origins.items():
        found = inner.origins.get(key)
        place, name, prefix = found or (f"{component.place}{key}", "", "")
        whole = f"{instance.name}.{name}" if name else instance.name
        target.origins[new] = Origin(place, whole, instance.prefix + prefix)
    for key, place_in_file in inner.lines.items():
        head, rest = _split(key)
        if head in origins:
            target.lines.setdefault(origins[head] + rest, place_in_file)
    for name, prefix in inner.instances.items():
        target.instances[f"{instance.prefix}{name}"] = instance.prefix + prefix


def _add_to_ground(target: Description, renaming: Renaming, entry: DescribedEntry) -> None:
    """Markers and shapes that a component gives to ground, on the body that stands in its place."""
    slot = Slot("bodies", "", "markers", (), entry)
    made = visit_entry("bodies", entry, renaming).values
    markers = made.get("markers", {})
    for name, placed in markers.items() if isinstance(markers, Mapping) else ():
        if isinstance(placed, Mapping):
            body = renaming.attached[GROUND_NAME].body
            _add_marker(target, body, f"{renaming.prefix}{name}", renaming.placed(GROUND_NAME, placed, slot))
    shapes = made.get("display", [])
    for shape in shapes if isinstance(shapes, list) else ():
        home = _body_entry(target, renaming.attached[GROUND_NAME].body)
        if home is not None and isinstance(shape, Mapping):
            own = {key: shape[key] for key in ("at", "rpy") if key in shape}
            placed_shape = {**shape, **renaming.placed(GROUND_NAME, own, slot)}
            home.values["display"] = [*home.values.get("display", ()), placed_shape]


def _body_entry(target: Description, body: str) -> DescribedEntry | None:
    entries = target.sections["bodies"]
    found = next((entry for entry in entries if entry.name == body), None)
    return target.add("bodies", GROUND_NAME, {}) if found is None and body == GROUND_NAME else found


def _add_marker(target: Description, body: str, name: str, placed: Mapping[str, Any]) -> None:
    entry = _body_entry(target, body)
    if entry is not None:
        markers = entry.values.get("markers", {})
        listed = dict(markers.items() if isinstance(markers, Mapping) else markers)
        entry.values["markers"] = {**listed, name: dict(placed)}


def _add_starts(target: Description, component: Component, instance: Instance, renaming: Renaming) -> None:
    """Initial values and guesses; those of the model itself come after them, and before them in force."""
    for key, given in (("initial", instance.initial), ("guess", instance.guess)):
        own = component.description.values.get(key, {})

        def inside(name: Any, slot: Slot) -> Any:
            return started(name, lambda plain: renaming.prefix + plain, renaming, slot)

        slots = {name: Slot("", "", key, (name,)) for name in (own if isinstance(own, Mapping) else ())}
        made = {inside(name, slot): renaming.scalar(own[name], slot) for name, slot in slots.items()}
        made |= {inside(name, Slot("", "", key, (name,))): value for name, value in given.items()}
        if made:
            kept = target.values.get(key, {})
            whole = {**made, **kept} if isinstance(kept, Mapping) else made
            if isinstance(kept, dict) and type(kept) is not dict:  # the Settings of a Model
                kept.clear()
                kept.update(whole)
            else:
                target.values[key] = whole
