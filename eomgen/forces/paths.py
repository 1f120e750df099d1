"""Force elements, their geometry: a scalar of the configuration, its rate, and the loads of a force along it."""

from __future__ import annotations

from abc import ABC, abstractmethod

from ..elements.element_type import Where
from ..elements.entry import Entry
from ..elements.kinds import JointReference, Pair
from ..elements.looks import Drawn, Points
from ..frames import Marker
from ..graph import vectors as vec
from ..graph.core import Expr, sqrt
from ..graph.vectors import Vec3
from ..records import dataclass
from .force import CoordinateLoad, Force, Load, MarkerLoad, View

#: Keys that say along what a force acts; :data:`COORDINATE` and :data:`ANGLE` read them.
ON_JOINT = JointReference("a joint of one degree, or a coordinate")
BETWEEN = Pair("two markers")


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
    def drawn(self, along: tuple[Points, ...] = (), about: tuple[Points, ...] = ()) -> Drawn:
        """Where an element on it is seen: with lines along it where it has a length, about it where it is an angle."""

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

    def drawn(self, along: tuple[Points, ...] = (), about: tuple[Points, ...] = ()) -> Drawn:
        return Drawn((self.start, self.end), along=along)

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

    def drawn(self, along: tuple[Points, ...] = (), about: tuple[Points, ...] = ()) -> Drawn:
        return Drawn((self.start,), about=about)

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

    def drawn(self, along: tuple[Points, ...] = (), about: tuple[Points, ...] = ()) -> Drawn:
        return Drawn((), self.name, along, about)

    def measure(self, view: View) -> tuple[Expr, Expr]:
        return view.coordinate(self.name)

    def loads(self, view: View, force: Expr) -> list[Load]:
        return [CoordinateLoad(self.name, force)]


def read_coordinate(e: Entry, angle: bool = False) -> JointCoordinate | None:
    """The coordinate meant by ``joint``: of a joint of one degree, or named itself."""
    found = e["joint"]
    if found is None:
        return None
    if found.kind == "parameter":
        remedy = "give the torque as a vector on the body: body: <body>, value: [x, y, z]"
        e.fault("joint", f"{found.name!r} is an Euler parameter, which takes no torque", remedy, "EG-REFERENCE")
        return None
    if angle and found.kind != "angle":
        message = f"the coordinate {found.name!r} is a {found.kind}"
        e.fault("joint", message, "a torsional element needs an angle", "EG-REFERENCE")
        return None
    return JointCoordinate(found.name)


def read_angle(e: Entry) -> Path | None:
    """An angle: of a joint, or between two markers."""
    if "joint" in e.values:
        return read_coordinate(e, angle=True)
    pair = e.pair()
    return None if pair is None else Turn(*pair)


COORDINATE = Where({"joint": ON_JOINT.replace(required=True)}, read_coordinate)
ANGLE = Where({"joint": ON_JOINT, "between": BETWEEN}, read_angle, one_of=("joint", "between"))


@dataclass(frozen=True)
class PathForce(Force):
    """A force along a path: :meth:`along` says how large it is at a value and a rate of the path."""

    path: Path

    def loads(self, view: View) -> list[Load]:
        value, rate = self.path.measure(view)
        push = self.along(value, rate)
        return [] if push is None else self.path.loads(view, push)
