"""Force elements, dry friction: laws of a sliding velocity, alone or with states of bristles; friction of a joint."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, NamedTuple

from ...base.limits.numbers import AT_REST
from ...base.value_rules import LIMITS, NOT_NEGATIVE, POSITIVE
from ...expr import vectors as vec
from ...expr.core import Expr, sqrt
from ...expr.records import Record
from ...expr.vectors import Mat3, Vec3
from ..dimensions import DAMPING, LENGTH, NONE, PUSH, RATE, REACH, STIFFNESS
from ..element_type import ElementType, Entry, Law, Types, element, key, table
from ..kinds import LAW, Choice, Fields, Scalar
from .force import Force, View, beyond_zero, map_law, reaction_symbol, where
from .paths import ON_JOINT, Path, PathForce, read_coordinate
from .springs import Damper

# -- dry friction ------------------------------------------------------------------------------------------------------


class DryFriction(Record, ABC):
    """What opposes sliding in a contact, as a part of the normal force; ``formula`` says it in LaTeX."""

    formula: ClassVar[str]

    @abstractmethod
    def in_plane(self, slip: Slip) -> Vec3:
        """Friction at a sliding velocity, with the direction of the velocity."""

    def mapped(self, change: Callable[[Expr], Expr]) -> DryFriction:
        """The law with other expressions, in the graph of a pair; without its states."""
        law: DryFriction = map_law(self, change)
        return law

    def on_pad(self, area: Expr) -> DryFriction:
        """The law of a point that stands for an area of a plate."""
        return self

    def holding(self, states: tuple[Expr, ...], lateral: Vec3 | None) -> DryFriction:
        """The law with its states; in contacts of the plane ``lateral`` is the direction across the plane."""
        return self

    def drag(self, push: Expr, slip: Slip) -> Vec3:
        """The force on the second surface (N), across the normal, beside a normal force."""
        return vec.scale(-push, self.in_plane(slip))

    def rates_apart(self) -> tuple[Expr, ...]:
        """Rates of its states where surfaces are apart."""
        return ()

    def rates_in_plane(self, slip: Slip) -> tuple[Expr, ...]:
        """Rates of its states at a sliding velocity."""
        return ()


class LineFriction(DryFriction):
    """Friction that acts in joints too, where it is a force; ``joint_formula`` says it there, in LaTeX."""

    joint_formula: ClassVar[str]

    @abstractmethod
    def along(self, rate: Expr) -> Expr:
        """Friction at a velocity along a line, with the sign of the velocity."""

    def rates_along(self, rate: Expr) -> tuple[Expr, ...]:
        """Rates of its states at a velocity along a line."""
        return ()


class Slip(NamedTuple):
    """How surfaces slide: velocity and normal (ground axes), penetration, normal force, and axes of the first one."""

    velocity: Vec3
    normal: Vec3
    depth: Expr
    push: Expr
    axes: Mat3

    def axes_of_states(self, lateral: Vec3 | None) -> Mat3:
        """In whose axes states are written: of the first surface, or along the surface, across the plane, normal."""
        if lateral is None:
            return self.axes
        return vec.transpose((vec.cross(self.normal, lateral), lateral, self.normal))

    def across(self, states: Sequence[Expr], lateral: Vec3 | None) -> Vec3:
        """A vector of states in ground axes, less its part along the normal."""
        zero = self.depth.graph.zero
        x, y, z = (*states, zero, zero)[:3]
        result = vec.times(self.axes_of_states(lateral), (x, y, z))
        return vec.sub(result, vec.scale(vec.dot(result, self.normal), self.normal))


def stribeck_level(squared: Expr, dynamic: Expr, static: Expr | None, stribeck: Expr | None) -> Expr:
    """dynamic + (static - dynamic) exp(-(v / stribeck)^2) of the squared velocity."""
    if static is None or stribeck is None:
        return dynamic
    fall = squared.graph.apply("exp", -squared / (stribeck * stribeck))
    return dynamic + (static - dynamic) * fall


_DYNAMIC = Scalar("coefficient of sliding friction", required=True, level=LAW, dimension=NONE, allowed=NOT_NEGATIVE)
_STATIC = Scalar(
    "coefficient of static friction, at the onset of sliding; give stribeck too", level=LAW, dimension=NONE
)
_STRIBECK = Scalar(
    "Stribeck velocity (m/s): the sliding velocity at which static friction has largely dropped to sliding friction",
    dimension=RATE,
    allowed=POSITIVE,
)
_VISCOUS = Scalar(
    "viscous friction coefficient per normal force and velocity (s/m)",
    default=0,
    level=LAW,
    dimension=NONE.times(RATE, -1),
    allowed=NOT_NEGATIVE,
)


# -- bristles ----------------------------------------------------------------------------------------------------------


UNIT = "J^0.5"  #: of the state of a contact
SUMS = 3  #: how many numbers :meth:`LuGre.sums` has beside one for each state


class LuGre(LineFriction):
    """Friction of bristles whose state holds a body at rest.

    In a joint the state is the deflection z,

        z' = v - stiffness |v| / c(v) z,  friction = stiffness z + damping z' + viscous v

    after Canudas de Wit, Olsson, Astrom and Lischinsky (1995), IEEE Trans. Autom. Control 40, 419-425, with c(v) of
    :class:`Friction`.  In a contact, of normal force N, the state is e = sqrt(stiffness N) z, a vector
    along the surface, whose e^2 / 2 is the energy in the bristles:

        friction = m (e + damping / stiffness e') + viscous N v
        e' = m v - stiffness |v| / c(v) e
        m = N / max(sqrt(N / stiffness), |e| / c_s),  c_s the greatest c(v)

    At a constant N this is the law above, with vectors (Velenis, Tsiotras and Canudas de Wit, 2002).  The law above
    gains energy where N rises while bristles are bent: their energy, stiffness N z^2 / 2, rises with it.  Here the
    power m e v of the bristles is (e^2 / 2)' + stiffness |v| / c(v) e^2, whatever N does.  Where N falls, e may stand
    for more than N can hold; then m is as large as c_s allows.  The damping takes while e grows with N what it gives
    back while e falls, so that a body that bounces as it slides loses c times the impulse of N, as by the law of
    Canudas de Wit and Tsiotras (1999), Proc. 38th IEEE Conf. Decis. Control, 3746-3751, whose friction is N times that
    of z.  Where damping |v| > 4 c(v) it may give more than the loss and the viscous part take (Barahanov and Ortega,
    IEEE Trans. Autom. Control 45, 2000); it gives no more than they take here.  Between surfaces that are apart the
    bristles spring back, e' = -(stiffness / damping) e.
    """

    formula: ClassVar[str] = (
        r"F_t = -m \left(e + \frac{\sigma_1}{\sigma_0} \dot{e}\right) - F_n b v, \quad "
        r"m = \frac{F_n}{\max(\sqrt{F_n/\sigma_0}, |e|/c_s)}, \quad "
        r"\dot{e} = m v - \sigma_0 \frac{|v|}{c(v)} e"
    )
    joint_formula: ClassVar[str] = (
        r"F = -(\sigma_0 z + \sigma_1 \dot{z} + b v), \quad \dot{z} = v - \sigma_0 \frac{|v|}{c(v)} z"
    )
    dynamic: Expr = key(_DYNAMIC.replace(allowed=POSITIVE))
    stiffness: Expr = key(
        Scalar(
            "friction per deflection of the bristles", required=True, dimension=NONE.times(REACH, -1), allowed=POSITIVE
        )
    )
    damping: Expr = key(
        Scalar("friction per rate of the deflection", required=True, dimension=NONE.times(RATE, -1), allowed=POSITIVE)
    )
    viscous: Expr = key(_VISCOUS)
    static: Expr | None = key(_STATIC)
    stribeck: Expr | None = key(_STRIBECK)
    deflections: tuple[Expr, ...] = ()  #: states: z of a joint, e of a contact
    lateral: Vec3 | None = None

    def along(self, rate: Expr) -> Expr:
        (z,), (change,) = self.deflections, self.rates_along(rate)
        return self.stiffness * z + self.damping * change + self.viscous * rate

    def rates_along(self, rate: Expr) -> tuple[Expr, ...]:
        return (rate - self._decay(rate * rate, rate.graph.apply("abs", rate)) * self.deflections[0],)

    def in_plane(self, slip: Slip) -> Vec3:
        """Of states in the axes of the first surface; those along the normal have no effect."""
        _, bent, _, give, damped, power, loss = self._bristles(slip)
        gains = power.graph.apply("lt", loss + power, 0.0)
        damped = vec.scale(where(gains, -loss / where(gains, power, 1.0), 1.0), damped)
        bristles = vec.scale(1.0 / give, vec.add(bent, damped))
        return vec.add(bristles, vec.scale(self.viscous, slip.velocity))

    def rates_in_plane(self, slip: Slip) -> tuple[Expr, ...]:
        """Of its states, at one place of contact."""
        *drive, decay, push, _ = self.sums(slip)
        return self.rates_of((*drive, decay, push, decay.graph.zero))

    def sums(self, slip: Slip) -> tuple[Expr, ...]:
        """What one of several places of contact adds: m v, the decay times N, N, and the decay that damping needs."""
        graph, (push, bent, decay, give, _, power, _) = slip.push.graph, self._bristles(slip)
        velocity = vec.transpose_times(slip.axes_of_states(self.lateral), slip.velocity)
        gives = graph.apply("lt", power, 0.0)  # only bent bristles do
        stored = where(gives, vec.dot(bent, bent), 1.0)
        needed = where(gives, graph.apply("min", decay, -power / stored), 0.0)
        drive = (push / give * v for v, _ in zip(velocity, self.deflections, strict=False))
        return (*drive, push * decay, push, needed)

    def rates_of(self, sums: Sequence[Expr]) -> tuple[Expr, ...]:
        """Rates from what all places of contact add; the decay is the mean of theirs by their normal forces.

        So the power of all bristles is that of their energy and of the decay, which is never negative, nor less than
        what the damping gives.
        """
        *drive, decay, push, needed = sums
        touches = push.graph.apply("lt", 0.0, push)
        mean = push.graph.apply("max", decay / where(touches, push, 1.0), needed)
        return tuple(
            where(touches, rise - mean * e, back)
            for rise, e, back in zip(drive, self.deflections, self.rates_apart(), strict=True)
        )

    def rates_apart(self) -> tuple[Expr, ...]:
        relaxed = self.stiffness / self.damping
        return tuple(-relaxed * z for z in self.deflections)

    def mapped(self, change: Callable[[Expr], Expr]) -> LuGre:
        return replace(map_law(self, change), deflections=(), lateral=None)  # type: ignore[no-any-return]

    def holding(self, states: tuple[Expr, ...], lateral: Vec3 | None) -> LuGre:
        return replace(self, deflections=states, lateral=lateral)

    def _decay(self, squared: Expr, speed: Expr) -> Expr:
        return self.stiffness * speed / stribeck_level(squared, self.dynamic, self.static, self.stribeck)

    def _bristles(self, slip: Slip) -> tuple[Expr, Vec3, Expr, Expr, Vec3, Expr, Expr]:
        """In a contact: the normal force where it presses, the state, its decay, and what it is divided by.

        That is sqrt(N / stiffness), or more where the normal force does not hold it.  Then damping / stiffness e', its
        power, and what the decay and viscous friction take.
        """
        graph, v, squared = slip.push.graph, slip.velocity, vec.dot(slip.velocity, slip.velocity)
        push, bent = graph.apply("max", 0.0, slip.push), slip.across(self.deflections, self.lateral)
        decay = self._decay(squared, _size(v))
        most = self.dynamic if self.static is None else graph.apply("max", self.dynamic, self.static)
        root = sqrt(where(graph.apply("lt", 0.0, slip.push), slip.push, 1.0) / self.stiffness)
        give = graph.apply("max", root, _size(bent) / most)
        change = vec.sub(vec.scale(push / give, v), vec.scale(decay, bent))
        damped = vec.scale(self.damping / self.stiffness, change)
        loss = decay * vec.dot(bent, bent) + self.viscous * push * squared
        return push, bent, decay, give, damped, push / give * vec.dot(damped, v), loss


def _size(x: Vec3) -> Expr:
    """The length of a vector; its slope at 0 counts as 0."""
    return beyond_zero(vec.dot(x, x), sqrt)


# -- laws --------------------------------------------------------------------------------------------------------------


class SlidingFriction(LineFriction):
    """Friction that follows from the sliding velocity alone."""

    @abstractmethod
    def per_velocity(self, squared: Expr) -> Expr:
        """What times the velocity in a plane is the friction, of the velocity's square; smooth at rest."""

    def in_plane(self, slip: Slip) -> Vec3:
        return vec.scale(self.per_velocity(vec.dot(slip.velocity, slip.velocity)), slip.velocity)


class Friction(SlidingFriction):
    """Coulomb and Stribeck friction; what multiplies the direction of sliding, opposed to it.

    ``dynamic``, ``static`` and ``viscous`` are forces for a joint and parts of the normal force for a contact.

        c(v) = dynamic + (static - dynamic) exp(-(v / stribeck)^2)

    after Armstrong-Helouvry, Dupont and Canudas de Wit (1994), Automatica 30, 1083-1138, section 2.  ``static`` None
    means dynamic.  At rest friction is 0: a body on a slope creeps, at a part of the velocity ``smoothing``.
    """

    formula: ClassVar[str] = r"F_t = -F_n (\frac{c(v)}{\sqrt{v^2 + v_s^2}} + b) v"
    joint_formula: ClassVar[str] = r"F = -c(v) \mathrm{tanh}(v/v_s) - b v"
    dynamic: Expr = key(_DYNAMIC)
    smoothing: Expr = key(
        Scalar(
            "sliding velocity (m/s) below which friction is smoothed", required=True, dimension=RATE, allowed=POSITIVE
        )
    )
    viscous: Expr = key(_VISCOUS)
    static: Expr | None = key(_STATIC)
    stribeck: Expr | None = key(_STRIBECK)

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
    dynamic: Expr = key(_DYNAMIC)
    static: Expr = key(_STATIC.replace(doc="coefficient of static friction, the greatest; that of sliding by default"))
    transition: Expr = key(
        Scalar("velocity (m/s) near which friction is largest", required=True, dimension=RATE, allowed=POSITIVE)
    )
    viscous: Expr = key(_VISCOUS)

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


def has_bristles(values: Mapping[str, Any]) -> bool:
    """Whether an entry's law of friction has states."""
    law = values.get("friction")
    kind = law.get("type") if isinstance(law, Mapping) else values.get("friction_law")
    return isinstance(kind, str) and kind == BRISTLES


def _check_onset(e: Entry, values: dict[str, Any]) -> None:
    """Static friction with the Stribeck velocity, or neither."""
    if ("static" in e.values) != ("stribeck" in e.values):
        missing = "stribeck" if "static" in e.values else "static"
        e.missing(missing, "give static friction and stribeck together, or neither")
    _check_static(e, values)


def _check_static(e: Entry, values: dict[str, Any]) -> None:
    """Static friction is not below sliding friction."""
    if values["static"] is not None:
        phrases = "is {1:g}, below sliding friction {0:g}", "static is the greater"
        e.judge("static", LIMITS, [values["dynamic"], values["static"]], phrases)


def _check_greatest(e: Entry, values: dict[str, Any]) -> None:
    if values["static"] is None:
        values["static"] = values["dynamic"]
    _check_static(e, values)


def _check_bristles(e: Entry, values: dict[str, Any]) -> None:
    _check_onset(e, values)
    values["deflections"] = e.states()
    if "lateral" in e.fields:
        e["lateral"]


BRISTLES = "lugre"  #: the type that has states
#: Laws of dry friction, as parts of the normal force.
FRICTIONS = table(
    element(Friction, "coulomb", "smoothed, with the Stribeck effect if wanted.", check=_check_onset),
    element(BrownMcPhee, "brown_mcphee", "of continuous derivatives.", check=_check_greatest),
    element(LuGre, BRISTLES, "bristles that hold a body at rest.", check=_check_bristles),
)


def friction_key(types: Types, sole: str = "") -> Law:
    """The key of a law of friction of a contact; ``sole`` is what rigid bodies have of it."""
    flat = {"friction_law": "type", "friction": "dynamic", "static_friction": "static", "viscous_friction": "viscous"}
    bristles = {"bristle_stiffness": "stiffness", "bristle_damping": "damping"}
    return Law("law of friction", types, "coulomb", flat | bristles, sole=sole)


FRICTION = friction_key(FRICTIONS)


# -- by reactions ------------------------------------------------------------------------------------------------------


class ReactionFriction(PathForce):
    """Friction by the force that the joint carries: -[(c(v) + m(v) N) tanh(v / smoothing) + viscous v].

    m is the coefficient of ``by_load``.  N is the size of the reaction across the joint's axis; for an angle it is
    times the ``radius`` of the pin, and ``thrust_radius`` times the size of the reaction along the axis is added.
    """

    sentence = (
        "Friction in a joint that grows with the reaction $N$ of the joint: it opposes the rate $v$ of the "
        "coordinate; $v_s$ smooths its change of sign."
    )
    formula = r"F = -\left(c(v) + \mu(v) N\right) \mathrm{tanh}(v/v_s) - b v"
    by_reaction = True
    law: Friction
    joint: str
    by_load: Friction
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
        return -(self.law.along(rate) + self.by_load.level(rate * rate) * normal * direction)


#: Keys of friction by the joint's reaction.
BY_REACTION: Fields = {
    "coefficient": Scalar(
        "friction coefficient, times the joint reaction across the axis",
        level=LAW,
        dimension=NONE,
        allowed=NOT_NEGATIVE,
    ),
    "static_coefficient": Scalar(
        "the same at the onset of sliding; give stribeck too", level=LAW, dimension=NONE, allowed=NOT_NEGATIVE
    ),
    "radius": Scalar("radius of the pin (m), where the coordinate is an angle", dimension=LENGTH, allowed=POSITIVE),
    "thrust_radius": Scalar(
        "mean radius of the collar (m) on which the reaction along the axis rubs; none by default",
        dimension=LENGTH,
        allowed=POSITIVE,
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
    for one in ("transition", "bristle_stiffness", "bristle_damping"):
        e.refuse(one, "has no meaning beside coefficient")
    if "smoothing" not in e.values:
        e.missing("smoothing", "give the velocity (greater than 0) below which friction is smoothed")
        return None
    coefficient, onset, preload, breakaway = (e[x] for x in ("coefficient", "static_coefficient", "coulomb", "static"))
    if ("stribeck" in e.values) != (onset is not None or breakaway is not None):
        message = "is missing" if "stribeck" not in e.values else "is given without static_coefficient or static"
        remedy = "give stribeck together with static_coefficient or static, or none of them"
        e.fault("stribeck", message, remedy, "EG-MISSING")
        return None
    result = e["joint"] if path is not None else None
    if result is None or path is None or coefficient is None:
        return None
    if result.joint is None:
        message = f"{result.name!r} is not a coordinate of a joint, so it has no reaction"
        e.fault("joint", message, "give coulomb", "EG-REFERENCE")
        return None
    turns = result.kind == "angle"
    if turns and "radius" not in e.values:
        message = f"is missing, and {result.name!r} is an angle"
        e.fault("radius", message, "give the radius of the pin (m)", "EG-MISSING")
        return None
    for one in ("radius", "thrust_radius"):
        if one in e.values and not turns:
            e.fault(one, f"has no meaning: {result.name!r} is a length", f"leave {one} out")
            return None
    smoothing, stribeck, zero = e["smoothing"], e["stribeck"], e.graph.zero
    preload, along = (zero if x is None else x for x in (preload, viscous))
    law = Friction(preload, smoothing, along, breakaway, None if breakaway is None else stribeck)
    by_load = Friction(coefficient, smoothing, zero, onset, None if onset is None else stribeck)
    return ReactionFriction(e.name, path, law, result.joint, by_load, e["radius"], e["thrust_radius"])


# -- friction of a joint -----------------------------------------------------------------------------------------------


class JointFriction(PathForce):
    """Friction on a joint's coordinate of rate v (N or N m), such as -[c(v) tanh(v / smoothing) + viscous v].

    The tanh is the regularization of Andersson, Soderberg and Bjorklund (2007), Tribol. Int. 40, 580-587.  It does not
    depend on the joint's reactions; :class:`ReactionFriction` does.
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


#: Keys of laws of friction -> those of friction in a joint, which are forces or torques.
_IN_JOINT = {
    **{key: key for key in ("static", "stribeck", "smoothing", "viscous", "transition")},
    "type": "friction_law",
    "dynamic": "coulomb",
    "stiffness": "bristle_stiffness",
    "damping": "bristle_damping",
}


def _joint_friction(e: Entry) -> Force | None:
    path, viscous = read_coordinate(e), e["viscous"]
    if "coefficient" in e.values:
        return read_reaction_friction(e, path, viscous)
    for one in BY_REACTION:
        if one in e.values:
            e.fault(one, "is given without coefficient", f"give coefficient, or leave {one} out", "EG-MISSING")
    values = {key: e.values[name] for key, name in _IN_JOINT.items() if name in e.values}
    if "coulomb" not in e.values:
        for one in [_IN_JOINT[key] for key in values if key != "viscous"]:
            e.fault(one, "is given without coulomb", f"give coulomb, or leave {one} out", "EG-MISSING")
    else:
        law = e.as_law(FRICTION, e["friction_law"], values, e.path, _IN_JOINT)
        dry = law.element_type.read(law)
        return None if path is None or dry is None else JointFriction(e.name, path, dry)
    if viscous is None and not e.at_fault():
        remedy = "give viscous, coulomb with smoothing, coefficient with smoothing, or several"
        e.fault("", "has no friction law", remedy, "EG-MISSING")
    return None if path is None or viscous is None else Damper(e.name, path, viscous)


def _states(values: Mapping[str, Any]) -> dict[str, str]:
    return {"bristle": ""} if has_bristles(values) else {}


TYPES = table(
    ElementType(
        "friction",
        "friction on a joint's coordinate: viscous, Coulomb (with the Stribeck effect if wanted), by the reaction that "
        "the joint carries, or several of them.",
        {
            "joint": ON_JOINT.replace(required=True),
            "viscous": Scalar(
                "viscous coefficient (N m s/rad or N s/m)", level=LAW, dimension=DAMPING, allowed=NOT_NEGATIVE
            ),
            "coulomb": Scalar("Coulomb friction (N m or N)", level=LAW, dimension=PUSH, allowed=NOT_NEGATIVE),
            "static": Scalar(
                "static friction, at the onset of sliding (N m or N); give stribeck too",
                level=LAW,
                dimension=PUSH,
                allowed=NOT_NEGATIVE,
            ),
            **BY_REACTION,
            "stribeck": Scalar(
                "Stribeck velocity (rad/s or m/s): where static friction has largely dropped to Coulomb friction",
                dimension=RATE,
                allowed=POSITIVE,
            ),
            "smoothing": Scalar(
                "velocity below which Coulomb friction is smoothed (rad/s or m/s)", dimension=RATE, allowed=POSITIVE
            ),
            "friction_law": Choice(
                "law of friction: coulomb, the default, smoothed and with the Stribeck effect if wanted; brown_mcphee; "
                "lugre, bristles that hold a body at rest",
                default="coulomb",
                choices=tuple(FRICTIONS),
            ),
            "transition": Scalar(
                "velocity of friction_law brown_mcphee near which friction is largest", dimension=RATE
            ),
            "bristle_stiffness": Scalar(
                "friction of friction_law lugre per deflection of the bristles", dimension=STIFFNESS
            ),
            "bristle_damping": Scalar("friction of friction_law lugre per rate of the deflection", dimension=DAMPING),
        },
        _joint_friction,
        states=_states,
    )
)
