"""Force elements, friction of a joint, by a given force or by the one that the joint carries."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ...base.records import dataclass
from ...base.value_rules import NOT_NEGATIVE
from ...expr.core import Expr, Graph, sqrt
from ..dimensions import DAMPING, LENGTH, NONE, PUSH, RATE, STIFFNESS
from ..element_type import ElementType, Entry, table
from ..kinds import LAW, Fields, Scalar
from .force import Force, Load, View, beyond_zero
from .friction_laws import FRICTION_CHOICE, Friction, LineFriction, has_bristles, read_friction
from .paths import ON_JOINT, Path, PathForce, read_coordinate
from .springs import Damper

# -- symbols of reactions ----------------------------------------------------------------------------------------------


_MULTIPLIER = re.compile(r"multiplier\((.+)\)\Z")
_SYMBOL = re.compile(r"reaction\((.+)\)\[([0-5])\]\Z")


def reaction_symbol(graph: Graph, joint: str, k: int) -> Expr:
    """Force (k = 0, 1, 2) or moment (3, 4, 5) that P exerts on S at S, along the axes of S (N, N m)."""
    return graph.symbol(f"reaction({joint})[{k}]")


def reaction_of(symbol: str) -> tuple[str, int] | None:
    """Joint and component of such a symbol's name; None for other names."""
    found = _SYMBOL.match(symbol)
    return (found[1], int(found[2])) if found else None


def multiplier_of(symbol: str) -> str | None:
    """Equation, or element of one equation, of the symbol of a multiplier, ``multiplier(mesh.ratio)``; else None."""
    found = _MULTIPLIER.match(symbol)
    return found[1] if found else None


def is_carried(symbol: str) -> bool:
    """Whether a symbol stands for a reaction or a multiplier."""
    return symbol.endswith((")", "]")) and (reaction_of(symbol) is not None or multiplier_of(symbol) is not None)


# -- by reactions ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ReactionFriction(Force):
    """Friction by the force that the joint carries: -[(c(v) + m(v) N) tanh(v / smoothing) + viscous v].

    m is the coefficient of ``carried``.  N is the size of the reaction across the joint's axis; for an angle it is
    times the ``radius`` of the pin, and ``thrust_radius`` times the size of the reaction along the axis is added.
    """

    sentence = (
        "Friction in a joint that grows with the force $N$ the joint carries: it opposes the rate $v$ of the "
        "coordinate; $v_s$ smooths its change of sign."
    )
    formula = r"F = -\left(c(v) + \mu(v) N\right) \mathrm{tanh}(v/v_s) - b v"
    by_reaction = True
    path: Path
    law: Friction
    joint: str
    carried: Friction
    radius: Expr | None = None
    thrust_radius: Expr | None = None

    def along(self, value: Expr, rate: Expr) -> Expr:
        graph = rate.graph
        x, y, z = (reaction_symbol(graph, self.joint, k) for k in range(3))
        normal = beyond_zero(x * x + y * y, sqrt)  # whose slopes are 0 where no force acts
        if self.radius is not None:
            normal = self.radius * normal
        if self.thrust_radius is not None:
            normal = normal + self.thrust_radius * graph.apply("abs", z)
        direction = graph.apply("tanh", rate / self.law.smoothing)
        return -(self.law.along(rate) + self.carried.level(rate * rate) * normal * direction)

    def loads(self, view: View) -> list[Load]:
        return self.path.loads(view, self.along(*self.path.measure(view)))


#: Keys of friction by the joint's reaction.
BY_REACTION: Fields = {
    "coefficient": Scalar(
        "friction coefficient, times the force across its axis that the joint carries", level=LAW, dimension=NONE
    ),
    "static_coefficient": Scalar("the same at the onset of sliding; give stribeck too", level=LAW, dimension=NONE),
    "radius": Scalar("radius of the pin (m), where the coordinate is an angle", dimension=LENGTH),
    "thrust_radius": Scalar(
        "mean radius of the collar (m) on which the reaction along the axis rubs; none by default", dimension=LENGTH
    ),
}


def read_reaction_friction(e: Entry, path: Path | None, viscous: Expr | None) -> Force | None:
    """Friction by the reaction, with a part that does not depend on it if coulomb is given too."""
    if "coulomb" not in e.values and "static" in e.values:
        e.fault("static", "is given without coulomb", "give static_coefficient, or coulomb too", "EG-MISSING")
        return None
    if (kind := e["friction_law"]) != "coulomb":
        e.fault("friction_law", f"{kind} has no coefficient", "leave friction_law out, or give coulomb")
        return None
    for key in ("transition", "bristle_stiffness", "bristle_damping"):
        e.refuse(key, "has no meaning beside coefficient")
    if "smoothing" not in e.values:
        e.missing("smoothing", "give the velocity (greater than 0) below which friction is smoothed")
        return None
    coefficient, onset, preload, breakaway = (
        e[key] for key in ("coefficient", "static_coefficient", "coulomb", "static")
    )
    given = {"coefficient": coefficient, "static_coefficient": onset, "coulomb": preload, "static": breakaway}
    for key, value in given.items():
        if value is not None:
            e.require(key, value, NOT_NEGATIVE, "must be 0 or greater")
    if ("stribeck" in e.values) != (onset is not None or breakaway is not None):
        message = "is missing" if "stribeck" not in e.values else "is given without static_coefficient or static"
        remedy = "give stribeck together with static_coefficient or static, or none of them"
        e.fault("stribeck", message, remedy, "EG-MISSING")
        return None
    found = e["joint"] if path is not None else None
    if found is None or path is None or coefficient is None:
        return None
    if found.joint is None:
        e.fault(
            "joint",
            f"{found.name!r} is no coordinate of a joint, so it carries no reaction",
            "give coulomb",
            "EG-REFERENCE",
        )
        return None
    turns = found.kind == "angle"
    if turns and "radius" not in e.values:
        e.fault("radius", f"is missing, and {found.name!r} is an angle", "give the radius of the pin (m)", "EG-MISSING")
        return None
    for key in ("radius", "thrust_radius"):
        if key in e.values and not turns:
            e.fault(key, f"has no meaning: {found.name!r} is a length", f"leave {key} out")
            return None
    smoothing = e.positive("smoothing")
    stribeck = e.positive("stribeck") if "stribeck" in e.values else None
    zero = e.graph.zero
    dry = Friction(zero if preload is None else preload, smoothing, zero if viscous is None else viscous)
    return ReactionFriction(
        e.name,
        path,
        dry if breakaway is None else replace(dry, static=breakaway, stribeck=stribeck),
        found.joint,
        Friction(coefficient, smoothing, zero, onset, None if onset is None else stribeck),
        e.positive("radius") if "radius" in e.values else None,
        e.positive("thrust_radius") if "thrust_radius" in e.values else None,
    )


# -- friction of a joint -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class JointFriction(PathForce):
    """Friction on a joint's coordinate of rate v (N or N m), such as -[c(v) tanh(v / smoothing) + viscous v].

    The tanh is the regularisation of Andersson, Soderberg and Bjorklund (2007), Tribol. Int. 40, 580-587.  It does not
    depend on the joint's reactions; :class:`~.friction.ReactionFriction` does.
    """

    sentence = "Friction in a joint: it opposes the rate $v$ of the coordinate."
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
                "static friction, at the onset of sliding (N m or N); give stribeck too", level=LAW, dimension=PUSH
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
