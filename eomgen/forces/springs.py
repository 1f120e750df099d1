"""Force elements, their laws: springs, dampers, actuators along a path; forces and torques on a body."""

from __future__ import annotations

from typing import ClassVar

from ..frames import Marker
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.vectors import Vec3
from ..records import dataclass
from .base import Force, Load, MarkerLoad, View
from .paths import Line, Path


@dataclass(frozen=True)
class Spring(Force):
    """Linear spring: generalized force -k (s - s0) along the path (k in N/m or N m/rad).

    The law is conservative while k and s0 depend on parameters only, which the description checks.
    """

    type_name: ClassVar[str] = "spring"
    uses_value: ClassVar[bool] = True
    path: Path
    stiffness: Expr
    rest: Expr

    def loads(self, view: View) -> list[Load]:
        if isinstance(self.path, Line) and self.rest.is_zero:
            # linear in the distance, so that the markers may meet
            return self.path.pair(view, vec.scale(-self.stiffness, self.path.reach(view)))
        value, _ = self.path.measure(view)
        return self.path.loads(view, -self.stiffness * (value - self.rest))

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

    type_name: ClassVar[str] = "damper"
    path: Path
    damping: Expr

    def loads(self, view: View) -> list[Load]:
        _, rate = self.path.measure(view)
        return self.path.loads(view, -self.damping * rate)


@dataclass(frozen=True)
class Actuator(Force):
    """A given generalized force along the path: positive pushes markers apart or drives the coordinate (N or N m)."""

    type_name: ClassVar[str] = "actuator"
    path: Path
    value: Expr

    def loads(self, view: View) -> list[Load]:
        return self.path.loads(view, self.value)


def _in_ground_axes(view: View, marker: Marker, value: Vec3, axes: str) -> Vec3:
    return vec.times(view.rotation(marker), value) if axes == "body" else value


@dataclass(frozen=True)
class PointForce(Force):
    """A force at a marker's origin, given in ground axes or in the marker's own (``axes="body"``) (N)."""

    type_name: ClassVar[str] = "force"
    marker: Marker
    value: Vec3
    axes: str = "ground"

    def loads(self, view: View) -> list[Load]:
        force = _in_ground_axes(view, self.marker, self.value, self.axes)
        return [MarkerLoad(self.marker, force, vec.zero(view.graph))]


@dataclass(frozen=True)
class BodyTorque(Force):
    """A torque on a body, given in ground axes or in the marker's own (``axes="body"``) (N m)."""

    type_name: ClassVar[str] = "torque"
    marker: Marker
    value: Vec3
    axes: str = "ground"

    def loads(self, view: View) -> list[Load]:
        torque = _in_ground_axes(view, self.marker, self.value, self.axes)
        return [MarkerLoad(self.marker, vec.zero(view.graph), torque)]
