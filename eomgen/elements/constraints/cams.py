"""Constraint elements: cam and follower, by a law of lift or by contact with the cam's contour."""

from __future__ import annotations

import math
from abc import abstractmethod

import numpy as np

from ...base.limits.numbers import ZERO
from ...base.value_rules import POSITIVE
from ...expr.core import Expr, atan2, cos, sin, sqrt, substitute, symbols_of
from ...expr.differentiate import jvp
from ...expr.evaluate import evaluate
from ...expr.records import Record
from ..dimensions import LENGTH, NONE, REACH
from ..element_type import ElementType, Entry, table
from ..frames import Frame, Marker
from ..glyphs import Contour, Glyph, LiftCurve, Wheel
from ..kinds import Choice, Flag, JointReference, Latex, MarkerReference, Name, Scalar
from .constraint import Condition, Constraint, ConstraintView, on_two_bodies

# -- laws of lift ------------------------------------------------------------------------------------------------------


TRIALS = 5


class Profile(Record):
    """f(theta), theta from 0 to a full turn; ``local`` is the symbol that stands for theta in ``expression``.

    Beyond one turn it repeats if ``periodic``: theta then is brought back to [0, 2 pi], unless the expression repeats
    of itself.
    """

    expression: Expr
    local: Expr
    periodic: bool = True

    def at(self, angle: Expr) -> Expr:
        """f(angle)."""
        return self._put(self.expression, angle)

    def slope(self, angle: Expr) -> Expr:
        """f'(angle)."""
        return self._put(jvp([self.expression], {self.local: self.local.graph.one})[0], angle)

    def toward(self, x: Expr, y: Expr) -> Expr:
        """f at the direction of (x, y)."""
        return self._insert(self.expression, atan2(-y, -x) + math.pi)

    def _put(self, expression: Expr, angle: Expr) -> Expr:
        if self.periodic and not self.repeats():
            angle = atan2(-sin(angle), -cos(angle)) + math.pi
        return self._insert(expression, angle)

    def _insert(self, expression: Expr, angle: Expr) -> Expr:
        return substitute([expression], {self.local: angle})[0]

    def over_a_turn(self) -> tuple[list[Expr], str] | None:
        """Value and slope, which close after a turn, and the name of their angle; None where they need not."""
        if not self.periodic:
            return None
        (name,) = symbols_of([self.local])
        return [self.expression, *jvp([self.expression], {self.local: self.local.graph.one})], name

    def repeats(self) -> bool:
        """Whether the expression repeats every turn of itself, tried at random values of all symbols."""
        (name,) = symbols_of([self.local])
        others = sorted(symbols_of([self.expression]) - {name})
        random = np.random.default_rng(5)
        theta = np.concatenate([random.uniform(-7.0, 7.0, TRIALS), np.linspace(0.0, 6.2, 2 * TRIALS)])
        for _ in range(2):
            values = dict(zip(others, random.uniform(0.2, 1.4, len(others)).tolist(), strict=True))
            with np.errstate(all="ignore"):
                here, there, back = (
                    np.broadcast_to(evaluate([self.expression], values | {name: theta + k * math.tau})[0], theta.shape)
                    for k in (0, 1, -1)
                )
            size = float(np.abs(here).max())
            if not all(bool((np.abs(x - here) <= ZERO * size).all()) for x in (there, back)):
                return False
        return True


# -- cams --------------------------------------------------------------------------------------------------------------

# Contact is bilateral: the follower is held to the cam (a groove, a spring that never lets go). Polar coordinates of
# the contour are those of the cam's marker: theta from its x axis about its z axis, which is the cam's axis. In the
# axes (e_r, e_theta) of the contact point the contour r(theta) has the tangent (r', r) and the outward normal (r, -r')
# over sqrt(r^2 + r'^2) (Norton, Cam Design and Manufacturing Handbook, ch. 7; Litvin and Fuentes, Gear Geometry, sec.
# 1.6).


#: The name that stands for the angle in profiles of cams.
CAM_ANGLE = "theta"


class CamLift(Constraint):
    """The follower's coordinate is a given function of the cam's: s = lift(theta - phase)."""

    sentence = "The coordinate of the follower is a given function of the angle of the cam."
    formula = r"s = f(\theta - \theta_0)"
    type_name = "cam"
    written = True
    cam: Expr
    follower: Expr
    lift: Profile
    phase: Expr
    kind: str

    def glyphs(self) -> list[Glyph]:
        return [LiftCurve(self.cam, self.follower, self.lift.expression, self.lift.local, self.phase)]

    def conditions(self, view: ConstraintView) -> list[Condition]:
        return [Condition("lift", self.follower - self.lift.at(self.cam - self.phase), self.kind)]


class OnContour(Constraint):
    """A follower that is held to the contour r(theta) about the axis of a cam."""

    face = False  #: whether the follower has a flat face across its z axis
    cam: Marker
    follower: Marker
    contour: Profile

    def glyphs(self) -> list[Glyph]:
        a, r = self.contour.local, self.contour.expression
        point = (r * cos(a), r * sin(a), a.graph.zero)
        return [Contour(self.cam, point, a, 0.0, 2.0 * math.pi, self.follower, self.face)]


class KnifeContact(OnContour):
    """The follower marker's origin lies on the contour: |p| = r(theta of p), p in the cam's axes."""

    sentence = "The tip of the follower lies on the contour of the cam."
    formula = r"|\mathbf{p}| = r(\theta)"
    type_name = "cam_knife_edge"

    def conditions(self, view: ConstraintView) -> list[Condition]:
        x, y, _ = view.relative(self.cam, self.follower).position
        return [Condition("contact", sqrt(x * x + y * y) - self.contour.toward(x, y), "length")]


class FlatSupport(Constraint):
    """A flat face touches a cam given by its support function: n . p = h(theta of n), p a point of the face.

    n is the z axis of the follower's marker, which points away from the cam; h(theta) is the distance from the cam's
    axis to the tangent whose outward normal points to theta (for a convex cam h + h'' > 0 is its radius of curvature).
    """

    sentence = r"A flat face with the normal $\mathbf{n}$ touches the cam."
    formula = r"\mathbf{n}^T \mathbf{p} = h(\theta)"
    type_name = "cam_support"
    cam: Marker
    follower: Marker
    support: Profile

    def glyphs(self) -> list[Glyph]:
        """The envelope of the tangents: h n + h' t."""
        a, h = self.support.local, self.support.expression
        slope = self.support.slope(a)
        x, y = h * cos(a) - slope * sin(a), h * sin(a) + slope * cos(a)
        return [Contour(self.cam, (x, y, a.graph.zero), a, 0.0, 2.0 * math.pi, self.follower, True)]

    def conditions(self, view: ConstraintView) -> list[Condition]:
        face = view.relative(self.cam, self.follower)
        n_x, n_y = face.rotation[0][2], face.rotation[1][2]
        x, y, _ = face.position
        return [Condition("contact", n_x * x + n_y * y - self.support.toward(n_x, n_y), "length")]


class _Contact(OnContour):
    """Contact at a point of the contour whose polar angle is unknown: ``angle``, the turn of marker ``point``.

    ``point`` is fixed to a body without mass that turns about the cam's axis by that angle.
    """

    sentence = r"The follower touches the contour of the cam at the polar angle $\theta$."
    formula = r"\mathbf{p} = r(\theta) \mathbf{e}_r"
    point: Marker
    angle: Expr

    def polar(self, view: ConstraintView) -> tuple[Expr, Expr, Frame]:
        """r, r' and the follower's marker in the axes (e_r, e_theta, axis) of the contact point."""
        r, slope = self.contour.at(self.angle), self.contour.slope(self.angle)
        return r, slope, view.relative(self.point, self.follower)

    def hints(self, view: ConstraintView) -> list[tuple[Expr, Expr]]:
        x, y = self.toward(view.relative(self.cam, self.follower))
        return [(self.angle, atan2(y, x))]

    @abstractmethod
    def toward(self, follower: Frame) -> tuple[Expr, Expr]:
        """The direction in which contact is to be looked for, in the axes in which the follower is given."""


class RollerContact(_Contact):
    """A roller of radius R whose centre is the follower's marker: p = r e_r + R n."""

    type_name = "cam_roller"
    radius: Expr

    def glyphs(self) -> list[Glyph]:
        return [*super().glyphs(), Wheel(self.follower, self.radius)]

    def toward(self, follower: Frame) -> tuple[Expr, Expr]:
        return follower.position[0], follower.position[1]

    def conditions(self, view: ConstraintView) -> list[Condition]:
        r, slope, follower = self.polar(view)
        x, y, _ = follower.position
        reach = self.radius / sqrt(r * r + slope * slope)
        return [
            Condition("contact_r", x - r - reach * r, "length"),
            Condition("contact_theta", y + reach * slope, "length"),
        ]


class FlatContact(_Contact):
    """A flat face through the follower's marker, normal to its z axis n, which points away from the cam.

    The contact point lies in the face, n . (p - r e_r) = 0, and the contour is tangent to it, n . (r' e_r + r e_theta)
    = 0; of the two sides of the cam, the one that n points out of.
    """

    type_name = "cam_flat_face"
    face = True

    def toward(self, follower: Frame) -> tuple[Expr, Expr]:
        return follower.rotation[0][2], follower.rotation[1][2]

    def conditions(self, view: ConstraintView) -> list[Condition]:
        r, slope, face = self.polar(view)
        n_r, n_theta = face.rotation[0][2], face.rotation[1][2]
        x, y, _ = face.position
        return [
            Condition("touch", n_r * (x - r) + n_theta * y, "length"),
            Condition("tangent", n_r * slope + n_theta * r, "length"),
        ]

    def aligned(self, view: ConstraintView) -> list[Expr]:
        r, slope, face = self.polar(view)
        return [r * face.rotation[0][2] - slope * face.rotation[1][2]]


def _profile(e: Entry, key: str, turns: bool = True) -> Profile:
    local = e.graph.symbol(f"{CAM_ANGLE} of {e.name}")
    return Profile(e.law(key, {CAM_ANGLE: local}, exclusive=False), local, e["periodic"] and turns)


def _cam(e: Entry) -> CamLift | None:
    turning, follower = e["cam"], e["follower"]
    if turning is None or follower is None:
        return None
    if turning.name == follower.name:
        e.fault("follower", f"{follower.name!r} is the cam's own coordinate", "name another", "EG-REFERENCE")
        return None
    for key, result in (("cam", turning), ("follower", follower)):
        if result.kind not in ("angle", "length"):
            message = f"the coordinate {result.name!r} is neither an angle nor a length"
            remedy = "name an angle or a length; with rotation: euler_angles a joint has angles"
            e.fault(key, message, remedy, "EG-REFERENCE")
    if e.values.get("periodic") is True and turning.kind == "length":
        message = f"the cam slides ({turning.name!r} is a length), so its profile has no turn to repeat after"
        remedy = "leave it out, or write the repetition into lift, as with sin(2*pi*theta/l)"
        e.fault("periodic", message, remedy, "EG-REFERENCE")
    if e.at_fault():
        return None
    lift = _profile(e, "lift", turning.kind == "angle")
    return CamLift(e.name, e.symbol(turning), e.symbol(follower), lift, e["phase"], follower.kind)


def _cam_contact(e: Entry) -> Constraint | None:
    shape, axis, follower = e["shape"], e["cam"], e["follower"]
    on_two_bodies(e, "follower", axis, follower)
    if e.at_fault("shape"):
        return None
    if shape != "roller":
        e.refuse("radius", f"a follower of shape {shape} has no radius")
    elif "radius" not in e.values:
        e.missing("radius", "give the radius of the roller")
    if "support" in e.values and shape != "flat_face":
        e.fault("support", "only a flat face takes a support function", "give the contour r(theta) instead")
    if shape == "knife_edge" or "support" in e.values:
        for key in ("coordinate", "latex"):
            e.refuse(key, "the contact point of this follower needs no coordinate of its own")
    if axis is None or follower is None or e.at_fault():
        return None
    profile = _profile(e, "support" if "support" in e.values else "contour")
    if "support" in e.values:
        return FlatSupport(e.name, axis, follower, profile)
    if shape == "knife_edge":
        return KnifeContact(e.name, axis, follower, profile)
    contact: tuple[Marker, Expr] | None = e.reader.contact_point(e, axis)
    if contact is None:
        return None
    if shape == "roller":
        return RollerContact(e.name, axis, follower, profile, *contact, e["radius"])
    return FlatContact(e.name, axis, follower, profile, *contact)


_TURN = {CAM_ANGLE: Scalar("", dimension=NONE)}
_PERIODIC = Flag(
    "whether the profile repeats every turn; if so, value and slope at 2 pi must equal those at 0", default=True
)
_JOINT = JointReference("a joint of one degree, or a coordinate", required=True)

TYPES = table(
    ElementType(
        "cam",
        "a cam with a given lift: the follower's coordinate is a function of the cam's angle.",
        {
            "cam": _JOINT.replace(doc="joint of the cam"),
            "follower": _JOINT.replace(doc="joint of the follower"),
            "lift": Scalar(
                "the follower's coordinate as an expression of theta, the cam's angle minus the phase (0 to 2 pi)",
                required=True,
                dimension=REACH,
                along="follower",
                local={CAM_ANGLE: Scalar("", dimension=REACH, along="cam")},
            ),
            "phase": Scalar("the cam's angle where theta is 0 (rad)", default=0, dimension=REACH, along="cam"),
            "periodic": _PERIODIC,
        },
        _cam,
    ),
    ElementType(
        "cam_contact",
        "a follower that stays in contact with the contour of a plane cam.",
        {
            "cam": MarkerReference("marker on the cam: z is its axis, polar angles count from x", required=True),
            "follower": MarkerReference(
                "marker at the tip, at the centre of the roller, or on the flat face with z away from the cam",
                required=True,
            ),
            "shape": Choice("shape of the follower", required=True, choices=("knife_edge", "roller", "flat_face")),
            "contour": Scalar(
                "radius r(theta) of the contour at the polar angle theta (m)", dimension=LENGTH, local=_TURN
            ),
            "support": Scalar(
                "for a flat face: support function h(theta), distance of the axis from the tangent whose normal points "
                "at theta (m)",
                dimension=LENGTH,
                local=_TURN,
            ),
            "radius": Scalar("radius of the roller (m)", dimension=LENGTH, allowed=POSITIVE),
            "coordinate": Name("name of the polar angle of the contact point (<name>_contact)", holds="coordinate"),
            "latex": Latex("how formulas and plots print that angle, in LaTeX (from its name unless given)"),
            "periodic": _PERIODIC,
        },
        _cam_contact,
        one_of=("contour", "support"),
    ),
)
