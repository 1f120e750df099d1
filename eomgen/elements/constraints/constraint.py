"""Constraint elements: each a frozen class holding graph expressions and markers, asked for conditions that must hold.

An element sees the mechanism's motion through a :class:`ConstraintView`, which the kinematics stage provides.
Coordinates are held as symbols under their own names; the kinematics stage replaces those of cut joints.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple, Protocol

from ...base.records import dataclass
from ...expr.core import Expr
from ..element_type import Entry
from ..frames import Frame, Marker, MotionView
from ..looks import Seen

POSITION, VELOCITY = "position", "velocity"


class ConstraintView(MotionView, Protocol):
    """Motion of markers against each other too."""

    def relative(self, start: Marker, end: Marker) -> Frame:
        """Placement of ``end`` in the axes of ``start``."""
        ...


class Condition(NamedTuple):
    """One equation ``expression = 0``.

    ``kind`` is 'length' (m, or m/s) or 'angle' (rad, a ratio, or rad/s).  ``level`` is 'position' for an equation of
    coordinates, or 'velocity' for one that is linear in velocities and cannot be integrated (nonholonomic).
    """

    label: str
    expression: Expr
    kind: str
    level: str = POSITION


@dataclass(frozen=True)
class Constraint(ABC):
    """A constraint element.  ``name`` is the user's; a subclass adds its coordinates, markers and dimensions.

    ``sentence`` and ``formula`` (LaTeX) say its condition, for readers.
    """

    sentence: ClassVar[str] = "A condition between coordinates, or between motions of markers."
    formula: ClassVar[str] = r"C(q,t) = 0"
    type_name: ClassVar[str]
    written: ClassVar[bool] = False  #: whether factors in the equations are the user's, and may have any size
    name: str

    @abstractmethod
    def conditions(self, view: ConstraintView) -> list[Condition]:
        """The equations this element adds."""

    def drawn(self) -> list[Seen]:
        """What is to be seen of it in a picture; nothing unless a type says so."""
        return []

    def aligned(self, view: ConstraintView) -> list[Expr]:
        """Expressions that must be positive: the equations alone also admit contact from the wrong side."""
        return []

    def is_defined(self, view: ConstraintView) -> bool:
        """Whether the angle it is about is defined everywhere."""
        return True

    def hints(self, view: ConstraintView) -> list[tuple[Expr, Expr]]:
        """Where assembly may look for a coordinate of the element's own: (its symbol, a value near by)."""
        return []


def on_two_bodies(e: Entry, key: str, a: Marker, b: Marker) -> bool:
    """Whether two markers are on different bodies, which is noted where they are not."""
    if a.body == b.body:
        remedy = "choose a marker on another body for one of them"
        e.fault(key, f"{a.label} and {b.label} are on the same body", remedy, "EG-REFERENCE")
    return a.body != b.body
