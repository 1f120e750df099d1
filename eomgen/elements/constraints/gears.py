"""Constraint elements: gear pairs, racks, belts and planetary sets, as relations between coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from ...base.value_rules import POSITIVE
from ...base.value_rules import WHEELS as WHEELS_FIT
from ...expr.core import Expr, sin
from ..dimensions import LENGTH, NONE
from ..element_type import ElementType, Entry, Found, Where, element, key
from ..glyphs import Glyph, PitchCircles, RackAndPinion
from ..kinds import Fields, Flag, JointPair, JointReference, Scalar, Two, Wheels
from .constraint import Condition, Constraint, ConstraintView, switchable


class Pair(Constraint):
    """Two angles, measured from the part that carries the two axes, in a fixed ratio: a + ratio b = phase."""

    sentence: ClassVar[str] = "Two angles, measured from the part that carries both axes, keep a fixed ratio $i$."
    formula: ClassVar[str] = r"a + i b = \varphi_0"
    written: ClassVar[bool] = True
    a: Expr
    b: Expr
    ratio: Expr
    phase: Expr = key(Scalar("first angle at which the second angle is 0 (rad)", default=0, dimension=NONE))

    def conditions(self, view: ConstraintView) -> list[Condition]:
        return [Condition("ratio", self.a + self.ratio * self.b - self.phase, "angle")]


class Gear(Pair):
    """Two gears that roll on each other's pitch circles.

    ratio = r_b / r_a outside and -r_b / r_a where one gear is internal (Shabana, Computational Dynamics, sec. 3.2;
    Norton, Design of Machinery, eq. 9.1).
    """

    def glyphs(self) -> list[Glyph]:
        return [PitchCircles(self.a, self.b, self.ratio)]


class Belt(Pair):
    """A belt or chain that does not stretch or slip on two pulleys: r_a a = r_b b, with b reversed where it crosses.

    (Norton, Design of Machinery, sec. 9.11.)
    """

    radius: Expr | None = None  #: of the first pulley, for its picture; None where teeth are given

    def glyphs(self) -> list[Glyph]:
        return [PitchCircles(self.a, self.b, self.ratio, belt=True, radius=self.radius)]


class Rack(Constraint):
    """A pinion that rolls on a rack: s = r a + offset (Norton, Design of Machinery, sec. 9.3)."""

    sentence = "A pinion of radius $r$ rolls on a rack."
    formula = r"s = r a + s_0"
    written = True
    pinion: Expr = key(JointReference("joint of the pinion", required=True, measure="angle"))
    rack: Expr = key(JointReference("joint of the rack", required=True, measure="length"))
    radius: Expr = key(Scalar("radius (m); negative if the rack moves the other way", required=True, dimension=LENGTH))
    offset: Expr = key(Scalar("travel of the rack at which the pinion's angle is 0 (m)", default=0, dimension=LENGTH))

    def glyphs(self) -> list[Glyph]:
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


def _wheels(e: Entry) -> tuple[Expr, Expr, Expr] | None:
    """Two angles whose axes one part carries, and the ratio, negative where both turn the same way."""
    pair: tuple[Found, Found] | None = e["joints"]
    if pair is not None:
        e.require_one_carrier("joints", *pair)
    ratio, opposite = _ratio(e), e["crossed"] if "crossed" in e.fields else not e["internal"]
    if pair is None or ratio is None:
        return None
    return e.symbol(pair[0]), e.symbol(pair[1]), ratio if opposite else -ratio


def _check_carrier(e: Entry, values: dict[str, Any]) -> None:
    if values["pinion"] is not None and values["rack"] is not None:
        e.require_one_carrier("", values["pinion"], values["rack"])


_SIZES: Fields = {
    "joints": JointPair(
        "two joints of one degree, or coordinates, with the same predecessor", required=True, measure="angle"
    ),
    "radii": Two("base or pitch circle radii (m), in the order of the joints", dimension=LENGTH),
    "teeth": Two("numbers of teeth", dimension=NONE),
}
_CONES = Two(
    "pitch cone angles of a bevel pair (rad); both z axes point away from their intersection, or both to it",
    dimension=NONE,
)
_INTERNAL = Flag("whether one gear is internal, so that both turn the same way", default=False)
_CROSSED = Flag("whether the belt crosses, so that the pulleys turn in opposite directions", default=False)

TYPES = switchable(
    element(
        Gear,
        "gear",
        "two gears that mesh: r_a a + r_b b = r_a phase, or r_a a - r_b b = r_a phase if one is internal.",
        Where({**_SIZES, "cones": _CONES, "internal": _INTERNAL}, _wheels, one_of=("radii", "teeth", "cones")),
    ),
    element(Rack, "rack", "a pinion that rolls on a rack: s = radius angle + offset (m).", check=_check_carrier),
    element(
        Belt,
        "belt",
        "a belt without slip on two pulleys: r_a (a - phase) = r_b b, or -r_b b if the belt crosses.",
        Where({**_SIZES, "crossed": _CROSSED}, _wheels, one_of=("radii", "teeth")),
        check=lambda e, values: values.update(radius=(e["radii"] or [None])[0]),
    ),
)


# -- planetary sets ----------------------------------------------------------------------------------------------------


class Planetary(Constraint):
    """A planetary set; angles of sun, ring and carrier from the frame, that of the planet from the carrier.

    Sun and planet mesh outside, ring and planet inside (Willis; Norton, Design of Machinery, sec. 9.9):

        r_s / r_p (sun - carrier) + planet = phase,    r_r / r_p (ring - carrier) - planet = 0,

    and, without the planet, (r_s sun + r_r ring) / (r_s + r_r) = carrier + phase.  A wheel that is fixed to the frame
    has the angle 0; one whose radius is None is not there.
    """

    sentence = "The angles of sun, ring and carrier of a planetary set with the radii $r_s$ and $r_r$."
    formula = r"\frac{r_s \varphi_s + r_r \varphi_r}{r_s + r_r} = \varphi_c"
    written = True
    sun: Expr
    ring: Expr
    carrier: Expr
    planet: Expr | None  #: angle from the carrier; None if the planets are not bodies of the model
    sun_radius: Expr | None
    ring_radius: Expr | None
    planet_radius: Expr | None
    phase: Expr

    def glyphs(self) -> list[Glyph]:
        (r_s, r_r, r_p), result = self._radii(), list[Glyph]()
        if self.planet is None or r_p is None:
            return []
        if r_s is not None:
            result.append(PitchCircles(self.sun, self.planet, r_p / r_s, self.carrier))
        if r_r is not None:
            result.append(PitchCircles(self.ring, self.planet, -(r_p / r_r), self.carrier))
        return result

    def _radii(self) -> tuple[Expr | None, Expr | None, Expr | None]:
        """Of sun, ring and planet, as far as they are known."""
        r_s, r_r, r_p = self.sun_radius, self.ring_radius, self.planet_radius
        if r_p is None and r_s is not None and r_r is not None:
            r_p = 0.5 * (r_r - r_s)
        return r_s, r_r, r_p

    def conditions(self, view: ConstraintView) -> list[Condition]:
        (r_s, r_r, r_p), rows = self._radii(), list[Condition]()
        if self.planet is None:
            if r_s is not None and r_r is not None:
                mean = (r_s * self.sun + r_r * self.ring) / (r_s + r_r)
                rows.append(Condition("ratio", mean - self.carrier - self.phase, "angle"))
            return rows
        if r_p is not None and r_s is not None:
            sun = r_s / r_p * (self.sun - self.carrier) + self.planet
            rows.append(Condition("sun_mesh", sun - self.phase, "angle"))
        if r_p is not None and r_r is not None:
            ring = r_r / r_p * (self.ring - self.carrier) - self.planet
            rows.append(Condition("ring_mesh", ring, "angle"))
        return rows


def _planetary(e: Entry) -> Planetary | None:
    """Angles are measured from the frame; the planet's from the frame or the carrier."""
    key = "radii" if "radii" in e.values else "teeth"
    sizes = e[key]
    result = {part: e[part] for part in ("sun", "ring", "carrier", "planet") if part in e.values}
    if sizes is not None:
        e.judge(key, WHEELS_FIT, [*sizes.values()], ([*sizes],))
    if any(x is None for x in result.values()) or sizes is None or e.at_fault():
        return None
    parts: dict[str, Found] = {part: x for part, x in result.items() if x is not None}
    for part in ("sun", "ring"):
        if part in parts and part not in sizes:
            e.fault(key, f"the {part} has a joint but no size", f"give {key} of the {part}", "EG-MISSING")
    main = [parts[part] for part in ("sun", "ring", "carrier") if part in parts]
    for other in main[1:]:
        e.require_one_carrier("", main[0], other)
    outer = {"sun", "ring"} & sizes.keys()
    if not outer or ("planet" not in parts and len(outer) < 2):
        e.fault(key, "these wheels do not determine a ratio", "give sun and ring, or planet and one more", "EG-MISSING")
    if "planet" in parts and len(sizes) < 2:
        e.fault(key, "one size does not determine a ratio", f"give two of {', '.join(Wheels.names)}", "EG-MISSING")
    if len(parts) < (2 if "planet" in parts else 1) or not main:
        remedy = "give joints for more of sun, ring, carrier, planet"
        e.fault("", "too few parts of the set can move", remedy, "EG-MISSING")
    if e.at_fault():
        return None
    sun, ring, carrier = (e.symbol(parts[p]) if p in parts else e.graph.zero for p in ("sun", "ring", "carrier"))
    r_s, r_r, r_p = (sizes.get(wheel) for wheel in ("sun", "ring", "planet"))
    return Planetary(e.name, sun, ring, carrier, _planet(e, parts, carrier), r_s, r_r, r_p, e["phase"])


def _planet(e: Entry, parts: Mapping[str, Found], carrier: Expr) -> Expr | None:
    """The planet's angle from the carrier."""
    if "planet" not in parts:
        return None
    planet, base = e.symbol(parts["planet"]), e.carrier(parts["planet"])
    if base is None or "carrier" not in parts or base == e.carrier(parts["carrier"], "successor"):
        return planet
    if base == e.carrier(parts["carrier"]):
        return planet - carrier
    message = f"{parts['planet'].name!r} is measured neither from the carrier nor from the frame"
    e.fault("planet", message, "make the carrier or the frame the predecessor of the planet's joint", "EG-REFERENCE")
    return None


_FIXED = "joint that turns the {0} relative to the frame; fixed if left out"

TYPES |= switchable(
    ElementType(
        "planetary",
        "a planetary gear set: its meshing wheels follow Willis' equation.",
        {
            **{part: JointReference(_FIXED.format(part), measure="angle") for part in ("sun", "ring", "carrier")},
            "planet": JointReference(
                "joint of a planet on the carrier or on the frame, needed only if a planet is a body", measure="angle"
            ),
            "radii": Wheels("radii of the wheels that exist: sun, planet, ring (m)", dimension=LENGTH),
            "teeth": Wheels("numbers of teeth of the wheels that exist: sun, planet, ring", dimension=NONE),
            "phase": Scalar(
                "phase in (r_s sun + r_r ring) / (r_s + r_r) = carrier + phase (rad); with a planet, that of its mesh "
                "with the sun",
                default=0,
                dimension=NONE,
            ),
        },
        _planetary,
        one_of=("radii", "teeth"),
    )
)
