"""Force elements, friction of a joint by the force that it carries."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

from ..base.value_rules import NOT_NEGATIVE
from ..elements.dimensions import LENGTH, NONE
from ..elements.entry import Entry
from ..elements.kinds import LAW, Fields, Scalar
from ..graph.core import Expr, sqrt
from ..records import dataclass
from .branches import beyond_zero
from .force import Force, Load, View
from .friction_laws import Friction
from .joint_reactions import reaction_symbol
from .paths import Path


@dataclass(frozen=True)
class ReactionFriction(Force):
    """Friction by the force that the joint carries: -[(c(v) + m(v) N) tanh(v / smoothing) + viscous v].

    m is the coefficient of ``carried``.  N is the size of the reaction across the joint's axis; for an angle it is
    times the ``radius`` of the pin, and ``thrust_radius`` times the size of the reaction along the axis is added.
    """

    sentence: ClassVar[str] = (
        "Friction in a joint that grows with the force $N$ the joint carries: it opposes the rate $v$ of the "
        "coordinate; $v_s$ smooths its change of sign."
    )
    formula: ClassVar[str] = r"F = -\left(c(v) + \mu(v) N\right) \mathrm{tanh}(v/v_s) - b v"
    by_reaction: ClassVar[bool] = True
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
        "friction coefficient, times the force across its axis that the joint carries",
        level=LAW,
        dimension=NONE,
    ),
    "static_coefficient": Scalar("the same at the onset of sliding; give stribeck too", level=LAW, dimension=NONE),
    "radius": Scalar("radius of the pin (m), where the coordinate is an angle", dimension=LENGTH),
    "thrust_radius": Scalar(
        "mean radius of the collar (m) on which the reaction along the axis rubs; none by default",
        dimension=LENGTH,
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
