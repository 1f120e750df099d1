"""Mass matrix on the graph + its branch-induced pattern -> straight-line L^T D L solution on the graph.

R. Featherstone, *Rigid Body Dynamics Algorithms* (2008), section 6.5: M = L^T D L with L unit lower triangular and
L[i, j] non-zero only where j lies on the path from i to ground, so that branches never fill in.  No square roots, one
reciprocal per pivot, and zeros of M that the pattern does not know fold as everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..base.limits.numbers import NOTHING, SINGULAR
from ..expr.core import Expr
from . import linear_algebra
from .linear_algebra import Row, SparseFactor

LONG = 24  #: velocities on the way to ground, on average, with which a mass matrix is written out


def path(parent: Sequence[int], index: int) -> list[int]:
    """Indices on the path from `index` (excluded) to ground, nearest first."""
    result = []
    while (index := parent[index]) >= 0:
        result.append(index)
    return result


def factorize(matrix: Sequence[Sequence[Expr]], parent: Sequence[int]) -> SparseFactor:
    """Factor a symmetric matrix with the branch-induced pattern of `parent`; only its lower triangle is read."""
    rows: list[Row] = [{i: row[i]} for i, row in enumerate(matrix)]
    for i, row in enumerate(matrix):
        for j in path(parent, i):
            if not row[j].is_zero:
                rows[i][j] = rows[j][i] = row[j]
    return linear_algebra.factorize(rows, order=range(len(rows))[::-1])


def positivity(matrix: Sequence[Sequence[Expr]], factor: SparseFactor, scales: Sequence[Expr]) -> list[Expr]:
    """Conditions (each 1.0 or 0.0) that all hold exactly where the matrix is safely positive definite.

    Each pivot, made dimensionless by the scales of the coordinates, must exceed 1e-13 of its own diagonal entry, and
    1e-22 of the largest, so that sizes of independent motions do not matter.
    """
    if not matrix:
        return []
    graph = matrix[0][0].graph
    if len(matrix) == 1:
        return [graph.apply("lt", 0.0, matrix[0][0])]
    squares = [s * s for s in scales]
    sizes = [matrix[i][i] * squares[i] for i in range(len(matrix))]
    return exceeding([d * s for d, s in zip(factor.pivots, squares, strict=True)], sizes)


def exceeding(pivots: Sequence[Expr], sizes: Sequence[Expr]) -> list[Expr]:
    """Conditions (each 1.0 or 0.0): each pivot exceeds 1e-13 of its size and 1e-22 of the largest size."""
    graph = pivots[0].graph
    largest, *rest = sizes
    for entry in graph.marked(rest):
        largest = _larger(largest, entry)
    nothing = largest * NOTHING
    conditions = []
    for size, d in graph.marked(zip(sizes, pivots, strict=True)):
        reduced = not (size - d).is_zero
        if reduced:
            conditions.append(graph.apply("lt", size * SINGULAR, d))
        if len(sizes) > 1 or not reduced:
            conditions.append(graph.apply("lt", nothing, d))
    return conditions


def outward(pivots: Sequence[Expr], parent: Sequence[int]) -> list[Expr]:
    """For each articulated inertia the largest of those from there to the leaves, which it is left over from."""
    sizes = list(pivots)
    for k in pivots[0].graph.marked(reversed(range(len(sizes)))):
        if parent[k] >= 0:
            sizes[parent[k]] = _larger(sizes[parent[k]], sizes[k])
    return sizes


def articulated_positivity(pivots: Sequence[Expr], scales: Sequence[Expr], parent: Sequence[int]) -> list[Expr]:
    """Conditions as of :func:`positivity`, by articulated inertias."""
    graph = pivots[0].graph
    pivots = [d * s * s for d, s in graph.marked(zip(pivots, scales, strict=True))]
    if len(pivots) == 1:
        return [graph.apply("lt", graph.zero, pivots[0])]
    return exceeding(pivots, outward(pivots, parent))


def _larger(a: Expr, b: Expr) -> Expr:
    """Plain comparison, not "max": NaN is caught with the result, and this is one instruction."""
    return a.graph.apply("select", a.graph.apply("lt", a, b), b, a)


def _depths(parent: Sequence[int]) -> list[int]:
    """How many velocities lie between each one and ground."""
    depths: list[int] = []
    for above in parent:
        depths.append(depths[above] + 1 if above >= 0 else 0)
    return depths


def factoring_operations(parent: Sequence[int]) -> int:
    """Operations of L^T D L and one solution, in loops over the paths to ground (Featherstone, RBDA, table 6.5).

    Ratios, products and differences; then two substitutions and the division by the pivot.
    """
    return sum(n + n * (n + 1) + 4 * n + 1 for n in _depths(parent))


def has_long_paths(parent: Sequence[int]) -> bool:
    """Whether the mass matrix has too many entries to be written out: more than :data:`LONG` for each velocity."""
    return sum(_depths(parent)) > (LONG - 1) * len(parent)


def is_unrolled(parent: Sequence[int], limit: int) -> bool:
    """Whether factoring the mass matrix takes no more operations than that of a chain of ``limit`` velocities does."""
    return factoring_operations(parent) <= factoring_operations(range(-1, limit - 1))
