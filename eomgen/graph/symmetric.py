"""Symmetric positive definite systems of expressions -> their solution."""

from __future__ import annotations

from collections.abc import Sequence

from .core import Expr


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
