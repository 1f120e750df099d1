"""Elements, one type: its word in model files, its keys, and the function that makes an element of an entry.

The tables of types (:data:`~eomgen.forces.FORCES` ...) drive the check of model files, their JSON Schema, the methods
of Model and their documentation, so that a new type is one row, in the file of its class.  The keys of most are fields
of their class, which :func:`key` marks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from .entry import Entry
from .kinds import Choice, Field, Fields


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


class Where(NamedTuple):
    """What an element acts on: keys before and behind those of its law, and how they are read together."""

    keys: Fields
    read: Callable[[Entry], Any]  #: None where anything is at fault
    behind: Mapping[str, Field] = {}
    one_of: tuple[str, ...] = ()


def key(field: Field) -> Any:
    """A field of an element's class that is a key of its entries."""
    return field


def keys_of(element: type) -> Fields:
    """The keys that are fields of a class, those of its bases first."""
    fields = [(name, x) for base in reversed(element.__mro__) for name, x in vars(base).items()]
    return {name: x for name, x in fields if isinstance(x, Field)}


def element(
    kind: type, name: str, doc: str, where: Where | None = None, keys: Fields | None = None, **more: Any
) -> ElementType:
    """The type of elements whose fields are read from their keys one by one, in this order.

    Parameters
    ----------
    kind : type
        The class: name, what it acts on (with ``where``), its keys.
    name, doc : str
        As of :class:`ElementType`.
    where : Where, optional
    keys : Fields, optional
        Other keys for the same fields, in their order.
    **more
        What else an ElementType has.
    """
    own = keys_of(kind) if keys is None else keys

    def read(e: Entry) -> Any:
        values = [*([] if where is None else [where.read(e)]), *(e[one] for one in own)]
        needed = [True] * (where is not None) + [x.required or x.default is not None for x in own.values()]
        missing = any(value is None and need for value, need in zip(values, needed, strict=True))
        return None if missing else kind(e.name, *values)

    more = {"read": read, **({} if where is None else {"one_of": where.one_of}), **more}
    return ElementType(name, doc, own if where is None else {**where.keys, **own, **where.behind}, **more)
