"""Analysis: linear equations near an iterate -> the correction of least norm, and whether any is left."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.analyses import ARRIVED, CLOSE
from ..base.limits.numbers import EPS
from ..numeric.projection import largest
from .eigenvalue_rounding import BALANCED

RANK = 500.0 * EPS  #: part of the terms of its rows below which a singular value of exact derivatives is rounding


class LinearizedResidual(NamedTuple):
    """Equations near an iterate: J by scaled variables, which move the tree and change unknowns."""

    J: Array  #: (m, k)
    moved: Array  #: (n_v, k) scaled displacements; the first n_z of length 1, at right angles
    changed: Array  #: (j, k) changes of the unknowns
    sizes: Array  #: (m,) of the terms in each row
    noise: float  #: relative error of J
    flow: Array | None  #: (n_v, n_z) how what drives the tree changes along them


class Solver:
    """Solutions of least norm with one J, rows divided by the sizes of their terms."""

    def __init__(self, linear: LinearizedResidual) -> None:
        self.linear = linear
        self.sizes = np.where(linear.sizes > 0.0, linear.sizes, 1.0)
        self.J = linear.J / self.sizes[:, None]
        self.U, values, self.V = algebra.svd(self.J, full_matrices=False)
        self.kept = values > linear.noise
        self.inverse = np.where(self.kept, 1.0 / np.where(self.kept, values, 1.0), 0.0)

    def solve(self, residual: Array) -> Array:
        """The correction."""
        return np.asarray(-self.V.T @ (self.inverse * (self.U.T @ (residual / self.sizes))))

    def shown(self, change: Array) -> Array:
        """The correction as a scaled displacement of the tree and a change of scaled unknowns."""
        return np.concatenate([self.linear.moved @ change, change[self.J.shape[1] - len(self.linear.changed) :]])

    def arrived(self, residual: Array, change: Array, numbers: float) -> bool:
        """Whether no correction and no residual is left but for rounding.

        numbers: scaled size of what the position is made of.
        """
        rounding = BALANCED * numbers
        left = residual / self.sizes + self.J @ change
        answers = np.abs(self.V.T) @ (self.inverse[:, None] * np.abs(self.U.T))
        limit = max(ARRIVED, min(CLOSE, rounding * float(answers.sum(axis=1).max(initial=0.0))))
        return largest(self.shown(change)) <= limit and largest(left) <= rounding
