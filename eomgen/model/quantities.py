"""Quantities by name: ``vx(hub, in=road)``, ``force(k1)``, ``reaction(A).x``, ``multiplier(mesh)`` <-> their parts.

One class reads all of them, from a text or from the parts of a call, writes them in one way, changes their names and
knows their dimensions.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from enum import Enum
from typing import NamedTuple

from ..elements import dimensions
from ..elements.dimensions import Dimension
from ..elements.frames import Marker
from ..errors import ExpressionError
from ..expr.records import Record

_XYZ, _ONE = ("x", "y", "z"), ("",)
#: Parts of what a force element exerts on a body; of a reaction also the size of the force across the joint's axis.
WRENCH_PARTS = ("x", "y", "z", "mx", "my", "mz", "size")
REACTION_PARTS = (*WRENCH_PARTS, "normal")


class Measure(Enum):
    """What is measured: the word with a place for the part, the parts, the dimension, how often by time.

    The dimension is None where it depends on the element; the order of the mass, which does not move, is None.
    """

    POSITION = "{}", _XYZ, dimensions.LENGTH, 0
    VELOCITY = "v{}", _XYZ, dimensions.SPEED, 1
    ACCELERATION = "a{}", _XYZ, dimensions.ACCELERATION, 2
    ANGLE = "angle", _ONE, dimensions.NONE, 0  #: about the z axis of another marker, or of ground
    ANGLE_RATE = "angle_rate", _ONE, dimensions.SPIN, 1
    DISTANCE = "distance", _ONE, dimensions.LENGTH, 0
    DISTANCE_RATE = "distance_rate", _ONE, dimensions.SPEED, 1
    # angular velocity and acceleration of the marker's body, in ground axes and in the marker's own
    SPIN = "w{}", _XYZ, dimensions.SPIN, 1
    SPIN_BODY = "w{}_body", _XYZ, dimensions.SPIN, 1
    SPIN_RATE = "w{}_dot", _XYZ, dimensions.SPIN_RATE, 2
    SPIN_BODY_RATE = "w{}_body_dot", _XYZ, dimensions.SPIN_RATE, 2
    # sums over all bodies in ground axes, the first two about the marker's origin
    ANGULAR_MOMENTUM = "angular_momentum_{}", _XYZ, dimensions.INERTIA.times(dimensions.TIME, -1), 1
    INERTIA = "inertia_{}", ("xx", "yy", "zz", "xy", "xz", "yz"), dimensions.INERTIA, 0
    MOMENTUM = "momentum_{}", _XYZ, dimensions.SPEED.times(dimensions.MASS), 1
    MASS = "total_mass", _ONE, dimensions.MASS, None
    # of a force element: along its path, and on the body of a marker
    FORCE = "force", _ONE, None, 0
    LENGTH = "length", _ONE, None, 0
    RATE = "rate", _ONE, None, 1
    POWER = "power", _ONE, dimensions.ENERGY.times(dimensions.TIME, -1), 0
    STATE_RATE = "rate of state {}", (), None, 0
    EXERTED = "force.{}", WRENCH_PARTS, None, 0
    # of a joint, and of an equation of a constraint
    REACTION = "reaction.{}", REACTION_PARTS, None, 0
    MULTIPLIER = "multiplier", _ONE, None, 0

    def __init__(self, word: str, parts: tuple[str, ...], dimension: Dimension | None, order: int | None) -> None:
        self.word, self.parts, self.dimension, self.order = word, parts, dimension, order


M = Measure
TURNING = (M.SPIN, M.SPIN_BODY, M.SPIN_RATE, M.SPIN_BODY_RATE)
ANGLES = (M.ANGLE, M.ANGLE_RATE)
SUMS = (M.ANGULAR_MOMENTUM, M.INERTIA, M.MOMENTUM, M.MASS)  #: over all bodies
REACTIONS = (M.REACTION, M.MULTIPLIER)
#: Motion of a marker: word -> what it measures, and the part.
QUANTITIES: dict[str, tuple[Measure, str]] = {
    measure.word.format(part): (measure, part)
    for measure in (M.POSITION, M.VELOCITY, M.ACCELERATION, *ANGLES, M.DISTANCE, M.DISTANCE_RATE, *TURNING, *SUMS[:2])
    for part in measure.parts
}
#: Sums over all bodies that need no marker, in outputs; a name of the model's own comes first.
TOTALS = {measure.word.format(part): (measure, part) for measure in SUMS[2:] for part in measure.parts}
#: Quantities between two markers.
PAIRS = ("angle", "angle_rate", "distance", "distance_rate")
#: Those of which the first may be left out: it is the ground then.
ONE_OR_TWO = ("angle", "angle_rate")
#: Quantities that can be seen from another marker, and resolved in the axes of another.
_RESOLVED = (M.POSITION, M.VELOCITY, M.ACCELERATION, M.SPIN, M.SPIN_RATE)
RESOLVED = tuple(name for name, (measure, _) in QUANTITIES.items() if measure in _RESOLVED)
#: Quantities of a force element: generalized force along its path, the path's length or angle and its rate, power.
OF_ELEMENTS = {measure.word: measure for measure in (M.FORCE, M.LENGTH, M.RATE, M.POWER)}
REACTION, MULTIPLIER, WRENCH = "reaction", "multiplier", "force"
#: The word that stands for the centre of mass of all bodies where a marker is asked for, unless a body bears it.
COM = "com"
#: Names that begin a quantity.
HEADS = frozenset((*QUANTITIES, *OF_ELEMENTS, REACTION, MULTIPLIER))

_LABEL = r"[A-Za-z]\w*(?:\.\w+)*"
_ARGUMENT = rf"\s*(?:(?:from|in|on)\s*=\s*)?{_LABEL}\s*"
#: A quantity of named markers and elements within a text.
IN_TEXT = rf"\b(?:{'|'.join(sorted(HEADS, key=len, reverse=True))})\({_ARGUMENT}(?:,{_ARGUMENT})*\)(?:\.[a-z]+\b)?"
_CALL = re.compile(rf"({'|'.join(HEADS)})\((.+)\)(?:\.(\w+))?\Z", re.DOTALL)
_KEYWORD = re.compile(r"(from|in|on)\s*=\s*", re.ASCII)


# -- of the markers and elements of a mechanism ------------------------------------------------------------------------
class Quantity(Record):
    """What a symbol of an expression measures.

    ``marker`` is the one that moves, or on whose body an element acts; None stands for the centre of mass of all
    bodies.  ``origin`` is the marker that the motion is seen from and ``axes`` the marker whose axes count, None for
    those of ground.
    """

    measure: Measure
    part: str = ""
    marker: Marker | None = None
    origin: Marker | None = None
    axes: Marker | None = None
    element: str = ""  #: the force element, the joint, or the equation of a constraint
    place: str = ""  #: where an expression speaks of an element first

    @property
    def dimension(self) -> Dimension | None:
        """What it is measured in; None where that depends on the element."""
        if self.measure in (Measure.EXERTED, Measure.REACTION):
            return dimensions.ENERGY if self.part.startswith("m") else dimensions.FORCE
        return self.measure.dimension

    @property
    def turns(self) -> bool:
        """Whether it is an angle or a rate of one."""
        return self.measure in (*TURNING, *ANGLES)


# -- as they are written -----------------------------------------------------------------------------------------------
class Call(NamedTuple):
    """A quantity as it is written: its word, labels in brackets, those by keyword, and what follows behind a dot."""

    name: str
    labels: Sequence[str]
    keywords: Mapping[str, str]
    part: str = ""


def call_of(text: str) -> Call | None:
    """The call in a text such as ``vx(rod.at(l, 0, 0), in=road)``; None where it is none."""
    result = _CALL.match(text)
    if result is None:
        return None
    labels, raw = list[str](), dict[str, str]()
    for part in _split(result[2]):
        key = _KEYWORD.match(part)
        if key is None:
            labels.append(part)
        else:
            raw[key[1]] = part[key.end() :]
    return Call(result[1], labels, raw, result[3] or "")


def _split(arguments: str) -> list[str]:
    """Arguments between commas; labels of unnamed markers have commas and brackets of their own."""
    parts, depth = [""], 0
    for character in arguments:
        depth += (character in "([{") - (character in ")]}")
        if character == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += character
    return [part.strip() for part in parts]


class Named(NamedTuple):
    """A quantity by the names in it.

    ``of`` is the marker that moves or the element, ``origin`` the marker it is seen from (none: the ground), ``axes``
    the marker whose axes count (none: those of ground), ``on`` the marker on whose body an element acts.
    ``distance(a, b)`` is of the marker b, from the origin a; ``multiplier(mesh.ratio)`` of an equation.
    """

    name: str
    of: str
    origin: str = ""
    axes: str = ""
    on: str = ""
    part: str = ""

    @classmethod
    def parse(cls, text: str) -> Named | None:
        """The quantity that a text is; None for other texts."""
        call = call_of(text)
        try:
            return None if call is None else cls.read(call)
        except ExpressionError:
            return None

    @classmethod
    def read(cls, call: Call) -> Named:
        """The quantity of a call; ExpressionError if it takes other arguments."""
        name, labels, raw, part = call
        if name in QUANTITIES:
            return cls._motion(name, labels, raw, part)
        element = labels[0] if len(labels) == 1 else ""
        if name == MULTIPLIER:
            if not element or element.count(".") > 1 or raw or part:
                raise ExpressionError("a multiplier is that of one equation", 0, _WRITE[MULTIPLIER])
            return cls(name, element)
        if name == REACTION or (name == WRENCH and (raw or part)):
            return cls._wrench(name, element, raw, part)
        if not element or raw or part:
            raise ExpressionError(f"{name}() takes the name of one force element", 0, f"write {name}(spring_1)")
        return cls(name, element)

    @classmethod
    def _motion(cls, name: str, labels: Sequence[str], raw: Mapping[str, str], part: str) -> Named:
        pair = name in PAIRS and (name not in ONE_OR_TWO or len(labels) == 2)
        if part:
            raise ExpressionError(f"{name}() has no part {part!r}", 0, f"leave .{part} out")
        if unknown := raw.keys() - {"from", "in"}:
            raise ExpressionError(f"{name}() takes no {min(unknown)}=", 0, "from= and in= take a marker")
        if raw and (pair or name not in RESOLVED):
            remedy = f"write {name}(a, b)" if name in PAIRS else f"it is known of {', '.join(RESOLVED)}"
            raise ExpressionError(f"{name}() takes no {next(iter(raw))}=", 0, remedy)
        one, two = f"write {name}(body) or {name}(body.marker)", f"write {name}(a, b)"
        if len(labels) != (2 if pair else 1):
            if name in ONE_OR_TWO:
                raise ExpressionError(f"{name}() takes one or two markers", 0, f"write {name}(b) or {name}(a, b)")
            raise ExpressionError(f"{name}() takes {'two markers' if pair else 'one marker'}", 0, two if pair else one)
        if "" in (*labels, *raw.values()):
            raise ExpressionError(f"{name}() takes markers, not expressions", 0, one)
        return cls(name, labels[-1], labels[0] if pair else raw.get("from", ""), raw.get("in", ""))

    @classmethod
    def _wrench(cls, name: str, element: str, raw: Mapping[str, str], part: str) -> Named:
        what = "a reaction" if name == REACTION else "what an element exerts on a body"
        parts = REACTION_PARTS if name == REACTION else WRENCH_PARTS
        keywords: Collection[str] = ("in",) if name == REACTION else ("in", "on")
        if not part:
            raise ExpressionError(f"{what} has several parts", 0, _WRITE[name])
        if name == WRENCH and element and raw.keys() <= {"in"} and part in parts:
            message = f"{WRENCH}({element}).{part} does not say on which body the element acts"
            raise ExpressionError(message, 0, f"add on=marker: {WRENCH}({element}, on=marker).{part}")
        missing = name == WRENCH and "on" not in raw
        if not element or missing or "" in raw.values() or not raw.keys() <= {*keywords}:
            owner = "joint" if name == REACTION else "element"
            raise ExpressionError(f"{what} is that of one {owner}", 0, _WRITE[name])
        if part not in parts:
            raise ExpressionError(f"{what} has no part {part!r}", 0, _WRITE[name])
        if "in" in raw and part in ("size", "normal"):
            raise ExpressionError(f"the part {part} does not depend on axes", 0, "leave in= out")
        return cls(name, element, "", raw.get("in", ""), raw.get("on", ""), part)

    def __str__(self) -> str:
        seen = self.origin and self.name not in PAIRS
        parts = (("from", self.origin if seen else ""), ("on", self.on), ("in", self.axes))
        named = "".join(f", {word}={label}" if label else "" for word, label in parts)
        first = f"{self.origin}, " if self.origin and not seen else ""
        return f"{self.name}({first}{self.of}{named}){f'.{self.part}' if self.part else ''}"

    @property
    def is_motion(self) -> bool:
        """Whether it is the motion of a marker, rather than what an element does."""
        return self.name in QUANTITIES

    @property
    def is_reaction(self) -> bool:
        """Whether it is the reaction of a joint or the multiplier of an equation."""
        return self.name in (REACTION, MULTIPLIER)

    @property
    def owner(self) -> str:
        """The element, the joint, or the element or joint of an equation."""
        return self.of.partition(".")[0] if self.name == MULTIPLIER else self.of

    @property
    def markers(self) -> tuple[str, ...]:
        """All markers in it."""
        labels = (self.of if self.is_motion else "", self.origin, self.axes, self.on)
        return tuple(label for label in labels if label)

    def renamed(self, marker: Callable[[str], str], element: Callable[[str], str] | None = None) -> Named:
        """The same of other markers and elements."""
        change = marker if self.is_motion or element is None else element
        origin, axes, on = (marker(label) if label else "" for label in (self.origin, self.axes, self.on))
        return Named(self.name, change(self.of), origin, axes, on, self.part)

    @property
    def measured(self) -> tuple[Measure, str]:
        """What it measures, and the part."""
        if self.is_motion:
            return QUANTITIES[self.name]
        if self.name in OF_ELEMENTS and not self.part:
            return OF_ELEMENTS[self.name], ""
        of_joint = Measure.REACTION if self.name == REACTION else Measure.MULTIPLIER
        return of_joint if self.is_reaction else Measure.EXERTED, self.part


_WRITE = {
    REACTION: f"write {REACTION}(joint).part or {REACTION}(joint, in=marker).part; parts: {', '.join(REACTION_PARTS)}",
    WRENCH: f"write {WRENCH}(element, on=marker).part or {WRENCH}(element, on=marker, in=marker).part; parts: "
    f"{', '.join(WRENCH_PARTS)}",
    MULTIPLIER: f"write {MULTIPLIER}(mesh) or, where an element has several equations, {MULTIPLIER}(roll.height)",
}
