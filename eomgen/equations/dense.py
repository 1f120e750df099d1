"""Stage equations: small symmetric positive definite systems on the graph."""

from __future__ import annotations

from collections.abc import Sequence

from ..graph.core import Expr


def solve_symmetric(matrix: Sequence[Sequence[Expr]], right: Sequence[Expr]) -> list[Expr]:
    """x with matrix x = right by L D L^T; unit diagonals and zeros fold away."""
    n = len(right)
    rows, x = [list(row) for row in matrix], list(right)
    for k in range(n):
        for i in range(k + 1, n):
            if rows[i][k].is_zero:
                continue
            ratio = rows[i][k] / rows[k][k]
            for j in range(k + 1, n):
                rows[i][j] = rows[i][j] - ratio * rows[k][j]
            x[i] = x[i] - ratio * x[k]
    for i in reversed(range(n)):
        for j in range(i + 1, n):
            x[i] = x[i] - rows[i][j] * x[j]
        x[i] = x[i] / rows[i][i]
    return x
