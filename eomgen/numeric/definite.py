"""Stage numeric: a mass matrix -> whether it is safely positive definite, whatever the sizes of its coordinates.

Each pivot is compared with its own diagonal entry, whose rounding it carries, so that scales do not interact.  Only
what rounding leaves of a zero, far below any inertia beside it, is compared with the largest entry.
"""

from __future__ import annotations

import numpy as np

from ..base.limits.numbers import FAINT, NOTHING, SINGULAR, STILL
from ..errors import NonFiniteError, SingularMassMatrixError
from . import algebra
from .scales import Array


def safely_positive(pivots: Array, sizes: Array) -> bool:
    """Whether each pivot (n,) of L D L^T exceeds 1e-13 of its size (n,) and 1e-22 of the largest; NaN does not."""
    return bool((pivots > np.maximum(SINGULAR * sizes, NOTHING * sizes.max(initial=0.0))).all())


def moves_inertia(pivot: float, B: Array, sizes: Array) -> bool:
    """Whether the inertia behind a single freedom is more than what rounding moves at the dead centre of a toggle.

    Parameters
    ----------
    pivot : float
        B^T M B, scaled.
    B : (n, 1) array
        What moves, scaled.
    sizes : (n,) array
        Diagonal of the scaled mass matrix of the tree.
    """
    return bool(pivot > STILL * sizes[B[:, 0] != 0.0].sum())


def definite_factor(M: Array, what: str) -> Array:
    """Cholesky's L (n, n) of a mass matrix M, for an analysis that holds for positive definite ones only.

    Raises
    ------
    NonFiniteError
        M is not finite.
    SingularMassMatrixError
        M is not positive definite; ``what`` names the analysis.
    """
    if not np.isfinite(M).all():
        raise NonFiniteError(f"{what}: the mass matrix is not finite")
    try:
        return np.asarray(np.linalg.cholesky(M))
    except np.linalg.LinAlgError:
        least = float(algebra.eigvalsh(correlated(M))[0])
        size = "negative inertia" if least < -SINGULAR else "no inertia"
        raise SingularMassMatrixError(
            f"{what}: a motion has {size} behind it (smallest eigenvalue {least:.2g}), but the mass matrix must be "
            "positive definite"
        ) from None


def indefinite_factor(matrix: Array, sizes: Array) -> tuple[Array, Array]:
    """L (n, n), 1 on its diagonal, and d (n,) with matrix = L diag(d) L^T, of a matrix that need not be definite.

    Without pivoting, as in C (templates/c/drivers/ldl.c): what a pivot loses is told by the terms it is the sum of.

    Raises
    ------
    SingularMassMatrixError
        A pivot is less than 1e-8 of the terms that it is the sum of.
    """
    n = len(matrix)
    L, d = np.eye(n), np.zeros(n)
    for j in range(n):
        terms = L[j, :j] ** 2 * d[:j]
        d[j] = matrix[j, j] - terms.sum()
        if not abs(d[j]) > FAINT * (sizes[j] + np.abs(terms).sum()):
            raise SingularMassMatrixError("the mass matrix of the degrees of freedom is singular")
        L[j + 1 :, j] = (matrix[j + 1 :, j] - L[j + 1 :, :j] @ (L[j, :j] * d[:j])) / d[j]
    return L, d


def correlated(M: Array) -> Array:
    """M (n, n) with each coordinate in the unit that makes its own entry 1; 0 where no inertia is behind it.

    Eigenvalues of the result say how well motions can be told apart by their inertia, in any units (A. van der Sluis,
    Numerische Mathematik 14, 1969: this scaling is within a factor of n of the best).
    """
    size = M.diagonal()
    unit = size > NOTHING * np.abs(size).max(initial=0.0)
    negative = size < 0.0
    scale = np.where(unit | negative, 1.0 / np.sqrt(np.where(unit | negative, np.abs(size), 1.0)), 0.0)
    return np.asarray(scale[:, None] * M * scale)
