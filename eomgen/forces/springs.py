"""Force elements, springs and dampers: linear laws along a path or on an angle."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from ..elements.dimensions import DAMPING, ENERGY, LENGTH, NONE, REACH, STIFFNESS, TIME
from ..elements.element_type import ElementType, table
from ..elements.entry import Entry
from ..elements.kinds import LAW, Scalar
from ..elements.looks import COIL, DASHPOT, SPIRAL, TURNING_DASHPOT, Seen
from ..graph import vectors as vec
from ..graph.core import Expr
from ..records import dataclass
from .force import Force, Load, View
from .paths import BETWEEN, ON_JOINT, Line, Path, read_angle, read_coordinate
from .routes import VIA, read_path


@dataclass(frozen=True)
class Spring(Force):
    """Linear spring: generalized force -k (s - s0) along the path (k in N/m or N m/rad).

    The law is conservative while k and s0 depend on parameters only, which the description checks.
    """

    sentence: ClassVar[str] = (
        "A linear spring: its force along its path of length or angle $s$ is proportional to the stretch "
        "from $s_0$ (`rest`), with the stiffness $k$."
    )
    formula: ClassVar[str] = r"F = -k (s - s_0), \quad V = \frac{1}{2} k (s - s_0)^2"
    uses_value: ClassVar[bool] = True
    path: Path
    stiffness: Expr
    rest: Expr

    def loads(self, view: View) -> list[Load]:
        if isinstance(self.path, Line) and self.rest.is_zero:
            # linear in the distance, so that the markers may meet
            return self.path.pair(view, vec.scale(-self.stiffness, self.path.reach(view)))
        value, rate = self.path.measure(view)
        return self.path.loads(view, self.push(value, rate))

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
class Damper(Force):
    """Viscous damper: generalized force -c s' along the path (c in N s/m or N m s/rad)."""

    sentence: ClassVar[str] = (
        "A viscous damper: its force along its path is proportional to the rate of the length or angle $s$, "
        "with the factor $c$ (`damping`)."
    )
    formula: ClassVar[str] = r"F = -c \dot{s}"
    path: Path
    damping: Expr

    def loads(self, view: View) -> list[Load]:
        value, rate = self.path.measure(view)
        return self.path.loads(view, self.push(value, rate))

    def push(self, value: Expr, rate: Expr) -> Expr:
        return -self.damping * rate

    def drawn(self) -> list[Seen]:
        return [self.path.drawn(DASHPOT, TURNING_DASHPOT)]


_STIFFNESS = Scalar("stiffness (N/m or N m/rad)", required=True, dimension=STIFFNESS)
_TURNING_STIFFNESS = _STIFFNESS.replace(dimension=ENERGY)
_DAMPING = Scalar("damping (N s/m or N m s/rad)", required=True, level=LAW, dimension=DAMPING)
_TURNING_DAMPING = _DAMPING.replace(dimension=ENERGY.times(TIME))
_MARKERS = BETWEEN.replace(required=True)
_COORDINATE = ON_JOINT.replace(required=True)
_ANGLE = {"joint": ON_JOINT, "between": BETWEEN}


def _spring(path: Callable[[Entry], Path | None], rest: str) -> Callable[[Entry], Spring | None]:
    def read(e: Entry) -> Spring | None:
        where, stiffness, length = path(e), e["stiffness"], e[rest]
        return None if where is None else Spring(e.name, where, stiffness, length)

    return read


def _damper(path: Callable[[Entry], Path | None]) -> Callable[[Entry], Damper | None]:
    def read(e: Entry) -> Damper | None:
        where, damping = path(e), e["damping"]
        return None if where is None else Damper(e.name, where, damping)

    return read


TYPES = table(
    ElementType(
        "spring",
        "a linear spring between two markers, or along a path over markers and cylinders.",
        {
            "between": _MARKERS,
            "stiffness": _STIFFNESS,
            "length": Scalar("free length (m), at which the force is 0", default=0, dimension=LENGTH),
            "via": VIA,
        },
        _spring(read_path, "length"),
    ),
    ElementType(
        "damper",
        "a viscous damper between two markers, or along a path over markers and cylinders.",
        {"between": _MARKERS, "damping": _DAMPING, "via": VIA},
        _damper(read_path),
    ),
    ElementType(
        "torsional_spring",
        "a linear torsional spring on an angle: of a joint, or of the second marker about the z axis of the first.",
        {
            **_ANGLE,
            "stiffness": _TURNING_STIFFNESS,
            "angle": Scalar("angle (rad) at which the torque is 0", default=0, dimension=NONE),
        },
        _spring(read_angle, "angle"),
        one_of=("joint", "between"),
    ),
    ElementType(
        "torsional_damper",
        "a viscous torsional damper on an angle: of a joint, or of the second marker about the z axis of the first.",
        {**_ANGLE, "damping": _TURNING_DAMPING},
        _damper(read_angle),
        one_of=("joint", "between"),
    ),
    ElementType(
        "joint_spring",
        "a linear spring on one coordinate of a joint, an angle or a length.",
        {
            "joint": _COORDINATE,
            "stiffness": _STIFFNESS,
            "rest": Scalar("value of the coordinate (rad or m) at which the force is 0", default=0, dimension=REACH),
        },
        _spring(read_coordinate, "rest"),
    ),
    ElementType(
        "joint_damper",
        "a viscous damper on one coordinate of a joint, an angle or a length.",
        {"joint": _COORDINATE, "damping": _DAMPING},
        _damper(read_coordinate),
    ),
)
