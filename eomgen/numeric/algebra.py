"""Stage numeric: NumPy's linear algebra -> the same results, or an error of eomgen's that says what is wrong.

``numpy.linalg`` raises ``LinAlgError`` for matrices that are singular or hold no numbers, which a user's values can
bring about anywhere.  Here such a matrix is a :class:`~..errors.NonFiniteError` or an :class:`~..errors.UnsolvedError`,
which callers handle as every failed evaluation.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import EvaluationError, NonFiniteError, UnsolvedError
from .space import Array


def _failed(what: str, *matrices: Any) -> EvaluationError:
    if not all(np.isfinite(matrix).all() for matrix in matrices):
        return NonFiniteError(f"{what}: a matrix holds entries that are no finite numbers")
    return UnsolvedError(f"{what}: the matrix is singular, or its entries are too far apart in size")


def svd(A: Any, full_matrices: bool = True) -> tuple[Array, Array, Array]:
    """U, singular values, V^T."""
    try:
        U, sizes, Vt = np.linalg.svd(A, full_matrices=full_matrices)
    except np.linalg.LinAlgError:
        raise _failed("singular values cannot be found", A) from None
    if not np.isfinite(sizes).all():
        raise _failed("singular values cannot be found", A)
    return U, sizes, Vt


def singular_values(A: Any) -> Array:
    """Singular values, the largest first."""
    try:
        sizes = np.asarray(np.linalg.svd(A, compute_uv=False))
    except np.linalg.LinAlgError:
        raise _failed("singular values cannot be found", A) from None
    if not np.isfinite(sizes).all():
        raise _failed("singular values cannot be found", A)
    return sizes


def eigh(A: Any) -> tuple[Array, Array]:
    """Eigenvalues and eigenvectors of a symmetric matrix."""
    try:
        values, vectors = np.linalg.eigh(A)
    except np.linalg.LinAlgError:
        raise _failed("eigenvalues cannot be found", A) from None
    return values, vectors


def eigvalsh(A: Any) -> Array:
    """Eigenvalues of a symmetric matrix, the smallest first."""
    try:
        return np.asarray(np.linalg.eigvalsh(A))
    except np.linalg.LinAlgError:
        raise _failed("eigenvalues cannot be found", A) from None


def eig(A: Any) -> tuple[Any, Any]:
    """Eigenvalues and eigenvectors, complex where they are."""
    try:
        values, vectors = np.linalg.eig(A)
    except np.linalg.LinAlgError:
        raise _failed("eigenvalues cannot be found", A) from None
    return values, vectors


def eigvals(A: Any) -> Any:
    """Eigenvalues, complex where they are."""
    try:
        return np.linalg.eigvals(A)
    except np.linalg.LinAlgError:
        raise _failed("eigenvalues cannot be found", A) from None


def solve(A: Any, b: Any) -> Array:
    """x with A x = b."""
    try:
        return np.asarray(np.linalg.solve(A, b))
    except np.linalg.LinAlgError:
        raise _failed("linear equations have no solution", A, b) from None


def inv(A: Any) -> Any:
    """A^-1."""
    try:
        return np.linalg.inv(A)
    except np.linalg.LinAlgError:
        raise _failed("a matrix has no inverse", A) from None


def pinv(A: Any, rcond: float | None = None) -> Array:
    """A^+; entries of A below ``rcond`` of the largest singular value count as zero."""
    try:
        return np.asarray(np.linalg.pinv(A) if rcond is None else np.linalg.pinv(A, rcond=rcond))
    except np.linalg.LinAlgError:
        raise _failed("a matrix has no pseudo-inverse", A) from None


def lstsq(A: Any, b: Any, rcond: float | None = None) -> Array:
    """The x of least norm with least |A x - b|."""
    try:
        return np.asarray(np.linalg.lstsq(A, b, rcond=rcond)[0])
    except np.linalg.LinAlgError:
        raise _failed("linear equations have no solution", A, b) from None


def cholesky(A: Any) -> Array:
    """L with L L^T = A."""
    try:
        return np.asarray(np.linalg.cholesky(A))
    except np.linalg.LinAlgError:
        raise _failed("a matrix is not positive definite", A) from None


def cond(A: Any) -> float:
    """The largest singular value over the smallest."""
    try:
        return float(np.linalg.cond(A))
    except np.linalg.LinAlgError:
        raise _failed("a condition number cannot be found", A) from None


def norm2(A: Any) -> float:
    """The largest singular value."""
    return float(singular_values(A).max(initial=0.0))
