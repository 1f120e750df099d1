"""Force elements, shapes of contacts between groups: a shape -> the features that meet, and how two of them touch.

A surface (half-space, segment, polygon) meets what is round: circles and spheres, and the corners and ends of other
shapes, which are round of radius 0 or of the shape's own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from typing import NamedTuple

import numpy as np

from ..elements.frames import Frame, Marker
from ..elements.looks import PLANE, Drawn, Seen, Wheel
from ..expr import vectors as vec
from ..expr.core import Expr, sqrt
from ..expr.records import dataclass
from ..expr.vectors import Vec3
from .fields import field_lines
from .pair_features import EDGE
from .profiles import (
    Point,
    ProfilePart,
    arc_points,
    clearance_of_arcs,
    cross,
    hollow_arcs,
    inner_corners,
    length,
    minus,
    peaks,
    piece_numbers,
    smooth_pieces,
    smooth_ring,
    solid_depth,
    sprocket_ring,
    straight_pieces,
    straight_ring,
)
from .rounds import cuboid_parts
from .states import BED, BED_CELL, FIELD, GROUNDS, INSIDE, POLYGON, WHEEL, ShapeParts, parts_of

#: Shapes whose pieces are edges and arcs.
PIECED = ("profile", "smooth_profile", "outline", "smooth_outline", "sprocket")
WHOLE_PLATE = "whole_plate"  #: a plate on a bed
_SLIM = 2e-3  #: part of half its length that a segment without a radius counts as thick
_STEPS = 24  #: lines of which the picture of an ellipse is made


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
    slot : int
        Its number among those of its class on the shape.
    number : int
        How many corners or pieces it has, where its law differs by it; 1 of a piece of a profile.
    """

    kind: str
    frame: Frame
    sizes: tuple[Expr, ...]
    bound: Expr | None
    thickness: Expr
    slot: int = 0
    number: int = 0


@dataclass(frozen=True)
class ContactShape:
    """A shape of a group, fixed to a marker.

    Attributes
    ----------
    kind : str
        One of :data:`~.states.SHAPE_FIELDS`.
    sizes : tuple of Expr
        radius, and of a wheel on soil its width; length, radius; of a box or polygon x and y of its corners,
        counterclockwise; of a profile or an outline its depth and x and y of its points, of outlines clockwise; of a
        sprocket its depth, teeth, pitch, seat, tip radius and angle of a seat; half axes; lengths, and the radius of
        edges; of a plate length, width and number of points; of a bed length and number of cells; of a height field
        z(x, y).
    """

    kind: str
    marker: Marker
    sizes: tuple[Expr, ...]

    def features(self) -> list[Feature]:
        """Its parts."""
        frame, zero = self.marker.frame, self.marker.frame.position[0].graph.zero
        if self.is_wheel:
            return [Feature("wheel", frame, self.sizes, self.sizes[0], 2.0 * self.sizes[0])]
        if self.kind in ("circle", "sphere"):
            return [Feature("round", frame, self.sizes, self.sizes[0], 2.0 * self.sizes[0])]
        if self.kind in ("half_plane", "half_space"):
            return [Feature("half", self._facing(frame), (), None, zero)]
        if self.kind in PIECED:
            return self._pieces(frame)
        if self.kind == "ellipsoid":
            return [Feature("ellipsoid", frame, self.sizes, greatest(self.sizes), 2.0 * _least(self.sizes))]
        if self.kind == "cuboid":
            *size, edge = self.sizes
            thick = _least(size)
            return [
                Feature(kind, _turned(_moved(frame, place), order), sizes, bound, thick, k)
                for kind, place, order, sizes, bound, k in cuboid_parts(size, edge)
            ]
        if self.kind == "height_field":
            return [Feature(FIELD, frame, (), None, zero)]
        if self.kind == "plate":
            return self._pads(frame)
        if self.kind == WHOLE_PLATE:
            return [Feature(WHOLE_PLATE, frame, self.sizes[:2], self.sizes[0], self.sizes[0])]
        if self.kind == BED:
            return self._cells(frame)
        if self.kind in ("segment", "capsule"):
            along = frame if self.kind == "segment" else _turned(frame, (2, 0, 1))
            half, radius = 0.5 * self.sizes[0], self.sizes[1]
            whole, *ends = ("segment", "corner") if self.kind == "segment" else ("rod", "end", "tip")
            thick = zero.graph.apply("max", 2.0 * radius, _SLIM * half)
            wholes = [whole] if self.kind == "segment" else [whole, "axis"]  # the same again, for edges of cuboids
            return [Feature(one, along, (half, radius), half + radius, thick) for one in wholes] + [
                Feature(end, _moved(along, (x, zero, zero)), (radius,), radius, thick, k)
                for end in ends
                for k, x in enumerate((-half, half))
            ]
        corners = list(zip(self.sizes[::2], self.sizes[1::2], strict=True))
        edges: list[Expr] = []
        reach = zero
        for (x, y), (x2, y2) in zip(corners, [*corners[1:], corners[0]], strict=True):
            dx, dy = x2 - x, y2 - y
            length = sqrt(dx * dx + dy * dy)
            edges += [x, y, dy / length, -dx / length, length]
            reach = reach.graph.apply("max", reach, x * x + y * y)
        thick = _width(edges, corners)
        points = [
            Feature("vertex", _moved(frame, (x, y, zero)), (zero,), zero, thick, k) for k, (x, y) in enumerate(corners)
        ]
        return [Feature(POLYGON, frame, tuple(edges), sqrt(reach), thick, number=len(corners)), *points]

    @property
    def is_wheel(self) -> bool:
        """Whether it is a circle with a width."""
        return self.kind == "circle" and len(self.sizes) > 1

    def convex_corners(self) -> list[Point]:
        """Corners, counterclockwise, of an outline whose points are numbers and which turns one way; else none."""
        points = self._points() if self.kind == "outline" else []
        around = zip([*points[-1:], *points[:-1]], points, [*points[1:], *points[:1]], strict=True)
        turns = [(b, cross(minus(b, a), minus(c, b)).value) for a, b, c in around]
        convex = all(turn is not None and turn <= 0.0 for _, turn in turns)
        return [point for point, turn in reversed(turns) if turn != 0.0] if convex else []

    def parts(self) -> ShapeParts:
        """How many parts of each class it has."""
        if self.is_wheel:
            return parts_of(WHEEL)
        counts = {
            "polygon": len(self.sizes) // 2, "sprocket": self._whole(1), "plate": self._whole(2), BED: self._whole(1),
        }  # fmt: skip
        return parts_of(self.kind, counts.get(self.kind, (len(self.sizes) - 1) // 2))

    def _whole(self, k: int) -> int:
        """A size that is a whole number."""
        return int(self.sizes[k].value or 0) if k < len(self.sizes) else 0

    def _pads(self, frame: Frame) -> list[Feature]:
        """Points of a plate: those of Gauss's rule along x, with parts of the area.

        Where the pressure of n points is a polynomial of degree 2 n - 2 or less along the plate, force and moment are
        exact.
        """
        length, width, _ = self.sizes
        zero, result = length.graph.zero, list[Feature]()
        for x, weight in zip(*np.polynomial.legendre.leggauss(self._whole(2)), strict=True):
            area = 0.5 * float(weight) * length * width
            place = _moved(frame, (0.5 * float(x) * length, zero, zero))
            result.append(Feature("pad", place, (area, width), zero, length, len(result)))
        return result

    def _cells(self, frame: Frame) -> list[Feature]:
        """Cells of a bed, from the marker on."""
        length, count = self.sizes[0], self._whole(1)
        size, zero = length / float(count), length.graph.zero
        places = (_moved(frame, ((k + 0.5) * size, zero, zero)) for k in range(count))
        return [Feature(BED_CELL, place, (size,), zero, size, k) for k, place in enumerate(places)]

    def on_bed(self) -> ContactShape:
        """The shape as it lies on a bed: a plate as a whole."""
        return replace(self, kind=WHOLE_PLATE) if self.kind == "plate" else self

    def _points(self) -> list[Point]:
        """Points of a profile or an outline."""
        if self.kind == "sprocket":
            return self._sprocket()[2]
        return list(zip(self.sizes[1::2], self.sizes[2::2], strict=True))

    def _sprocket(self) -> tuple[list[ProfilePart], list[Point], list[Point]]:
        _, teeth, *sizes = self.sizes
        assert teeth.value is not None
        return sprocket_ring(int(teeth.value), *sizes)

    def _parts(self) -> tuple[list[ProfilePart], list[tuple[int, Point]]]:
        """Pieces of a profile or an outline, and its corners, numbered, which meet what is flat."""
        if self.kind == "sprocket":
            pieces, tops, _ = self._sprocket()
            return pieces, list(enumerate(tops))
        points = self._points()
        if self.kind in ("profile", "smooth_profile"):
            return (straight_pieces if self.kind == "profile" else smooth_pieces)(points), peaks(points)
        pieces = (straight_ring if self.kind == "outline" else smooth_ring)(points)
        return pieces, peaks([points[-1], *points, points[0]])

    def _pieces(self, frame: Frame) -> list[Feature]:
        depth, zero = self.sizes[0], self.sizes[0].graph.zero
        pieces, tops = self._parts()
        depth = solid_depth(pieces, depth)
        surface = [one for one in pieces if one.kind in ("edge", "arc")]
        own_depth = depth  # by each piece for itself
        if self.kind == "smooth_outline" and math.isfinite(most := clearance_of_arcs(surface)):
            own_depth = zero.graph.apply("min", depth, most)
        result = [
            Feature(
                *(
                    one.kind,
                    one.frame(frame),
                    (*one.sizes, own_depth),
                    None if one.open else one.half + own_depth,
                    depth,
                ),
                number=int(self.kind in GROUNDS),
            )
            for one in surface
        ]
        hollows = [*inner_corners(pieces), *hollow_arcs(pieces)]
        result += [Feature(one.kind, one.frame(frame), (*one.sizes, depth), one.half, depth) for one in hollows]
        if self.kind not in GROUNDS:
            reach = greatest([length(one.origin) + one.half for one in surface])
            numbers = (*piece_numbers(surface), own_depth)
            result.append(Feature(INSIDE, frame, numbers, reach, depth, number=len(surface)))
        for k, (x, y) in tops:
            result.append(Feature("corner", _moved(frame, (x, y, zero)), (zero,), zero, depth, k))
        return result

    def _facing(self, frame: Frame) -> Frame:
        """The frame whose z axis points out of the solid: y of a half-plane's marker, z of a half-space's."""
        return _turned(frame, (2, 0, 1)) if self.kind == "half_plane" else frame

    def _ellipse(self, i: int, j: int) -> Drawn:
        """The outline of an ellipsoid in a plane of two of its axes."""
        places = []
        for k in range(_STEPS + 1):
            angle = 2.0 * math.pi * k / _STEPS
            place = [self.sizes[0].graph.zero] * 3
            place[i], place[j] = math.cos(angle) * self.sizes[i], math.sin(angle) * self.sizes[j]
            places.append(_moved(self.marker.frame, (place[0], place[1], place[2])))
        return Drawn(tuple(Marker(self.marker.body, frame, self.marker.label) for frame in places))

    def drawn(self) -> list[Seen]:
        """What is to be seen of it."""
        marker = self.marker
        if self.kind in ("circle", "sphere"):
            return [Wheel(marker, self.sizes[0])]
        if self.kind in ("half_plane", "half_space"):
            return [Drawn((Marker(marker.body, self._facing(marker.frame), marker.label),), about=PLANE)]
        if self.kind in PIECED:
            zero, points = self.sizes[0].graph.zero, self._points()
            line = points if self.kind in GROUNDS else [*points, points[0]]
            places = [_moved(marker.frame, (x, y, zero)) for x, y in line]
            if self.kind in ("smooth_profile", "smooth_outline"):
                arcs = [one for one in self._parts()[0] if one.kind == "arc"]
                places = [_moved(one.frame(marker.frame), (x, y, zero)) for one in arcs for x, y in arc_points(one)]
            return [Drawn(tuple(Marker(marker.body, frame, marker.label) for frame in places))]
        if self.kind == "ellipsoid":
            return [self._ellipse(i, j) for i, j in ((0, 1), (1, 2), (2, 0))]
        if self.kind == "height_field":
            lines = [[_moved(marker.frame, place) for place in line] for line in field_lines(self.sizes[0])]
            seen = [Drawn(tuple(Marker(marker.body, frame, marker.label) for frame in line)) for line in lines]
            return [*seen] or [Drawn((marker,), about=PLANE)]
        if self.kind == "cuboid":
            result = [feature.frame for feature in self.features() if feature.kind == "end"]
            ways = ((0, 1, 3, 2, 0, 4, 5, 7, 6, 4), (1, 5), (2, 6), (3, 7))
            return [Drawn(tuple(Marker(marker.body, result[k], marker.label) for k in way)) for way in ways]
        if self.kind == BED:
            zero = self.sizes[0].graph.zero
            places = [_moved(marker.frame, (x, zero, zero)) for x in (zero, self.sizes[0])]
            return [Drawn(tuple(Marker(marker.body, frame, marker.label) for frame in places))]
        if self.kind in ("plate", WHOLE_PLATE):
            half, zero = 0.5 * self.sizes[0], self.sizes[0].graph.zero
            places = [_moved(marker.frame, (x, zero, zero)) for x in (-half, half)]
            return [Drawn(tuple(Marker(marker.body, frame, marker.label) for frame in places))]
        frames = [feature.frame for feature in self.features() if feature.kind in ("corner", "end", "vertex")]
        closed = frames if self.kind in ("segment", "capsule") else [*frames, frames[0]]
        return [Drawn(tuple(Marker(marker.body, frame, marker.label) for frame in closed))]


def by_edges(
    first: Sequence[ContactShape], second: Sequence[ContactShape]
) -> tuple[tuple[ContactShape, ...], tuple[ContactShape, ...]]:
    """Groups in which convex outlines that meet polygons are polygons, which lie flush on each other by their edges.

    Plates meet outlines only; where a group has some, outlines of the other stay what they are.
    """

    def changed(own: Sequence[ContactShape], other: Sequence[ContactShape]) -> tuple[ContactShape, ...]:
        meets = any(shape.kind in ("box", "polygon") or shape.convex_corners() for shape in other)
        if not meets or any(shape.kind == "plate" or shape.is_wheel for shape in other):
            return tuple(own)
        result = []
        for shape in own:
            corners = tuple(x for corner in shape.convex_corners() for x in corner)
            result.append(ContactShape("polygon", shape.marker, corners) if corners else shape)
        return tuple(result)

    return changed(first, second or first), changed(second, first)


def greatest(sizes: Sequence[Expr]) -> Expr:
    """The greatest of several lengths."""
    return reduce(lambda a, b: a.graph.apply("max", a, b), sizes)


def _least(sizes: Sequence[Expr]) -> Expr:
    return reduce(lambda a, b: a.graph.apply("min", a, b), sizes)


def _width(edges: Sequence[Expr], corners: Sequence[tuple[Expr, Expr]]) -> Expr:
    """The least distance of two parallel lines that hold a polygon between them: one lies along an edge."""
    widths: list[Expr] = []
    for k in range(0, len(edges), EDGE):
        px, py, nx, ny, _ = edges[k : k + EDGE]
        across = [nx * (px - x) + ny * (py - y) for x, y in corners]
        widths.append(greatest(across))
    return _least(widths)


def _moved(frame: Frame, by: Vec3) -> Frame:
    return Frame(frame.rotation, vec.add(frame.position, vec.times(frame.rotation, by)))


def _turned(frame: Frame, columns: tuple[int, int, int]) -> Frame:
    """A frame whose axes are x, y and z of another in another order."""
    rows = tuple((row[columns[0]], row[columns[1]], row[columns[2]]) for row in frame.rotation)
    return Frame((rows[0], rows[1], rows[2]), frame.position)
