"""Constraint elements: wheels and balls that roll on a plane without slip, and blades that do not slip sideways.

The material point in contact has no velocity along the plane (Neimark and Fufaev, Dynamics of Nonholonomic Systems,
ch. I; Goldstein, Classical Mechanics, sec. 1.3): two equations that cannot be integrated, beside the height.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

from ..elements.looks import Seen, Wheel
from ..frames import Marker
from ..graph import vectors as vec
from ..graph.core import Expr, sqrt
from ..graph.vectors import Vec3
from ..records import dataclass
from .constraint import VELOCITY, Condition, Constraint, ConstraintView

#: What is wrong where the lowest point of a disc is not defined.
LYING = "the disc lies flat (axle along the plane's normal)"


@dataclass(frozen=True)
class Rolling(Constraint):
    """A body that rolls on the x-y plane of marker ``plane``, on the side to which its z axis points."""

    sentence: ClassVar[str] = "The body touches the plane, and the point of contact does not slide."
    formula: ClassVar[str] = r"\mathbf{v} + \boldsymbol{\omega} \times \mathbf{d} = \mathbf{0}"
    wheel: Marker  #: centre; its z axis is that of a disc
    plane: Marker

    @abstractmethod
    def height(self, view: ConstraintView) -> Expr:
        """Distance of the lowest point from the plane (m)."""

    @abstractmethod
    def contact(self, view: ConstraintView) -> Vec3:
        """From the centre to the lowest point, ground axes (m)."""

    def conditions(self, view: ConstraintView) -> list[Condition]:
        arm = self.contact(view)
        point = vec.add(view.position(self.wheel), arm)
        v = vec.add(view.velocity(self.wheel), vec.cross(view.angular_velocity(self.wheel), arm))
        beside = vec.sub(point, view.position(self.plane))
        floor = vec.add(view.velocity(self.plane), vec.cross(view.angular_velocity(self.plane), beside))
        x, y, _ = vec.transpose_times(view.rotation(self.plane), vec.sub(v, floor))
        return [
            Condition("height", self.height(view), "length"),
            Condition("slip_x", x, "length", VELOCITY),
            Condition("slip_y", y, "length", VELOCITY),
        ]


@dataclass(frozen=True)
class Wheeled(Rolling):
    """A body of one radius."""

    radius: Expr

    def drawn(self) -> list[Seen]:
        return [Wheel(self.wheel, self.radius)]


def _normal(view: ConstraintView, plane: Marker) -> Vec3:
    return vec.transpose(view.rotation(plane))[2]


@dataclass(frozen=True)
class RollingDisc(Wheeled):
    """A disc or wheel: a circle about the wheel's z axis, rounded by a tube of radius ``tube`` (0 for a sharp edge).

    With n the normal, a the axle and s = |n - (n.a) a| the sine of the angle between them, the centre is
    (radius - tube) s + tube above the plane.  The wheel may lean but not lie down (s > 0).
    """

    type_name: ClassVar[str] = "rolling_disc"
    tube: Expr

    def _lean(self, view: ConstraintView) -> tuple[Vec3, Vec3, Expr]:
        """Normal, its part across the axle, and the length of that part."""
        n = _normal(view, self.plane)
        axle = vec.transpose(view.rotation(self.wheel))[2]
        along = view.relative(self.plane, self.wheel).rotation[2][2]
        return n, vec.sub(n, vec.scale(along, axle)), sqrt(1.0 - along * along)

    def lies_flat(self, view: ConstraintView) -> bool:
        """Whether the axle is along the normal at every position."""
        return self._lean(view)[2].is_zero

    def height(self, view: ConstraintView) -> Expr:
        _, _, s = self._lean(view)
        above = view.relative(self.plane, self.wheel).position[2]
        return above - (self.radius - self.tube) * s - self.tube

    def contact(self, view: ConstraintView) -> Vec3:
        n, across, s = self._lean(view)
        rim = vec.scale((self.tube - self.radius) / s, across)
        return vec.sub(rim, vec.scale(self.tube, n))


@dataclass(frozen=True)
class RollingSphere(Wheeled):
    """A ball about the marker's origin; with ``no_spin`` it does not turn about the normal either."""

    type_name: ClassVar[str] = "rolling_sphere"
    no_spin: bool = False

    def height(self, view: ConstraintView) -> Expr:
        return view.relative(self.plane, self.wheel).position[2] - self.radius

    def contact(self, view: ConstraintView) -> Vec3:
        return vec.scale(-self.radius, _normal(view, self.plane))

    def conditions(self, view: ConstraintView) -> list[Condition]:
        rows = super().conditions(view)
        if self.no_spin:
            turning = vec.sub(view.angular_velocity(self.wheel), view.angular_velocity(self.plane))
            rows.append(Condition("spin", vec.dot(_normal(view, self.plane), turning), "angle", VELOCITY))
        return rows


@dataclass(frozen=True)
class KnifeEdge(Constraint):
    """A blade, or a small wheel upright on its plane: the marker does not move along ``axis`` of its own axes.

    The velocity is taken relative to the body of ``on`` (Chaplygin's sleigh; Neimark and Fufaev, ch. II).
    """

    sentence: ClassVar[str] = r"The marker does not move along one of its axes $\mathbf{n}$."
    formula: ClassVar[str] = r"\mathbf{n}^T \mathbf{v} = 0"
    type_name: ClassVar[str] = "knife_edge"
    marker: Marker
    axis: Vec3  #: unit vector, marker axes
    on: Marker

    def conditions(self, view: ConstraintView) -> list[Condition]:
        sideways = vec.times(view.rotation(self.marker), self.axis)
        apart = vec.sub(view.position(self.marker), view.position(self.on))
        under = vec.add(view.velocity(self.on), vec.cross(view.angular_velocity(self.on), apart))
        slip = vec.dot(sideways, vec.sub(view.velocity(self.marker), under))
        return [Condition("slip", slip, "length", VELOCITY)]
