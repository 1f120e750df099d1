"""Force elements of wheels: creep on a rail; a tyre on a plane road, whose slips build up as states."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

from ...base.limits.numbers import NO_SLIP
from ...base.value_rules import NOT_NEGATIVE, POSITIVE
from ...expr import vectors as vec
from ...expr.core import Expr, sqrt
from ...expr.records import Record
from ...expr.vectors import Vec3
from ..dimensions import DAMPING, FORCE, LENGTH, NONE, SPEED, STIFFNESS, TIME
from ..element_type import Entry, Where, element, key, keys_of, table
from ..frames import Marker, velocity_at
from ..glyphs import PLANE, Drawn, Glyph, Wheel
from ..kinds import LAW, Axis, Choice, Flag, Pair, Radii, Scalar
from .force import Force, Load, MarkerLoad, Measured, View, beyond_zero, where, with_reaction
from .normal_laws import DampedLinear

LAWS = ("linear", "vermeulen_johnson", "polach")
_FACTOR = Scalar("", level=LAW, dimension=FORCE)


class Creep(Force):
    """Forces by which a rolling wheel creeps on its track, from the velocity of the wheel where it touches.

    With the creepages x = v_x / V, y = v_y / V and the spin p = w_z / V they are -f11 x, -f22 y - f23 p and a moment
    f23 y - f33 p (J. J. Kalker, Three-Dimensional Elastic Bodies in Rolling Contact (1990), sec. 2.2).  Where the
    normal force N and the coefficient m are given, forces and moment are reduced in one proportion, so that the size
    of the force, F without it, is at most m N:

    - m N [1 - (1 - F / (3 m N))^3] (P. J. Vermeulen, K. L. Johnson, J. Appl. Mech. 31 (1964), 338-340);
    - (2 m N / pi) [e / (1 + e^2) + arctan e], e = pi F / (4 m N) (O. Polach, Vehicle System Dynamics, Supplement 33
      (2000), 728-739).
    """

    sentence = "A rolling wheel creeps on its track; $\\xi$ are its velocities divided by the speed of rolling."
    formula = r"F_x = -f_{11} \xi_x, \quad F_y = -f_{22} \xi_y - f_{23} \varphi"
    not_finite_where = "its speed of rolling is 0: give it a speed that does not vanish at rest"
    track: Marker  #: x along it, z its normal, to the side of the wheel
    wheel: Marker  #: on the axle
    radius: Expr = key(
        Scalar(
            "rolling radius (m), which may change with the place",
            required=True, level=LAW, dimension=LENGTH, allowed=POSITIVE,
        )
    )  # fmt: skip
    longitudinal: Expr = key(_FACTOR.replace(doc="creep coefficient f11 (N)", required=True, allowed=NOT_NEGATIVE))
    lateral: Expr = key(_FACTOR.replace(doc="creep coefficient f22 (N)", required=True, allowed=NOT_NEGATIVE))
    lateral_spin: Expr = key(
        _FACTOR.replace(doc="creep coefficient f23 (N m)", default=0, dimension=FORCE.times(LENGTH))
    )
    spin: Expr = key(_FACTOR.replace(doc="creep coefficient f33 (N m^2)", default=0, dimension=FORCE.times(LENGTH, 2)))
    speed: Expr | None = key(
        Scalar(
            "by which velocities are divided (m/s); that of the wheel's marker along the track unless given",
            level=LAW, dimension=SPEED,
        )
    )  # fmt: skip
    law: str = key(Choice("how the forces saturate", default="linear", choices=LAWS))
    normal: Expr | None = key(_FACTOR.replace(doc="normal force (N), such as -multiplier(roll.height)"))
    friction: Expr | None = key(Scalar("coefficient of friction", level=LAW, dimension=NONE, allowed=NOT_NEGATIVE))

    def _slip(self, view: View) -> tuple[Vec3, Expr, Expr, Vec3]:
        """Velocity of the wheel on the track where they touch, spin, speed of rolling (track axes), and the arm."""
        axes = view.rotation(self.track)
        arm = vec.scale(-self.radius, vec.transpose(axes)[2])
        centre = view.position(self.wheel)
        origin = view.position(self.track)
        under = velocity_at(view, self.track, vec.sub(vec.add(centre, arm), origin))
        slip = vec.transpose_times(axes, vec.sub(velocity_at(view, self.wheel, arm), under))
        sliding = vec.sub(view.velocity(self.wheel), velocity_at(view, self.track, vec.sub(centre, origin)))
        rolling = vec.transpose_times(axes, sliding)[0]
        turning = vec.sub(view.angular_velocity(self.wheel), view.angular_velocity(self.track))
        spin = vec.transpose_times(axes, turning)[2]
        speed = view.graph.apply("abs", rolling) if self.speed is None else self.speed
        return slip, spin, speed, arm

    def _kept(self, size: Expr) -> Expr:
        """What is left of forces whose size without saturation is given, from 1 to 0."""
        graph = size.graph
        if self.normal is None or self.friction is None:
            return graph.one
        most = graph.apply("max", 0.0, self.friction * self.normal)
        presses = graph.apply("lt", 0.0, most)
        if self.law == "polach":

            def kept(F: Expr) -> Expr:
                e = math.pi / 4.0 * F / where(presses, most, 1.0)
                return 2.0 / math.pi * most / F * (e / (1.0 + e * e) + graph.apply("atan", e))

            slides = graph.apply("lt", 0.0, size)
            return where(slides, kept(where(slides, size, 1.0)), where(presses, 1.0, 0.0))
        slides = graph.apply("le", 3.0 * most, size)
        b = size / where(presses, most, 1.0)
        full = where(presses, most, 0.0) / where(graph.apply("lt", 0.0, size), size, 1.0)
        return where(slides, full, 1.0 - b / 3.0 + b * b / 27.0)

    def loads(self, view: View) -> list[Load]:
        slip, turning, speed, arm = self._slip(view)
        x, y, p = (part / speed for part in (slip[0], slip[1], turning))
        first, second = -(self.longitudinal * x), -(self.lateral * y) - self.lateral_spin * p
        kept = self._kept(beyond_zero(first * first + second * second, sqrt))
        axes, zero = view.rotation(self.track), view.graph.zero
        force = vec.times(axes, (kept * first, kept * second, zero))
        moment = vec.times(axes, (zero, zero, kept * (self.lateral_spin * y - self.spin * p)))
        point = vec.sub(vec.add(view.position(self.wheel), arm), view.position(self.track))
        still = vec.zero(view.graph)
        back, turned = vec.sub(still, force), vec.sub(still, vec.add(moment, vec.cross(point, force)))
        return [
            MarkerLoad(self.wheel, force, vec.add(moment, vec.cross(arm, force))),
            MarkerLoad(self.track, back, turned),
        ]


def _check_saturation(e: Entry, values: dict[str, Any]) -> None:
    law = values["law"]
    for needed in ("normal", "friction"):
        if law == "linear":
            e.refuse(needed, "the linear law does not saturate")
        elif needed not in e.values:
            e.missing(needed, f"the law {law} needs the normal force and the coefficient of friction")


_ENDS = "the track (x along it, z its normal, to the side of the wheel) and a marker on the wheel's axle"

TYPES = table(
    element(
        Creep,
        "creep",
        "creep forces of a rolling wheel on its track (Kalker; Vermeulen and Johnson; Polach).",
        Where({"between": Pair(_ENDS, required=True)}, Entry.pair),
        {"creep_law" if name == "law" else name: field for name, field in keys_of(Creep).items()},
        check=_check_saturation,
        ends=("track", "wheel"),
    )
)


# -- laws of tyres -----------------------------------------------------------------------------------------------------

# Slips have the sign of the motion of the tread over the road: forces oppose them. A tyre rolls backwards as its mirror
# image, fore and aft exchanged, rolls forwards; a way between -1 and 1 blends both around a standstill.


MOST = 3.0  #: slip up to which measured curves are followed, that of an angle of 72 degrees


class Slips(NamedTuple):
    """Longitudinal slip V_sx / |V_x|, tangent of the slip angle V_sy / |V_x|, camber (rad), way of the wheel."""

    along: Expr
    across: Expr
    camber: Expr
    way: Expr  #: 1 forwards, -1 backwards, 0 at rest

    def size(self) -> Expr:
        """Of both together, 0 where there is next to none."""
        square = self.along * self.along + self.across * self.across
        some = square.graph.apply("lt", NO_SLIP * NO_SLIP, square)
        return where(some, sqrt(where(some, square, 1.0)), 0.0)


class TyreForces(NamedTuple):
    """What a law gives."""

    along: Expr  #: at the radius of rolling about the axle (N)
    across: Expr  #: (N)
    aligning: Expr  #: moment about the normal (N m)
    drag: Expr  #: along the wheel as well, of rolling resistance: without a moment about the axle (N)


class TyreLaw(Record, ABC):
    """Forces of a tyre; ``formula`` says them in LaTeX."""

    formula: ClassVar[str]

    @abstractmethod
    def slides(self, slips: Slips, load: Expr) -> Expr:
        """Whether the tyre slides as a whole, so that its deflections grow no more."""

    @abstractmethod
    def forces(self, slips: Slips, load: Expr) -> TyreForces:
        """Forces along and across the wheel and the moment about the normal at a load above 0."""

    def gradients(self, slips: Slips, load: Expr) -> tuple[Expr, Expr] | None:
        """Growth of the force with the slip, across it and along it, as parts of that without slip.

        None where the law cannot say how a tread and a carcass share the deflections.
        """
        return None


class Brush(TyreLaw):
    """The brush model of one stiffness in all directions.

    With theoretical slips s = V_s / |Omega R|, here (kappa, tan alpha) / |1 - w kappa|, and theta = C / (3 mu F_z)

        F = -mu F_z (1 - (1 - theta |s|)^3) s / |s| for theta |s| < 1, else -mu F_z s / |s|
        M_z = -w t F_y,  t = (a / 3) (1 - r)^3 / (1 - r + r^2 / 3), r = theta |s|

    w the way of the wheel: the longest bristles are behind, so that the moment turns the wheel into its motion.

    After Pacejka, Tyre and Vehicle Dynamics (2nd edition, 2006), section 3.2, where C = 2 c_p a^2.
    """

    formula: ClassVar[str] = (
        r"F = -\mu F_z (1 - (1 - \theta s)^3), \quad \theta = \frac{C}{3 \mu F_z}, \quad s < \frac{1}{\theta}"
    )
    stiffness: Expr
    friction: Expr
    half: Expr | None

    def slides(self, slips: Slips, load: Expr) -> Expr:
        """Beyond |s| = 1 / theta; where driving takes more than twice that as kappa = -s / (1 - s), at twice."""
        return load.graph.apply("le", *self._filled(slips, load))

    def _filled(self, slips: Slips, load: Expr) -> tuple[Expr, Expr]:
        """|1 - w kappa|, at most 2, and theta |s| of the slips by V_x; all slides where the second is the greater."""
        turning = load.graph.apply("min", 2.0, load.graph.apply("abs", 1.0 - slips.way * slips.along))
        return turning, self.stiffness / (3.0 * self.friction * load) * slips.size()

    def forces(self, slips: Slips, load: Expr) -> TyreForces:
        graph = load.graph
        kappa, tangent = slips.along, slips.across
        size = slips.size()
        sliding = graph.apply("lt", 0.0, size)
        rolling = 1.0 - slips.way * kappa  # Omega R / V_x
        turning = graph.apply("max", NO_SLIP, graph.apply("abs", rolling))
        most = self.friction * load
        theta = self.stiffness / (3.0 * most)
        r = theta * size / turning
        adheres = graph.apply("lt", r, 1.0)
        s = where(adheres, r, 1.0)
        slope = where(adheres, most * theta * (3.0 - 3.0 * s + s * s) / turning, most / where(sliding, size, 1.0))
        along, lateral = -slope * kappa, -slope * tangent
        if self.half is None:
            return TyreForces(along, lateral, graph.zero, graph.zero)
        rest = 1.0 - s
        trail = self.half / 3.0 * rest * rest * rest / (rest + s * s / 3.0)
        onwards = where(graph.apply("lt", rolling, 0.0), -slips.way, slips.way)  # the tread's, not the wheel's
        return TyreForces(along, lateral, -onwards * trail * lateral, graph.zero)

    def gradients(self, slips: Slips, load: Expr) -> tuple[Expr, Expr]:
        """1 - r + r^2 / 3 across and (1 - r)^2 along, by |1 - w kappa|; where all slides 1 / (3 theta |s|) and 0."""
        turning, filled = self._filled(slips, load)
        adheres = load.graph.apply("lt", filled, turning)
        part = where(adheres, turning, 1.0)
        r = where(adheres, filled / part, 0.0)
        sliding = 1.0 / (3.0 * where(adheres, 1.0, filled))
        return (
            where(adheres, (1.0 - r + r * r / 3.0) / part, sliding),
            where(adheres, (1.0 - r) * (1.0 - r) / part, 0.0),
        )


#: The car tyre 205/60R15 91V at 2.2 bar of Pacejka, Tyre and Vehicle Dynamics (2nd edition, 2006), appendix 3.
CAR_205_60R15 = {
    "pCx1": 1.685, "pDx1": 1.210, "pDx2": -0.037, "pEx1": 0.344, "pEx2": 0.095, "pEx3": -0.020, "pEx4": 0.0,
    "pKx1": 21.51, "pKx2": -0.163, "pKx3": 0.245, "pHx1": -0.002, "pHx2": 0.002, "pVx1": 0.0, "pVx2": 0.0,
    "rBx1": 12.35, "rBx2": -10.77, "rCx1": 1.092, "rHx1": 0.007,
    "pCy1": 1.193, "pDy1": -0.990, "pDy2": 0.145, "pDy3": -11.23, "pEy1": -1.003, "pEy2": -0.537, "pEy3": -0.083,
    "pEy4": -4.787, "pKy1": -14.95, "pKy2": 2.130, "pKy3": -0.028, "pHy1": 0.003, "pHy2": -0.001, "pHy3": 0.075,
    "pVy1": 0.045, "pVy2": -0.024, "pVy3": -0.532, "pVy4": 0.039,
    "rBy1": 6.461, "rBy2": 4.196, "rBy3": -0.015, "rCy1": 1.081, "rHy1": 0.009, "rVy1": 0.053, "rVy2": -0.073,
    "rVy3": 0.517, "rVy4": 35.44, "rVy5": 1.9, "rVy6": -10.71,
}  # fmt: skip
NOMINAL = 4000.0  #: its nominal load (N)
#: Its coefficients of forces at no slip, from conicity and ply steer, and of other differences of left and right.
SHIFTS = (
    "pHx1", "pHx2", "pVx1", "pVx2", "rHx1", "pEy3", "pHy1", "pHy2", "pVy1", "pVy2", "rBy3", "rHy1", "rVy1", "rVy2",
)  # fmt: skip


class MagicFormula(TyreLaw):
    """The Magic Formula in its version of 2002, forces of combined slip with camber, without moments.

    Pacejka, Tyre and Vehicle Dynamics (2nd edition, 2006), section 4.3.2, equations 4.E9 to 4.E30 and 4.E50 to 4.E67
    with all scaling factors but that of friction 1, slips as tangents.  What tells driving from braking changes its
    sign with the way of the wheel.  A thrust of camber or conicity would do work where it pushes along a small slip;
    the wheel pays for it by its drag, max(0, F_x kappa + F_y tan alpha), 5e-4 of the load at a camber of 0.1.
    """

    formula: ClassVar[str] = (
        r"F = D \sin(C \mathrm{arctan}(B x - E (B x - \mathrm{arctan}(B x)))) + S_V, \quad x = \kappa, \alpha"
    )
    shifts: bool
    friction: Expr  #: scales the peaks

    def slides(self, slips: Slips, load: Expr) -> Expr:
        return load.graph.apply("le", MOST, slips.size())

    def _of(self, name: str) -> float:
        return 0.0 if not self.shifts and name in SHIFTS else CAR_205_60R15[name]

    def forces(self, slips: Slips, load: Expr) -> TyreForces:
        graph, p = load.graph, self._of
        kappa, tangent, camber, way = -slips.along, slips.across, slips.camber, slips.way
        excess = (load - NOMINAL) / NOMINAL

        def atan(x: Expr) -> Expr:
            return graph.apply("atan", x)

        def sine(B: Expr, C: float, D: Expr, E: Expr, x: Expr) -> Expr:
            return D * graph.apply("sin", C * atan(B * x - E * (B * x - atan(B * x))))

        def cosine(C: float, x: Expr) -> Expr:
            return graph.apply("cos", C * atan(x))

        def sign(x: Expr) -> Expr:
            return where(graph.apply("lt", x, 0.0), -1.0, 1.0)

        # along the wheel
        x = kappa + way * (p("pHx1") + p("pHx2") * excess)
        D = self.friction * (p("pDx1") + p("pDx2") * excess) * load
        E = (p("pEx1") + p("pEx2") * excess + p("pEx3") * excess * excess) * (1.0 - p("pEx4") * way * sign(x))
        K = load * (p("pKx1") + p("pKx2") * excess) * graph.apply("exp", p("pKx3") * excess)
        pure = sine(K / (p("pCx1") * D), p("pCx1"), D, graph.apply("min", E, 1.0), x)
        pure = pure + way * load * (p("pVx1") + p("pVx2") * excess)
        B = p("rBx1") * cosine(1.0, p("rBx2") * kappa)
        along = pure * cosine(p("rCx1"), B * (tangent + p("rHx1"))) / cosine(p("rCx1"), B * p("rHx1"))

        # across it
        y = tangent + p("pHy1") + p("pHy2") * excess + p("pHy3") * camber
        mu = self.friction * (p("pDy1") + p("pDy2") * excess) * (1.0 - p("pDy3") * camber * camber)
        D = mu * load
        E = (p("pEy1") + p("pEy2") * excess) * (1.0 - (p("pEy3") + p("pEy4") * camber) * sign(y))
        bend = 2.0 * atan(load / (p("pKy2") * NOMINAL))
        K = p("pKy1") * NOMINAL * graph.apply("sin", bend) * (1.0 - p("pKy3") * graph.apply("abs", camber))
        lift = p("pVy1") + p("pVy2") * excess + (p("pVy3") + p("pVy4") * excess) * camber
        pure = sine(K / (p("pCy1") * D), p("pCy1"), D, graph.apply("min", E, 1.0), y) + load * lift
        B = p("rBy1") * cosine(1.0, p("rBy2") * (tangent - p("rBy3")))
        shift = way * p("rHy1")
        lateral = pure * cosine(p("rCy1"), B * (kappa + shift)) / cosine(p("rCy1"), B * shift)
        sway = D * (p("rVy1") + p("rVy2") * excess + p("rVy3") * camber) * cosine(1.0, p("rVy4") * tangent)
        lateral = lateral + way * sway * graph.apply("sin", p("rVy5") * atan(p("rVy6") * kappa))
        gain = graph.apply("max", 0.0, along * slips.along + lateral * tangent)
        return TyreForces(along, lateral, graph.zero, -way * gain)


# -- tyres -------------------------------------------------------------------------------------------------------------


TYRE_LAWS = ("brush", "magic_formula")


class _WheelMotion(NamedTuple):
    """How a wheel stands on the road and moves over it."""

    normal: Vec3
    along: Vec3
    across: Vec3
    tilt: Expr  #: sine and
    upright: Expr  #: cosine of the camber
    lowest: Vec3  #: from the wheel's centre, of the tyre without load
    patch: Vec3  #: from the wheel's centre, on the road
    arm: Expr  #: length of the patch's vector
    depth: Expr
    rate: Expr
    camber: Expr
    forward: Expr  #: V_x
    rolling: Expr  #: Omega R
    sideways: Expr  #: V_sy


class Tyre(Force):
    """A tyre of a thin wheel on a plane road.

    The load is max(0, k d + c d') of the penetration d of the wheel's circle, at its lowest point; forces in the road's
    plane act where the line from the centre to that point meets the plane.  Deflections u, v of the tread are states:

        u' = V_sx - |V_x| kappa,  v' = V_sy - |V_x| tan alpha
        kappa = (u + tau V_sx) / s_x,  tan alpha = (v + tau V_sy) / s_y,  tau = tau_0 / (1 + |V_x| tau_0 / s)

    with slip velocities V_s and relaxation lengths s (Pacejka, Tyre and Vehicle Dynamics (2nd edition, 2006), section
    7.2, where tau is 0).  The time tau_0 damps a wheel at rest and does not change steady slips.  A wheel in the air
    rolls its deflections off.

    A brush of two lengths is a tread of the shorter one s_0 before a carcass of the rest: instead of u and v, s_0
    (kappa, tan alpha) + (s - s_0) F / C grows in this way, so that the force at rest has a potential.

    Where the tyre slides as a whole the deflections have no more to give: u' = V_sx - (|V_x| + l) kappa and v' = V_sy -
    (|V_x| + l) tan alpha with the l >= 0 that keeps kappa^2 + tan^2 alpha from growing, so that they come to lie along
    the slip velocity and a wheel that stops has no more energy in its tread than at full grip.

    The longitudinal force turns the wheel by the rolling radius R_e, at which it slips, not by the arm h of the patch:
    its power is F_x V_sx, so that no slip gains energy.  The difference F_x (h - R_e) is a moment about the lateral
    axis of the road, as that of rolling resistance; it takes the work of the aligning moment on a cambered wheel's
    spin, too.  The way of the wheel, tanh(V_x / reversal), tells the laws whether it rolls forwards or backwards.
    """

    sentence = (
        "A tyre on a road: load from its penetration, forces in the plane of the road from slips that build up over "
        "relaxation lengths."
    )
    road: Marker
    wheel: Marker
    radius: Expr = key(Scalar("radius without load (m)", required=True, dimension=LENGTH, allowed=POSITIVE))
    stiffness: Expr = key(Scalar("radial stiffness (N/m)", required=True, dimension=STIFFNESS, allowed=POSITIVE))
    relaxation: tuple[Expr, Expr] = key(
        Radii(
            "relaxation lengths along and across the wheel (m)",
            required=True,
            dimension=LENGTH,
            allowed=POSITIVE,
        )
    )
    damping: Expr = key(Scalar("radial damping (N s/m)", default=0, dimension=DAMPING, allowed=NOT_NEGATIVE))
    settling: Expr = key(
        Scalar(
            "time (s) that damps the deflections at rest; steady slips do not depend on it",
            default=0, dimension=TIME, allowed=NOT_NEGATIVE,
        )
    )  # fmt: skip
    reversal: Expr = key(
        Scalar(
            "velocity (m/s) around 0 over which rolling forwards becomes rolling backwards",
            default=0.1, dimension=SPEED, allowed=POSITIVE,
        )
    )  # fmt: skip
    axis: Vec3 = key(Axis("axis of the wheel to its left, in its marker", default="y"))
    rolling_radius: Expr = key(
        Scalar("effective rolling radius (m), the radius unless given", dimension=LENGTH, allowed=POSITIVE)
    )
    law: TyreLaw = key(
        Choice(
            "law of the forces: brush; magic_formula, of the car tyre 205/60R15 91V of Pacejka (2006)",
            default=TYRE_LAWS[0], choices=TYRE_LAWS,
        )
    )  # fmt: skip
    deflections: tuple[Expr, ...] = ()
    acts_along = True

    @property
    def load_law(self) -> DampedLinear:
        """The normal force."""
        return DampedLinear(self.stiffness, self.damping)

    @property
    def laws(self) -> tuple[Any, ...]:
        return (self.load_law, self.law)

    def glyphs(self) -> list[Glyph]:
        return [Drawn((self.road,), about=PLANE), Wheel(self.wheel, self.radius)]

    def measured(self, view: View) -> Measured:
        way = self._rolling(view)
        return Measured(way.depth, way.rate, self.load_law.force(way.depth, way.rate))

    def _rolling(self, view: View) -> _WheelMotion:
        normal = vec.transpose(view.rotation(self.road))[2]
        axis = vec.times(view.rotation(self.wheel), self.axis)
        reach = vec.sub(view.position(self.wheel), view.position(self.road))
        height, tilt = vec.dot(normal, reach), vec.dot(normal, axis)
        upright = sqrt(1.0 - tilt * tilt)  # cos of the camber
        up = vec.scale(1.0 / upright, vec.sub(normal, vec.scale(tilt, axis)))  # in the wheel's plane
        along = vec.scale(1.0 / upright, vec.cross(axis, normal))
        lateral = vec.cross(normal, along)
        whirl = view.angular_velocity(self.road)
        spin = vec.sub(view.angular_velocity(self.wheel), whirl)  # against the road, as all that follows
        omega = vec.dot(spin, axis)
        turning = vec.sub(spin, vec.scale(omega, axis))  # of the carcass, which does not spin
        arm = height / upright
        lowest, patch = vec.scale(-self.radius, up), vec.scale(-arm, up)
        moving = vec.sub(view.velocity(self.wheel), vec.add(view.velocity(self.road), vec.cross(whirl, reach)))

        def over_road(place: Vec3) -> Vec3:
            return vec.add(moving, vec.cross(turning, place))

        velocity = over_road(patch)
        return _WheelMotion(
            normal,
            along,
            lateral,
            tilt,
            upright,
            lowest,
            patch,
            arm,
            self.radius * upright - height,
            -vec.dot(normal, over_road(lowest)),
            view.graph.apply("asin", tilt),
            vec.dot(along, velocity),
            omega * self.rolling_radius,
            vec.dot(lateral, velocity),
        )

    def _slips(self, way: _WheelMotion) -> Slips:
        """Those of the law."""
        graph = way.depth.graph
        speed, (x, y), (u, v) = graph.apply("abs", way.forward), self.relaxation, self.deflections

        def slip(deflection: Expr, velocity: Expr, length: Expr) -> Expr:
            tau = self.settling / (1.0 + speed * self.settling / length)
            return (deflection + tau * velocity) / length

        along, across = slip(u, way.forward - way.rolling, x), slip(v, way.sideways, y)
        return Slips(along, across, way.camber, graph.apply("tanh", way.forward / self.reversal))

    def loads(self, view: View) -> list[Load]:
        return self._loads(view, True)

    def potential(self, view: View) -> Expr | None:
        return self.load_law.energy(self._rolling(view).depth)

    def remainder(self, view: View) -> list[Load]:
        return self._loads(view, False)

    def _loads(self, view: View, whole: bool) -> list[Load]:
        way = self._rolling(view)
        load = self.load_law.force(way.depth, way.rate)
        push = load if whole else load - self.load_law.elastic(way.depth)
        slips = self._slips(way)
        bears = view.graph.apply("lt", 0.0, load)
        result = self.law.forces(slips, where(bears, load, 1.0))
        along, lateral, moment, drag = TyreForces(*(where(bears, one, 0.0) for one in result))
        sliding = vec.add(vec.scale(along + drag, way.along), vec.scale(lateral, way.across))
        lag = along * (way.arm - self.rolling_radius) + drag * way.arm - moment * way.tilt  # about the axle
        pressing = vec.scale(push, way.normal)
        turn = vec.add(vec.scale(moment, way.normal), vec.scale(lag / way.upright, way.across))
        force = vec.add(pressing, sliding)
        torque = vec.add(vec.add(vec.cross(way.lowest, pressing), vec.cross(way.patch, sliding)), turn)
        return with_reaction(view, self.wheel, self.road, force, torque)

    def state_rates(self, view: View) -> tuple[Expr, ...]:
        way, graph = self._rolling(view), view.graph
        (u, v), (x, y) = self.deflections, self.relaxation
        speed = graph.apply("abs", way.forward)
        load = self.load_law.force(way.depth, way.rate)
        bears = graph.apply("lt", 0.0, load)
        off = speed + graph.apply("abs", way.rolling)
        slips = self._slips(way)
        moved = way.forward - way.rolling - speed * slips.along, way.sideways - speed * slips.across
        vertical = where(bears, load, 1.0)
        slides = self.law.slides(slips, vertical)
        taken = self._shares(slips, vertical)
        rates, unwound = taken(*moved), taken(slips.along, slips.across)
        growth = slips.along * rates[0] / x + slips.across * rates[1] / y
        weight = slips.along * unwound[0] / x + slips.across * unwound[1] / y
        grows = where(graph.apply("lt", 0.0, weight), graph.apply("lt", 0.0, growth), 0.0)
        lost = where(slides, where(grows, growth / where(grows, weight, 1.0), 0.0), 0.0)
        return tuple(
            where(bears, rate - lost * back, -off / length * deflection)
            for rate, back, deflection, length in zip(rates, unwound, (u, v), (x, y), strict=True)
        )

    def _shares(self, slips: Slips, load: Expr) -> Callable[[Expr, Expr], tuple[Expr, Expr]]:
        """Rates of the deflections of the motion that the tyre takes up: of a tread beside the rest of a carcass."""
        (u, v), (x, y), graph = self.deflections, self.relaxation, load.graph
        limited = slips._replace(along=u / x, across=v / y)
        result = None if (y - x).is_zero else self.law.gradients(limited, load)
        if result is None:
            return lambda along, across: (along, across)
        around, outwards = result
        size, tread = limited.size(), graph.apply("min", x, y)
        some = graph.apply("lt", 0.0, size)
        c, s = (where(some, one / where(some, size, 1.0), 0.0) for one in (limited.along, limited.across))
        bend = outwards - around
        a, b = tread + (x - tread) * (around + bend * c * c), (x - tread) * bend * c * s
        d, e = (y - tread) * bend * c * s, tread + (y - tread) * (around + bend * s * s)
        whole = a * e - b * d
        return lambda along, across: (x * (e * along - b * across) / whole, y * (a * across - d * along) / whole)


# -- reading ----------------------------------------------------------------------------------------------------------


def _check_tyre(e: Entry, values: dict[str, Any]) -> None:
    values["law"], values["deflections"] = _law(e), e.states()
    if values["rolling_radius"] is None:
        values["rolling_radius"] = values["radius"]


def _law(e: Entry) -> TyreLaw | None:
    slip_stiffness, friction, half = (e[key] for key in ("slip_stiffness", "friction", "half_length"))
    if e["law"] == "brush":
        e.refuse("shifts", "belongs to law: magic_formula")
        for key in ("slip_stiffness", "friction"):
            if key not in e.values:
                e.missing(key, "law: brush needs slip_stiffness and friction")
        return Brush(slip_stiffness, friction, half)
    for key in ("slip_stiffness", "half_length"):
        e.refuse(key, "belongs to law: brush")
    return MagicFormula(e["shifts"], e.graph.one if friction is None else friction)


TYPES |= table(
    element(
        Tyre,
        "tyre",
        "a tyre on a plane road: the first marker is the road (z out of it), the second the centre of the wheel.",
        Where({"between": Pair("the road and the wheel's centre", required=True)}, Entry.pair),
        more={
            "slip_stiffness": Scalar(
                "force of the brush per slip (N), along and across", level=LAW, dimension=FORCE, allowed=POSITIVE
            ),
            "friction": Scalar(
                "friction coefficient of the brush, or factor of the peaks of the Magic Formula",
                level=LAW,
                dimension=NONE,
                allowed=POSITIVE,
            ),
            "half_length": Scalar(
                "half of the length of contact (m) of the brush, for its aligning moment",
                dimension=LENGTH,
                allowed=POSITIVE,
            ),
            "shifts": Flag("whether the Magic Formula has its forces at no slip (conicity, ply steer)", default=True),
        },
        check=_check_tyre,
        states=lambda values: {"deflection_x": "m", "deflection_y": "m"},
        ends=("road", "wheel"),
    )
)
