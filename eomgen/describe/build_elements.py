"""Stage describe, elements: entries of the sections of forces and constraints -> the elements themselves."""

from __future__ import annotations

from typing import Any

from ..elements.element_type import Types
from .checks import check_names
from .description import DescribedEntry
from .element_entry import ElementEntry, Surroundings


def build_elements(around: Surroundings, what: str, entries: list[DescribedEntry], types: Types) -> tuple[Any, ...]:
    """Elements of all entries without faults; the faults are noted."""
    made = [_build(ElementEntry(around, e), what, types) for e in check_names(entries, what, around.reader.faults)]
    return tuple(element for element in made if element is not None)


def _build(e: ElementEntry, what: str, types: Types) -> Any:
    found = e.type_of(what, types)
    element = None if found is None or found.read is None else found.read(e)
    return None if e.at_fault() else element
