"""Constraint elements: drivers, which prescribe a measure of the configuration as a function of time.

measure(q) - value(t) = 0 (Shabana, Computational Dynamics, sec. 3.3; Haug, Computer Aided Kinematics and Dynamics of
Mechanical Systems, sec. 3.5); velocity and acceleration follow from the derivatives of the value.
"""

from __future__ import annotations

from abc import abstractmethod

from ...expr import vectors as vec
from ...expr.core import Expr, reachable, sqrt, symbols_of
from ...expr.vectors import Vec3
from ..dimensions import REACH
from ..element_type import ElementType, Entry, table
from ..frames import Marker
from ..glyphs import ROUND_ARROW, Drawn, Glyph
from ..kinds import MOTION, Axis, JointReference, MarkerReference, Pair, Scalar
from .constraint import Condition, Constraint, ConstraintView, on_two_bodies

#: Kinds of tables whose second derivative jumps between points.
ROUGH = ("monotone",)


class Driver(Constraint):
    """A measure that follows ``value``, an expression of t and parameters; its row is called ``<name>.motion``."""

    sentence = "A measure $s$ of the motion follows a given function of time."
    formula = r"s - f(t) = 0"
    value: Expr

    @abstractmethod
    def measure(self, view: ConstraintView) -> tuple[Expr, str]:
        """What is driven, and its kind: 'length' or 'angle'."""

    def conditions(self, view: ConstraintView) -> list[Condition]:
        measure, kind = self.measure(view)
        return [Condition("motion", measure - self.value, kind)]


class CoordinateDriver(Driver):
    """The coordinate of a joint."""

    type_name = "driver"
    coordinate: Expr
    kind: str

    def glyphs(self) -> list[Glyph]:
        name = self.coordinate.node
        return [Drawn((), str(name[1]), about=ROUND_ARROW)] if name[0] == "sym" else []

    def measure(self, view: ConstraintView) -> tuple[Expr, str]:
        return self.coordinate, self.kind

    def hints(self, view: ConstraintView) -> list[tuple[Expr, Expr]]:
        return [(self.coordinate, self.value)]


class DistanceDriver(Driver):
    """The distance between the origins of two markers, which must not meet."""

    type_name = "driver_distance"
    start: Marker
    end: Marker

    def measure(self, view: ConstraintView) -> tuple[Expr, str]:
        d = view.relative(self.start, self.end).position
        return sqrt(vec.dot(d, d)), "length"


class PlaceDriver(Driver):
    """The place of a marker's origin along ``axis``, a unit vector in the axes of marker ``on``, from its origin."""

    type_name = "driver_place"
    marker: Marker
    axis: Vec3
    on: Marker

    def measure(self, view: ConstraintView) -> tuple[Expr, str]:
        return vec.dot(self.axis, view.relative(self.on, self.marker).position), "length"


class AngleDriver(Driver):
    """The turn of one marker about the z axis of another; the two z axes stay in line."""

    type_name = "driver_angle"
    start: Marker
    end: Marker

    def measure(self, view: ConstraintView) -> tuple[Expr, str]:
        return view.turn(self.start, self.end)[0], "angle"

    def is_defined(self, view: ConstraintView) -> bool:
        return view.turn(self.start, self.end)[2]


def _driver(e: Entry) -> Driver | None:
    value = _value(e)
    if "marker" not in e.values:
        for key in ("axis", "on"):
            e.refuse(key, "only a driver of a marker takes this key")
    if "coordinate" in e.values:
        result = e["coordinate"]
        if result is not None and result.kind == "parameter":
            message = f"{result.name!r} is an Euler parameter, which cannot move on its own"
            e.fault("coordinate", message, "drive an angle or markers, or use Euler angles", "EG-REFERENCE")
        return None if result is None else CoordinateDriver(e.name, value, e.symbol(result), result.kind)
    if "marker" in e.values:
        marker, on, axis = e["marker"], e["on"], e["axis"]
        return PlaceDriver(e.name, value, marker, axis, on) if on_two_bodies(e, "on", marker, on) else None
    key = "between" if "between" in e.values else "angle"
    pair = e.pair(key)
    if pair is None or not on_two_bodies(e, key, *pair):
        return None
    return (DistanceDriver if key == "between" else AngleDriver)(e.name, value, *pair)


def _value(e: Entry) -> Expr:
    """The motion: an expression of t, parameters, inputs and functions that are smooth enough."""
    value: Expr = e["value"]
    graph = e.graph
    for name in sorted(symbols_of([value])):
        kind = e.reader.meaning(name).kind
        if kind not in ("", "time", "parameter", "input"):
            remedy = "a driver's value can contain t, parameters and inputs; a coupling relates coordinates"
            e.fault("value", f"the {kind} {name!r} cannot be used here", remedy, "EG-REFERENCE")
    called = {graph.nodes[i][0] for i in reachable(graph, [value.id])} & graph.calls.keys()
    for function, orders in (graph.calls[operation] for operation in sorted(called)):
        table_kind = e.reader.table_kind(function.name)
        if table_kind is not None and (table_kind in ROUGH or any(orders)):
            derived = f"of the derivative of table {function.name!r}"
            what = derived if any(orders) else f"of {table_kind} table {function.name!r}"
            remedy = "use a table of kind cubic, natural or periodic: its curvature is continuous"
            e.fault("value", f"the acceleration {what} jumps at its points", remedy, "EG-JUMP")
    return value


TYPES = table(
    ElementType(
        "driver",
        "a motion prescribed over time: of a coordinate, a distance, an angle or the place of a marker.",
        {
            "coordinate": JointReference("a joint of one degree, or a coordinate, that is driven"),
            "value": Scalar(
                "the motion over time (rad or m), an expression of t, parameters, inputs and functions; its second "
                "derivative should be continuous",
                required=True,
                level=MOTION,
                dimension=REACH,
                along="coordinate",
            ),
            "between": Pair("two markers whose distance is driven; the distance must not become 0"),
            "angle": Pair(
                "two markers whose z axes stay in line; the angle of the second about z of the first is driven"
            ),
            "marker": MarkerReference("a marker whose position along axis is driven"),
            "axis": Axis("direction in which the marker's position is measured, in the axes of on", default="x"),
            "on": MarkerReference("body or marker from which the marker's position is measured", default="ground"),
        },
        _driver,
        one_of=("coordinate", "between", "angle", "marker"),
    )
)
