"""Poses of the bodies at nearby positions -> their velocities, momenta and accelerations.

Everything here follows from the description of the bodies (mass, centre of mass, inertia) and from where they are: no
velocity, acceleration, Jacobian or mass matrix of the derivation enters.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ..expr.core import Expr
from ..model.mechanism import Mechanism
from .digits import Number, Numbers, array


def cross(a: Numbers, b: Numbers) -> Numbers:
    """a x b"""
    return array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


class Pose(NamedTuple):
    """Rotation (3, 3) from body to ground axes, and position (3,) of the body's origin in ground axes (m)."""

    rotation: Numbers
    position: Numbers


class Twist(NamedTuple):
    """Angular velocity, and velocity of the body's origin, ground axes; of a displacement: per unit of it."""

    angular: Numbers
    linear: Numbers

    @property
    def moves(self) -> bool:
        return any(self.angular) or any(self.linear)

    def at(self, arm: Numbers) -> Numbers:
        """Velocity of a point of the body, ``arm`` from its origin in ground axes."""
        return array(self.linear + cross(self.angular, arm))


def poses_of(flat: Numbers) -> list[Pose]:
    """Poses from 16 numbers a body, row by row."""
    return [Pose(T[:3, :3], T[:3, 3]) for T in flat.reshape(-1, 4, 4)]


def difference(ahead: Pose, behind: Pose, here: Pose, step: Number) -> Twist:
    """The twist from poses a step ahead and a step behind: [omega] = R' R^T."""
    rate = (ahead.rotation - behind.rotation) / (2 * step)
    return Twist(axial(rate @ here.rotation.T), (ahead.position - behind.position) / (2 * step))


def axial(A: Numbers) -> Numbers:
    """The vector of the skew-symmetric part of a matrix."""
    return array([(A[2, 1] - A[1, 2]) / 2, (A[0, 2] - A[2, 0]) / 2, (A[1, 0] - A[0, 1]) / 2])


def second_difference(ahead: Pose, behind: Pose, here: Pose, step: Number) -> Twist:
    """Angular acceleration and acceleration of the origin: R'' R^T = [alpha] + [omega]^2, whose last part is
    symmetric."""
    bend, linear = ((a - 2 * b + c) / (step * step) for a, b, c in zip(ahead, here, behind, strict=True))
    return Twist(axial(bend @ here.rotation.T), linear)


class Rigid(NamedTuple):
    """A body at one state: mass, arm from the origin to the centre of mass, inertia about it, both in ground axes."""

    mass: Number
    arm: Numbers
    inertia: Numbers

    def needed(self, rate: Twist, omega: Numbers) -> tuple[Numbers, Numbers]:
        """m a and J alpha + omega x J omega."""
        a = rate.at(self.arm) + cross(omega, cross(omega, self.arm))
        return self.mass * a, self.inertia @ rate.angular + cross(omega, self.inertia @ omega)

    def product(self, w: Twist, z: Twist) -> Number:
        return self.mass * (w.at(self.arm) @ z.at(self.arm)) + w.angular @ (self.inertia @ z.angular)


def described(mechanism: Mechanism) -> list[Expr]:
    """Mass, centre of mass (3) and inertia about it (9) of all bodies, as they were described: 13 a body."""
    return [x for body in mechanism.bodies for x in (body.mass, *body.com, *(e for row in body.inertia for e in row))]


def rigid_bodies(numbers: Numbers, poses: Sequence[Pose]) -> list[Rigid]:
    """Bodies where they are."""
    return [
        Rigid(rows[0], pose.rotation @ rows[1:4], pose.rotation @ rows[4:].reshape(3, 3) @ pose.rotation.T)
        for rows, pose in zip(numbers.reshape(-1, 13), poses, strict=True)
    ]
