"""Geometry of force elements: a scalar of the configuration, its rate, and the loads of a force along it."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

from ...expr import vectors as vec
from ...expr.core import Expr, atan2, sqrt
from ...expr.records import Record
from ...expr.vectors import Vec3
from ..element_type import Entry, Where
from ..frames import Marker, WrapCylinder
from ..glyphs import Drawn, Points
from ..kinds import JointReference, Pair, Via
from .force import CoordinateLoad, Force, Load, MarkerLoad, Measured, View, power_of, where

# -- paths -------------------------------------------------------------------------------------------------------------


#: Keys that say along what a force acts; :data:`COORDINATE` and :data:`ANGLE` read them.
ON_JOINT = JointReference("a joint of one degree, or a coordinate")
BETWEEN = Pair("two markers")


class Path(Record, ABC):
    """A scalar measure of the configuration."""

    @abstractmethod
    def measure(self, view: View) -> tuple[Expr, Expr]:
        """Value and rate."""

    def is_exact(self, view: View) -> bool:
        """Whether the loads of a force that depends on the value alone derive from a potential."""
        return True

    @abstractmethod
    def glyphs(self, along: tuple[Points, ...] = (), about: tuple[Points, ...] = ()) -> Drawn:
        """Where an element on it is seen: with lines along it where it has a length, about it where it is an angle."""

    @abstractmethod
    def loads(self, view: View, force: Expr) -> list[Load]:
        """Loads equivalent to a generalized force along increasing value: their power is force times rate."""


class Line(Path):
    """The distance between the origins of two markers (m)."""

    start: Marker
    end: Marker

    def reach(self, view: View) -> Vec3:
        """From start to end, ground axes (m)."""
        return vec.sub(view.position(self.end), view.position(self.start))

    def geometry(self, view: View) -> tuple[Vec3, Expr]:
        """The unit vector from start to end, ground axes, and the distance."""
        d = self.reach(view)
        length = sqrt(vec.dot(d, d))
        return (d[0] / length, d[1] / length, d[2] / length), length

    def glyphs(self, along: tuple[Points, ...] = (), about: tuple[Points, ...] = ()) -> Drawn:
        return Drawn((self.start, self.end), along=along)

    def measure(self, view: View) -> tuple[Expr, Expr]:
        direction, length = self.geometry(view)
        relative = vec.sub(view.velocity(self.end), view.velocity(self.start))
        return length, vec.dot(direction, relative)

    def loads(self, view: View, force: Expr) -> list[Load]:
        direction, _ = self.geometry(view)
        return self.pair(view, vec.scale(force, direction))

    def pair(self, view: View, push: Vec3) -> list[Load]:
        """A force (ground axes) on the end marker and its reaction on the start marker."""
        o = vec.zero(view.graph)
        return [MarkerLoad(self.end, push, o), MarkerLoad(self.start, vec.neg(push), o)]


class Turn(Path):
    """The angle by which the end marker is turned about the z axis of the start marker (rad).

    Meant for markers whose z axes stay in line; it is then the sum of the joint angles between them.
    """

    start: Marker
    end: Marker

    def glyphs(self, along: tuple[Points, ...] = (), about: tuple[Points, ...] = ()) -> Drawn:
        return Drawn((self.start,), about=about)

    def measure(self, view: View) -> tuple[Expr, Expr]:
        return view.turn(self.start, self.end)[:2]

    def is_exact(self, view: View) -> bool:
        return view.turn(self.start, self.end)[2]

    def loads(self, view: View, force: Expr) -> list[Load]:
        axis = vec.transpose(view.rotation(self.start))[2]
        torque = vec.scale(force, axis)
        o = vec.zero(view.graph)
        return [MarkerLoad(self.end, o, torque), MarkerLoad(self.start, o, vec.neg(torque))]


class JointCoordinate(Path):
    """One coordinate of a joint (rad or m)."""

    name: str

    def glyphs(self, along: tuple[Points, ...] = (), about: tuple[Points, ...] = ()) -> Drawn:
        return Drawn((), self.name, along, about)

    def measure(self, view: View) -> tuple[Expr, Expr]:
        return view.coordinate(self.name)

    def loads(self, view: View, force: Expr) -> list[Load]:
        return [CoordinateLoad(self.name, force)]


def read_coordinate(e: Entry, angle: bool = False) -> JointCoordinate | None:
    """The coordinate meant by ``joint``: of a joint of one degree, or named itself."""
    result = e["joint"]
    if result is None:
        return None
    if result.kind == "parameter":
        remedy = "give the torque as a vector on the body: body: <body>, value: [x, y, z]"
        e.fault("joint", f"{result.name!r} is an Euler parameter, which takes no torque", remedy, "EG-REFERENCE")
        return None
    if angle and result.kind != "angle":
        message = f"the coordinate {result.name!r} is a {result.kind}"
        e.fault("joint", message, "a torsional element needs an angle", "EG-REFERENCE")
        return None
    return JointCoordinate(result.name)


def read_angle(e: Entry) -> Path | None:
    """An angle: of a joint, or between two markers."""
    if "joint" in e.values:
        return read_coordinate(e, angle=True)
    pair = e.pair()
    return None if pair is None else Turn(*pair)


COORDINATE = Where({"joint": ON_JOINT.replace(required=True)}, read_coordinate)
ANGLE = Where({"joint": ON_JOINT, "between": BETWEEN}, read_angle, one_of=("joint", "between"))


class PathForce(Force):
    """A force along a path: :meth:`along` says how large it is at a value and a rate of the path."""

    path: Path
    acts_along = True

    def along(self, value: Expr, rate: Expr) -> Expr | None:
        """The force along its path at a value and a rate of it."""
        return self.push(value, rate)

    def measured(self, view: View) -> Measured | None:
        value, rate = self.path.measure(view)
        force = self.along(value, rate)
        return None if force is None else Measured(value, rate, force)

    def loads(self, view: View) -> list[Load]:
        value, rate = self.path.measure(view)
        push = self.along(value, rate)
        return [] if push is None else self.path.loads(view, push)


# -- paths over via points and cylinders -------------------------------------------------------------------------------


class Piece(NamedTuple):
    """A piece of a path between two markers: its length, and the directions in which it leaves and arrives.

    ``force`` and ``torque`` are the resultant on the cylinder per unit of force that lengthens the path; ``turns`` are
    the parts of the torque where the path leaves to its start and to its end, and ``bend`` is the angle by which it
    turns on the cylinder.
    """

    length: Expr
    leaving: Vec3
    arriving: Vec3
    force: Vec3
    torque: Vec3
    turns: tuple[Vec3, Vec3]
    bend: Expr


class Route(Path):
    """A taut string from one marker to another over via points, which it slides through, and around cylinders (m).

    Without friction its tension is the same all along, and with friction on a cylinder a force is that at the start:
    beyond the cylinder it is smaller by

        exp(-friction bend tanh(v / smoothing)),  v = (v_start - v_end) / 2,

    with the velocities v_start and v_end at which the rope slips off the cylinder to either side (Euler 1769, Eytelwein
    1808, smoothed).  A cylinder stands between two markers of the path.
    """

    start: Marker
    end: Marker
    via: tuple[Marker | WrapCylinder, ...]

    def glyphs(self, along: tuple[Points, ...] = (), about: tuple[Points, ...] = ()) -> Drawn:
        return Drawn((self.start, *self.via, self.end))

    def measure(self, view: View) -> tuple[Expr, Expr]:
        length = sum((piece.length for _, _, _, piece in self._pieces(view)), view.graph.zero)
        return length, power_of(view, self._smooth(view, view.graph.one))  # of a unit force: the rate

    def is_exact(self, view: View) -> bool:
        return not any(isinstance(stop, WrapCylinder) and stop.friction is not None for stop in self.via)

    def loads(self, view: View, force: Expr) -> list[Load]:
        if self.is_exact(view):
            return list(self._smooth(view, force))
        pieces = self._pieces(view)
        halves = [half for piece in pieces for half in _halves(view, piece)]
        result: list[Load] = []
        for k, (_, _, cylinder, piece) in enumerate(pieces):
            result += _scaled(force, halves[2 * k])
            if cylinder is not None and cylinder.friction is not None and cylinder.smoothing is not None:
                before, after = (
                    power_of(view, [load for half in part for load in half])
                    for part in (halves[: 2 * k + 1], halves[2 * k + 1 :])
                )
                slip = view.graph.apply("tanh", 0.5 * (before - after) / cylinder.smoothing)
                force = force * view.graph.apply("exp", -cylinder.friction * piece.bend * slip)
            result += _scaled(force, halves[2 * k + 1])
        return result

    def _smooth(self, view: View, force: Expr) -> list[MarkerLoad]:
        """Loads of one force all along."""
        o = vec.zero(view.graph)
        result: list[MarkerLoad] = []
        for start, end, cylinder, piece in self._pieces(view):
            result.append(MarkerLoad(start, vec.scale(-force, piece.leaving), o))
            result.append(MarkerLoad(end, vec.scale(force, piece.arriving), o))
            if cylinder is not None:
                push, turn = vec.scale(force, piece.force), vec.scale(force, piece.torque)
                result.append(MarkerLoad(cylinder.marker, push, turn))
        return result

    def _pieces(self, view: View) -> list[tuple[Marker, Marker, WrapCylinder | None, Piece]]:
        result = []
        last, around = self.start, None
        for stop in (*self.via, self.end):
            if isinstance(stop, WrapCylinder):
                around = stop
                continue
            piece = _straight(view, last, stop) if around is None else _wrap(view, last, stop, around)
            result.append((last, stop, around, piece))
            last, around = stop, None
        return result


def _halves(
    view: View, one: tuple[Marker, Marker, WrapCylinder | None, Piece]
) -> tuple[list[MarkerLoad], list[MarkerLoad]]:
    """Loads of a unit force of the part of a piece to its start and of that to its end."""
    start, end, cylinder, piece = one
    o = vec.zero(view.graph)
    first, last = [MarkerLoad(start, vec.neg(piece.leaving), o)], [MarkerLoad(end, piece.arriving, o)]
    if cylinder is not None:
        first.append(MarkerLoad(cylinder.marker, piece.leaving, piece.turns[0]))
        last.append(MarkerLoad(cylinder.marker, vec.neg(piece.arriving), vec.neg(piece.turns[1])))
    return first, last


def _scaled(force: Expr, loads: Sequence[MarkerLoad]) -> list[MarkerLoad]:
    return [MarkerLoad(one.marker, vec.scale(force, one.force), vec.scale(force, one.torque)) for one in loads]


def _straight(view: View, start: Marker, end: Marker) -> Piece:
    direction, length = Line(start, end).geometry(view)
    o = vec.zero(view.graph)
    return Piece(length, direction, direction, o, o, (o, o), view.graph.zero)


def _wrap(view: View, start: Marker, end: Marker, around: WrapCylinder) -> Piece:
    """The shortest path that turns about a cylinder in the given sense; straight where it does not touch.

    Across the axis it is a tangent of length t_a, an arc of r w and a tangent of length t_b.  The surface unrolls into
    a plane, in which the path is straight: it rises along the axis in proportion, and
    L^2 = (t_a + r w + t_b)^2 + h^2 with the rise h.
    """
    r, s = around.radius, float(around.sense)
    rotation, center = view.rotation(around.marker), view.position(around.marker)
    a, b = (vec.transpose_times(rotation, vec.sub(view.position(end_), center)) for end_ in (start, end))
    square_a, square_b = a[0] * a[0] + a[1] * a[1], b[0] * b[0] + b[1] * b[1]
    t_a, t_b = sqrt(square_a - r * r), sqrt(square_b - r * r)  # not real, so not a number, inside the cylinder
    # angle from start to end about the axis in the sense of the path, 0 to 2 pi, less those from the ends to where the
    # tangents touch
    cross, dot = s * (a[0] * b[1] - a[1] * b[0]), a[0] * b[0] + a[1] * b[1]
    w = math.pi + atan2(-cross, -dot) - atan2(t_a, r) - atan2(t_b, r)
    arc = t_a + r * w + t_b
    h = b[2] - a[2]
    length = sqrt(arc * arc + h * h)
    # radial directions to where the path touches first (p) and last (q)
    p = ((a[0] * r - s * a[1] * t_a) / square_a, (a[1] * r + s * a[0] * t_a) / square_a)
    q = ((b[0] * r + s * b[1] * t_b) / square_b, (b[1] * r - s * b[0] * t_b) / square_b)
    planar, rise = s * arc / length, h / length
    leaving: Vec3 = (-p[1] * planar, p[0] * planar, rise)
    arriving: Vec3 = (-q[1] * planar, q[0] * planar, rise)
    first: Vec3 = (r * p[0], r * p[1], a[2] + h * t_a / arc)
    last: Vec3 = (r * q[0], r * q[1], b[2] - h * t_b / arc)
    turns = vec.cross(first, leaving), vec.cross(last, arriving)
    torque = vec.sub(*turns)

    # written so that an end inside the cylinder counts as touching, which fails, and not as free
    touching = view.graph.apply("not", view.graph.apply("le", w, 0.0))
    straight = _straight(view, start, end)

    def chosen(wrapped: Vec3, free: Vec3) -> Vec3:
        x, y, z = (where(touching, i, k) for i, k in zip(vec.times(rotation, wrapped), free, strict=True))
        return (x, y, z)

    o = vec.zero(view.graph)
    leave, arrive = chosen(leaving, straight.leaving), chosen(arriving, straight.arriving)
    return Piece(
        where(touching, length, straight.length),
        leave,
        arrive,
        vec.sub(leave, arrive),
        chosen(torque, o),
        (chosen(turns[0], o), chosen(turns[1], o)),
        where(touching, w * arc / length, 0.0),
    )


VIA = Via(
    "points of the path between its ends, in order: markers that it slides through, and cylinders that it wraps "
    "around, {around: marker, radius: r, sense: positive or negative}, about the z axis of a marker; with friction and "
    "smoothing the rope rubs on the cylinder",
    default=(),
)


def read_path(e: Entry) -> Path | None:
    """The line between two markers, or a path over what ``via`` lists."""
    pair = e.pair()
    via = e["via"]
    if pair is None or via is None:
        return None
    return Route(*pair, tuple(via)) if via else Line(*pair)


def read_joint_or_path(e: Entry) -> Path | None:
    """A joint's coordinate, or a line or path between markers."""
    if "joint" in e.values and "via" in e.values:
        e.fault("via", "a force on a joint's coordinate has no path", "leave it out, or give between")
    return read_coordinate(e) if "joint" in e.values else read_path(e)


LINE = Where({"between": BETWEEN.replace(required=True)}, read_path, {"via": VIA})
ANYWHERE = Where({"joint": ON_JOINT, "between": BETWEEN}, read_joint_or_path, {"via": VIA}, ("joint", "between"))
