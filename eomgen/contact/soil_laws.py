"""Laws of soil: sinkage with unloading, shear that builds up with displacement, and published numbers of soils."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import ClassVar, NamedTuple

from ..base.value_rules import NOT_NEGATIVE, POSITIVE, Allowed
from ..elements.dimensions import FORCE, LENGTH, NONE, REACH, SPEED, TIME
from ..elements.element_type import ElementType, Entry, Law
from ..elements.forces.force import beyond_zero, where
from ..elements.forces.friction import DryFriction, Slip
from ..elements.forces.normal_laws import DISSIPATION, NormalLaw
from ..elements.kinds import Fields, Flag, Radii, Scalar
from ..expr import vectors as vec
from ..expr.core import Expr, sqrt
from ..expr.records import Record
from ..expr.vectors import Vec3
from .limits import CAUGHT_UP
from .states import WHEEL, cells_of, groups_of_entry

# -- numbers of soils --------------------------------------------------------------------------------------------------

# J. Y. Wong, Theory of Ground Vehicles (4th edition, Wiley, 2008), table 2.3, in SI units; the number in a name is the
# moisture content in percent. Moduli of shear deformation are not in the table: those of dry sand (loose) and of clayey
# soil (well compacted clay) are what the same book names for such soils; the others have to be given.


RECOVERY = 0.05  #: (s) in which a plate above the ground forgets its sinkage and shear: far less than it is lifted


class Soil(NamedTuple):
    """Numbers of a soil.

    Attributes
    ----------
    exponent : float
        n of the sinkage.
    cohesive, frictional : float
        k_c (N/m^(n+1)) and k_phi (N/m^(n+2)).
    cohesion : float
        c (Pa).
    angle : float
        phi, angle of internal shearing resistance (degrees).
    shear : float or None
        K, modulus of shear deformation (m).
    """

    exponent: float
    cohesive: float
    frictional: float
    cohesion: float
    angle: float
    shear: float | None = None


SOILS = {
    "dry_sand": Soil(1.1, 0.99e3, 1528.43e3, 1.04e3, 28.0, 0.025),
    "sandy_loam_15": Soil(0.7, 5.27e3, 1515.04e3, 1.72e3, 29.0),
    "sandy_loam_22": Soil(0.2, 2.56e3, 43.12e3, 1.38e3, 38.0),
    "sandy_loam_michigan_11": Soil(0.9, 52.53e3, 1127.97e3, 4.83e3, 20.0),
    "sandy_loam_michigan_23": Soil(0.4, 11.42e3, 808.96e3, 9.65e3, 35.0),
    "sandy_loam_hanamoto_26": Soil(0.3, 2.79e3, 141.11e3, 13.79e3, 22.0),
    "sandy_loam_hanamoto_32": Soil(0.5, 0.77e3, 51.91e3, 5.17e3, 11.0),
    "clayey_soil_38": Soil(0.5, 13.19e3, 692.15e3, 4.14e3, 13.0, 0.006),
    "clayey_soil_55": Soil(0.7, 16.03e3, 1262.53e3, 2.07e3, 10.0),
    "heavy_clay_25": Soil(0.13, 12.70e3, 1555.95e3, 68.95e3, 34.0),
    "heavy_clay_40": Soil(0.11, 1.84e3, 103.27e3, 20.69e3, 6.0),
    "lean_clay_22": Soil(0.2, 16.43e3, 1724.69e3, 68.95e3, 20.0),
    "lean_clay_32": Soil(0.15, 1.52e3, 119.61e3, 13.79e3, 11.0),
    "lete_sand": Soil(0.79, 102e3, 5301e3, 1.3e3, 31.1),
    "upland_sandy_loam_51": Soil(1.10, 74.6e3, 2080e3, 3.3e3, 33.7),
    "rubicon_sandy_loam_43": Soil(0.66, 6.9e3, 752e3, 3.7e3, 29.8),
    "north_gower_clayey_loam_46": Soil(0.73, 41.6e3, 2471e3, 6.1e3, 26.6),
    "grenville_loam_24": Soil(1.01, 0.06e3, 5880e3, 3.1e3, 29.8),
    "snow": Soil(1.6, 4.37e3, 196.72e3, 1.03e3, 19.7),
    "snow_sweden": Soil(1.44, 10.55e3, 66.08e3, 6.0e3, 20.7),
}


# -- laws --------------------------------------------------------------------------------------------------------------

# Each point of a plate remembers its greatest sinkage and its shear displacement as states, as long as it is in the
# ground.


CUSTOM = "own"  #: the soil whose numbers are all given
REBOUND = 0.1  #: part of the sinkage that unloading gives back, where nothing is said
REVERSAL = 0.01  #: (m/s) of a wheel over the ground, over which its front becomes its rear
SETTLING = 1e-3  #: (s) of cells of a bed
_NUMBERS = ("cohesive", "frictional", "exponent", "dissipation", "recovery", "rebound", "width", "reversal", "settling")


class SoilPressure(Record, NormalLaw):
    """Pressure p of a point of a plate at a sinkage z, whose greatest so far is z_m, times the area that it stands for.

        p = k z^n, k = k_c / b + k_phi                         at the greatest sinkage (Bekker)
        p = k z_m^n - k_u (z_m - z), k_u = k_0 + A_u z_m       below it, never less than 0

    after Wong, Theory of Ground Vehicles (2008), section 2.4 (pressure and sinkage, response to repetitive loading).
    Without k_0 and A_u unloading gives back a part of the sinkage, k_u = k z_m^n / (rebound z_m).  No point pulls, and
    unloading is at least as steep as the line to z = 0, and as (n + 1) / 2 times that, which gives back all work.
    With dissipation p is multiplied by max(0, 1 + lambda z').
    """

    formula: ClassVar[str] = (
        r"p = (\frac{k_c}{b} + k_\phi) z^n, \quad p = p_m - k_u (z_m - z) \text{ for } z < z_m, \quad F_n = p A"
    )
    count: ClassVar[int] = 1
    cohesive: Expr
    frictional: Expr
    exponent: Expr
    rebound: Expr | None
    unloading: tuple[Expr, Expr] | None
    dissipation: Expr
    recovery: Expr
    settling: Expr  #: of cells
    reversal: Expr  #: of wheels, as the next
    peak: tuple[Expr, Expr] | None = None
    area: Expr | None = None
    width: Expr | None = None
    deepest: Expr | None = None

    def modulus_of(self, width: Expr) -> Expr:
        """k of what has a width, unless one is given."""
        return self.cohesive / (width if self.width is None else self.width) + self.frictional

    def greatest(self, depth: Expr, width: Expr) -> Expr:
        """The pressure at the greatest sinkage so far."""
        return self.modulus_of(width) * depth**self.exponent

    def unloading_slope(self, deepest: Expr, top: Expr) -> Expr:
        """k_u below the greatest sinkage so far, at which the pressure was ``top``.

        It gives back p^2 / (2 k_u) of the work p z / (n + 1) of the pressing, so that it is at least (n + 1) / 2 p / z.
        """
        apply = deepest.graph.apply
        least = apply("max", 1.0, 0.5 * (self.exponent + 1.0))
        if self.unloading is None:
            assert self.rebound is not None
            return top / deepest * apply("max", 1.0 / self.rebound, least)
        return apply("max", self.unloading[0] + self.unloading[1] * deepest, top / deepest * least)

    def on_pad(self, area: Expr, width: Expr) -> SoilPressure:
        return replace(self, area=area, width=width if self.width is None else self.width)

    def holding(self, states: tuple[Expr, ...]) -> SoilPressure:
        return replace(self, deepest=states[0])

    def mapped(self, change: Callable[[Expr], Expr]) -> SoilPressure:
        numbers = {name: change(getattr(self, name)) for name in _NUMBERS if getattr(self, name) is not None}

        def both(pair: tuple[Expr, Expr] | None) -> tuple[Expr, Expr] | None:
            return None if pair is None else (change(pair[0]), change(pair[1]))

        return replace(self, **numbers, unloading=both(self.unloading), peak=both(self.peak))

    def force(self, depth: Expr, rate: Expr) -> Expr:
        assert self.deepest is not None
        assert self.area is not None
        assert self.width is not None
        graph, deepest, area, width = depth.graph, self.deepest, self.area, self.width

        def pressure(z: Expr) -> Expr:
            most = graph.apply("max", z, deepest)
            top = self.greatest(most, width)
            slope = self.unloading_slope(most, top)
            gain = graph.apply("max", 0.0, 1.0 + self.dissipation * rate)
            return area * gain * graph.apply("max", 0.0, top - slope * (most - z))

        return beyond_zero(depth, pressure)

    def elastic(self, depth: Expr) -> Expr:
        return depth.graph.zero

    def energy(self, depth: Expr) -> Expr:
        return depth.graph.zero

    def deepening(self, depth: Expr, rate: Expr) -> Expr:
        """z_m' of what is in the ground: z' while the sinkage grows beyond z_m.

        Where a plate that has begun deeper than z_m rises, z_m catches up with z: dz_m / d|z| = (z - z_m) / (part z).
        """
        assert self.deepest is not None
        graph, deepest = depth.graph, self.deepest
        over = beyond_zero(depth, lambda z: 1.0 - deepest / z)
        change = where(graph.apply("lt", rate, 0.0), -over / CAUGHT_UP * rate, rate)
        return where(graph.apply("lt", 0.0, depth), where(graph.apply("le", deepest, depth), change, 0.0), 0.0)

    def rates(self, depth: Expr, rate: Expr) -> tuple[Expr, ...]:
        """z_m' in the ground; above the ground z_m fades."""
        inside = depth.graph.apply("lt", 0.0, depth)
        return (where(inside, self.deepening(depth, rate), self.rates_apart()[0]),)

    def rates_apart(self) -> tuple[Expr, ...]:
        assert self.deepest is not None
        return (-self.deepest / self.recovery,)


class SoilShear(DryFriction):
    """Shear stress against the sliding, tau = (c + p tan phi) s, |s| = 1 - exp(-j / K) of the shear displacement j.

    The state is the recoverable displacement d = K s, with d' = v - |v| d / K: at a sliding of one direction this is
    the law of Janosi and Hanamoto (1961); where sliding turns back, stress falls and rises again the other way.
    """

    formula: ClassVar[str] = (
        r"\tau = (c + p \tan\varphi) \frac{d}{K}, \quad \dot{d} = v - \frac{|v|}{K} d, \quad F_t = -\tau A"
    )
    cohesion: Expr
    slope: Expr  #: tan phi
    modulus: Expr
    recovery: Expr
    area: Expr | None = None
    shears: tuple[Expr, ...] = ()
    lateral: Vec3 | None = None

    def in_plane(self, slip: Slip) -> Vec3:
        """Of a normal force without cohesion."""
        return vec.scale(self.slope / self.modulus, slip.across(self.shears, self.lateral))

    def drag(self, push: Expr, slip: Slip) -> Vec3:
        assert self.area is not None
        strength = where(push.graph.apply("lt", 0.0, push), self.cohesion * self.area + push * self.slope, 0.0)
        return vec.scale(-strength / self.modulus, slip.across(self.shears, self.lateral))

    def on_pad(self, area: Expr) -> SoilShear:
        return replace(self, area=area)

    def holding(self, states: tuple[Expr, ...], lateral: Vec3 | None) -> SoilShear:
        return replace(self, shears=states, lateral=lateral)

    def mapped(self, change: Callable[[Expr], Expr]) -> SoilShear:
        return SoilShear(change(self.cohesion), change(self.slope), change(self.modulus), change(self.recovery))

    def rates_in_plane(self, slip: Slip) -> tuple[Expr, ...]:
        speed = beyond_zero(vec.dot(slip.velocity, slip.velocity), sqrt)  # the root has no slope at rest
        velocity = vec.transpose_times(slip.axes_of_states(self.lateral), slip.velocity)
        pressed = slip.push.graph.apply("lt", 0.0, slip.push)
        return tuple(
            where(pressed, v - speed / self.modulus * d, back)
            for v, d, back in zip(velocity, self.shears, self.rates_apart(), strict=False)
        )

    def rates_apart(self) -> tuple[Expr, ...]:
        return tuple(-d / self.recovery for d in self.shears)


# -- reading ----------------------------------------------------------------------------------------------------------
_PRESSURE = FORCE.times(LENGTH, -2)
_RISE = FORCE.times(REACH, -1)
#: Of laws with states, of friction and of soil.
LATERAL: Fields = {
    "lateral": Flag(
        "whether planar shapes have states of lateral sliding; plane mechanisms need none (false)",
        default=True,
    ),
}
_SOIL: Fields = {
    "cohesive_modulus": Scalar("k_c (N/m^(n+1)) of the pressure (k_c / b + k_phi) z^n", dimension=_RISE,
        exponent="sinkage_exponent", allowed=NOT_NEGATIVE,
    ),
    "frictional_modulus": Scalar("k_phi (N/m^(n+2))", dimension=_RISE.times(REACH, -1), exponent="sinkage_exponent",
        allowed=NOT_NEGATIVE,
    ),
    "sinkage_exponent": Scalar("n of the sinkage", dimension=NONE, allowed=POSITIVE),
    "cohesion": Scalar("cohesion c (Pa)", dimension=_PRESSURE, allowed=NOT_NEGATIVE),
    "friction_angle": Scalar("angle of internal shearing resistance phi (rad)", dimension=NONE,
        allowed=Allowed(0.0, math.pi / 2, below=True), remedy="is 0 or greater and below pi/2; it is in rad",
    ),
    "shear_modulus": Scalar("K (m): shear displacement in which stress builds up", dimension=LENGTH, allowed=POSITIVE),
    "contact_width": Scalar("b (m), the smaller side of the area in contact; the width of the plate unless given",
        dimension=LENGTH, allowed=POSITIVE,
    ),
    "rebound": Scalar(f"part of the sinkage that unloading gives back; {REBOUND} unless given", dimension=NONE,
        allowed=Allowed(0.0, 1.0, above=True), remedy="is above 0 and at most 1",
    ),
    "unloading_stiffness": Scalar("k_0 (N/m^3) of the slope k_0 + A_u z_m of unloading, instead of rebound",
        dimension=_PRESSURE.times(LENGTH, -1), allowed=NOT_NEGATIVE,
    ),
    "unloading_rise": Scalar("A_u (N/m^4)", dimension=_PRESSURE.times(LENGTH, -2), allowed=NOT_NEGATIVE),
    "peak_angle": Radii(
        "c1 and c2 of wheels, whose pressure is greatest at (c1 + c2 abs(slip)) times the angle of entry, such as "
        "[0.43, 0.32] of compact, [0.18, 0.32] of loose sand (Wong and Reece, 1967); at the lowest point unless given",
        dimension=NONE,
    ),
    "reversal": Scalar("velocity (m/s) of wheels over the ground over which front and rear change places",
        default=REVERSAL, dimension=SPEED, allowed=POSITIVE,
    ),
    "settling": Scalar(
        "time constant (s) with which cells of a bed reach the initial sinkage and follow fast sliding",
        default=SETTLING, dimension=TIME, allowed=POSITIVE,
    ),
    "recovery": Scalar("time (s) in which a plate above the ground forgets sinkage and shear; of published soils "
        f"{RECOVERY} unless given",
        dimension=TIME, allowed=POSITIVE,
    ),
    "dissipation": DISSIPATION,
    **LATERAL,
}  # fmt: skip


def read_soil(e: Entry) -> tuple[SoilPressure, SoilShear] | None:
    """The two laws of the keys :data:`SOIL`; None where there are faults, which are noted."""
    name = str(e.values.get("type"))
    soil = SOILS.get(name)

    def number(key: str, published: float | None) -> Expr:
        if key in e.values:
            value: Expr = e[key]
            return value
        if published is None:
            why = f"is missing of soil {name}"
            where_from = "K is 0.01 m in firm sand, 0.025 m in loose sand, 0.006 m in firm clay (Wong, 2008)"
            remedy = where_from if key == "shear_modulus" else "give it, or the name of a published soil"
            e.fault(key, why, remedy, "EG-MISSING")
            return e.stand_in
        return e.graph.constant(published)

    cohesive = number("cohesive_modulus", soil and soil.cohesive)
    frictional = number("frictional_modulus", soil and soil.frictional)
    exponent = number("sinkage_exponent", soil and soil.exponent)
    cohesion = number("cohesion", soil and soil.cohesion)
    angle = number("friction_angle", soil and math.radians(soil.angle))
    modulus = number("shear_modulus", soil and soil.shear)
    if "frictional_modulus" in e.values and not e.at_fault():
        message, remedy = "is 0 as cohesive_modulus is", "give one that is greater than 0"
        e.require("frictional_modulus", cohesive + frictional, POSITIVE, remedy, message)
    groups = groups_of_entry(e.owner.values)
    rolls = any(shape.kind == WHEEL for group in groups for shape in group) and not cells_of(groups)
    recovery = e.graph.one if rolls else number("recovery", soil and RECOVERY)
    width, dissipation, settling, reversal, _ = (
        e[key] for key in ("contact_width", "dissipation", "settling", "reversal", "lateral")
    )
    unloading, peak = _unloading(e), _peak(e)
    if e.at_fault():
        return None
    damped = e.graph.zero if dissipation is None else dissipation
    pressure = SoilPressure(
        cohesive, frictional, exponent, *unloading, damped, recovery, settling, reversal, peak, None, width
    )
    return pressure, SoilShear(cohesion, angle.graph.apply("tan", angle), modulus, recovery)


def _unloading(e: Entry) -> tuple[Expr | None, tuple[Expr, Expr] | None]:
    """The part of the sinkage that is given back, or two numbers of the slope."""
    keys = ("unloading_stiffness", "unloading_rise")
    if not any(key in e.values for key in keys):
        return e["rebound"] if "rebound" in e.values else e.graph.constant(REBOUND), None
    e.refuse("rebound", f"follows from {' and '.join(keys)}")
    result = [e[key] if key in e.values else e.graph.zero for key in keys]
    return None, (result[0], result[1])


def _peak(e: Entry) -> tuple[Expr, Expr] | None:
    """The two numbers of the angle of greatest pressure."""
    pair = e["peak_angle"]
    if pair is None:
        return None
    e.require("peak_angle[0]", pair[0], Allowed(0.0, 1.0, above=True), "is above 0 and at most 1")
    e.require("peak_angle[1]", pair[1], NOT_NEGATIVE, "must be 0 or greater")
    for key in ("rebound", "unloading_stiffness", "unloading_rise"):
        e.refuse(key, "is of the rear of wheels without peak_angle, which gives the pressure of the whole arc")
    return pair[0], pair[1]


def states_of_soil(axes: tuple[str, ...]) -> tuple[str, ...]:
    """What the states of a point are called."""
    return (*(f"shear{axis}" for axis in axes), "sinkage")


_ROW = ElementType("soil", "pressure and shear of soil, whose numbers are given or published.", _SOIL, read_soil)
SOIL = Law(
    "soil under plates and wheels, instead of laws of normal force and friction: as type the name of a published one, "
    f"whose numbers may be replaced by others, or {CUSTOM} with all numbers given",
    dict.fromkeys((CUSTOM, *SOILS), _ROW),
    flat={"soil": "type"},
)
