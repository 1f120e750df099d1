"""Matrices and inertia tensors of expressions with few operations; solutions of symmetric systems."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import reduce
from operator import add

from . import vectors as vec
from .core import Expr
from .vectors import Mat3, Vec3

# -- rows and systems --------------------------------------------------------------------------------------------------


Matrix = list[list[Expr]]


def dot(a: Sequence[Expr], b: Sequence[Expr]) -> Expr:
    """The product of two rows that are not empty."""
    return combined(a[0].graph.zero, a, b)


def combined(base: Expr, factors: Sequence[Expr], values: Sequence[Expr]) -> Expr:
    """A value with multiples of others."""
    for k, x in zip(factors, values, strict=True):
        base = base + k * x
    return base


def total(terms: Iterable[Expr]) -> Expr:
    """The sum of terms, of which there is one at least."""
    return reduce(add, terms)


def eliminate(matrix: Sequence[Sequence[Expr]], right: Sequence[Expr]) -> list[Expr]:
    """x with A x = right, without exchange of rows: A is positive definite, or I less a contraction."""
    A, (x,) = reduced(matrix, [right])
    return substituted_back(A, x)


def reduced(
    matrix: Sequence[Sequence[Expr]],
    columns: Sequence[Sequence[Expr]],
    before: Callable[[Matrix, Matrix, int], None] = lambda A, columns, k: None,
) -> tuple[Matrix, Matrix]:
    """A matrix with columns on its right, upper triangular; ``before`` may change both before it takes out k."""
    A, result, n = [list(row) for row in matrix], [list(column) for column in columns], len(matrix)
    for k in range(n):
        before(A, result, k)
        for i in range(k + 1, n):
            if A[i][k].is_zero:
                continue
            ratio = A[i][k] / A[k][k]
            for j in range(k + 1, n):
                A[i][j] = A[i][j] - ratio * A[k][j]
            for x in result:
                x[i] = x[i] - ratio * x[k]
    return A, result


def substituted_back(A: Matrix, x: list[Expr]) -> list[Expr]:
    """The solution for a column and an upper triangular matrix."""
    for k in reversed(range(len(x))):
        x[k] = total([x[k], *(-(A[k][j] * x[j]) for j in range(k + 1, len(x)))]) / A[k][k]
    return x


def solve_symmetric(matrix: Sequence[Sequence[Expr]], right: Sequence[Expr]) -> list[Expr]:
    """x with matrix x = right by L^T D L; the last is eliminated first, so that a tree's branches stay apart."""
    n = len(right)
    rows, x = [list(row) for row in matrix], list(right)
    for k in reversed(range(n)):
        for i in range(k):
            if rows[k][i].is_zero:
                continue
            ratio = rows[k][i] / rows[k][k]
            for j in range(i + 1):
                rows[i][j] = rows[i][j] - ratio * rows[k][j]
            x[i] = x[i] - ratio * x[k]
    for i in range(n):
        for j in range(i):
            x[i] = x[i] - rows[i][j] * x[j]
        x[i] = x[i] / rows[i][i]
    return x


# -- matrices and inertia tensors --------------------------------------------------------------------------------------

# A turn about a coordinate axis touches only what it changes.


def symmetric(a: Mat3) -> Mat3:
    """The upper triangle, mirrored."""
    return (a[0], (a[0][1], a[1][1], a[1][2]), (a[0][2], a[1][2], a[2][2]))


def add_matrices(a: Mat3, b: Mat3) -> Mat3:
    """a + b"""
    return (vec.add(a[0], b[0]), vec.add(a[1], b[1]), vec.add(a[2], b[2]))


def subtract_matrices(a: Mat3, b: Mat3) -> Mat3:
    """a - b"""
    return (vec.sub(a[0], b[0]), vec.sub(a[1], b[1]), vec.sub(a[2], b[2]))


def skew(a: Vec3) -> Mat3:
    """[a]: [a] b = a x b"""
    o = a[0].graph.zero
    return ((o, -a[2], a[1]), (a[2], o, -a[0]), (-a[1], a[0], o))


def _axis_of(rotation: Mat3) -> int | None:
    """The coordinate axis that a rotation turns about by an angle; None for other rotations and quarter turns."""
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        about_axis = all(rotation[k][m].is_zero and rotation[m][k].is_zero for m in (i, j))
        if about_axis and rotation[k][k].value == 1.0:
            c, s = rotation[i][i], rotation[j][i]
            if c.is_zero or s.is_zero or c != rotation[j][j] or rotation[i][j] != -s:
                return None
            return k
    return None


def rotate_symmetric(rotation: Mat3, a: Mat3) -> Mat3:
    """R a R^T of a symmetric a."""
    k = _axis_of(rotation)
    if k is not None:
        return symmetric(_turn(rotation, a, k))
    half = vec.product(rotation, a)
    upper = [[vec.dot(half[i], rotation[j]) if j >= i else half[i][j] for j in range(3)] for i in range(3)]
    return symmetric(tuple(tuple(row) for row in upper))  # type: ignore[arg-type]


def rotate(rotation: Mat3, a: Mat3) -> Mat3:
    """R a R^T"""
    k = _axis_of(rotation)
    if k is not None:
        return _turn(rotation, a, k)
    return vec.product(vec.product(rotation, a), vec.transpose(rotation))


def _turn(rotation: Mat3, a: Mat3, k: int) -> Mat3:
    """R a R^T for a turn by an angle about axis k; c^2 + s^2 = 1 saves half of the operations."""
    i, j = (k + 1) % 3, (k + 2) % 3
    c, s = rotation[i][i], rotation[j][i]
    t = s * (a[i][i] - a[j][j]) + c * (a[i][j] + a[j][i])
    result = [list(row) for row in a]
    result[i][i], result[j][j] = a[i][i] - s * t, a[j][j] + s * t
    result[i][j], result[j][i] = c * t - a[j][i], c * t - a[i][j]
    result[i][k], result[j][k] = c * a[i][k] - s * a[j][k], s * a[i][k] + c * a[j][k]
    result[k][i], result[k][j] = c * a[k][i] - s * a[k][j], s * a[k][i] + c * a[k][j]
    return tuple(tuple(row) for row in result)  # type: ignore[return-value]


def shift_tensor(mass: Expr, arm: Vec3) -> Mat3:
    """mass (|d|^2 1 - d d^T): what a point at a distance d adds (Huygens-Steiner)."""
    x, y, z = arm
    mx, my, mz = vec.scale(mass, arm)
    return symmetric(
        ((my * y + mz * z, -(mx * y), -(mx * z)), (x, mx * x + mz * z, -(my * z)), (x, x, mx * x + my * y))
    )
