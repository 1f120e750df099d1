"""Force elements, contacts between groups: which features of shapes meet, and how one touches another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ..frames import Marker
from ..graph.core import Expr, Graph
from ..graph.vectors import Mat3, Vec3
from .contact import Contact, SpherePlane, joint_radius
from .contact_blocks import BlockEllipsoid
from .contact_ellipsoids import EllipsoidEllipsoid, EllipsoidPlane, EllipsoidRod, EllipsoidRound
from .contact_fields import FieldEllipsoid, FieldRound, HeightField
from .contact_insides import BowlRound, InsideRound, NotchRound
from .contact_polygons import PolygonPolygon
from .contact_profiles import WALLS, ArcRound, EdgeRound
from .contact_rounds import PolygonRound, RoundRound, SegmentRound
from .contact_shapes import SOLE, greatest
from .contact_solids import BlockRound, EdgeRod, RodRod
from .contact_states import BLOCK, CORE, HOLLOW, INSIDE, MET, POLYGON, part_of
from .normal_laws import ElasticPart

#: Features at which an overlap acts back, with the elastic part of the law alone.
HOLLOWS = ("notch", "bowl")
#: Features of the first shapes of :data:`~.contact_states.MET` that have several.
_SURFACES = {"ground": ("edge", "arc"), HOLLOW: HOLLOWS}
#: Classes of features that meet: the first is a surface, or both are of one class.
MEETINGS = tuple((one, soft) for own, met in MET.items() for one in _SURFACES.get(own, (own,)) for soft in met)


def meet(kinds: tuple[str, str]) -> bool:
    """Whether features of two classes meet, in this order."""
    return (part_of(kinds[0]), part_of(kinds[1])) in MEETINGS


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
    spot: int = 0,
    field: HeightField | None = None,
) -> Contact:
    """The contact of one feature with another at one of its places; ``law`` has the laws."""
    first, radius = sizes[0], sizes[1][0]
    normal = law.normal_law.at(lambda: joint_radius(first[0], radius) if kinds[0] == "round" else radius)
    friction = law.friction
    if kinds[1] == "pad":
        area, width = sizes[1]
        normal, radius = normal.on_pad(area, width), radius.graph.zero
        friction = None if friction is None else friction.on_pad(area)
    laws = (law.name, *markers, normal, friction)
    if kinds[0] == "round":
        return RoundRound(*laws, (first[0], radius))
    if part_of(kinds[1]) == POLYGON:
        return PolygonPolygon(*laws, first, sizes[1], spot)
    if kinds[1] == "ellipsoid":
        x, y, z = sizes[1]
        if field is not None:
            return FieldEllipsoid(*laws, field, (x, y, z))
        if kinds[0] == "half":
            return EllipsoidPlane(*laws, (x, y, z))
        if kinds[0] == BLOCK:
            return BlockEllipsoid(*laws, (first[0], first[1], first[2]), (x, y, z))
        return EllipsoidEllipsoid(*laws, ((first[0], first[1], first[2]), (x, y, z)))
    if field is not None:
        return FieldRound(*laws, field, radius)
    if kinds[0] == "ellipsoid":
        x, y, z = first
        return (
            EllipsoidRod(*laws, (x, y, z), sizes[1][1], radius)
            if kinds[1] == "rod"
            else (EllipsoidRound(*laws, (x, y, z), radius))
        )
    if kinds[0] in (BLOCK, CORE):
        x, y, z, edge = first
        return BlockRound(*laws, (x, y, z), edge, radius)
    if kinds[0] == "brim":
        return EdgeRod(*laws, (first[0], sizes[1][0]), (first[1], sizes[1][1]))
    if kinds[1] == "rod":
        return RodRod(*laws, (first[0], sizes[1][0]), (first[1], sizes[1][1]))
    if kinds[0] == "half":
        return SpherePlane(*laws, radius)
    if kinds[0] in HOLLOWS:
        elastic = (law.name, *markers, ElasticPart(normal), None)
        return (NotchRound if kinds[0] == "notch" else BowlRound)(*elastic, first, radius)
    if part_of(kinds[0]) == INSIDE:
        return InsideRound(*laws, first, radius)
    if kinds[1] == "rim" and kinds[0] == "edge":
        first = (*first[:WALLS], radius.graph.zero, *first[WALLS + 1 :])  # soil has no energy that parts could share
    if kinds[0] in ("edge", "arc"):
        return (EdgeRound if kinds[0] == "edge" else ArcRound)(*laws, first, radius)
    if kinds[0] in ("segment", "rod"):
        return SegmentRound(*laws, first[0], (first[1], radius))
    return PolygonRound(*laws, first, radius)


def turning_radius(kind: str, sizes: Sequence[Expr], graph: Graph) -> Expr:
    """How far points of a feature are from its centre that its turning moves along a normal; 0 of what is round."""
    if kind == "ellipsoid":
        return greatest(sizes)
    if part_of(kind) == POLYGON:
        return sizes[-1]  # of the numbers that matter, see PolygonPolygon
    if kind == SOLE:
        return sizes[0]
    return sizes[0] + sizes[1] if kind in ("rod", "brim", "spine") else graph.zero
