"""Stage kinematics, elimination: a small linear system on the graph -> its solution, written out."""

from __future__ import annotations

from collections.abc import Sequence

from ..graph.core import Expr

Matrix = list[list[Expr]]


def eliminate(matrix: Sequence[Sequence[Expr]], right: Sequence[Expr]) -> list[Expr]:
    """x with A x = right, without exchange of rows: A is positive definite, or I less a contraction."""
    A, x, n = [list(row) for row in matrix], list(right), len(right)
    for k in range(n):
        for i in range(k + 1, n):
            if A[i][k].is_zero:
                continue
            ratio = A[i][k] / A[k][k]
            for j in range(k + 1, n):
                A[i][j] = A[i][j] - ratio * A[k][j]
            x[i] = x[i] - ratio * x[k]
    for k in reversed(range(n)):
        x[k] = total([x[k], *(-(A[k][j] * x[j]) for j in range(k + 1, n))]) / A[k][k]
    return x


def dot(a: Sequence[Expr], b: Sequence[Expr]) -> Expr:
    """The product of two rows that are not empty."""
    return total([x * y for x, y in zip(a, b, strict=True)])


def combined(base: Expr, factors: Sequence[Expr], values: Sequence[Expr]) -> Expr:
    """A value with multiples of others."""
    return total([base, *(k * x for k, x in zip(factors, values, strict=True))])


def total(terms: Sequence[Expr]) -> Expr:
    """The sum of terms, of which there is one at least."""
    found = terms[0]
    for term in terms[1:]:
        if not term.is_zero:
            found = found + term
    return found
