"""Elements: a type (its word in model files, its keys, its reader), and what a reader may ask of an entry.

The tables of types (:data:`~.forces.FORCES` ...) drive the check of model files, their JSON Schema, the methods
of Model and their documentation, so that a new type is one row, in the file of its class.  The keys of most are fields
of their class, which :func:`key` marks.  The reader of entries is :class:`~eomgen.model.element_entry.ElementEntry`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from ..base.value_rules import Allowed
from ..expr.core import Expr, Graph
from .frames import Marker
from .kinds import Choice, Field, Fields


class Found(NamedTuple):
    """A coordinate: its name, 'angle', 'length' or 'parameter', and its joint (None: a bare Lagrangian's own)."""

    name: str
    kind: str
    joint: str | None


class Meaning(NamedTuple):
    """What a name in an expression stands for.

    ``kind`` is a word such as coordinate, velocity, parameter, time, marker (its motion), energy, reaction or
    multiplier; ``level`` counts derivatives of motions, None of other things; ``measure`` is 'length' or 'angle' of
    motions.
    """

    kind: str
    level: int | None = None
    measure: str = ""


class Entry(Protocol):
    """An entry on its way to an element.

    Every method reads one key, notes what is wrong with it as a fault of that key, and returns None or a stand-in then,
    so that one pass finds all faults.
    """

    name: str
    values: dict[str, Any]  #: what the user gave, by key
    fields: Fields  #: the keys of its type
    graph: Graph
    stand_in: Expr  #: in place of an expression that is at fault

    # -- faults ---------------------------------------------------------------------------------------------------
    def fault(self, key: str, message: str, remedy: str = "", code: str = "EG-CONFLICT") -> None:
        """Note a fault of one key, or of the entry as a whole (``""``)."""

    def missing(self, key: str, remedy: str) -> None:
        """Note that a key is missing."""

    def at_fault(self, key: str = "") -> bool:
        """Whether a fault of the key, or any, has been noted."""

    def refuse(self, key: str, why: str) -> None:
        """Note a key that has no meaning beside the others, if it is given."""

    def require(self, key: str, value: Expr, allowed: Allowed, rule: str, message: str = "") -> None:
        """Require an expression in a range, at the declared values of parameters and at those given later.

        ``rule`` says what is allowed; ``{:g}`` in a ``message`` of its own stands for the number.
        """

    def judge(
        self, key: str, rule: str, values: Sequence[Expr], data: Sequence[Any] = (), local: Sequence[str] = ()
    ) -> None:
        """Require that expressions keep a rule of :mod:`~eomgen.base.value_rules`, in the same way.

        ``data`` is what the rule takes beside them, ``local`` the names that stand for the points at which it looks.
        """

    # -- values ---------------------------------------------------------------------------------------------------
    def __getitem__(self, key: str) -> Any:
        """What a key holds, or its default, read by its kind."""

    def read(self, key: str, kind: type[Field] | None = None) -> Any:
        """The same, read as if the key was of another kind."""

    def law(self, key: str, local: Mapping[str, Expr], exclusive: bool = True) -> Expr:
        """An expression with names that it alone knows; with ``exclusive`` none may be a name of the model too."""

    def pair(self, key: str = "between") -> tuple[Marker, Marker] | None:
        """Two markers."""

    def positive(self, key: str) -> Expr:
        """An expression that must be greater than 0."""

    def states(self) -> tuple[Expr, ...]:
        """The symbols of its own first-order states, in the order in which its type names them."""

    # -- coordinates and names ------------------------------------------------------------------------------------
    def symbol(self, found: Found) -> Expr:
        """The symbol of a coordinate."""

    def velocities(self, key: str) -> tuple[tuple[str, Expr, str], ...] | None:
        """The velocities of a joint, or of one coordinate: the name, the symbol, and 'angle' or 'length'."""

    def require_one_carrier(self, key: str, a: Found, b: Found) -> None:
        """Note two coordinates that are measured from different bodies."""

    def carrier(self, coordinate: Found) -> int | None:
        """The body from which a coordinate is measured, bodies that are welded together counting as one."""

    def carried(self, coordinate: Found) -> int | None:
        """The body that a coordinate moves."""

    def meaning(self, name: str) -> Meaning:
        """What a name in an expression stands for."""

    def known(self, kind: str) -> list[str]:
        """The model's names of a kind."""

    def table_kind(self, function: str) -> str | None:
        """The kind of a function that is a table."""

    def contact_point(self, axis: Marker) -> tuple[Marker, Expr] | None:
        """A massless body about a marker's axis, whose x axis points to a contact, and the angle that turns it."""


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
