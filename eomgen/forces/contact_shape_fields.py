"""Force elements, shapes of contacts between groups: the kinds of shapes and their keys."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

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
from .contact_states import MOST_PAIRS, PLATE, POINTS

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

    def map(self, value: Any, slot: Any, visitor: Any) -> Any:
        if isinstance(value, list | tuple):
            return [visitor.marker(one, slot) for one in value]
        return None if value is None else visitor.marker(value, slot)


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
            "how far inside the outline its pieces tell by themselves which is nearest (m); half of the narrowest "
            "place, of points that are numbers, unless given",
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
        "points": Scalar(f"at how many points it is felt, 1 to {POINTS}", default=PLATE, level=NUMBER, dimension=NONE),
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
            "how far inside the teeth pieces tell by themselves which is nearest (m); half of the least width of teeth "
            "unless given",
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

    def map(self, value: Any, slot: Any, visitor: Any) -> Any:
        parts = [value] if isinstance(value, Mapping) else value or ()
        return [self._mapped(part, slot, visitor) for part in parts]

    @staticmethod
    def _mapped(part: Any, slot: Any, visitor: Any) -> Any:
        if not isinstance(part, Mapping):
            return part
        made = {k: v if k == "shape" else visitor.vector(v, slot.named(k)) for k, v in part.items() if k != "on"}
        on = _ON["on"].map(part.get("on"), slot, visitor)
        return made if on is None else {**made, "on": on}

    def part(self, words: Sequence[str]) -> Field | None:
        keys = {key: field for fields in SHAPE_FIELDS.values() for key, field in fields.items()}
        return next((keys[word] for word in reversed(words) if word in keys), None)


#: Shapes of mechanisms in the plane; the others are shapes in space.
PLANAR = (
    *("circle", "segment", "box", "polygon", "outline", "smooth_outline", "sprocket", "plate"),
    *("half_plane", "profile", "smooth_profile", "bed"),
)
#: Shapes without an end or that are ground, which do not meet each other.
GROUNDS = ("half_plane", "profile", "smooth_profile", "bed", "half_space", FIELD_SHAPE)
