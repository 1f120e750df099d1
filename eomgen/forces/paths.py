"""Force elements, their geometry: a scalar of the configuration, its rate, and the loads of a force along it."""

from __future__ import annotations

from abc import ABC, abstractmethod

from ..frames import Marker
from ..graph import vectors as vec
from ..graph.core import Expr, sqrt
from ..graph.vectors import Vec3
from ..records import dataclass
from .base import CoordinateLoad, Load, MarkerLoad, View


@dataclass(frozen=True)
class Path(ABC):
    """A scalar measure of the configuration."""

    @abstractmethod
    def measure(self, view: View) -> tuple[Expr, Expr]:
        """Value and rate."""

    def is_exact(self, view: View) -> bool:
        """Whether the loads of a force that depends on the value alone derive from a potential."""
        return True

    @abstractmethod
    def loads(self, view: View, force: Expr) -> list[Load]:
        """Loads equivalent to a generalized force along increasing value: their power is force times rate."""


@dataclass(frozen=True)
class Line(Path):
    """The distance between the origins of two markers (m)."""

    start: Marker
    end: Marker

    def reach(self, view: View) -> Vec3:
        """From start to end, ground axes (m)."""
        return vec.sub(view.position(self.end), view.position(self.start))

    def _geometry(self, view: View) -> tuple[Vec3, Expr]:
        d = self.reach(view)
        length = sqrt(vec.dot(d, d))
        return (d[0] / length, d[1] / length, d[2] / length), length

    def measure(self, view: View) -> tuple[Expr, Expr]:
        direction, length = self._geometry(view)
        relative = vec.sub(view.velocity(self.end), view.velocity(self.start))
        return length, vec.dot(direction, relative)

    def loads(self, view: View, force: Expr) -> list[Load]:
        direction, _ = self._geometry(view)
        return self.pair(view, vec.scale(force, direction))

    def pair(self, view: View, push: Vec3) -> list[Load]:
        """A force (ground axes) on the end marker and its reaction on the start marker."""
        o = vec.zero(view.graph)
        return [MarkerLoad(self.end, push, o), MarkerLoad(self.start, vec.neg(push), o)]


@dataclass(frozen=True)
class Turn(Path):
    """The angle by which the end marker is turned about the z axis of the start marker (rad).

    Meant for markers whose z axes stay in line; it is then the sum of the joint angles between them.
    """

    start: Marker
    end: Marker

    def measure(self, view: View) -> tuple[Expr, Expr]:
        angle, rate, _ = view.turn(self.start, self.end)
        return angle, rate

    def is_exact(self, view: View) -> bool:
        return view.turn(self.start, self.end)[2]

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
