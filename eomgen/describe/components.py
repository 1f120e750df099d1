"""The sections ``components`` and ``add`` of a model file -> entries of the model."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from decimal import Decimal
from typing import Any

from ..elements import kinds
from ..elements.kinds import ROUNDS, items
from ..errors import UsageError
from .checks import unknown_key
from .description import GROUND_NAME, Description, Faults
from .fields import ADDED, COMPONENT
from .instance import Component, Fault, Instance, add_instance, size_of
from .names import fault_of_name, nearest
from .rewritten_texts import in_brackets, rewritten
from .visit import undotted

Round = dict[str, Any]

_LISTS = "give a list of numbers or expressions, a count n for 1 to n, or {from, to, step}"


def rounds_of(given: Any, path: str, fault: Fault) -> list[Round] | None:
    """The values of all variables in each round; None where something is wrong, which is told."""
    if not isinstance(given, Mapping) or not given:
        fault(path, f"{given!r} is not a mapping of variables to their values", _LISTS, "EG-TYPE")
        return None
    columns: dict[str, list[Any]] = {}
    for name, values in given.items():
        place = f"{path}.{name}"
        wrong = fault_of_name(name, symbol=True)
        if wrong:
            fault(place, *wrong, "EG-NAME-FORM")
            return None
        listed = _values_of(values)
        if listed is None:
            fault(place, f"{values!r} is not a list of values", _LISTS, "EG-TYPE")
            return None
        if not 1 <= len(listed) <= ROUNDS:
            many, none = ("has more than {} values", "EG-TOO-LARGE"), ("has no values", "EG-SHAPE")
            wrong_count, code = many if listed else none
            fault(place, wrong_count.format(ROUNDS), f"1 to {ROUNDS}", code)
            return None
        columns[name] = listed
    counts = {name: len(values) for name, values in columns.items()}
    if len(set(counts.values())) > 1:
        shown = ", ".join(f"{name} has {count}" for name, count in counts.items())
        remedy = "all lists must have the same length: the variables take their values side by side"
        fault(path, f"lists of different lengths: {shown}", remedy, "EG-SHAPE")
        return None
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _values_of(values: Any) -> list[Any] | None:
    if isinstance(values, int) and not isinstance(values, bool):
        return list(range(1, min(values, ROUNDS + 1) + 1))
    if isinstance(values, Mapping):
        first, last, step = (values.get(key, default) for key, default in (("from", 1), ("to", None), ("step", 1)))
        if not {*values} <= {"from", "to", "step"} or not all(map(_is_number, (first, last, step))) or step == 0:
            return None
        begin, end, by = (Decimal(repr(x)) for x in (first, last, step))  # as written, so that the end counts
        count = math.floor((end - begin) / by) + 1
        whole = all(isinstance(x, int) for x in (first, step))
        return [(int if whole else float)(begin + k * by) for k in range(max(0, min(count, ROUNDS + 1)))]
    listed = items(values)
    if listed is None or not all(isinstance(x, str) or _is_number(x) for x in listed):
        return None
    return listed


def put_in(value: Any, variables: Round) -> Any:
    """A value, or all that it holds, with the variables of a round put in."""
    if isinstance(value, str):
        if value.strip() in variables:
            return variables[value.strip()]
        return rewritten(value, lambda name: _text_of(name, variables), str)
    if isinstance(value, Mapping):
        return {key: part if key == "body" else put_in(part, variables) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [put_in(part, variables) for part in value]
    return value


def _text_of(name: str, variables: Round) -> str:
    if name not in variables:
        return name
    value = variables[name]
    return in_brackets(value if isinstance(value, str) else repr(value))


ENTRIES = 20_000  #: most entries and instances of a model that its components make

#: Reads the sections of a mapping into a description: mapping, path before its keys, the description.
Fill = Callable[[Mapping[str, Any], str, Description], None]
#: Reads a file that the model file names; None where it is at fault, which is told.
Open = Callable[[str], Description | None]


class Components:
    """The components of one model file, each read when it is first added.

    Parameters
    ----------
    given : object
        The section ``components``.
    lines : mapping
        Dotted path -> (file, line) in the model file.
    fill, open_file : callable
        Read what stands in the model file, and files that it names.
    faults : Faults
    """

    def __init__(
        self, given: Any, lines: Mapping[str, tuple[str, int]], fill: Fill, open_file: Open, faults: Faults
    ) -> None:
        self.lines, self.fill, self.open_file, self.faults, self.fault = lines, fill, open_file, faults, faults.add
        self.given: Mapping[str, Any] = given if isinstance(given, Mapping) else {}
        if given is not None and not isinstance(given, Mapping):
            faults.add(
                "components", f"is not {kinds.Table.says}", "write the names of the components as keys", "EG-TYPE"
            )
        self.read: dict[str, Component | None] = {}
        self.within: list[str] = []

    def read_all(self) -> None:
        """Read also those that nothing adds, so that their faults are told."""
        for name in self.given:
            self.find(name, f"components.{name}")

    def find(self, name: Any, path: str) -> Component | None:
        """The component of a name; None where there is none, or it has faults, which are told."""
        if not isinstance(name, str) or name not in self.given:
            self.fault(path, f"no component {name!r}", nearest(str(name), self.given, "components"), "EG-NAME-UNKNOWN")
            return None
        if name in self.within:
            chain = ", ".join([*self.within[self.within.index(name) :], name])
            self.fault(
                path, f"the component {name!r} adds itself: {chain}", "remove one of these additions", "EG-CIRCLE"
            )
            return None
        if name not in self.read:
            self.within.append(name)
            self.read[name] = self._read(name)
            self.within.pop()
        return self.read[name]

    def _read(self, name: str) -> Component | None:
        given, path = self.given[name], f"components.{name}"
        wrong = fault_of_name(name)
        if wrong:
            self.fault(path, *wrong, "EG-NAME-FORM")
        if not isinstance(given, Mapping):
            self.fault(path, f"is not {kinds.Table.says}", "write its keys, or {file: leg.yaml}", "EG-TYPE")
            return None
        for key in given:
            if key not in COMPONENT:
                self.fault(f"{path}.{key}", "unknown key", unknown_key(key, COMPONENT), "EG-NAME-UNKNOWN")
        if "file" in given:
            if len(given) > 1:
                remedy = "give file alone; the file describes the whole component"
                self.fault(path, "has keys beside file", remedy, "EG-CONFLICT")
            return self._read_file(name, given["file"], path)
        start = f"{path}."
        lines = {key.removeprefix(start): place for key, place in self.lines.items() if key.startswith(start)}
        description = Description(lines=lines)
        self.fill(given, start, description)
        self.add(given.get("add"), start, description)
        description = undotted(description)
        return self._checked(Component(name, start, description, self._attachments(given, start), closed=False))

    def _read_file(self, name: str, file: Any, path: str) -> Component | None:
        if not isinstance(file, str):
            self.fault(f"{path}.file", f"{file!r} is not {kinds.File.says}", "", "EG-TYPE")
            return None
        try:
            description = self.open_file(file)
        except FileNotFoundError:
            self.fault(
                f"{path}.file", f"there is no file {file}", "give its path from the folder of the model file", "EG-FILE"
            )
            return None
        except UsageError as error:
            self.fault(f"{path}.file", str(error), "", error.code)
            return None
        except OSError as error:
            self.fault(f"{path}.file", f"{file} cannot be read ({error.strerror})", "", "EG-FILE")
            return None
        if description is None:
            return None
        return self._checked(component_of(description, name, "", lambda _, *what: self.fault(f"{path}.file", *what)))

    def _checked(self, component: Component) -> Component:
        for name in component.attachments:
            if name in component.names.bodies or name in (GROUND_NAME, "body"):
                message = f"the attachment {name!r} has the name of a body"
                self.fault(f"{component.place}attachments", message, "rename one of them", "EG-NAME-TAKEN")
        return component

    def _attachments(self, given: Mapping[str, Any], start: str) -> tuple[str, ...]:
        listed = given.get("attachments") or []
        listed = [listed] if isinstance(listed, str) else listed
        if not isinstance(listed, list) or any(fault_of_name(name) for name in listed):
            self.fault(f"{start}attachments", f"{listed!r} is not {kinds.Names.says}", "such as [foot, top]", "EG-TYPE")
            return ()
        return tuple(listed)

    # -- instances ------------------------------------------------------------------------------------------------
    def add(self, given: Any, start: str, target: Description) -> None:
        """Add the instances of a section ``add`` to a description; ``start`` stands before its path."""
        if given is None:
            return
        if not isinstance(given, Mapping):
            self.fault(
                f"{start}add", f"is not {kinds.Table.says}", "write the names of the instances as keys", "EG-TYPE"
            )
            return
        for name, keys in given.items():
            self._add_one(name, keys, f"{start}add.{name}", target)

    def _add_one(self, name: Any, keys: Any, path: str, target: Description) -> None:
        wrong = fault_of_name(name)
        if wrong:
            self.fault(path, *wrong, "EG-NAME-FORM")
            return
        if not isinstance(keys, Mapping):
            self.fault(path, f"is not {kinds.Table.says}", "write component: NAME and its other keys", "EG-TYPE")
            return
        for key in keys:
            if key not in ADDED:
                self.fault(f"{path}.{key}", "unknown key", unknown_key(key, ADDED), "EG-NAME-UNKNOWN")
        if "component" not in keys:
            self.fault(f"{path}.component", "is missing", nearest("", self.given, "components"), "EG-MISSING")
            return
        component = self.find(keys["component"], f"{path}.component")
        rounds = rounds_of(keys["for"], f"{path}.for", self.fault) if "for" in keys else [{}]
        prefix = keys.get("prefix", f"{name}_")
        if prefix != "" and fault_of_name(prefix):
            remedy = "use letters, digits and underscores"
            self.fault(f"{path}.prefix", f"{prefix!r} cannot begin a name", remedy, "EG-NAME-FORM")
            return
        if component is None or rounds is None:
            return
        if size_of(target) + component.size * len(rounds) > ENTRIES:
            self.fault(path, "makes the model too large", f"at most {ENTRIES} entries and instances", "EG-TOO-LARGE")
            return
        for k, variables in enumerate(rounds):
            number = str(k + 1) if "for" in keys else ""
            before = f"{prefix.rstrip('_')}{number}_" if number else prefix
            instance = self._instance(component, f"{name}{number}", before, keys, variables, path)
            if instance is None or not claim(target, instance, path, self.fault):
                return
            add_instance(target, component, instance, path, self.faults)

    def _instance(
        self, component: Component, name: str, prefix: str, keys: Mapping[str, Any], variables: Any, path: str
    ) -> Instance | None:
        tables: dict[str, Mapping[str, Any]] = {}
        for key in ("parameters", "inputs", "initial", "guess"):
            given = put_in(keys.get(key) or {}, variables)
            if not isinstance(given, Mapping):
                self.fault(f"{path}.{key}", f"is not {kinds.Table.says}", "write names as keys", "EG-TYPE")
                return None
            tables[key] = given
        at = put_in(keys["at"], variables) if isinstance(keys.get("at"), Mapping) else keys.get("at")
        values = {**tables["parameters"], **tables["inputs"]}
        named = named_attachments(component, at, f"{path}.at", self.fault)
        if named is None:
            return None
        places = {one: f"{key}.{one}" for key in ("parameters", "inputs") for one in tables[key]}
        return Instance(name, prefix, named, values, places, tables["initial"], tables["guess"])


def named_attachments(component: Component, at: Any, path: str, fault: Fault) -> Mapping[str, Any] | None:
    """What is given as ``at``, by the names of attachments; one marker stands for the only one, or for ground."""
    if at is None:
        return {}
    if isinstance(at, Mapping) and "body" not in at:
        return at
    if len(component.attachments) > 1:
        remedy = f"give a mapping of {', '.join(component.attachments)}"
        fault(path, f"{component.name} has several attachments", remedy, "EG-MISSING")
        return None
    return {(component.attachments or (GROUND_NAME,))[0]: at}


def claim(target: Description, instance: Instance, path: str, fault: Fault) -> bool:
    """Take the name of an instance into a description; False, and a fault, where it is taken."""
    if instance.name in target.instances:
        fault(path, f"there is an instance {instance.name!r} already", "rename one of them", "EG-NAME-TAKEN")
        return False
    if any(entry.name == instance.name for entry in target.sections["bodies"]):
        message = f"{instance.name!r} is a body too, so {instance.name}.x could mean two things"
        fault(path, message, "rename one of them", "EG-NAME-TAKEN")
        return False
    target.instances[instance.name] = instance.prefix
    return True


def component_of(description: Description, name: str, place: str, fault: Fault) -> Component:
    """A component of the description of a whole model: its bodies, joints and what belongs to them."""
    for key in ("lagrangian", "equations"):
        if description.values.get(key) is not None:
            remedy = "a component can contain only bodies, joints and what belongs to them"
            fault("", f"{name} has {key}", remedy, "EG-UNSUPPORTED")
    check = description.values.get("check_inertia")
    for entry in description.sections["bodies"]:
        if check is not None and entry.name != GROUND_NAME:
            entry.values.setdefault("check_inertia", check)
    attachments = description.values.get("attachments") or []
    attachments = [attachments] if isinstance(attachments, str) else attachments
    return Component(name, place, description, tuple(map(str, attachments)))
