"""Stage numeric: a sparse linear system K z = r that holds accelerations and reactions -> z, redundant rows allowed.

Where constraints are redundant, K is singular and their reactions are not determined, though accelerations are.  The
proximal point method then finds the reactions of least size: K less a small number at the places of the constraints is
solved for, again and again until K z = r holds (R. T. Rockafellar, Monotone operators and the proximal point
algorithm, SIAM J. Control Optim. 14 (1976), 877-898).  The same steps refine away rounding; what is left at the end is
held against it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base.algebra import Array, Indices
from ..base.limits.systems import BALANCED, FAINT, FIRST, LEFT, PIVOT, RELAXATION, ROUNDED, WEAKEST
from ..errors import NonFiniteError, SingularMassMatrixError, UnsolvedError

STEPS = 30
BALANCES = 40  #: of rows and columns in turn, at most


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

    def balance(self, entries: Array, sizes: Array) -> Balanced:
        """Scale K.

        From the units of rows and columns, until their largest entries are about 1; those of constraints by one common
        factor beside their units, since a redundant constraint may have no entries but rounding.

        Parameters
        ----------
        entries : array
            At the places of the pattern.
        sizes : (2 n,) array
            Units of the equations, then of the unknowns.

        Raises
        ------
        NonFiniteError, SingularMassMatrixError
        """
        K = np.zeros((self.size, self.size))
        K[self.places] = entries
        if not np.isfinite(K).all():
            raise NonFiniteError("the equations of motion are not finite")
        row, column = 1.0 / sizes[: self.size], np.array(sizes[self.size :])
        balanced, calm = row[:, None] * K * column, 0
        for k in range(BALANCES):  # D. Ruiz, RAL-TR-2001-034
            largest = np.abs(balanced).max(axis=1 - k % 2)
            constraints = self.relaxed[k % 2]
            largest[constraints] = largest[constraints].max(initial=0.0)
            factor = 1.0 / np.sqrt(np.where(largest > 0.0, largest, 1.0))
            calm = calm + 1 if np.abs(np.log2(factor)).max() <= 0.5 * np.log2(BALANCED) else 0
            (column if k % 2 else row)[:] *= factor
            balanced = row[:, None] * K * column
            if calm == 2:
                break
        first, relaxed = np.array(balanced), np.array(balanced)
        first[self.relaxed] -= FIRST
        relaxed[self.relaxed] -= RELAXATION
        return Balanced(balanced, first, relaxed, row, column, self.relaxed[0])


class Balanced:
    """K with the scales of rows and columns that bring its entries to about 1, and its relaxed forms.

    Raises
    ------
    SingularMassMatrixError
    """

    def __init__(self, K: Array, first: Array, relaxed: Array, row: Array, column: Array, constraints: Indices) -> None:
        self.K, self.first, self.relaxed = K, first, relaxed
        self.row, self.column, self.constraints = row, column, constraints
        probe = np.cos(np.arange(1.0, len(K) + 1.0))[:, None]  # along no axis and no plane
        answer = self._step(self.relaxed, probe)
        if not np.abs(answer).max(initial=0.0) <= 1.0 / PIVOT:
            raise SingularMassMatrixError("the equations of motion are singular: no inertia is behind some motion")

    def _step(self, relaxed: Array, right: Array) -> Array:
        try:
            return np.asarray(np.linalg.solve(relaxed, right), dtype=np.float64)
        except np.linalg.LinAlgError:
            return np.full(right.shape, np.inf)

    def solve(self, r: Array) -> Array:
        """z with K z = r, both (n,) or (n, k).

        Raises
        ------
        NonFiniteError, UnsolvedError
        """
        right = (self.row * r.T).T.reshape(len(r), -1)
        z = np.zeros(right.shape)
        before = np.inf
        for count in range(STEPS + 1):
            defect = right - self.K @ z
            size = float(np.abs(defect).max(initial=0.0))
            if not np.isfinite(size):
                raise NonFiniteError("the accelerations are not finite")
            if size == 0.0 or count == STEPS or (count > 1 and size > 0.5 * before):
                break
            before = size
            z = z + self._step(self.relaxed if count else self.first, defect)
        # a step leaves RELAXATION / (s^2 + RELAXATION) along constraints of singular value s
        weak = max(WEAKEST, RELAXATION * (before / size - 1.0)) if size else 1.0
        limit = np.full((len(r), 1), LEFT)
        limit[self.constraints] = max(LEFT, FAINT / weak)
        terms = np.abs(right) + np.abs(self.K) @ np.abs(z)
        if not (np.abs(defect) <= limit * terms + ROUNDED * terms.max(axis=0, initial=0.0)).all():
            raise UnsolvedError("because of rounding the equations of motion could not be solved")
        return np.asarray((self.column * z.T).T.reshape(r.shape))
