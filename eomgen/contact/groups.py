"""Contact in bulk: every shape of one group against every shape of another, by one law."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

from ..base.value_rules import POSITIVE, Allowed
from ..elements.dimensions import LENGTH
from ..elements.element_type import ElementType, Entry, element, table
from ..elements.forces.force import Force, Load, MarkerLoad, MovingView, View
from ..elements.forces.friction import (
    BRISTLES,
    FRICTIONS,
    SUMS,
    UNIT,
    DryFriction,
    LuGre,
    friction_key,
    has_bristles,
)
from ..elements.forces.normal_laws import CURVED_LAWS, IMPACT, HertzBodies, NormalLaw, RigidLaw, normal_key
from ..elements.frames import Frame, Marker
from ..elements.glyphs import Glyph
from ..expr.core import Expr, Graph
from ..expr.vectors import Vec3
from .pair_laws import HOLLOWS, MEETINGS, PairLaw, class_of, pair_kind, pair_states
from .pairs import LOSSES, PairFunction, pair_meeting, pair_sum, pair_witnesses
from .profiles import never_reached
from .shape_keys import SHAPE_FIELDS, ContactShapes
from .shapes import PIECED, ContactShape, Feature, by_edges
from .soil_beds import COUNTS, STATES, bed_rates
from .soil_laws import LATERAL, SOIL, SoilPressure, SoilShear, states_of_soil
from .states import (
    BED,
    FIELD,
    FIELD_SHAPE,
    GROUNDS,
    MOST_PAIRS,
    PLANAR,
    POLYGON,
    FeatureKind,
    ShapeParts,
    cells_of,
    groups_of_entry,
)

# -- the element -------------------------------------------------------------------------------------------------------

# The law of one kind of pair is derived once, in a graph of its own; the sum over all pairs is one operation of the
# model's graph (:mod:`~eomgen.contact.pairs`), so that equations do not grow with the number of pairs.


class ContactGroups(Force):
    """Contact of two groups of shapes, or of the shapes of one group among themselves (``second`` is empty then).

    The force of a pair is that of :class:`~.point.Contact`.  Shapes of one body do not meet.
    """

    sentence = (
        "Contact of every shape of one group with every shape of another: a force along the normal from the "
        "penetration $d$ and its rate, and friction against the sliding."
    )
    by_power = True
    first: tuple[ContactShape, ...]
    second: tuple[ContactShape, ...]
    normal_law: NormalLaw
    friction: DryFriction | None
    states: tuple[Expr, ...] = ()
    axes: int = 0  #: how many states a pair has of friction
    coefficient: Expr | None = None  #: of friction, where bodies are rigid
    restitution: Expr | None = None  #: where bodies are rigid

    @property
    def not_finite_where(self) -> str:  # type: ignore[override]
        kinds = {shape.kind for shape in (*self.first, *self.second)}
        return "; ".join(why for kind, why in _ENDS.items() if kind in kinds)

    @property
    def laws(self) -> tuple[Any, ...]:
        return (self.normal_law,) if self.friction is None else (self.normal_law, self.friction)

    def glyphs(self) -> list[Glyph]:
        return [seen for shape in (*self.first, *self.second) for seen in shape.glyphs()]

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
        result = results[6 * len(markers) + 1 :]
        if self.on_bed:
            assert isinstance(self.friction, SoilShear)
            return tuple(bed_rates(self.states, result, self.friction.recovery))
        if isinstance(self.friction, LuGre) and self._pieces:
            return self._bent(self.friction, result)
        if self._pieces:
            result = self._shared_out(result)
        return tuple(map(Expr.__add__, self._rates_apart(), result))

    def _shared_out(self, sums: list[Expr]) -> list[Expr]:
        """What pieces add to the rates of the states that they share, which is its mean where several touch."""
        result: list[Expr] = []
        for k in range(0, len(sums), self._slots):
            *added, touching = sums[k : k + self._slots]
            result += [x / x.graph.apply("max", 1.0, touching) for x in added]
        return result

    def _bent(self, friction: LuGre, sums: list[Expr]) -> tuple[Expr, ...]:
        """Rates of bristles from what all pieces add."""
        result: list[Expr] = []
        for k, start in enumerate(range(0, len(sums), self._slots)):
            force = friction.holding(self.states[k * self._each : (k + 1) * self._each], None)
            result += force.rates_of(sums[start : start + self._slots])
        return tuple(result)

    def _rates_apart(self) -> list[Expr]:
        """Rates of all states where no shapes meet."""
        result: list[Expr] = []
        law = self._pair_law(False)
        for k in range(0, len(self.states), self._each):
            friction, normal = law.holding(self.normal_law, self.friction, self.states[k : k + self._each], None)
            result += [*(() if friction is None else friction.rates_apart()), *normal.rates_apart()]
        return result

    @property
    def _each(self) -> int:
        """How many states a pair has."""
        return self.axes + self.normal_law.count

    def _pair_law(self, planar: bool) -> PairLaw:
        rigid = (self.coefficient, self.restitution)
        slots = self._slots if self.states else 0
        return PairLaw(self.name, self.normal_law, self.friction, rigid, self.axes, slots, planar)

    @property
    def _slots(self) -> int:
        """How many numbers a pair has in the sum: its states, and where shapes have pieces what their rates need too.

        Soil needs how many pieces touch; see also :meth:`~..elements.forces.friction.LuGre.sums`.
        """
        if self.on_bed:
            return self._each + COUNTS
        return self._each + (self._pieces and (SUMS if isinstance(self.friction, LuGre) else 1))

    @property
    def _pieces(self) -> bool:
        """Whether shapes have pieces, which share states."""
        return any(shape.kind in PIECED for shape in (*self.first, *self.second))

    @property
    def on_bed(self) -> bool:
        """Whether the ground remembers by place."""
        return any(shape.kind == BED for shape in (*self.first, *self.second))

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

    def _groups(self) -> list[dict[FeatureKind, list[_Part]]]:
        """Features of both groups, by class, of those classes that meet something."""
        groups = [_features(group) for group in (self.first, self.second) if group]
        met = set[tuple[int, FeatureKind]]()
        for g, members in enumerate(groups):
            for h, other in enumerate(groups):
                if g != h or len(groups) == 1:
                    pairs = [(a, b) for a in members for b in other if self._meet((a, b), members[a], other[b])]
                    met |= {(g, a) for a, _ in pairs} | {(h, b) for _, b in pairs}
        return [{k: parts for k, parts in group.items() if (g, k) in met} for g, group in enumerate(groups)]

    def _meet(self, kinds: tuple[FeatureKind, FeatureKind], members: list[_Part], other: list[_Part]) -> bool:
        """Whether parts of two classes meet, and act on each other."""
        hollow, meet = kinds[0].name, (kinds[0].name, kinds[1].name) in MEETINGS
        if not meet or hollow not in HOLLOWS:
            return meet
        pairs = [(one.feature.sizes, two.feature.sizes[0]) for one in members for two in other]
        never = all(never_reached(hollow, sizes, radius) for sizes, radius in pairs)
        return not never and not self.normal_law.elastic(other[0].feature.sizes[0].graph.one).is_zero

    def met_shapes(self) -> list[tuple[str, int]]:
        parts = [one.shape for group in self._groups() for features in group.values() for one in features]
        return [(f"{shape.kind} on {shape.marker.label}", shape.marker.body) for shape in parts]

    def meeting(self, view: MovingView) -> list[Expr]:
        markers, function, operands = self._operands(view, "")
        return pair_meeting(view.graph, function, operands, view.accelerations(markers))

    def near(self, view: View) -> list[Expr]:
        if isinstance(self.normal_law, SoilPressure):
            return []  # soil yields
        _, function, operands = self._operands(view, "", still=True)
        return pair_witnesses(view.graph, function, operands)

    @property
    def is_rigid(self) -> bool:  # type: ignore[override]
        return isinstance(self.normal_law, RigidLaw)

    def _results(self, view: View, part: str, still: bool = False) -> tuple[list[Marker], list[Expr]]:
        """The bodies as markers at their origins, force and torque on each, and the energy; at rest, if asked."""
        markers, function, operands = self._operands(view, part, still)
        return markers, pair_sum(view.graph, function, operands)

    @cached_property
    def _made(self) -> dict[str, tuple[PairFunction, list[Expr]]]:
        """Sums over pairs, by what of them is requested, and what they are given beside the motion of bodies."""
        return {}

    def _operands(self, view: View, part: str, still: bool = False) -> tuple[list[Marker], PairFunction, list[Expr]]:
        """The bodies as markers at their origins, the sum over pairs and what it is given."""
        graph = view.graph
        bodies = sorted({shape.marker.body for shape in (*self.first, *self.second)})
        labels = {shape.marker.body: shape.marker.label.partition(".")[0] for shape in (*self.first, *self.second)}
        frame = Frame.identity(graph)
        markers = [Marker(body, frame, labels[body]) for body in bodies]
        operands: list[Expr] = []
        for marker in graph.marked(markers):
            rotation = [x for row in view.rotation(marker) for x in row]
            moving = (view.velocity(marker), view.angular_velocity(marker))
            operands += [*view.position(marker), *rotation]
            operands += [graph.zero if still else x for v in moving for x in v]
        if part not in self._made:  # of bodies that move, at rest, for the energy: the sum is the same
            data = _SharedData(len(operands), graph)
            self._made[part] = self._function(f"{part}{self.name}", bodies, data, bool(part)), data.values
        function, shared = self._made[part]
        states = [graph.zero] * function.states if still else self._all(graph)  # the energy does not depend on states
        return markers, function, [*operands, *shared, *states]

    def _all(self, graph: Graph) -> list[Expr]:
        """The states of all pairs; the number of pieces that touch is found, so 0 stands in its place."""
        result: list[Expr] = []
        for k in range(0, len(self.states), self._each or 1):
            result += [*self.states[k : k + self._each], *[graph.zero] * (self._slots - self._each)]
        return result

    def _function(self, name: str, bodies: Sequence[int], data: _SharedData, lost: bool) -> PairFunction:
        shapes = [self.first, self.second] if self.second else [self.first]
        groups = self._groups()
        place = {body: k for k, body in enumerate(bodies)}
        keys = [(g, kind) for g, group in enumerate(groups) for kind in group]
        tables = [tuple(data.row(place[one.shape.marker.body], one.feature) for one in groups[g][k]) for g, k in keys]
        planar = any(shape.kind in PLANAR for shape in (*self.first, *self.second))
        blocks, _ = pair_states([[shape.parts() for shape in group] for group in shapes]) if self.states else ({}, 0)
        law = self._pair_law(planar)
        kinds = []
        for i, (g, first) in enumerate(keys):
            for j, (h, second) in enumerate(keys):
                apart = g != h or len(groups) == 1
                twice = first.name == second.name and i > j  # round beside round, once
                these, other = groups[g][first], groups[h][second]
                if apart and not twice and self._meet((first, second), these, other):
                    sizes = len(these[0].feature.sizes), len(other[0].feature.sizes)
                    height = these[0].shape.sizes[0] if first.name == FIELD else None
                    kind = pair_kind(law, (first, second), (i, j), sizes, data.place, lost, height)
                    if self.on_bed:
                        places = tuple(self._slots * x.column for x in these)
                        kind = replace(kind, offsets=(places, (0,) * len(other)), lines=_lines(these))
                    elif self.states:
                        block = blocks[g, h, class_of(first.name, second.name), second.name]
                        rows = tuple(self._slots * block.of_first(x.number, x.column) for x in these)
                        columns = tuple(self._slots * block.places * x.column for x in other)
                        kind = replace(kind, offsets=(rows, columns))
                    kinds.append(kind)
        states = [x.value for x in self._all(data.graph)]
        numbers = (*(x.value for x in data.values), *states)
        return PairFunction(name, len(bodies), numbers, tuple(tables), tuple(kinds), len(states))


#: Kind of shape -> where its law ends.
_ENDS = {
    **dict.fromkeys(
        ("profile", "smooth_profile"),
        "a shape is deeper below the profile than its depth: make the law stiffer or the depth greater, or "
        "smaller for a body that belongs below",
    ),
    "ellipsoid": "an ellipsoid is so deep in another solid that its nearest place is not unique: make the law stiffer",
    FIELD_SHAPE: "a shape lies in a hollow of the height field that is sharper than itself: make the shape smaller",
}


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
        """A row of a table of shapes; see :class:`~eomgen.contact.pair_sums.PairSum`."""
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


def _lines(parts: Sequence[_Part]) -> tuple[tuple[int, int], ...]:
    """Rows of cells that are of one bed: the first of each and how many."""
    rows = [list(group) for _, group in itertools.groupby(parts, lambda part: part.number)]
    starts = itertools.accumulate((len(group) for group in rows), initial=0)
    return tuple((start, len(group)) for start, group in zip(starts, rows, strict=False))


def _features(shapes: Sequence[ContactShape]) -> dict[FeatureKind, list[_Part]]:
    """Features of shapes, by class; parts are numbered in this order."""
    result: dict[FeatureKind, list[_Part]] = {}
    before: dict[str, int] = {}
    heights: dict[Expr, int] = {}  # fields of one height are of one class
    for number, shape in enumerate(shapes):
        for feature in shape.features():
            column, kind = before.get(feature.kind, 0) + feature.slot, FeatureKind(feature.kind, feature.number)
            if feature.kind == FIELD:
                kind = FeatureKind(FIELD, heights.setdefault(shape.sizes[0], 1 + len(heights)))
            result.setdefault(kind, []).append(_Part(shape, feature, number, column))
        for name, count in shape.parts().parts.items():
            before[name] = before.get(name, 0) + count
    polygons = 0  # which are of one class, whatever the number of their corners
    for kind, parts in result.items():
        if kind.name == POLYGON:
            result[kind] = [part._replace(column=polygons + k) for k, part in enumerate(parts)]
            polygons += len(parts)
    return result


def _vector(x: Sequence[Expr]) -> Vec3:
    return x[0], x[1], x[2]


# -- reading an entry --------------------------------------------------------------------------------------------------


def _contact_groups(e: Entry) -> ContactGroups | None:
    first = e["first"]
    second = e["second"] if "second" in e.values else ()
    soil, bristles = "soil" in e.values, has_bristles(e.values)
    laws = _laws(e)
    if first is None or second is None or laws is None or e.at_fault():
        return None
    normal, friction, rigidly = laws
    _refuse_pairs(e, first, second)
    if not soil and not bristles:  # whose states are counted before shapes are known
        first, second = by_edges(first, second)
    if bristles:
        _refuse_edges(e, first, second)
    if soil:
        _refuse_on_soil(e, first, second)
    bed = _is_bed(e, first, second, soil)
    if bed:
        first, second = (tuple(shape.on_bed() for shape in shapes) for shapes in (first, second))
    for key, shapes in (("first", first), ("second", second)):
        if not soil and any(shape.is_wheel for shape in shapes):
            e.fault(key, "has a circle with a width, which belongs to wheels on soil", "leave width out, or give soil")
    if isinstance(normal, HertzBodies):
        for key, shapes in (("first", first), ("second", second)):
            if flat := [shape.kind for shape in shapes if shape.kind not in ("sphere", "half_space")]:
                e.fault(key, f"a {flat[0]} has no radius for Hertz's law from moduli", "give stiffness, not moduli")
    axes = 0
    if soil or bristles:
        groups = groups_of_entry(e.values)
        pairs = pair_states(groups)[1]
        axes = len(_axes(e.values, groups)) if pairs else 0
        axes = len(STATES) - 1 if bed else axes
        if pairs > MOST_PAIRS:
            message = f"has {pairs} pairs with states; at most {MOST_PAIRS} may have them"
            remedy = "put only shapes that stick to each other into the groups, or use friction of type brown_mcphee"
            e.fault("", message, remedy, "EG-TOO-LARGE")
    return ContactGroups(e.name, first, second, normal, friction, e.states(), axes, *rigidly)


def _is_bed(e: Entry, first: Sequence[ContactShape], second: Sequence[ContactShape], soil: bool) -> bool:
    """Whether the ground is a bed, of which there is one, with soil; what is wrong is noted."""
    beds = [
        (key, shapes) for key, shapes in (("first", first), ("second", second)) if any(x.kind == BED for x in shapes)
    ]
    for key, shapes in beds:
        if len(shapes) > 1:
            e.fault(key, "has a bed and more", "give one bed as all of a group, and contacts of their own to others")
        if not soil:
            e.fault(key, "has a bed, which belongs to soil", "give soil, or half_plane or a profile as the ground")
    if beds:
        for word in ("lateral", "peak_angle", "reversal"):
            _refuse_in_soil(e, word, "has no meaning for a bed, whose cells are sheared along x")
    return bool(beds)


def _refuse_in_soil(e: Entry, key: str, why: str) -> None:
    if key in e.values.get("soil", ()):
        e.fault(f"soil.{key}", why, "leave it out")


def _laws(e: Entry) -> tuple[NormalLaw, DryFriction | None, tuple[Expr | None, Expr | None]] | None:
    """The laws of the normal force and of friction; coefficient of friction and restitution where bodies are rigid."""
    if "soil" in e.values:
        for part in [part for part in ("law", "friction") if part in e.values]:
            keys = [f"{part}.{key}" for key in e.values[part]] if isinstance(e.values[part], Mapping) else [part]
            for key in keys:
                e.fault(key, "is of another law than soil", "leave it out")
        result = e["soil"]
        return None if result is None else (*result, (None, None))
    if "law" not in e.values:
        e.fault("", "has no law", "give law: {stiffness: ...} and what else the law has, or soil", "EG-MISSING")
    law, rubbing = e.part("law"), e.values.get("friction", {})
    normal, rigid = (None, False) if law is None else (law.element_type.read(law), law.element_type is RIGID)
    restitution = None
    if law is not None and "restitution" in law.values and "restitution" in law.fields:  # judged once
        restitution = law["restitution"] if rigid else law.law("restitution", {})
    if not rigid:
        friction = e["friction"]
        return None if normal is None else (normal, friction, (getattr(friction, "dynamic", None), restitution))
    for key in [key for key in rubbing if key != "dynamic"]:
        why = "has no meaning for rigid bodies, whose friction is a coefficient"
        e.fault(f"friction.{key}", why, "leave it out")
    dynamic, place = FRICTIONS["coulomb"].keys["dynamic"], f"{e.path}.friction.dynamic"
    coefficient = dynamic.read(e.reader, place, rubbing["dynamic"]) if "dynamic" in rubbing else None
    return None if normal is None else (normal, None, (coefficient, restitution))


def _refuse_on_soil(e: Entry, first: Sequence[ContactShape], second: Sequence[ContactShape]) -> None:
    """Note groups that are not plates on ground."""
    for shapes, others, key in ((first, second, "second"), (second, first, "first")):
        if any(shape.kind in GROUNDS for shape in shapes):
            wrong = sorted({shape.kind for shape in others if shape.kind != "plate" and not shape.is_wheel})
            wheels = [shape for shape in others if shape.is_wheel]
            if wrong:
                remedy = "give plates: the undersides of links, soles, feet; or wheels: circles that have a width"
                e.fault(key, f"a {wrong[0]} does not lie on soil", remedy)
            elif 0 < len(wheels) < len(others) and not any(shape.kind == BED for shape in shapes):
                e.fault(key, "has wheels and plates, which remember differently", "give each contacts of their own")
            on_bed = any(shape.kind == BED for shape in shapes)  # whose cells remember
            if not on_bed:
                for word in ("recovery", "lateral") if wheels else ("peak_angle", "reversal"):
                    _refuse_in_soil(e, word, f"has no meaning for {'wheels' if wheels else 'plates'}")
                _refuse_in_soil(e, "settling", "belongs to the cells of a bed")
            return
    message = "has soil, but no ground"
    e.fault("", message, "give half_plane or a profile as one group, plates or wheels as the other", "EG-MISSING")


def _axes(values: Mapping[str, Any], groups: Sequence[Sequence[ShapeParts]]) -> tuple[str, ...]:
    """How states of friction are called, by their axes.

    In the plane along the surface, and across the plane; in space along x and y of half-spaces, or x, y, z of others.
    """
    kinds = {shape.kind for group in groups for shape in group}
    if kinds & set(PLANAR):
        law = values["soil" if "soil" in values else "friction"]
        return ("",) if isinstance(law, Mapping) and law.get("lateral") is False else ("_x", "_z")
    round_pairs = FIELD_SHAPE in kinds or any(first != "surface" for _, _, first, _ in pair_states(groups)[0])
    return ("_x", "_y", "_z") if round_pairs else ("_x", "_y")


def _states(values: Mapping[str, Any]) -> dict[str, str]:
    """States of all pairs and their units, pair after pair."""
    soil = "soil" in values
    if not soil and not has_bristles(values):
        return {}
    groups = groups_of_entry(values)
    if cells := cells_of(groups):
        return {f"{name}_{k + 1}": "m" for k in range(cells) for name in STATES}
    axes = _axes(values, groups)
    names = states_of_soil(axes) if soil else tuple(f"bristle{axis}" for axis in axes)
    unit = "m" if soil else UNIT
    pairs = pair_states(groups)[1]
    return {f"{name}_{k + 1}": unit for k in range(pairs) for name in names} if pairs <= MOST_PAIRS else {}


def _refuse_pairs(e: Entry, first: Sequence[ContactShape], second: Sequence[ContactShape]) -> None:
    """Note shapes that cannot meet, and a shape that is in both groups."""
    kinds = sorted({shape.kind for shape in first}), sorted({shape.kind for shape in second or first})
    for a in kinds[0]:
        for b in kinds[1]:
            if (a in PLANAR) != (b in PLANAR):
                e.fault("second", f"{a} and {b} do not meet", _ALLOWED)
            elif a in GROUNDS and b in GROUNDS and (second or a != b or _differ(first, a)):
                message = f"two shapes {a} do not meet" if a == b else f"{a} and {b} do not meet"
                e.fault("second" if second else "first", message, _ALLOWED)
    for key, this_kind, met in (("second", kinds[0], kinds[1]), ("first", kinds[1], kinds[0])):
        if "plate" in this_kind and (wrong := [kind for kind in met if kind not in _UNDER_PLATES]):
            e.fault(key, f"{wrong[0]} and plate do not meet", f"plates meet {', '.join(_UNDER_PLATES)}")
            break
    for key, group, others in (("first", first, second or first), ("second", second, first)):
        cornered = sorted({shape.kind for shape in others if shape.kind in _CORNERED or _is_thin(shape)})
        if cornered and (second or _differ_in_body(first)):
            message = f"corners of {cornered[0]} pass through a segment of radius 0, which has no inside"
            for shape in group:
                if shape.kind == "segment":
                    e.require(key, shape.sizes[1], POSITIVE, "give the segment a radius greater than 0", message)
        if e.at_fault(key):
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


def _refuse_edges(e: Entry, first: Sequence[ContactShape], second: Sequence[ContactShape]) -> None:
    """Note cuboids that meet cuboids or capsules, where every pair of their edges would have states."""
    for one in first:
        for other in second or first:
            kinds = {one.kind, other.kind}
            if one.marker.body != other.marker.body and kinds in ({"cuboid"}, {"cuboid", "capsule"}):
                message = f"{one.kind} and {other.kind} have no states where their edges meet"
                e.fault("friction.type", message, "use coulomb or brown_mcphee for cuboids among themselves")
                return


def _is_thin(shape: ContactShape) -> bool:
    return shape.kind == "segment" and shape.sizes[1].is_zero


def _differ_in_body(shapes: Sequence[ContactShape]) -> bool:
    return len({shape.marker.body for shape in shapes}) > 1


def _differ(shapes: Sequence[ContactShape], kind: str) -> bool:
    """Whether shapes of a kind are on different bodies."""
    return len({shape.marker.body for shape in shapes if shape.kind == kind}) > 1


_UNDER_PLATES = ("bed", "half_plane", *PIECED)
_CORNERED = ("box", "polygon", *PIECED)  #: shapes whose corners meet segments
_ALLOWED = (
    "circle, segment, box, polygon, outline, smooth_outline and sprocket meet each other, half_plane, profile and "
    "smooth_profile, which plates meet too; wheels and plates meet a bed; sphere, capsule, ellipsoid and cuboid meet "
    "half_space, height_field and each other"
)

#: No penetration, in runs by the method moreau only.
RIGID = element(
    RigidLaw,
    "rigid",
    "no penetration, for runs by the method moreau only.",
    more={
        "restitution": IMPACT["restitution"].replace(
            doc="coefficient of restitution, Newton's", allowed=Allowed(0.0, 1.0), remedy="is 0 to 1"
        )
    },
)
_LUGRE = FRICTIONS[BRISTLES]
_SHAPES = "shapes {shape, on, ...} of the "

TYPES = table(
    ElementType(
        "contacts",
        "contact of every shape of a group with every shape of another, by one law.  Shapes are mappings of shape "
        f"({', '.join(PLANAR)}; {', '.join(kind for kind in SHAPE_FIELDS if kind not in PLANAR)}), "
        "on (a marker or a list of markers) and sizes.  Shapes of one body do not meet.",
        {
            "first": ContactShapes(_SHAPES + "first group", required=True, dimension=LENGTH),
            "second": ContactShapes(
                _SHAPES + "second group; without it those of the first meet among themselves",
                dimension=LENGTH,
            ),
            "law": normal_key(CURVED_LAWS | table(RIGID), required=False),
            "friction": friction_key(FRICTIONS | table(_LUGRE._replace(keys=_LUGRE.keys | LATERAL)), "dynamic"),
            "soil": SOIL,
        },
        _contact_groups,
        states=_states,
    )
)
