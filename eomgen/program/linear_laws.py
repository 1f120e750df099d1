"""Stage program, linear laws: the gain K of f = N0 + K f -> whether f is certain, and f, written out on the graph.

Forces are certain if they follow from none as they grow in one proportion s from 0 to 1: det(I - s K) > 0 on the way,
so that no real eigenvalue of K is 1 or more.  This does not depend on the order of the laws.  With A = I - K it is the
polynomial whose Bernstein coefficients are sums of the principal minors of A of one size, divided by their number; it
is positive where the coefficients are, of each of the parts into which the way is cut (G. Farin, Curves and Surfaces
for CAGD (2002), ch. 5 and 6).  Thus every A whose principal minors are positive is accepted at once; cutting finds what
rotates, whose eigenvalues are complex.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from ..graph.core import Expr
from ..kinematics.eliminate import Matrix, total

#: How often the way is halved.  Complex eigenvalues z of K are then told from real ones where |Im z| > |z| / 16.
HALVINGS = 3


def grows_from_zero(A: Matrix, one: Expr) -> Expr:
    """1 where det(I - s (I - A)) is positive for all s from 0 to 1 for certain, else 0."""
    graph, n = one.graph, len(A)
    sums = _minor_sums(A)
    parts = [[one, *(e / math.comb(n, k) for k, e in enumerate(sums, 1))]]
    for _ in range(HALVINGS if n > 1 else 0):
        parts = [half for part in parts for half in _halves(part)]
    certain = one
    for part in parts:
        for b in part[1:]:
            certain = certain * graph.apply("lt", 0.0, b)
    return certain


def _minor_sums(A: Matrix) -> list[Expr]:
    """Sums of the principal minors of each size from 1 on (D. K. Faddeev, V. N. Faddeeva (1963), sec. 47)."""
    n, found = len(A), list[Expr]()
    power = [list(row) for row in A]
    for k in range(1, n + 1):
        e = total([power[i][i] for i in range(n)]) / float(k)
        found.append(e)
        if k < n:
            rest = [[(e if i == j else e * 0.0) - power[i][j] for j in range(n)] for i in range(n)]
            power = _product(A, rest)
    return found


def _product(A: Matrix, B: Matrix) -> Matrix:
    n = range(len(A))
    return [[total([A[i][0] * B[0][j], *(A[i][k] * B[k][j] for k in n[1:])]) for j in n] for i in n]


def _halves(part: Sequence[Expr]) -> tuple[list[Expr], list[Expr]]:
    """Bernstein coefficients of either half (P. de Casteljau)."""
    row, first, last = list(part), [part[0]], [part[-1]]
    while len(row) > 1:
        row = [(a + b) * 0.5 for a, b in pairwise(row)]
        first.append(row[0])
        last.append(row[-1])
    return first, last[::-1]


def solve_by_largest_pivots(matrix: Matrix, right: Matrix) -> Matrix:
    """X with A X = B, by columns, with exchange of rows: A may be turned so that a leading entry of it vanishes."""
    A, columns, n = [list(row) for row in matrix], [list(column) for column in right], len(matrix)
    for k in range(n):
        for i in range(k + 1, n):
            if not A[i][k].is_zero:
                _larger_first(A, columns, k, i)
        for i in range(k + 1, n):
            if A[i][k].is_zero:
                continue
            ratio = A[i][k] / A[k][k]
            for j in range(k + 1, n):
                A[i][j] = A[i][j] - ratio * A[k][j]
            for x in columns:
                x[i] = x[i] - ratio * x[k]
    for x in columns:
        for k in reversed(range(n)):
            x[k] = total([x[k], *(-(A[k][j] * x[j]) for j in range(k + 1, n))]) / A[k][k]
    return columns


def _larger_first(A: Matrix, columns: Matrix, k: int, i: int) -> None:
    """Exchange rows k and i where the entry below is larger."""
    graph = A[k][k].graph
    below = graph.apply("lt", graph.apply("abs", A[k][k]), graph.apply("abs", A[i][k]))

    def exchange(a: Expr, b: Expr) -> tuple[Expr, Expr]:
        return graph.apply("select", below, b, a), graph.apply("select", below, a, b)

    for j in range(k, len(A)):
        A[k][j], A[i][j] = exchange(A[k][j], A[i][j])
    for x in columns:
        x[k], x[i] = exchange(x[k], x[i])
