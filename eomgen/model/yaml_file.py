"""YAML 1.2 -> Description, without SymPy; every fault says its file and line.

Only what a model file needs is read: mappings with plain keys, sequences and scalars of YAML 1.2.  Anchors, aliases,
tags and duplicate keys are refused; size, depth and number of nodes are bounded.
"""

from __future__ import annotations

import numbers
import os
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from ..base.files import as_name, beside, open_plain
from ..base.texts import visible
from ..elements import kinds
from ..elements.kinds import Field, items
from ..errors import ModelError, Problem, UsageError, cannot
from ..expr.texts import comment_text, shortened, yaml_quoted
from .description import GROUND_NAME, SECTIONS, DescribedEntry, Description, Faults
from .fields import MODEL, PARTS, SHORT, fields_of
from .names import WHOLE, join_surrogates, lone_surrogate, nearest
from .quantities import Named
from .sympy_face import free_names, is_sympy, name_of, symbol, sympy_text, values_in, with_intermediates, with_sympy
from .visit import undotted

SIZE = 1_000_000  #: bytes of a file
DEPTH = 12  #: nesting
NODES = 100_000  #: scalars, sequences and mappings
DAMAGED = "EG-FILE-DAMAGED"

_INT = re.compile(r"[-+]?[0-9]+\Z", re.ASCII)
_BASED = re.compile(r"0o[0-7]+\Z|0x[0-9a-fA-F]+\Z", re.ASCII)
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?\Z", re.ASCII)
_SPECIAL = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **{sign + word: float(sign + "inf") for sign in ("", "+", "-") for word in (".inf", ".Inf", ".INF")},
    **dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan")),
}


def scalar(text: str) -> Any:
    """The value of a plain scalar by YAML 1.2's core schema."""
    if text in _SPECIAL:
        return _SPECIAL[text]
    if _INT.match(text) and len(text) <= 40:
        return int(text)
    if _FLOAT.match(text):
        return float(text)
    if _BASED.match(text) and len(text) <= 40:
        return int(text, 0)
    return text


class Document:
    """A model file as plain values: mappings, lists and scalars."""

    def __init__(self, text: str, file: str) -> None:
        self.file = file
        self.lines: dict[str, tuple[str, int]] = {"": (file, 1)}  #: by dotted path; the empty one is the file itself
        self.problems: list[Problem] = []  #: anchors, tags, duplicate keys and what else a model file does not have
        self.count = 0
        self.value = self._read(text)

    def _stop(self, line: int, message: str, remedy: str = "", path: str = "", code: str = DAMAGED) -> ModelError:
        """An error after which reading on makes no sense."""
        problem = Problem(path or "file", message, remedy, self.file, line, code)
        return ModelError([*self.problems, problem])

    def _note(self, path: str, line: int, message: str, remedy: str) -> None:
        self.problems.append(Problem(path, message, remedy, self.file, line, DAMAGED))

    def _read(self, text: str) -> Any:
        from ruamel.yaml import YAML
        from ruamel.yaml.error import MarkedYAMLError, YAMLError

        if len(text) > SIZE:
            raise self._stop(1, f"the file has {len(text)} characters", f"at most {SIZE}", code="EG-TOO-LARGE")
        reader = YAML(typ="safe", pure=True)
        try:
            self._events = iter(reader.parse(text))
            documents = self._documents()
        except MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            what = " ".join(part for part in (error.context, error.problem) if part)
            remedy = "replace the tab by spaces" if r"'\t'" in what else "check indents, colons and brackets"
            raise self._stop(mark.line + 1 if mark else 1, f"not YAML: {what}", remedy) from None
        except (YAMLError, RecursionError, ValueError) as error:
            what = str(getattr(error, "reason", "") or error).split("\n")[0]
            raise self._stop(_line_of(error, text), f"not YAML: {what}") from None
        if not documents:
            raise self._stop(1, "the file is empty", "write a name, bodies and joints, or a name and a lagrangian")
        return documents[0]

    def _documents(self) -> list[Any]:
        documents: list[Any] = []
        for event in self._events:
            kind = type(event).__name__
            if kind in ("ScalarEvent", "SequenceStartEvent", "MappingStartEvent", "AliasEvent"):
                if documents:
                    raise self._stop(
                        event.start_mark.line + 1, "a second YAML document begins here", "write one model per file"
                    )
                documents.append(self._value(event, "", 0))
        return documents

    def _value(self, event: Any, path: str, depth: int) -> Any:
        kind, line = type(event).__name__, event.start_mark.line + 1
        self.count += 1
        if self.count > NODES:
            raise self._stop(line, "the file has too many values", f"at most {NODES}", path, "EG-TOO-LARGE")
        if depth > DEPTH:
            raise self._stop(line, "nested too deeply", f"at most {DEPTH} levels", path, "EG-TOO-LARGE")
        if kind == "AliasEvent":
            self._note(
                path or "file", line, f"the alias *{event.anchor}", "aliases are not supported: write the value itself"
            )
            return None
        if event.anchor is not None:
            self._note(path or "file", line, f"the anchor &{event.anchor}", "anchors are not supported: leave it out")
        if event.ctag is not None:
            self._note(path or "file", line, f"the tag {event.ctag}", "tags are not supported: leave it out")
        if kind == "ScalarEvent":
            text = self._whole(path, line, event.value)
            plain = event.style is None or event.style == ""
            return scalar(text) if plain else text
        if kind == "SequenceStartEvent":
            return self._sequence(path, depth)
        return self._mapping(path, depth)

    def _whole(self, path: str, line: int, text: str) -> str:
        """The text with its pairs of surrogates, as JSON escapes them, as characters; half a pair is a fault."""
        half = lone_surrogate(text)
        if half:
            self._note(path or "file", line, f"contains {half}, which is half of a character pair", WHOLE)
            return visible(text)
        return join_surrogates(text)

    def _sequence(self, path: str, depth: int) -> list[Any]:
        result: list[Any] = []
        for event in self._events:
            if type(event).__name__ == "SequenceEndEvent":
                break
            inner = f"{path}[{len(result)}]"
            self.lines[inner] = (self.file, event.start_mark.line + 1)
            result.append(self._value(event, inner, depth + 1))
        return result

    def _mapping(self, path: str, depth: int) -> dict[str, Any]:
        result: dict[str, Any] = {}
        for event in self._events:
            if type(event).__name__ == "MappingEndEvent":
                break
            line = event.start_mark.line + 1
            if type(event).__name__ != "ScalarEvent":
                self._note(path or "file", line, "a key is not a name", "keys must be plain names")
                self._value(event, path, depth + 1)
                self._value(next(self._events), f"{path}.?", depth + 1)
                continue
            key = self._whole(path, line, str(event.value))
            inner = f"{path}.{key}" if path else key
            if event.anchor is not None or event.ctag is not None:
                self._note(inner, line, "a key has an anchor or a tag", "keys must be plain names")
            repeated = key in result
            if repeated:
                first = self.lines[inner][1]
                self._note(inner, line, f"is given twice, first in line {first}", "remove or rename one of them")
            else:
                self.lines[inner] = (self.file, line)
            value = self._value(next(self._events), f"{inner} (again)" if repeated else inner, depth + 1)
            if not repeated:
                result[key] = value
        return result


def _line_of(error: BaseException, text: str) -> int:
    position = getattr(error, "position", None)
    return text.count("\n", 0, position) + 1 if isinstance(position, int) else 1


def describe_yaml_file(path: str | os.PathLike[str], *, allow_native: bool = False) -> Description:
    """The raw data of a model file, with the entries of all components that it adds.

    Names are looked up when the model is checked, as in Python; faults of the file itself that leave nothing to check
    (it is not YAML, too large, not a mapping) are raised at once as ModelError, others are reported with all the rest.
    FileNotFoundError or UsageError is raised where there is no such file, or no plain one.
    """
    name = as_name("path", path)
    return _describe(_text_of(name), name, _Origin(allow_native, os.path.dirname(name)))


def describe_yaml(text: str, file: str = "model.yaml") -> Description:
    """The raw data of a model file's text; ``file`` is the name that messages bear."""
    return _describe(text, file, _Origin())


class _Origin(NamedTuple):
    """Whether functions may bring code, the folder where their files lie, and the files that named this one."""

    trusted: bool = False
    folder: str = ""
    within: tuple[str, ...] = ()


def _text_of(name: str) -> str:
    with open_plain(name) as file:
        data = file.read(SIZE + 1)
    if len(data) > SIZE:
        raise ModelError([Problem("file", "is too large", f"at most {SIZE} bytes", name, 1, code="EG-TOO-LARGE")])
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ModelError(
            [Problem("file", "is not UTF-8 text", "save it as UTF-8", name, line, code="EG-FILE-DAMAGED")]
        ) from None


def _describe(text: str, file: str, origin: _Origin) -> Description:
    document = Document(text, file)
    tree = document.value
    if not isinstance(tree, Mapping):
        raise ModelError(
            [Problem("file", "is not a mapping", f"allowed keys: {', '.join(MODEL)}", file, 1, code="EG-FILE-DAMAGED")]
        )
    description = Description(lines=dict(document.lines), problems=document.problems)
    faults = Faults(description)

    def fill(raw: Mapping[str, Any], start: str, target: Description) -> None:
        for key in raw:
            if key in SECTIONS:
                _add_section(target, faults, start, key, raw[key], origin)
            elif key == "contacts" and not start:
                _add_contacts(target, faults, raw[key], origin)
            elif key not in ("initial", "guess") or not start:
                continue
            elif values := faults.mapping(f"{start}{key}", raw[key], "write names as keys"):
                target.values[key] = values

    def open_file(name: str) -> Description | None:
        return _open_part(name, file, origin, faults)

    for key, value in tree.items():
        if key not in MODEL:
            faults.add(key, "unknown key", nearest(key, MODEL, "allowed"), "EG-NAME-UNKNOWN")
        elif (
            key not in SECTIONS
            and key not in PARTS
            and key != "contacts"
            and (value is not None or not isinstance(MODEL[key], kinds.Table))
        ):
            description.values[key] = value
    fill(tree, "", description)
    if tree.get("components") is not None or tree.get("add") is not None:
        from .components import Components

        components = Components(tree.get("components"), document.lines, fill, open_file, faults)
        components.add(tree.get("add"), "", description)
        components.read_all()
        description = undotted(description)
        description.incomplete = components.incomplete
    description.problems = faults.problems
    return description


def _open_part(name: str, file: str, origin: _Origin, faults: Faults) -> Description | None:
    """The description of a file that a model file names; None where it is none, which is told."""
    within = (*origin.within, os.path.realpath(file))
    path = os.path.join(os.path.dirname(file), name)
    real = beside(file, name)
    if real in within:
        chain = ", ".join(os.path.basename(one) for one in (*within[within.index(real) :], real))
        raise UsageError(f"the file {name} adds itself: {chain}", code="EG-CIRCLE")
    try:
        result = _describe(_text_of(path), path, _Origin(origin.trusted, os.path.dirname(path), within))
    except ModelError as error:
        for problem in error.problems:
            faults.take(problem)
        return None
    for problem in result.problems:
        faults.take(problem)
    for entry in result.sections["bodies"]:  # meshes are looked up from the folder of the whole model
        for solid in entry.values.get("solids") or ():
            if isinstance(solid, dict) and isinstance(solid.get("file"), str):
                solid["file"] = os.path.join(os.path.dirname(name), solid["file"])
    return result


def _add_contacts(description: Description, faults: Faults, value: Any, origin: _Origin) -> None:
    """Take in the section ``contacts``: forces of that type."""
    forces: dict[str, Any] = {}
    for name, raw in faults.mapping("contacts", value, "write the names of the contacts as keys").items():
        if isinstance(raw, Mapping) and "type" in raw:
            faults.add(f"contacts.{name}.type", "is given in the section contacts", "leave it out", "EG-CONFLICT")
        forces[name] = {"type": "contacts", **raw} if isinstance(raw, Mapping) else raw
    _add_section(description, faults, "", "forces", forces, origin, "contacts")


def _add_section(
    description: Description, faults: Faults, start: str, section: str, value: Any, origin: _Origin, home: str = ""
) -> None:
    """Take in the entries of a section, ``home`` in the file; an empty section is one that was left out."""

    def twice(path: str) -> None:
        faults.add(f"{start}{path}", "is given in a law and beside it", "give it once", "EG-CONFLICT")

    named = faults.mapping(f"{start}{section}", value, f"write the names of the {section} as keys")
    for name, raw in named.items():
        values, place = raw, f"{section}.{name}"
        if not isinstance(raw, dict):
            key = SHORT.get(section)
            if raw is None and key == "value":
                values = {}
            elif key is not None:
                if place in description.lines:
                    description.lines[f"{place}.{key}"] = description.lines[place]
                values = {key: raw}
            else:
                path, remedy = f"{start}{home or section}.{name}", "write its keys as {key: value, ...}"
                faults.add(path, f"is not {kinds.Table.says}", remedy, "EG-TYPE")
                values = {}
        entry = description.add(section, name, values, fields_of(section, values), home, twice)
        entry.trusted, entry.folder = section == "functions" and origin.trusted, origin.folder


# -- writing -----------------------------------------------------------------------------------------------------------


def with_named_markers(description: Description) -> Description:
    """The same description in which markers that expressions speak of have names.

    Each unnamed one in use gets one, ``marker_1`` and so on; ``x(rod.at(l, 0, 0))`` in an expression is
    ``x(rod.marker_1)``.
    """
    if not description.motions:
        return description
    parts = [description.values, *(entry.values for part in description.sections.values() for entry in part)]
    uses = {name: result for name in free_names([*values_in(parts)]) if (result := Named.parse(name))}
    spoken = {label for quantity in uses.values() for label in quantity.markers}
    labels = [label for label in description.motions if label in spoken]
    if not labels:
        return description
    sections = {name: list(description.sections[name]) for name in SECTIONS}
    named = {label: _give_name(sections["bodies"], description.motions[label]) for label in labels}
    named_symbols = {
        symbol(name): symbol(str(quantity.renamed(lambda label: named.get(label, label), str)))
        for name, quantity in uses.items()
        if not named.keys().isdisjoint(quantity.markers)
    }

    def put(expression: Any) -> Any:
        return expression.xreplace(named_symbols)

    for name, entries in sections.items():
        sections[name] = [replace(entry, values=with_sympy(entry.values, put)) for entry in entries]
    values = with_sympy(description.values, put)
    return Description(values=values, sections=sections, notes=description.notes, renamed=description.renamed)


def _give_name(bodies: list[DescribedEntry], reference: Mapping[str, Any]) -> str:
    """Give a body a marker at a reference; returns how to refer to it."""
    body = reference["body"]
    place = next((k for k, entry in enumerate(bodies) if entry.name == body), None)
    if place is None:  # ground, of which nothing was said yet
        bodies.append(DescribedEntry(GROUND_NAME, {}, f"bodies.{GROUND_NAME}"))
        place = len(bodies) - 1
    entry = bodies[place]
    markers = entry.values.get("markers") or {}
    listed = list(markers.items()) if isinstance(markers, Mapping) else list(markers)
    taken = {name for name, _ in listed}
    k = 1
    while f"marker_{k}" in taken:
        k += 1
    placed = {key: value for key, value in reference.items() if key != "body"}
    bodies[place] = replace(entry, values={**entry.values, "markers": [*listed, (f"marker_{k}", placed)]})
    return f"{body}.marker_{k}"


Names = frozenset[Any]  # of declared functions
_UNKNOWN = Field("")  #: a key that is no key of its entry

_PLAIN = re.compile(r"[A-Za-z0-9_.(*+/-][A-Za-z0-9_.()*+/<>= -]*\Z")


def yaml_text(description: Description) -> str:
    """The text of a model file: YAML 1.2, sections in the order of the table of fields, one entry a line.

    SymPy expressions are written as text, and unnamed markers whose motion they use get names.  Raises UsageError for
    what has no form in a model file.
    """
    if isinstance(raw := description.values.get("equations"), Mapping):
        values = {**description.values, "equations": with_intermediates(raw)}
        description = replace(description, values=values)
    lines = [f"# {comment_text(note)}" for note in description.notes]
    description = plain_description(description)
    for key in MODEL:
        if key in SECTIONS:
            lines += _section(key, description)
        elif key in description.values:
            value = description.values[key]
            if key in ("lagrangian", "equations") and value is not None:
                lines += [f"{key}:", *(f"  {_key(k)}: {_value(v)}" for k, v in value.items())]
            elif not MODEL[key].is_default(value):
                lines.append(f"{key}: {_value(value)}")
    return "\n".join(lines) + "\n"


def _section(section: str, description: Description) -> list[str]:
    entries = description.sections[section]
    if not entries:
        return []
    short = SHORT.get(section)
    lines = [f"{section}:"]
    for entry in entries:
        fields = fields_of(section, entry.values)
        values = {key: x for key, x in entry.values.items() if not fields.get(key, _UNKNOWN).is_default(x)}
        only = short is not None and list(values) == [short]
        lines.append(f"  {_key(entry.name)}: {_value(values[short] if only and short else values)}")
    return lines


def _value(value: Any) -> str:
    if value is None:
        return "null"
    if isinstance(value, os.PathLike):
        return _text(os.fspath(value))
    if isinstance(value, bool):
        return "true" if value else "false"
    if getattr(value, "shape", None) == () and hasattr(value, "tolist"):
        value = value.tolist()
    if not isinstance(value, numbers.Real | str | Mapping | list | tuple):
        raise cannot(f"{shortened(value)} cannot be written to a model file")
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, numbers.Real):
        return str(int(value)) if isinstance(value, numbers.Integral) else repr(float(value))
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(k)}: {_value(v)}" for k, v in value.items()) + "}"
    if value and all(isinstance(x, list) and len(x) == 2 and isinstance(x[1], dict) for x in value):
        return _value(dict(value))  # named markers
    return "[" + ", ".join(_value(x) for x in value) + "]"


def _key(key: Any) -> str:
    """A name as a key, whatever it holds: names are checked when the model is."""
    name = name_of(key)
    return _text(name) if isinstance(name, str) else _value(name)


def _text(text: str) -> str:
    """A text as a plain scalar where that reads back as the same text, else in quotes."""
    plain = _PLAIN.match(text) and isinstance(scalar(text), str) and not text.endswith(" ") and ": " not in text
    if plain and not text.startswith(("- ", "---", "...", "*")) and text not in ("-", "=", "<<", "*"):
        return text
    return yaml_quoted(text)


def plain_description(raw: Description) -> Description:
    """A description without SymPy and arrays, in which markers that expressions speak of have names."""
    description = with_named_markers(undotted(raw))
    functions = frozenset(entry.name for entry in description.sections["functions"])
    sections = {
        section: [replace(entry, values=plain(entry.values, functions)) for entry in entries]
        for section, entries in description.sections.items()
    }
    return Description(
        values=plain(description.values, functions),
        sections=sections,
        instances=dict(raw.instances),
        origins=dict(raw.origins),
        bindings=list(raw.bindings),
    )


def plain(value: Any, functions: Names = frozenset()) -> Any:
    """A value as numbers, texts, lists and mappings; functions of Python stay."""
    if is_sympy(value):
        text = sympy_text(value, functions)
        return number if isinstance(number := scalar(text), int | float) else text
    if isinstance(value, Mapping):
        return {name_of(key): plain(part, functions) for key, part in value.items()}
    listed = None if isinstance(value, str) else items(value)
    return value if listed is None else [plain(part, functions) for part in listed]
