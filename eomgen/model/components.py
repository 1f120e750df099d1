"""The sections ``components`` and ``add`` of a model file, and ``Model.add`` -> entries of the model.

An instance is a component whose names have a prefix, whose attachments are markers of the model, and whose parameters
are parameters or expressions of the model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from functools import partial
from typing import Any, NamedTuple, TypeVar

from ..elements import kinds
from ..elements.joints import JOINTS
from ..elements.kinds import MARKER, ROUNDS, items
from ..errors import Problem, UsageError
from ..expr.core import Graph
from ..expr.latex import Group, NotationError, Scripts, head_of, read_latex, spaced
from ..expr.notation import literal
from .build_elements import declare_contacts, declare_coordinates, element_states
from .build_quantities import declare_states, declare_switches
from .checks import check_keys, unknown_key
from .description import GROUND_NAME, SECTIONS, Binding, DescribedEntry, Description, Faults, Origin, place_of
from .fields import ADDED, COMPONENT, fields_of
from .names import ENERGIES, RATES, Namespace, callable_names, fault_of_name, nearest
from .quantities import COM, QUANTITIES, TOTALS, Named
from .units import UnitError, read_unit, sound_unit
from .values import Reader
from .visit import Undotted, Visitor, in_brackets, names_of, rewritten, started, undotted, visit_entry

#: Notes a fault: path, message, remedy, code.
Fault = Callable[[str, str, str, str], None]

Result = TypeVar("Result")
#: Names in expressions that no model declares.
RESERVED = frozenset(("t", "pi", "and", "or", "not", "if", "else", *ENERGIES, *TOTALS, *QUANTITIES, *callable_names()))


class Refused(Exception):
    """What cannot be added: path, message, remedy, code; nothing where that is noted already."""


def attempt(fault: Fault, call: Callable[..., Result], *arguments: Any) -> Result | None:
    """The result of a call; None, and a fault, where it is refused."""
    try:
        return call(*arguments)
    except Refused as refused:
        if refused.args:
            fault(*refused.args)
        return None


def is_constant(value: Any) -> bool:
    """Whether a value is a number, or a text of numbers alone such as ``-pi/6``."""
    return not isinstance(value, str) or names_of(value) <= {"pi", *callable_names()}


# -- the names of a component ------------------------------------------------------------------------------------------
@dataclass
class Component:
    """A part of a mechanism that models take in, as often as they like."""

    name: str  #: in messages
    place: str  #: dotted path of its entries in messages
    description: Description  #: its entries, values numbers and texts; instances in it are expanded
    attachments: tuple[str, ...] = ()  #: names that stand for markers of the model
    closed: bool = True  #: whether it knows no names but its own: it has a file of its own, or is a Model

    def __post_init__(self) -> None:
        """Collect the names that it declares: bodies, joints and constraints, symbols of expressions."""
        sections = self.description.sections
        named = {place: {e.name for e in entries if isinstance(e.name, str)} for place, entries in sections.items()}
        self.size = size_of(self.description) + 1
        self.settable = {e.name: e for place in ("parameters", "inputs") for e in sections[place]}
        self.bodies, self.elements = named["bodies"] - {GROUND_NAME}, named["joints"] | named["constraints"]
        faults = Faults(Description())  # noted where the model is checked
        reader = Reader(Graph(), Namespace(faults), faults, self.description)
        declare_coordinates(reader, sections["joints"])
        declare_contacts(reader, sections["constraints"])
        declare_states(reader, sections["states"], False)
        element_states(reader, sections["forces"])
        declare_switches(reader, [*sections["constraints"], *sections["joints"]])
        self.symbols = {str(e.name) for e in sections["joints"] if str(e.values.get("type")) not in JOINTS}
        self.symbols |= {*reader.names.kinds} - {"t"}
        for place in ("parameters", "inputs", "functions", "states", "outputs", "events"):
            self.symbols |= named[place]

    def has_symbol(self, name: str) -> bool:
        """Whether a name, or the quantity whose rate it is, is declared."""
        return any(name.endswith(rate) and name[: len(name) - len(rate)] in self.symbols for rate in RATES)

    def report(self, faults: Faults, place: str, message: str, remedy: str, code: str) -> None:
        """Note a fault of the component itself."""
        faults.take(Problem(f"{self.place}{place}", message, remedy, *self.description.place(place), code))


class Attached(NamedTuple):
    """What stands in the place of an attachment: a marker of the model, and where it is in its body."""

    reference: Any
    body: str
    placed: Mapping[str, Any]


class Renaming(Visitor):
    """A component's names as an instance has them, its attachments the markers given, its parameters replaced.

    ``prefix`` is put before every name of the component; ``values`` are expressions of the model in the place of
    parameters and inputs, ``attached`` markers by attachment, ground among them.  ``fault`` notes names that the
    component does not declare.
    """

    def __init__(
        self,
        component: Component,
        prefix: str,
        values: Mapping[str, str],
        attached: Mapping[str, Attached],
        fault: Fault | None = None,
    ) -> None:
        self.component, self.prefix, self.values, self.attached, self.fault = component, prefix, values, attached, fault
        self.markers: dict[str, tuple[str, Mapping[str, Any]]] = {}  #: name -> body and place of markers to add

    def word(self, name: str) -> str:
        """A name in an expression."""
        if name in self.values:
            return in_brackets(self.values[name])
        if self.component.has_symbol(name):
            return self.prefix + name
        if name not in RESERVED:
            self._foreign(
                name, "declare a parameter or an input of that name in it, and give it where you add the component"
            )
        return name

    def scalar(self, value: Any) -> Any:
        hidden = self.field.local if self.field else ()

        def place(marker: str) -> str:
            if marker == COM and COM not in self.component.bodies:
                return marker
            result = self.marker(marker)
            return result if isinstance(result, str) else self._named(marker, result)

        def quantity(named: Named) -> str:
            return str(named.renamed(place, lambda name: self.prefix + name))

        return rewritten(value, lambda name: name if name in hidden else self.word(name), quantity)

    def coordinate(self, name: str) -> str:
        known = name in self.component.elements or self.component.has_symbol(name)
        return self.prefix + name if known or self.component.closed else name

    def latex(self, text: Any) -> Any:
        return with_instance(text, self.prefix.strip("_")) if isinstance(text, str) and text else text

    def body(self, name: str) -> str:
        if name in self.attached:
            return self.attached[name].body
        return self.prefix + name if name in self.component.bodies or self.component.closed else name

    def marker(self, reference: Any) -> Any:
        body = reference.get("body") if isinstance(reference, Mapping) else reference
        if not isinstance(body, str):
            return reference
        body, _, name = body.partition(".")
        if body in self.attached:
            return self._on_attachment(body, name, reference)
        if body not in self.component.bodies:
            self._foreign(
                body, f"it has the bodies and attachments {', '.join([*self.component.bodies, *self.attached])}"
            )
            return reference if isinstance(reference, str) else super().marker(reference)
        return super().marker(reference)

    def _on_attachment(self, body: str, name: str, reference: Any) -> Any:
        result = self.attached[body]
        if isinstance(reference, str):
            if name:  # a marker that the component gives to ground
                return f"{result.body}.{self.prefix}{name}"
            return result.reference
        placed = self.placement(body, {key: value for key, value in reference.items() if key != "body"})
        return {"body": result.body, **self.placed(body, placed)}

    def placed(self, attachment: str, placed: Any) -> Mapping[str, Any]:
        """A place in the axes of an attachment, in the axes of the body that it is on."""
        inner, outer = placed if isinstance(placed, Mapping) else {"at": placed}, self.attached[attachment].placed
        if not outer:
            return inner
        return {**inner, "on": self.placed(attachment, inner["on"]) if "on" in inner else outer}

    def _named(self, attachment: str, reference: Mapping[str, Any]) -> str:
        """The label of a marker that expressions can speak of, in the place of an attachment without a name."""
        name = self.prefix + attachment
        self.markers[name] = (reference["body"], {k: v for k, v in reference.items() if k != "body"})
        return f"{reference['body']}.{name}"

    def _foreign(self, name: str, remedy: str) -> None:
        if self.fault is not None and self.entry is not None:
            message = f"{name!r} is not declared in the component, and a component knows only its own names"
            self.fault(f"{self.entry.path}.{self.key}", message, remedy, "EG-NAME-UNKNOWN")


# -- instances ---------------------------------------------------------------------------------------------------------
VALUE_KEYS = ("value", "unit")


def read_instance_value(entry: DescribedEntry, raw: Any, path: str) -> tuple[Any, str | None]:
    """A number or expression and its unit, None for that of the component.

    ``entry`` is the parameter or input of the component, ``raw`` what the instance has for it, at ``path``.
    """
    if not isinstance(raw, Mapping):
        return raw, None
    for key in raw:
        if key not in VALUE_KEYS:
            raise Refused(f"{path}.{key}", f"no key {key!r}", nearest(str(key), VALUE_KEYS, "keys"), "EG-NAME-UNKNOWN")
    if raw.get("value") is None:
        raise Refused(path, f"{dict(raw)!r} has no value", "write {value: 500, unit: mm}, or a number", "EG-MISSING")
    value, unit, base = raw["value"], raw.get("unit"), entry.values.get("unit")
    try:
        if unit is not None and not isinstance(unit, str):
            raise UnitError(f"{unit!r} is not a unit", "write a unit as text, as in mm")
        read = read_unit(unit or "")
        if unit is not None and isinstance(base, str) and base and read_unit(base).dimension != read.dimension:
            raise UnitError(f"{unit!r} does not measure what {entry.name} is in: {base}", "give a unit like that")
        if not is_constant(value) and read.size != 1.0:
            remedy = "leave the unit out: parameters are in SI units, so the expression is too"
            raise UnitError(f"{str(value)!r} is an expression, and {unit} is not an SI unit", remedy)
    except UnitError as error:
        raise Refused(f"{path}.unit", str(error), error.remedy, "EG-UNIT") from None
    return value, unit


def size_of(description: Description) -> int:
    """Number of entries and instances."""
    return sum(map(len, description.sections.values())) + len(description.instances)


@dataclass
class Instance:
    """One use of a component: its name, prefix, attachments by name, and values of parameters and inputs.

    Each value has the path at which it stands.
    """

    name: str
    prefix: str
    at: Mapping[str, Any] = field(default_factory=dict)
    values: Mapping[str, tuple[Any, str]] = field(default_factory=dict)
    initial: Mapping[str, Any] = field(default_factory=dict)
    guess: Mapping[str, Any] = field(default_factory=dict)


def add_instance(
    target: Description, component: Component, instance: Instance, path: str, faults: Faults, whole: bool = False
) -> None:
    """Add the entries of an instance to a description.

    A wrong marker or value is a fault, and a stand-in takes its place; if ``whole``, the instance is refused then.
    """
    before = len(faults)
    attached = _attachments(target, component, instance, path, faults.add)
    numbers, texts, units = _values(component, instance, faults)
    if whole and len(faults) > before:
        raise Refused
    claim(target, instance, path)
    origins = {
        f"{section}.{entry.name}": f"{section}.{instance.prefix}{entry.name}"
        for section, entries in component.description.sections.items()
        for entry in entries
    }
    renaming = Renaming(component, instance.prefix, texts, attached)
    _copy_origins(target, component, instance, origins)

    def note_attachment(name: str, where: str) -> None:
        """What is wrong there with a marker in the place of an attachment is wrong where the instance gives it."""
        target.origins[where] = Origin(f"{path}.at.{name}", "", "")
        target.lines[where] = place_of(f"{path}.at.{name}", faults.lines)

    for section in SECTIONS:
        for entry in component.description.sections[section]:
            if section == "bodies" and entry.name == GROUND_NAME:
                _add_to_ground(target, renaming, entry)
            elif section not in ("parameters", "inputs") or entry.name not in texts:
                made = visit_entry(section, entry, renaming)
                if section in ("parameters", "inputs") and entry.name in numbers:
                    made.values["value"] = numbers[entry.name]
                    made.values |= {"unit": units[entry.name]} if entry.name in units else {}
                if made.values.get("type") == "native" and section == "functions":
                    made.values.setdefault("function", entry.name)
                made.name = f"{instance.prefix}{entry.name}"
                made.path = f"{section}.{made.name}"
                target.sections[section].append(made)
                for key, kind in fields_of(section, entry.values).items():
                    raw = entry.values.get(key) if kind.holds in _HOLDERS else None
                    one = isinstance(raw, Mapping) and isinstance(made.values[key], list)  # shape in place of a list
                    for name, where in _attachments_in([raw] if one else raw, key):
                        if name in instance.at:
                            note_attachment(name, f"{made.path}.{where}")
    for name, (body, placed) in renaming.markers.items():
        _add_marker(target, body, name, placed)
        note_attachment(name.removeprefix(instance.prefix), f"bodies.{body}.markers.{name}")
    _add_starts(target, component, instance, renaming)
    target.absent |= {f"{instance.prefix}{name}" for name in component.description.absent}
    for binding in component.description.bindings:
        whole_name, text = f"{instance.name}.{binding.instance}", renaming.scalar(binding.text)
        target.bindings.append(binding._replace(instance=whole_name, text=text))
    for name in texts:
        if instance.values.get(name, (None,))[0] is not None:
            place, unit = instance.values[name][1], component.settable[name].values.get("unit")
            target.bindings.append(Binding(place, instance.name, texts[name], unit))
            target.origins[place] = Origin(place, "", "")


def _split(place: str) -> tuple[str, str]:
    """``joints.hip`` and ``.axis`` of ``joints.hip.axis``."""
    section, _, rest = place.partition(".")
    name = rest.partition(".")[0].partition("[")[0]
    return f"{section}.{name}", rest[len(name) :]


def _attachments(
    target: Description, component: Component, instance: Instance, path: str, fault: Fault
) -> dict[str, Attached]:
    """What stands in the place of each attachment; a body that is not there, where the instance gives no marker."""
    known = [*component.attachments, GROUND_NAME]
    result = {GROUND_NAME: Attached(GROUND_NAME, GROUND_NAME, {})}
    for name in instance.at:
        if name not in known:
            message = f"{component.name} has no attachment {name!r}"
            fault(f"{path}.at.{name}", message, nearest(str(name), known, "it has"), "EG-NAME-UNKNOWN")
    remedy = "give a body, body.marker, ground or {body, at, rpy}"
    unknown = [name for name in instance.at if name not in (*known, *component.bodies)]
    for name in (*known, *unknown):
        attached = _attached(target, instance.at[name]) if name in instance.at else None
        if attached is not None:
            result[name] = attached
            continue
        if name in instance.at:
            wrong = f"{instance.at[name]!r} is not a marker"
            fault(f"{path}.at.{name}", wrong, f"{remedy}; the marker must be declared before", "EG-TYPE")
        elif name != GROUND_NAME:
            fault(f"{path}.at.{name}", f"the attachment {name!r} of {component.name} is missing", remedy, "EG-MISSING")
        if name != GROUND_NAME:
            body = f"{instance.prefix}{name}"
            target.absent.add(body)
            result[name] = Attached(body, body, {})
    return result


#: What kinds of keys hold that may speak of an attachment.
_HOLDERS = ("marker", "body")


def _attachments_in(value: Any, path: str) -> Iterator[tuple[str, str]]:
    """Names that may be those of attachments, and the paths at which what is given for them is read."""
    if isinstance(value, str):
        yield value, path
    elif isinstance(value, Mapping) and isinstance(value.get("body"), str):
        yield from ((value["body"], f"{path}.{key}") for key in ("body", "on"))
    elif isinstance(value, Mapping):
        for key, part in value.items():
            yield from _attachments_in(part, f"{path}.{key}")
    elif isinstance(value, list | tuple):
        for k, part in enumerate(value):
            yield from _attachments_in(part, f"{path}[{k}]")


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
    component: Component, instance: Instance, faults: Faults
) -> tuple[dict[str, Any], dict[str, str], dict[str, str]]:
    """Numbers of parameters and inputs that stay, texts in the place of those that do not; units given with numbers."""
    for name, (_, place) in instance.values.items():
        if name not in component.settable:
            remedy = nearest(str(name), component.settable, "parameters and inputs")
            faults.add(place, f"{component.name} has no parameter or input {name!r}", remedy, "EG-NAME-UNKNOWN")
    numbers, texts, units = dict[str, Any](), dict[str, str](), dict[str, str]()
    for name, entry in component.settable.items():
        read = attempt(faults.add, read_instance_value, entry, *instance.values.get(name, (None, "")))
        raw, unit = read or (None, None)
        if raw is not None and is_constant(raw):
            numbers[name] = raw
            units |= {} if unit is None else {name: unit}
        elif raw is not None:
            texts[name] = str(raw)
        elif not is_constant(value := entry.values.get("value")):  # in parameters of its own that stand before it
            if (base := sound_unit(entry.values.get("unit"))) is not None and base.size != 1.0:
                remedy = "give an SI unit: parameters are in SI units, so the expression is too"
                message = f"{str(value)!r} is an expression, and its unit is not an SI unit"
                component.report(faults, f"{entry.path}.unit", message, remedy, "EG-UNIT")
            texts[name] = str(Renaming(component, instance.prefix, dict(texts), {}).scalar(value))
    return numbers, texts, units


def _copy_origins(target: Description, component: Component, instance: Instance, origins: Mapping[str, str]) -> None:
    """Lines and origins of what the instance brings."""
    inner = component.description
    for key, new in origins.items():
        result = inner.origins.get(key)
        place, name, prefix = result or (f"{component.place}{key}", "", "")
        whole = f"{instance.name}.{name}" if name else instance.name
        target.origins[new] = Origin(place, whole, instance.prefix + prefix)
    for key, place_in_file in inner.lines.items():
        head, rest = _split(key)
        if head in origins:
            target.lines.setdefault(origins[head] + rest, place_in_file)
            if rest and key in inner.origins:
                target.origins[origins[head] + rest] = inner.origins[key]
    for key, written in inner.written_paths.items():
        target.written_paths[origins[_split(key)[0]] + _split(key)[1]] = origins[_split(key)[0]] + _split(written)[1]
    for name, prefix in inner.instances.items():
        target.instances[f"{instance.prefix}{name}"] = instance.prefix + prefix


def _add_to_ground(target: Description, renaming: Renaming, entry: DescribedEntry) -> None:
    """Markers and shapes that a component gives to ground, on the body that stands in its place."""
    made = visit_entry("bodies", entry, renaming).values
    markers = made.get("markers", {})
    for name, placed in markers.items() if isinstance(markers, Mapping) else ():
        if isinstance(placed, Mapping):
            body = renaming.attached[GROUND_NAME].body
            _add_marker(target, body, f"{renaming.prefix}{name}", renaming.placed(GROUND_NAME, placed))
    shapes = made.get("display", [])
    for shape in shapes if isinstance(shapes, list) else ():
        home = _body_entry(target, renaming.attached[GROUND_NAME].body)
        if home is not None and isinstance(shape, Mapping):
            marker = {key: x for key, x in shape.items() if key in MARKER}
            placed_shape = {**shape, **renaming.placed(GROUND_NAME, marker)}
            home.values["display"] = [*home.values.get("display", ()), placed_shape]


def _body_entry(target: Description, body: str) -> DescribedEntry | None:
    entries = target.sections["bodies"]
    result = next((entry for entry in entries if entry.name == body), None)
    return target.add("bodies", GROUND_NAME, {}) if result is None and body == GROUND_NAME else result


def _add_marker(target: Description, body: str, name: str, placed: Mapping[str, Any]) -> None:
    entry = _body_entry(target, body)
    if entry is not None:
        markers = entry.values.get("markers", {})
        listed = dict(markers.items() if isinstance(markers, Mapping) else markers)
        entry.values["markers"] = {**listed, name: dict(placed)}


def _add_starts(target: Description, component: Component, instance: Instance, renaming: Renaming) -> None:
    """Initial values and guesses; those of the model itself come after them, and before them in force."""
    for key, raw in (("initial", instance.initial), ("guess", instance.guess)):
        starts = component.description.values.get(key, {})

        def inside(name: Any) -> Any:
            return started(name, lambda plain: renaming.prefix + plain, renaming)

        made = {inside(name): renaming.scalar(x) for name, x in (starts.items() if isinstance(starts, Mapping) else ())}
        made |= {inside(name): value for name, value in raw.items()}
        if made:
            kept = target.values.get(key)
            whole = {**made, **kept} if isinstance(kept, Mapping) else made
            if isinstance(kept, dict):  # also the Settings of a Model
                kept.clear()
                kept.update(whole)
            else:
                target.values[key] = whole


# -- the variables of repeated instances -------------------------------------------------------------------------------
Round = dict[str, Any]

_LISTS = "give a list of numbers or expressions, a count n for 1 to n, or {from, to, step}"


def rounds_of(raw: Any, path: str) -> list[Round]:
    """The values of all variables in each round."""
    if not isinstance(raw, Mapping) or not raw:
        raise Refused(path, f"{raw!r} is not a mapping of variables to their values", _LISTS, "EG-TYPE")
    columns = {name: _values_of(name, values, f"{path}.{name}") for name, values in raw.items()}
    if len({len(values) for values in columns.values()}) > 1:
        lengths = ", ".join(f"{name} has {len(values)}" for name, values in columns.items())
        remedy = "all lists must have the same length: the variables take their values side by side"
        raise Refused(path, f"lists of different lengths: {lengths}", remedy, "EG-SHAPE")
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _values_of(name: Any, raw: Any, path: str) -> list[Any]:
    """The values of a variable."""
    if wrong := fault_of_name(name, symbol=True):
        raise Refused(path, *wrong, "EG-NAME-FORM")
    listed = _counted(raw) if isinstance(raw, Mapping) else items(raw)
    if isinstance(raw, int) and not isinstance(raw, bool):
        listed = list(range(1, min(raw, ROUNDS + 1) + 1))
    if listed is None or not all(isinstance(x, str) or _is_number(x) for x in listed):
        raise Refused(path, f"{raw!r} is not a list of values", _LISTS, "EG-TYPE")
    if not 1 <= len(listed) <= ROUNDS:
        many, none = (f"has more than {ROUNDS} values", "EG-TOO-LARGE"), ("has no values", "EG-SHAPE")
        message, code = many if listed else none
        raise Refused(path, message, f"1 to {ROUNDS}", code)
    return listed


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _counted(raw: Mapping[str, Any]) -> list[Any] | None:
    """The numbers of ``{from, to, step}``; None if it is none."""
    first, last, step = (raw.get(key, default) for key, default in (("from", 1), ("to", None), ("step", 1)))
    if not {*raw} <= {"from", "to", "step"} or not all(map(_is_number, (first, last, step))) or step == 0:
        return None
    begin, end, by = (Decimal(repr(x)) for x in (first, last, step))  # as written, so that the end counts
    count = math.floor((end - begin) / by) + 1
    whole = all(isinstance(x, int) for x in (first, step))
    return [(int if whole else float)(begin + k * by) for k in range(max(0, min(count, ROUNDS + 1)))]


def with_variables(value: Any, variables: Round) -> Any:
    """A value, or all that it holds, in which the variables of a round have their values."""
    if isinstance(value, str):
        if value.strip() in variables:
            return variables[value.strip()]
        return rewritten(value, lambda name: in_brackets(str(variables[name])) if name in variables else name)
    if isinstance(value, Mapping):
        return {key: part if key == "body" else with_variables(part, variables) for key, part in value.items()}
    return [with_variables(part, variables) for part in value] if isinstance(value, list | tuple) else value


ENTRIES = 20_000  #: most entries and instances of a model that its components make


# -- the sections of a model file --------------------------------------------------------------------------------------
#: Reads the sections of a mapping into a description: mapping, path before its keys, the description.
Fill = Callable[[Mapping[str, Any], str, Description], None]
#: Reads a file that the model file names; None where it is at fault, which is noted.
Open = Callable[[str], Description | None]


class Components:
    """The components of one model file, each read when it is first added.

    ``lines`` are those of the model file by dotted path; ``fill`` and ``open_file`` read what stands in it, and files
    that it names.
    """

    def __init__(
        self, raw: Any, lines: Mapping[str, tuple[str, int]], fill: Fill, open_file: Open, faults: Faults
    ) -> None:
        self.lines, self.fill, self.open_file, self.faults, self.fault = lines, fill, open_file, faults, faults.add
        self.listed = faults.mapping("components", raw, "write the names of the components as keys")
        self.read: dict[str, Component | None] = {}
        self.within: list[str] = []
        self.incomplete = False  #: whether an instance could not be added

    def read_all(self) -> None:
        """Read also those that nothing adds, so that their faults are noted."""
        for name in self.listed:
            attempt(self.fault, self.find, name, f"components.{name}")

    def find(self, name: Any, path: str) -> Component:
        """The component of a name; refused where there is none, or it has faults, which are noted."""
        if not isinstance(name, str) or name not in self.listed:
            remedy = nearest(str(name), self.listed, "components")
            raise Refused(path, f"no component {name!r}", remedy, "EG-NAME-UNKNOWN")
        if name in self.within:
            chain = ", ".join([*self.within[self.within.index(name) :], name])
            message = f"the component {name!r} adds itself: {chain}"
            raise Refused(path, message, "remove one of these additions", "EG-CIRCLE")
        if name not in self.read:
            self.within.append(name)
            self.read[name] = attempt(self.fault, self._read, name, self.listed[name], f"components.{name}")
            self.within.pop()
        if (result := self.read[name]) is None:
            raise Refused
        return result

    def _read(self, name: str, raw: Any, path: str) -> Component:
        if wrong := fault_of_name(name):
            self.fault(path, *wrong, "EG-NAME-FORM")
        if not isinstance(raw, Mapping):
            raise Refused(path, f"is not {kinds.Table.says}", "write its keys, or {file: leg.yaml}", "EG-TYPE")
        check_keys(path, raw, COMPONENT, self.faults)
        if "file" in raw:
            if len(raw) > 1:
                remedy = "give file alone; the file describes the whole component"
                self.fault(path, "has keys beside file", remedy, "EG-CONFLICT")
            description = self._opened(raw["file"], f"{path}.file")
            self.incomplete |= description.incomplete
            component = component_of(description, name, "", self.faults, f"{path}.file")
        else:
            start = f"{path}."
            lines = {key.removeprefix(start): place for key, place in self.lines.items() if key.startswith(start)}
            description = Description(lines=lines)
            self.fill(raw, start, description)
            self.add(raw.get("add"), start, description)
            names = _attachments_of(raw)
            if any(map(fault_of_name, names)):
                message = f"{raw['attachments']!r} is not {kinds.Names.says}"
                self.fault(f"{start}attachments", message, "such as [foot, top]", "EG-TYPE")
                names = ()
            component = Component(name, start, undotted(description), names, closed=False)
        for one in component.attachments:
            if one in component.bodies or one in (GROUND_NAME, "body"):
                message = f"the attachment {one!r} has the name of a body"
                self.fault(f"{component.place}attachments", message, "rename one of them", "EG-NAME-TAKEN")
        return component

    def _opened(self, file: Any, path: str) -> Description:
        """The description of a file."""
        if not isinstance(file, str):
            raise Refused(path, f"{file!r} is not {kinds.File.says}", "", "EG-TYPE")
        try:
            description = self.open_file(file)
        except FileNotFoundError:
            remedy = "give its path from the folder of the model file"
            raise Refused(path, f"there is no file {file}", remedy, "EG-FILE") from None
        except UsageError as error:
            raise Refused(path, str(error), "", error.code) from None
        except OSError as error:
            raise Refused(path, f"{file} cannot be read ({error.strerror})", "", "EG-FILE") from None
        if description is None:
            raise Refused
        return description

    # -- instances ------------------------------------------------------------------------------------------------
    def add(self, raw: Any, start: str, target: Description) -> None:
        """Add the instances of a section ``add`` to a description; ``start`` stands before its path."""
        for name, keys in self.faults.mapping(f"{start}add", raw, "write the names of the instances as keys").items():
            if not attempt(self.fault, self._add_one, name, keys, f"{start}add.{name}", target):
                self.incomplete = True

    def _add_one(self, name: Any, keys: Any, path: str, target: Description) -> bool:
        if wrong := fault_of_name(name):
            raise Refused(path, *wrong, "EG-NAME-FORM")
        if not isinstance(keys, Mapping):
            raise Refused(path, f"is not {kinds.Table.says}", "write component: NAME and its other keys", "EG-TYPE")
        for key in keys:
            if key not in ADDED:
                self.fault(f"{path}.{key}", "unknown key", unknown_key(key, ADDED), "EG-NAME-UNKNOWN")
        if "component" not in keys:
            raise Refused(f"{path}.component", "is missing", nearest("", self.listed, "components"), "EG-MISSING")
        component = attempt(self.fault, self.find, keys["component"], f"{path}.component")
        rounds = attempt(self.fault, rounds_of, keys["for"], f"{path}.for") if "for" in keys else [{}]
        prefix = keys.get("prefix", f"{name}_")
        if prefix != "" and fault_of_name(prefix):
            remedy = "use letters, digits and underscores"
            raise Refused(f"{path}.prefix", f"{prefix!r} cannot begin a name", remedy, "EG-NAME-FORM")
        if component is None or rounds is None:
            raise Refused
        if size_of(target) + component.size * len(rounds) > ENTRIES:
            remedy = f"at most {ENTRIES} entries and instances"
            raise Refused(path, "makes the model too large", remedy, "EG-TOO-LARGE")
        for k, variables in enumerate(rounds):
            number = str(k + 1) if "for" in keys else ""
            before = f"{prefix.rstrip('_')}{number}_" if number else prefix
            instance = _instance(component, f"{name}{number}", before, keys, variables, path)
            add_instance(target, component, instance, path, self.faults)
        return True


def _instance(
    component: Component, name: str, prefix: str, keys: Mapping[str, Any], variables: Round, path: str
) -> Instance:
    """The instance of a round."""
    tables = {
        key: with_variables(keys.get(key) or {}, variables) for key in ("parameters", "inputs", "initial", "guess")
    }
    for key, raw in tables.items():
        if not isinstance(raw, Mapping):
            raise Refused(f"{path}.{key}", f"is not {kinds.Table.says}", "write names as keys", "EG-TYPE")
    at = with_variables(keys["at"], variables) if isinstance(keys.get("at"), Mapping) else keys.get("at")
    values = {n: (x, f"{path}.{key}.{n}") for key in ("parameters", "inputs") for n, x in tables[key].items()}
    attached = named_attachments(component, at, f"{path}.at")
    return Instance(name, prefix, attached, values, tables["initial"], tables["guess"])


def named_attachments(component: Component, at: Any, path: str) -> Mapping[str, Any]:
    """What is given as ``at``, by the names of attachments; one marker stands for the only one, or for ground."""
    if at is None:
        return {}
    if isinstance(at, Mapping) and "body" not in at:
        return at
    if len(component.attachments) > 1:
        remedy = f"give a mapping of {', '.join(component.attachments)}"
        raise Refused(path, f"{component.name} has several attachments", remedy, "EG-MISSING")
    return {(component.attachments or (GROUND_NAME,))[0]: at}


def claim(target: Description, instance: Instance, path: str) -> None:
    """Take the name of an instance into a description; refused where it is taken."""
    if instance.name in target.instances:
        raise Refused(path, f"there is an instance {instance.name!r} already", "rename one of them", "EG-NAME-TAKEN")
    if any(entry.name == instance.name for entry in target.sections["bodies"]):
        message = f"{instance.name!r} is a body too, so {instance.name}.x could mean two things"
        raise Refused(path, message, "rename one of them", "EG-NAME-TAKEN")
    target.instances[instance.name] = instance.prefix


def _attachments_of(values: Mapping[str, Any]) -> tuple[Any, ...]:
    """The names of attachments; one name counts as a list."""
    raw = values.get("attachments") or []
    return tuple(raw) if isinstance(raw, list | tuple) else (raw,)


def component_of(description: Description, name: str, place: str, faults: Faults, path: str) -> Component:
    """A component of the description of a whole model, which is at ``path``; it knows no names but its own."""
    for key in ("lagrangian", "equations"):
        if description.values.get(key) is not None:
            remedy = "a component can contain only bodies, joints and what belongs to them"
            faults.add(path, f"{name} has {key}", remedy, "EG-UNSUPPORTED")
    check = description.values.get("check_inertia")
    for entry in description.sections["bodies"]:
        if check is not None and entry.name != GROUND_NAME:
            entry.values.setdefault("check_inertia", check)
    component = Component(name, place, description, tuple(map(str, _attachments_of(description.values))))
    attached = dict.fromkeys((*component.attachments, GROUND_NAME), Attached(GROUND_NAME, GROUND_NAME, {}))
    known = Renaming(component, "", {}, attached, partial(component.report, faults))
    for section, entries in description.sections.items():
        for entry in entries:
            visit_entry(section, entry, known)
    return component


def with_instance(latex: str, instance: str) -> str:
    r"""LaTeX with the name of an instance as a further subscript: ``m_{c}`` -> ``m_{c,\mathrm{leg1}}``.

    What is not the LaTeX of a symbol stays as it is.
    """
    latex = spaced(latex)
    try:
        tree = read_latex(latex)
    except NotationError:  # noted when the model is checked
        return latex
    while isinstance(tree, Group) and len(tree.parts) > 1:
        head = head_of(tree) or tree.parts[0]
        tree = next(part for part in tree.parts if part.end >= head.end)
    word = literal(instance)
    if not isinstance(tree, Scripts):
        return f"{latex[: tree.end]}_{{{word}}}{latex[tree.end :]}"
    if tree.sub is None:
        return f"{latex[: tree.base.end]}_{{{word}}}{latex[tree.base.end :]}"
    start, end = tree.sub.start, tree.sub.end
    sub = f"{latex[start:end]},{word}"
    braced = latex[start - 1] == "{"
    return f"{latex[:start]}{sub if braced else f'{{{sub}}}'}{latex[end:]}"
