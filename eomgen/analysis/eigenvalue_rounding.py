"""Analysis: a matrix of small motions -> which of its eigenvalues rounding alone could move to the imaginary axis.

The matrix is balanced first (B. N. Parlett, C. Reinsch, Balancing a matrix for calculation of eigenvalues and
eigenvectors, Numer. Math. 13 (1969), 293-304), so that stiff parts do not drown slow ones; an eigenvalue is then
uncertain as far as its component of the pseudospectrum of rounding reaches (L. N. Trefethen, M. Embree, Spectra and
Pseudospectra, 2005, section 2).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base import algebra
from ..base.algebra import Array, Indices
from ..base.limits.numbers import EPS, TINY

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

ROUNDING = 10.0 * EPS  #: relative error of the entries of a matrix that is exact but for rounding
BALANCED = 100.0 * EPS  #: what rounding leaves of a balance, relative to what a unit displacement does to it
ROUNDS = 30  #: of balancing, at most
GAP = 10.0  #: between eigenvalues that are judged together and those apart
NODES = 32  #: of the contour around them
WAY = (0.0, 0.25, 0.5, 0.75)  #: places between the axis and an eigenvalue that are looked at
SWEEPS = 12  #: of Jacobi's method, at most


def stability_of_matrix(
    A: Array, own: Array | None = None, error: float = ROUNDING, errors: Array | None = None
) -> str:
    """'asymptotically stable', 'marginal' or 'unstable', by the largest real part of the eigenvalues.

    Without states it is 'no freedom': what drivers and constraints hold entirely is neither.

    Parameters
    ----------
    A : (n, n) array
        Of s' = A s (1/s).
    own : (n_dof,) array, optional
        Accelerations of the model's own forces in units of the last n_dof states' displacements (1/s^2): slopes of
        forces far below them are rounding.
    error : float
        Relative error of A.
    errors : (n, n) array, optional
        Bounds for the errors of its entries, which can split a double zero by their root.
    """
    if not A.size:
        return "no freedom"
    scale = _balance(A, own)
    balanced = A * scale / scale[:, None]
    values = algebra.eigvals(balanced)
    far = error * float(algebra.norm2(balanced))
    zero = np.array([_reaches_axis(balanced, complex(value), far) for value in values])
    if errors is not None:
        scale = _balance(np.maximum(np.abs(A), errors), own)  # so that what is but an error is not blown up
        balanced, scaled = A * scale / scale[:, None], errors * scale / scale[:, None]
        for k in np.flatnonzero(~zero & (values.real > 0.0)):
            zero[k] = _reaches_axis_in_cluster(balanced, scaled, np.abs(values), complex(values[k]))
    if (values.real[~zero] > 0.0).any():
        return "unstable"
    return "marginal" if zero.any() else "asymptotically stable"


def _reaches_axis(A: Array, value: complex, far: float) -> bool:
    """Whether a change of A by a norm of `far` can move an eigenvalue to the imaginary axis, straight on."""
    identity = np.eye(len(A))
    return all(algebra.singular_values(A - (1j * value.imag + part * value.real) * identity)[-1] <= far for part in WAY)


def _reaches_axis_in_cluster(A: Array, errors: Array, sizes: Array, value: complex) -> bool:
    """The same within the invariant subspace of an eigenvalue and all smaller ones, with the errors that it sees.

    The subspace is that of the spectral projector, a contour integral of the resolvent (T. Kato, Perturbation Theory
    for Linear Operators, 1980, section I.5.3), which no defective eigenvalue spoils.
    """
    sizes = np.sort(sizes)
    wider = sizes[sizes > GAP * abs(value)]
    if not wider.size:
        return False
    inner = sizes[sizes <= GAP * abs(value)]
    radius = float(np.sqrt(inner[-1] * wider[0]))
    nodes = radius * np.exp(2j * np.pi * (np.arange(NODES) + 0.5) / NODES)
    identity = np.eye(len(A))
    try:
        projector = np.mean([z * np.linalg.inv(z * identity - A) for z in nodes], axis=0).real
    except np.linalg.LinAlgError:
        return False
    basis = algebra.svd(projector)[0][:, : len(inner)]
    left = basis.T @ projector
    far = float(algebra.norm2(np.abs(left) @ errors @ np.abs(basis)))
    return _reaches_axis(left @ A @ basis, value, far)


def _balance(A: Array, own: Array | None) -> Array:
    """Units of the states that make rows and columns alike; forces of the model keep rows from being blown up."""
    sizes = np.abs(A)
    if own is not None and len(own) and len(A) >= 2 * len(own):
        n = len(own)
        rows = np.arange(len(A) - n, len(A))
        sizes[rows, rows - n] = np.maximum(sizes[rows, rows - n], own)
        sizes[rows - n, rows] = np.maximum(sizes[rows - n, rows], TINY)
    np.fill_diagonal(sizes, 0.0)
    d = np.ones(len(A))
    for _ in range(ROUNDS):
        worst = 1.0
        for i in range(len(A)):
            row, column = float(np.linalg.norm(sizes[i])), float(np.linalg.norm(sizes[:, i]))
            if row > 0.0 and column > 0.0:
                f = 2.0 ** round(0.5 * np.log2(row / column))
                sizes[i] /= f
                sizes[:, i] *= f
                d[i] *= f
                worst = max(worst, f, 1.0 / f)
        if worst <= 2.0:
            break
    return d


def own_accelerations(module: BoundModel, t: float, x: Array, B: Array, velocities: Indices, mass: Array) -> Array:
    """Accelerations that the forces of the model would make if they did not balance, scaled (1/s^2), (n_dof,).

    Parameters
    ----------
    module : BoundModel
    t : float
    x : (n_x,) array
    B : (n_v, n_dof) array
        Virtual displacements.
    velocities : (n_dof,) indices
    mass : (n_dof, n_dof) array
        Embedded.
    """
    if not len(mass):
        return np.zeros(0)
    forces = np.abs(B).T @ np.abs(module.kernels.bias(t, x))
    try:
        return np.asarray(np.abs(np.linalg.inv(mass)) @ forces / module.layout.scales.q[velocities])
    except np.linalg.LinAlgError:
        return np.ones(len(mass))


def graded_modes(M: Array, K: Array, shapes: Array) -> tuple[Array, Array]:
    """Squares of frequencies and shapes of symmetric M and K, slow modes as accurate as K has them.

    By Jacobi's method on the nearly diagonal K of modes, which keeps small eigenvalues next to large ones (J. Demmel,
    K. Veselic, Jacobi's method is more accurate than QR, SIAM J. Matrix Anal. Appl. 13 (1992), 1204-1245).
    """
    S = shapes / np.sqrt(np.einsum("ik,ij,jk->k", shapes, M, shapes))
    T = S.T @ K @ S
    T = 0.5 * (T + T.T)
    for _ in range(SWEEPS):
        turned = False
        for i in range(len(T)):
            for j in range(i):
                if abs(T[i, j]) <= EPS * np.sqrt(abs(T[i, i] * T[j, j])) + TINY:
                    continue
                angle = 0.5 * np.arctan2(2.0 * T[i, j], T[i, i] - T[j, j])
                if T[i, i] < T[j, j]:  # the smaller of both turns
                    angle = 0.5 * np.arctan(2.0 * T[i, j] / (T[i, i] - T[j, j]))
                c, s = np.cos(angle), np.sin(angle)
                turn = np.array([[c, -s], [s, c]])
                T[:, [i, j]] = T[:, [i, j]] @ turn
                T[[i, j]] = turn.T @ T[[i, j]]
                S[:, [i, j]] = S[:, [i, j]] @ turn
                T[i, j] = T[j, i] = 0.0
                turned = turned or abs(s) > EPS
        if not turned:
            break
    order = np.argsort(T.diagonal())
    return np.asarray(T.diagonal()[order]), np.asarray(S[:, order])
