"""Force elements, a tyre on a plane road: a wheel's motion -> load, slips with relaxation as states, and forces."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

from ..base.value_rules import NOT_NEGATIVE, POSITIVE
from ..elements.dimensions import DAMPING, FORCE, LENGTH, NONE, SPEED, STIFFNESS, TIME
from ..elements.element_type import ElementType, table
from ..elements.entry import Entry
from ..elements.kinds import LAW, Axis, Choice, Flag, Pair, Radii, Scalar
from ..elements.looks import PLANE, Drawn, Seen, Wheel
from ..frames import Marker
from ..graph import vectors as vec
from ..graph.core import Expr, sqrt
from ..graph.vectors import Vec3
from ..records import dataclass
from .branches import where
from .force import Force, Load, MarkerLoad, Measured, View
from .normal_laws import DampedLinear
from .tyre_laws import Brush, MagicFormula, Slips, TyreForces, TyreLaw

LAWS = ("brush", "magic_formula")


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


@dataclass(frozen=True)
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

    sentence: ClassVar[str] = (
        "A tyre on a road: load from its penetration, forces in the plane of the road from slips that build up over "
        "relaxation lengths."
    )
    road: Marker
    wheel: Marker
    axis: Vec3  #: in the wheel's axes
    radius: Expr
    rolling_radius: Expr
    load_law: DampedLinear
    law: TyreLaw
    relaxation: tuple[Expr, Expr]
    settling: Expr
    reversal: Expr
    deflections: tuple[Expr, Expr]

    @property
    def laws(self) -> tuple[Any, ...]:
        return (self.load_law, self.law)

    @property
    def acts_along(self) -> bool:
        return True

    def drawn(self) -> list[Seen]:
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
        across = vec.cross(normal, along)
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
            across,
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
            vec.dot(across, velocity),
        )

    def _slips(self, way: _WheelMotion) -> tuple[Expr, Expr]:
        """Longitudinal slip and tangent of the slip angle of the law."""
        speed, (x, y), (u, v) = way.depth.graph.apply("abs", way.forward), self.relaxation, self.deflections

        def slip(deflection: Expr, velocity: Expr, length: Expr) -> Expr:
            tau = self.settling / (1.0 + speed * self.settling / length)
            return (deflection + tau * velocity) / length

        return slip(u, way.forward - way.rolling, x), slip(v, way.sideways, y)

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
        slips = Slips(*self._slips(way), way.camber, view.graph.apply("tanh", way.forward / self.reversal))
        bears = view.graph.apply("lt", 0.0, load)
        found = self.law.forces(slips, where(bears, load, 1.0))
        along, across, moment, drag = TyreForces(*(where(bears, one, 0.0) for one in found))
        sliding = vec.add(vec.scale(along + drag, way.along), vec.scale(across, way.across))
        lag = along * (way.arm - self.rolling_radius) + drag * way.arm - moment * way.tilt  # about the axle
        pressing = vec.scale(push, way.normal)
        turn = vec.add(vec.scale(moment, way.normal), vec.scale(lag / way.upright, way.across))
        force = vec.add(pressing, sliding)
        torque = vec.add(vec.add(vec.cross(way.lowest, pressing), vec.cross(way.patch, sliding)), turn)
        reach = vec.sub(view.position(self.wheel), view.position(self.road))
        return [
            MarkerLoad(self.wheel, force, torque),
            MarkerLoad(self.road, vec.neg(force), vec.neg(vec.add(torque, vec.cross(reach, force)))),
        ]

    def state_rates(self, view: View) -> tuple[Expr, ...]:
        way, graph = self._rolling(view), view.graph
        (u, v), (x, y) = self.deflections, self.relaxation
        speed = graph.apply("abs", way.forward)
        load = self.load_law.force(way.depth, way.rate)
        bears = graph.apply("lt", 0.0, load)
        off = speed + graph.apply("abs", way.rolling)
        slips = self._slips(way)
        moved = [v - speed * slip for v, slip in zip((way.forward - way.rolling, way.sideways), slips, strict=True)]
        turned = Slips(*slips, way.camber, graph.apply("tanh", way.forward / self.reversal))
        carried = where(bears, load, 1.0)
        slides = self.law.slides(turned, carried)
        taken = self._shares(way, carried)
        rates, unwound = taken(*moved), taken(*slips)
        growth = slips[0] * rates[0] / x + slips[1] * rates[1] / y
        weight = slips[0] * unwound[0] / x + slips[1] * unwound[1] / y
        grows = where(graph.apply("lt", 0.0, weight), graph.apply("lt", 0.0, growth), 0.0)
        lost = where(slides, where(grows, growth / where(grows, weight, 1.0), 0.0), 0.0)
        found = [
            where(bears, rate - lost * back, -off / length * deflection)
            for rate, back, deflection, length in zip(rates, unwound, (u, v), (x, y), strict=True)
        ]
        return tuple(found)

    def _shares(self, way: _WheelMotion, load: Expr) -> Callable[[Expr, Expr], tuple[Expr, Expr]]:
        """Rates of the deflections of the motion that the tyre takes up: of a tread beside the rest of a carcass."""
        (u, v), (x, y), graph = self.deflections, self.relaxation, load.graph
        held = Slips(u / x, v / y, way.camber, graph.apply("tanh", way.forward / self.reversal))
        found = None if (y - x).is_zero else self.law.gradients(held, load)
        if found is None:
            return lambda along, across: (along, across)
        around, outwards = found
        size, tread = held.size(), graph.apply("min", x, y)
        some = graph.apply("lt", 0.0, size)
        c, s = (where(some, one / where(some, size, 1.0), 0.0) for one in (held.along, held.across))
        bend = outwards - around
        a, b = tread + (x - tread) * (around + bend * c * c), (x - tread) * bend * c * s
        d, e = (y - tread) * bend * c * s, tread + (y - tread) * (around + bend * s * s)
        whole = a * e - b * d
        return lambda along, across: (x * (e * along - b * across) / whole, y * (a * across - d * along) / whole)


# -- reading ----------------------------------------------------------------------------------------------------------
def _tyre(e: Entry) -> Tyre | None:
    pair, axis, radius = e.pair(), e["axis"], e.positive("radius")
    rolling = e.positive("rolling_radius") if "rolling_radius" in e.values else radius
    damping, settling, relaxation = e["damping"], e["settling"], e["relaxation"]
    reversal = e.positive("reversal")
    e.require("settling", settling, NOT_NEGATIVE, "must be 0 or greater")
    e.require("damping", damping, NOT_NEGATIVE, "must be 0 or greater")
    for k, length in enumerate(relaxation or ()):
        e.require(f"relaxation[{k}]", length, POSITIVE, "must be greater than 0")
    law, load_law = _law(e), DampedLinear(e.positive("stiffness"), damping)
    if pair is None or law is None or relaxation is None or e.at_fault():
        return None
    u, v = e.states()
    lengths = (relaxation[0], relaxation[1])
    return Tyre(e.name, *pair, axis, radius, rolling, load_law, law, lengths, settling, reversal, (u, v))


def _law(e: Entry) -> TyreLaw | None:
    kind = e["law"]
    if kind == "brush":
        e.refuse("shifts", "belongs to law: magic_formula")
        for key in ("slip_stiffness", "friction"):
            if key not in e.values:
                e.missing(key, "law: brush needs slip_stiffness and friction")
        if e.at_fault():
            return None
        half = e.positive("half_length") if "half_length" in e.values else None
        return Brush(e.positive("slip_stiffness"), e.positive("friction"), half)
    for key in ("slip_stiffness", "half_length"):
        e.refuse(key, "belongs to law: brush")
    friction = e.positive("friction") if "friction" in e.values else e.graph.one
    return MagicFormula(e["shifts"], friction)


TYPES = table(
    ElementType(
        "tyre",
        "a tyre on a plane road: the first marker is the road (z out of it), the second the centre of the wheel.",
        {
            "between": Pair("the road and the wheel's centre", required=True),
            "radius": Scalar("radius without load (m)", required=True, dimension=LENGTH),
            "stiffness": Scalar("radial stiffness (N/m)", required=True, dimension=STIFFNESS),
            "relaxation": Radii("relaxation lengths along and across the wheel (m)", required=True, dimension=LENGTH
            ),
            "damping": Scalar("radial damping (N s/m)", default=0, dimension=DAMPING),
            "settling": Scalar("time (s) that damps the deflections at rest; steady slips do not depend on it",
                default=0, dimension=TIME,
            ),
            "reversal": Scalar("velocity (m/s) around 0 over which rolling forwards becomes rolling backwards",
                default=0.1, dimension=SPEED,
            ),
            "axis": Axis("axis of the wheel to its left, in its marker", default="y"),
            "rolling_radius": Scalar("effective rolling radius (m), the radius unless given", dimension=LENGTH
            ),
            "law": Choice("law of the forces: brush; magic_formula, of the car tyre 205/60R15 91V of Pacejka (2006)",
                default=LAWS[0],
                choices=LAWS,
            ),
            "slip_stiffness": Scalar("force of the brush per slip (N), along and across", level=LAW, dimension=FORCE
            ),
            "friction": Scalar("friction coefficient of the brush, or factor of the peaks of the Magic Formula",
                level=LAW, dimension=NONE,
            ),
            "half_length": Scalar("half of the length of contact (m) of the brush, for its aligning moment",
                dimension=LENGTH,
            ),
            "shifts": Flag("whether the Magic Formula has its forces at no slip (conicity, ply steer)", default=True
            ),
        },
        _tyre,
        states=lambda values: {"deflection_x": "m", "deflection_y": "m"},
        ends=("road", "wheel"),
    )
)  # fmt: skip
