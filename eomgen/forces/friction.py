"""Force elements, friction of a joint."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from ..base.value_rules import NOT_NEGATIVE
from ..elements.dimensions import DAMPING, PUSH, RATE, STIFFNESS
from ..elements.element_type import ElementType, table
from ..elements.entry import Entry
from ..elements.kinds import LAW, Scalar
from ..graph.core import Expr
from ..records import dataclass
from .dry_friction import LineFriction
from .force import Force, View
from .friction_laws import FRICTION_CHOICE, has_bristles, read_friction
from .paths import ON_JOINT, PathForce, read_coordinate
from .reaction_friction import BY_REACTION, read_reaction_friction
from .springs import Damper


@dataclass(frozen=True)
class JointFriction(PathForce):
    """Friction on a joint's coordinate of rate v (N or N m), such as -[c(v) tanh(v / smoothing) + viscous v].

    The tanh is the regularisation of Andersson, Soderberg and Bjorklund (2007), Tribol. Int. 40, 580-587.  It does not
    depend on the joint's reactions; :class:`~.reaction_friction.ReactionFriction` does.
    """

    sentence: ClassVar[str] = "Friction in a joint: it opposes the rate $v$ of the coordinate."
    law: LineFriction

    @property
    def laws(self) -> tuple[LineFriction, ...]:
        return (self.law,)

    @property
    def formulas(self) -> list[str]:
        return [self.law.joint_formula]

    def along(self, value: Expr, rate: Expr) -> Expr:
        return -self.law.along(rate)

    def state_rates(self, view: View) -> tuple[Expr, ...]:
        return self.law.rates_along(self.path.measure(view)[1])


def _joint_friction(e: Entry) -> Force | None:
    path, viscous = read_coordinate(e), e["viscous"]
    if viscous is not None:
        e.require("viscous", viscous, NOT_NEGATIVE, "must be 0 or greater")
    if "coefficient" in e.values:
        return read_reaction_friction(e, path, viscous)
    for key in BY_REACTION:
        if key in e.values:
            e.fault(key, "is given without coefficient", f"give coefficient, or leave {key} out", "EG-MISSING")
    dry = read_friction(e, "coulomb", "static", "viscous", alone=True)
    if dry is None and "viscous" not in e.values and not e.at_fault():
        remedy = "give viscous, coulomb with smoothing, coefficient with smoothing, or several"
        e.fault("", "has no friction law", remedy, "EG-MISSING")
    if path is None:
        return None
    return (
        JointFriction(e.name, path, dry)
        if dry is not None
        else Damper(e.name, path, e.graph.zero if viscous is None else viscous)
    )


def _states(values: Mapping[str, Any]) -> dict[str, str]:
    return {"bristle": ""} if has_bristles(values) else {}


TYPES = table(
    ElementType(
        "friction",
        "friction on a joint's coordinate: viscous, Coulomb (with the Stribeck effect if wanted), by the reaction that "
        "the joint carries, or several of them.",
        {
            "joint": ON_JOINT.replace(required=True),
            "viscous": Scalar("viscous coefficient (N m s/rad or N s/m)", level=LAW, dimension=DAMPING),
            "coulomb": Scalar("Coulomb friction (N m or N)", level=LAW, dimension=PUSH),
            "static": Scalar(
                "static friction, at the onset of sliding (N m or N); give stribeck too",
                level=LAW,
                dimension=PUSH,
            ),
            **BY_REACTION,
            "stribeck": Scalar(
                "Stribeck velocity (rad/s or m/s): where static friction has largely dropped to Coulomb friction",
                dimension=RATE,
            ),
            "smoothing": Scalar("velocity below which Coulomb friction is smoothed (rad/s or m/s)", dimension=RATE),
            **FRICTION_CHOICE,
            "bristle_stiffness": FRICTION_CHOICE["bristle_stiffness"].replace(dimension=STIFFNESS),
            "bristle_damping": FRICTION_CHOICE["bristle_damping"].replace(dimension=DAMPING),
        },
        _joint_friction,
        states=_states,
    )
)
