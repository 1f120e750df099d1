"""Force elements, dry friction: regularised laws of a sliding velocity, and friction of a joint."""

from __future__ import annotations

from typing import ClassVar

from ..elements.dimensions import DAMPING, NONE, PUSH, RATE
from ..elements.element_type import ElementType, table
from ..elements.entry import Entry
from ..elements.field import LAW, Field, Fields
from ..graph.core import Expr
from ..records import dataclass
from .force import Force, Load, View
from .paths import ON_JOINT, Path, read_coordinate
from .springs import Damper


@dataclass(frozen=True)
class Friction:
    """Coulomb and Stribeck friction; what multiplies the direction of sliding, opposed to it.

    ``dynamic``, ``static`` and ``viscous`` are forces for a joint and parts of the normal force for a contact.

        c(v) = dynamic + (static - dynamic) exp(-(v / stribeck)^2)

    after Armstrong-Helouvry, Dupont and Canudas de Wit (1994), Automatica 30, 1083-1138, section 2.  ``static`` None
    means dynamic.  At rest friction is 0: a body on a slope creeps, at a part of the velocity ``smoothing``.
    """

    dynamic: Expr
    smoothing: Expr
    viscous: Expr
    static: Expr | None = None
    stribeck: Expr | None = None

    def level(self, squared: Expr) -> Expr:
        """c of the squared sliding velocity."""
        if self.static is None or self.stribeck is None:
            return self.dynamic
        fall = squared.graph.apply("exp", -squared / (self.stribeck * self.stribeck))
        return self.dynamic + (self.static - self.dynamic) * fall

    def along(self, rate: Expr) -> Expr:
        """c tanh(v / smoothing) + viscous v of a velocity along a line."""
        direction = rate.graph.apply("tanh", rate / self.smoothing)
        return self.level(rate * rate) * direction + self.viscous * rate

    def per_velocity(self, squared: Expr) -> Expr:
        """c / sqrt(v^2 + smoothing^2) + viscous: times the velocity in a plane it is the friction; smooth at rest."""
        size = squared.graph.apply("sqrt", squared + self.smoothing * self.smoothing)
        return self.level(squared) / size + self.viscous


@dataclass(frozen=True)
class JointFriction(Force):
    """Friction -[c(v) tanh(v / smoothing) + viscous v] on a joint's coordinate of rate v (N or N m).

    The tanh is the regularisation of Andersson, Soderberg and Bjorklund (2007), Tribol. Int. 40, 580-587.  It does not
    depend on the joint's reactions, unless the coefficients are given so.
    """

    sentence: ClassVar[str] = (
        "Friction in a joint: it opposes the rate $v$ of the coordinate; $v_s$ smooths its change of sign."
    )
    formula: ClassVar[str] = r"F = -c(v) \mathrm{tanh}(v/v_s) - b v"
    path: Path
    law: Friction

    def along(self, value: Expr, rate: Expr) -> Expr:
        return -self.law.along(rate)

    def loads(self, view: View) -> list[Load]:
        return self.path.loads(view, self.along(*self.path.measure(view)))


#: Of contacts, as parts of the normal force.
FRICTION: Fields = {
    "friction": Field("expression", "coefficient of sliding friction", level=LAW, dimension=NONE),
    "static_friction": Field(
        "expression",
        "coefficient of static friction, at the onset of sliding; give stribeck too",
        level=LAW,
        dimension=NONE,
    ),
    "stribeck": Field(
        "expression",
        "Stribeck velocity (m/s): the sliding velocity at which static friction has largely dropped to "
        "sliding friction",
        dimension=RATE,
    ),
    "viscous_friction": Field(
        "expression",
        "viscous friction coefficient per normal force and velocity (s/m)",
        default=0,
        level=LAW,
        dimension=NONE.times(RATE, -1),
    ),
    "smoothing": Field("expression", "sliding velocity (m/s) below which friction is smoothed", dimension=RATE),
}


def read_friction(e: Entry, dynamic: str, static: str, viscous: str, alone: bool = False) -> Friction | None:
    """Dry friction from the keys of its parts; None without Coulomb's part, beside which viscous may stand alone."""
    if dynamic not in e.values:
        for key in (static, "stribeck", "smoothing", *(() if alone else (viscous,))):
            if key in e.values:
                e.fault(key, f"is given without {dynamic}", f"give {dynamic}, or leave {key} out")
        return None
    level = e.law(dynamic)
    e.require(dynamic, level, lambda x: x >= 0, "must be 0 or greater")
    if "smoothing" not in e.values:
        e.fault("smoothing", "is missing", "give the velocity (greater than 0) below which friction is smoothed")
        return None
    if (static in e.values) != ("stribeck" in e.values):
        missing = "stribeck" if static in e.values else static
        e.fault(missing, "is missing", f"give {static} and stribeck together, or neither")
        return None
    onset = e.given(static)
    if onset is not None:
        e.require(static, onset, lambda x: x >= 0, "must be 0 or greater")
    stribeck = e.positive("stribeck") if "stribeck" in e.values else None
    along = e.given(viscous)
    return Friction(level, e.positive("smoothing"), e.graph.zero if along is None else along, onset, stribeck)


def _joint_friction(e: Entry) -> Force | None:
    path, viscous = read_coordinate(e), e.given("viscous")
    dry = read_friction(e, "coulomb", "static", "viscous", alone=True)
    if dry is None and "viscous" not in e.values and not e.at_fault():
        e.fault("", "has no friction law", "give viscous, or coulomb with smoothing, or all three")
    if path is None:
        return None
    return (
        JointFriction(e.name, path, dry)
        if dry is not None
        else Damper(e.name, path, e.graph.zero if viscous is None else viscous)
    )


TYPES = table(
    ElementType(
        "friction",
        "friction on a joint's coordinate: viscous, Coulomb (with the Stribeck effect if wanted), or both.",
        {
            "joint": ON_JOINT._replace(required=True),
            "viscous": Field("expression", "viscous coefficient (N m s/rad or N s/m)", level=LAW, dimension=DAMPING),
            "coulomb": Field("expression", "Coulomb friction (N m or N)", level=LAW, dimension=PUSH),
            "static": Field(
                "expression",
                "static friction, at the onset of sliding (N m or N); give stribeck too",
                level=LAW,
                dimension=PUSH,
            ),
            "stribeck": Field(
                "expression",
                "Stribeck velocity (rad/s or m/s): where static friction has largely dropped to Coulomb friction",
                dimension=RATE,
            ),
            "smoothing": Field(
                "expression", "velocity below which Coulomb friction is smoothed (rad/s or m/s)", dimension=RATE
            ),
        },
        _joint_friction,
    )
)
