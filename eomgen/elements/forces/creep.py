"""Force elements, wheel on rail: creep forces between a rolling wheel and its track."""

from __future__ import annotations

import math

from ...base.records import dataclass
from ...base.value_rules import NOT_NEGATIVE, POSITIVE
from ...expr import vectors as vec
from ...expr.core import Expr, sqrt
from ...expr.vectors import Vec3
from ..dimensions import FORCE, LENGTH, NONE, SPEED
from ..element_type import Entry, Where, element, key, keys_of, table
from ..frames import Marker, velocity_at
from ..kinds import LAW, Choice, Pair, Scalar
from .force import Force, Load, MarkerLoad, View, beyond_zero, where

LAWS = ("linear", "vermeulen_johnson", "polach")
_FACTOR = Scalar("", level=LAW, dimension=FORCE)


@dataclass(frozen=True)
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
        passing = vec.sub(view.velocity(self.wheel), velocity_at(view, self.track, vec.sub(centre, origin)))
        rolling = vec.transpose_times(axes, passing)[0]
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


def _check_saturation(e: Entry) -> None:
    law = e["creep_law"]
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
