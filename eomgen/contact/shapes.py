"""Force elements, shapes of contacts between groups: a shape -> the features that meet, and how two of them touch.

A surface (half-space, segment, polygon) meets what is round: circles and spheres, and the corners and ends of other
shapes, which are round of radius 0 or of the shape's own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import reduce
from typing import NamedTuple

import numpy as np

from ..elements.frames import Frame, Marker
from ..elements.glyphs import PLANE, Drawn, Glyph, Wheel
from ..expr import vectors as vec
from ..expr.core import Expr, sqrt
from ..expr.records import Record
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
from .states import BED, BED_CELL, BLOCK, FIELD, FIELD_SHAPE, GROUNDS, INSIDE, POLYGON, WHEEL, ShapeParts, parts_of

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


class ContactShape(Record):
    """A shape of a group, fixed to a marker.

    Attributes
    ----------
    kind : str
        One of :data:`SHAPES`.
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

    @property
    def is_wheel(self) -> bool:
        """Whether it is a circle with a width."""
        return self.kind == "circle" and len(self.sizes) > 1

    def features(self) -> list[Feature]:
        """Its parts."""
        return SHAPES[self.kind].features(self)

    def glyphs(self) -> list[Glyph]:
        """What is to be seen of it."""
        return SHAPES[self.kind].glyphs(self)

    def parts(self) -> ShapeParts:
        """How many parts of each class it has."""
        if self.is_wheel:
            return parts_of(WHEEL)
        counts = {
            "polygon": len(self.sizes) // 2, "sprocket": self.whole(1), "plate": self.whole(2), BED: self.whole(1),
        }  # fmt: skip
        return parts_of(self.kind, counts.get(self.kind, (len(self.sizes) - 1) // 2))

    def whole(self, k: int) -> int:
        """A size that is a whole number."""
        return int(self.sizes[k].value or 0) if k < len(self.sizes) else 0

    def on_bed(self) -> ContactShape:
        """The shape as it lies on a bed: a plate as a whole."""
        return replace(self, kind=WHOLE_PLATE) if self.kind == "plate" else self

    def convex_corners(self) -> list[Point]:
        """Corners, counterclockwise, of an outline whose points are numbers and which turns one way; else none."""
        points = _points(self) if self.kind == "outline" else []
        around = zip([*points[-1:], *points[:-1]], points, [*points[1:], *points[:1]], strict=True)
        turns = [(b, cross(minus(b, a), minus(c, b)).value) for a, b, c in around]
        convex = all(turn is not None and turn <= 0.0 for _, turn in turns)
        return [point for point, turn in reversed(turns) if turn != 0.0] if convex else []

    def line(self, frames: Sequence[Frame]) -> Drawn:
        """A line through places in its body."""
        return Drawn(tuple(Marker(self.marker.body, frame, self.marker.label) for frame in frames))

    def along(self, *places: Expr) -> list[Frame]:
        """Places on the x axis of its marker."""
        zero = self.sizes[0].graph.zero
        return [_moved(self.marker.frame, (x, zero, zero)) for x in places]


# -- features and pictures of each kind --------------------------------------------------------------------------------


def _round(shape: ContactShape) -> list[Feature]:
    kind = "wheel" if shape.is_wheel else "round"
    return [Feature(kind, shape.marker.frame, shape.sizes, shape.sizes[0], 2.0 * shape.sizes[0])]


def _facing(shape: ContactShape) -> Frame:
    """The frame whose z axis points out of the solid: y of a half-plane's marker, z of a half-space's."""
    return _turned(shape.marker.frame, (2, 0, 1)) if shape.kind == "half_plane" else shape.marker.frame


def _endless(shape: ContactShape) -> list[Feature]:
    """A half-plane, a half-space or a height field."""
    kind = FIELD if shape.kind == FIELD_SHAPE else "half"
    return [Feature(kind, _facing(shape), (), None, shape.marker.frame.position[0].graph.zero)]


def _ellipsoid(shape: ContactShape) -> list[Feature]:
    sizes = shape.sizes
    return [Feature("ellipsoid", shape.marker.frame, sizes, greatest(sizes), 2.0 * _least(sizes))]


def _ellipses(shape: ContactShape) -> list[Glyph]:
    """The outlines of an ellipsoid in the planes of two of its axes."""
    result = list[Glyph]()
    for i, j in ((0, 1), (1, 2), (2, 0)):
        places = []
        for k in range(_STEPS + 1):
            angle = 2.0 * math.pi * k / _STEPS
            place = [shape.sizes[0].graph.zero] * 3
            place[i], place[j] = math.cos(angle) * shape.sizes[i], math.sin(angle) * shape.sizes[j]
            places.append(_moved(shape.marker.frame, (place[0], place[1], place[2])))
        result.append(shape.line(places))
    return result


def _cuboid(shape: ContactShape) -> list[Feature]:
    *size, edge = shape.sizes
    thick = _least(size)
    return [
        Feature(kind, _turned(_moved(shape.marker.frame, place), order), sizes, bound, thick, k)
        for kind, place, order, sizes, bound, k in cuboid_parts(size, edge)
    ]


def _cuboid_edges(shape: ContactShape) -> list[Glyph]:
    corners = [feature.frame for feature in shape.features() if feature.kind == "end"]
    ways = ((0, 1, 3, 2, 0, 4, 5, 7, 6, 4), (1, 5), (2, 6), (3, 7))
    return [shape.line([corners[k] for k in way]) for way in ways]


def _field_lines(shape: ContactShape) -> list[Glyph]:
    frame = shape.marker.frame
    lines = [shape.line([_moved(frame, place) for place in line]) for line in field_lines(shape.sizes[0])]
    return [*lines] or [Drawn((shape.marker,), about=PLANE)]


def _pads(shape: ContactShape) -> list[Feature]:
    """Points of a plate: those of Gauss's rule along x, with parts of the area.

    Where the pressure of n points is a polynomial of degree 2 n - 2 or less along the plate, force and moment are
    exact.
    """
    length, width, _ = shape.sizes
    result = list[Feature]()
    for x, weight in zip(*np.polynomial.legendre.leggauss(shape.whole(2)), strict=True):
        area = 0.5 * float(weight) * length * width
        (place,) = shape.along(0.5 * float(x) * length)
        result.append(Feature("pad", place, (area, width), length.graph.zero, length, len(result)))
    return result


def _whole_plate(shape: ContactShape) -> list[Feature]:
    length, width, _ = shape.sizes
    return [Feature(WHOLE_PLATE, shape.marker.frame, (length, width), length, length)]


def _cells(shape: ContactShape) -> list[Feature]:
    """Cells of a bed, from the marker on."""
    length, count = shape.sizes[0], shape.whole(1)
    size = length / float(count)
    places = shape.along(*((k + 0.5) * size for k in range(count)))
    return [Feature(BED_CELL, place, (size,), length.graph.zero, size, k) for k, place in enumerate(places)]


def _strip(shape: ContactShape) -> list[Glyph]:
    """A plate, about its marker, or a bed, from its marker on."""
    length = shape.sizes[0]
    half = 0.5 * length
    return [shape.line(shape.along(*((length.graph.zero, length) if shape.kind == BED else (-half, half))))]


def _rod(shape: ContactShape) -> list[Feature]:
    """A segment or a capsule: its whole, and its ends."""
    flat, zero = shape.kind == "segment", shape.sizes[0].graph.zero
    frame = shape.marker.frame if flat else _turned(shape.marker.frame, (2, 0, 1))
    half, radius = 0.5 * shape.sizes[0], shape.sizes[1]
    thick = zero.graph.apply("max", 2.0 * radius, _SLIM * half)
    wholes = ("segment",) if flat else ("rod", "axis")  # the same again, for edges of cuboids
    return [Feature(one, frame, (half, radius), half + radius, thick) for one in wholes] + [
        Feature(end, _moved(frame, (x, zero, zero)), (radius,), radius, thick, k)
        for end in (("corner",) if flat else ("end", "tip"))
        for k, x in enumerate((-half, half))
    ]


def _polygon(shape: ContactShape) -> list[Feature]:
    frame, zero = shape.marker.frame, shape.sizes[0].graph.zero
    corners = list(zip(shape.sizes[::2], shape.sizes[1::2], strict=True))
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


def _corners(shape: ContactShape) -> list[Glyph]:
    """A line from corner to corner, closed where it goes around."""
    frames = [feature.frame for feature in shape.features() if feature.kind in ("corner", "end", "vertex")]
    return [shape.line(frames if SHAPES[shape.kind].features is _rod else [*frames, frames[0]])]


def _points(shape: ContactShape) -> list[Point]:
    """Points of a profile or an outline."""
    if shape.kind == "sprocket":
        return _sprocket(shape)[2]
    return list(zip(shape.sizes[1::2], shape.sizes[2::2], strict=True))


def _sprocket(shape: ContactShape) -> tuple[list[ProfilePart], list[Point], list[Point]]:
    _, teeth, *sizes = shape.sizes
    assert teeth.value is not None
    return sprocket_ring(int(teeth.value), *sizes)


#: Kind of shape -> its pieces from its points.
_RINGS: dict[str, Callable[[list[Point]], list[ProfilePart]]] = {
    "profile": straight_pieces,
    "smooth_profile": smooth_pieces,
    "outline": straight_ring,
    "smooth_outline": smooth_ring,
}


def _surface(shape: ContactShape) -> tuple[list[ProfilePart], list[tuple[int, Point]]]:
    """Pieces of a profile or an outline, and its corners, numbered, which meet what is flat."""
    if shape.kind == "sprocket":
        pieces, tops, _ = _sprocket(shape)
        return pieces, list(enumerate(tops))
    points = _points(shape)
    around = points if shape.kind in GROUNDS else [points[-1], *points, points[0]]
    return _RINGS[shape.kind](points), peaks(around)


def _pieces(shape: ContactShape) -> list[Feature]:
    frame, depth, zero = shape.marker.frame, shape.sizes[0], shape.sizes[0].graph.zero
    pieces, tops = _surface(shape)
    depth = solid_depth(pieces, depth)
    surface = [one for one in pieces if one.kind in ("edge", "arc")]
    own_depth = depth  # by each piece for itself
    if shape.kind == "smooth_outline" and math.isfinite(most := clearance_of_arcs(surface)):
        own_depth = zero.graph.apply("min", depth, most)
    ground = int(shape.kind in GROUNDS)
    result = [
        Feature(one.kind, one.frame(frame), (*one.sizes, own_depth), reach, depth, number=ground)
        for one, reach in ((one, None if one.open else one.half + own_depth) for one in surface)
    ]
    hollows = [*inner_corners(pieces), *hollow_arcs(pieces)]
    result += [Feature(one.kind, one.frame(frame), (*one.sizes, depth), one.half, depth) for one in hollows]
    if shape.kind not in GROUNDS:
        reach = greatest([length(one.origin) + one.half for one in surface])
        numbers = (*piece_numbers(surface), own_depth)
        result.append(Feature(INSIDE, frame, numbers, reach, depth, number=len(surface)))
    for k, (x, y) in tops:
        result.append(Feature("corner", _moved(frame, (x, y, zero)), (zero,), zero, depth, k))
    return result


def _outline(shape: ContactShape) -> list[Glyph]:
    frame, zero, points = shape.marker.frame, shape.sizes[0].graph.zero, _points(shape)
    places = [_moved(frame, (x, y, zero)) for x, y in (points if shape.kind in GROUNDS else [*points, points[0]])]
    if shape.kind in ("smooth_profile", "smooth_outline"):
        arcs = [one for one in _surface(shape)[0] if one.kind == "arc"]
        places = [_moved(one.frame(frame), (x, y, zero)) for one in arcs for x, y in arc_points(one)]
    return [shape.line(places)]


class ShapeType(NamedTuple):
    """A kind of shape: its features, its picture, and which feature it is where it is the first of a pair."""

    features: Callable[[ContactShape], list[Feature]]
    glyphs: Callable[[ContactShape], list[Glyph]]
    first: str = ""


_ROUND = ShapeType(_round, lambda shape: [Wheel(shape.marker, shape.sizes[0])], "round")
_HALF = ShapeType(_endless, lambda shape: [shape.line([_facing(shape)])._replace(about=PLANE)], "half")
_PIECED = ShapeType(_pieces, _outline, "edge")
_CORNERED = ShapeType(_polygon, _corners, POLYGON)
#: Kind of shape -> what it is.
SHAPES = {
    **dict.fromkeys(("circle", "sphere"), _ROUND),
    **dict.fromkeys(("half_plane", "half_space"), _HALF),
    **dict.fromkeys((*_RINGS, "sprocket"), _PIECED),
    **dict.fromkeys(("box", "polygon"), _CORNERED),
    "segment": ShapeType(_rod, _corners, "segment"),
    "capsule": ShapeType(_rod, _corners, "rod"),
    "ellipsoid": ShapeType(_ellipsoid, _ellipses, "ellipsoid"),
    "cuboid": ShapeType(_cuboid, _cuboid_edges, BLOCK),
    FIELD_SHAPE: ShapeType(_endless, _field_lines, FIELD),
    "plate": ShapeType(_pads, _strip),
    WHOLE_PLATE: ShapeType(_whole_plate, _strip),
    BED: ShapeType(_cells, _strip),
}
#: Shapes whose pieces are edges and arcs.
PIECED = tuple(kind for kind, one in SHAPES.items() if one is _PIECED)


def by_edges(
    first: Sequence[ContactShape], second: Sequence[ContactShape]
) -> tuple[tuple[ContactShape, ...], tuple[ContactShape, ...]]:
    """Groups in which convex outlines that meet polygons are polygons, which lie flush on each other by their edges.

    Plates meet outlines only; where a group has some, outlines of the other stay what they are.
    """

    def changed(these: Sequence[ContactShape], other: Sequence[ContactShape]) -> tuple[ContactShape, ...]:
        meets = any(shape.kind in ("box", "polygon") or shape.convex_corners() for shape in other)
        if not meets or any(shape.kind == "plate" or shape.is_wheel for shape in other):
            return tuple(these)
        result = []
        for shape in these:
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
        spread = [nx * (px - x) + ny * (py - y) for x, y in corners]
        widths.append(greatest(spread))
    return _least(widths)


def _moved(frame: Frame, by: Vec3) -> Frame:
    return Frame(frame.rotation, vec.add(frame.position, vec.times(frame.rotation, by)))


def _turned(frame: Frame, columns: tuple[int, int, int]) -> Frame:
    """A frame whose axes are x, y and z of another in another order."""
    rows = tuple((row[columns[0]], row[columns[1]], row[columns[2]]) for row in frame.rotation)
    return Frame((rows[0], rows[1], rows[2]), frame.position)
