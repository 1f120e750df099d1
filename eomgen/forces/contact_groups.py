"""Force elements, contact in bulk: every shape of one group against every shape of another, by one law.

The law of one kind of pair is derived once, in a graph of its own; the sum over all pairs is one operation of the
model's graph (:mod:`~eomgen.graph.pair_calls`), so that equations do not grow with the number of pairs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from ..elements.dimensions import LENGTH
from ..elements.element_type import ElementType, table
from ..elements.entry import Entry
from ..elements.field import Field
from ..elements.looks import Seen
from ..frames import Frame, Marker
from ..graph import vectors as vec
from ..graph.core import Expr, Graph
from ..graph.differentiate import jvp
from ..graph.pair_calls import LOSSES, PairFunction, PairKind, pair_meeting, pair_spots, pair_sum
from ..graph.traverse import reachable
from ..graph.vectors import Vec3
from ..numeric.pair_sums import POSE
from ..records import dataclass
from .branches import where
from .contact import CURVED, SpherePlane
from .contact_rounds import AtHeight
from .contact_shapes import (
    GROUNDS,
    PLANAR,
    SHAPE_FIELDS,
    ContactShape,
    Feature,
    ShapeMotion,
    meet,
    touching,
    turning_radius,
)
from .force import Force, Load, MarkerLoad, MovingView, View
from .friction_laws import DryFriction, has_bristles, read_friction
from .normal_laws import NORMAL_LAWS, RIGID, HertzBodies, NormalLaw, RigidLaw, read_normal_law


class _PairView:
    """The motion of two shapes, as symbols of the graph of their law."""

    def __init__(self, graph: Graph, planar: bool) -> None:
        self.graph, self._planar = graph, planar
        self._poses = [self._pose(letter) for letter in "ab"]

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

    def turn(self, start: Marker, end: Marker) -> tuple[Expr, Expr, bool]:
        raise NotImplementedError  # no contact asks for it

    def coordinate(self, name: str) -> tuple[Expr, Expr]:
        raise NotImplementedError


@dataclass(frozen=True)
class ContactGroups(Force):
    """Contact of two groups of shapes, or of the shapes of one group among themselves (``second`` is empty then).

    The force of a pair is that of :class:`~.contact.Contact`.  Shapes of one body do not meet.
    """

    sentence: ClassVar[str] = (
        "Contact of every shape of one group with every shape of another: a force along the normal from the "
        "penetration $d$ and its rate, and friction against the sliding."
    )
    by_power: ClassVar[bool] = True
    first: tuple[ContactShape, ...]
    second: tuple[ContactShape, ...]
    normal_law: NormalLaw
    friction: DryFriction | None
    coefficient: Expr  #: of friction, where bodies are rigid
    restitution: Expr  #: where bodies are rigid

    @property
    def laws(self) -> tuple[Any, ...]:
        return (self.normal_law,) if self.friction is None else (self.normal_law, self.friction)

    def drawn(self) -> list[Seen]:
        return [seen for shape in (*self.first, *self.second) for seen in shape.drawn()]

    def loads(self, view: View) -> list[Load]:
        return self._loads(view, "")

    def potential(self, view: View) -> Expr | None:
        return self._results(view, "", still=True)[1][-1]

    def remainder(self, view: View) -> list[Load]:
        return self._loads(view, LOSSES)

    def _loads(self, view: View, part: str) -> list[Load]:
        markers, results = self._results(view, part)
        return [
            MarkerLoad(marker, _vector(results[6 * k : 6 * k + 3]), _vector(results[6 * k + 3 : 6 * k + 6]))
            for k, marker in enumerate(markers)
        ]

    def met_shapes(self) -> list[str]:
        groups = [_features(self.first), *([_features(self.second)] if self.second else [])]
        parts = [shape for group in groups for features in group.values() for shape, _ in features]
        return [f"{shape.kind} on {shape.marker.label}" for shape in parts]

    def meeting(self, view: MovingView) -> list[Expr]:
        markers, function, operands = self._operands(view, "")
        accelerations = [x for m in markers for x in (*view.acceleration(m), *view.angular_acceleration(m))]
        return pair_meeting(view.graph, function, operands, accelerations)

    def near(self, view: View) -> list[Expr]:
        _, function, operands = self._operands(view, "", still=True)
        return pair_spots(view.graph, function, operands)

    @property
    def met_bodies(self) -> list[int]:
        groups = [_features(self.first), *([_features(self.second)] if self.second else [])]
        return [shape.marker.body for group in groups for features in group.values() for shape, _ in features]

    @property
    def is_rigid(self) -> bool:
        return isinstance(self.normal_law, RigidLaw)

    def _results(self, view: View, part: str, still: bool = False) -> tuple[list[Marker], list[Expr]]:
        """The bodies as markers at their origins, force and torque on each, and the energy; at rest, if asked."""
        markers, function, operands = self._operands(view, part, still)
        return markers, pair_sum(view.graph, function, operands)

    def _operands(self, view: View, part: str, still: bool = False) -> tuple[list[Marker], PairFunction, list[Expr]]:
        """The bodies as markers at their origins, the sum over pairs and what it is given."""
        graph = view.graph
        bodies = sorted({shape.marker.body for shape in (*self.first, *self.second)})
        labels = {shape.marker.body: shape.marker.label.partition(".")[0] for shape in (*self.first, *self.second)}
        frame = Frame(vec.identity(graph), vec.zero(graph))
        markers = [Marker(body, frame, labels[body]) for body in bodies]
        operands: list[Expr] = []
        for marker in markers:
            rotation = [x for row in view.rotation(marker) for x in row]
            moving = (view.velocity(marker), view.angular_velocity(marker))
            operands += [*view.position(marker), *rotation]
            operands += [graph.zero if still else x for v in moving for x in v]
        data = _SharedData(len(operands), graph)
        function = self._function(f"{part}{self.name}", bodies, data, bool(part))
        return markers, function, [*operands, *data.values]

    def _function(self, name: str, bodies: Sequence[int], data: _SharedData, lost: bool) -> PairFunction:
        groups = [_features(self.first), _features(self.second)] if self.second else [_features(self.first)]
        place = {body: k for k, body in enumerate(bodies)}
        keys = [(g, kind) for g, group in enumerate(groups) for kind in group]
        tables = [tuple(data.row(place[shape.marker.body], f) for shape, f in groups[g][kind]) for g, kind in keys]
        planar = any(shape.kind in PLANAR for shape in (*self.first, *self.second))
        kinds = []
        for i, (g, first) in enumerate(keys):
            for j, (h, second) in enumerate(keys):
                apart = g != h or len(groups) == 1
                twice = first == second and i > j  # round beside round, once
                if apart and not twice and meet((first, second)):
                    sizes = tuple(len(groups[n][kind][0][1].sizes) for n, kind in ((g, first), (h, second)))
                    flat = planar and first != "half"  # which has no extent along its normal to leave out
                    kinds.append(self._kind((first, second), (i, j), (sizes[0], sizes[1]), (planar, flat), data, lost))
        return PairFunction(name, len(bodies), tuple(x.value for x in data.values), tuple(tables), tuple(kinds))

    def _kind(
        self,
        kinds: tuple[str, str],
        tables: tuple[int, int],
        sizes: tuple[int, int],
        plane: tuple[bool, bool],
        data: _SharedData,
        lost: bool,
    ) -> PairKind:
        """The law of one kind of pair in a graph of its own, with its derivative.

        ``plane`` says whether shapes lie in a plane, and whether distances count across it only.
        """
        graph = Graph()
        in_plane, planar = plane
        view = _PairView(graph, planar)
        places: list[int] = []

        def own(x: Expr) -> Expr:
            if x.value is not None:
                return graph.constant(x.value)
            places.append(data.place(x))
            return graph.symbol(f"l{len(places) - 1}")

        frame = Frame(vec.identity(graph), vec.zero(graph))
        normal = self.normal_law.mapped(own)
        dry, rigid = self.friction, (own(self.coefficient), own(self.restitution))
        friction = None if dry is None else dry.mapped(own)
        markers = (Marker(0, frame, "a"), Marker(1, frame, "b"))
        given = [
            tuple(graph.symbol(f"{letter}{POSE + k}") for k in range(n)) for letter, n in zip("ab", sizes, strict=True)
        ]
        bare = SpherePlane(self.name, *markers, normal, friction, graph.zero)
        contact = touching(kinds, markers, (given[0], given[1]), bare)
        if planar:
            contact = AtHeight(self.name, *markers, contact.normal_law, friction, contact, view.height())
        on_second, on_first = contact.remainder(view) if lost else contact.loads(view)
        assert isinstance(on_second, MarkerLoad)
        assert isinstance(on_first, MarkerLoad)
        energy = graph.zero if lost else contact.potential(view)
        assert energy is not None
        results = [*on_second.force, *on_first.torque, *on_second.torque, energy]
        names = [f"a{k}" for k in range(POSE + sizes[0])] + [f"b{k}" for k in range(POSE + sizes[1])]
        names += [f"l{k}" for k in range(len(places))]
        seeds = {graph.symbol(name): graph.symbol(f"d_{name}") for name in names}
        slopes = jvp(results, seeds)
        across, depth, arm, _ = contact.touch(view)
        if (share := contact.share(view)) is not None:  # beside a piece of ground nothing is in it
            depth = where(graph.apply("lt", 0.0, share), depth, graph.apply("min", depth, 0.0))
        touch = [*across, depth, turning_radius(kinds[1], given[1], graph)]
        flat = vec.transpose(view.rotation(markers[kinds[0] == "half"]))[2] if in_plane else vec.zero(graph)
        spot = [*touch[:4], *vec.add(view.position(markers[0]), arm), *flat, *rigid]
        nodes, renamed = _kept(graph, [*results, *slopes, *touch, *spot])
        ids, seen, place = ([renamed[x.id] for x in found] for found in ((*results, *slopes), touch, spot))
        rates = [f"d_{name}" for name in names]
        return PairKind(
            f"{kinds[0]}_{kinds[1]}_{tables[0]}_{tables[1]}",
            *tables,
            planar,
            tuple(places),
            nodes,
            (*names, *rates),
            tuple(ids[: len(results)]),
            tuple(ids[len(results) :]),
            tuple(seen),
            tuple(place),
        )


class _SharedData:
    """Different numbers and expressions that shapes and laws need, behind the poses of the bodies."""

    def __init__(self, start: int, graph: Graph) -> None:
        self.start, self.graph, self.values = start, graph, list[Expr]()
        self._places: dict[Expr, int] = {}

    def place(self, x: Expr) -> int:
        if x not in self._places:
            self._places[x] = self.start + len(self.values)
            self.values.append(x)
        return self._places[x]

    def row(self, body: int, feature: Feature) -> tuple[int, ...]:
        """A row of a table of shapes; see :class:`~eomgen.numeric.pair_sums.PairSum`."""
        frame = feature.frame
        entries = [*frame.position, *(x for row in frame.rotation for x in row), *feature.sizes]
        bound = -1 if feature.bound is None else self.place(feature.bound)
        return (body, *(self.place(x) for x in entries), bound, self.place(feature.thickness))


def _features(shapes: Sequence[ContactShape]) -> dict[str, list[tuple[ContactShape, Feature]]]:
    """Features of shapes, by class."""
    found: dict[str, list[tuple[ContactShape, Feature]]] = {}
    for shape in shapes:
        for feature in shape.features():
            found.setdefault(feature.kind, []).append((shape, feature))
    return found


def _kept(graph: Graph, results: Sequence[Expr]) -> tuple[tuple[tuple[object, ...], ...], dict[int, int]]:
    """The nodes of some results alone, the numbers 0 and 1 first as in every graph; their ids by the old ones."""
    order = sorted({graph.zero.id, graph.one.id, *reachable(graph, (x.id for x in results))})
    renamed = {old: new for new, old in enumerate(order)}
    nodes = []
    for i in order:
        operation, *rest = graph.nodes[i]
        nodes.append((operation, *(rest if operation in ("const", "sym") else (renamed[k] for k in rest))))
    return tuple(nodes), renamed


def _vector(x: Sequence[Expr]) -> Vec3:
    return x[0], x[1], x[2]


# -- reading ----------------------------------------------------------------------------------------------------------
def _contact_groups(e: Entry) -> ContactGroups | None:
    first = e.shapes("first")
    second = e.shapes("second") if "second" in e.values else ()
    if has_bristles(e.values):
        remedy = "use brown_mcphee, or point_plane, sphere_plane or sphere_sphere for each pair"
        e.fault("friction_law", "lugre has states, which pairs of groups do not", remedy)
        return None
    if e.choice("normal_law") == RIGID:
        law: NormalLaw = RigidLaw()
        friction, coefficient, restitution = None, e.given("friction"), e.given("restitution")
        for key in CURVED:
            if key not in ("normal_law", "friction", "restitution"):
                e.refuse(
                    key, f"has no meaning in normal_law: {RIGID}, which has friction (a coefficient) and restitution"
                )
        for key, value in (("friction", coefficient), ("restitution", restitution)):
            if value is not None:
                e.require(key, value, lambda x: x >= 0, "must be 0 or greater")
        if restitution is not None:
            e.require("restitution", restitution, lambda x: x <= 1, "must be at most 1")
    else:
        law, friction = read_normal_law(e), read_friction(e, "friction", "static_friction", "viscous_friction")
        coefficient = getattr(friction, "dynamic", None)
        restitution = e.given("restitution")
    if first is None or second is None or e.at_fault():
        return None
    _refuse_pairs(e, first, second)
    if isinstance(law, HertzBodies):
        for key, shapes in (("first", first), ("second", second)):
            if flat := [shape.kind for shape in shapes if shape.kind not in ("sphere", "half_space")]:
                e.fault(key, f"a {flat[0]} has no radius for Hertz's law from moduli", "give stiffness, not moduli")
    zero = e.graph.zero
    return ContactGroups(
        *(e.name, first, second, law, friction),
        zero if coefficient is None else coefficient,
        zero if restitution is None else restitution,
    )


def _refuse_pairs(e: Entry, first: Sequence[ContactShape], second: Sequence[ContactShape]) -> None:
    """Note shapes that cannot meet, and a shape that is in both groups."""
    kinds = sorted({shape.kind for shape in first}), sorted({shape.kind for shape in second or first})
    for a in kinds[0]:
        for b in kinds[1]:
            if (a in PLANAR) != (b in PLANAR):
                e.fault("second", f"{a} and {b} do not meet", _ALLOWED)
            elif (
                (a in GROUNDS and b in GROUNDS)
                or (a in _ON_GROUND and b in _IN_SPACE)
                or (b in _ON_GROUND and a in _IN_SPACE)
            ) and (second or a != b or _differ(first, a)):
                told = f"two shapes {a} do not meet" if a == b else f"{a} and {b} do not meet"
                e.fault("second" if second else "first", told, _ALLOWED)
    thin = [shape for shape in first if _is_thin(shape)], [shape for shape in second or first if _is_thin(shape)]
    for k, others in enumerate((second or first, first)):
        cornered = sorted({shape.kind for shape in others if shape.kind in _CORNERED or _is_thin(shape)})
        if thin[k] and cornered and (second or _differ_in_body(first)):
            e.fault(
                ("first", "second")[k] if second else "first",
                f"corners of {cornered[0]} pass through a segment of radius 0, which has no inside",
                "give the segment a radius greater than 0",
            )
            break
    for key, shapes in (("first", first), ("second", second)):
        if twice := [shape for k, shape in enumerate(shapes) if shape in shapes[:k]]:
            e.fault(key, f"has the {twice[0].kind} on {twice[0].marker.label} twice", "give each shape once")
    both = {shape.marker.label for shape in first if shape in second}
    if both:
        e.fault(
            "second",
            f"the shape on {sorted(both)[0]} is in both groups",
            "give second only what is not in first; without second the shapes of first meet among themselves",
        )
    bodies = {shape.marker.body for shape in (*first, *second)}
    if len(bodies) == 1:
        e.fault("", "has shapes on one body only", "shapes of one body do not meet; give shapes on other bodies")


def _is_thin(shape: ContactShape) -> bool:
    return shape.kind == "segment" and shape.sizes[1].is_zero


def _differ_in_body(shapes: Sequence[ContactShape]) -> bool:
    return len({shape.marker.body for shape in shapes}) > 1


def _differ(shapes: Sequence[ContactShape], kind: str) -> bool:
    """Whether shapes of a kind are on different bodies."""
    return len({shape.marker.body for shape in shapes if shape.kind == kind}) > 1


_CORNERED = (
    "box",
    "polygon",
    "profile",
    "smooth_profile",
    "outline",
    "smooth_outline",
    "sprocket",
)  #: shapes whose corners meet segments
_ON_GROUND = ("ellipsoid", "cuboid")  #: shapes that meet a half-space alone
_IN_SPACE = ("sphere", "capsule", *_ON_GROUND)
_ALLOWED = (
    "circle, segment, box, polygon, outline, smooth_outline and sprocket meet each other, half_plane, profile and "
    "smooth_profile; sphere and capsule meet each other and half_space; ellipsoid and cuboid meet half_space"
)

_NORMAL_LAW = CURVED["normal_law"]._replace(
    choices=(*NORMAL_LAWS, RIGID),
    doc=CURVED["normal_law"].doc + f"; {RIGID}, no penetration, for runs by the method moreau only",
)
_RESTITUTION = CURVED["restitution"]._replace(
    doc="coefficient of restitution, from which the dissipation is computed; in runs by the method moreau Newton's"
)
_SHAPES = "shapes {shape, on, ...} of the "

TYPES = table(
    ElementType(
        "contacts",
        "contact of every shape of a group with every shape of another, by one law.  Shapes are mappings of shape "
        f"({', '.join(PLANAR)}; {', '.join(kind for kind in SHAPE_FIELDS if kind not in PLANAR)}), "
        "on (a marker or a list of markers) and sizes.  Shapes of one body do not meet.",
        {
            "first": Field("shapes", _SHAPES + "first group", required=True, dimension=LENGTH),
            "second": Field(
                "shapes",
                _SHAPES + "second group; without it those of the first meet among themselves",
                dimension=LENGTH,
            ),
            "law": Field("law", "the keys that follow as a mapping, instead of one by one"),
            **CURVED,
            "normal_law": _NORMAL_LAW,
            "restitution": _RESTITUTION,
        },
        _contact_groups,
    )
)
