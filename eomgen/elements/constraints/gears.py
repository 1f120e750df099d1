"""Constraint elements: gear pairs, racks and belts, as relations between coordinates."""

from __future__ import annotations

from typing import ClassVar

from ...base.records import dataclass
from ...base.value_rules import POSITIVE
from ...expr.core import Expr, sin
from ..dimensions import LENGTH, NONE
from ..element_type import ElementType, Entry, Found, table
from ..kinds import Flag, JointPair, JointReference, Scalar, Two
from ..looks import PitchCircles, RackAndPinion, Seen
from .constraint import Condition, Constraint, ConstraintView


@dataclass(frozen=True)
class Pair(Constraint):
    """Two angles, measured from the part that carries the two axes, in a fixed ratio: a + ratio b = phase."""

    sentence: ClassVar[str] = "Two angles, measured from the part that carries both axes, keep a fixed ratio $i$."
    formula: ClassVar[str] = r"a + i b = \varphi_0"
    written: ClassVar[bool] = True
    a: Expr
    b: Expr
    ratio: Expr
    phase: Expr

    def conditions(self, view: ConstraintView) -> list[Condition]:
        return [Condition("ratio", self.a + self.ratio * self.b - self.phase, "angle")]


class Gear(Pair):
    """Two gears that roll on each other's pitch circles.

    ratio = r_b / r_a outside and -r_b / r_a where one gear is internal (Shabana, Computational Dynamics, sec. 3.2;
    Norton, Design of Machinery, eq. 9.1).
    """

    type_name: ClassVar[str] = "gear"

    def drawn(self) -> list[Seen]:
        return [PitchCircles(self.a, self.b, self.ratio)]


@dataclass(frozen=True)
class Belt(Pair):
    """A belt or chain that does not stretch or slip on two pulleys: r_a a = r_b b, with b reversed where it crosses.

    (Norton, Design of Machinery, sec. 9.11.)
    """

    type_name: ClassVar[str] = "belt"
    radius: Expr | None = None  #: of the first pulley, for its picture; None where teeth are given

    def drawn(self) -> list[Seen]:
        return [PitchCircles(self.a, self.b, self.ratio, belt=True, radius=self.radius)]


@dataclass(frozen=True)
class Rack(Constraint):
    """A pinion that rolls on a rack: s = r a + offset (Norton, Design of Machinery, sec. 9.3)."""

    sentence = "A pinion of radius $r$ rolls on a rack."
    formula = r"s = r a + s_0"
    type_name = "rack"
    written = True
    pinion: Expr
    rack: Expr
    radius: Expr
    offset: Expr

    def drawn(self) -> list[Seen]:
        return [RackAndPinion(self.pinion, self.rack, self.radius)]

    def conditions(self, view: ConstraintView) -> list[Condition]:
        return [Condition("travel", self.rack - self.radius * self.pinion - self.offset, "length")]


def _ratio(e: Entry) -> Expr | None:
    """Second size over the first, by radii, teeth or sines of cone angles."""
    key = next((key for key in ("radii", "teeth", "cones") if key in e.values), "radii")
    sizes = e[key]
    for k, size in enumerate(sizes or ()):
        e.require(f"{key}[{k}]", size, POSITIVE, "give a size greater than 0")
    if sizes is None or e.at_fault(key):
        return None
    a, b = (sin(x) for x in sizes) if key == "cones" else sizes
    return b / a


def _angles(e: Entry) -> tuple[Found, Found] | None:
    """Two angles whose axes are carried by one part."""
    pair: tuple[Found, Found] | None = e["joints"]
    if pair is not None:
        e.require_one_carrier("joints", *pair)
    return pair


def _gear(e: Entry) -> Gear | None:
    pair, ratio = _angles(e), _ratio(e)
    if pair is None or ratio is None:
        return None
    ratio = -ratio if e["internal"] else ratio
    return Gear(e.name, e.symbol(pair[0]), e.symbol(pair[1]), ratio, e["phase"])


def _belt(e: Entry) -> Belt | None:
    pair, ratio = _angles(e), _ratio(e)
    if pair is None or ratio is None:
        return None
    ratio = ratio if e["crossed"] else -ratio
    radii = e["radii"]
    return Belt(e.name, e.symbol(pair[0]), e.symbol(pair[1]), ratio, e["phase"], radii[0] if radii else None)


def _rack(e: Entry) -> Rack | None:
    pinion, travel = e["pinion"], e["rack"]
    if pinion is None or travel is None:
        return None
    e.require_one_carrier("", pinion, travel)
    return Rack(e.name, e.symbol(pinion), e.symbol(travel), e["radius"], e["offset"])


_JOINTS = JointPair(
    "two joints of one degree, or coordinates, whose axes are carried by the same part", required=True, measure="angle"
)
_RADII = Two("base or pitch circle radii (m), in the order of the joints", dimension=LENGTH)
_TEETH = Two("numbers of teeth", dimension=NONE)
_PHASE = Scalar("first angle at which the second angle is 0 (rad)", default=0, dimension=NONE)
_JOINT = JointReference("a joint of one degree, or a coordinate", required=True)

TYPES = table(
    ElementType(
        "gear",
        "two gears that mesh: r_a a + r_b b = r_a phase, or r_a a - r_b b = r_a phase if one is internal.",
        {
            "joints": _JOINTS,
            "radii": _RADII,
            "teeth": _TEETH,
            "cones": Two(
                "pitch cone angles of a bevel pair (rad); both z axes point away from their intersection, or both to "
                "it",
                dimension=NONE,
            ),
            "internal": Flag("whether one gear is internal, so that both turn the same way", default=False),
            "phase": _PHASE,
        },
        _gear,
        one_of=("radii", "teeth", "cones"),
    ),
    ElementType(
        "rack",
        "a pinion that rolls on a rack: s = radius angle + offset (m).",
        {
            "pinion": _JOINT.replace(doc="joint of the pinion", measure="angle"),
            "rack": _JOINT.replace(doc="joint of the rack", measure="length"),
            "radius": Scalar("radius (m); negative if the rack moves the other way", required=True, dimension=LENGTH),
            "offset": Scalar("travel of the rack at which the pinion's angle is 0 (m)", default=0, dimension=LENGTH),
        },
        _rack,
    ),
    ElementType(
        "belt",
        "a belt without slip on two pulleys: r_a (a - phase) = r_b b, or -r_b b if the belt crosses.",
        {
            "joints": _JOINTS,
            "radii": _RADII,
            "teeth": _TEETH,
            "crossed": Flag("whether the belt crosses, so that the pulleys turn in opposite directions", default=False),
            "phase": _PHASE,
        },
        _belt,
        one_of=("radii", "teeth"),
    ),
)
