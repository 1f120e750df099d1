"""Force elements, their geometry: a scalar of the configuration, its rate, and the loads of a force along it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from ..frames import Marker
from ..graph import vectors as vec
from ..graph.core import Expr, atan2, sqrt
from .base import CoordinateLoad, Load, MarkerLoad, View


@dataclass(frozen=True)
class Path(ABC):
    """A scalar measure of the configuration."""

    @abstractmethod
    def measure(self, view: View) -> tuple[Expr, Expr]:
        """Value and rate."""

    @abstractmethod
    def loads(self, view: View, force: Expr) -> list[Load]:
        """Loads equivalent to a generalized force along increasing value: their power is force times rate."""


@dataclass(frozen=True)
class Line(Path):
    """The distance between the origins of two markers (m)."""

    start: Marker
    end: Marker

    def _geometry(self, view: View) -> tuple[vec.Vec3, Expr]:
        d = vec.sub(view.position(self.end), view.position(self.start))
        length = sqrt(vec.dot(d, d))
        return (d[0] / length, d[1] / length, d[2] / length), length

    def measure(self, view: View) -> tuple[Expr, Expr]:
        direction, length = self._geometry(view)
        relative = vec.sub(view.velocity(self.end), view.velocity(self.start))
        return length, vec.dot(direction, relative)

    def loads(self, view: View, force: Expr) -> list[Load]:
        direction, _ = self._geometry(view)
        push = vec.scale(force, direction)
        o = vec.zero(view.graph)
        return [MarkerLoad(self.end, push, o), MarkerLoad(self.start, vec.neg(push), o)]


@dataclass(frozen=True)
class Twist(Path):
    """The angle by which the end marker is turned about the z axis of the start marker (rad)."""

    start: Marker
    end: Marker

    def measure(self, view: View) -> tuple[Expr, Expr]:
        a = vec.transpose(view.rotation(self.start))  # its rows are the marker's axes
        x = vec.transpose(view.rotation(self.end))[0]
        relative = vec.sub(view.angular_velocity(self.end), view.angular_velocity(self.start))
        # with both z axes in line this is the exact rate of the angle; the element is meant for that case
        return atan2(vec.dot(a[1], x), vec.dot(a[0], x)), vec.dot(a[2], relative)

    def loads(self, view: View, force: Expr) -> list[Load]:
        axis = vec.transpose(view.rotation(self.start))[2]
        torque = vec.scale(force, axis)
        o = vec.zero(view.graph)
        return [MarkerLoad(self.end, o, torque), MarkerLoad(self.start, o, vec.neg(torque))]


@dataclass(frozen=True)
class JointCoordinate(Path):
    """One coordinate of a joint (rad or m)."""

    name: str

    def measure(self, view: View) -> tuple[Expr, Expr]:
        return view.coordinate(self.name)

    def loads(self, view: View, force: Expr) -> list[Load]:
        return [CoordinateLoad(self.name, force)]
