"""What Python calls and model files both fill, in the layout of the model file.

A :class:`Description` is plain data: sections of named entries whose values are numbers, texts, sequences, mappings or
SymPy expressions as the user gave them.  Nothing is looked up or judged here; that is done by
:mod:`~eomgen.model.build_mechanism`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ..base.texts import html_text
from ..elements.element_type import sort_laws
from ..elements.kinds import Fields, Table
from ..elements.kinds import is_zero as is_zero
from ..elements.kinds import items as items
from ..errors import Problem, cannot
from ..expr.texts import NO_TEXT, printed, shortened

GROUND_NAME = "ground"

#: Sections made of named entries, in the order of a model file.
SECTIONS = (
    *("parameters", "inputs", "functions", "bodies", "joints", "forces", "constraints", "states", "outputs", "events"),
)

Values = dict[str, Any]


@dataclass
class DescribedEntry:
    """One named thing of a section; ``path`` is its dotted place.

    ``trusted`` tells whether it may bring code of its own, ``folder`` where its relative file names start.
    """

    name: Any
    values: Values
    path: str
    trusted: bool = True
    folder: str = ""


class Origin(NamedTuple):
    """Where an entry that an instance of a component brought comes from, or a marker in the place of an attachment.

    ``place`` is the dotted path of the entry in the component, ``instance`` the name of the instance (``leg1``, or
    ``leg1.knee``), ``prefix`` what stands before its names; of a marker the path where the instance gives it alone.
    """

    place: str
    instance: str
    prefix: str


class Binding(NamedTuple):
    """An expression that takes the place of a parameter or an input of a component; ``path`` is where it stands."""

    path: str
    instance: str
    text: str
    unit: Any  #: of the parameter or input


@dataclass
class Description:
    """Everything said about a model so far, and where."""

    #: What stands outside the sections: name, doc, gravity, independent, initial, guess, simulation, lagrangian.
    values: Values = field(default_factory=dict)
    #: One list for each of :data:`SECTIONS`, in the order of the description; names may still repeat.
    sections: dict[str, list[DescribedEntry]] = field(default_factory=lambda: {name: [] for name in SECTIONS})
    #: Label of an unnamed marker whose motion is used -> its reference (a mapping of body, at, rpy).
    motions: dict[str, Values] = field(default_factory=dict)
    lines: dict[str, tuple[str, int]] = field(default_factory=dict)  #: dotted path -> (file, line)
    written_paths: dict[str, str] = field(default_factory=dict)  #: dotted path -> as the user wrote it, if otherwise
    problems: list[Problem] = field(default_factory=list)  #: faults of what the description was made from
    notes: list[str] = field(default_factory=list)  #: what an import left out or changed
    #: Section -> name in an imported file, or in SymPy -> name in the model, where they differ.
    renamed: dict[str, dict[str, str]] = field(default_factory=dict)
    instances: dict[str, str] = field(default_factory=dict)  #: instance of a component -> prefix: ``leg1`` -> ``leg1_``
    #: Path of an entry that an instance brought, or of a marker in it -> where it comes from.
    origins: dict[str, Origin] = field(default_factory=dict)
    bindings: list[Binding] = field(default_factory=list)  #: of instances of components
    absent: set[str] = field(default_factory=set)  #: bodies that are not there, in the place of wrong attachments
    incomplete: bool = False  #: whether instances could not be added, so that names are missing

    def add(
        self,
        section: str,
        name: Any,
        values: Values,
        keys: Fields | None = None,
        home: str = "",
        twice: Callable[[str], None] = lambda path: None,
    ) -> DescribedEntry:
        """Append an entry to a section; of ``keys`` those of laws are put into their laws.

        ``home`` is the section in which the user wrote it, if another; ``twice`` takes the path of a key given twice.
        """
        path = f"{section}.{shortened(name)}"
        if home:
            self.written_paths[path] = f"{home}.{shortened(name)}"
        start = as_written(path, self.written_paths)
        values, places = sort_laws(keys or {}, values, lambda key: twice(f"{start}.{key}"))
        self.written_paths.update((f"{path}.{key}", f"{start}.{place}") for key, place in places.items())
        entry = DescribedEntry(name, values, path)
        self.sections[section].append(entry)
        return entry

    def declare(self, parameters: Mapping[str, Any], inputs: Mapping[str, Any], used: Sequence[str]) -> None:
        """Declare inputs and parameters with their values, None for none, and what else is used as parameters."""
        for name in dict.fromkeys((*parameters, *used)):
            value = parameters.get(name)
            self.add("parameters", name, {} if value is None else {"value": value})
        for name, value in inputs.items():
            self.add("inputs", name, {} if value is None else {"value": value})

    def note_renamed(self, renamed: dict[str, dict[str, str]]) -> None:
        """Keep the names that an import changed, and note them."""
        self.renamed = renamed
        for section, names in renamed.items():
            self.notes.append(f"renamed {section}: " + ", ".join(f"{old!r} is {new}" for old, new in names.items()))

    def place(self, path: str) -> tuple[str, int]:
        """File and line of a dotted path; ``("", 0)`` if the model comes from no file."""
        return place_of(as_written(path, self.written_paths), self.lines)


def as_written(path: str, written: Mapping[str, str]) -> str:
    """A dotted path as the user wrote it."""
    start = path
    while written and start:
        if start in written:
            return written[start] + path[len(start) :]
        start = parent_of(start)
    return path


def place_of(path: str, lines: Mapping[str, tuple[str, int]]) -> tuple[str, int]:
    """File and line of a dotted path, or of the nearest enclosing one; ``("", 0)`` if there is none."""
    while True:
        result = lines.get(path)
        if result is not None:
            return result
        if not path:
            return ("", 0)
        path = parent_of(path)


_LAST_PART = re.compile(r"(\.[^.\[]*|\[\d+\])\Z")


def parent_of(path: str) -> str:
    """The path without its last key or index; empty for a path of one part."""
    shorter = _LAST_PART.sub("", path)
    return shorter if shorter != path else ""


class Faults:
    """Collects the problems of one description, with the file and line of each."""

    def __init__(self, description: Description) -> None:
        self.lines, self.origins, self.written_paths = description.lines, description.origins, description.written_paths
        self.absent = description.absent
        self.problems: list[Problem] = []
        self._seen: set[Problem] = set()
        self._paths: set[str] = set()
        for problem in description.problems:
            self.take(problem)

    def add(self, path: str, message: str, remedy: str = "", code: str = "") -> None:
        """Note a fault at a dotted path."""
        place = as_written(path, self.written_paths)
        self.take(Problem(place, message, remedy, *place_of(place, self.lines), code))
        self._mark(path)

    def mapping(self, path: str, value: Any, remedy: str) -> Mapping[Any, Any]:
        """A value, if it is a mapping, else an empty one; noted unless it is None."""
        if value is not None and not isinstance(value, Mapping):
            self.add(path, f"is not {Table.says}", remedy, "EG-TYPE")
        return value if isinstance(value, Mapping) else {}

    def missing(self, path: str, remedy: str) -> None:
        """Note that something is missing."""
        self.add(path, "is missing", remedy, "EG-MISSING")

    def take(self, problem: Problem) -> None:
        """Note a fault whose file and line are known; one that was noted already counts once."""
        if problem in self._seen:
            return
        self._seen.add(problem)
        self.problems.append(problem)
        self._mark(problem.path)

    def _mark(self, path: str) -> None:
        while path and path not in self._paths:
            self._paths.add(path)
            path = parent_of(path)

    def __len__(self) -> int:
        return len(self.problems)

    def under(self, path: str) -> bool:
        """Whether a fault was noted at a path or inside it."""
        return path in self._paths

    def sorted(self) -> list[Problem]:
        """All problems; those of a file in the order of its lines, one of several instances once."""
        return list_names_once(sorted(self._merge_instances(), key=lambda p: (p.file, p.line)))

    def _merge_instances(self) -> list[Problem]:
        """Problems of what instances brought, at the entry of the component, with the names of the instances.

        Those of a marker or an expression that an instance has are there, and those that follow from them are left out.
        """
        absent = [repr(name) for name in self.absent]
        problems = [problem for problem in self.problems if not any(name in problem.message for name in absent)]
        places = [(problem, *self.origin_of(problem.path)) for problem in problems]
        attached = [(o.place, problem.message) for problem, _, o in places if o is not None and not o.instance]
        result: dict[Any, tuple[Problem, list[str]]] = {}
        for problem, path_of, origin in places:
            if origin is None:
                result[problem] = (problem, [])
            elif not origin.instance:
                path = origin.place + problem.path[len(path_of) :]
                result.setdefault((path, problem.message), (problem._replace(path=path), []))
            elif not any(_gives(origin, place) and problem.message.startswith(message) for place, message in attached):
                path = origin.place + problem.path[len(path_of) :]
                alike = problem.message.replace(origin.prefix, "") if origin.prefix else problem.message
                first = problem._replace(path=path)
                result.setdefault((path, alike, *problem[3:]), (first, []))[1].append(origin.instance)
        return [p._replace(message=p.message + _in_instances(names)) if names else p for p, names in result.values()]

    def names_at(self, path: str, names: Iterable[str]) -> list[str]:
        """The names as an entry may write them: of one that an instance brought, those of its component."""
        origin = self.origin_of(path)[1]
        prefix = "" if origin is None else origin.prefix
        return [name.removeprefix(prefix) for name in names if name.startswith(prefix) or name in (GROUND_NAME, "t")]

    def origin_of(self, path: str) -> tuple[str, Origin | None]:
        """The part of a path that an instance brought, and where that comes from."""
        while path and path not in self.origins:
            path = parent_of(path)
        return path, self.origins.get(path)


def _gives(origin: Origin, place: str) -> bool:
    """Whether a place is one where an instance that an entry is in, or its row of instances, is given something."""
    names = {name for part in origin.instance.split(".") for name in (part, part.rstrip("0123456789"))}
    return any(f"add.{name}." in place for name in names)


def list_names_once(problems: Sequence[Problem]) -> list[Problem]:
    """The same problems, of which only the first that lists certain names does so; the others refer to it."""
    seen: set[str] = set()
    result = []
    for problem in problems:
        for names in _LISTED.findall(problem.remedy):
            if names in seen:
                problem = problem._replace(remedy=problem.remedy.replace(names, "those listed above", 1))
            seen.add(names)
        result.append(problem)
    return result


#: Four names or more behind what they are: ``bodies: ground, rod, ...``.
_LISTED = re.compile(r"(?<=: )(?:[\w.]+, ){3,}[\w.]+")


def _in_instances(names: Sequence[str]) -> str:
    listed = ", ".join(names[:3])
    return f" (in {listed} and {len(names) - 3} more)" if len(names) > 3 else f" (in {listed})"


def text_of(value: Any) -> str:
    """A value as it is shown in labels: numbers exactly, expressions as written."""
    if isinstance(value, float):
        return repr(float(value))
    listed = items(value)
    if listed is not None:
        return "(" + ", ".join(text_of(x) for x in listed) + ")"
    return printed(value)


def label_of(reference: Mapping[str, Any]) -> str:
    """The label of an unnamed marker, e.g. ``crank.at(r, 0, 0)``."""
    at = reference.get("at", (0, 0, 0))
    text = text_of(at)
    if not text.startswith("("):
        text = f"({text})"
    turn = items(reference.get("rpy"))
    if turn is not None and not is_zero(turn):
        text = f"{text[:-1]}, rpy={text_of(turn)})"
    for key in ("axes", "matrix", "on"):
        if key in reference:
            text = f"{text[:-1]}, {key}={text_of(reference[key])})"
    if NO_TEXT in text:  # two such markers would bear one label
        raise cannot(
            f"the place of an unnamed marker of {printed(reference.get('body'))} cannot be written as a text; name the "
            "marker"
        )
    return f"{reference.get('body')}.at{text}"


# -- as a table in notebooks -------------------------------------------------------------------------------------------


LONG = 40  #: rows of a table more than which it is folded up


def reference_text(value: Any) -> str:
    """A body, marker or joint as it is shown."""
    if isinstance(value, Mapping):
        return label_of(value)
    listed = items(value)
    return text_of(value) if listed is None else " to ".join(reference_text(x) for x in listed)


def _summary(entry: DescribedEntry) -> str:
    parts = []
    for key, value in entry.values.items():
        if key == "markers":
            names = list(value) if isinstance(value, Mapping) else [name for name, _ in value]
            parts.append("markers " + ", ".join(map(printed, names)))
        elif entry.path.startswith("functions.") and key in ("x", "y", "z"):
            parts.append(f"{len(items(value) or ())} {key}")
        elif key in ("display", "solids") and all(isinstance(one, Mapping) for one in items(value) or ("",)):
            kinds = (text_of(one.get("shape", one.get("type"))) for one in items(value) or ())
            parts.append(f"{key} " + ", ".join(kinds))
        elif key in ("type", "value", "expression"):
            parts.append(text_of(value))
        elif key in ("between", "marker", "body", "joint"):
            parts.append(reference_text(value))
        elif isinstance(value, Mapping):
            parts.append(f"{key} " + ", ".join(f"{k} {text_of(v)}" for k, v in value.items()))
        elif text_of(value) not in ("", "z", "(0, 0, 0)"):
            parts.append(f"{key} {text_of(value)}")
    return "; ".join(parts)


def model_html(description: Description) -> str:
    """The model as an HTML table, one row an entry."""
    name = printed(description.values.get("name", ""))
    rows = [f"<tr><th colspan='3' style='text-align:left'>Model {html_text(name)}</th></tr>"]
    lagrangian = description.values.get("lagrangian")
    if isinstance(lagrangian, Mapping):
        text = text_of(lagrangian.get("expression"))
        rows.append(f"<tr><td>Lagrangian</td><td></td><td>{html_text(text)}</td></tr>")
    equations = description.values.get("equations")
    if isinstance(equations, Mapping):
        names = ", ".join(text_of(q) for q in items(equations.get("coordinates")) or ())
        rows.append(f"<tr><td>equations</td><td></td><td>of {html_text(names)}</td></tr>")
    for section, entries in description.sections.items():
        for k, entry in enumerate(entries):
            first = section if k == 0 else ""
            rows.append(
                f"<tr><td>{first}</td><td>{html_text(printed(entry.name))}</td>"
                f"<td style='text-align:left'>{html_text(_summary(entry))}</td></tr>"
            )
    table = f"<table>{''.join(rows)}</table>"
    if len(rows) <= LONG:
        return table
    counts = ", ".join(f"{len(entries)} {section}" for section, entries in description.sections.items() if entries)
    return f"<details><summary>{html_text(name)}: {counts}</summary>{table}</details>"
