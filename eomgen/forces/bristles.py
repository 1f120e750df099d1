"""Force elements, the law of bristles: states that friction bends and that hold a body at rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import ClassVar

from ..graph import vectors as vec
from ..graph.core import Expr, sqrt
from ..graph.vectors import Vec3
from ..records import dataclass
from .branches import beyond_zero, where
from .dry_friction import LineFriction, Slip, stribeck_level

UNIT = "J^0.5"  #: of the state of a contact
SUMS = 2  #: how many numbers :meth:`LuGre.sums` has beside one for each state


@dataclass(frozen=True)
class LuGre(LineFriction):
    """Friction of bristles whose state holds a body at rest.

    In a joint the state is the deflection z,

        z' = v - stiffness |v| / c(v) z,  friction = stiffness z + damping z' + viscous v

    after Canudas de Wit, Olsson, Astrom and Lischinsky (1995), IEEE Trans. Autom. Control 40, 419-425, with c(v) of
    :class:`~.friction_laws.Friction`.  In a contact, of normal force N, the state is e = sqrt(stiffness N) z, a vector
    along the surface, whose e^2 / 2 is the energy in the bristles:

        friction = m e + damping N (v - |v| f / c(v)) + viscous N v,  f = m e / N
        e' = m v - stiffness |v| / c(v) e
        m = N / max(sqrt(N / stiffness), |e| / c_s),  c_s the greatest c(v)

    At a constant N this is the law above, with vectors (Velenis, Tsiotras and Canudas de Wit, 2002).  The law above
    gains energy where N rises while bristles are bent: their energy, stiffness N z^2 / 2, rises with it.  Here the
    power m e v of the bristles is (e^2 / 2)' + stiffness |v| / c(v) e^2, whatever N does.  Where N falls, e may stand
    for more than N can hold; then m is as large as c_s allows.  Where damping |v| > 4 c(v) the damping may give more
    than that loss and the viscous part take (Barahanov and Ortega, IEEE Trans. Autom. Control 45, 2000); it
    gives no more than they take here, and nothing where places of contact share states (``shared``).  Between surfaces
    that are apart the bristles spring back, e' = -(stiffness / damping) e.
    """

    formula: ClassVar[str] = (
        r"F_t = -F_n \left(f + \sigma_1 \left(v - \frac{|v|}{c(v)} f\right) + b v\right), \quad "
        r"f = \frac{e}{\max(\sqrt{F_n/\sigma_0}, |e|/c_s)}, \quad "
        r"\dot{e} = \frac{F_n v}{\max(\sqrt{F_n/\sigma_0}, |e|/c_s)} - \sigma_0 \frac{|v|}{c(v)} e"
    )
    joint_formula: ClassVar[str] = (
        r"F = -(\sigma_0 z + \sigma_1 \dot{z} + b v), \quad \dot{z} = v - \sigma_0 \frac{|v|}{c(v)} z"
    )
    dynamic: Expr
    stiffness: Expr
    damping: Expr
    viscous: Expr
    static: Expr | None
    stribeck: Expr | None
    deflections: tuple[Expr, ...]  #: states: z of a joint, e of a contact
    lateral: Vec3 | None = None
    shared: bool = False  #: whether several places of contact have these states

    def along(self, rate: Expr) -> Expr:
        (z,), (change,) = self.deflections, self.rates_along(rate)
        return self.stiffness * z + self.damping * change + self.viscous * rate

    def rates_along(self, rate: Expr) -> tuple[Expr, ...]:
        return (rate - self._decay(rate * rate, rate.graph.apply("abs", rate)) * self.deflections[0],)

    def in_plane(self, slip: Slip) -> Vec3:
        """Of states in the axes of the first surface; those along the normal have no effect."""
        v, viscous = slip.velocity, vec.scale(self.viscous, slip.velocity)
        squared, speed = vec.dot(v, v), _size(v)
        f = vec.scale(1.0 / self._give(slip), self._bent(slip))
        level = stribeck_level(squared, self.dynamic, self.static, self.stribeck)
        if self.shared:
            level = level.graph.apply("max", level, _size(f))
        damped = vec.scale(self.damping, vec.sub(v, vec.scale(speed / level, f)))
        if self.static is not None and not self.shared:  # f is never greater than the level otherwise
            taken = speed * vec.dot(f, f) / level + self.viscous * squared
            power = vec.dot(damped, v)
            gains = level.graph.apply("lt", taken + power, 0.0)
            damped = vec.scale(where(gains, -taken / where(gains, power, 1.0), 1.0), damped)
        return vec.add(vec.add(f, damped), viscous)

    def rates_in_plane(self, slip: Slip) -> tuple[Expr, ...]:
        """Of its states, at one place of contact."""
        *drive, decay, push = self.sums(slip)
        return self.rates_of((*drive, decay, push))

    def sums(self, slip: Slip) -> tuple[Expr, ...]:
        """What one of several places of contact adds: m v, the decay times the normal force, and that force."""
        push = slip.push.graph.apply("max", 0.0, slip.push)
        velocity = vec.transpose_times(slip.axes_of_states(self.lateral), slip.velocity)
        drive = push / self._give(slip)
        squared = vec.dot(slip.velocity, slip.velocity)
        decay = self._decay(squared, _size(slip.velocity))
        return (*(drive * v for v, _ in zip(velocity, self.deflections, strict=False)), push * decay, push)

    def rates_of(self, sums: Sequence[Expr]) -> tuple[Expr, ...]:
        """Rates from what all places of contact add; the decay is the mean of theirs by their normal forces.

        So the power of all bristles is that of their energy and of the decay, which is never negative.
        """
        *drive, decay, push = sums
        touches = push.graph.apply("lt", 0.0, push)
        mean = decay / where(touches, push, 1.0)
        return tuple(
            where(touches, rise - mean * e, back)
            for rise, e, back in zip(drive, self.deflections, self.rates_apart(), strict=True)
        )

    def rates_apart(self) -> tuple[Expr, ...]:
        relaxed = self.stiffness / self.damping
        return tuple(-relaxed * z for z in self.deflections)

    def mapped(self, own: Callable[[Expr], Expr]) -> LuGre:
        static, stribeck = (None if x is None else own(x) for x in (self.static, self.stribeck))
        dynamic, stiffness, damping = own(self.dynamic), own(self.stiffness), own(self.damping)
        return LuGre(dynamic, stiffness, damping, own(self.viscous), static, stribeck, ())

    def holding(self, states: tuple[Expr, ...], lateral: Vec3 | None) -> LuGre:
        return replace(self, deflections=states, lateral=lateral)

    def sharing(self) -> LuGre:
        return replace(self, shared=True)

    def _decay(self, squared: Expr, speed: Expr) -> Expr:
        return self.stiffness * speed / stribeck_level(squared, self.dynamic, self.static, self.stribeck)

    def _bent(self, slip: Slip) -> Vec3:
        return slip.across(self.deflections, self.lateral)

    def _give(self, slip: Slip) -> Expr:
        """What the state is divided by: sqrt(N / stiffness), or more where the normal force does not hold it."""
        graph = slip.push.graph
        pressed = graph.apply("lt", 0.0, slip.push)
        most = self.dynamic if self.static is None else graph.apply("max", self.dynamic, self.static)
        root = sqrt(where(pressed, slip.push, 1.0) / self.stiffness)
        return graph.apply("max", root, _size(self._bent(slip)) / most)


def _size(x: Vec3) -> Expr:
    """The length of a vector; its slope at 0 counts as 0."""
    return beyond_zero(vec.dot(x, x), sqrt)
