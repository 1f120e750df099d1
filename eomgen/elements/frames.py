"""Frames fixed in bodies: what joints and force elements attach to."""

from __future__ import annotations

from typing import Protocol

from ..expr import vectors as vec
from ..expr.core import Expr, Graph
from ..expr.records import Record
from ..expr.vectors import Mat3, Vec3

GROUND = -1


class Frame(Record):
    """Placement in a body: ``rotation`` takes marker axes to body axes, ``position`` is in body axes (m)."""

    rotation: Mat3
    position: Vec3

    def __matmul__(self, inner: Frame) -> Frame:
        """A frame placed in the axes of this one, in the body."""
        turned = vec.product(self.rotation, inner.rotation)
        return Frame(turned, vec.add(self.position, vec.times(self.rotation, inner.position)))

    def turned(self, turn: Mat3) -> Frame:
        """The frame with its axes turned, by a rotation in them."""
        return Frame(vec.product(self.rotation, turn), self.position)

    @classmethod
    def identity(cls, graph: Graph) -> Frame:
        """The axes and the origin of the body itself."""
        return cls(vec.identity(graph), vec.zero(graph))


class Marker(Record):
    """A frame fixed in a body (``body`` is an index, or GROUND); ``label`` is how messages call it."""

    body: int
    frame: Frame
    label: str

    def turned(self, turn: Mat3) -> Marker:
        """The marker with its axes turned."""
        return Marker(self.body, self.frame.turned(turn), self.label)


class MotionView(Protocol):
    """Motion of markers, as expressions in ground axes, which the kinematics stage provides."""

    graph: Graph

    def position(self, marker: Marker) -> Vec3: ...
    def velocity(self, marker: Marker) -> Vec3: ...
    def rotation(self, marker: Marker) -> Mat3: ...
    def angular_velocity(self, marker: Marker) -> Vec3: ...

    def turn(self, start: Marker, end: Marker) -> tuple[Expr, Expr, bool]:
        """Angle of ``end`` about the z axis of ``start``, its rate, and whether it is exact and does not wrap."""
        ...


def velocity_at(view: MotionView, marker: Marker, arm: Vec3) -> Vec3:
    """The velocity of a marker's body at an arm from its origin, both in ground axes, as a view of the motion tells."""
    return vec.add(view.velocity(marker), vec.cross(view.angular_velocity(marker), arm))


class WrapCylinder(Record):
    """A cylinder of the radius (m) about the z axis of a marker; ``sense`` is the turn of the path about it.

    The path runs from start to end round the axis counterclockwise (1) or clockwise (-1), seen against z.  The surface
    is smooth, or has a coefficient of ``friction`` that is reached well above the velocity ``smoothing`` (m/s) of slip.
    """

    marker: Marker
    radius: Expr
    sense: int
    friction: Expr | None = None
    smoothing: Expr | None = None
