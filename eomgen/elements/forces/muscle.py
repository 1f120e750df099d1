"""Force elements, a muscle with its tendon: the Hill-type model of De Groote and others, rigid tendon."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...base.value_rules import Allowed
from ...expr.core import Expr, sin, sqrt
from ...expr.records import dataclass
from ..dimensions import FORCE, LENGTH, NONE, SPEED, TIME
from ..element_type import ElementType, Entry, table
from ..kinds import LAW, Scalar
from ..looks import Seen
from .force import View
from .paths import BETWEEN, VIA, PathForce, read_path

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


@dataclass(frozen=True)
class Activation:
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


@dataclass(frozen=True)
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
    activation: Expr
    force_max: Expr
    fiber_length: Expr
    slack_length: Expr
    velocity_max: Expr
    pennation: Expr
    damping: Expr
    drive: Activation | None = None  #: of a muscle whose activation is a state of its own

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

    def drawn(self) -> list[Seen]:
        return [self.path.drawn()]

    def along(self, value: Expr, rate: Expr) -> Expr:
        return -self.tension(value, rate)


#: Optimal lengths of the fibres in which they shorten in a second, at most: De Groote and others (2016).
SHORTENING = 10.0


def _muscle(e: Entry) -> Muscle | None:
    path, drive = read_path(e), None
    if "excitation" in e.values:
        activation = e.states()[0]
        drive = Activation(e["excitation"], e.positive("activation_time"), e.positive("deactivation_time"))
        e.require("excitation", drive.excitation, Allowed(0.0, 1.0), "an excitation is 0 to 1")
    else:
        activation = e["activation"]
        e.require("activation", activation, Allowed(0.0, 1.0), "an activation is 0 to 1")
        for key in ("activation_time", "deactivation_time"):
            e.refuse(key, "has a meaning beside excitation only")
    force_max, fiber_length, slack_length = (e.positive(k) for k in ("force_max", "fiber_length", "slack_length"))
    velocity_max = e.positive("velocity_max") if "velocity_max" in e.values else SHORTENING * fiber_length
    pennation, damping = e["pennation"], e["damping"]
    e.require("pennation", pennation, Allowed(-1.5707, 1.5707, above=True, below=True), "must be less than pi/2")
    if path is None:
        return None
    sizes = (force_max, fiber_length, slack_length, velocity_max, pennation, damping)
    return Muscle(e.name, path, activation, *sizes, drive)


def _states(values: Mapping[str, Any]) -> dict[str, str]:
    return {"activation": ""} if "excitation" in values else {}


TYPES = table(
    ElementType(
        "muscle",
        "a Hill-type muscle with a rigid tendon (De Groote and others, 2016) from its origin to its insertion.",
        {
            "between": BETWEEN.replace(required=True),
            "activation": Scalar("activation of the muscle, 0 to 1", level=LAW, dimension=NONE),
            "force_max": Scalar("largest active force (N)", required=True, dimension=FORCE),
            "fiber_length": Scalar("optimal length of the fibres (m)", required=True, dimension=LENGTH),
            "slack_length": Scalar("length of the tendon (m)", required=True, dimension=LENGTH),
            "velocity_max": Scalar(
                "largest shortening velocity of the fibres (m/s); 10 fiber_length per second by default",
                dimension=SPEED,
            ),
            "pennation": Scalar(
                "angle of the fibres to the tendon at their optimal length (rad)", default=0, dimension=NONE
            ),
            "damping": Scalar("damping force at velocity_max, divided by force_max", default=0.1, dimension=NONE),
            "via": VIA,
            "excitation": Scalar(
                "instead of activation: what a state of the muscle, <name>_activation, follows, 0 to 1",
                level=LAW,
                dimension=NONE,
            ),
            "activation_time": Scalar("time in which it grows (s)", default=0.015, dimension=TIME),
            "deactivation_time": Scalar("time in which it dies away (s)", default=0.06, dimension=TIME),
        },
        _muscle,
        one_of=("activation", "excitation"),
        states=_states,
    )
)
