"""Shapes of contacts between groups: the keys of each kind, and how they are read, a shape for each marker."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from typing import Any

from ..base.value_rules import BELOW, NOT_NEGATIVE, OUTLINE, POSITIVE, RISING, SPROCKET, Flaw, sense_of_outline
from ..elements.dimensions import LENGTH, NONE
from ..elements.element_type import Entry
from ..elements.kinds import (
    NUMBER,
    Choice,
    Count,
    Field,
    Fields,
    Grid,
    MarkerReference,
    Numbers,
    Places,
    Scalar,
    Scalars,
    Schema,
    Two,
    Vector,
    any_of,
    array,
    define,
    items,
    ref,
    typed_schema,
)
from ..expr.core import Expr
from ..expr.texts import printed
from .fields import PLACES
from .profiles import half_gap, half_tooth
from .shapes import ContactShape
from .states import COUNTED, FIELD_SHAPE, MOST_PAIRS, PLATE, POINTS, count_of

Sizes = tuple[Expr, ...]

CORNERS = 64  #: most corners of a polygon
SEAT_ANGLE = math.radians(130)  #: ISO 606 allows 120 to 140 degrees
EDGES = 0.05  #: radius of the edges of a cuboid unless given, as a part of its least length


# -- kinds of keys -----------------------------------------------------------------------------------------------------
class Lengths(Scalars):
    """Three numbers or expressions [x, y, z]."""

    schema = Vector.schema
    count = 3


def _points(reader: Any, path: str, listed: Sequence[Any]) -> list[tuple[Expr, Expr]] | None:
    """Points [x, y]; None if one is none."""
    result = [reader.several(f"{path}[{k}]", point, 2, Two) for k, point in enumerate(listed)]
    points = [(point[0], point[1]) for point in result if point is not None]
    return points if len(points) == len(result) else None


def _numbers(reader: Any, points: Sequence[tuple[Expr, Expr]]) -> list[tuple[float, float]]:
    """Points whose places the declared values tell."""
    known = [(reader.known(x), reader.known(y)) for x, y in points]
    return [(x, y) for x, y in known if x is not None and y is not None]


class Corners(Places):
    """A list of corners [x, y]."""

    schema = array(array(ref("expression"), 2, 2), 3, CORNERS)
    convex = True

    def read(self, reader: Any, path: str, value: Any) -> Sizes | None:
        """x and y of the corners, counterclockwise."""
        listed = items(value)
        if listed is None or not 3 <= len(listed) <= CORNERS:
            reader.fault(path, "is no outline", f"give 3 to {CORNERS} corners [x, y]", "EG-TYPE")
            return None
        points = _points(reader, path, listed)
        if points is None:
            return None
        numbers = _numbers(reader, points)
        sense = sense_of_outline(numbers, self.convex) if len(numbers) == len(points) else 1
        if isinstance(sense, Flaw):
            reader.fault(path + sense.key, sense.message, sense.remedy, "EG-RANGE")
            return None
        reader.requirements.keep(path, OUTLINE, [x for point in points for x in point], (self.convex, sense))
        if sense < 0:
            points.reverse()
        return tuple(x for point in points for x in point)


class Outline(Corners):
    """A list of corners [x, y]."""

    convex = False


class On(MarkerReference):
    """A marker or a list of markers."""

    schema = any_of(ref("marker"), array(ref("marker"), 1))

    def reference(self, value: Any, refer: Any) -> Any:
        many = items(value)
        return refer.marker(value) if many is None else [refer.marker(one) for one in many]


# -- keys of shapes ----------------------------------------------------------------------------------------------------


_SIZE: dict[str, Any] = {"dimension": LENGTH, "allowed": POSITIVE}
_RADIUS = Scalar("radius (m)", required=True, **_SIZE)
_PLACE = Scalar("", dimension=LENGTH)
_ALONG = "length between the centres of its ends (m), along {} of the marker"


def _profile(how: str, least: int) -> Fields:
    return {
        "points": Places(
            f"{least} or more points [x, y] from left to right that the ground runs through{how} (m)",
            required=True,
            dimension=LENGTH,
        ),
        "depth": Scalar("how far the solid reaches below it (m); a tenth of its length unless given", **_SIZE),
    }


def _outline(how: str) -> Fields:
    return {
        "points": Outline(f"3 to {CORNERS} points [x, y] around the solid{how} (m)", required=True, dimension=LENGTH),
        "depth": Scalar(
            "depth inside the outline up to which its pieces determine the nearest one (m); by default, with points "
            "that are numbers, half of the narrowest width",
            **_SIZE,
        ),
    }


_SIZES: dict[str, Fields] = {
    "circle": {
        "radius": _RADIUS,
        "width": Scalar("width across the plane (m), of wheels on soil", **_SIZE),
    },
    "segment": {
        "length": Scalar(_ALONG.format("x"), required=True, **_SIZE),
        "radius": _RADIUS.replace(required=False, default=0, allowed=NOT_NEGATIVE),
    },
    "box": {"size": Two("lengths along x and y (m)", required=True, **_SIZE)},
    "polygon": {
        "points": Corners(f"3 to {CORNERS} corners [x, y] of a convex outline (m)", required=True, dimension=LENGTH),
    },
    "plate": {
        "length": Scalar("length along x of the marker (m)", required=True, **_SIZE),
        "width": Scalar("width across the plane (m)", required=True, **_SIZE),
        "points": Scalar(f"number of contact points, 1 to {POINTS}", default=PLATE, level=NUMBER, dimension=NONE),
    },
    "half_plane": {},
    "bed": {
        "length": Scalar("length of the strip from the marker on along its x axis (m)", required=True, **_SIZE),
        "cells": Count(f"of how many cells it is, 1 to {MOST_PAIRS}", required=True),
    },
    "profile": _profile("", 2),
    "smooth_profile": _profile(", by a smooth curve of circular arcs", 3),
    "outline": _outline(", with straight edges between; it need not be convex"),
    "smooth_outline": _outline(", with a smooth curve of circular arcs through them"),
    "sprocket": {
        "teeth": Count("number of teeth, 3 or more", required=True),
        "pitch": Scalar("straight distance between neighbouring pins (m)", required=True, **_SIZE),
        "seat": Scalar("radius of the seats of the pins (m)", required=True, **_SIZE),
        "tip_radius": Scalar("radius of the tips (m)", required=True, **_SIZE),
        "seat_angle": Scalar("angle over which the arc of a seat goes, 130 deg unless given (rad)", dimension=NONE),
        "depth": Scalar(
            "depth inside the teeth up to which the pieces determine the nearest one (m); half of the least width of "
            "teeth by default",
            **_SIZE,
        ),
    },
    "sphere": {"radius": _RADIUS},
    "capsule": {
        "length": Scalar(_ALONG.format("z"), required=True, **_SIZE),
        "radius": _RADIUS,
    },
    "half_space": {},
    "ellipsoid": {
        "semi_axes": Lengths("semi-axes along x, y and z (m)", required=True, **_SIZE),
    },
    "cuboid": {
        "size": Lengths("lengths along x, y and z (m)", required=True, **_SIZE),
        "edge_radius": Scalar(
            "radius of its edges where it meets cuboids and capsules (m); a twentieth of its least length unless given",
            **_SIZE,
        ),
    },
    FIELD_SHAPE: {
        "height": Scalar(
            "height z (m) of the ground over the x-y plane of the marker, an expression of ``x``, ``y``, parameters "
            "and tables",
            dimension=LENGTH,
            local={"x": _PLACE, "y": _PLACE},
        ),
        "x": Numbers("instead of height: grid lines along x, strictly increasing (m)"),
        "y": Numbers("grid lines along y (m)"),
        "z": Grid("heights on the grid, a row for each x (m)"),
        "kind": Choice("interpolation between the points", choices=("cubic", "natural")),
        "extrapolation": Choice("beyond the grid: keep the slope or the height", choices=("linear", "constant")),
    },
}
_ON = {
    "shape": Choice("kind of shape", required=True, choices=tuple(_SIZES)),
    "on": On("the marker to which it is fixed, or a list of markers that have one each", required=True),
}
#: Kind of shape -> its keys; a shape in the plane lies in the x-y plane of its marker.
SHAPE_FIELDS: dict[str, Fields] = {kind: {**_ON, **sizes} for kind, sizes in _SIZES.items()}


# -- sizes of shapes ---------------------------------------------------------------------------------------------------
def _count(e: Entry, kind: str) -> Expr | None:
    """How many parts a shape has; None where that is no such number, which is noted."""
    count, (key, least, most, _) = count_of(kind, e.values), COUNTED[kind]
    if count is None:
        remedy = f"give a whole number {f'of {least} or more' if most == math.inf else f'from {least} to {most}'}"
        e.fault(key, f"is {printed(e.values[key])}", remedy, "EG-RANGE")
        return None
    return e.graph.constant(float(count))


def _in_order(*keys: str) -> Callable[[Entry], Sizes | None]:
    """The sizes of some keys, of those that need not be there the ones that are."""
    return lambda e: tuple(e[key] for key in keys if key in e.values or e.fields[key].default is not None)


def _counted(kind: str, *keys: str) -> Callable[[Entry], Sizes | None]:
    """Some sizes, and how many parts there are."""

    def sizes(e: Entry) -> Sizes | None:
        lengths, count = _in_order(*keys)(e), _count(e, kind)
        return None if lengths is None or count is None else (*lengths, count)

    return sizes


def _box(e: Entry) -> Sizes | None:
    if (size := e["size"]) is None:
        return None
    x, y = 0.5 * size[0], 0.5 * size[1]
    return (-x, -y, x, -y, x, y, -x, y)


def _outline_sizes(e: Entry) -> Sizes | None:
    """Depth and points, clockwise, of an outline whose corners are known, counterclockwise."""
    if (corners := e["points"]) is None:
        return None
    points = list(zip(corners[::2], corners[1::2], strict=True))[::-1]
    numbers, known = _numbers(e.reader, points), all(x.value is not None for x in corners)
    depth: Expr | None = e["depth"]
    if depth is not None:
        depth = e.graph.apply("min", depth, half_gap(numbers)) if known else depth
    elif known:
        depth = e.graph.constant(half_gap(numbers))
    else:
        e.missing("depth", "points with parameters do not determine it; give a length")
        depth = e.stand_in
    return (depth, *(x for point in points for x in point))


def _sprocket(e: Entry) -> Sizes | None:
    """Depth, number of teeth, pitch, radii of seats and tips, angle of a seat."""
    if (teeth := _count(e, "sprocket")) is None:
        return None
    sizes = [e[key] for key in ("pitch", "seat", "tip_radius")]
    sizes.append(e["seat_angle"] if "seat_angle" in e.values else e.graph.constant(SEAT_ANGLE))
    number = int(teeth.value or 0)
    if e.at_fault() or e.reader.requirements.judge(e.path, SPROCKET, sizes, (number,)):
        return None
    depth = e["depth"]
    return (half_tooth(number, *sizes) if depth is None else depth, teeth, *sizes)


def _profile_sizes(least: int) -> Callable[[Entry], Sizes | None]:
    """Depth and points of a profile, from left to right."""

    def sizes(e: Entry) -> Sizes | None:
        listed, place = items(e.values["points"]), f"{e.path}.points"
        if listed is None or len(listed) < least:
            e.fault("points", "is no profile", f"give {least} or more points [x, y] from left to right", "EG-TYPE")
            return None
        points = _points(e.reader, place, listed)
        if points is None:
            return None
        for k, ((a, _), (b, _)) in enumerate(itertools.pairwise(points)):
            if e.reader.requirements.judge(f"{place}[{k + 1}]", RISING, [a, b]):
                return None
        depth = e["depth"]
        return (
            0.1 * (points[-1][0] - points[0][0]) if depth is None else depth,
            *(x for point in points for x in point),
        )

    return sizes


def _cuboid(e: Entry) -> Sizes | None:
    """Its lengths and the radius of its edges."""
    if (size := e["size"]) is None:
        return None
    least, radius = reduce(lambda a, b: a.graph.apply("min", a, b), size), e["edge_radius"]
    if radius is None:
        return (*size, EDGES * least)
    phrases = ("is {:g}", "must be less than half of its least length, {1:g}")
    e.judge("edge_radius", BELOW, [radius, 0.5 * least], phrases)
    return (*size, radius)


def _height(e: Entry) -> Sizes | None:
    """The height of a field, as an expression or a table of its own."""
    graph, local = e.graph, {name: e.graph.symbol(symbol) for name, symbol in PLACES.items()}
    table = {key: value for key, value in e.values.items() if key not in ("shape", "on", "height")}
    if "height" in e.values:
        for key in table:
            e.fault(key, "stands beside height", "give height, or x, y and z")
        return (e.law("height", local, exclusive=False),)
    if missing := [key for key in ("x", "y", "z") if key not in table]:
        remedy = "give height, an expression of x and y, or the grid lines x and y and the heights z on them"
        e.fault(missing[0], "is missing, and there is no height", remedy, "EG-MISSING")
        return None
    taken = {f.name for f in (*graph.functions.values(), *(f for f, _ in graph.calls.values()))}
    name = re.sub(r"\W+", "_", e.path).strip("_")
    while name in taken:
        name += "_"
    function = e.reader.table(name, e.path, table)
    return None if function is None else (Expr(graph, graph.call(function, (0, 0), [x.id for x in local.values()])),)


#: Kind of shape -> its sizes as a :class:`~.shapes.ContactShape` has them; None where one is at fault.
_READ: dict[str, Callable[[Entry], Sizes | None]] = {
    "circle": _in_order("radius", "width"),
    "segment": _in_order("length", "radius"),
    "box": _box,
    "polygon": lambda e: e["points"],
    "plate": _counted("plate", "length", "width"),
    "half_plane": _in_order(),
    "bed": _counted("bed", "length"),
    "profile": _profile_sizes(2),
    "smooth_profile": _profile_sizes(3),
    "outline": _outline_sizes,
    "smooth_outline": _outline_sizes,
    "sprocket": _sprocket,
    "sphere": _in_order("radius"),
    "capsule": _in_order("length", "radius"),
    "half_space": _in_order(),
    "ellipsoid": lambda e: e["semi_axes"],
    "cuboid": _cuboid,
    FIELD_SHAPE: _height,
}


# -- lists of shapes ---------------------------------------------------------------------------------------------------
def _shape_schema() -> Schema:
    schemas = {kind: typed_schema(fields, kind, "shape") for kind, fields in SHAPE_FIELDS.items()}
    schemas[FIELD_SHAPE]["oneOf"] = [{"required": ["height"]}, {"required": ["x", "y", "z"]}]
    return {"oneOf": [*schemas.values()]}


class ContactShapes(Field):
    """A list of shapes {shape, on, ...}."""

    argument, annotation = "sequence of mapping", "Sequence[Mapping[str, Any]] | Mapping[str, Any]"
    holds = "marker"
    schema = any_of(ref("contact_shape"), array(ref("contact_shape"), 1))
    defines = define("contact_shape", _shape_schema)[1]

    def read(self, reader: Any, path: str, value: Any) -> tuple[ContactShape, ...] | None:
        """The shapes of a group; None if anything is wrong with them, which is noted."""
        listed = [value] if isinstance(value, Mapping) else items(value)
        if listed is None:
            reader.wrong(path, value, self)
            return None
        if not listed:
            remedy = "give at least one shape, such as {shape: circle, on: wheel, radius: 0.1}"
            reader.fault(path, "has no shapes", remedy, "EG-MISSING")
            return None
        result = [shape for k, raw in enumerate(listed) for shape in self._shapes(reader, f"{path}[{k}]", raw)]
        return None if reader.faults.under(path) else tuple(result)

    def _shapes(self, reader: Any, path: str, raw: Any) -> list[ContactShape]:
        """The shapes of a mapping, one for each marker."""
        if not isinstance(raw, Mapping):
            reader.wrong(path, raw, self)
            return []
        kind = reader.type_of(path, raw, SHAPE_FIELDS, "shape", "shape")
        if not kind:
            return []
        e = Entry(reader, "", path, dict(raw))
        e.fields = SHAPE_FIELDS[kind]
        reader.check_keys(path, raw, e.fields)
        if e.at_fault():
            return []
        many = items(raw["on"])
        if many is not None and not many:
            e.fault("on", "names no marker", "give a body or a marker, or a list of them", "EG-MISSING")
        places = [(f"{path}.on", raw["on"])] if many is None else [(f"{path}.on[{k}]", x) for k, x in enumerate(many)]
        markers, sizes = [reader.marker(*place) for place in places], _READ[kind](e)
        return [] if sizes is None else [ContactShape(kind, marker, sizes) for marker in markers if marker is not None]

    def reference(self, value: Any, refer: Any) -> Any:
        listed = [value] if isinstance(value, Mapping) else items(value)
        return (
            value if listed is None else [self._refer(part, refer) for part in listed]
        )  # reading tells what is no list

    @staticmethod
    def _refer(shape: Any, refer: Any) -> Any:
        if not isinstance(shape, Mapping) or "on" not in shape:
            return shape
        return {**shape, "on": _ON["on"].reference(shape["on"], refer)}

    def map(self, value: Any, visitor: Any) -> Any:
        parts = [value] if isinstance(value, Mapping) else value or ()
        return [self._mapped(part, visitor) for part in parts]

    @staticmethod
    def _mapped(part: Any, visitor: Any) -> Any:
        if not isinstance(part, Mapping):
            return part
        made = {k: v if k == "shape" else visitor.vector(v) for k, v in part.items() if k != "on"}
        on = _ON["on"].map(part.get("on"), visitor)
        return made if on is None else {**made, "on": on}

    def part(self, path: Sequence[str]) -> Field | None:
        keys = {key: field for fields in SHAPE_FIELDS.values() for key, field in fields.items()}
        return next((keys[word] for word in reversed(path) if word in keys), None)
