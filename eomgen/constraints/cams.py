"""Constraint elements: cam and follower, by a law of lift or by contact with the cam's contour.

Contact is bilateral: the follower is held to the cam (a groove, a spring that never lets go).  Polar coordinates of
the contour are those of the cam's marker: theta from its x axis about its z axis, which is the cam's axis.  In the axes
(e_r, e_theta) of the contact point the contour r(theta) has the tangent (r', r) and the outward normal (r, -r') over
sqrt(r^2 + r'^2) (Norton, Cam Design and Manufacturing Handbook, ch. 7; Litvin and Fuentes, Gear Geometry, sec. 1.6).
"""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

from ..frames import Frame, Marker
from ..graph.core import Expr, atan2, sqrt
from ..records import dataclass
from .base import Condition, Constraint, View
from .profiles import Profile


@dataclass(frozen=True)
class CamLift(Constraint):
    """The follower's coordinate is a given function of the cam's: s = lift(theta - phase)."""

    type_name: ClassVar[str] = "cam"
    written: ClassVar[bool] = True
    cam: Expr
    follower: Expr
    lift: Profile
    phase: Expr
    kind: str

    def conditions(self, view: View) -> list[Condition]:
        return [Condition("lift", self.follower - self.lift.at(self.cam - self.phase), self.kind)]


@dataclass(frozen=True)
class KnifeContact(Constraint):
    """The follower marker's origin lies on the contour: |p| = r(theta of p), p in the cam's axes."""

    type_name: ClassVar[str] = "cam_knife_edge"
    cam: Marker
    follower: Marker
    contour: Profile

    def conditions(self, view: View) -> list[Condition]:
        x, y, _ = view.relative(self.cam, self.follower).position
        return [Condition("contact", sqrt(x * x + y * y) - self.contour.toward(x, y), "length")]


@dataclass(frozen=True)
class FlatSupport(Constraint):
    """A flat face touches a cam given by its support function: n . p = h(theta of n), p a point of the face.

    n is the z axis of the follower's marker, which points away from the cam; h(theta) is the distance from the cam's
    axis to the tangent whose outward normal points to theta (for a convex cam h + h'' > 0 is its radius of curvature).
    """

    type_name: ClassVar[str] = "cam_support"
    cam: Marker
    follower: Marker
    support: Profile

    def conditions(self, view: View) -> list[Condition]:
        face = view.relative(self.cam, self.follower)
        n_x, n_y = face.rotation[0][2], face.rotation[1][2]
        x, y, _ = face.position
        return [Condition("contact", n_x * x + n_y * y - self.support.toward(n_x, n_y), "length")]


@dataclass(frozen=True)
class _Contact(Constraint):
    """Contact at a point of the contour whose polar angle is unknown: ``angle``, the turn of marker ``point``.

    ``point`` is fixed to a body without mass that turns about the cam's axis by that angle.
    """

    cam: Marker
    follower: Marker
    contour: Profile
    point: Marker
    angle: Expr

    def polar(self, view: View) -> tuple[Expr, Expr, Frame]:
        """r, r' and the follower's marker in the axes (e_r, e_theta, axis) of the contact point."""
        r, slope = self.contour.at(self.angle), self.contour.slope(self.angle)
        return r, slope, view.relative(self.point, self.follower)

    def hints(self, view: View) -> list[tuple[Expr, Expr]]:
        x, y = self.toward(view.relative(self.cam, self.follower))
        return [(self.angle, atan2(y, x))]

    @abstractmethod
    def toward(self, follower: Frame) -> tuple[Expr, Expr]:
        """The direction in which contact is to be looked for, in the axes in which the follower is given."""


@dataclass(frozen=True)
class RollerContact(_Contact):
    """A roller of radius R whose centre is the follower's marker: p = r e_r + R n."""

    type_name: ClassVar[str] = "cam_roller"
    radius: Expr

    def toward(self, follower: Frame) -> tuple[Expr, Expr]:
        return follower.position[0], follower.position[1]

    def conditions(self, view: View) -> list[Condition]:
        r, slope, follower = self.polar(view)
        x, y, _ = follower.position
        reach = self.radius / sqrt(r * r + slope * slope)
        return [
            Condition("contact_r", x - r - reach * r, "length"),
            Condition("contact_theta", y + reach * slope, "length"),
        ]


@dataclass(frozen=True)
class FlatContact(_Contact):
    """A flat face through the follower's marker, normal to its z axis n, which points away from the cam.

    The contact point lies in the face, n . (p - r e_r) = 0, and the contour is tangent to it, n . (r' e_r + r e_theta)
    = 0; of the two sides of the cam, the one that n points out of.
    """

    type_name: ClassVar[str] = "cam_flat_face"

    def toward(self, follower: Frame) -> tuple[Expr, Expr]:
        return follower.rotation[0][2], follower.rotation[1][2]

    def conditions(self, view: View) -> list[Condition]:
        r, slope, face = self.polar(view)
        n_r, n_theta = face.rotation[0][2], face.rotation[1][2]
        x, y, _ = face.position
        return [
            Condition("touch", n_r * (x - r) + n_theta * y, "length"),
            Condition("tangent", n_r * slope + n_theta * r, "length"),
        ]

    def aligned(self, view: View) -> list[Expr]:
        r, slope, face = self.polar(view)
        return [r * face.rotation[0][2] - slope * face.rotation[1][2]]
