"""Linear algebra on numbers: NumPy's results, or an error of eomgen's that says what is wrong.

``numpy.linalg`` raises ``LinAlgError`` for matrices that are singular or hold no numbers, which a user's values can
bring about anywhere.  Here such a matrix is a :class:`~..errors.NonFiniteError` or an :class:`~..errors.UnsolvedError`,
which callers handle as every failed evaluation.

Each pivot is compared with its own diagonal entry, whose rounding it carries, so that scales do not interact.  Only
what rounding leaves of a zero, far below any inertia beside it, is compared with the largest entry.
"""

from __future__ import annotations

from types import TracebackType
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..errors import EvaluationError, NonFiniteError, SingularMassMatrixError, UnsolvedError
from .limits.numbers import NOTHING, SINGULAR

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.intp]


def _failed(what: str, *matrices: Any) -> EvaluationError:
    if not all(np.isfinite(matrix).all() for matrix in matrices):
        return NonFiniteError(f"{what}: a matrix has entries that are not finite")
    return UnsolvedError(f"{what}: the matrix is singular, or its entries differ too much in size")


class _NamedFailure:
    """NumPy's LinAlgError within the block -> an error that says what failed, and why."""

    def __init__(self, what: str, *matrices: Any) -> None:
        self.what, self.matrices = what, matrices

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if isinstance(error, np.linalg.LinAlgError):
            raise _failed(self.what, *self.matrices) from None


def svd(A: Any, full_matrices: bool = True) -> tuple[Array, Array, Array]:
    """U, singular values, V^T."""
    with _NamedFailure("singular values cannot be found", A):
        U, sizes, Vt = np.linalg.svd(A, full_matrices=full_matrices)
    if not np.isfinite(sizes).all():
        raise _failed("singular values cannot be found", A)
    return U, sizes, Vt


def qr(A: Any, complete: bool = False) -> tuple[Array, Array]:
    """Q of orthonormal columns and the triangle R; ``complete``: Q is square."""
    with _NamedFailure("a matrix has no orthonormal basis", A):
        Q, R = np.linalg.qr(A, mode="complete" if complete else "reduced")
    return Q, R


def singular_values(A: Any) -> Array:
    """Singular values, the largest first."""
    with _NamedFailure("singular values cannot be found", A):
        sizes = np.asarray(np.linalg.svd(A, compute_uv=False))
    if not np.isfinite(sizes).all():
        raise _failed("singular values cannot be found", A)
    return sizes


def eigh(A: Any) -> tuple[Array, Array]:
    """Eigenvalues and eigenvectors of a symmetric matrix."""
    with _NamedFailure("eigenvalues cannot be found", A):
        values, vectors = np.linalg.eigh(A)
    return values, vectors


def eigvalsh(A: Any) -> Array:
    """Eigenvalues of a symmetric matrix, the smallest first."""
    with _NamedFailure("eigenvalues cannot be found", A):
        return np.asarray(np.linalg.eigvalsh(A))


def eig(A: Any) -> tuple[Any, Any]:
    """Eigenvalues and eigenvectors, complex where they are."""
    with _NamedFailure("eigenvalues cannot be found", A):
        values, vectors = np.linalg.eig(A)
    return values, vectors


def eigvals(A: Any) -> Any:
    """Eigenvalues, complex where they are."""
    with _NamedFailure("eigenvalues cannot be found", A):
        return np.linalg.eigvals(A)


def solve(A: Any, b: Any) -> Array:
    """x with A x = b."""
    with _NamedFailure("linear equations have no solution", A, b):
        return np.asarray(np.linalg.solve(A, b))


def inv(A: Any) -> Any:
    """A^-1."""
    with _NamedFailure("a matrix has no inverse", A):
        return np.linalg.inv(A)


def pinv(A: Any, rcond: float | None = None) -> Array:
    """A^+; entries of A below ``rcond`` of the largest singular value count as zero."""
    with _NamedFailure("a matrix has no pseudo-inverse", A):
        return np.asarray(np.linalg.pinv(A) if rcond is None else np.linalg.pinv(A, rcond=rcond))


def lstsq(A: Any, b: Any, rcond: float | None = None) -> Array:
    """The x of least norm with least |A x - b|."""
    with _NamedFailure("linear equations have no solution", A, b):
        return np.asarray(np.linalg.lstsq(A, b, rcond=rcond)[0])


def cholesky(A: Any) -> Array:
    """L with L L^T = A."""
    with _NamedFailure("a matrix is not positive definite", A):
        return np.asarray(np.linalg.cholesky(A))


def cond(A: Any) -> float:
    """The largest singular value over the smallest."""
    with _NamedFailure("a condition number cannot be found", A):
        return float(np.linalg.cond(A))


def norm2(A: Any) -> float:
    """The largest singular value."""
    return float(singular_values(A).max(initial=0.0))


# -- positive definite matrices ----------------------------------------------------------------------------------------


def definite_factor(M: Array, what: str) -> Array:
    """Cholesky's L (n, n) of a mass matrix M, for an analysis, named ``what``, that holds for positive definite ones
    only.
    """
    if not np.isfinite(M).all():
        raise NonFiniteError(f"{what}: the mass matrix is not finite")
    try:
        return np.asarray(np.linalg.cholesky(M))
    except np.linalg.LinAlgError:
        least = float(eigvalsh(correlated(M))[0])
        size = "negative inertia" if least < -SINGULAR else "no inertia"
        raise SingularMassMatrixError(
            f"{what}: a motion has {size} behind it (smallest eigenvalue {least:.2g}), but the mass matrix must be "
            "positive definite"
        ) from None


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
