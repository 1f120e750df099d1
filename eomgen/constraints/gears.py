"""Constraint elements: gear pairs, planetary sets, racks and belts, as relations between coordinates."""

from __future__ import annotations

from typing import ClassVar

from ..graph.core import Expr
from ..records import dataclass
from .base import Condition, Constraint, View


@dataclass(frozen=True)
class Pair(Constraint):
    """Two angles, measured from the part that carries the two axes, in a fixed ratio: a + ratio b = phase."""

    written: ClassVar[bool] = True
    a: Expr
    b: Expr
    ratio: Expr
    phase: Expr

    def conditions(self, view: View) -> list[Condition]:
        return [Condition("ratio", self.a + self.ratio * self.b - self.phase, "angle")]


class Gear(Pair):
    """Two gears that roll on each other's pitch circles.

    ratio = r_b / r_a outside and -r_b / r_a where one gear is internal (Shabana, Computational Dynamics, sec. 3.2;
    Norton, Design of Machinery, eq. 9.1).
    """

    type_name: ClassVar[str] = "gear"


class Belt(Pair):
    """A belt or chain that does not stretch or slip on two pulleys: r_a a = r_b b, with b reversed where it crosses.

    (Norton, Design of Machinery, sec. 9.11.)
    """

    type_name: ClassVar[str] = "belt"


@dataclass(frozen=True)
class Rack(Constraint):
    """A pinion that rolls on a rack: s = r a + offset (Norton, Design of Machinery, sec. 9.3)."""

    type_name: ClassVar[str] = "rack"
    written: ClassVar[bool] = True
    pinion: Expr
    rack: Expr
    radius: Expr
    offset: Expr

    def conditions(self, view: View) -> list[Condition]:
        return [Condition("travel", self.rack - self.radius * self.pinion - self.offset, "length")]


@dataclass(frozen=True)
class Planetary(Constraint):
    """A planetary set; angles of sun, ring and carrier from the frame, that of the planet from the carrier.

    Sun and planet mesh outside, ring and planet inside (Willis; Norton, Design of Machinery, sec. 9.9):

        r_s (sun - carrier) + r_p planet = 0,    r_r (ring - carrier) - r_p planet = 0,

    and, without the planet, their sum r_s sun + r_r ring = (r_s + r_r) carrier.  A wheel that is fixed to the frame has
    the angle 0; one whose radius is None is not there.
    """

    type_name: ClassVar[str] = "planetary"
    written: ClassVar[bool] = True
    sun: Expr
    ring: Expr
    carrier: Expr
    planet: Expr | None  #: angle from the carrier; None if the planets are not bodies of the model
    sun_radius: Expr | None
    ring_radius: Expr | None
    planet_radius: Expr | None
    phase: Expr

    def conditions(self, view: View) -> list[Condition]:
        r_s, r_r, r_p = self.sun_radius, self.ring_radius, self.planet_radius
        rows: list[Condition] = []
        if self.planet is None:
            if r_s is not None and r_r is not None:
                mean = (r_s * self.sun + r_r * self.ring) / (r_s + r_r)
                rows.append(Condition("ratio", mean - self.carrier - self.phase, "angle"))
            return rows
        if r_p is None and r_s is not None and r_r is not None:
            r_p = 0.5 * (r_r - r_s)
        if r_p is None:
            return rows
        if r_s is not None:
            sun = r_s / r_p * (self.sun - self.carrier) + self.planet
            rows.append(Condition("sun_mesh", sun - self.phase, "angle"))
        if r_r is not None:
            ring = r_r / r_p * (self.ring - self.carrier) - self.planet
            rows.append(Condition("ring_mesh", ring, "angle"))
        return rows
