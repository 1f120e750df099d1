"""Constraint elements: wheels, balls and smooth convex bodies that roll without slip, and blades."""

from __future__ import annotations

import math
from abc import abstractmethod

from ...base.value_rules import POSITIVE, SUPPORT
from ...expr import vectors as vec
from ...expr.core import Expr, cos, sin, sqrt, substitute
from ...expr.differentiate import jvp
from ...expr.vectors import Vec3
from ..dimensions import LENGTH, NONE
from ..element_type import ElementType, Entry, element, key
from ..frames import Marker, velocity_at
from ..glyphs import Contour, Glyph, Wheel
from ..kinds import Axis, Choice, Flag, MarkerReference, Scalar, Vector
from .constraint import VELOCITY, Condition, Constraint, ConstraintView, on_two_bodies, switchable

# -- supports ----------------------------------------------------------------------------------------------------------

# Continued by H(k n) = k H(n), a support is that of a convex body where H is convex. On unit normals its radii of
# curvature are the eigenvalues of f_nn + (f - f_n . n) I across n, with the derivatives of any formula f that agrees
# with H there (Schneider, Convex Bodies, 2014, section 2.5). Where both vanish the body has a corner, about which it
# would turn; where one does it has an edge, on which it rolls as a thin disc does.


def require_convex(e: Entry, support: Expr, local: Vec3) -> None:
    """Note a fault of a support that is not convex, as far as the values of parameters tell."""
    slopes = [_along(support, local, k) for k in range(3)]
    bends = [_along(slope, local, k) for slope in slopes for k in range(3)]
    e.judge("support", SUPPORT, [support, *slopes, *bends], local=[str(x.node[1]) for x in local])


def _along(x: Expr, local: Vec3, k: int) -> Expr:
    graph = x.graph
    return jvp([x], {symbol: graph.one if i == k else graph.zero for i, symbol in enumerate(local)})[0]


# -- wheels, balls and blades ------------------------------------------------------------------------------------------

# The material point in contact has no velocity along the plane (Neimark and Fufaev, Dynamics of Nonholonomic Systems,
# ch. I; Goldstein, Classical Mechanics, sec. 1.3): two equations that cannot be integrated, beside the height.


#: What is wrong where the lowest point of a disc is not defined.
LYING = "the disc lies flat (axle along the plane's normal)"


class Rolling(Constraint):
    """A body that rolls on the x-y plane of marker ``plane``, on the side to which its z axis points."""

    sentence = "The body touches the plane, and the point of contact does not slide."
    formula = r"\mathbf{v} + \boldsymbol{\omega} \times \mathbf{d} = \mathbf{0}"
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
        v = velocity_at(view, self.wheel, arm)
        floor = velocity_at(view, self.plane, vec.sub(point, view.position(self.plane)))
        x, y, _ = vec.transpose_times(view.rotation(self.plane), vec.sub(v, floor))
        return [
            Condition("height", self.height(view), "length"),
            Condition("slip_x", x, "length", VELOCITY),
            Condition("slip_y", y, "length", VELOCITY),
        ]


class Wheeled(Rolling):
    """A body of one radius."""

    radius: Expr

    def glyphs(self) -> list[Glyph]:
        return [Wheel(self.wheel, self.radius)]


def _normal(view: ConstraintView, plane: Marker) -> Vec3:
    return vec.transpose(view.rotation(plane))[2]


class RollingDisc(Wheeled):
    """A disc or wheel: a circle about the wheel's z axis, rounded by a tube of radius ``tube`` (0 for a sharp edge).

    With n the normal, a the axle and s = |n - (n.a) a| the sine of the angle between them, the centre is
    (radius - tube) s + tube above the plane.  The wheel may lean but not lie down (s > 0).
    """

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
        n, lateral, s = self._lean(view)
        rim = vec.scale((self.tube - self.radius) / s, lateral)
        return vec.sub(rim, vec.scale(self.tube, n))


class RollingSphere(Wheeled):
    """A ball about the marker's origin; with ``no_spin`` it does not turn about the normal either."""

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


class KnifeEdge(Constraint):
    """A blade, or a small wheel upright on its plane: the marker does not move along ``axis`` of its own axes.

    The velocity is taken relative to the body of ``on`` (Chaplygin's sleigh; Neimark and Fufaev, ch. II).
    """

    sentence = r"The marker does not move along one of its axes $\mathbf{n}$."
    formula = r"\mathbf{n}^T \mathbf{v} = 0"
    marker: Marker = key(MarkerReference("marker at the point where the blade touches", required=True))
    axis: Vec3 = key(Axis("direction in which the marker cannot move, in its own axes", default="y"))
    on: Marker = key(MarkerReference("the body on which the blade moves", default="ground"))

    def conditions(self, view: ConstraintView) -> list[Condition]:
        sideways = vec.times(view.rotation(self.marker), self.axis)
        under = velocity_at(view, self.on, vec.sub(view.position(self.marker), view.position(self.on)))
        slip = vec.dot(sideways, vec.sub(view.velocity(self.marker), under))
        return [Condition("slip", slip, "length", VELOCITY)]


# -- convex bodies -----------------------------------------------------------------------------------------------------

# The support H(n) of a convex body is the distance, from its centre, of the plane of normal n that touches it. That
# plane touches it at the gradient of H, continued from unit vectors to all by H(k n) = k H(n): at h n + (g - (g . n)
# n), where h and g are the value and the gradient of any formula that holds on unit vectors (Schneider, Convex Bodies,
# 2014, section 1.7). Of an ellipsoid H = sqrt(a^2 n_x^2 + b^2 n_y^2 + c^2 n_z^2).


NORMAL = ("nx", "ny", "nz")  #: what a formula of a support calls the components of the normal


class RollingConvex(Rolling):
    """A body whose support is a formula of the outward normal in the axes of marker ``wheel``, at its centre."""

    support: Expr
    local: Vec3  #: symbols of the formula

    def _down(self, view: ConstraintView) -> Vec3:
        """The outward normal at the lowest point, body axes."""
        x, y, z = view.relative(self.plane, self.wheel).rotation[2]
        return -x, -y, -z

    def _touching(self, n: Vec3) -> tuple[Expr, Vec3]:
        """The support and the point of a normal, body axes."""
        slopes = [_along(self.support, self.local, k) for k in range(3)]
        h, x, y, z = substitute([self.support, *slopes], dict(zip(self.local, n, strict=True)))
        along = vec.dot((x, y, z), n)
        return h, vec.add(vec.scale(h - along, n), (x, y, z))

    def height(self, view: ConstraintView) -> Expr:
        above = view.relative(self.plane, self.wheel).position[2]
        return above - self._touching(self._down(view))[0]

    def contact(self, view: ConstraintView) -> Vec3:
        return vec.times(view.rotation(self.wheel), self._touching(self._down(view))[1])

    def glyphs(self) -> list[Glyph]:
        """Where planes that contain two of its axes touch it."""
        graph = self.support.graph
        angle = graph.symbol(f"normal of {self.name}")
        c, s, zero = cos(angle), sin(angle), graph.zero
        rings = ((c, s, zero), (zero, c, s), (s, zero, c))
        return [Contour(self.wheel, self._touching(n)[1], angle, 0.0, 2.0 * math.pi) for n in rings]


def ellipsoid_support(local: Vec3, semi_axes: Vec3) -> Expr:
    """The support of an ellipsoid about its centre."""
    products = [a * n for a, n in zip(semi_axes, local, strict=True)]
    return sqrt(vec.dot((products[0], products[1], products[2]), (products[0], products[1], products[2])))


# -- entries -----------------------------------------------------------------------------------------------------------


#: Shape -> what several are called, the key that it needs, and another that it has.
_SHAPES = {
    "disc": ("discs", "radius", "tube"),
    "sphere": ("spheres", "radius", "no_spin"),
    "ellipsoid": ("ellipsoids", "semi_axes"),
    "convex": ("convex shapes", "support"),
}


def _rolling(e: Entry) -> Constraint | None:
    shape, wheel, plane = e["shape"], e["wheel"], e["plane"]
    if shape in _SHAPES:
        for own in dict.fromkeys(key for _, *keys in _SHAPES.values() for key in keys):
            if own not in _SHAPES[shape]:
                e.refuse(
                    own, f"only {' and '.join(plural for plural, *keys in _SHAPES.values() if own in keys)} have it"
                )
        if (needed := _SHAPES[shape][1]) not in e.values:
            e.missing(needed, f"needed where shape is {shape}")
    if wheel is None or plane is None or e.at_fault() or not on_two_bodies(e, "plane", wheel, plane):
        return None
    if shape == "sphere":
        return RollingSphere(e.name, wheel, plane, e["radius"], e["no_spin"])
    if shape == "disc":
        return RollingDisc(e.name, wheel, plane, e["radius"], e["tube"])
    symbols = {name: e.graph.symbol(f"{name} of {e.name}") for name in NORMAL}
    local = (symbols["nx"], symbols["ny"], symbols["nz"])
    if shape == "convex":
        support = e.law("support", symbols)
        if not e.at_fault():
            require_convex(e, support, local)
        return RollingConvex(e.name, wheel, plane, support, local)
    for k, x in enumerate(semi_axes := e["semi_axes"]):
        e.require(f"semi_axes[{k}]", x, POSITIVE, "must be greater than 0")
    return RollingConvex(e.name, wheel, plane, ellipsoid_support(local, semi_axes), local)


TYPES = switchable(
    ElementType(
        "rolling",
        "a wheel, ball or smooth convex body that rolls on a plane without slip.",
        {
            "wheel": MarkerReference("marker at the centre of the wheel; z is the axle of a disc", required=True),
            "plane": MarkerReference(
                "marker in the plane; z is its normal and points to the wheel's side", default="ground"
            ),
            "radius": Scalar("radius of a disc or a sphere (m)", dimension=LENGTH, allowed=POSITIVE),
            "shape": Choice("shape of the wheel", default="disc", choices=tuple(_SHAPES)),
            "tube": Scalar("radius of the rounded edge of a disc (m), 0 for a sharp edge", default=0, dimension=LENGTH),
            "no_spin": Flag("whether the sphere is kept from spinning about the plane's normal", default=False),
            "semi_axes": Vector("semi-axes of an ellipsoid along x, y and z (m)", dimension=LENGTH),
            "support": Scalar(
                "of a smooth convex body: the distance (m), from the marker, of the plane that touches it with the "
                "outward normal [nx, ny, nz] in the marker's axes",
                dimension=LENGTH,
                local={name: Scalar("", dimension=NONE) for name in NORMAL},
            ),
        },
        _rolling,
    ),
    element(
        KnifeEdge,
        "knife_edge",
        "a blade: a marker that cannot move sideways, along one of its own axes.",
        check=lambda e, values: on_two_bodies(e, "on", values["marker"], values["on"]),
    ),
)
