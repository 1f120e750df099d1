"""Force elements, shapes of contacts between groups: a shape -> the features that meet, and how two of them touch.

A surface (half-space, segment, polygon) meets what is round: circles and spheres, and the corners and ends of other
shapes, which are round of radius 0 or of the shape's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import NamedTuple

from ..elements.dimensions import LENGTH
from ..elements.field import Field, Fields
from ..elements.looks import PLANE, Drawn, Seen, Wheel
from ..frames import Frame, Marker
from ..graph import vectors as vec
from ..graph.core import Expr, sqrt
from ..graph.vectors import Mat3, Vec3
from ..records import dataclass
from .branches import where
from .contact import Contact, SpherePlane, SphereSphere, Touch
from .force import View

CORNERS = 64  #: most corners of a polygon

_RADIUS = Field("expression", "radius (m)", required=True, dimension=LENGTH)
_ALONG = "length between the centres of its ends (m), along {} of the marker"
_SIZES: dict[str, Fields] = {
    "circle": {"radius": _RADIUS},
    "segment": {
        "length": Field("expression", _ALONG.format("x"), required=True, dimension=LENGTH),
        "radius": _RADIUS._replace(required=False, default=0),
    },
    "box": {"size": Field("two", "lengths along x and y (m)", required=True, dimension=LENGTH)},
    "polygon": {
        "points": Field(
            "corners", f"3 to {CORNERS} corners [x, y] of a convex outline (m)", required=True, dimension=LENGTH
        ),
    },
    "half_plane": {},
    "sphere": {"radius": _RADIUS},
    "capsule": {
        "length": Field("expression", _ALONG.format("z"), required=True, dimension=LENGTH),
        "radius": _RADIUS,
    },
    "half_space": {},
}
_ON = {
    "shape": Field("choice", "kind of shape", required=True, choices=tuple(_SIZES)),
    "on": Field("on", "the marker to which it is fixed, or a list of markers that have one each", required=True),
}
#: Kind of shape -> its keys; a shape in the plane lies in the x-y plane of its marker.
SHAPE_FIELDS: dict[str, Fields] = {kind: {**_ON, **sizes} for kind, sizes in _SIZES.items()}
#: Shapes of mechanisms in the plane; the others are shapes in space.
PLANAR = ("circle", "segment", "box", "polygon", "half_plane")
_SLIM = 2e-3  #: part of half its length that a segment without a radius counts as thick
_EDGE = 5  #: numbers of an edge: its first corner, its outward normal, its length


class Feature(NamedTuple):
    """A part of a shape.

    Attributes
    ----------
    kind : str
        Its class.
    frame : Frame
        In the body.
    sizes : tuple of Expr
    bound : Expr or None
        The radius about the frame's origin within which it lies.
    thickness : Expr
        How far another body goes from one side of the shape to the other at least; greater than 0 but for a half-plane,
        which has no other side.
    """

    kind: str
    frame: Frame
    sizes: tuple[Expr, ...]
    bound: Expr | None
    thickness: Expr


@dataclass(frozen=True)
class ContactShape:
    """A shape of a group, fixed to a marker.

    Attributes
    ----------
    kind : str
        One of :data:`SHAPE_FIELDS`.
    sizes : tuple of Expr
        radius; length, radius; of a box or polygon x and y of its corners, counterclockwise.
    """

    kind: str
    marker: Marker
    sizes: tuple[Expr, ...]

    def features(self) -> list[Feature]:
        """Its parts."""
        frame, zero = self.marker.frame, self.marker.frame.position[0].graph.zero
        if self.kind in ("circle", "sphere"):
            return [Feature("round", frame, self.sizes, self.sizes[0], 2.0 * self.sizes[0])]
        if self.kind in ("half_plane", "half_space"):
            return [Feature("half", self._facing(frame), (), None, zero)]
        if self.kind in ("segment", "capsule"):
            along = frame if self.kind == "segment" else _turned(frame, (2, 0, 1))
            half, radius = 0.5 * self.sizes[0], self.sizes[1]
            thick = zero.graph.apply("max", 2.0 * radius, _SLIM * half)
            ends = [Feature("corner", _moved(along, (x, zero, zero)), (radius,), radius, thick) for x in (-half, half)]
            return [Feature("segment", along, (half, radius), half + radius, thick), *ends]
        corners = list(zip(self.sizes[::2], self.sizes[1::2], strict=True))
        edges: list[Expr] = []
        reach = zero
        for (x, y), (x2, y2) in zip(corners, [*corners[1:], corners[0]], strict=True):
            dx, dy = x2 - x, y2 - y
            length = sqrt(dx * dx + dy * dy)
            edges += [x, y, dy / length, -dx / length, length]
            reach = reach.graph.apply("max", reach, x * x + y * y)
        thick = _width(edges, corners)
        points = [Feature("corner", _moved(frame, (x, y, zero)), (zero,), zero, thick) for x, y in corners]
        return [Feature(f"polygon{len(corners)}", frame, tuple(edges), sqrt(reach), thick), *points]

    def _facing(self, frame: Frame) -> Frame:
        """The frame whose z axis points out of the solid: y of a half-plane's marker, z of a half-space's."""
        return _turned(frame, (2, 0, 1)) if self.kind == "half_plane" else frame

    def drawn(self) -> list[Seen]:
        """What is to be seen of it."""
        marker = self.marker
        if self.kind in ("circle", "sphere"):
            return [Wheel(marker, self.sizes[0])]
        if self.kind in ("half_plane", "half_space"):
            return [Drawn((Marker(marker.body, self._facing(marker.frame), marker.label),), about=PLANE)]
        frames = [feature.frame for feature in self.features()[1:]]
        closed = frames if self.kind in ("segment", "capsule") else [*frames, frames[0]]
        return [Drawn(tuple(Marker(marker.body, frame, marker.label) for frame in closed))]


def _width(edges: Sequence[Expr], corners: Sequence[tuple[Expr, Expr]]) -> Expr:
    """The least distance of two parallel lines that hold a polygon between them: one lies along an edge."""
    graph = edges[0].graph
    widths: list[Expr] = []
    for k in range(0, len(edges), _EDGE):
        px, py, nx, ny, _ = edges[k : k + _EDGE]
        across = [nx * (px - x) + ny * (py - y) for x, y in corners]
        widths.append(reduce(lambda a, b: graph.apply("max", a, b), across))
    return reduce(lambda a, b: graph.apply("min", a, b), widths)


def _moved(frame: Frame, by: Vec3) -> Frame:
    return Frame(frame.rotation, vec.add(frame.position, vec.times(frame.rotation, by)))


def _turned(frame: Frame, columns: tuple[int, int, int]) -> Frame:
    """A frame whose axes are x, y and z of another in another order."""
    rows = tuple((row[columns[0]], row[columns[1]], row[columns[2]]) for row in frame.rotation)
    return Frame((rows[0], rows[1], rows[2]), frame.position)


def direction(reach: Vec3, otherwise: Vec3) -> tuple[Vec3, Expr]:
    """The unit vector along another and its length; ``otherwise`` where that is 0, so that coincident centres part."""
    square = vec.dot(reach, reach)
    apart = square.graph.apply("lt", 0.0, square)
    length = sqrt(where(apart, square, 1.0))
    x, y, z = (where(apart, a / length, b) for a, b in zip(reach, otherwise, strict=True))
    return (x, y, z), where(apart, length, 0.0)


@dataclass(frozen=True)
class RoundRound(SphereSphere):
    """Two circles or spheres; where their centres coincide the second is pushed along x of the first marker."""

    def touch(self, view: View) -> Touch:
        reach = vec.sub(view.position(self.second), view.position(self.first))
        normal, distance = direction(reach, vec.transpose(view.rotation(self.first))[0])
        depth = self.radii[0] + self.radii[1] - distance
        first = vec.scale(self.radii[0] - 0.5 * depth, normal)
        return normal, depth, first, vec.scale(0.5 * depth - self.radii[1], normal)


@dataclass(frozen=True)
class SegmentRound(Contact):
    """A circle or sphere about the second marker on a segment along x of the first, which has a radius of its own.

    A centre on the segment is pushed along y of the first marker.
    """

    half: Expr
    radii: tuple[Expr, Expr]

    def touch(self, view: View) -> Touch:
        graph, along = view.graph, vec.transpose(view.rotation(self.first))[0]
        reach = vec.sub(view.position(self.second), view.position(self.first))
        place = graph.apply("max", -self.half, graph.apply("min", self.half, vec.dot(along, reach)))
        across = vec.sub(reach, vec.scale(place, along))
        normal, distance = direction(across, vec.transpose(view.rotation(self.first))[1])
        depth = self.radii[0] + self.radii[1] - distance
        first = vec.add(vec.scale(place, along), vec.scale(self.radii[0] - 0.5 * depth, normal))
        return normal, depth, first, vec.scale(0.5 * depth - self.radii[1], normal)


@dataclass(frozen=True)
class PolygonRound(Contact):
    """A circle about the second marker on a convex polygon in the x-y plane of the first.

    Of a centre outside the nearest point of the outline counts, of one inside the edge that is nearest; the edge in
    whose direction the centre is farthest holds both (Ericson, Real-Time Collision Detection, 2005, section 5.1).
    """

    edges: tuple[Expr, ...]
    radius: Expr

    def touch(self, view: View) -> Touch:
        graph, R = view.graph, view.rotation(self.first)
        reach = vec.sub(view.position(self.second), view.position(self.first))
        x, y, _ = vec.transpose_times(R, reach)
        best: tuple[Expr, ...] | None = None
        for k in range(0, len(self.edges), _EDGE):
            px, py, nx, ny, length = self.edges[k : k + _EDGE]
            rise = nx * (x - px) + ny * (y - py)
            mine = (rise, px, py, nx, ny, length)
            if best is None:
                best = mine
            else:
                higher = graph.apply("lt", best[0], rise)
                best = tuple(where(higher, new, old) for new, old in zip(mine, best, strict=True))
        assert best is not None
        rise, px, py, nx, ny, length = best
        run = ny * (px - x) + nx * (y - py)  # along the edge (-ny, nx)
        run = graph.apply("max", 0.0, graph.apply("min", length, run))
        ax, ay = x - px + run * ny, y - py - run * nx
        outside = graph.apply("lt", 0.0, rise)
        distance = sqrt(where(outside, ax * ax + ay * ay, 1.0))
        gap = where(outside, distance, rise)
        nx, ny = where(outside, ax / distance, nx), where(outside, ay / distance, ny)
        normal = vec.times(R, (nx, ny, graph.zero))
        depth = self.radius - gap
        second = vec.scale(0.5 * depth - self.radius, normal)
        return normal, depth, vec.add(reach, second), second


@dataclass(frozen=True)
class AtHeight(Contact):
    """Shapes of the plane that touch in the plane of the first: the point of contact lies at the height of the second.

    So both bodies feel the force at one place, and its power is that of the depth, whichever way the bodies tilt.
    """

    flat: Contact
    height: Vec3

    def touch(self, view: View) -> Touch:
        normal, depth, first, second = self.flat.touch(view)
        return normal, depth, vec.add(first, self.height), second


#: Classes of features that meet: the first is a surface, or round beside round.
MEETINGS = (
    ("round", "round"),
    *((surface, soft) for surface in ("half", "segment", "polygon") for soft in ("round", "corner")),
)


def meet(kinds: tuple[str, str]) -> bool:
    """Whether features of two classes meet, in this order."""
    return (kinds[0].rstrip("0123456789"), kinds[1]) in MEETINGS


class ShapeMotion(NamedTuple):
    """A shape's place and motion, ground axes."""

    position: Vec3
    rotation: Mat3
    velocity: Vec3
    angular_velocity: Vec3


def touching(
    kinds: tuple[str, str],
    markers: tuple[Marker, Marker],
    sizes: tuple[tuple[Expr, ...], tuple[Expr, ...]],
    law: Contact,
) -> Contact:
    """The contact of one feature with another; ``law`` has the laws."""
    laws = (law.name, *markers, law.normal_law, law.friction)
    first, radius = sizes[0], sizes[1][0]
    if kinds[0] == "round":
        return RoundRound(*laws, (first[0], radius))
    if kinds[0] == "half":
        return SpherePlane(*laws, radius)
    if kinds[0] == "segment":
        return SegmentRound(*laws, first[0], (first[1], radius))
    return PolygonRound(*laws, first, radius)
