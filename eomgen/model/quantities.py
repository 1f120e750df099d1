"""Quantities by name: ``vx(hub, in=road)``, ``force(k1)``, ``reaction(A).x``, ``multiplier(mesh)`` <-> their parts.

One class reads all of them, from a text or from the parts of a call, writes them in one way, changes their names and
knows their dimensions.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import NamedTuple

from ..elements import dimensions
from ..elements.dimensions import Dimension
from ..elements.frames import Marker
from ..errors import ExpressionError
from ..expr.records import Record

ANGULAR_MOMENTUM, INERTIA, MOMENTUM, MASS = 3, 4, 5, 6  #: levels of a Quantity that are sums over all bodies
SUMS = (ANGULAR_MOMENTUM, INERTIA, MOMENTUM, MASS)
TURNING = (7, 8, 9, 10)  #: angular velocity in ground axes and in the marker's own, then their rates
#: Level of a quantity -> its dimension, save for angles (axis 3).
LEVEL_DIMENSIONS = (
    *(dimensions.LENGTH, dimensions.SPEED, dimensions.ACCELERATION),
    *(dimensions.INERTIA.times(dimensions.TIME, -1), dimensions.INERTIA),
    *(dimensions.SPEED.times(dimensions.MASS), dimensions.MASS),
    *(dimensions.SPIN, dimensions.SPIN, dimensions.SPIN_RATE, dimensions.SPIN_RATE),
)
#: Motion of a marker in ground axes: name -> (level 0 position, 1 velocity, 2 acceleration; axis).
QUANTITIES: dict[str, tuple[int, int]] = {
    prefix + axis: (level, k) for level, prefix in enumerate(("", "v", "a")) for k, axis in enumerate("xyz")
}
QUANTITIES |= {"angle": (0, 3), "angle_rate": (1, 3)}  # turn about the z axis of another marker, or of ground
QUANTITIES |= {"distance": (0, 4), "distance_rate": (1, 4)}
# angular velocity and acceleration of the marker's body, in ground axes and in the marker's own
QUANTITIES |= {
    f"w{axis}{suffix}": (level, k)
    for level, suffix in zip((7, 8, 9, 10), ("", "_body", "_dot", "_body_dot"), strict=True)
    for k, axis in enumerate("xyz")
}
# sums over all bodies about the marker's origin, ground axes: angular momentum, inertia (levels above)
QUANTITIES |= {f"angular_momentum_{axis}": (3, k) for k, axis in enumerate("xyz")}
QUANTITIES |= {f"inertia_{entry}": (4, k) for k, entry in enumerate(("xx", "yy", "zz", "xy", "xz", "yz"))}
#: Quantities between two markers.
PAIRS = ("angle", "angle_rate", "distance", "distance_rate")
#: Quantities that can be seen from another marker, and resolved in the axes of another.
RESOLVED = tuple(name for name, (level, axis) in QUANTITIES.items() if axis < 3 and level in (0, 1, 2, 7, 9))
#: Quantities of a force element: generalized force along its path, the path's length or angle and its rate, power.
OF_ELEMENTS = ("force", "length", "rate", "power")
#: Quantities of a joint and of an equation of a constraint: what it carries.
REACTION, MULTIPLIER = "reaction", "multiplier"
#: Parts of a reaction: force and moment, size of the force, size of its part across the axis of the joint.
REACTION_PARTS = ("x", "y", "z", "mx", "my", "mz", "size", "normal")
#: What a force element exerts on the body of a marker, ``force(track, on=wheel).x``, and its parts.
WRENCH, WRENCH_PARTS = "force", ("x", "y", "z", "mx", "my", "mz", "size")
#: Levels of what is linear in velocities.
VELOCITIES = (1, 3, 5, 7, 8)
#: Levels of what only the accelerations tell.
ACCELERATIONS = (2, 9, 10)
#: Sums over all bodies that need no marker, in outputs; a name of the model's own comes first.
TOTALS: dict[str, tuple[int, int]] = {f"momentum_{axis}": (5, k) for k, axis in enumerate("xyz")} | {
    "total_mass": (6, 0)
}
#: The word that stands for the centre of mass of all bodies where a marker is asked for, unless a body bears it.
COM = "com"
#: Quantities of two markers, of which the first may be left out: it is the ground then.
ONE_OR_TWO = ("angle", "angle_rate")
#: Words that begin a quantity.
WORDS = frozenset((*QUANTITIES, *OF_ELEMENTS, REACTION, MULTIPLIER))

_LABEL = r"[A-Za-z]\w*(?:\.\w+)*"
_ARGUMENT = rf"\s*(?:(?:from|in|on)\s*=\s*)?{_LABEL}\s*"
#: A quantity of named markers and elements within a text.
IN_TEXT = rf"\b(?:{'|'.join(sorted(WORDS, key=len, reverse=True))})\({_ARGUMENT}(?:,{_ARGUMENT})*\)(?:\.[a-z]+\b)?"
_CALL = re.compile(rf"({'|'.join(WORDS)})\((.+)\)(?:\.(\w+))?\Z", re.DOTALL)
_KEYWORD = re.compile(r"(from|in|on)\s*=\s*", re.ASCII)


def dimension_of(level: int, axis: int) -> Dimension:
    """The dimension of a quantity."""
    if axis == 3 and level < 2:
        return dimensions.SPIN if level else dimensions.NONE
    return LEVEL_DIMENSIONS[level]


# -- of the markers of a mechanism -----------------------------------------------------------------------------
class Quantity(Record):
    """Motion of a marker: ``level`` 0 position, 1 velocity, 2 acceleration; ``axis`` 0, 1, 2, or 3 for its angle about
    the z axis of the origin, 4 for its distance from the origin.

    ``origin`` is the marker that it is seen from and ``axes`` the marker whose axes count; None stands for ground.

    Levels of :data:`TURNING` are the angular velocity and acceleration of the marker's body.

    Sums over all bodies: ``level`` :data:`ANGULAR_MOMENTUM` or :data:`INERTIA` (``axis`` 0 to 5: xx yy zz xy xz yz)
    about the marker's origin, :data:`MOMENTUM` and :data:`MASS` without a marker.  The marker None stands for the
    centre of mass of all bodies.
    """

    marker: Marker | None
    level: int
    axis: int
    origin: Marker | None = None
    axes: Marker | None = None

    @property
    def dimension(self) -> Dimension:
        """What it is measured in."""
        return dimension_of(self.level, self.axis)

    @property
    def turns(self) -> bool:
        """Whether it is an angle or a rate of one."""
        return self.level in TURNING or (self.level < 2 and self.axis == 3)

    @property
    def order(self) -> int | None:
        """How many times the place is differentiated in it: 0, 1 or 2; None of the mass, which does not move."""
        if self.level == MASS:
            return None
        return 2 if self.level in ACCELERATIONS else 1 if self.level in VELOCITIES else 0


class WrenchQuantity(NamedTuple):
    """A part of what a force element exerts on the body of a marker, along the axes of a marker (None: ground)."""

    element: str
    part: str
    on: Marker
    axes: Marker | None
    path: str  #: where an expression speaks of it first


class ReactionQuantity(NamedTuple):
    """A part of the reaction of a joint, along the axes of a marker (None: ground), or the multiplier of an equation.

    ``part`` is empty for a multiplier.
    """

    of: str
    part: str
    axes: Marker | None
    path: str  #: where an expression speaks of it first


# -- as they are written -----------------------------------------------------------------------------------------------
class Call(NamedTuple):
    """A quantity as it is written: its word, labels in brackets, those by keyword, and what follows behind a dot."""

    name: str
    labels: Sequence[str]
    given: Mapping[str, str]
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
    def level(self) -> int:
        """Of a motion: 0 position, 1 velocity, 2 acceleration, or one of the levels above; else -1."""
        return QUANTITIES[self.name][0] if self.is_motion else -1

    @property
    def dimension(self) -> Dimension | None:
        """What it is measured in; None where that depends on the element."""
        if self.is_motion:
            return dimension_of(*QUANTITIES[self.name])
        if self.part:
            return dimensions.ENERGY if self.part.startswith("m") else dimensions.FORCE
        return dimensions.ENERGY.times(dimensions.TIME, -1) if self.name == "power" else None


_WRITE = {
    REACTION: f"write {REACTION}(joint).part or {REACTION}(joint, in=marker).part; parts: {', '.join(REACTION_PARTS)}",
    WRENCH: f"write {WRENCH}(element, on=marker).part or {WRENCH}(element, on=marker, in=marker).part; parts: "
    f"{', '.join(WRENCH_PARTS)}",
    MULTIPLIER: f"write {MULTIPLIER}(mesh) or, where an element has several equations, {MULTIPLIER}(roll.height)",
}
