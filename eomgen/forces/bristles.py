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
SUMS = 3  #: how many numbers :meth:`LuGre.sums` has beside one for each state


@dataclass(frozen=True)
class LuGre(LineFriction):
    """Friction of bristles whose state holds a body at rest.

    In a joint the state is the deflection z,

        z' = v - stiffness |v| / c(v) z,  friction = stiffness z + damping z' + viscous v

    after Canudas de Wit, Olsson, Astrom and Lischinsky (1995), IEEE Trans. Autom. Control 40, 419-425, with c(v) of
    :class:`~.friction_laws.Friction`.  In a contact, of normal force N, the state is e = sqrt(stiffness N) z, a vector
    along the surface, whose e^2 / 2 is the energy in the bristles:

        friction = m (e + damping / stiffness e') + viscous N v
        e' = m v - stiffness |v| / c(v) e
        m = N / max(sqrt(N / stiffness), |e| / c_s),  c_s the greatest c(v)

    At a constant N this is the law above, with vectors (Velenis, Tsiotras and Canudas de Wit, 2002).  The law above
    gains energy where N rises while bristles are bent: their energy, stiffness N z^2 / 2, rises with it.  Here the
    power m e v of the bristles is (e^2 / 2)' + stiffness |v| / c(v) e^2, whatever N does.  Where N falls, e may stand
    for more than N can hold; then m is as large as c_s allows.  The damping takes while e grows with N what it gives
    back while e falls, so that a body that bounces as it slides loses c times the impulse of N, as by the law of
    Canudas de Wit and Tsiotras (1999), Proc. 38th IEEE Conf. Decis. Control, 3746-3751, whose friction is N times that
    of z.  Where damping |v| > 4 c(v) it may give more than the loss and the viscous part take (Barahanov and Ortega,
    IEEE Trans. Autom. Control 45, 2000); it gives no more than they take here.  Between surfaces that are apart the
    bristles spring back, e' = -(stiffness / damping) e.
    """

    formula: ClassVar[str] = (
        r"F_t = -m \left(e + \frac{\sigma_1}{\sigma_0} \dot{e}\right) - F_n b v, \quad "
        r"m = \frac{F_n}{\max(\sqrt{F_n/\sigma_0}, |e|/c_s)}, \quad "
        r"\dot{e} = m v - \sigma_0 \frac{|v|}{c(v)} e"
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

    def along(self, rate: Expr) -> Expr:
        (z,), (change,) = self.deflections, self.rates_along(rate)
        return self.stiffness * z + self.damping * change + self.viscous * rate

    def rates_along(self, rate: Expr) -> tuple[Expr, ...]:
        return (rate - self._decay(rate * rate, rate.graph.apply("abs", rate)) * self.deflections[0],)

    def in_plane(self, slip: Slip) -> Vec3:
        """Of states in the axes of the first surface; those along the normal have no effect."""
        damped, power, loss = self._damping(slip)
        gains = power.graph.apply("lt", loss + power, 0.0)
        damped = vec.scale(where(gains, -loss / where(gains, power, 1.0), 1.0), damped)
        bristles = vec.scale(1.0 / self._give(slip), vec.add(self._bent(slip), damped))
        return vec.add(bristles, vec.scale(self.viscous, slip.velocity))

    def rates_in_plane(self, slip: Slip) -> tuple[Expr, ...]:
        """Of its states, at one place of contact."""
        *drive, decay, push, _ = self.sums(slip)
        return self.rates_of((*drive, decay, push, decay.graph.zero))

    def sums(self, slip: Slip) -> tuple[Expr, ...]:
        """What one of several places of contact adds: m v, the decay times N, N, and the decay that damping needs."""
        push = _pressing(slip)
        velocity = vec.transpose_times(slip.axes_of_states(self.lateral), slip.velocity)
        drive = push / self._give(slip)
        decay, bent = self._decay_in_plane(slip), self._bent(slip)
        power = self._damping(slip)[1]
        stored = vec.dot(bent, bent)
        gives = push.graph.apply("lt", power, 0.0)  # only bent bristles do
        needed = where(gives, push.graph.apply("min", decay, -power / where(gives, stored, 1.0)), 0.0)
        return (*(drive * v for v, _ in zip(velocity, self.deflections, strict=False)), push * decay, push, needed)

    def rates_of(self, sums: Sequence[Expr]) -> tuple[Expr, ...]:
        """Rates from what all places of contact add; the decay is the mean of theirs by their normal forces.

        So the power of all bristles is that of their energy and of the decay, which is never negative, nor less than
        what the damping gives.
        """
        *drive, decay, push, needed = sums
        touches = push.graph.apply("lt", 0.0, push)
        mean = push.graph.apply("max", decay / where(touches, push, 1.0), needed)
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

    def _decay(self, squared: Expr, speed: Expr) -> Expr:
        return self.stiffness * speed / stribeck_level(squared, self.dynamic, self.static, self.stribeck)

    def _decay_in_plane(self, slip: Slip) -> Expr:
        return self._decay(vec.dot(slip.velocity, slip.velocity), _size(slip.velocity))

    def _damping(self, slip: Slip) -> tuple[Vec3, Expr, Expr]:
        """damping / stiffness e', its power, and what the decay and viscous friction take."""
        push, bent, decay = _pressing(slip), self._bent(slip), self._decay_in_plane(slip)
        drive = push / self._give(slip)
        change = vec.sub(vec.scale(drive, slip.velocity), vec.scale(decay, bent))
        damped = vec.scale(self.damping / self.stiffness, change)
        viscous = self.viscous * push * vec.dot(slip.velocity, slip.velocity)
        return damped, drive * vec.dot(damped, slip.velocity), decay * vec.dot(bent, bent) + viscous

    def _bent(self, slip: Slip) -> Vec3:
        return slip.across(self.deflections, self.lateral)

    def _give(self, slip: Slip) -> Expr:
        """What the state is divided by: sqrt(N / stiffness), or more where the normal force does not hold it."""
        graph = slip.push.graph
        pressed = graph.apply("lt", 0.0, slip.push)
        most = self.dynamic if self.static is None else graph.apply("max", self.dynamic, self.static)
        root = sqrt(where(pressed, slip.push, 1.0) / self.stiffness)
        return graph.apply("max", root, _size(self._bent(slip)) / most)


def _pressing(slip: Slip) -> Expr:
    return slip.push.graph.apply("max", 0.0, slip.push)


def _size(x: Vec3) -> Expr:
    """The length of a vector; its slope at 0 counts as 0."""
    return beyond_zero(vec.dot(x, x), sqrt)
