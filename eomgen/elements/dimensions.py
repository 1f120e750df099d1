"""Elements, dimensions: the powers of length, mass and time in which a quantity is measured.

An angle has no dimension.  Forces along a coordinate, stiffnesses and the like depend on whether the coordinate is a
length or an angle: ``reach`` is the power of the coordinate's own dimension, so that energy / reach is a force along a
length and a torque on an angle.
"""

from __future__ import annotations

from typing import NamedTuple

from ..base.limits.numbers import POWERS


class Dimension(NamedTuple):
    """Powers of length, mass, time, of the coordinate that is acted on, of electric current and temperature."""

    length: float = 0
    mass: float = 0
    time: float = 0
    reach: float = 0
    current: float = 0
    temperature: float = 0

    def times(self, other: Dimension, power: float = 1) -> Dimension:
        """The dimension of a product with a power of another quantity."""
        return Dimension(*(a + power * b for a, b in zip(self, other, strict=True)))

    def along(self, length: bool) -> Dimension:
        """The dimension where the coordinate that is acted on is a length, or an angle."""
        return self._replace(length=self.length + (self.reach if length else 0), reach=0)

    def alike(self, other: Dimension) -> bool:
        """Whether both are the same, to the rounding of broken powers."""
        return all(abs(a - b) <= POWERS for a, b in zip(self, other, strict=True))


NONE, LENGTH, MASS, TIME, REACH = Dimension(), Dimension(1), Dimension(0, 1), Dimension(0, 0, 1), Dimension(0, 0, 0, 1)
SPEED, ACCELERATION, INERTIA = Dimension(1, 0, -1), Dimension(1, 0, -2), Dimension(2, 1)
FORCE, ENERGY, SPIN, SPIN_RATE = Dimension(1, 1, -2), Dimension(2, 1, -2), Dimension(0, 0, -1), Dimension(0, 0, -2)
PUSH = ENERGY.times(REACH, -1)  #: force along a length, torque on an angle
RATE = REACH.times(TIME, -1)
STIFFNESS, DAMPING = PUSH.times(REACH, -1), PUSH.times(RATE, -1)
