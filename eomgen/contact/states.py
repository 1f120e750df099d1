"""Shapes of contacts between groups: their kinds and keys, and how many parts of each class they have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from numbers import Real
from typing import Any, NamedTuple

from ..base.value_rules import as_count
from ..elements.dimensions import LENGTH, NONE
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
    Schema,
    Two,
    Vector,
    any_of,
    array,
    by,
    define,
    items,
    ref,
    typed_schema,
)

# -- parts of shapes ---------------------------------------------------------------------------------------------------


MOST_PAIRS = 2000  #: pairs that may have states: equations grow with states, and circles among themselves with squares
PLATE = 2  #: points of a plate unless given
POINTS = 8  #: most points of a plate
WHEEL = "wheel"  #: a circle with a width
BED = "bed"  #: soil that remembers by place, in cells
BED_CELL = "cell"  #: class of the cells, whose states belong to no pair
POLYGON = "polygon"  #: class of convex polygons, which meet each other with their edges
BLOCK = "block"  #: class of cuboids, which spheres and ellipsoids meet
CORE = "core"  #: class of cuboids with rounded edges, which those of other cuboids and capsules meet
INSIDE = "inside"  #: class of the insides of closed outlines, which what is deep in them meets
FIELD = "field"  #: class of height fields, whose number tells those of different heights


class FeatureKind(NamedTuple):
    """A class of features, and how many corners or pieces they have, or which height, where their laws differ by it."""

    name: str
    number: int = 0

    def __str__(self) -> str:
        return f"{self.name}{self.number or ''}"


class ShapeParts(NamedTuple):
    """A shape: its kind and how many parts of each class it has."""

    kind: str
    parts: Mapping[str, int]


def parts_of(kind: str, points: int = 0) -> ShapeParts:
    """The parts of a shape; ``points`` counts the points of an outline, profile or plate, or the teeth of a wheel.

    A wheel, which is a circle with a width, has one part, which has no states.
    """
    result = {
        "circle": {"round": 1}, "sphere": {"round": 1}, "segment": {"corner": 2},
        "box": {POLYGON: 1, "vertex": 4}, "polygon": {POLYGON: 1, "vertex": points},
        "capsule": {"rod": 1, "end": 2, "tip": 2, "axis": 1}, "ellipsoid": {"ellipsoid": 1},
        "cuboid": {"end": 8, "rounded_corner": 8, "rounded_edge": 12},
        "outline": {"corner": points}, "smooth_outline": {"corner": points},
        "sprocket": {"corner": 2 * points}, "plate": {"pad": points}, WHEEL: {"wheel": 1},
        "profile": {"corner": points - 2}, "smooth_profile": {"corner": points - 2}, BED: {BED_CELL: points},
    }  # fmt: skip
    return ShapeParts(kind, result.get(kind, {}))


def cells_of(groups: Sequence[Sequence[ShapeParts]]) -> int:
    """How many cells the beds of some groups have."""
    return sum(shape.parts.get(BED_CELL, 0) for group in groups for shape in group)


# -- from what the user gave ------------------------------------------------------------------------------------------
def _whole(raw: Any) -> int | None:
    """A whole number, also one that is written with decimals, such as 2.0; None if it is none."""
    result = as_count(raw)
    if result is not None or isinstance(raw, bool) or not isinstance(raw, Real):
        return result
    value = float(raw)
    return int(value) if value.is_integer() else None


#: Kind of shape -> the key that counts its parts, the least and the greatest number, and that where none is given.
COUNTED = {
    "plate": ("points", 1, POINTS, PLATE), "bed": ("cells", 1, MOST_PAIRS, None), "sprocket": ("teeth", 3, inf, None),
}  # fmt: skip


def count_of(kind: str, raw: Mapping[str, Any]) -> int | None:
    """How many parts a shape has; None where that is no such number."""
    key, least, most, preset = COUNTED[kind]
    count = _whole(raw.get(key, preset))
    return count if count is not None and least <= count <= most else None


def groups_of_entry(values: Mapping[str, Any]) -> list[list[ShapeParts]]:
    """The shapes of an entry's groups, as far as they can be read."""
    return [_shapes_of_entry(values[key]) for key in ("first", "second") if key in values]


def _listed(value: Any) -> list[Any]:
    if isinstance(value, list | tuple):
        return list(value)
    return value.tolist() if hasattr(value, "tolist") else [value]


def _shapes_of_entry(value: Any) -> list[ShapeParts]:
    result: list[ShapeParts] = []
    for shape in _listed(value):
        if not isinstance(shape, Mapping):
            continue
        kind = str(shape.get("shape"))
        if kind in COUNTED:
            count = count_of(kind, shape) or 0
        elif kind == "circle" and "width" in shape:
            kind, count = WHEEL, 1
        else:
            count = len(_listed(shape.get("points", ())))
        result += [parts_of(kind, count)] * len(_listed(shape.get("on")))
    return result


# -- keys of shapes ----------------------------------------------------------------------------------------------------


CORNERS = 64  #: most corners of a polygon


class Corners(Places):
    """A list of corners [x, y]."""

    schema = array(array(ref("expression"), 2, 2), 3, CORNERS)


class On(MarkerReference):
    """A marker or a list of markers."""

    schema = any_of(ref("marker"), array(ref("marker"), 1))

    def reference(self, value: Any, refer: Any) -> Any:
        many = items(value)
        return refer.marker(value) if many is None else [refer.marker(one) for one in many]


_RADIUS = Scalar("radius (m)", required=True, dimension=LENGTH)
_PLACE = Scalar("", dimension=LENGTH)
_ALONG = "length between the centres of its ends (m), along {} of the marker"


def _profile(how: str, least: int) -> Fields:
    return {
        "points": Places(
            f"{least} or more points [x, y] from left to right that the ground runs through{how} (m)",
            required=True,
            dimension=LENGTH,
        ),
        "depth": Scalar(
            "how far the solid reaches below it (m); a tenth of its length unless given",
            dimension=LENGTH,
        ),
    }


def _outline(how: str) -> Fields:
    return {
        "points": Corners(f"3 to {CORNERS} points [x, y] around the solid{how} (m)", required=True, dimension=LENGTH),
        "depth": Scalar(
            "depth inside the outline up to which its pieces determine the nearest one (m); by default, with points "
            "that are numbers, half of the narrowest width",
            dimension=LENGTH,
        ),
    }


FIELD_SHAPE = "height_field"
_SIZES: dict[str, Fields] = {
    "circle": {
        "radius": _RADIUS,
        "width": Scalar("width across the plane (m), of wheels on soil", dimension=LENGTH),
    },
    "segment": {
        "length": Scalar(_ALONG.format("x"), required=True, dimension=LENGTH),
        "radius": _RADIUS.replace(required=False, default=0),
    },
    "box": {"size": Two("lengths along x and y (m)", required=True, dimension=LENGTH)},
    "polygon": {
        "points": Corners(f"3 to {CORNERS} corners [x, y] of a convex outline (m)", required=True, dimension=LENGTH),
    },
    "plate": {
        "length": Scalar("length along x of the marker (m)", required=True, dimension=LENGTH),
        "width": Scalar("width across the plane (m)", required=True, dimension=LENGTH),
        "points": Scalar(f"number of contact points, 1 to {POINTS}", default=PLATE, level=NUMBER, dimension=NONE),
    },
    "half_plane": {},
    "bed": {
        "length": Scalar(
            "length of the strip from the marker on along its x axis (m)", required=True, dimension=LENGTH
        ),
        "cells": Count(f"of how many cells it is, 1 to {MOST_PAIRS}", required=True),
    },
    "profile": _profile("", 2),
    "smooth_profile": _profile(", by a smooth curve of circular arcs", 3),
    "outline": _outline(", with straight edges between; it need not be convex"),
    "smooth_outline": _outline(", with a smooth curve of circular arcs through them"),
    "sprocket": {
        "teeth": Count("number of teeth, 3 or more", required=True),
        "pitch": Scalar("straight distance between neighbouring pins (m)", required=True, dimension=LENGTH),
        "seat": Scalar("radius of the seats of the pins (m)", required=True, dimension=LENGTH),
        "tip_radius": Scalar("radius of the tips (m)", required=True, dimension=LENGTH),
        "seat_angle": Scalar("angle over which the arc of a seat goes, 130 deg unless given (rad)", dimension=NONE),
        "depth": Scalar(
            "depth inside the teeth up to which the pieces determine the nearest one (m); half of the least width of "
            "teeth by default",
            dimension=LENGTH,
        ),
    },
    "sphere": {"radius": _RADIUS},
    "capsule": {
        "length": Scalar(_ALONG.format("z"), required=True, dimension=LENGTH),
        "radius": _RADIUS,
    },
    "half_space": {},
    "ellipsoid": {
        "semi_axes": Vector("semi-axes along x, y and z (m)", required=True, dimension=LENGTH),
    },
    "cuboid": {
        "size": Vector("lengths along x, y and z (m)", required=True, dimension=LENGTH),
        "edge_radius": Scalar(
            "radius of its edges where it meets cuboids and capsules (m); a twentieth of its least length unless given",
            dimension=LENGTH,
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
    read = by("shapes")

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


#: Shapes of mechanisms in the plane; the others are shapes in space.
PLANAR = (
    *("circle", "segment", "box", "polygon", "outline", "smooth_outline", "sprocket", "plate"),
    *("half_plane", "profile", "smooth_profile", "bed"),
)
#: Shapes without an end or that are ground, which do not meet each other.
GROUNDS = ("half_plane", "profile", "smooth_profile", "bed", "half_space", FIELD_SHAPE)
