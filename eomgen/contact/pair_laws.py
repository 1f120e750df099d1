"""Contacts between groups: the table of features that meet, the states of pairs, and the law of one kind of pair."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from operator import add
from typing import Any, NamedTuple, cast

from ..elements.forces.force import MarkerLoad, View, where
from ..elements.forces.friction import DryFriction
from ..elements.forces.normal_laws import NormalLaw, PartlyDamped
from ..elements.frames import Frame, Marker
from ..expr import vectors as vec
from ..expr.core import Expr, Graph, reachable, substitute
from ..expr.differentiate import jvp
from ..expr.vectors import Mat3, Vec3
from .ellipsoids import BlockEllipsoid, EllipsoidEllipsoid, EllipsoidPlane, EllipsoidRod, EllipsoidRound
from .fields import FieldEllipsoid, FieldRound, planted
from .limits import NOWHERE
from .pair_features import CHOSEN, EDGE, FIRST, OTHER, PIECE
from .pair_sums import POSE
from .pairs import PairKind
from .point import Contact, SpherePlane, joint_radius
from .polygons import PolygonPolygon
from .profiles import WALLS, ArcRound, EdgeRound, HollowArcRound, InnerCornerRound, InsideRound, ProfilePiece
from .rounds import (
    AtHeight,
    CoreRound,
    EdgeEdge,
    EdgeRod,
    PolygonRound,
    RodCorner,
    RodRod,
    SharedEnergy,
)
from .shapes import SHAPES, WHOLE_PLATE, greatest
from .soil_beds import SoilCell
from .soil_wheels import SoilWheel
from .states import BED_CELL, BLOCK, CORE, FIELD, INSIDE, POLYGON, FeatureKind, ShapeParts

# -- features that meet ------------------------------------------------------------------------------------------------


#: Features at which an overlap acts back, with the elastic part of the law alone.
HOLLOWS = ("inner_corner", "hollow_arc")


class FeaturePair(NamedTuple):
    """What the contact of two features is made of."""

    laws: tuple[str, Marker, Marker, NormalLaw, DryFriction | None]
    first: Any  #: sizes
    second: Any
    radius: Expr  #: of the second, where it is a point with a radius
    witness: int  #: which of several places of contact it is
    field: Any  #: of a height field alone
    height: Callable[[], Vec3] | None  #: from the plane of the first to the second, of shapes of the plane
    ground: bool  #: whether the first is a piece of a profile


Make = Callable[[FeaturePair], Contact]


def _each(first: str, second: Sequence[str], make: Make) -> dict[tuple[str, str], Make]:
    return {(first, one): make for one in second}


def _on_core(g: FeaturePair) -> Contact:
    """On a core with half lengths and a radius as sizes."""
    *halves, radius = g.first
    return CoreRound(*g.laws, tuple(halves), (radius, g.radius))


def _two_rods(g: FeaturePair) -> tuple[tuple[Expr, Expr], tuple[Expr, Expr]]:
    return (g.first[0], g.second[0]), (g.first[1], g.second[1])


def _on(kind: type[ProfilePiece]) -> Make:
    return lambda g: kind(*g.laws, g.first, g.radius, g.ground)


def _in_hollow(kind: type[ProfilePiece]) -> Make:
    return lambda g: kind(*g.laws[:3], PartlyDamped(g.laws[3], g.radius.graph.zero), None, g.first, g.radius)


def _wheel_on_edge(g: FeaturePair) -> Contact:
    """On soil, which has no energy that parts could share."""
    return EdgeRound(*g.laws, (*g.first[:WALLS], g.radius.graph.zero, *g.first[WALLS + 1 :]), g.radius, g.ground)


def _on_cell(kind: str) -> Make:
    return lambda g: SoilCell(*g.laws, kind, g.second, g.first[0], None if g.height is None else g.height())


#: Features that points may pass, however thick the bodies of these are, and the points.
_THIN, _POINTS = ("segment", "edge", "arc", "rod", CORE), ("vertex", "pad", "rounded_corner")
_OUTLINED = ("round", "corner", "vertex", "pad")
#: Features that meet -> their contact.  The first is a surface, or both are of one class.
MEETINGS: dict[tuple[str, str], Make] = {
    ("round", "round"): _on_core,
    ("rod", "rod"): lambda g: RodRod(*g.laws, *_two_rods(g)),
    ("rod", "round"): _on_core,
    ("rod", "rounded_corner"): lambda g: RodCorner(*g.laws, g.first[:1], (g.first[1], g.radius), g.second[1:]),
    **_each("segment", ("round", "corner", "vertex"), _on_core),
    ("ellipsoid", "round"): lambda g: EllipsoidRound(*g.laws, g.first, g.radius),
    ("ellipsoid", "rod"): lambda g: EllipsoidRod(*g.laws, g.first, g.second[1], g.radius),
    ("ellipsoid", "ellipsoid"): lambda g: EllipsoidEllipsoid(*g.laws, (g.first, g.second)),
    (BLOCK, "round"): _on_core,
    (BLOCK, "ellipsoid"): lambda g: BlockEllipsoid(*g.laws, g.first[:3], g.second),
    **_each(CORE, ("rounded_corner", "tip"), _on_core),
    ("rounded_edge", "rounded_edge"): lambda g: EdgeEdge(*g.laws, *_two_rods(g)),
    ("rounded_edge", "axis"): lambda g: EdgeRod(*g.laws, *_two_rods(g), g.first[2:]),
    **_each(FIELD, ("round", "end"), lambda g: FieldRound(*g.laws, g.field, g.radius)),
    (FIELD, "ellipsoid"): lambda g: FieldEllipsoid(*g.laws, g.field, g.second),
    **_each(POLYGON, ("round", "corner"), lambda g: PolygonRound(*g.laws, g.first, g.radius)),
    (POLYGON, POLYGON): lambda g: PolygonPolygon(*g.laws, g.first, g.second, g.witness),
    **_each("edge", _OUTLINED, _on(EdgeRound)),
    ("edge", "wheel"): _wheel_on_edge,
    **_each("arc", (*_OUTLINED, "wheel"), _on(ArcRound)),
    **_each(INSIDE, _OUTLINED, _on(InsideRound)),
    **_each("inner_corner", ("round", "corner"), _in_hollow(InnerCornerRound)),
    **_each("hollow_arc", ("round", "corner"), _in_hollow(HollowArcRound)),
    **_each("half", (*_OUTLINED, "end", "wheel"), lambda g: SpherePlane(*g.laws, g.radius)),
    ("half", "ellipsoid"): lambda g: EllipsoidPlane(*g.laws, g.second),
    (BED_CELL, "wheel"): _on_cell("wheel"),
    (BED_CELL, WHOLE_PLATE): _on_cell(WHOLE_PLATE),
}


class ShapeMotion(NamedTuple):
    """A shape's place and motion, ground axes."""

    position: Vec3
    rotation: Mat3
    velocity: Vec3
    angular_velocity: Vec3


def touching(names: tuple[str, str], raw: FeaturePair) -> Contact:
    """The contact of one feature with another at one of its places, by laws that are not yet of their radii."""
    normal, friction = raw.laws[3:]
    normal = normal.at(lambda: joint_radius(raw.first[0], raw.radius) if names[0] == "round" else raw.radius)
    radius = raw.radius
    if names[1] == "pad":
        area, width = raw.second
        normal, radius = normal.on_pad(area, width), radius.graph.zero
        friction = None if friction is None else friction.on_pad(area)
    return MEETINGS[names](raw._replace(laws=(*raw.laws[:3], normal, friction), radius=radius))


def turning_radius(kind: str, sizes: Sequence[Expr], graph: Graph) -> Expr:
    """How far points of a feature are from its centre that its turning moves along a normal; 0 of what is round."""
    if kind == "ellipsoid":
        return greatest(sizes)
    if kind == POLYGON:
        return sizes[-1]  # of the numbers that matter, see PolygonPolygon
    if kind == WHOLE_PLATE:
        return sizes[0]
    return sizes[0] + sizes[1] if kind in ("rod", "rounded_edge", "axis") else graph.zero


# -- states of pairs ---------------------------------------------------------------------------------------------------

# A pair is a shape with a surface, or a round one, beside a part of another shape that meets it: a circle, a corner, a
# point of a plate.  The pieces of a profile share the states of their shape.


#: Parts that meet surfaces, in the order in which their states stand.
PARTS = ("round", "corner", "vertex", "end", "ellipsoid", "rod", "pad", "polygon")
#: Classes of first parts of which each has states of its own; those of all others are of surfaces.
_APART = ("round", "rod", POLYGON, "ellipsoid", BLOCK)


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


def pair_states(groups: Sequence[Sequence[ShapeParts]]) -> tuple[dict[tuple[int, int, str, str], PairStates], int]:
    """Blocks of pairs by (group of the first, of the second, class of the first, class of the second); all pairs."""
    result: dict[tuple[int, int, str, str], PairStates] = {}
    start = 0
    for g, h in [(0, 0)] if len(groups) == 1 else [(0, 1), (1, 0)]:
        for first in (*_APART, "surface"):
            for second in PARTS:
                if first == second and g > h:  # met already
                    continue
                columns = sum(shape.parts.get(second, 0) for shape in groups[h])
                members = [k for k, shape in enumerate(groups[g]) if _meets(shape.kind, first, second)]
                if not members or not columns:
                    continue
                once = first == second and g == h
                count = sum(groups[g][k].parts[second] for k in members) if first == second else len(members)
                places = places_of((first, second))
                block = PairStates(start, columns, {shape: row for row, shape in enumerate(members)}, once, places)
                result[g, h, first, second] = block
                start += places * (count * (count - 1) // 2 if once else len(members) * columns)
    return result, start


def class_of(first: str, second: str) -> str:
    """The class of a first part: its own where parts of one class meet each other, else that of surfaces."""
    return first if first in _APART and (first != POLYGON or second == POLYGON) else "surface"


def places_of(names: tuple[str, str]) -> int:
    """At how many places two features touch."""
    return 2 if names == (POLYGON, POLYGON) else 1


def _meets(kind: str, first: str, second: str) -> bool:
    feature = SHAPES[kind].first if kind in SHAPES else ""
    return (feature, second) in MEETINGS and class_of(feature, second) == first


# -- laws --------------------------------------------------------------------------------------------------------------

# Its results, their directional derivative, what tells when shapes meet, and where they touch.


class _PairView:
    """The motion of two shapes, as symbols of the graph of their law: what contacts ask of a view."""

    def __init__(self, graph: Graph, planar: bool) -> None:
        self.graph, self._planar = graph, planar
        self._poses = [self._pose(letter) for letter in "ab"]
        self._rounded: dict[Expr, Expr] = {}

    def converged(self, x: Expr) -> Expr:
        """A symbol for a number to which iterations came; see :func:`~.rounds.converged`."""
        if x.value is not None:
            return x
        result = next((symbol for symbol, known in self._rounded.items() if known.id == x.id), None)
        if result is None:
            result = self.graph.symbol(f"settled{len(self._rounded)}")
            self._rounded[result] = x
        return result

    def unsettled(self, results: Sequence[Expr]) -> list[Expr]:
        """Expressions with the numbers themselves in the places of their symbols."""
        known: dict[Expr, Expr] = {}
        for symbol, x in self._rounded.items():  # later ones may hold earlier ones
            known[symbol] = substitute([x], known)[0]
        return substitute(results, known)

    def _pose(self, letter: str) -> ShapeMotion:
        x = [self.graph.symbol(f"{letter}{k}") for k in range(POSE)]
        rotation = ((x[3], x[4], x[5]), (x[6], x[7], x[8]), (x[9], x[10], x[11]))
        return ShapeMotion((x[0], x[1], x[2]), rotation, (x[12], x[13], x[14]), (x[15], x[16], x[17]))

    def height(self) -> Vec3:
        """From the plane of the first shape, in which shapes of the plane touch, to the second."""
        first, second = self._poses
        normal = vec.transpose(first.rotation)[2]
        return vec.scale(vec.dot(normal, vec.sub(second.position, first.position)), normal)

    def position(self, marker: Marker) -> Vec3:
        position = self._poses[marker.body].position
        return vec.sub(position, self.height()) if marker.body and self._planar else position

    def rotation(self, marker: Marker) -> vec.Mat3:
        return self._poses[marker.body].rotation

    def velocity(self, marker: Marker) -> Vec3:
        return self._poses[marker.body].velocity

    def angular_velocity(self, marker: Marker) -> Vec3:
        return self._poses[marker.body].angular_velocity


class PairLaw(NamedTuple):
    """The law of all pairs of some contacts.

    Attributes
    ----------
    name : str
    normal : NormalLaw
    friction : DryFriction or None
    rigid : tuple of two Expr or None
        Coefficient of friction and restitution of bodies that are rigid.
    axes : int
        How many states one place of contact has of friction.
    slots : int
        How many numbers it has in the sum: its states, and how many pieces touch; 0 without states.
    planar : bool
        Whether the shapes lie in the plane.
    """

    name: str
    normal: NormalLaw
    friction: DryFriction | None
    rigid: tuple[Expr | None, Expr | None]
    axes: int
    slots: int
    planar: bool

    def holding(
        self, normal: NormalLaw, friction: DryFriction | None, states: tuple[Expr, ...], lateral: Vec3 | None
    ) -> tuple[DryFriction | None, NormalLaw]:
        """The laws of a place of contact with its states."""
        force = None if friction is None else friction.holding(states[: self.axes], lateral)
        return force, normal.holding(states[self.axes :])

    @property
    def each(self) -> int:
        """How many states a place of contact has."""
        return self.axes + self.normal.count


def pair_kind(
    law: PairLaw,
    kinds: tuple[FeatureKind, FeatureKind],
    tables: tuple[int, int],
    sizes: tuple[int, int],
    place: Callable[[Expr], int],
    lost: bool,
    height: Expr | None = None,
) -> PairKind:
    """How features of two classes act on each other.

    Parameters
    ----------
    law : PairLaw
    kinds, tables, sizes : tuple of two
        Classes of the features, the tables in which they stand, how many sizes they have.
    place : callable
        Gives an expression of the model a place behind the poses of the bodies.
    lost : bool
        Whether only what is taken from the energy counts.
    height : Expr, optional
        Of a height field, which is the first of the two.
    """
    graph = Graph()
    names = kinds[0].name, kinds[1].name
    flat = law.planar and names[0] != "half"  # which has no extent along its normal to leave out
    pair = _PairView(graph, flat)
    view = cast(View, pair)  # contacts ask for markers alone, not for angles and coordinates of joints
    places: list[int] = []

    def local(x: Expr) -> Expr:
        if x.value is not None:
            return graph.constant(x.value)
        places.append(place(x))
        return graph.symbol(f"l{len(places) - 1}")

    frame = Frame.identity(graph)
    normal = law.normal.mapped(local)
    rigid = [graph.zero if x is None else local(x) for x in law.rigid]
    friction = None if law.friction is None else law.friction.mapped(local)
    field = None if height is None else planted(height, graph, local)
    markers = (Marker(0, frame, "a"), Marker(1, frame, "b"))
    lateral = vec.transpose(view.rotation(markers[0]))[0 if names[0] == "half" else 2] if law.planar else None
    polygons = names == (POLYGON, POLYGON)
    inside, ground = names[0] == INSIDE, names[0] in ("edge", "arc") and kinds[0].number > 0
    corners = (sizes[0] // EDGE, sizes[1] // EDGE) if polygons else (sizes[0] // PIECE,) if inside else ()
    sizes = (FIRST, OTHER) if polygons else (CHOSEN, sizes[1]) if inside else sizes
    raw = [tuple(graph.symbol(f"{letter}{POSE + k}") for k in range(n)) for letter, n in zip("ab", sizes, strict=True)]
    out = vec.transpose(view.rotation(markers[names[0] == "half"]))[2] if law.planar else vec.zero(graph)
    exerted: list[list[Expr]] = []
    forces: list[Expr] = []
    rates: list[Expr] = []
    witnesses: list[Expr] = []
    touch: list[Expr] = []
    for witness in range(places_of(names)):
        states = tuple(graph.symbol(f"s{len(forces) + k}") for k in range(law.slots))
        forces += states
        dry, push = law.holding(normal, friction, states[: law.each], lateral) if states else (friction, normal)
        sides = (law.name, *markers)
        laws = (*sides, push, dry)
        one = FeaturePair(laws, raw[0], raw[1], raw[1][0], witness, field, pair.height if flat else None, ground)
        contact = touching(names, one)
        on_cell = isinstance(contact, SoilCell)
        if flat and not on_cell:
            contact = AtHeight(*sides, contact.normal_law, contact.friction, contact, pair.height())
        if names[1] == "wheel" and not on_cell:
            normal_axis = vec.transpose(view.rotation(markers[0]))[0 if names[0] == "half" else 2]
            contact = SoilWheel(*sides, push, dry, contact, raw[1][0], raw[1][1], normal_axis)
        exerted.append(_exerted(contact, view, lost))
        if states and (lost or names[0] in HOLLOWS):
            rates += [graph.zero] * law.slots
        elif states:
            rates += (
                contact.sums(view) if isinstance(contact, SoilCell) else _rates(contact, view, law.slots > law.each)
            )
        normal_of, depth, arm, _ = contact.touch(view)
        share = contact.share(view)
        facing, gap = contact.nearness(view)
        touch = [*facing, gap, turning_radius(names[1], raw[1], graph)]
        if share is not None:  # beside a piece of ground nothing is in it, and its neighbour is what is near
            owned = graph.apply("lt", 0.0, share)
            # what is inside has come there through the outline
            away = -NOWHERE if inside or names[0] in HOLLOWS else graph.apply("min", depth, 0.0)
            touch[3] = where(owned, depth, away)
            depth = where(owned, depth, -NOWHERE)
        witnesses += [*normal_of, depth, *vec.add(view.position(markers[0]), arm), *out, *rigid]
    results = [*(reduce(add, result) for result in zip(*exerted, strict=True)), *rates]
    symbols = [f"a{k}" for k in range(POSE + sizes[0])] + [f"b{k}" for k in range(POSE + sizes[1])]
    symbols += [*(f"l{k}" for k in range(len(places))), *(f"s{k}" for k in range(len(forces)))]
    seeds = {graph.symbol(name): graph.symbol(f"d_{name}") for name in symbols}
    counts = [len(result) for result in (results, results, touch, witnesses)]
    meets = [graph.apply("lt", 0.0, contact.touch(view)[1])] if isinstance(contact, SharedEnergy) and not forces else []
    every = pair.unsettled([*results, *jvp(results, seeds), *touch, *witnesses, *meets])
    starts = [0, *itertools.accumulate(counts)]
    results, slopes, touch, witnesses = (every[a:b] for a, b in itertools.pairwise(starts))
    nodes, renamed = _kept(graph, every)
    ids, seen, met = ([renamed[x.id] for x in result] for result in ((*results, *slopes), touch, witnesses))
    return PairKind(
        f"{kinds[0]}_{kinds[1]}_{tables[0]}_{tables[1]}",
        *tables,
        flat,
        tuple(places),
        nodes,
        (*symbols, *(f"d_{name}" for name in symbols)),
        tuple(ids[: len(results)]),
        tuple(ids[len(results) :]),
        tuple(seen),
        tuple(met),
        states=len(forces),
        thin=2 if names[0] in _THIN and names[1] in _POINTS else int(names[0] in ("edge", "arc")),
        calls=tuple(
            (name, graph.calls[name]) for name in sorted(graph.calls.keys() & {str(node[0]) for node in nodes})
        ),
        corners=corners,
        meets=tuple(renamed[x.id] for x in every[starts[-1] :]),
    )


def _exerted(contact: Contact, view: View, lost: bool) -> list[Expr]:
    """Force on the second shape, torques on the first and the second, the energy."""
    on_second, on_first = contact.remainder(view) if lost else contact.loads(view)
    assert isinstance(on_second, MarkerLoad)
    assert isinstance(on_first, MarkerLoad)
    energy = view.graph.zero if lost else contact.potential(view)
    assert energy is not None
    return [*on_second.force, *on_first.torque, *on_second.torque, energy]


def _rates(contact: Contact, view: View, counts: bool) -> list[Expr]:
    """What a place of contact adds to the rates of its states, and to the number of pieces that touch."""
    graph, share, sums = view.graph, contact.share(view), contact.sums_of_rates(view)
    if sums is not None and counts:
        return list(sums)
    part = graph.one if share is None or sums is not None else share  # a load of 0 counts as apart
    pairs = zip(contact.state_rates(view), contact.rates_apart(), strict=True)
    result = [(x - apart) * part for x, apart in pairs]
    touches = [where(graph.apply("lt", 0.0, contact.touch(view)[1]), part, 0.0)] if counts else []
    return [*result, *touches]


def _kept(graph: Graph, results: Sequence[Expr]) -> tuple[tuple[tuple[object, ...], ...], dict[int, int]]:
    """The nodes of some results alone, the numbers 0 and 1 first as in every graph; their ids by the old ones."""
    order = sorted({graph.zero.id, graph.one.id, *reachable(graph, (x.id for x in results))})
    renamed = {old: new for new, old in enumerate(order)}
    nodes = []
    for i in order:
        operation, *rest = graph.nodes[i]
        nodes.append((operation, *(rest if operation in ("const", "sym") else (renamed[k] for k in rest))))
    return tuple(nodes), renamed
