"""Frames fixed in bodies: what joints and force elements attach to; roll-pitch-yaw and axes -> exact rotations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

from ..expr import vectors as vec
from ..expr.core import Expr, Graph
from ..expr.records import Record
from ..expr.vectors import Mat3, Vec3
from .scalars import matrix_from_roll_pitch_yaw

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


# -- roll-pitch-yaw and axes -> rotation matrices, with zeros and ones kept exact --------------------------------------


_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_NX, _NY, _NZ = (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)

Numbers = tuple[float, float, float]
Columns = tuple[Numbers, Numbers, Numbers]

#: Word for an axis -> columns of the turn that brings it to z.
TURNS: dict[str, Columns] = {
    "x": (_Y, _Z, _X),
    "y": (_Z, _X, _Y),
    "z": (_X, _Y, _Z),
    "-x": (_Y, _NZ, _NX),
    "-y": (_Z, _NX, _NY),
    "-z": (_X, _NY, _NZ),
}


def axis_word(direction: Numbers) -> str:
    """``x``, ``-z``, or ``(0.6, 0, 0.8)`` for an axis that is none of a marker's."""
    for word, columns in TURNS.items():
        if direction == columns[2]:
            return word
    return f"({', '.join(f'{part:.6g}' for part in direction)})"


def rpy_rotation(graph: Graph, rpy: Sequence[Expr]) -> Mat3:
    """R = Rz(yaw) Ry(pitch) Rx(roll), marker axes to body axes: turned about fixed axes, roll first, as in URDF."""
    return vec.matrix(graph, matrix_from_roll_pitch_yaw(rpy))


def axis_columns(axis: Numbers) -> Columns | None:
    """Columns of a right-handed turn whose third column is the axis; None for the zero vector.

    Along a coordinate axis the entries are those of :data:`TURNS`; an axis in a coordinate plane keeps that plane's
    normal as first column, so that exact zeros stay.
    """
    largest = max(abs(a) for a in axis)
    if largest == 0.0:
        return None
    x, y, z = (a / largest for a in axis)
    zeros = [a == 0.0 for a in (x, y, z)]
    if sum(zeros) == 2:
        k = zeros.index(False)
        return TURNS[("-" if axis[k] < 0 else "") + "xyz"[k]]
    length = math.sqrt(x * x + y * y + z * z)
    n = (x / length, y / length, z / length)
    k = zeros.index(True) if any(zeros) else min(range(3), key=lambda i: abs(n[i]))
    e = (_X, _Y, _Z)[k]
    first = e if any(zeros) else _unit(_cross(e, n))
    return first, _cross(n, first), n


def axes_columns(x: Numbers, y: Numbers) -> Columns:
    """Columns of the turn that brings x and y to two unit vectors at right angles; y is made so to the last digit."""
    z = _cross(x, y)
    z = z if sum(a == 0.0 for a in z) == 2 else _unit(z)
    return x, _cross(z, x), z


def complete_axes(first: int, a: Numbers, second: int, b: Numbers) -> tuple[Numbers, ...]:
    """Columns of the turn of a frame of which axes ``first`` and ``second`` (0 to 2) are given, at right angles."""
    x, y, z = axes_columns(a, b)
    if (second - first) % 3 != 1:
        z = (-z[0], -z[1], -z[2])
    result = {first: x, second: y, 3 - first - second: z}
    return result[0], result[1], result[2]


def turn_matrix(graph: Graph, columns: Sequence[Numbers]) -> Mat3:
    """The constant matrix with the given columns."""
    return vec.transpose(tuple(vec.vector(graph, column) for column in columns))  # type: ignore[arg-type]


def _cross(a: Numbers, b: Numbers) -> Numbers:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _unit(a: Numbers) -> Numbers:
    length = math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    return (a[0] / length, a[1] / length, a[2] / length)
