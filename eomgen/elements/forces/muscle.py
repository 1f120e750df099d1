"""Force elements, a muscle with its tendon: the Hill-type model of De Groote and others, rigid tendon."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...base.value_rules import POSITIVE, Allowed
from ...expr.core import Expr, sin, sqrt
from ...expr.records import Record
from ..dimensions import FORCE, LENGTH, NONE, SPEED, TIME
from ..element_type import Entry, element, key, table
from ..glyphs import Glyph
from ..kinds import LAW, Scalar
from .force import View
from .paths import LINE, Path, PathForce, read_path

# Constants of the curves: De Groote, Kinney, Rao and Fregly (2016), Evaluation of direct collocation optimal control
# problem formulations for solving the muscle redundancy problem, Ann. Biomed. Eng. 44, 2922-2936, supplement,
# rounded as there (docs/forces.md compares them with those of OpenSim).
_ACTIVE = ((0.814, 1.06, 0.162, 0.0633), (0.433, 0.717, -0.0299, 0.2), (0.1, 1.0, 0.354, 0.0))
_VELOCITY = (-0.318, -8.149, -0.374, 0.886)
_STRAIN, _SHAPE = 0.6, 4.0
SHARPNESS = 10.0  #: with which activation changes to deactivation


def active_force_length(length: Expr) -> Expr:
    """Active force over fibre length, both normalised: three bells exp(-((l - b2) / (b3 + b4 l))^2 / 2)."""
    total = length.graph.zero
    for height, middle, width, slope in _ACTIVE:
        x = (length - middle) / (width + slope * length)
        total = total + height * length.graph.apply("exp", -0.5 * (x * x))
    return total


def passive_force_length(length: Expr) -> Expr:
    """Passive force over fibre length, both normalised: (exp(4 (l - 1) / 0.6) - 1) / (exp(4) - 1)."""
    g = length.graph
    return (g.apply("exp", _SHAPE * (length - 1.0) / _STRAIN) - 1.0) / (g.apply("exp", _SHAPE) - 1.0)


def force_velocity(velocity: Expr) -> Expr:
    """Force over lengthening velocity, both normalised: d1 log(y + sqrt(y^2 + 1)) + d4, y = d2 v + d3."""
    d1, d2, d3, d4 = _VELOCITY
    y = d2 * velocity + d3
    return d1 * velocity.graph.apply("log", y + sqrt(y * y + 1.0)) + d4


class Activation(Record):
    """How the activation a follows the excitation e (De Groote and others, 2016, eq. 1 and 2).

    a' = [(h + 1/2) / (t_a (1/2 + 3 a / 2)) + (1/2 - h) (1/2 + 3 a / 2) / t_d] (e - a),  h = tanh(10 (e - a)) / 2
    """

    excitation: Expr
    activation_time: Expr
    deactivation_time: Expr

    def rate(self, activation: Expr) -> Expr:
        """The rate of the activation (1/s)."""
        apart = self.excitation - activation
        h, slow = 0.5 * activation.graph.apply("tanh", SHARPNESS * apart), 0.5 + 1.5 * activation
        return ((0.5 + h) / (self.activation_time * slow) + slow * (0.5 - h) / self.deactivation_time) * apart


class Muscle(PathForce):
    """A muscle and its rigid tendon, pulling the ends of its path together.

        tension = force_max [a fl(l) fv(v) + fp(l) + damping v] cos alpha

    with the fibre length l l_opt = sqrt((L - slack)^2 + (l_opt sin alpha_opt)^2) of the path's length L, its pennation
    cos alpha = (L - slack) / (l l_opt), and v velocity_max = L' cos alpha.  The activation a is an input, a first-order
    state or any expression; an elastic tendon is outside.  The thickness of the muscle, l_opt sin alpha_opt, stays.
    """

    sentence = (
        "A muscle with a rigid tendon pulls the ends of its path together; $a$ is the activation, $l$ and "
        r"$\dot{l}$ the length of its fibres and its rate, normalised."
    )
    formula = r"F = F_0 [a f_l(l) f_v(\dot{l}) + f_p(l)] \mathrm{cos}(\alpha)"
    uses_value = True
    drive: Activation | None  #: of a muscle whose activation is a state of its own
    activation: Expr = key(
        Scalar(
            "activation of the muscle, 0 to 1", level=LAW, dimension=NONE,
            allowed=Allowed(0.0, 1.0), remedy="an activation is 0 to 1",
        )
    )  # fmt: skip
    force_max: Expr = key(Scalar("largest active force (N)", required=True, dimension=FORCE, allowed=POSITIVE))
    fiber_length: Expr = key(
        Scalar("optimal length of the fibres (m)", required=True, dimension=LENGTH, allowed=POSITIVE)
    )
    slack_length: Expr = key(Scalar("length of the tendon (m)", required=True, dimension=LENGTH, allowed=POSITIVE))
    velocity_max: Expr = key(
        Scalar(
            "largest shortening velocity of the fibres (m/s); 10 fiber_length per second by default",
            dimension=SPEED, allowed=POSITIVE,
        )
    )  # fmt: skip
    pennation: Expr = key(
        Scalar(
            "angle of the fibres to the tendon at their optimal length (rad)", default=0, dimension=NONE,
            allowed=Allowed(-1.5707, 1.5707, above=True, below=True), remedy="must be less than pi/2",
        )
    )  # fmt: skip
    damping: Expr = key(Scalar("damping force at velocity_max, divided by force_max", default=0.1, dimension=NONE))

    def state_rates(self, view: View) -> tuple[Expr, ...]:
        return () if self.drive is None else (self.drive.rate(self.activation),)

    def tension(self, length: Expr, rate: Expr) -> Expr:
        """Pull of the tendon (N) from the length and the lengthening rate of the path."""
        along = length - self.slack_length
        if self.pennation.is_zero:
            fiber, tilt = along, length.graph.one
        else:
            thickness = self.fiber_length * sin(self.pennation)
            fiber = sqrt(along * along + thickness * thickness)
            tilt = along / fiber
        l, v = fiber / self.fiber_length, rate * tilt / self.velocity_max
        active = self.activation * active_force_length(l) * force_velocity(v)
        return self.force_max * (active + passive_force_length(l) + self.damping * v) * tilt

    def glyphs(self) -> list[Glyph]:
        return [self.path.glyphs()]

    def along(self, value: Expr, rate: Expr) -> Expr:
        return -self.tension(value, rate)


#: Optimal lengths of the fibres in which they shorten in a second, at most: De Groote and others (2016).
SHORTENING = 10.0


def _driven(e: Entry) -> tuple[Path, Activation | None] | None:
    path, drive = read_path(e), None
    if "excitation" in e.values:
        drive = Activation(*(e[one] for one in ("excitation", "activation_time", "deactivation_time")))
    else:
        for one in ("activation_time", "deactivation_time"):
            e.refuse(one, "has a meaning beside excitation only")
    return None if path is None else (path, drive)


def _complete(e: Entry, values: dict[str, Any]) -> None:
    if "excitation" in e.values:
        values["activation"] = e.states()[0]
    if values["velocity_max"] is None:
        values["velocity_max"] = SHORTENING * values["fiber_length"]


def _states(values: Mapping[str, Any]) -> dict[str, str]:
    return {"activation": ""} if "excitation" in values else {}


TYPES = table(
    element(
        Muscle,
        "muscle",
        "a Hill-type muscle with a rigid tendon (De Groote and others, 2016) from its origin to its insertion.",
        LINE._replace(read=_driven),
        more={
            "excitation": Scalar(
                "instead of activation: what a state of the muscle, <name>_activation, follows, 0 to 1",
                level=LAW,
                dimension=NONE,
                allowed=Allowed(0.0, 1.0),
                remedy="an excitation is 0 to 1",
            ),
            "activation_time": Scalar("time in which it grows (s)", default=0.015, dimension=TIME, allowed=POSITIVE),
            "deactivation_time": Scalar(
                "time in which it dies away (s)", default=0.06, dimension=TIME, allowed=POSITIVE
            ),
        },
        check=_complete,
        one_of=("activation", "excitation"),
        states=_states,
    )
)
