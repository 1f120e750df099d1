"""Description -> the text of a model file that reads back as the same model."""

from __future__ import annotations

import numbers
import os
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ..base.texts import comment_text, yaml_quoted
from ..elements.kinds import Field, items
from ..errors import cannot
from .description import GROUND_NAME, SECTIONS, DescribedEntry, Description
from .fields import MODEL, SHORT, fields_of
from .quantities import Named
from .sympy_face import free_names, is_sympy, name_of, symbol, values_in, with_sympy
from .visit import undotted
from .yaml_file import scalar


def with_named_markers(description: Description) -> Description:
    """The same description in which markers that expressions speak of have names.

    Parameters
    ----------
    description : Description
        Stays as it is.

    Returns
    -------
    Description
        With a named marker, ``marker_1`` and so on, for each unnamed one in use; ``x(rod.at(l, 0, 0))`` in an
        expression is ``x(rod.marker_1)``.
    """
    if not description.motions:
        return description
    parts = [description.values, *(entry.values for part in description.sections.values() for entry in part)]
    uses = {name: found for name in free_names([*values_in(parts)]) if (found := Named.parse(name))}
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
    """The text of a model file.

    Parameters
    ----------
    description : Description
        SymPy expressions in it are written as text; unnamed markers whose motion they use get names.

    Returns
    -------
    str
        YAML 1.2, sections in the order of the table of fields, one entry a line.

    Raises
    ------
    UsageError
        An expression or value has no form in a model file.
    """
    description = with_named_markers(undotted(description))
    lines = [f"# {comment_text(note)}" for note in description.notes]
    functions = frozenset(entry.name for entry in description.sections["functions"])
    for key in MODEL:
        if key in SECTIONS:
            lines += _section(key, description)
        elif key in description.values:
            value = description.values[key]
            if key == "equations" and isinstance(value, Mapping):
                from .sympy_text import with_intermediates

                value = with_intermediates(value)
            if key in ("lagrangian", "equations") and value is not None:
                lines += [f"{key}:", *(f"  {_key(k)}: {_value(v, functions)}" for k, v in value.items())]
            elif not MODEL[key].is_default(value):
                lines.append(f"{key}: {_value(value, functions)}")
    return "\n".join(lines) + "\n"


def _section(section: str, description: Description) -> list[str]:
    entries = description.sections[section]
    functions = frozenset(entry.name for entry in description.sections["functions"])
    if not entries:
        return []
    short = SHORT.get(section)
    lines = [f"{section}:"]
    for entry in entries:
        fields = fields_of(section, entry.values)
        values = {key: x for key, x in entry.values.items() if not fields.get(key, _UNKNOWN).is_default(x)}
        only = short is not None and list(values) == [short]
        lines.append(f"  {_key(entry.name)}: {_value(values[short] if only and short else values, functions)}")
    return lines


def _value(value: Any, functions: Names) -> str:
    if value is None:
        return "null"
    if isinstance(value, os.PathLike):
        return _text(os.fspath(value))
    if isinstance(value, bool):
        return "true" if value else "false"
    if getattr(value, "shape", None) == () and hasattr(value, "tolist"):
        value = value.tolist()
    if not isinstance(value, numbers.Real | str | Mapping | list | tuple):
        listed = items(value)
        if listed is not None:
            return _value(listed, functions)
        if is_sympy(value):
            return _sympy(value, functions)
        from ..expr.shown import shortened

        raise cannot(f"{shortened(value)} cannot be written to a model file")
    if is_sympy(value):
        return _sympy(value, functions)
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, numbers.Real):
        return str(int(value)) if isinstance(value, numbers.Integral) else repr(float(value))
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(k)}: {_value(v, functions)}" for k, v in value.items()) + "}"
    if value and all(isinstance(x, tuple) and len(x) == 2 and isinstance(x[1], dict) for x in value):
        return _value(dict(value), functions)  # named markers
    return "[" + ", ".join(_value(x, functions) for x in value) + "]"


def _key(key: Any) -> str:
    """A name as a key, whatever it holds: names are checked when the model is."""
    name = name_of(key)
    return _text(name) if isinstance(name, str) else _value(name, frozenset())


def _sympy(value: Any, functions: Names) -> str:
    from .sympy_text import sympy_text

    text = sympy_text(value, functions)
    return text if isinstance(scalar(text), int | float) else _text(text)


def _text(text: str) -> str:
    """A text as a plain scalar where that reads back as the same text, else in quotes."""
    plain = _PLAIN.match(text) and isinstance(scalar(text), str) and not text.endswith(" ") and ": " not in text
    if plain and not text.startswith(("- ", "---", "...", "*")) and text not in ("-", "=", "<<", "*"):
        return text
    return yaml_quoted(text)


def plain_description(given: Description) -> Description:
    """A description without SymPy and arrays, in which markers that expressions speak of have names."""
    description = with_named_markers(undotted(given))
    functions = frozenset(entry.name for entry in description.sections["functions"])
    sections = {
        section: [replace(entry, values=plain(entry.values, functions)) for entry in entries]
        for section, entries in description.sections.items()
    }
    values, origins = plain(description.values, functions), dict(given.origins)
    return Description(values=values, sections=sections, instances=dict(given.instances), origins=origins)


def plain(value: Any, functions: Names = frozenset()) -> Any:
    """A value as numbers, texts, lists and mappings; functions of Python stay."""
    if is_sympy(value):
        from .sympy_text import sympy_text

        return sympy_text(value, functions)
    if isinstance(value, Mapping):
        return {name_of(key): plain(part, functions) for key, part in value.items()}
    listed = None if isinstance(value, str) else items(value)
    return value if listed is None else [plain(part, functions) for part in listed]
