"""Elements, one entry: what the function that reads a type of element may ask of an entry of a model file.

The reader itself is :class:`~eomgen.describe.element_entry.ElementEntry`; elements know this much of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from ..base.value_rules import Allowed
from ..frames import Marker
from ..graph.core import Expr, Graph
from .kinds import Field, Fields


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
