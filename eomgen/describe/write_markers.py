"""Stage describe, writing: unnamed markers whose motion expressions use -> named markers of their bodies.

In Python ``rod.at(l, 0, 0).position`` speaks of a marker that has no name; a model file can only speak of named ones.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from .description import GROUND_NAME, SECTIONS, DescribedEntry, Description, items
from .marker_quantities import marker_quantity
from .sympy_face import free_names, is_sympy, symbol


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
    uses = {name: found for name in sorted(_names(parts)) if (found := marker_quantity(name))}
    spoken = {label for quantity in uses.values() for label in quantity.markers}
    labels = [label for label in description.motions if label in spoken]
    if not labels:
        return description
    sections = {name: list(description.sections[name]) for name in SECTIONS}
    named = {label: _name(sections["bodies"], description.motions[label]) for label in labels}
    named_symbols = {
        symbol(name): symbol(str(quantity.renamed(lambda label: named.get(label, label))))
        for name, quantity in uses.items()
        if not named.keys().isdisjoint(quantity.markers)
    }
    for name, entries in sections.items():
        sections[name] = [
            DescribedEntry(entry.name, _replaced(entry.values, named_symbols), entry.path, entry.trusted, entry.folder)
            for entry in entries
        ]
    values = _replaced(description.values, named_symbols)
    return Description(values=values, sections=sections, notes=description.notes, renamed=description.renamed)


def _name(bodies: list[DescribedEntry], reference: Mapping[str, Any]) -> str:
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
    bodies[place] = DescribedEntry(
        entry.name,
        {**entry.values, "markers": [*listed, (f"marker_{k}", placed)]},
        entry.path,
        entry.trusted,
        entry.folder,
    )
    return f"{body}.marker_{k}"


def _names(value: Any) -> Iterator[str]:
    """Names of the symbols in everything that a value holds."""
    if is_sympy(value):
        yield from free_names([value])
    elif isinstance(value, Mapping):
        for part in value.values():
            yield from _names(part)
    elif not isinstance(value, str) and (parts := items(value)) is not None:
        for part in parts:
            yield from _names(part)


def _replaced(value: Any, symbols: Mapping[Any, Any]) -> Any:
    """A value with other symbols in its expressions."""
    if is_sympy(value):
        return value.xreplace(symbols)
    if isinstance(value, Mapping):
        return {key: _replaced(part, symbols) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return type(value)(_replaced(part, symbols) for part in value)
    parts = None if isinstance(value, str) else items(value)
    return value if parts is None else [_replaced(part, symbols) for part in parts]
