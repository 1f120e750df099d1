"""Forward dynamics of a tree of revolute joints, by articulated bodies and by mass matrix and factor, on any scalars.

What users of CasADi write, for symbols whose products with 0 and 1 vanish (R. Featherstone, Rigid Body Dynamics
Algorithms, 2008, chapters 5 to 7), with symmetric matrices filled from one half.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

Vector = list[Any]
Matrix = list[list[Any]]


@dataclass(frozen=True)
class Body:
    """One body and the joint to the body before: placement in that body, axis of rotation, inertia about the centre."""

    parent: int
    axis: int
    rotation: Matrix
    position: Vector
    mass: float
    com: Vector
    inertia: Matrix


def add(a: Vector, b: Vector) -> Vector:
    return [x + y for x, y in zip(a, b, strict=True)]


def subtract(a: Vector, b: Vector) -> Vector:
    return [x - y for x, y in zip(a, b, strict=True)]


def scale(s: Any, a: Vector) -> Vector:
    return [s * x for x in a]


def dot(a: Vector, b: Vector) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def apply(A: Matrix, v: Vector) -> Vector:
    return [dot(row, v) for row in A]


def transpose(A: Matrix) -> Matrix:
    return [[A[j][i] for j in range(3)] for i in range(3)]


def product(A: Matrix, B: Matrix) -> Matrix:
    return [[dot(row, column) for column in transpose(B)] for row in A]


def skew(a: Vector, zero: Any) -> Matrix:
    return [[zero, -a[2], a[1]], [a[2], zero, -a[0]], [-a[1], a[0], zero]]


def rotated(E: Matrix, S: Matrix) -> Matrix:
    """E S E^T of a symmetric S."""
    X = product(E, S)
    R = [[X[i][0]] * 3 for i in range(3)]
    for i in range(3):
        for j in range(i, 3):
            R[i][j] = R[j][i] = dot(X[i], E[j])
    return R


class Tree:
    """Rotations, velocities and velocity-product accelerations of all bodies, in their own axes."""

    def __init__(self, bodies: list[Body], q: Vector, v: Vector, sin: Any, cos: Any, number: Any) -> None:
        self.bodies, self.number = bodies, number
        zero, one = number(0.0), number(1.0)
        self.zero, self.one = zero, one
        self.E, self.r, self.w, self.v, self.cw, self.cv = [], [], [], [], [], []
        for b, angle, rate in zip(bodies, q, v, strict=True):
            i, j = (b.axis + 1) % 3, (b.axis + 2) % 3
            turn = [[one if a == c == b.axis else zero for c in range(3)] for a in range(3)]
            turn[i][i] = turn[j][j] = cos(angle)
            turn[i][j], turn[j][i] = -sin(angle), sin(angle)
            E = product([[number(x) for x in row] for row in b.rotation], turn)
            r = [number(x) for x in b.position]
            w, u = ([zero] * 3, [zero] * 3) if b.parent < 0 else (self.w[b.parent], self.v[b.parent])
            w, u = apply(transpose(E), w), apply(transpose(E), add(u, cross(w, r)))
            spin = [rate if k == b.axis else zero for k in range(3)]
            self.E.append(E)
            self.r.append(r)
            self.w.append(add(w, spin))
            self.v.append(u)
            self.cw.append(cross(w, spin))
            self.cv.append(cross(u, spin))

    def inertias(self) -> list[tuple[Any, Vector, Matrix]]:
        """Mass, first moment and inertia about the origin."""
        found = []
        for b in self.bodies:
            h = [b.mass * x for x in b.com]
            square = sum(x * y for x, y in zip(h, b.com, strict=True))
            inertia = [[b.inertia[i][j] + (i == j) * square - h[i] * b.com[j] for j in range(3)] for i in range(3)]
            found.append((self.number(b.mass), list(map(self.number, h)), [list(map(self.number, r)) for r in inertia]))
        return found

    def wrench(self, inertia: tuple[Any, Vector, Matrix], w: Vector, v: Vector) -> tuple[Vector, Vector]:
        """Moment and force of a spatial inertia times a twist."""
        m, h, I = inertia
        return add(apply(I, w), cross(h, v)), subtract(scale(m, v), cross(h, w))

    def product_wrench(self, i: int, inertia: tuple[Any, Vector, Matrix]) -> tuple[Vector, Vector]:
        """What the velocities alone ask for: twist x* (inertia twist)."""
        n, f = self.wrench(inertia, self.w[i], self.v[i])
        return add(cross(self.w[i], n), cross(self.v[i], f)), cross(self.w[i], f)

    def shifted(self, i: int, n: Vector, f: Vector) -> tuple[Vector, Vector]:
        """A wrench of body i about the origin and in the axes of the body before."""
        force = apply(self.E[i], f)
        return add(apply(self.E[i], n), cross(self.r[i], force)), force

    def accelerate(self, i: int, A: list[tuple[Vector, Vector]], gravity: Vector) -> tuple[Vector, Vector]:
        """The acceleration of body i without its own joint's."""
        p = self.bodies[i].parent
        w, v = ([self.zero] * 3, gravity) if p < 0 else A[p]
        v = add(v, cross(w, self.r[i])) if p >= 0 else v
        back = transpose(self.E[i])
        return add(apply(back, w), self.cw[i]), add(apply(back, v), self.cv[i])
