"""Constraint elements: drivers, which prescribe a measure of the configuration as a function of time.

measure(q) - value(t) = 0 (Shabana, Computational Dynamics, sec. 3.3; Haug, Computer Aided Kinematics and Dynamics of
Mechanical Systems, sec. 3.5); velocity and acceleration follow from the derivatives of the value.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

from ..frames import Marker
from ..graph import vectors as vec
from ..graph.core import Expr, sqrt
from ..graph.vectors import Vec3
from ..records import dataclass
from .base import Condition, Constraint, View


@dataclass(frozen=True)
class Driver(Constraint):
    """A measure that follows ``value``, an expression of t and parameters; its row is called ``<name>.motion``."""

    value: Expr

    @abstractmethod
    def measure(self, view: View) -> tuple[Expr, str]:
        """What is driven, and its kind: 'length' or 'angle'."""

    def conditions(self, view: View) -> list[Condition]:
        measure, kind = self.measure(view)
        return [Condition("motion", measure - self.value, kind)]


@dataclass(frozen=True)
class CoordinateDriver(Driver):
    """The coordinate of a joint."""

    type_name: ClassVar[str] = "driver"
    coordinate: Expr
    kind: str

    def measure(self, view: View) -> tuple[Expr, str]:
        return self.coordinate, self.kind

    def hints(self, view: View) -> list[tuple[Expr, Expr]]:
        return [(self.coordinate, self.value)]


@dataclass(frozen=True)
class DistanceDriver(Driver):
    """The distance between the origins of two markers, which must not meet."""

    type_name: ClassVar[str] = "driver_distance"
    start: Marker
    end: Marker

    def measure(self, view: View) -> tuple[Expr, str]:
        d = view.relative(self.start, self.end).position
        return sqrt(vec.dot(d, d)), "length"


@dataclass(frozen=True)
class PlaceDriver(Driver):
    """The place of a marker's origin along ``axis``, a unit vector in the axes of marker ``on``, from its origin."""

    type_name: ClassVar[str] = "driver_place"
    marker: Marker
    axis: Vec3
    on: Marker

    def measure(self, view: View) -> tuple[Expr, str]:
        return vec.dot(self.axis, view.relative(self.on, self.marker).position), "length"


@dataclass(frozen=True)
class AngleDriver(Driver):
    """The turn of one marker about the z axis of another; the two z axes stay in line."""

    type_name: ClassVar[str] = "driver_angle"
    start: Marker
    end: Marker

    def measure(self, view: View) -> tuple[Expr, str]:
        return view.turn(self.start, self.end)[0], "angle"

    def is_defined(self, view: View) -> bool:
        return view.turn(self.start, self.end)[2]
