"""Force elements, contact in bulk: every shape of one group against every shape of another, by one law.

The law of one kind of pair is derived once, in a graph of its own; the sum over all pairs is one operation of the
model's graph (:mod:`~eomgen.graph.pair_calls`), so that equations do not grow with the number of pairs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar, NamedTuple, cast

from ..elements.looks import Seen
from ..frames import Frame, Marker
from ..graph import vectors as vec
from ..graph.core import Expr, Graph
from ..graph.differentiate import jvp
from ..graph.pair_calls import LOSSES, PairFunction, PairKind, pair_meeting, pair_spots, pair_sum
from ..graph.traverse import reachable
from ..graph.vectors import Vec3
from ..limits.contacts import NOWHERE
from ..numeric.pair_sums import POSE
from ..records import dataclass
from .branches import where
from .contact import SpherePlane
from .contact_rounds import AtHeight
from .contact_shape_fields import PLANAR
from .contact_shapes import (
    PIECED,
    ContactShape,
    Feature,
    ShapeMotion,
    meet,
    touching,
    turning_radius,
)
from .contact_states import class_of, pair_states
from .force import Force, Load, MarkerLoad, MovingView, View
from .friction_laws import DryFriction
from .normal_laws import NormalLaw, RigidLaw
from .soil_laws import SoilPressure
from .soil_wheels import SoilWheel


class _PairView:
    """The motion of two shapes, as symbols of the graph of their law: what contacts ask of a view."""

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
    states: tuple[Expr, ...] = ()
    axes: int = 0  #: how many states a pair has of friction
    coefficient: Expr | None = None  #: of friction, where bodies are rigid
    restitution: Expr | None = None  #: where bodies are rigid

    @property
    def laws(self) -> tuple[Any, ...]:
        return (self.normal_law,) if self.friction is None else (self.normal_law, self.friction)

    def drawn(self) -> list[Seen]:
        return [seen for shape in (*self.first, *self.second) for seen in shape.drawn()]

    def loads(self, view: View) -> list[Load]:
        return self._loads(view, "")

    def potential(self, view: View) -> Expr | None:
        if self.is_rigid:
            return view.graph.zero
        markers, results = self._results(view, "", still=True)
        return results[6 * len(markers)]

    def state_rates(self, view: View) -> tuple[Expr, ...]:
        if not self.states:
            return ()
        markers, results = self._results(view, "")
        found = results[6 * len(markers) + 1 :]
        if self._slots > self._each:
            found = self._shared_out(found)
        return tuple(map(Expr.__add__, self._rates_apart(), found))

    def _shared_out(self, sums: list[Expr]) -> list[Expr]:
        """What pieces add to the rates of the states that they share, which is its mean where several touch."""
        found: list[Expr] = []
        for k in range(0, len(sums), self._slots):
            *added, touching = sums[k : k + self._slots]
            found += [x / x.graph.apply("max", 1.0, touching) for x in added]
        return found

    def _rates_apart(self) -> list[Expr]:
        """Rates of all states where no shapes meet."""
        found: list[Expr] = []
        for k in range(0, len(self.states), self._each):
            friction, normal = self._holding(self.normal_law, self.friction, self.states[k : k + self._each], None)
            found += [*(() if friction is None else friction.rates_apart()), *normal.rates_apart()]
        return found

    @property
    def _each(self) -> int:
        """How many states a pair has."""
        return self.axes + self.normal_law.count

    @property
    def _slots(self) -> int:
        """How many numbers a pair has in the sum: its states, and where shapes have pieces how many of them touch."""
        return self._each + any(shape.kind in PIECED for shape in (*self.first, *self.second))

    def _holding(
        self, normal: NormalLaw, friction: DryFriction | None, states: tuple[Expr, ...], lateral: Vec3 | None
    ) -> tuple[DryFriction | None, NormalLaw]:
        """The laws of a pair with its states."""
        held = None if friction is None else friction.holding(states[: self.axes], lateral)
        return held, normal.holding(states[self.axes :])

    def remainder(self, view: View) -> list[Load]:
        return self._loads(view, LOSSES)

    def _loads(self, view: View, part: str) -> list[Load]:
        if self.is_rigid:
            return []
        markers, results = self._results(view, part)
        return [
            MarkerLoad(marker, _vector(results[6 * k : 6 * k + 3]), _vector(results[6 * k + 3 : 6 * k + 6]))
            for k, marker in enumerate(markers)
        ]

    def met_shapes(self) -> list[str]:
        groups = [_features(self.first), *([_features(self.second)] if self.second else [])]
        parts = [one.shape for group in groups for features in group.values() for one in features]
        return [f"{shape.kind} on {shape.marker.label}" for shape in parts]

    def meeting(self, view: MovingView) -> list[Expr]:
        markers, function, operands = self._operands(view, "")
        return pair_meeting(view.graph, function, operands, view.accelerations(markers))

    def near(self, view: View) -> list[Expr]:
        if isinstance(self.normal_law, SoilPressure):
            return []  # soil yields
        _, function, operands = self._operands(view, "", still=True)
        return pair_spots(view.graph, function, operands)

    @property
    def met_bodies(self) -> list[int]:
        groups = [_features(self.first), *([_features(self.second)] if self.second else [])]
        return [one.shape.marker.body for group in groups for features in group.values() for one in features]

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
        for marker in graph.marked(markers):
            rotation = [x for row in view.rotation(marker) for x in row]
            moving = (view.velocity(marker), view.angular_velocity(marker))
            operands += [*view.position(marker), *rotation]
            operands += [graph.zero if still else x for v in moving for x in v]
        data = _SharedData(len(operands), graph)
        function = self._function(f"{part}{self.name}", bodies, data, bool(part))
        held = [graph.zero] * function.states if still else self._held(graph)  # the energy does not depend on states
        return markers, function, [*operands, *data.values, *held]

    def _held(self, graph: Graph) -> list[Expr]:
        """The states of all pairs; the number of pieces that touch is found, so 0 stands in its place."""
        found: list[Expr] = []
        for k in range(0, len(self.states), self._each or 1):
            found += [*self.states[k : k + self._each], *[graph.zero] * (self._slots - self._each)]
        return found

    def _function(self, name: str, bodies: Sequence[int], data: _SharedData, lost: bool) -> PairFunction:
        shapes = [self.first, self.second] if self.second else [self.first]
        groups = [_features(group) for group in shapes]
        place = {body: k for k, body in enumerate(bodies)}
        keys = [(g, kind) for g, group in enumerate(groups) for kind in group]
        tables = [tuple(data.row(place[one.shape.marker.body], one.feature) for one in groups[g][k]) for g, k in keys]
        planar = any(shape.kind in PLANAR for shape in (*self.first, *self.second))
        blocks, _ = pair_states([[shape.parts() for shape in group] for group in shapes]) if self.states else ({}, 0)
        kinds = []
        for i, (g, first) in enumerate(keys):
            for j, (h, second) in enumerate(keys):
                apart = g != h or len(groups) == 1
                twice = first == second and i > j  # round beside round, once
                if apart and not twice and meet((first, second)):
                    sizes = tuple(len(groups[n][kind][0].feature.sizes) for n, kind in ((g, first), (h, second)))
                    flat = planar and first != "half"  # which has no extent along its normal to leave out
                    kind = self._kind((first, second), (i, j), (sizes[0], sizes[1]), flat, planar, data, lost)
                    if self.states:
                        block = blocks[g, h, class_of(first), second]
                        rows = tuple(self._slots * block.of_first(x.number, k) for k, x in enumerate(groups[g][first]))
                        columns = tuple(self._slots * one.column for one in groups[h][second])
                        kind = replace(kind, held=(rows, columns), states=self._slots)
                    kinds.append(kind)
        held = [x.value for x in self._held(data.graph)]
        numbers = (*(x.value for x in data.values), *held)
        return PairFunction(name, len(bodies), numbers, tuple(tables), tuple(kinds), len(held))

    def _kind(
        self,
        kinds: tuple[str, str],
        tables: tuple[int, int],
        sizes: tuple[int, int],
        flat: bool,
        planar: bool,
        data: _SharedData,
        lost: bool,
    ) -> PairKind:
        """The law of one kind of pair in a graph of its own, with its derivative."""
        graph = Graph()
        pair = _PairView(graph, flat)
        view = cast(View, pair)  # contacts ask for markers alone, not for angles and coordinates of joints
        places: list[int] = []

        def own(x: Expr) -> Expr:
            if x.value is not None:
                return graph.constant(x.value)
            places.append(data.place(x))
            return graph.symbol(f"l{len(places) - 1}")

        frame = Frame(vec.identity(graph), vec.zero(graph))
        normal = self.normal_law.mapped(own)
        dry, rigid = self.friction, [graph.zero if x is None else own(x) for x in (self.coefficient, self.restitution)]
        friction = None if dry is None else dry.mapped(own)
        markers = (Marker(0, frame, "a"), Marker(1, frame, "b"))
        held = tuple(graph.symbol(f"s{k}") for k in range(self._slots if self.states else 0))
        if held:
            lateral = vec.transpose(view.rotation(markers[0]))[0 if kinds[0] == "half" else 2] if planar else None
            friction, normal = self._holding(normal, friction, held[: self._each], lateral)
        given = [
            tuple(graph.symbol(f"{letter}{POSE + k}") for k in range(n)) for letter, n in zip("ab", sizes, strict=True)
        ]
        bare = SpherePlane(self.name, *markers, normal, friction, graph.zero)
        contact = touching(kinds, markers, (given[0], given[1]), bare)
        if flat:
            contact = AtHeight(self.name, *markers, contact.normal_law, contact.friction, contact, pair.height())
        if kinds[1] == "rim":
            across = vec.transpose(view.rotation(markers[0]))[0 if kinds[0] == "half" else 2]
            contact = SoilWheel(self.name, *markers, normal, friction, contact, given[1][0], given[1][1], across)
        on_second, on_first = contact.remainder(view) if lost else contact.loads(view)
        assert isinstance(on_second, MarkerLoad)
        assert isinstance(on_first, MarkerLoad)
        energy = graph.zero if lost else contact.potential(view)
        assert energy is not None
        results = [*on_second.force, *on_first.torque, *on_second.torque, energy]
        share = contact.share(view)
        if held and not lost:
            rates = zip(contact.state_rates(view), contact.rates_apart(), strict=True)
            part = graph.one if share is None else share
            results += [(x - apart) * part for x, apart in rates]
            if self._slots > self._each:
                results.append(where(graph.apply("lt", 0.0, contact.touch(view)[1]), part, 0.0))
        results += [graph.zero] * (len(held) if lost else 0)
        names = [f"a{k}" for k in range(POSE + sizes[0])] + [f"b{k}" for k in range(POSE + sizes[1])]
        names += [*(f"l{k}" for k in range(len(places))), *(f"s{k}" for k in range(len(held)))]
        seeds = {graph.symbol(name): graph.symbol(f"d_{name}") for name in names}
        slopes = jvp(results, seeds)
        across, depth, arm, _ = contact.touch(view)
        own_depth = depth
        if share is not None:  # beside a piece of ground nothing is in it, and its neighbour is what is near
            owned = graph.apply("lt", 0.0, share)
            own_depth = where(owned, depth, -NOWHERE)
            depth = where(owned, depth, graph.apply("min", depth, 0.0))
        touch = [*across, depth, turning_radius(kinds[1], given[1], graph)]
        out = vec.transpose(view.rotation(markers[kinds[0] == "half"]))[2] if planar else vec.zero(graph)
        spot = [*across, own_depth, *vec.add(view.position(markers[0]), arm), *out, *rigid]
        nodes, renamed = _kept(graph, [*results, *slopes, *touch, *spot])
        ids, seen, place = ([renamed[x.id] for x in found] for found in ((*results, *slopes), touch, spot))
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


class _Part(NamedTuple):
    """A feature, its shape and the number of that in its group, and its number among all of its class there."""

    shape: ContactShape
    feature: Feature
    number: int
    column: int


def _features(shapes: Sequence[ContactShape]) -> dict[str, list[_Part]]:
    """Features of shapes, by class."""
    found: dict[str, list[_Part]] = {}
    before: dict[str, int] = {}
    for number, shape in enumerate(shapes):
        for feature in shape.features():
            column = before.get(feature.kind, 0) + feature.slot
            found.setdefault(feature.kind, []).append(_Part(shape, feature, number, column))
        for kind, count in shape.parts().parts.items():
            before[kind] = before.get(kind, 0) + count
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
