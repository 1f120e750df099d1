"""Force elements, laws of dry friction: a sliding velocity -> what opposes it, alone or with states of bristles."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

from ..base.limits.contacts import AT_REST
from ..base.value_rules import LIMITS, NOT_NEGATIVE, POSITIVE
from ..elements.dimensions import NONE, RATE, REACH
from ..elements.entry import Entry
from ..elements.kinds import LAW, Choice, Fields, Scalar
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.vectors import Vec3
from ..records import dataclass
from .bristles import LuGre
from .dry_friction import LineFriction, Slip, stribeck_level

BRISTLES = "lugre"  #: the law that has states
#: Laws of dry friction.
FRICTION_LAWS = ("coulomb", "brown_mcphee", BRISTLES)


class SlidingFriction(LineFriction):
    """Friction that follows from the sliding velocity alone."""

    @abstractmethod
    def per_velocity(self, squared: Expr) -> Expr:
        """What times the velocity in a plane is the friction, of the velocity's square; smooth at rest."""

    def in_plane(self, slip: Slip) -> Vec3:
        return vec.scale(self.per_velocity(vec.dot(slip.velocity, slip.velocity)), slip.velocity)


@dataclass(frozen=True)
class Friction(SlidingFriction):
    """Coulomb and Stribeck friction; what multiplies the direction of sliding, opposed to it.

    ``dynamic``, ``static`` and ``viscous`` are forces for a joint and parts of the normal force for a contact.

        c(v) = dynamic + (static - dynamic) exp(-(v / stribeck)^2)

    after Armstrong-Helouvry, Dupont and Canudas de Wit (1994), Automatica 30, 1083-1138, section 2.  ``static`` None
    means dynamic.  At rest friction is 0: a body on a slope creeps, at a part of the velocity ``smoothing``.
    """

    formula: ClassVar[str] = r"F_t = -F_n (\frac{c(v)}{\sqrt{v^2 + v_s^2}} + b) v"
    joint_formula: ClassVar[str] = r"F = -c(v) \mathrm{tanh}(v/v_s) - b v"
    dynamic: Expr
    smoothing: Expr
    viscous: Expr
    static: Expr | None = None
    stribeck: Expr | None = None

    def level(self, squared: Expr) -> Expr:
        """c of the squared sliding velocity."""
        return stribeck_level(squared, self.dynamic, self.static, self.stribeck)

    def along(self, rate: Expr) -> Expr:
        """c tanh(v / smoothing) + viscous v of a velocity along a line."""
        direction = rate.graph.apply("tanh", rate / self.smoothing)
        return self.level(rate * rate) * direction + self.viscous * rate

    def per_velocity(self, squared: Expr) -> Expr:
        """c / sqrt(v^2 + smoothing^2) + viscous: times the velocity in a plane it is the friction; smooth at rest."""
        size = squared.graph.apply("sqrt", squared + self.smoothing * self.smoothing)
        return self.level(squared) / size + self.viscous

    def mapped(self, own: Callable[[Expr], Expr]) -> Friction:
        static, stribeck = (None if x is None else own(x) for x in (self.static, self.stribeck))
        return Friction(own(self.dynamic), own(self.smoothing), own(self.viscous), static, stribeck)


@dataclass(frozen=True)
class BrownMcPhee(SlidingFriction):
    """Friction of continuous derivatives whose largest value is the static friction, close to v = transition.

        c(v) = dynamic tanh(4 x) + (static - dynamic) x / (x^2 / 4 + 3/4)^2 + viscous v,  x = v / transition

    after Brown and McPhee (2016), J. Comput. Nonlinear Dynam. 11, 054502, equation 5.
    """

    _CURVE: ClassVar[str] = (
        r"c_d \mathrm{tanh}(4 \frac{v}{v_t}) + (c_s - c_d) \frac{v/v_t}{(\frac{1}{4} (v/v_t)^2 + \frac{3}{4})^2} + b v"
    )
    formula: ClassVar[str] = rf"F_t = -F_n ({_CURVE})"
    joint_formula: ClassVar[str] = rf"F = -({_CURVE})"
    dynamic: Expr
    static: Expr
    transition: Expr
    viscous: Expr

    def along(self, rate: Expr) -> Expr:
        x = rate / self.transition
        return self.dynamic * x.graph.apply("tanh", 4.0 * x) + self._rise(x * x) * x + self.viscous * rate

    def per_velocity(self, squared: Expr) -> Expr:
        """By the velocity sqrt(v^2 + (AT_REST transition)^2) in tanh(4 x) / v, which is finite at rest then."""
        graph, small = squared.graph, AT_REST * self.transition
        speed = graph.apply("sqrt", squared + small * small)
        slope = graph.apply("tanh", 4.0 * speed / self.transition) / speed
        return (
            self.dynamic * slope
            + self._rise(squared / (self.transition * self.transition)) / self.transition
            + (self.viscous)
        )

    def _rise(self, square: Expr) -> Expr:
        base = 0.25 * square + 0.75
        return (self.static - self.dynamic) / (base * base)

    def mapped(self, own: Callable[[Expr], Expr]) -> BrownMcPhee:
        return BrownMcPhee(own(self.dynamic), own(self.static), own(self.transition), own(self.viscous))


def has_bristles(values: Mapping[str, Any]) -> bool:
    """Whether an entry's law of friction has states."""
    law = values.get("friction_law")
    return isinstance(law, str) and law == BRISTLES


#: Of contacts, as parts of the normal force.
FRICTION: Fields = {
    "friction": Scalar("coefficient of sliding friction", level=LAW, dimension=NONE),
    "static_friction": Scalar(
        "coefficient of static friction, at the onset of sliding; give stribeck too",
        level=LAW,
        dimension=NONE,
    ),
    "stribeck": Scalar(
        "Stribeck velocity (m/s): the sliding velocity at which static friction has largely dropped to "
        "sliding friction",
        dimension=RATE,
    ),
    "viscous_friction": Scalar(
        "viscous friction coefficient per normal force and velocity (s/m)",
        default=0,
        level=LAW,
        dimension=NONE.times(RATE, -1),
    ),
    "smoothing": Scalar("sliding velocity (m/s) below which friction is smoothed", dimension=RATE),
}
#: Which law it is, and what only some laws have; of a contact.
FRICTION_CHOICE: Fields = {
    "friction_law": Choice(
        "law of friction: coulomb, the default, smoothed and with the Stribeck effect if wanted; brown_mcphee; lugre, "
        "bristles that hold a body at rest",
        default=FRICTION_LAWS[0],
        choices=FRICTION_LAWS,
    ),
    "transition": Scalar("velocity of friction_law brown_mcphee near which friction is largest", dimension=RATE),
    "bristle_stiffness": Scalar(
        "friction of friction_law lugre per deflection of the bristles",
        dimension=NONE.times(REACH, -1),
    ),
    "bristle_damping": Scalar(
        "friction of friction_law lugre per rate of the deflection",
        dimension=NONE.times(RATE, -1),
    ),
}
_PLAIN = ("stribeck", "smoothing", "transition", "bristle_stiffness", "bristle_damping")


def read_friction(e: Entry, dynamic: str, static: str, viscous: str, alone: bool = False) -> LineFriction | None:
    """Dry friction from the keys of its parts; None without Coulomb's part, beside which viscous may stand alone."""
    if dynamic not in e.values:
        for key in (static, "friction_law", *_PLAIN, *(() if alone else (viscous,))):
            if key in e.values:
                e.fault(key, f"is given without {dynamic}", f"give {dynamic}, or leave {key} out", "EG-MISSING")
        return None
    level = e[dynamic]
    kind = e["friction_law"]
    if kind == BRISTLES:
        e.require(dynamic, level, POSITIVE, "must be greater than 0 in friction_law: lugre")
    else:
        e.require(dynamic, level, NOT_NEGATIVE, "must be 0 or greater")
    along = e[viscous]
    if along is not None and not alone:
        e.require(viscous, along, NOT_NEGATIVE, "must be 0 or greater")
    drag = e.graph.zero if along is None else along
    if kind == "brown_mcphee":
        return _brown_mcphee(e, level, drag, static)
    if kind == BRISTLES:
        return _lugre(e, level, drag, static)
    for key in _PLAIN[2:]:
        e.refuse(key, f"has no meaning in friction_law: {kind}")
    if "smoothing" not in e.values:
        e.missing("smoothing", "give the velocity (greater than 0) below which friction is smoothed")
        return None
    pair = _onset(e, level, static)
    return None if pair is None else Friction(level, e.positive("smoothing"), drag, *pair)


def _onset(e: Entry, level: Expr, static: str) -> tuple[Expr | None, Expr | None] | None:
    """Static friction and Stribeck velocity, or neither; None where only one is given, which is noted."""
    if (static in e.values) != ("stribeck" in e.values):
        missing = "stribeck" if static in e.values else static
        e.missing(missing, f"give {static} and stribeck together, or neither")
        return None
    onset = e[static]
    if onset is not None:
        _require_greater(e, level, onset, static)
    return onset, e.positive("stribeck") if "stribeck" in e.values else None


def _require_greater(e: Entry, level: Expr, onset: Expr, static: str) -> None:
    """Require static friction that is not below sliding friction, which is itself not below 0."""
    told = "is {1:g}, below sliding friction {0:g}", "static is the greater"
    e.judge(static, LIMITS, [level, onset], told)


def _brown_mcphee(e: Entry, level: Expr, viscous: Expr, static: str) -> BrownMcPhee | None:
    for key in ("stribeck", "smoothing", *_PLAIN[3:]):
        e.refuse(key, "has no meaning in friction_law: brown_mcphee, which has transition")
    if "transition" not in e.values:
        e.missing("transition", "give the velocity (greater than 0) near which friction is largest")
        return None
    onset = e[static]
    if onset is None:
        onset = level
    _require_greater(e, level, onset, static)
    return BrownMcPhee(level, onset, e.positive("transition"), viscous)


def _lugre(e: Entry, level: Expr, viscous: Expr, static: str) -> LuGre | None:
    for key in ("smoothing", "transition"):
        e.refuse(key, "has no meaning in friction_law: lugre")
    for key in _PLAIN[3:]:
        if key not in e.values:
            e.missing(key, "friction_law: lugre needs bristle_stiffness and bristle_damping")
    pair = _onset(e, level, static)
    if pair is None or e.at_fault():
        return None
    return LuGre(level, e.positive("bristle_stiffness"), e.positive("bristle_damping"), viscous, *pair, e.states())
