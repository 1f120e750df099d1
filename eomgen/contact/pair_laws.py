"""Contacts between groups: which features of shapes meet, and the law of one kind of pair."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from functools import reduce
from operator import add
from typing import NamedTuple, cast

from ..elements.forces.force import MarkerLoad, View, where
from ..elements.forces.friction import DryFriction
from ..elements.forces.normal_laws import NormalLaw, PartlyDamped
from ..elements.frames import Frame, Marker
from ..expr import vectors as vec
from ..expr.core import Expr, Graph, reachable, substitute
from ..expr.differentiate import jvp
from ..expr.vectors import Mat3, Vec3
from .ellipsoids import BlockEllipsoid, EllipsoidEllipsoid, EllipsoidPlane, EllipsoidRod, EllipsoidRound
from .fields import FieldEllipsoid, FieldRound, HeightField, planted
from .limits import NOWHERE
from .pair_features import CHOSEN, EDGE, OTHER, OWN, PIECE
from .pair_sums import POSE
from .pairs import PairKind
from .point import Contact, SpherePlane, joint_radius
from .polygons import PolygonPolygon
from .profiles import WALLS, ArcRound, BowlRound, EdgeRound, InsideRound, NotchRound
from .rounds import AtHeight, BlockRound, EdgeRod, PolygonRound, RodRod, RoundRound, SegmentRound
from .shapes import SOLE, greatest
from .soil_beds import SoilCell, cell_of
from .soil_wheels import SoilWheel
from .states import BED_CELL, BLOCK, CORE, HOLLOW, INSIDE, MET, POLYGON, part_of, places_of

# -- features that meet ------------------------------------------------------------------------------------------------


#: Features at which an overlap acts back, with the elastic part of the law alone.
HOLLOWS = ("notch", "bowl")
#: Features of the first shapes of :data:`~.states.MET` that have several.
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
    witness: int = 0,
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
        return PolygonPolygon(*laws, first, sizes[1], witness)
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
    if kinds[0] == "rounded_edge":
        return EdgeRod(*laws, (first[0], sizes[1][0]), (first[1], sizes[1][1]))
    if kinds[1] == "rod":
        return RodRod(*laws, (first[0], sizes[1][0]), (first[1], sizes[1][1]))
    if kinds[0] == "half":
        return SpherePlane(*laws, radius)
    if kinds[0] in HOLLOWS:
        elastic = (law.name, *markers, PartlyDamped(normal, radius.graph.zero), None)
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
    return sizes[0] + sizes[1] if kind in ("rod", "rounded_edge", "spine") else graph.zero


# -- laws --------------------------------------------------------------------------------------------------------------

# Its results, their directional derivative, what tells when shapes meet, and where they touch.


class _PairView:
    """The motion of two shapes, as symbols of the graph of their law: what contacts ask of a view."""

    def __init__(self, graph: Graph, planar: bool) -> None:
        self.graph, self._planar = graph, planar
        self._poses = [self._pose(letter) for letter in "ab"]
        self._rounded: dict[Expr, Expr] = {}

    def settled(self, x: Expr) -> Expr:
        """A symbol for a number to which iterations came; see :func:`~.rounds.settled`."""
        if x.value is not None:
            return x
        found = next((symbol for symbol, known in self._rounded.items() if known.id == x.id), None)
        if found is None:
            found = self.graph.symbol(f"settled{len(self._rounded)}")
            self._rounded[found] = x
        return found

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
        held = None if friction is None else friction.holding(states[: self.axes], lateral)
        return held, normal.holding(states[self.axes :])

    @property
    def each(self) -> int:
        """How many states a place of contact has."""
        return self.axes + self.normal.count


def pair_kind(
    law: PairLaw,
    kinds: tuple[str, str],
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
    flat = law.planar and kinds[0] != "half"  # which has no extent along its normal to leave out
    pair = _PairView(graph, flat)
    view = cast(View, pair)  # contacts ask for markers alone, not for angles and coordinates of joints
    places: list[int] = []

    def own(x: Expr) -> Expr:
        if x.value is not None:
            return graph.constant(x.value)
        places.append(place(x))
        return graph.symbol(f"l{len(places) - 1}")

    frame = Frame.identity(graph)
    normal = law.normal.mapped(own)
    rigid = [graph.zero if x is None else own(x) for x in law.rigid]
    friction = None if law.friction is None else law.friction.mapped(own)
    field = None if height is None else planted(height, graph, own)
    markers = (Marker(0, frame, "a"), Marker(1, frame, "b"))
    lateral = vec.transpose(view.rotation(markers[0]))[0 if kinds[0] == "half" else 2] if law.planar else None
    polygons = part_of(kinds[0]) == part_of(kinds[1]) == POLYGON
    inside = part_of(kinds[0]) == INSIDE
    corners = (sizes[0] // EDGE, sizes[1] // EDGE) if polygons else (sizes[0] // PIECE,) if inside else ()
    sizes = (OWN, OTHER) if polygons else (CHOSEN, sizes[1]) if inside else sizes
    given = [
        tuple(graph.symbol(f"{letter}{POSE + k}") for k in range(n)) for letter, n in zip("ab", sizes, strict=True)
    ]
    out = vec.transpose(view.rotation(markers[kinds[0] == "half"]))[2] if law.planar else vec.zero(graph)
    exerted: list[list[Expr]] = []
    held: list[Expr] = []
    rates: list[Expr] = []
    witnesses: list[Expr] = []
    touch: list[Expr] = []
    for witness in range(places_of(kinds)):
        states = tuple(graph.symbol(f"s{len(held) + k}") for k in range(law.slots))
        held += states
        dry, push = law.holding(normal, friction, states[: law.each], lateral) if states else (friction, normal)
        bare = SpherePlane(law.name, *markers, push, dry, graph.zero)
        on_cell = kinds[0] == BED_CELL
        if on_cell:
            contact: Contact = cell_of(bare, given[1], given[0][0], kinds[1], pair.height() if flat else None)
        else:
            contact = touching(kinds, markers, (given[0], given[1]), bare, witness, field)
        if flat and not on_cell:
            contact = AtHeight(law.name, *markers, contact.normal_law, contact.friction, contact, pair.height())
        if kinds[1] == "rim" and not on_cell:
            across = vec.transpose(view.rotation(markers[0]))[0 if kinds[0] == "half" else 2]
            contact = SoilWheel(law.name, *markers, push, dry, contact, given[1][0], given[1][1], across)
        exerted.append(_exerted(contact, view, lost))
        if states and (lost or kinds[0] in HOLLOWS):
            rates += [graph.zero] * law.slots
        elif states:
            rates += (
                contact.sums(view) if isinstance(contact, SoilCell) else _rates(contact, view, law.slots > law.each)
            )
        normal_of, depth, arm, _ = contact.touch(view)
        share = contact.share(view)
        facing, gap = contact.nearness(view)
        touch = [*facing, gap, turning_radius(kinds[1], given[1], graph)]
        if share is not None:  # beside a piece of ground nothing is in it, and its neighbour is what is near
            owned = graph.apply("lt", 0.0, share)
            # what is inside has come there through the outline
            away = -NOWHERE if inside or kinds[0] in HOLLOWS else graph.apply("min", depth, 0.0)
            touch[3] = where(owned, depth, away)
            depth = where(owned, depth, -NOWHERE)
        witnesses += [*normal_of, depth, *vec.add(view.position(markers[0]), arm), *out, *rigid]
    results = [*(reduce(add, found) for found in zip(*exerted, strict=True)), *rates]
    names = [f"a{k}" for k in range(POSE + sizes[0])] + [f"b{k}" for k in range(POSE + sizes[1])]
    names += [*(f"l{k}" for k in range(len(places))), *(f"s{k}" for k in range(len(held)))]
    seeds = {graph.symbol(name): graph.symbol(f"d_{name}") for name in names}
    counts = [len(found) for found in (results, results, touch, witnesses)]
    every = pair.unsettled([*results, *jvp(results, seeds), *touch, *witnesses])
    starts = [0, *itertools.accumulate(counts)]
    results, slopes, touch, witnesses = (every[a:b] for a, b in itertools.pairwise(starts))
    nodes, renamed = _kept(graph, [*results, *slopes, *touch, *witnesses])
    ids, seen, met = ([renamed[x.id] for x in found] for found in ((*results, *slopes), touch, witnesses))
    return PairKind(
        f"{kinds[0]}_{kinds[1]}_{tables[0]}_{tables[1]}",
        *tables,
        flat,
        tuple(places),
        nodes,
        (*names, *(f"d_{name}" for name in names)),
        tuple(ids[: len(results)]),
        tuple(ids[len(results) :]),
        tuple(seen),
        tuple(met),
        states=len(held),
        calls=tuple(
            (name, graph.calls[name]) for name in sorted(graph.calls.keys() & {str(node[0]) for node in nodes})
        ),
        corners=corners,
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
    found = [(x - apart) * part for x, apart in pairs]
    touches = [where(graph.apply("lt", 0.0, contact.touch(view)[1]), part, 0.0)] if counts else []
    return [*found, *touches]


def _kept(graph: Graph, results: Sequence[Expr]) -> tuple[tuple[tuple[object, ...], ...], dict[int, int]]:
    """The nodes of some results alone, the numbers 0 and 1 first as in every graph; their ids by the old ones."""
    order = sorted({graph.zero.id, graph.one.id, *reachable(graph, (x.id for x in results))})
    renamed = {old: new for new, old in enumerate(order)}
    nodes = []
    for i in order:
        operation, *rest = graph.nodes[i]
        nodes.append((operation, *(rest if operation in ("const", "sym") else (renamed[k] for k in rest))))
    return tuple(nodes), renamed
