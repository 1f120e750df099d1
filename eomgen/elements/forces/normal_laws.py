"""Force elements, laws of a one-sided stop: penetration and its rate -> a force that never pulls; stops of joints."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

from ...base.value_rules import NOT_NEGATIVE, POSITIVE, Allowed
from ...expr.core import Expr, sqrt
from ...expr.records import Record
from ..dimensions import DAMPING, FORCE, LENGTH, NONE, PUSH, RATE, REACH, STIFFNESS
from ..element_type import ElementType, Entry, Law, Types, element, key, table
from ..glyphs import STOP, Glyph
from ..kinds import EXPONENT, Choice, Fields, Radii, Scalar
from .force import Load, View, beyond_zero, map_law, where
from .paths import COORDINATE, PathForce

_STIFFNESS = Scalar(
    "stiffness k (N/m**n) in the normal force k d**n max(0, 1 + dissipation d_dot), d the penetration",
    required=True,
    dimension=PUSH,
    exponent="exponent",
    allowed=POSITIVE,
)
DISSIPATION = Scalar("dissipation (s/m)", dimension=NONE.times(RATE, -1), allowed=NOT_NEGATIVE)
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

    def mapped(self, change: Callable[[Expr], Expr]) -> NormalLaw:
        """The law with other expressions, in the graph of a pair."""
        law: NormalLaw = map_law(self, change)
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


class HuntCrossley(Record, NormalLaw):
    """k d^n max(0, 1 + lambda d') of the penetration d > 0, else 0 (Hunt and Crossley, 1975).

    With n > 1 the force and its slope are continuous at touch-down.  The force ends at 0 where the surfaces part faster
    than 1 / lambda; there it is continuous, with a kink.
    """

    stiffness: Expr = key(_STIFFNESS)
    exponent: Expr = key(
        Scalar(
            "exponent n of the penetration", default=EXPONENT, dimension=NONE, allowed=Allowed(1.0),
            remedy="must be at least 1; above 1 the stiffness begins without a jump",
        )
    )  # fmt: skip
    dissipation: Expr = key(DISSIPATION.replace(doc="dissipation (s/m); or give restitution and velocity"))

    def force(self, depth: Expr, rate: Expr) -> Expr:
        gain = depth.graph.apply("max", 0.0, 1.0 + self.dissipation * rate)
        return beyond_zero(depth, lambda d: self.stiffness * d**self.exponent * gain)

    def elastic(self, depth: Expr) -> Expr:
        return beyond_zero(depth, lambda d: self.stiffness * d**self.exponent)

    def energy(self, depth: Expr) -> Expr:
        power = self.exponent + 1.0
        return beyond_zero(depth, lambda d: self.stiffness * d**power / power)


class DampedLinear(Record, NormalLaw):
    """max(0, k d + c d') of the penetration d > 0, else 0.

    With damping the force begins with a jump to c d'; it ends at 0 where the surfaces part faster than k d / c.
    """

    formula: ClassVar[str] = r"F_n = \mathrm{max}(0, k d + c \dot{d}), \quad d > 0"
    stiffness: Expr = key(_STIFFNESS.replace(doc="stiffness k (N/m)", dimension=STIFFNESS, exponent=""))
    damping: Expr = key(Scalar("damping c (N s/m)", default=0, dimension=DAMPING, allowed=NOT_NEGATIVE))

    def force(self, depth: Expr, rate: Expr) -> Expr:
        pull = depth.graph.apply("max", 0.0, self.stiffness * depth + self.damping * rate)
        return beyond_zero(depth, lambda d: pull)

    def elastic(self, depth: Expr) -> Expr:
        return beyond_zero(depth, lambda d: self.stiffness * d)

    def energy(self, depth: Expr) -> Expr:
        return beyond_zero(depth, lambda d: 0.5 * self.stiffness * d * d)


class HertzBodies(HuntCrossley):
    """Hertz's law of two elastic bodies, of an effective radius of 1 m; :meth:`at` gives that of others.

    F = (4/3) E sqrt(R) d^(3/2), with 1 / E = (1 - nu1^2) / E1 + (1 - nu2^2) / E2 and 1 / R = 1 / R1 + 1 / R2 (Johnson,
    Contact Mechanics, 1985, equations 4.22 to 4.24).
    """

    formula: ClassVar[str] = r"F_n = \frac{4}{3} E \sqrt{R} d^{3/2} (1 + \lambda \dot{d}), \quad d > 0"

    def at(self, radius: Callable[[], Expr]) -> HuntCrossley:
        return HuntCrossley(self.stiffness * sqrt(radius()), self.exponent, self.dissipation)


class PartOfLaw(Record, NormalLaw):
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


class PartlyDamped(Record, NormalLaw):
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


class UpToDepth(Record, NormalLaw):
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


class RigidLaw(Record, NormalLaw):
    """No penetration: the force is what it takes, found by a time-stepping method; elsewhere it is none."""

    formula: ClassVar[str] = r"0 \le F_n \perp g \ge 0"

    def force(self, depth: Expr, rate: Expr | None = None) -> Expr:
        return depth.graph.zero

    elastic = energy = force


# -- keys --------------------------------------------------------------------------------------------------------------


#: Instead of the dissipation.
IMPACT: Fields = {
    "restitution": Scalar(
        "coefficient of restitution, from which the dissipation is computed",
        dimension=NONE,
        allowed=Allowed(0.0, 1.0, above=True),
        remedy="must be greater than 0 and at most 1",
    ),
    "velocity": Scalar("impact velocity (m/s) at which that restitution holds", dimension=RATE, allowed=POSITIVE),
    "formula": Choice(
        "formula that gives the dissipation from the restitution", default=RESTITUTIONS[0], choices=RESTITUTIONS
    ),
}
#: Of two bodies of known radii, instead of the stiffness.
ELASTIC: Fields = {
    "moduli": Radii(
        "Young's moduli of both bodies (Pa), instead of the stiffness, with poisson",
        dimension=FORCE.times(LENGTH, -2),
        allowed=POSITIVE,
    ),
    "poisson": Radii(
        "Poisson's ratios of both bodies, beside moduli",
        dimension=NONE,
        allowed=Allowed(-1.0, 0.5, above=True),
        remedy="is above -1 and at most 0.5",
    ),
}


def _dissipation(e: Entry, value: Expr | None) -> Expr:
    """Given as such, or through a coefficient of restitution; none of them means none."""
    restitution, velocity, formula = (e[one] for one in IMPACT)
    if value is not None:
        for one in IMPACT:
            if one in e.values:
                e.fault(one, "dissipation is given too", "give dissipation, or restitution with velocity")
        return value
    if (restitution is None) != (velocity is None):
        e.missing("velocity" if velocity is None else "restitution", "give restitution and velocity together")
    elif "formula" in e.values and restitution is None:
        remedy = "give restitution and velocity, or leave formula out"
        e.fault("formula", "is given without restitution", remedy, "EG-MISSING")
    known = restitution is not None and velocity is not None
    return dissipation_of(restitution, velocity, formula) if known else e.graph.zero


def _hertz(e: Entry) -> HuntCrossley | None:
    """Of a stiffness, or of the moduli of both bodies."""
    exponent, dissipation = e.graph.constant(EXPONENT), _dissipation(e, e["dissipation"])
    if not e.values.keys() & ELASTIC.keys():
        if "stiffness" not in e.values:
            e.missing("stiffness", "give it, or moduli and poisson" if "moduli" in e.fields else "give it")
        stiffness = e["stiffness"]
        return None if e.at_fault() else HuntCrossley(stiffness, exponent, dissipation)
    e.refuse("stiffness", "follows from moduli, poisson and the radii")
    moduli, ratios = (e[one] for one in ELASTIC)
    for one in ELASTIC:
        if one not in e.values:
            e.missing(one, "give moduli and poisson together, two numbers each")
    if e.at_fault():
        return None
    (E1, E2), (nu1, nu2) = moduli, ratios
    modulus = 1.0 / ((1.0 - nu1 * nu1) / E1 + (1.0 - nu2 * nu2) / E2)
    return HertzBodies(4.0 / 3.0 * modulus, exponent, dissipation)


def _hertz_law(elastic: Fields) -> ElementType:
    keys = {"stiffness": _STIFFNESS.replace(required=False), "dissipation": DISSIPATION, **IMPACT}
    remedies = _REMEDIES | {"exponent": "leave it out; it is 3/2"}
    return ElementType("hertz", "the same with the exponent 3/2.", keys | elastic, _hertz, remedies=remedies)


_BY_MODULI = dict.fromkeys(ELASTIC, "choose the type hertz, or give stiffness instead")
_REMEDIES = {"damping": "leave it out; the dissipation is damping / stiffness", **_BY_MODULI}
_LAWS = table(
    element(
        HuntCrossley,
        "hunt_crossley",
        "k d**n max(0, 1 + dissipation d_dot) of the penetration d.",
        more=IMPACT,
        check=lambda e, values: values.update(dissipation=_dissipation(e, values["dissipation"])),
        remedies=_REMEDIES,
    ),
    _hertz_law({}),
    element(DampedLinear, "linear", "max(0, k d + c d_dot).", remedies=_BY_MODULI),
)
#: Where radii are known.
CURVED_LAWS = _LAWS | table(_hertz_law(ELASTIC))
_RENAMED = {"normal_law": "type"}


def normal_key(types: Types, required: bool = True) -> Law:
    """The key of a law of the normal force."""
    return Law("law of the normal force", types, "hunt_crossley", _RENAMED, required)


NORMAL = normal_key(_LAWS)


# -- stops of a joint --------------------------------------------------------------------------------------------------


class JointStop(PathForce):
    """Stops of a joint's coordinate q: beyond ``lower`` or ``upper`` a one-sided force pushes it back (N or N m).

    Penetrations are q - upper and lower - q.  A stop never pulls.
    """

    sentence = "Stops of a joint: beyond its limits a force from the penetration $d$ pushes the coordinate back."
    uses_value = True
    law: NormalLaw = key(NORMAL)
    lower: Expr | None = key(Scalar("lower limit (rad or m)", dimension=REACH))
    upper: Expr | None = key(Scalar("upper limit (rad or m)", dimension=REACH))

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

    def _sum(self, value: Expr, rate: Expr, part: Callable[[Expr, Expr, float], Expr]) -> Expr:
        """A part of what the law gives, of both stops."""
        return sum((part(*one) for one in self._depths(value, rate)), value.graph.zero)

    def along(self, value: Expr, rate: Expr) -> Expr:
        return self._sum(value, rate, lambda depth, change, sense: sense * self.law.force(depth, change))

    def glyphs(self) -> list[Glyph]:
        ends = tuple(x for x in (self.lower, self.upper) if x is not None)
        return [self.path.glyphs((), STOP)._replace(walls=ends)]

    def potential(self, view: View) -> Expr | None:
        return self._sum(*self.path.measure(view), lambda depth, change, sense: self.law.energy(depth))

    def remainder(self, view: View) -> list[Load]:
        def beyond(depth: Expr, change: Expr, sense: float) -> Expr:
            return sense * (self.law.force(depth, change) - self.law.elastic(depth))

        return self.path.loads(view, self._sum(*self.path.measure(view), beyond))


def _check_limits(e: Entry, values: dict[str, Any]) -> None:
    lower, upper = values["lower"], values["upper"]
    if lower is None and upper is None:
        e.fault("", "has no limit", "give lower, upper or both", "EG-MISSING")
    if lower is not None and upper is not None:
        e.require("upper", upper - lower, POSITIVE, "this is upper - lower; lower must be less than upper")


TYPES = table(
    element(
        JointStop,
        "stop",
        "elastic stops of a joint's coordinate: below ``lower``, above ``upper`` or both.",
        COORDINATE,
        check=_check_limits,
    )
)
