"""Force elements, springs and dampers: linear laws along a path or on an angle."""

from __future__ import annotations

from ...base.records import dataclass
from ...expr import vectors as vec
from ...expr.core import Expr
from ..dimensions import DAMPING, ENERGY, LENGTH, NONE, REACH, STIFFNESS, TIME
from ..element_type import element, key, keys_of, table
from ..kinds import LAW, Scalar
from ..looks import COIL, DASHPOT, SPIRAL, TURNING_DASHPOT, Seen
from .force import Load, View
from .paths import ANGLE, COORDINATE, LINE, Line, PathForce


@dataclass(frozen=True)
class Spring(PathForce):
    """Linear spring: generalized force -k (s - s0) along the path (k in N/m or N m/rad).

    The law is conservative while k and s0 depend on parameters only, which the description checks.
    """

    sentence = (
        "A linear spring: its force along its path of length or angle $s$ is proportional to the stretch "
        "from $s_0$ (`rest`), with the stiffness $k$."
    )
    formula = r"F = -k (s - s_0), \quad V = \frac{1}{2} k (s - s_0)^2"
    uses_value = True
    stiffness: Expr = key(Scalar("stiffness (N/m or N m/rad)", required=True, dimension=STIFFNESS))
    rest: Expr = key(Scalar("value of the coordinate (rad or m) at which the force is 0", default=0, dimension=REACH))

    def loads(self, view: View) -> list[Load]:
        if isinstance(self.path, Line) and self.rest.is_zero:
            # linear in the distance, so that the markers may meet
            return self.path.pair(view, vec.scale(-self.stiffness, self.path.reach(view)))
        return super().loads(view)

    def push(self, value: Expr, rate: Expr) -> Expr:
        return -self.stiffness * (value - self.rest)

    def drawn(self) -> list[Seen]:
        return [self.path.drawn(COIL, SPIRAL)]

    def potential(self, view: View) -> Expr | None:
        if not self.path.is_exact(view):
            return None  # the loads are the definition
        if isinstance(self.path, Line) and self.rest.is_zero:
            reach = self.path.reach(view)
            return 0.5 * self.stiffness * vec.dot(reach, reach)
        value, _ = self.path.measure(view)
        stretch = value - self.rest
        return 0.5 * self.stiffness * (stretch * stretch)


@dataclass(frozen=True)
class Damper(PathForce):
    """Viscous damper: generalized force -c s' along the path (c in N s/m or N m s/rad)."""

    sentence = (
        "A viscous damper: its force along its path is proportional to the rate of the length or angle $s$, "
        "with the factor $c$ (`damping`)."
    )
    formula = r"F = -c \dot{s}"
    damping: Expr = key(Scalar("damping (N s/m or N m s/rad)", required=True, level=LAW, dimension=DAMPING))

    def push(self, value: Expr, rate: Expr) -> Expr:
        return -self.damping * rate

    def drawn(self) -> list[Seen]:
        return [self.path.drawn(DASHPOT, TURNING_DASHPOT)]


_TURNING_STIFFNESS = keys_of(Spring)["stiffness"].replace(dimension=ENERGY)
_TURNING_DAMPING = keys_of(Damper)["damping"].replace(dimension=ENERGY.times(TIME))
_LENGTH = Scalar("free length (m), at which the force is 0", default=0, dimension=LENGTH)
_ANGLE = Scalar("angle (rad) at which the torque is 0", default=0, dimension=NONE)

TYPES = table(
    element(
        Spring,
        "spring",
        "a linear spring between two markers, or along a path over markers and cylinders.",
        LINE,
        {"stiffness": keys_of(Spring)["stiffness"], "length": _LENGTH},
    ),
    element(
        Damper, "damper", "a viscous damper between two markers, or along a path over markers and cylinders.", LINE
    ),
    element(
        Spring,
        "torsional_spring",
        "a linear torsional spring on an angle: of a joint, or of the second marker about the z axis of the first.",
        ANGLE,
        {"stiffness": _TURNING_STIFFNESS, "angle": _ANGLE},
    ),
    element(
        Damper,
        "torsional_damper",
        "a viscous torsional damper on an angle: of a joint, or of the second marker about the z axis of the first.",
        ANGLE,
        {"damping": _TURNING_DAMPING},
    ),
    element(Spring, "joint_spring", "a linear spring on one coordinate of a joint, an angle or a length.", COORDINATE),
    element(Damper, "joint_damper", "a viscous damper on one coordinate of a joint, an angle or a length.", COORDINATE),
)
