"""Force elements, laws of tyres: slips and a load -> forces along and across the wheel, and a moment about the normal.

Slips have the sign of the motion of the tread over the road: forces oppose them.  A tyre rolls backwards as its mirror
image, fore and aft exchanged, rolls forwards; a way between -1 and 1 blends both around a standstill.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple

from ..base.limits.contacts import NO_SLIP
from ..graph.core import Expr, sqrt
from ..records import dataclass
from .branches import where

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


class TyreLaw(ABC):
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


@dataclass(frozen=True)
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
        along, across = -slope * kappa, -slope * tangent
        if self.half is None:
            return TyreForces(along, across, graph.zero, graph.zero)
        rest = 1.0 - s
        trail = self.half / 3.0 * rest * rest * rest / (rest + s * s / 3.0)
        onwards = where(graph.apply("lt", rolling, 0.0), -slips.way, slips.way)  # the tread's, not the wheel's
        return TyreForces(along, across, -onwards * trail * across, graph.zero)

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


@dataclass(frozen=True)
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
        across = pure * cosine(p("rCy1"), B * (kappa + shift)) / cosine(p("rCy1"), B * shift)
        sway = D * (p("rVy1") + p("rVy2") * excess + p("rVy3") * camber) * cosine(1.0, p("rVy4") * tangent)
        across = across + way * sway * graph.apply("sin", p("rVy5") * atan(p("rVy6") * kappa))
        gain = graph.apply("max", 0.0, along * slips.along + across * tangent)
        return TyreForces(along, across, graph.zero, -way * gain)
