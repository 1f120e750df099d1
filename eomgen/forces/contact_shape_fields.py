"""Force elements, shapes of contacts between groups: the kinds of shapes and their keys."""

from __future__ import annotations

from ..elements.dimensions import LENGTH, NONE
from ..elements.field import NUMBER, Field, Fields
from .contact_states import MOST_PAIRS, PLATE, POINTS

CORNERS = 64  #: most corners of a polygon

_RADIUS = Field("expression", "radius (m)", required=True, dimension=LENGTH)
_PLACE = Field("expression", "", dimension=LENGTH)
_ALONG = "length between the centres of its ends (m), along {} of the marker"


def _profile(how: str, least: int) -> Fields:
    return {
        "points": Field(
            "places",
            f"{least} or more points [x, y] from left to right that the ground runs through{how} (m)",
            required=True,
            dimension=LENGTH,
        ),
        "depth": Field(
            "expression",
            "how far the solid reaches below it (m); a tenth of its length unless given",
            dimension=LENGTH,
        ),
    }


def _outline(how: str) -> Fields:
    return {
        "points": Field(
            "corners", f"3 to {CORNERS} points [x, y] around the solid{how} (m)", required=True, dimension=LENGTH
        ),
        "depth": Field(
            "expression",
            "how far inside the outline its pieces tell by themselves which is nearest (m); half of the narrowest "
            "place, of points that are numbers, unless given",
            dimension=LENGTH,
        ),
    }


FIELD_SHAPE = "height_field"
_SIZES: dict[str, Fields] = {
    "circle": {
        "radius": _RADIUS,
        "width": Field("expression", "width across the plane (m), of wheels on soil", dimension=LENGTH),
    },
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
    "plate": {
        "length": Field("expression", "length along x of the marker (m)", required=True, dimension=LENGTH),
        "width": Field("expression", "width across the plane (m)", required=True, dimension=LENGTH),
        "points": Field(
            "expression", f"at how many points it is felt, 1 to {POINTS}", default=PLATE, level=NUMBER, dimension=NONE
        ),
    },
    "half_plane": {},
    "bed": {
        "length": Field(
            "expression", "length of the strip from the marker on along its x axis (m)", required=True, dimension=LENGTH
        ),
        "cells": Field("count", f"of how many cells it is, 1 to {MOST_PAIRS}", required=True),
    },
    "profile": _profile("", 2),
    "smooth_profile": _profile(", by a smooth curve of circular arcs", 3),
    "outline": _outline(", with straight edges between; it need not be convex"),
    "smooth_outline": _outline(", with a smooth curve of circular arcs through them"),
    "sprocket": {
        "teeth": Field("count", "number of teeth, 3 or more", required=True),
        "pitch": Field(
            "expression", "straight distance between neighbouring pins (m)", required=True, dimension=LENGTH
        ),
        "seat": Field("expression", "radius of the seats of the pins (m)", required=True, dimension=LENGTH),
        "tip_radius": Field("expression", "radius of the tips (m)", required=True, dimension=LENGTH),
        "seat_angle": Field(
            "expression", "angle over which the arc of a seat goes, 130 deg unless given (rad)", dimension=NONE
        ),
        "depth": Field(
            "expression",
            "how far inside the teeth pieces tell by themselves which is nearest (m); half of the least width of teeth "
            "unless given",
            dimension=LENGTH,
        ),
    },
    "sphere": {"radius": _RADIUS},
    "capsule": {
        "length": Field("expression", _ALONG.format("z"), required=True, dimension=LENGTH),
        "radius": _RADIUS,
    },
    "half_space": {},
    "ellipsoid": {
        "semi_axes": Field("vector", "semi-axes along x, y and z (m)", required=True, dimension=LENGTH),
    },
    "cuboid": {
        "size": Field("vector", "lengths along x, y and z (m)", required=True, dimension=LENGTH),
        "edge_radius": Field(
            "expression",
            "radius of its edges where it meets cuboids and capsules (m); a twentieth of its least length unless given",
            dimension=LENGTH,
        ),
    },
    FIELD_SHAPE: {
        "height": Field(
            "expression",
            "height z (m) of the ground over the x-y plane of the marker, an expression of ``x``, ``y``, parameters "
            "and tables",
            dimension=LENGTH,
            local={"x": _PLACE, "y": _PLACE},
        ),
        "x": Field("numbers", "instead of height: grid lines along x, strictly increasing (m)"),
        "y": Field("numbers", "grid lines along y (m)"),
        "z": Field("grid", "heights on the grid, a row for each x (m)"),
        "kind": Field("choice", "interpolation between the points", choices=("cubic", "natural")),
        "extrapolation": Field(
            "choice", "beyond the grid: keep the slope or the height", choices=("linear", "constant")
        ),
    },
}
_ON = {
    "shape": Field("choice", "kind of shape", required=True, choices=tuple(_SIZES)),
    "on": Field("on", "the marker to which it is fixed, or a list of markers that have one each", required=True),
}
#: Kind of shape -> its keys; a shape in the plane lies in the x-y plane of its marker.
SHAPE_FIELDS: dict[str, Fields] = {kind: {**_ON, **sizes} for kind, sizes in _SIZES.items()}
#: Shapes of mechanisms in the plane; the others are shapes in space.
PLANAR = (
    *("circle", "segment", "box", "polygon", "outline", "smooth_outline", "sprocket", "plate"),
    *("half_plane", "profile", "smooth_profile", "bed"),
)
#: Shapes without an end or that are ground, which do not meet each other.
GROUNDS = ("half_plane", "profile", "smooth_profile", "bed", "half_space", FIELD_SHAPE)
