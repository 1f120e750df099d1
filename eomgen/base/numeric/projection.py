"""Constraint rows and what they have to give -> the least changes that do it."""

from __future__ import annotations

import numpy as np

from .. import algebra
from ..algebra import Array
from ..limits.constraints import TIKHONOV, UNMOVED
from .scales import Scales


def largest(values: Array) -> float:
    """The largest magnitude, 0.0 of nothing, NaN if one is NaN."""
    return float(np.abs(values).max()) if values.size else 0.0


def least(J: Array, y: Array) -> Array:
    """The least x, (n,) or (n, k), with J x = y.

    Parameters
    ----------
    J : (m, n) array
        Scaled Jacobian; redundant rows allowed, with y to match.  Rows that are all zero to rounding, as where
        parameters alone decide whether a loop closes, ask for nothing.
    y : (m,) or (m, k) array

    Raises
    ------
    NonFiniteError
    """
    if not largest(J) > UNMOVED and np.isfinite(J).all():
        return np.zeros((J.shape[1], *y.shape[1:]))
    return algebra.lstsq(J, y, rcond=TIKHONOV**0.5)


def minimum_norm(C_q: Array, y: Array, scales: Scales) -> Array:
    """The smallest scaled x (n, k) with C_q x = y (m, k); y must be consistent, as rates of redundant rows are."""
    return np.asarray(scales.q[:, None] * least(scales.jacobian(C_q), y / scales.c[: len(y), None]))


def tangent_projector(C_q: Array, scales: Scales) -> Array:
    """``P = I - S^2 C_q^T (C_q S^2 C_q^T)^+ C_q`` (n, n).

    The derivative, at a point of the manifold, of the projected q by q and of the projected v by v.
    """
    return np.asarray(np.eye(len(scales.q)) - minimum_norm(C_q, C_q, scales))
