"""Force elements, the law of a one-sided stop: penetration and its rate -> a force that never pulls."""

from __future__ import annotations

from ..elements.dimensions import NONE, PUSH, RATE
from ..elements.entry import Entry
from ..elements.field import EXPONENT, Field, Fields
from ..graph.core import Expr
from ..records import dataclass
from .branches import beyond_zero

#: Names of the formulas for the dissipation from a coefficient of restitution; see :func:`dissipation_of`.
RESTITUTIONS = ("hunt_crossley", "lankarani", "flores")


def dissipation_of(restitution: Expr, velocity: Expr, formula: str) -> Expr:
    """The factor lambda of :class:`HuntCrossley` for a coefficient of restitution at an impact velocity.

    Parameters
    ----------
    restitution, velocity : Expr
        e (1) and v (m/s, or rad/s), v > 0.
    formula : {"hunt_crossley", "lankarani", "flores"}
        3 (1 - e) / (2 v), Hunt and Crossley (1975), J. Appl. Mech. 42, 440-445, for e close to 1; 3 (1 - e^2) / (4 v),
        Lankarani and Nikravesh (1990), J. Mech. Des. 112, 369-376; 8 (1 - e) / (5 e v), Flores, Machado, Silva and
        Martins (2011), Multibody Syst. Dyn. 25, 357-375, for all e > 0.
    """
    e, v = restitution, velocity
    if formula == "lankarani":
        return 3.0 * (1.0 - e * e) / (4.0 * v)
    if formula == "flores":
        return 8.0 * (1.0 - e) / (5.0 * e * v)
    return 3.0 * (1.0 - e) / (2.0 * v)


@dataclass(frozen=True)
class HuntCrossley:
    """k d^n max(0, 1 + lambda d') of the penetration d > 0, else 0 (Hunt and Crossley, 1975).

    With n > 1 the force and its slope are continuous at touch-down.  The force ends at 0 where the surfaces part faster
    than 1 / lambda; there it is continuous, with a kink.
    """

    stiffness: Expr
    exponent: Expr
    dissipation: Expr

    def force(self, depth: Expr, rate: Expr) -> Expr:
        """Force (N or N m) from the penetration and its rate."""
        gain = depth.graph.apply("max", 0.0, 1.0 + self.dissipation * rate)
        return beyond_zero(depth, lambda d: self.stiffness * d**self.exponent * gain)

    def elastic(self, depth: Expr) -> Expr:
        """The part of the force that has a potential."""
        return beyond_zero(depth, lambda d: self.stiffness * d**self.exponent)

    def energy(self, depth: Expr) -> Expr:
        """The potential of the elastic part, k d^(n + 1) / (n + 1) (J)."""
        power = self.exponent + 1.0
        return beyond_zero(depth, lambda d: self.stiffness * d**power / power)


NORMAL: Fields = {
    "stiffness": Field(
        "expression",
        "stiffness k (N/m**n) in the normal force k d**n max(0, 1 + dissipation d_dot), d the penetration",
        required=True,
        dimension=PUSH,
        exponent="exponent",
    ),
    "exponent": Field("expression", "exponent n of the penetration", default=EXPONENT, dimension=NONE),
    "dissipation": Field(
        "expression", "dissipation (s/m); or give restitution and velocity", dimension=NONE.times(RATE, -1)
    ),
    "restitution": Field(
        "expression", "coefficient of restitution, from which the dissipation is computed", dimension=NONE
    ),
    "velocity": Field("expression", "impact velocity (m/s) at which that restitution holds", dimension=RATE),
    "formula": Field(
        "choice",
        "formula that gives the dissipation from the restitution",
        default=RESTITUTIONS[0],
        choices=RESTITUTIONS,
    ),
}


def read_normal_law(e: Entry) -> HuntCrossley:
    """The law of the keys :data:`NORMAL`."""
    stiffness, exponent = e.positive("stiffness"), e.law("exponent")
    e.require("exponent", exponent, lambda n: n >= 1, "must be at least 1; above 1 the stiffness begins without a jump")
    return HuntCrossley(stiffness, exponent, _dissipation(e))


def _dissipation(e: Entry) -> Expr:
    """Given as such, or through a coefficient of restitution; none of them means none."""
    restitution, velocity = e.given("restitution"), e.given("velocity")
    formula = e.choice("formula")
    if "dissipation" in e.values:
        for key in ("restitution", "velocity", "formula"):
            if key in e.values:
                e.fault(key, "dissipation is given too", "give dissipation, or restitution with velocity")
        value = e.law("dissipation")
        e.require("dissipation", value, lambda x: x >= 0, "must be 0 or greater")
        return value
    if restitution is None and velocity is None:
        if "formula" in e.values:
            e.fault("formula", "is given without restitution", "give restitution and velocity, or leave formula out")
        return e.graph.zero
    if restitution is None or velocity is None:
        e.fault(
            "velocity" if velocity is None else "restitution", "is missing", "give restitution and velocity together"
        )
        return e.stand_in
    e.require("restitution", restitution, lambda x: 0 < x <= 1, "must be greater than 0 and at most 1")
    e.require("velocity", velocity, lambda x: x > 0, "must be greater than 0")
    return dissipation_of(restitution, velocity, formula)
