"""Elements, one type: its word in model files, its keys, and the function that makes an element of an entry.

The tables of types (:data:`~eomgen.forces.FORCES` ...) drive the check of model files, their JSON Schema, the methods
of Model and their documentation, so that a new type is one row, in the file of its class.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from .entry import Entry
from .kinds import Choice, Fields


class ElementType(NamedTuple):
    """A type of element.

    Attributes
    ----------
    name : str
        The word in model files, and the method of Model.
    doc : str
        What it is, in one sentence that goes on from "Add".
    keys : Fields
        Its keys besides ``type``, in the order of the method's arguments.
    read : callable
        Entry -> the element; None where the entry has a fault, which is noted.  Joints are read otherwise.
    one_of : tuple of str
        Keys of which exactly one is given.
    remedies : mapping of str to str
        What to do instead, for keys that people give something of another kind.
    ends : tuple of str
        What the arguments of the method are called that a key of two markers or joints has.
    states : callable
        The entry's values -> its first-order states, as suffixes of its name, and their units.
    """

    name: str
    doc: str
    keys: Fields
    read: Callable[[Entry], Any] | None = None
    one_of: tuple[str, ...] = ()
    remedies: Mapping[str, str] = {}
    ends: tuple[str, str] = ("a", "b")
    states: Callable[[Mapping[str, Any]], Mapping[str, str]] = lambda values: {}

    def fields(self, what: str, types: Mapping[str, Any]) -> Fields:
        """All keys, ``type`` among them."""
        return {"type": Choice(f"type of the {what}", required=True, choices=tuple(types)), **self.keys}


Types = dict[str, ElementType]


def table(*types: ElementType) -> Types:
    """Types by their names."""
    return {one.name: one for one in types}
