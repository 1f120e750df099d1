"""Analysis: M z'' + C z' + K z = 0 and its first-order form -> its stability in a word.

Of a rigid body that may turn freely, and of every other neutral motion, 0 is a double eigenvalue with one eigenvector:
an error e of the matrix splits it by sqrt(e), so that its sign says nothing.  Where C has no negative part and K is
symmetric, the sign of K decides instead (Kelvin, Tait, Chetaev: D. R. Merkin, Introduction to the Theory of Stability,
1997, chapter 6): no eigenvalue is on the right where K is positive semidefinite, and as many as K has negative ones
where nothing is gyroscopic.  An eigenvalue of K is wrong by e at most, not by its root.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.numbers import EPS
from .eigenvalue_rounding import ROUNDING, graded_modes, stability_of_matrix

MARGIN = 5.0 * ROUNDING  #: relative error of sums of forces, on the safe side


class SecondOrder(NamedTuple):
    """Equations of second order and bounds for the errors of their entries."""

    M: Array  #: (n, n)
    C: Array  #: (n, n)
    K: Array  #: (n, n) by the displacements that the velocities make
    C_error: Array  #: (n, n)
    K_error: Array  #: (n, n)


def stiffness_errors(M: Array, slopes: Array, own: Array, sizes: Array, error: float = MARGIN) -> Array:
    """Bounds (n, n_z) for the errors that rounding leaves in K.

    Of the sums that make an acceleration, of the forces behind them, and of what cancels within one stiff force whose
    other directions do not show it.

    Parameters
    ----------
    M : (n, n) array
    slopes : (n, n_z) array
        Of accelerations by displacements; -M^-1 K.
    own : (n,) array
        Accelerations of the model's own forces, each without the others, per unit displacement.
    sizes : (n_z,) array
        Unit displacements.
    error : float
        Relative error of forces.
    """
    local = np.abs(M) @ np.abs(slopes)
    if len(own):
        local[:, : len(own)] += np.diag(M.diagonal() * own)
    n = len(M)
    stiffest = float((sizes[:n] * np.abs(M @ slopes)[:, :n].diagonal() * sizes[:n]).max(initial=0.0))
    rows = np.ones(n)  # of first-order states, which are no displacements
    rows[: len(sizes)] = sizes[:n]
    shared = 2.0 * EPS * max(1.0, error / MARGIN) * stiffest / np.outer(rows, sizes)
    return np.asarray(error * local + shared)


def symmetric_modes(M: Array, K: Array) -> tuple[Array, Array]:
    """Squares of frequencies, ascending, and shapes (columns, s^T M s = 1) of symmetric M and K."""
    factor = algebra.cholesky(M)
    inverse = algebra.inv(factor)
    reduced = inverse @ K @ inverse.T
    return graded_modes(M, K, inverse.T @ algebra.eigh(0.5 * (reduced + reduced.T))[1])


def uncertainty(squares: Array, shapes: Array, K_error: Array) -> Array:
    """What errors of K can do to each square: to first order, and by rounding of the shapes."""
    sizes = np.abs(shapes) + EPS * np.abs(shapes).sum(axis=1, keepdims=True)
    bound = np.einsum("ik,ij,jk->k", sizes, K_error, sizes)
    return np.asarray(np.maximum(bound, ROUNDING * EPS * np.abs(squares).max(initial=0.0)))


def verdict(
    second: SecondOrder | None,
    A: Array,
    own: Array | None = None,
    error: float = ROUNDING,
    errors: Array | None = None,
) -> str:
    """The stability of s' = A s.

    Parameters
    ----------
    second : SecondOrder or None
        The same equations of second order, where they have that form: displacements z, then velocities z'.
    A : (n, n) array
    own, error, errors
        As for :func:`~.eigenvalue_rounding.stability_of_matrix`, which decides where the signs of K and C do not.
    """
    if second is None or not A.size or not _is_dissipative(second):
        return stability_of_matrix(A, own, error, errors)
    squares, shapes = symmetric_modes(second.M, 0.5 * (second.K + second.K.T))
    bound = uncertainty(squares, shapes, second.K_error)
    if (squares < -bound).any():
        gyroscopic = np.abs(second.C - second.C.T) > second.C_error + second.C_error.T
        return stability_of_matrix(A, own, error, errors) if gyroscopic.any() else "unstable"
    if (squares <= bound).any():
        return "marginal"
    found = stability_of_matrix(A, own, error, errors)
    return found if found == "asymptotically stable" else "stable (undamped)"  # a least potential


def _is_dissipative(second: SecondOrder) -> bool:
    """Whether K is symmetric and C takes no energy from anywhere, up to their errors."""
    K, C, M = second.K, second.C, second.M
    if (np.abs(K - K.T) > second.K_error + second.K_error.T).any():
        return False
    if not np.isfinite(C).all():
        return False
    try:
        inverse = np.linalg.inv(np.linalg.cholesky(M))
    except np.linalg.LinAlgError:
        return False
    rates, shapes = algebra.eigh(inverse @ (0.5 * (C + C.T)) @ inverse.T)
    sizes = np.abs(inverse.T @ shapes)
    bound = np.einsum("ik,ij,jk->k", sizes, second.C_error, sizes)
    return bool((rates >= -bound - ROUNDING * np.abs(rates).max(initial=0.0)).all())
