"""Constraint elements: wheels and convex shapes that roll on a plane without slip, blades that do not slip sideways.

The material point in contact has no velocity along the plane (Neimark and Fufaev, Dynamics of Nonholonomic Systems,
ch. I; Goldstein, Classical Mechanics, sec. 1.3): two equations that cannot be integrated, beside the height.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from ..elements.dimensions import LENGTH, NONE
from ..elements.element_type import ElementType, table
from ..elements.entry import Entry
from ..elements.field import Field
from ..elements.looks import Seen, Wheel
from ..frames import Marker
from ..graph import vectors as vec
from ..graph.core import Expr, sqrt
from ..graph.differentiate import gradient
from ..graph.substitute import substitute
from ..graph.vectors import Vec3
from ..records import dataclass
from .constraint import VELOCITY, Condition, Constraint, ConstraintView, on_two_bodies

#: What is wrong where the lowest point of a disc is not defined.
LYING = "the disc lies flat (axle along the plane's normal)"


@dataclass(frozen=True)
class _Rolling(Constraint):
    """A body that rolls on the x-y plane of marker ``plane``, on the side to which its z axis points."""

    sentence: ClassVar[str] = "The body touches the plane, and the point of contact does not slide."
    formula: ClassVar[str] = r"\mathbf{v} + \boldsymbol{\omega} \times \mathbf{d} = \mathbf{0}"
    wheel: Marker  #: centre; its z axis is that of the wheel
    plane: Marker
    radius: Expr

    def drawn(self) -> list[Seen]:
        return [Wheel(self.wheel, self.radius)]

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


def _normal(view: ConstraintView, plane: Marker) -> Vec3:
    return vec.transpose(view.rotation(plane))[2]


@dataclass(frozen=True)
class RollingDisc(_Rolling):
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
class RollingSphere(_Rolling):
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
class RollingConvex(_Rolling):
    """A smooth convex shape by its support function H(d), the distance of the tangent plane of outward normal d.

    H holds for vectors of any length, in proportion to it, so that the point of contact is grad H (R. Schneider, Convex
    Bodies (2014), sec. 1.7).  ``radius`` is that of the picture.
    """

    type_name: ClassVar[str] = "rolling_convex"
    direction: Vec3  #: symbols of d, in the axes of the wheel
    support: Expr

    def _at(self, view: ConstraintView, parts: Sequence[Expr]) -> list[Expr]:
        """Expressions of d where the normal points down to the plane."""
        down = [-x for x in view.relative(self.plane, self.wheel).rotation[2]]
        return substitute(parts, dict(zip(self.direction, down, strict=True)))

    def height(self, view: ConstraintView) -> Expr:
        return view.relative(self.plane, self.wheel).position[2] - self._at(view, [self.support])[0]

    def contact(self, view: ConstraintView) -> Vec3:
        x, y, z = self._at(view, gradient(self.support, self.direction))
        return vec.times(view.rotation(self.wheel), (x, y, z))

    def drawn(self) -> list[Seen]:
        return []


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


def _rolling(e: Entry) -> Constraint | None:
    shape, wheel, plane = e.choice("shape"), e.marker("wheel"), e.marker("plane")
    if shape in ("ellipsoid", "convex"):
        return _convex(e, shape, wheel, plane)
    for key in ("semi_axes", "support"):
        e.refuse(key, f"a {shape} has a radius")
    if "radius" not in e.values:
        e.fault("radius", "is missing", f"give the radius of the {shape} (m)")
        return None
    radius = e.positive("radius")
    if shape == "sphere":
        e.refuse("tube", "only a disc has an edge with a tube radius")
    else:
        e.refuse("no_spin", "only a sphere takes no_spin")
    if wheel is None or plane is None or not on_two_bodies(e, "plane", wheel, plane):
        return None
    if shape == "sphere":
        return RollingSphere(e.name, wheel, plane, radius, e.flag("no_spin"))
    return RollingDisc(e.name, wheel, plane, radius, e.law("tube"))


def _convex(e: Entry, shape: str, wheel: Marker | None, plane: Marker | None) -> Constraint | None:
    key = {"ellipsoid": "semi_axes", "convex": "support"}[shape]
    for other in ("radius", "tube", "no_spin", "semi_axes", "support"):
        if other != key:
            e.refuse(other, f"a shape that is {'an ellipsoid' if shape == 'ellipsoid' else shape} has no {other}")
    if key not in e.values:
        e.fault(key, "is missing", f"shape: {shape} needs it")
        return None
    d: Vec3 = tuple(e.graph.symbol(f"normal {axis} of {e.name}") for axis in "xyz")  # type: ignore[assignment]
    if shape == "ellipsoid":
        semi_axes = e.vector(key)
        for k, size in enumerate(semi_axes):
            e.require(f"{key}[{k}]", size, lambda x: x > 0, "must be greater than 0")
        support = sqrt(sum((a * a * x * x for a, x in zip(semi_axes, d, strict=True)), start=e.graph.zero))
    else:
        length = sqrt(vec.dot(d, d))
        unit = {f"n{axis}": x / length for axis, x in zip("xyz", d, strict=True)}
        support = length * e.law(key, unit)
    if wheel is None or plane is None or not on_two_bodies(e, "plane", wheel, plane):
        return None
    return RollingConvex(e.name, wheel, plane, e.graph.zero, d, support)


def _knife_edge(e: Entry) -> Constraint | None:
    marker, on, axis = e.marker("marker"), e.marker("on"), e.axis("axis")
    if marker is None or on is None or not on_two_bodies(e, "on", marker, on):
        return None
    return KnifeEdge(e.name, marker, axis, on)


TYPES = table(
    ElementType(
        "rolling",
        "a wheel, a ball or another convex shape that rolls on a plane without slip.",
        {
            "wheel": Field("marker", "marker at the centre of the wheel; z is the axle of a disc", required=True),
            "plane": Field(
                "marker", "marker in the plane; z is its normal and points to the wheel's side", default="ground"
            ),
            "radius": Field("expression", "radius of a disc or sphere (m)", dimension=LENGTH),
            "shape": Field(
                "choice", "shape of the wheel", default="disc", choices=("disc", "sphere", "ellipsoid", "convex")
            ),
            "tube": Field(
                "expression",
                "radius of the rounded edge of a disc (m), 0 for a sharp edge",
                default=0,
                dimension=LENGTH,
            ),
            "semi_axes": Field("vector", "of an ellipsoid: its half axes along x, y and z (m)", dimension=LENGTH),
            "support": Field(
                "expression",
                "of a convex shape: distance from the marker to the tangent plane of outward normal nx, ny, nz (m)",
                dimension=LENGTH,
                local={
                    f"n{axis}": Field("expression", f"{axis} of the outward normal", dimension=NONE) for axis in "xyz"
                },
            ),
            "no_spin": Field(
                "flag", "whether the sphere is kept from spinning about the plane's normal", default=False
            ),
        },
        _rolling,
    ),
    ElementType(
        "knife_edge",
        "a blade: a marker that cannot move sideways, along one of its own axes.",
        {
            "marker": Field("marker", "marker at the point where the blade touches", required=True),
            "axis": Field("axis", "direction in which the marker cannot move, in its own axes", default="y"),
            "on": Field("marker", "the body on which the blade moves", default="ground"),
        },
        _knife_edge,
    ),
)
