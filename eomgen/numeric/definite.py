"""Stage numeric: a mass matrix -> whether it is safely positive definite, whatever the sizes of its coordinates.

Each pivot is compared with its own diagonal entry, whose rounding it carries, so that scales do not interact.  Only
what rounding leaves of a zero, far below any inertia beside it, is compared with the largest entry.
"""

from __future__ import annotations

import numpy as np

from ..limits.inertia import NOTHING, SINGULAR, STILL
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
