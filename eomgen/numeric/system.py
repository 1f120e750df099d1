"""Stage numeric: a sparse linear system K z = r that holds accelerations and reactions -> z, redundant rows allowed.

Where constraints are redundant, K is singular and their reactions are not determined, though accelerations are.  The
proximal point method then finds the reactions of least size: K less a small number at the places of the constraints is
factored once, and its steps repeated until K z = r holds (R. T. Rockafellar, Monotone operators and the proximal point
algorithm, SIAM J. Control Optim. 14 (1976), 877-898).  The same steps refine away rounding.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..errors import NonFiniteError, SingularMassMatrixError
from .scales import Array

RELAXATION = 1e-10  #: subtracted from the balanced K at the places of constraints
PIVOT = 1e-14  #: the balanced, relaxed K counts as singular where its inverse has an entry above 1 / PIVOT
STEPS = 30


class Pattern:
    """Where the entries of K stand.

    Parameters
    ----------
    described : mapping
        ``size``, ``rows`` and ``columns`` of the entries, ``relaxed`` places, as the metadata of a model has them.
    """

    def __init__(self, described: Mapping[str, Any]) -> None:
        self.size: int = described["size"]
        self.places = np.array(described["rows"], dtype=np.intp), np.array(described["columns"], dtype=np.intp)
        relaxed = np.array(described["relaxed"], dtype=np.intp).reshape(-1, 2)
        self.relaxed = relaxed[:, 0], relaxed[:, 1]

    def factor(self, entries: Array, sizes: Array) -> Factored:
        """Balance and invert K.

        Rows and columns are scaled until their largest entries are about 1; those of constraints by one common factor
        beside their sizes, since a redundant constraint may have no entries but rounding.

        Parameters
        ----------
        entries : array
            At the places of the pattern.
        sizes : array
            Typical sizes of the constraints, one per relaxed place.

        Raises
        ------
        NonFiniteError, SingularMassMatrixError
        """
        K = np.zeros((self.size, self.size))
        K[self.places] = entries
        if not np.isfinite(K).all():
            raise NonFiniteError("the equations of motion are not finite")
        scales = np.ones(self.size), np.ones(self.size)
        for scale, constraints in zip(scales, self.relaxed, strict=True):
            scale[constraints] /= sizes
        row, column = scales
        for k in range(8):  # D. Ruiz, RAL-TR-2001-034
            largest = np.abs(row[:, None] * K * column).max(axis=1 - k % 2)
            constraints = self.relaxed[k % 2]
            largest[constraints] = largest[constraints].max(initial=0.0)
            scales[k % 2][:] /= np.sqrt(np.where(largest > 0.0, largest, 1.0))
        balanced = row[:, None] * K * column
        balanced[self.relaxed] -= RELAXATION
        try:
            inverse: Array = np.asarray(np.linalg.inv(balanced), dtype=np.float64)
        except np.linalg.LinAlgError:
            inverse = np.full((1, 1), np.inf)
        if not np.abs(inverse).max(initial=0.0) <= 1.0 / PIVOT:
            raise SingularMassMatrixError("the equations of motion are singular: no inertia is behind some motion")
        return Factored(K, inverse, row, column)


class Factored:
    """K with the inverse of its balanced and relaxed form."""

    def __init__(self, K: Array, inverse: Array, row: Array, column: Array) -> None:
        self.K, self.inverse, self.row, self.column = K, inverse, row, column

    def solve(self, r: Array) -> Array:
        """z (n,) with K z = r (n,)."""
        z = np.zeros(len(r))
        before = np.inf
        for count in range(STEPS):
            defect = self.row * (r - self.K @ z)
            size = float(np.abs(defect).max(initial=0.0))
            if not np.isfinite(size):
                raise NonFiniteError("the accelerations are not finite")
            if size == 0.0 or (count > 1 and size > 0.5 * before):
                break
            before = size
            z = z + self.column * (self.inverse @ defect)
        return z
