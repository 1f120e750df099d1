"""Shapes of contacts between groups: how many parts of each class they have, whose states follow from these."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from numbers import Real
from typing import Any, NamedTuple

from ..base.value_rules import as_count

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
FIELD_SHAPE = "height_field"


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


#: Shapes of mechanisms in the plane; the others are shapes in space.
PLANAR = (
    *("circle", "segment", "box", "polygon", "outline", "smooth_outline", "sprocket", "plate"),
    *("half_plane", "profile", "smooth_profile", "bed"),
)
#: Shapes without an end or that are ground, which do not meet each other.
GROUNDS = ("half_plane", "profile", "smooth_profile", "bed", "half_space", FIELD_SHAPE)
