"""Constraint elements: each a frozen class holding graph expressions and markers, asked for conditions that must hold.

An element sees the mechanism's motion through a :class:`ConstraintView`, which the kinematics stage provides.
Coordinates are held as symbols under their own names; the kinematics stage replaces those of cut joints.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple, Protocol

from ...expr.core import Expr, is_comparison, symbols_of
from ...expr.differentiate import gradient
from ..dimensions import SPIN
from ..element_type import Element, ElementType, Entry, Meaning
from ..frames import Frame, Marker, MotionView
from ..glyphs import Glyph
from ..kinds import LAW, OUTPUT, Factors, Fields, Flag, Scalar, SomeNames

POSITION, VELOCITY = "position", "velocity"


class ConstraintView(MotionView, Protocol):
    """Motion of markers against each other too."""

    def relative(self, start: Marker, end: Marker) -> Frame:
        """Placement of ``end`` in the axes of ``start``."""
        ...


class Condition(NamedTuple):
    """One equation ``expression = 0``.

    ``kind`` is 'length' (m, or m/s) or 'angle' (rad, a ratio, or rad/s).  ``level`` is 'position' for an equation of
    coordinates, or 'velocity' for one that is linear in velocities and cannot be integrated (nonholonomic).
    """

    label: str
    expression: Expr
    kind: str
    level: str = POSITION


class Constraint(Element):
    """A constraint element.  ``name`` is the user's; a subclass adds its coordinates, markers and dimensions.

    ``sentence`` and ``formula`` (LaTeX) say its condition, for readers.
    """

    sentence: ClassVar[str] = "A condition between coordinates, or between motions of markers."
    formula: ClassVar[str] = r"C(q,t) = 0"
    type_name: ClassVar[str]
    written: ClassVar[bool] = False  #: whether factors in the equations are the user's, and may have any size
    name: str

    @abstractmethod
    def conditions(self, view: ConstraintView) -> list[Condition]:
        """The equations this element adds."""

    def glyphs(self) -> list[Glyph]:
        """What is to be seen of it in a picture; nothing unless a type says so."""
        return []

    def aligned(self, view: ConstraintView) -> list[Expr]:
        """Expressions that must be positive: the equations alone also admit contact from the wrong side."""
        return []

    def is_defined(self, view: ConstraintView) -> bool:
        """Whether the angle it is about is defined everywhere."""
        return True

    def hints(self, view: ConstraintView) -> list[tuple[Expr, Expr]]:
        """Where assembly may look for a coordinate of the element's own: (its symbol, a value near by)."""
        return []


def on_two_bodies(e: Entry, key: str, a: Marker | None, b: Marker | None) -> bool:
    """Whether there are two markers, on different bodies; the same body is noted."""
    if a is None or b is None:
        return False
    if a.body == b.body:
        remedy = "choose a marker on another body for one of them"
        e.fault(key, f"{a.label} and {b.label} are on the same body", remedy, "EG-REFERENCE")
    return a.body != b.body


# -- keys of constraints that close and open --------------------------------------------------------------------------


#: Of any constraint that may close and open in a run.
SWITCHING: Fields = {
    "closes": Scalar("where it falls to 0 the constraint closes: a plastic impact, after which it holds", level=LAW),
    "opens": Scalar("where it falls to 0 while the constraint holds, it lets go", level=LAW),
    "closed": Flag("whether it holds at the start of a run; false if closes is given, else true"),
    "releases": SomeNames("one or several other constraints that let go as it closes, before the impact"),
    "stabilisation": Scalar(
        "rate (1/s), greater than 0, at which an error of the equation dies away while it holds",
        default=10,
        dimension=SPIN,
    ),
}

#: How a condition of a joint without coordinates is written that holds for a time.
IN_PLACE_OF_JOINTS = (
    "joints without coordinates, except welds, cannot open; use a constraint of type hold: axes: xyz, turning: xyz "
    "acts as a weld, axes: xyz without turning as a ball joint, axes: xy, turning: z in the plane"
)


def switchable(*types: ElementType) -> dict[str, ElementType]:
    """The table of types with these keys too."""
    return {one.name: one._replace(keys=one.keys | SWITCHING) for one in types}


def is_switched(values: Mapping[str, Any]) -> bool:
    """Whether an entry says that a constraint or joint closes or opens."""
    return not values.keys().isdisjoint(("closes", "opens", "closed"))


def state_of(name: str) -> str:
    """The first-order state that is 1 while the constraint or joint of a name holds."""
    return f"{name}_closed"


def event_of(name: str, key: str) -> str:
    """The event at which it ``closes`` or ``opens``."""
    return f"{name}_{key}"


# -- relations between coordinates that the user writes out ------------------------------------------------------------


#: Of what is true or false: message, remedy and code.
NO_EQUATION = (
    "is a comparison, not an expression that is to be 0", "give the difference of its sides: a - b for a = b",
    "EG-EXPRESSION",
)  # fmt: skip
#: What can stand in an equation, as a remedy.
ALLOWED = "a constraint can contain t, inputs, coordinates and velocities"
#: Kinds of names that cannot, with what is added to that.
_UNUSABLE = {
    "energy": "not energies",
    "reaction": "not reactions",
    "multiplier": "not multipliers",
    "rate of a state": "not rates of states",
}


class Linear(Constraint):
    """A linear relation: sum of factor times coordinate = offset (Shabana, Computational Dynamics, sec. 3.2)."""

    sentence = "A linear relation between coordinates."
    formula = r"\Sigma_k c_k q_k = c_0"
    written = True
    terms: tuple[tuple[Expr, Expr], ...]  #: (coordinate, factor)
    offset: Expr
    kind: str

    def conditions(self, view: ConstraintView) -> list[Condition]:
        total = sum((factor * coordinate for coordinate, factor in self.terms), -self.offset)
        return [Condition("relation", total, self.kind)]


class Equation(Constraint):
    """Any expression held at zero; nonholonomic (``level`` 'velocity') if it is linear in velocities."""

    sentence = "An equation that the model gives."
    formula = r"C = 0"
    written = True
    expression: Expr
    kind: str
    level: str

    def conditions(self, view: ConstraintView) -> list[Condition]:
        return [Condition("equation", self.expression, self.kind, self.level)]


def _coupling(e: Entry) -> Linear | Equation | None:
    if "equation" in e.values:
        e.refuse("offset", "offset belongs to coordinates, not to an equation")
        return _equation(e)
    terms = e["coordinates"]
    if terms is None:
        return None
    kind = "length" if any(result.kind == "length" for result, _ in terms) else "angle"
    return Linear(e.name, tuple((e.symbol(result), factor) for result, factor in terms), e["offset"], kind)


def _equation(e: Entry) -> Equation | None:
    expression = e["equation"]
    if is_comparison(expression):
        e.fault("equation", *NO_EQUATION)
    used: dict[str, Meaning] = {name: e.reader.meaning(name) for name in sorted(symbols_of([expression]))}
    for name, meant in used.items():
        if meant.level == 2:
            what = {"marker": "acceleration", "rate of rate": "second rate"}.get(meant.kind, meant.kind)
            e.fault("equation", f"the {what} {name!r} cannot be used here", ALLOWED, "EG-REFERENCE")
        elif meant.kind in _UNUSABLE:
            remedy = f"{ALLOWED}, {_UNUSABLE[meant.kind]}"
            e.fault("equation", f"the {meant.kind} {name!r} cannot be used here", remedy, "EG-REFERENCE")
    moving = [meant for meant in used.values() if meant.level is not None]
    rates = [name for name, meant in used.items() if meant.level == 1]
    if not moving and not e.at_fault("equation"):
        remedy = f"coordinates are: {', '.join(e.reader.names.of('coordinate'))}"
        e.fault("equation", "the equation contains no coordinate", remedy, "EG-EXPRESSION")
    if {*rates} & symbols_of(gradient(expression, [e.graph.symbol(name) for name in rates])):
        message = f"the equation is not linear in {', '.join(rates)}"
        e.fault("equation", message, "a nonholonomic constraint must be linear in the velocities", "EG-EXPRESSION")
    kind = "length" if any(meant.measure == "length" for meant in moving) else "angle"
    return Equation(e.name, expression, kind, VELOCITY if rates else POSITION)


TYPES = switchable(
    ElementType(
        "coupling",
        "a relation between coordinates: a linear one, or any equation.",
        {
            "coordinates": Factors(
                "mapping of coordinates to factors: the sum of factor times coordinate equals the offset"
            ),
            "offset": Scalar("value of that sum, an expression of parameters", default=0),
            "equation": Scalar(
                "instead of coordinates, an expression that must be 0: of t, parameters, inputs, coordinates, "
                "places and velocities of markers; with velocities the constraint is nonholonomic and must be linear "
                "in them",
                level=OUTPUT,
            ),
        },
        _coupling,
        one_of=("coordinates", "equation"),
    )
)
