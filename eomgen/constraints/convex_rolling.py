"""Constraint elements: smooth convex bodies that roll on a plane without slip, by their support functions.

The support H(n) of a convex body is the distance, from its centre, of the plane of normal n that touches it.  That
plane touches it at the gradient of H, continued from unit vectors to all by H(k n) = k H(n): at h n + (g - (g . n) n),
where h and g are the value and the gradient of any formula that holds on unit vectors (Schneider, Convex Bodies, 2014,
section 1.7).  Of an ellipsoid H = sqrt(a^2 n_x^2 + b^2 n_y^2 + c^2 n_z^2).
"""

from __future__ import annotations

import math
from typing import ClassVar

from ..elements.looks import Contour, Seen
from ..graph import vectors as vec
from ..graph.core import Expr, cos, sin, sqrt
from ..graph.differentiate import jvp
from ..graph.substitute import substitute
from ..graph.vectors import Vec3
from ..records import dataclass
from .constraint import ConstraintView
from .rolling import Rolling

NORMAL = ("nx", "ny", "nz")  #: what a formula of a support calls the components of the normal


@dataclass(frozen=True)
class RollingConvex(Rolling):
    """A body whose support is a formula of the outward normal in the axes of marker ``wheel``, at its centre."""

    type_name: ClassVar[str] = "rolling_convex"
    support: Expr
    local: Vec3  #: symbols of the formula

    def _down(self, view: ConstraintView) -> Vec3:
        """The outward normal at the lowest point, body axes."""
        x, y, z = view.relative(self.plane, self.wheel).rotation[2]
        return -x, -y, -z

    def _touching(self, n: Vec3) -> tuple[Expr, Vec3]:
        """The support and the point of a normal, body axes."""
        graph = self.support.graph
        zero, one = graph.zero, graph.one
        slopes = [
            jvp([self.support], {x: one if i == k else zero for i, x in enumerate(self.local)})[0] for k in range(3)
        ]
        h, x, y, z = substitute([self.support, *slopes], dict(zip(self.local, n, strict=True)))
        along = vec.dot((x, y, z), n)
        return h, vec.add(vec.scale(h - along, n), (x, y, z))

    def height(self, view: ConstraintView) -> Expr:
        above = view.relative(self.plane, self.wheel).position[2]
        return above - self._touching(self._down(view))[0]

    def contact(self, view: ConstraintView) -> Vec3:
        return vec.times(view.rotation(self.wheel), self._touching(self._down(view))[1])

    def drawn(self) -> list[Seen]:
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
