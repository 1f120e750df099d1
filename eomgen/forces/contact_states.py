"""Force elements, states of contacts between groups: kinds of shapes -> the states that pairs of them have.

A pair is a shape with a surface, or a round one, beside a part of another shape that meets it: a circle, a corner, a
point of a plate.  The pieces of a profile share the states of their shape.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any, NamedTuple

from ..base.value_rules import as_count

MOST_PAIRS = 2000  #: pairs that may have states: equations grow with states, and circles among themselves with squares
PLATE = 2  #: points of a plate unless given
POINTS = 8  #: most points of a plate
WHEEL = "wheel"  #: a circle with a width
BED = "bed"  #: soil that remembers by place, in cells
BED_CELL = "cell"  #: class of the cells, whose states belong to no pair
TEETH = 3  #: fewest teeth of a sprocket
#: Parts that meet surfaces, in the order in which their states stand.
PARTS = ("round", "corner", "vertex", "end", "ellipsoid", "rod", "pad", "polygon")
#: Parts that meet surfaces and have no states.
STATELESS = ("rim", "sole", "knob", "tip", "brim", "spine")
POLYGON = "polygon"  #: class of convex polygons, which meet each other with their edges
BLOCK = "block"  #: class of cuboids, which spheres and ellipsoids meet
CORE = "core"  #: class of cuboids with rounded edges, which those of other cuboids and capsules meet
INSIDE = "inside"  #: class of the insides of closed outlines, which what is deep in them meets
HOLLOW = "hollow"  #: class of places of outlines where parts of an overlap grow together
FIELD = "field"  #: class of height fields, of which those of one height have one number
_ROUND = ("round", "rod", POLYGON)
#: Classes of first parts that are told apart; all others are surfaces.
_APART = (*_ROUND, "ellipsoid", BLOCK)
#: Kind of shape -> what it is where it is the first of a pair.
_FIRST = {
    "circle": "round", "sphere": "round", "capsule": "rod", "segment": "segment", "box": POLYGON, "polygon": POLYGON,
    "profile": "ground", "smooth_profile": "ground", "outline": "ground", "smooth_outline": "ground",
    "sprocket": "ground", "half_plane": "half", "half_space": "half",
    "ellipsoid": "ellipsoid", "cuboid": BLOCK, "height_field": FIELD,
}  # fmt: skip
#: What is met by each of these.
MET = {
    "round": ("round",),
    "rod": ("round", "rod"),
    "ellipsoid": ("round", "rod", "ellipsoid"),
    BLOCK: ("round", "ellipsoid"),
    CORE: ("knob", "tip"),
    "brim": ("brim", "spine"),
    FIELD: ("round", "end", "ellipsoid"),
    "segment": ("round", "corner", "vertex"),
    POLYGON: ("round", "corner", POLYGON),
    "ground": ("round", "corner", "vertex", "pad", "rim"),
    INSIDE: ("round", "corner", "vertex", "pad"),
    HOLLOW: ("round", "corner"),
    "half": ("round", "corner", "vertex", "end", "ellipsoid", "pad", "rim"),
    BED_CELL: ("rim", "sole"),
}


class ShapeParts(NamedTuple):
    """A shape: its kind and how many parts of each class it has."""

    kind: str
    parts: Mapping[str, int]


class PairStates(NamedTuple):
    """Where the pairs of some first shapes with parts of one class stand among all pairs."""

    start: int
    columns: int
    rows: Mapping[int, int]  #: number of the first shape in its group -> row
    once: bool  #: whether the parts meet among themselves, each two once
    places: int = 1  #: how many places of contact a pair has

    def of_first(self, shape: int, row: int) -> int:
        """The number of a first part: of its shape, or where parts meet among themselves of its number among these."""
        if self.once:
            return self.start + self.places * (row * self.columns - row * (row + 1) // 2 - row - 1)
        return self.start + self.places * self.rows[shape] * self.columns


def parts_of(kind: str, points: int = 0) -> ShapeParts:
    """The parts of a shape; ``points`` counts the points of an outline, profile or plate, or the teeth of a wheel.

    A wheel, which is a circle with a width, has one part, which has no states.
    """
    found = {
        "circle": {"round": 1}, "sphere": {"round": 1}, "segment": {"corner": 2},
        "box": {POLYGON: 1, "vertex": 4}, "polygon": {POLYGON: 1, "vertex": points},
        "capsule": {"rod": 1, "end": 2, "tip": 2, "spine": 1}, "ellipsoid": {"ellipsoid": 1},
        "cuboid": {"end": 8, "knob": 8, "brim": 12},
        "outline": {"corner": points}, "smooth_outline": {"corner": points},
        "sprocket": {"corner": 2 * points}, "plate": {"pad": points}, WHEEL: {"rim": 1},
        "profile": {"corner": points - 2}, "smooth_profile": {"corner": points - 2}, BED: {BED_CELL: points},
    }  # fmt: skip
    return ShapeParts(kind, found.get(kind, {}))


def pair_states(groups: Sequence[Sequence[ShapeParts]]) -> tuple[dict[tuple[int, int, str, str], PairStates], int]:
    """Blocks of pairs by (group of the first, of the second, class of the first, class of the second); all pairs."""
    found: dict[tuple[int, int, str, str], PairStates] = {}
    start = 0
    for g, h in [(0, 0)] if len(groups) == 1 else [(0, 1), (1, 0)]:
        for first in (*_APART, "surface"):
            for second in PARTS:
                if first == second and g > h:  # met already
                    continue
                columns = sum(shape.parts.get(second, 0) for shape in groups[h])
                own = [k for k, shape in enumerate(groups[g]) if _meets(shape.kind, first, second)]
                if not own or not columns:
                    continue
                once = first == second and g == h
                count = sum(groups[g][k].parts[second] for k in own) if first == second else len(own)
                places = places_of((first, second))
                block = PairStates(start, columns, {shape: row for row, shape in enumerate(own)}, once, places)
                found[g, h, first, second] = block
                start += places * (count * (count - 1) // 2 if once else len(own) * columns)
    return found, start


def class_of(feature: str, met: str) -> str:
    """The class of a first part: its own where parts of one class meet each other, else that of surfaces."""
    own, other = part_of(feature), part_of(met)
    return own if own in _APART and (own != POLYGON or other == POLYGON) else "surface"


def part_of(feature: str) -> str:
    """The class of a feature, whatever the number of its corners."""
    return feature.rstrip("0123456789")


def alike(first: str, second: str) -> bool:
    """Whether two features are of one class, whose parts meet each other once."""
    return part_of(first) == part_of(second)


def places_of(kinds: tuple[str, str]) -> int:
    """At how many places two features touch."""
    return 2 if part_of(kinds[0]) == part_of(kinds[1]) == POLYGON else 1


def _meets(kind: str, first: str, second: str) -> bool:
    own = _FIRST.get(kind, "")
    return own != "" and class_of(own, second) == first and second in MET[own]


def cells_of(groups: Sequence[Sequence[ShapeParts]]) -> int:
    """How many cells the beds of some groups have."""
    return sum(shape.parts.get(BED_CELL, 0) for group in groups for shape in group)


# -- from what the user gave ------------------------------------------------------------------------------------------
def _whole(given: Any) -> int | None:
    """A whole number, also one that is written with decimals, such as 2.0; None if it is none."""
    found = as_count(given)
    if found is not None or isinstance(given, bool) or not isinstance(given, Real):
        return found
    value = float(given)
    return int(value) if value.is_integer() else None


def points_of_plate(given: Mapping[str, Any]) -> int | None:
    """At how many points a plate is felt; None where that is no number."""
    count = _whole(given.get("points", PLATE))
    return count if count is not None and 1 <= count <= POINTS else None


def cells_of_bed(given: Mapping[str, Any]) -> int | None:
    """How many cells a bed has; None where that is no number."""
    count = _whole(given.get("cells"))
    return count if count is not None and 1 <= count <= MOST_PAIRS else None


def teeth_of_sprocket(given: Mapping[str, Any]) -> int | None:
    """How many teeth a sprocket has; None where that is no number."""
    count = _whole(given.get("teeth"))
    return count if count is not None and count >= TEETH else None


def given_groups(values: Mapping[str, Any]) -> list[list[ShapeParts]]:
    """The shapes of an entry's groups, as far as they can be read."""
    return [_given_shapes(values[key]) for key in ("first", "second") if key in values]


def _listed(value: Any) -> list[Any]:
    if isinstance(value, list | tuple):
        return list(value)
    return value.tolist() if hasattr(value, "tolist") else [value]


def _given_shapes(value: Any) -> list[ShapeParts]:
    found: list[ShapeParts] = []
    for shape in _listed(value):
        if not isinstance(shape, Mapping):
            continue
        kind = str(shape.get("shape"))
        if kind == "plate":
            count = points_of_plate(shape) or 0
        elif kind == "sprocket":
            count = teeth_of_sprocket(shape) or 0
        elif kind == BED:
            count = cells_of_bed(shape) or 0
        elif kind == "circle" and "width" in shape:
            kind, count = WHEEL, 1
        else:
            count = len(_listed(shape.get("points", ())))
        found += [parts_of(kind, count)] * len(_listed(shape.get("on")))
    return found
