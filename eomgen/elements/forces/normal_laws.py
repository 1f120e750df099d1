"""Force elements, laws of a one-sided stop: penetration and its rate -> a force that never pulls; stops of joints."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar

from ...base.value_rules import NOT_NEGATIVE, POSITIVE, Allowed
from ...expr.core import Expr, sqrt
from ...expr.records import dataclass
from ..dimensions import DAMPING, FORCE, LENGTH, NONE, PUSH, RATE, REACH
from ..element_type import ElementType, Entry, table
from ..kinds import EXPONENT, LINEAR, Choice, Fields, Radii, Scalar
from ..looks import STOP, Seen
from .force import Load, View, beyond_zero, map_law, where
from .paths import ON_JOINT, PathForce, read_coordinate

_PRESSURE = FORCE.times(LENGTH, -2)

#: Laws of the force along the normal.
NORMAL_LAWS = ("hunt_crossley", "hertz", LINEAR)
RIGID = "rigid"  #: contact without penetration, of groups of shapes only

#: Names of the formulas for the dissipation from a coefficient of restitution; see :func:`dissipation_of`.
RESTITUTIONS = ("hunt_crossley", "lankarani", "flores")


def dissipation_of(restitution: Expr, velocity: Expr, formula: str) -> Expr:
    """The factor lambda of :class:`HuntCrossley` for a coefficient of restitution e at an impact velocity v > 0.

    By ``formula`` 3 (1 - e) / (2 v), Hunt and Crossley (1975), J. Appl. Mech. 42, 440-445, for e close to 1;
    ``lankarani`` 3 (1 - e^2) / (4 v), Lankarani and Nikravesh (1990), J. Mech. Des. 112, 369-376; ``flores``
    8 (1 - e) / (5 e v), Flores, Machado, Silva and Martins (2011), Multibody Syst. Dyn. 25, 357-375, for all e > 0.
    """
    e, v = restitution, velocity
    if formula == "lankarani":
        return 3.0 * (1.0 - e * e) / (4.0 * v)
    if formula == "flores":
        return 8.0 * (1.0 - e) / (5.0 * e * v)
    return 3.0 * (1.0 - e) / (2.0 * v)


class NormalLaw(ABC):
    """The force along the normal from the penetration and its rate; ``formula`` says it in LaTeX."""

    formula: ClassVar[str] = r"F_n = k d^n (1 + \lambda \dot{d}), \quad d > 0"
    count: ClassVar[int] = 0  #: how many states it has

    @abstractmethod
    def force(self, depth: Expr, rate: Expr) -> Expr:
        """Force (N or N m) from the penetration and its rate."""

    @abstractmethod
    def elastic(self, depth: Expr) -> Expr:
        """The part of the force that has a potential."""

    @abstractmethod
    def energy(self, depth: Expr) -> Expr:
        """The potential of the elastic part (J)."""

    def mapped(self, own: Callable[[Expr], Expr]) -> NormalLaw:
        """The law with other expressions, in the graph of a pair."""
        law: NormalLaw = map_law(self, own)
        return law

    def at(self, radius: Callable[[], Expr]) -> NormalLaw:
        """The law of two surfaces of an effective radius R, 1 / R = 1 / R1 + 1 / R2."""
        return self

    def on_pad(self, area: Expr, width: Expr) -> NormalLaw:
        """The law of a point that stands for an area of a plate."""
        return self

    def holding(self, states: tuple[Expr, ...]) -> NormalLaw:
        """The law with its states."""
        return self

    def rates(self, depth: Expr, rate: Expr) -> tuple[Expr, ...]:
        """Rates of its states."""
        return ()

    def rates_apart(self) -> tuple[Expr, ...]:
        """Rates of its states where surfaces are apart."""
        return ()


@dataclass(frozen=True)
class HuntCrossley(NormalLaw):
    """k d^n max(0, 1 + lambda d') of the penetration d > 0, else 0 (Hunt and Crossley, 1975).

    With n > 1 the force and its slope are continuous at touch-down.  The force ends at 0 where the surfaces part faster
    than 1 / lambda; there it is continuous, with a kink.
    """

    stiffness: Expr
    exponent: Expr
    dissipation: Expr

    def force(self, depth: Expr, rate: Expr) -> Expr:
        gain = depth.graph.apply("max", 0.0, 1.0 + self.dissipation * rate)
        return beyond_zero(depth, lambda d: self.stiffness * d**self.exponent * gain)

    def elastic(self, depth: Expr) -> Expr:
        return beyond_zero(depth, lambda d: self.stiffness * d**self.exponent)

    def energy(self, depth: Expr) -> Expr:
        power = self.exponent + 1.0
        return beyond_zero(depth, lambda d: self.stiffness * d**power / power)


@dataclass(frozen=True)
class DampedLinear(NormalLaw):
    """max(0, k d + c d') of the penetration d > 0, else 0.

    With damping the force begins with a jump to c d'; it ends at 0 where the surfaces part faster than k d / c.
    """

    formula: ClassVar[str] = r"F_n = \mathrm{max}(0, k d + c \dot{d}), \quad d > 0"
    stiffness: Expr
    damping: Expr

    def force(self, depth: Expr, rate: Expr) -> Expr:
        pull = depth.graph.apply("max", 0.0, self.stiffness * depth + self.damping * rate)
        return beyond_zero(depth, lambda d: pull)

    def elastic(self, depth: Expr) -> Expr:
        return beyond_zero(depth, lambda d: self.stiffness * d)

    def energy(self, depth: Expr) -> Expr:
        return beyond_zero(depth, lambda d: 0.5 * self.stiffness * d * d)


@dataclass(frozen=True)
class HertzBodies(HuntCrossley):
    """Hertz's law of two elastic bodies, of an effective radius of 1 m; :meth:`at` gives that of others.

    F = (4/3) E sqrt(R) d^(3/2), with 1 / E = (1 - nu1^2) / E1 + (1 - nu2^2) / E2 and 1 / R = 1 / R1 + 1 / R2 (Johnson,
    Contact Mechanics, 1985, equations 4.22 to 4.24).
    """

    formula: ClassVar[str] = r"F_n = \frac{4}{3} E \sqrt{R} d^{3/2} (1 + \lambda \dot{d}), \quad d > 0"

    def at(self, radius: Callable[[], Expr]) -> HuntCrossley:
        return HuntCrossley(self.stiffness * sqrt(radius()), self.exponent, self.dissipation)


@dataclass(frozen=True)
class PartOfLaw(NormalLaw):
    """A part of another law, less an elastic force that another place of contact has taken over with its energy."""

    law: NormalLaw
    share: Expr
    less: Expr

    def force(self, depth: Expr, rate: Expr) -> Expr:
        return depth.graph.apply("max", 0.0, self.share * self.law.force(depth, rate) - self.less)

    def elastic(self, depth: Expr) -> Expr:
        return self.share * self.law.elastic(depth) - self.less

    def energy(self, depth: Expr) -> Expr:
        return self.share * self.law.energy(depth)


@dataclass(frozen=True)
class PartlyDamped(NormalLaw):
    """Another law with a part of its damping, of 0 to 1."""

    law: NormalLaw
    grip: Expr

    def force(self, depth: Expr, rate: Expr) -> Expr:
        elastic = self.law.elastic(depth)
        return elastic if self.grip.is_zero else elastic + self.grip * (self.law.force(depth, rate) - elastic)

    def elastic(self, depth: Expr) -> Expr:
        return self.law.elastic(depth)

    def energy(self, depth: Expr) -> Expr:
        return self.law.energy(depth)


@dataclass(frozen=True)
class UpToDepth(NormalLaw):
    """Another law up to a depth; deeper its force and its energy are no numbers, which ends a run by an error."""

    law: NormalLaw
    most: Expr

    def _known(self, depth: Expr, value: Expr) -> Expr:
        return where(depth.graph.apply("lt", self.most, depth), sqrt(self.most - depth), value)

    def force(self, depth: Expr, rate: Expr) -> Expr:
        return self._known(depth, self.law.force(depth, rate))

    def elastic(self, depth: Expr) -> Expr:
        return self._known(depth, self.law.elastic(depth))

    def energy(self, depth: Expr) -> Expr:
        return self._known(depth, self.law.energy(depth))


@dataclass(frozen=True)
class RigidLaw(NormalLaw):
    """No penetration: the force is what it takes, found by a time-stepping method; elsewhere it is none."""

    formula: ClassVar[str] = r"0 \le F_n \perp g \ge 0"

    def force(self, depth: Expr, rate: Expr) -> Expr:
        return depth.graph.zero

    def elastic(self, depth: Expr) -> Expr:
        return depth.graph.zero

    def energy(self, depth: Expr) -> Expr:
        return depth.graph.zero


NORMAL: Fields = {
    "stiffness": Scalar(
        "stiffness k (N/m**n) in the normal force k d**n max(0, 1 + dissipation d_dot), d the penetration",
        required=True,
        dimension=PUSH,
        exponent="exponent",
    ),
    "exponent": Scalar("exponent n of the penetration", default=EXPONENT, dimension=NONE),
    "dissipation": Scalar("dissipation (s/m); or give restitution and velocity", dimension=NONE.times(RATE, -1)),
    "restitution": Scalar("coefficient of restitution, from which the dissipation is computed", dimension=NONE),
    "velocity": Scalar("impact velocity (m/s) at which that restitution holds", dimension=RATE),
    "formula": Choice(
        "formula that gives the dissipation from the restitution", default=RESTITUTIONS[0], choices=RESTITUTIONS
    ),
}
#: Which law it is, and what only some laws have.
NORMAL_CHOICE: Fields = {
    "normal_law": Choice(
        "law of the normal force: hunt_crossley, the default; hertz, the same with the exponent 3/2; linear, "
        "max(0, k d + damping d_dot)",
        default=NORMAL_LAWS[0],
        choices=NORMAL_LAWS,
    ),
    "damping": Scalar("damping c (N s/m) of normal_law linear", dimension=DAMPING),
}
#: Of bodies whose radii are known, instead of the stiffness.
ELASTIC: Fields = {
    "moduli": Radii("Young's moduli of both bodies (Pa), instead of the stiffness, with poisson", dimension=_PRESSURE),
    "poisson": Radii("Poisson's ratios of both bodies, beside moduli", dimension=NONE),
}


def read_normal_law(e: Entry) -> NormalLaw:
    """The law of the keys :data:`NORMAL` and :data:`NORMAL_CHOICE`, and :data:`ELASTIC` where the type has them."""
    kind = e["normal_law"]
    if kind == LINEAR:
        return _linear(e)
    e.refuse("damping", f"belongs to normal_law: linear; of {kind} the dissipation is damping / stiffness")
    if kind == "hertz":
        e.refuse("exponent", "is 3/2 in the law of Hertz")
    if "moduli" in e.values or "poisson" in e.values:
        return _elastic(e, kind)
    _require_stiffness(e)
    stiffness, exponent = e.positive("stiffness"), e["exponent"]
    e.require("exponent", exponent, Allowed(1.0), "must be at least 1; above 1 the stiffness begins without a jump")
    return HuntCrossley(stiffness, exponent, _dissipation(e))


def _require_stiffness(e: Entry) -> None:
    """Note that the stiffness is missing, of a type that may have moduli instead."""
    if "stiffness" not in e.values and not e.fields["stiffness"].required:
        e.missing("stiffness", "give it, or moduli and poisson with normal_law: hertz")


def _linear(e: Entry) -> DampedLinear:
    _require_stiffness(e)
    for key in ("dissipation", "restitution", "velocity", "formula", "exponent", *ELASTIC):
        e.refuse(key, "has no meaning in normal_law: linear, which has stiffness and damping")
    damping = e["damping"]
    if damping is not None:
        e.require("damping", damping, NOT_NEGATIVE, "must be 0 or greater")
    return DampedLinear(e.positive("stiffness"), e.graph.zero if damping is None else damping)


def _elastic(e: Entry, kind: str) -> NormalLaw:
    e.refuse("stiffness", "follows from moduli, poisson and the radii")
    if kind != "hertz":
        key = "moduli" if "moduli" in e.values else "poisson"
        e.fault(key, f"belongs to normal_law: hertz, and this is {kind}", "give normal_law: hertz, or stiffness")
    moduli, ratios = e["moduli"], e["poisson"]
    for key in ELASTIC:
        if key not in e.values:
            e.missing(key, "give moduli and poisson together, two numbers each")
    for key, result, right, rule in (
        ("moduli", moduli, POSITIVE, "must be greater than 0"),
        ("poisson", ratios, Allowed(-1.0, 0.5, above=True), "is above -1 and at most 0.5"),
    ):
        for k, x in enumerate(result or ()):
            e.require(f"{key}[{k}]", x, right, rule)
    exponent, dissipation = e.graph.constant(EXPONENT), _dissipation(e)
    if moduli is None or ratios is None:
        return HertzBodies(e.stand_in, exponent, dissipation)
    (E1, E2), (nu1, nu2) = moduli, ratios
    modulus = 1.0 / ((1.0 - nu1 * nu1) / E1 + (1.0 - nu2 * nu2) / E2)
    return HertzBodies(4.0 / 3.0 * modulus, exponent, dissipation)


def _dissipation(e: Entry) -> Expr:
    """Given as such, or through a coefficient of restitution; none of them means none."""
    restitution, velocity = e["restitution"], e["velocity"]
    formula = e["formula"]
    if "dissipation" in e.values:
        for key in ("restitution", "velocity", "formula"):
            if key in e.values:
                e.fault(key, "dissipation is given too", "give dissipation, or restitution with velocity")
        value: Expr = e["dissipation"]
        e.require("dissipation", value, NOT_NEGATIVE, "must be 0 or greater")
        return value
    if restitution is None and velocity is None:
        if "formula" in e.values:
            remedy = "give restitution and velocity, or leave formula out"
            e.fault("formula", "is given without restitution", remedy, "EG-MISSING")
        return e.graph.zero
    if restitution is None or velocity is None:
        e.missing("velocity" if velocity is None else "restitution", "give restitution and velocity together")
        return e.stand_in
    e.require("restitution", restitution, Allowed(0.0, 1.0, above=True), "must be greater than 0 and at most 1")
    e.require("velocity", velocity, POSITIVE, "must be greater than 0")
    return dissipation_of(restitution, velocity, formula)


# -- stops of a joint --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class JointStop(PathForce):
    """Stops of a joint's coordinate q: beyond ``lower`` or ``upper`` a one-sided force pushes it back (N or N m).

    Penetrations are q - upper and lower - q.  A stop never pulls.
    """

    sentence = "Stops of a joint: beyond its limits a force from the penetration $d$ pushes the coordinate back."
    uses_value = True
    lower: Expr | None
    upper: Expr | None
    law: NormalLaw

    @property
    def laws(self) -> tuple[NormalLaw, ...]:
        return (self.law,)

    def _depths(self, value: Expr, rate: Expr) -> list[tuple[Expr, Expr, float]]:
        """Penetration, its rate and the sense of the force, of each stop."""
        result = []
        if self.lower is not None:
            result.append((self.lower - value, -rate, 1.0))
        if self.upper is not None:
            result.append((value - self.upper, rate, -1.0))
        return result

    def along(self, value: Expr, rate: Expr) -> Expr:
        total = value.graph.zero
        for depth, change, sense in self._depths(value, rate):
            total = total + sense * self.law.force(depth, change)
        return total

    def drawn(self) -> list[Seen]:
        ends = tuple(x for x in (self.lower, self.upper) if x is not None)
        return [self.path.drawn((), STOP)._replace(walls=ends)]

    def potential(self, view: View) -> Expr | None:
        total = view.graph.zero
        for depth, _, _ in self._depths(*self.path.measure(view)):
            total = total + self.law.energy(depth)
        return total

    def remainder(self, view: View) -> list[Load]:
        total = view.graph.zero
        for depth, rate, sense in self._depths(*self.path.measure(view)):
            total = total + sense * (self.law.force(depth, rate) - self.law.elastic(depth))
        return self.path.loads(view, total)


def _stop(e: Entry) -> JointStop | None:
    path, law = read_coordinate(e), read_normal_law(e)
    lower, upper = e["lower"], e["upper"]
    if lower is None and upper is None:
        e.fault("", "has no limit", "give lower, upper or both", "EG-MISSING")
    if lower is not None and upper is not None:
        e.require("upper", upper - lower, POSITIVE, "this is upper - lower; lower must be less than upper")
    return None if path is None else JointStop(e.name, path, lower, upper, law)


TYPES = table(
    ElementType(
        "stop",
        "elastic stops of a joint's coordinate: below ``lower``, above ``upper`` or both.",
        {
            "joint": ON_JOINT.replace(required=True),
            "stiffness": NORMAL["stiffness"],
            "lower": Scalar("lower limit (rad or m)", dimension=REACH),
            "upper": Scalar("upper limit (rad or m)", dimension=REACH),
            **{key: field for key, field in (NORMAL | NORMAL_CHOICE).items() if key != "stiffness"},
        },
        _stop,
    )
)
