"""Poses of the bodies at nearby positions -> their velocities, momenta and accelerations.

Everything here follows from the description of the bodies (mass, centre of mass, inertia) and from where they are: no
velocity, acceleration, Jacobian or mass matrix of the derivation enters.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ..expr.core import Expr
from ..model.mechanism import Mechanism
from .digits import Number, Numbers

Matrix = list[Numbers]


def dot(a: Sequence[Number], b: Sequence[Number]) -> Number:
    """a . b"""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Sequence[Number], b: Sequence[Number]) -> Numbers:
    """a x b"""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def add(a: Sequence[Number], b: Sequence[Number]) -> Numbers:
    """a + b"""
    return [x + y for x, y in zip(a, b, strict=True)]


def sub(a: Sequence[Number], b: Sequence[Number]) -> Numbers:
    """a - b"""
    return [x - y for x, y in zip(a, b, strict=True)]


def scale(s: Number, a: Sequence[Number]) -> Numbers:
    """s a"""
    return [s * x for x in a]


def times(A: Matrix, b: Sequence[Number]) -> Numbers:
    """A b"""
    return [dot(row, b) for row in A]


def product(A: Matrix, B: Matrix) -> Matrix:
    """A B"""
    columns = transpose(B)
    return [[dot(row, column) for column in columns] for row in A]


def transpose(A: Matrix) -> Matrix:
    """A^T"""
    return [list(column) for column in zip(*A, strict=True)]


class Pose(NamedTuple):
    """Rotation (3 rows) from body to ground axes, and position of the body's origin in ground axes (m)."""

    rotation: Matrix
    position: Numbers


class Twist(NamedTuple):
    """Angular velocity, and velocity of the body's origin, ground axes; of a displacement: per unit of it."""

    angular: Numbers
    linear: Numbers

    @property
    def moves(self) -> bool:
        """Whether it is not rest."""
        return any(self.angular) or any(self.linear)

    def at(self, arm: Sequence[Number]) -> Numbers:
        """Velocity of a point of the body, ``arm`` from its origin in ground axes."""
        return add(self.linear, cross(self.angular, arm))


def poses_of(flat: Numbers) -> list[Pose]:
    """Poses from 16 numbers a body, row by row."""
    return [
        Pose([flat[k + 4 * i : k + 4 * i + 3] for i in range(3)], [flat[k + 4 * i + 3] for i in range(3)])
        for k in range(0, len(flat), 16)
    ]


def difference(ahead: Pose, behind: Pose, here: Pose, step: Number) -> Twist:
    """The twist from poses a step ahead and a step behind: [omega] = R' R^T."""
    two = 2 * step
    rate = [scale(1 / two, sub(a, b)) for a, b in zip(ahead.rotation, behind.rotation, strict=True)]
    return Twist(axial(product(rate, transpose(here.rotation))), scale(1 / two, sub(ahead.position, behind.position)))


def axial(A: Matrix) -> Numbers:
    """The vector of the skew-symmetric part of a matrix."""
    return [(A[2][1] - A[1][2]) / 2, (A[0][2] - A[2][0]) / 2, (A[1][0] - A[0][1]) / 2]


def second_difference(ahead: Pose, behind: Pose, here: Pose, step: Number) -> Twist:
    """Angular acceleration and acceleration of the origin: R'' R^T = [alpha] + [omega]^2, whose last part is
    symmetric."""
    square = step * step

    def second(a: Number, b: Number, c: Number) -> Number:
        return (a - 2 * b + c) / square

    bend = [[second(*x) for x in zip(a, b, c, strict=True)]
            for a, b, c in zip(ahead.rotation, here.rotation, behind.rotation, strict=True)]  # fmt: skip
    linear = [second(*x) for x in zip(ahead.position, here.position, behind.position, strict=True)]
    return Twist(axial(product(bend, transpose(here.rotation))), linear)


class Rigid(NamedTuple):
    """A body at one state: mass, arm from the origin to the centre of mass, inertia about it, both in ground axes."""

    mass: Number
    arm: Numbers
    inertia: Matrix

    def power(self, w: Twist, rate: Twist, omega: Sequence[Number]) -> Number:
        """m a . v(w) + (J alpha + omega x J omega) . omega(w): inertia forces against a virtual velocity w."""
        a = add(rate.at(self.arm), cross(omega, cross(omega, self.arm)))
        moment = add(times(self.inertia, rate.angular), cross(omega, times(self.inertia, omega)))
        return self.mass * dot(a, w.at(self.arm)) + dot(moment, w.angular)

    def product(self, w: Twist, z: Twist) -> Number:
        """m v(w) . v(z) + omega(w) . J omega(z)."""
        return self.mass * dot(w.at(self.arm), z.at(self.arm)) + dot(w.angular, times(self.inertia, z.angular))

    def centre(self, pose: Pose) -> Numbers:
        """The centre of mass, ground axes."""
        return add(pose.position, self.arm)


def described(mechanism: Mechanism) -> list[Expr]:
    """Mass, centre of mass (3) and inertia about it (9) of all bodies, as they were described: 13 a body."""
    return [x for body in mechanism.bodies for x in (body.mass, *body.com, *(e for row in body.inertia for e in row))]


def rigid_bodies(numbers: Numbers, poses: Sequence[Pose]) -> list[Rigid]:
    """Bodies where they are."""
    result = []
    for k, pose in enumerate(poses):
        mass, *rest = numbers[13 * k : 13 * k + 13]
        own = [rest[3:6], rest[6:9], rest[9:12]]
        inertia = product(product(pose.rotation, own), transpose(pose.rotation))
        result.append(Rigid(mass, times(pose.rotation, rest[:3]), inertia))
    return result
