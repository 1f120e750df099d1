"""Force elements, dry friction: regularised laws of a sliding velocity, and friction of a joint."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

from ..elements.dimensions import DAMPING, LENGTH, NONE, PUSH, RATE
from ..elements.element_type import ElementType, table
from ..elements.entry import Entry
from ..elements.field import LAW, Field, Fields
from ..graph.core import Expr, sqrt
from ..records import dataclass
from .force import Force, Load, View
from .joint_reactions import reaction_symbol
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
    depend on the joint's reactions; :class:`ReactionFriction` does.
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


@dataclass(frozen=True)
class ReactionFriction(JointFriction):
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
    joint: str
    carried: Friction
    radius: Expr | None = None
    thrust_radius: Expr | None = None

    def along(self, value: Expr, rate: Expr) -> Expr:
        graph = rate.graph
        x, y, z = (reaction_symbol(graph, self.joint, k) for k in range(3))
        normal = size_across(x, y)
        if self.radius is not None:
            normal = self.radius * normal
        if self.thrust_radius is not None:
            normal = normal + self.thrust_radius * graph.apply("abs", z)
        direction = graph.apply("tanh", rate / self.law.smoothing)
        return -(self.law.along(rate) + self.carried.level(rate * rate) * normal * direction)


def size_across(x: Expr, y: Expr) -> Expr:
    """sqrt(x^2 + y^2), whose slopes are 0 where both are."""
    squared = x * x + y * y
    some = x.graph.apply("lt", 0.0, squared)
    return x.graph.apply("select", some, sqrt(x.graph.apply("select", some, squared, 1.0)), 0.0)


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


#: Keys of friction by the joint's reaction.
_BY_REACTION = ("static_coefficient", "radius", "thrust_radius")


def _joint_friction(e: Entry) -> Force | None:
    path, viscous = read_coordinate(e), e.given("viscous")
    if "coefficient" in e.values:
        return _reaction_friction(e, path, viscous)
    for key in _BY_REACTION:
        if key in e.values:
            e.fault(key, "is given without coefficient", f"give coefficient, or leave {key} out")
    dry = read_friction(e, "coulomb", "static", "viscous", alone=True)
    if dry is None and "viscous" not in e.values and not e.at_fault():
        e.fault(
            "", "has no friction law", "give viscous, coulomb with smoothing, coefficient with smoothing, or several"
        )
    if path is None:
        return None
    return (
        JointFriction(e.name, path, dry)
        if dry is not None
        else Damper(e.name, path, e.graph.zero if viscous is None else viscous)
    )


def _reaction_friction(e: Entry, path: Path | None, viscous: Expr | None) -> Force | None:
    """Friction by the reaction, with a part that does not depend on it if coulomb is given too."""
    if "coulomb" not in e.values and "static" in e.values:
        e.fault("static", "is given without coulomb", "give static_coefficient, or coulomb too")
        return None
    if "smoothing" not in e.values:
        e.fault("smoothing", "is missing", "give the velocity (greater than 0) below which friction is smoothed")
        return None
    coefficient, onset, preload, breakaway = (
        e.given(key) for key in ("coefficient", "static_coefficient", "coulomb", "static")
    )
    given = {"coefficient": coefficient, "static_coefficient": onset, "coulomb": preload, "static": breakaway}
    for key, value in given.items():
        if value is not None:
            e.require(key, value, lambda x: x >= 0, "must be 0 or greater")
    if ("stribeck" in e.values) != (onset is not None or breakaway is not None):
        message = "is missing" if "stribeck" not in e.values else "is given without static_coefficient or static"
        e.fault("stribeck", message, "give stribeck together with static_coefficient or static, or none of them")
        return None
    found = e.coordinate("joint") if path is not None else None
    if found is None or path is None or coefficient is None:
        return None
    if found.joint is None:
        e.fault("joint", f"{found.name!r} is no coordinate of a joint, so it carries no reaction", "give coulomb")
        return None
    turns = found.kind == "angle"
    if turns and "radius" not in e.values:
        e.fault("radius", f"is missing, and {found.name!r} is an angle", "give the radius of the pin (m)")
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


TYPES = table(
    ElementType(
        "friction",
        "friction on a joint's coordinate: viscous, Coulomb (with the Stribeck effect if wanted), by the reaction that "
        "the joint carries, or several of them.",
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
            "coefficient": Field(
                "expression",
                "friction coefficient, times the force across its axis that the joint carries",
                level=LAW,
                dimension=NONE,
            ),
            "static_coefficient": Field(
                "expression", "the same at the onset of sliding; give stribeck too", level=LAW, dimension=NONE
            ),
            "radius": Field("expression", "radius of the pin (m), where the coordinate is an angle", dimension=LENGTH),
            "thrust_radius": Field(
                "expression",
                "mean radius of the collar (m) on which the reaction along the axis rubs; none by default",
                dimension=LENGTH,
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
