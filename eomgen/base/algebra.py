"""Linear algebra on numbers: NumPy's results, or an error of eomgen's that says what is wrong; ranks and partitions.

``numpy.linalg`` raises ``LinAlgError`` for matrices that are singular or hold no numbers, which a user's values can
bring about anywhere.  Here such a matrix is a :class:`~..errors.NonFiniteError` or an :class:`~..errors.UnsolvedError`,
which callers handle as every failed evaluation.

Each pivot is compared with its own diagonal entry, whose rounding it carries, so that scales do not interact.  Only
what rounding leaves of a zero, far below any inertia beside it, is compared with the largest entry.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..errors import EvaluationError, NonFiniteError, PartitionError, SingularMassMatrixError, UnsolvedError
from .limits.constraints import CHOSEN as STRICT
from .limits.constraints import PREFERENCE, UNMOVED
from .limits.constraints import STATE as RANK
from .limits.constraints import STRUCTURE as TOLERANCE
from .limits.numbers import NOTHING, SINGULAR

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.intp]


def _failed(what: str, *matrices: Any) -> EvaluationError:
    if not all(np.isfinite(matrix).all() for matrix in matrices):
        return NonFiniteError(f"{what}: a matrix has entries that are not finite")
    return UnsolvedError(f"{what}: the matrix is singular, or its entries differ too much in size")


def _named(what: str, call: Callable[..., Any]) -> Callable[..., Any]:
    """The call, with an error that says what failed, and why, in place of NumPy's LinAlgError."""

    def named(*matrices: Any, **options: Any) -> Any:
        try:
            return call(*matrices, **options)
        except np.linalg.LinAlgError:
            raise _failed(what, *matrices) from None

    return named


def _svd(A: Any, **options: Any) -> Any:
    result = np.linalg.svd(A, **options)
    if not np.isfinite(result if isinstance(result, np.ndarray) else result[1]).all():
        raise np.linalg.LinAlgError
    return result


#: U, singular values, V^T.
svd: Callable[..., tuple[Array, Array, Array]] = _named("singular values cannot be found", _svd)
#: Singular values, the largest first.
singular_values: Callable[[Any], Array] = partial(svd, compute_uv=False)  # type: ignore[assignment]
#: Q of orthonormal columns and the triangle R; ``mode="complete"``: Q is square.
qr: Callable[..., tuple[Array, Array]] = _named("a matrix has no orthonormal basis", np.linalg.qr)
#: Eigenvalues and eigenvectors of a symmetric matrix.
eigh: Callable[[Any], tuple[Array, Array]] = _named("eigenvalues cannot be found", np.linalg.eigh)
#: Eigenvalues of a symmetric matrix, the smallest first.
eigvalsh: Callable[[Any], Array] = _named("eigenvalues cannot be found", np.linalg.eigvalsh)
#: Eigenvalues and eigenvectors, complex where they are.
eig: Callable[[Any], tuple[Any, Any]] = _named("eigenvalues cannot be found", np.linalg.eig)
#: Eigenvalues, complex where they are.
eigvals: Callable[[Any], Any] = _named("eigenvalues cannot be found", np.linalg.eigvals)
#: x with A x = b.
solve: Callable[[Any, Any], Array] = _named("linear equations have no solution", np.linalg.solve)
#: A^-1.
inv: Callable[[Any], Any] = _named("a matrix has no inverse", np.linalg.inv)
#: A^+; entries of A below ``rcond`` of the largest singular value count as zero.
pinv: Callable[..., Array] = _named("a matrix has no pseudo-inverse", np.linalg.pinv)
#: L with L L^T = A.
cholesky: Callable[[Any], Array] = _named("a matrix is not positive definite", np.linalg.cholesky)
#: The largest singular value over the smallest.
cond: Callable[[Any], float] = _named("a condition number cannot be found", lambda A: float(np.linalg.cond(A)))
_lstsq = _named("linear equations have no solution", np.linalg.lstsq)


def lstsq(A: Any, b: Any, rcond: float | None = None) -> Array:
    """The x of least norm with least |A x - b|."""
    return np.asarray(_lstsq(A, b, rcond=rcond)[0])


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


# -- ranks -------------------------------------------------------------------------------------------------------------


class Rank(NamedTuple):
    """Rank of a scaled Jacobian, and how clearly it is decided."""

    rank: int
    kept: float  #: smallest singular value counted, relative to the largest
    dropped: float  #: largest singular value not counted, relative to the largest

    @property
    def clear(self) -> bool:
        """Whether the decision is far from the tolerance on both sides (a factor of 100)."""
        return self.kept > 100.0 * TOLERANCE and self.dropped < 0.01 * TOLERANCE


def rank(J: Array, tolerance: float = TOLERANCE) -> Rank:
    """Numerical rank of a scaled Jacobian J (m, n) by its singular values."""
    values = singular_values(J) if J.size else np.empty(0)
    if not values.size or values[0] == 0.0:
        return Rank(0, 1.0, 0.0)
    relative = values / values[0]
    # rows may all be rounding of their terms: there is a least length, too
    count = int(np.count_nonzero((relative > tolerance) & (values > UNMOVED)))
    if not count:
        return Rank(0, 1.0, 0.0)
    return Rank(count, float(relative[count - 1]), float(relative[count]) if count < len(relative) else 0.0)


# -- connected parts of the pattern of a matrix ------------------------------------------------------------------------


WIDTH = 16  #: rows of a level at least: smaller ones are joined


class Level(NamedTuple):
    """Rows, and the coordinates that no level before has."""

    rows: Indices
    columns: Indices


def parts(J: Array) -> list[list[Level]]:
    """The connected parts of the pattern of J (m, n), each as levels; a coordinate that no row holds is a part."""
    m, n = J.shape
    rows, columns = np.nonzero(J)
    of_rows = np.split(columns, np.searchsorted(rows, np.arange(1, m)))
    order = np.argsort(columns, kind="stable")
    of_columns = np.split(rows[order], np.searchsorted(columns[order], np.arange(1, n)))
    members, collected = [x.tolist() for x in of_rows], [x.tolist() for x in of_columns]
    open_columns, result = np.ones(n, dtype=bool), list[list[Level]]()
    for k in range(n):
        if not open_columns[k]:
            continue
        levels = _levels(k, members, collected)
        if len(levels) > 1:  # from the coordinate of fewest rows among those farthest away
            far = next(level for level in reversed(levels) if level[1])[1]
            levels = _levels(min(far, key=lambda j: (len(collected[j]), j)), members, collected)
        for _, members_of in levels:
            open_columns[members_of] = False
        result.append([Level(np.array(a, dtype=np.intp), np.array(b, dtype=np.intp)) for a, b in _joined(levels)])
    return result


def _levels(start: int, members: Sequence[list[int]], result: Sequence[list[int]]) -> list[tuple[list[int], list[int]]]:
    """Rows and new columns of each level, from one column."""
    level, seen, known, levels = [start], {start}, set[int](), []
    while level:
        rows = sorted({i for j in level for i in result[j]} - known)
        known.update(rows)
        levels.append((rows, level))
        level = sorted({j for i in rows for j in members[i]} - seen)
        seen.update(level)
    return levels


def _joined(levels: Sequence[tuple[list[int], list[int]]]) -> Iterator[tuple[list[int], list[int]]]:
    rows: list[int] = []
    columns: list[int] = []
    for more, further in levels:
        rows, columns = rows + more, columns + further
        if len(rows) >= WIDTH:
            yield rows, columns
            rows, columns = [], []
    if columns:
        yield rows, columns


# -- partitions --------------------------------------------------------------------------------------------------------

# Gaussian elimination with complete pivoting: the columns of the pivots are the dependent coordinates, rows without
# a pivot are redundant here.


class Partition(NamedTuple):
    """The coordinates of one configuration split in two; all quantities scaled."""

    dependent: Indices  #: (r,) columns
    independent: Indices  #: (n - r,) columns, the preferred ones first and in their order
    rows: Indices  #: (r,) rows that determine the dependent coordinates; the others are redundant here
    inverse: Array  #: (r, r) inverse of J[rows, dependent]
    B: Array  #: (n, n - r) velocity transformation: v = B v_i (+ b_t), J B = 0

    def particular(self, y: Array) -> Array:
        """The x (n,) or (n, k) with J x = y on the pivot rows and x = 0 for the independent coordinates."""
        x = np.zeros((len(self.B), *y.shape[1:]))
        x[self.dependent] = self.inverse @ y[self.rows]
        return x


def partition(J: Array, rank: int, independent: Sequence[int] | Indices, strict: bool = False) -> Partition:
    """Split the coordinates of a scaled Jacobian J (m, n) of a rank, fixed for a mechanism.

    The columns ``independent`` are preferred as such, the others as dependent; ``strict`` takes exactly this set or
    fails.
    """
    n = J.shape[1]
    preferred = np.ones(n, dtype=bool)
    preferred[np.asarray(independent, dtype=np.intp)] = False
    columns = np.flatnonzero(preferred)
    work = J.take(columns, axis=1) if strict else np.array(J)
    size = float(np.abs(J).max()) if J.size else 0.0
    rows = np.empty(rank, dtype=np.intp)
    dependent = np.empty(rank, dtype=np.intp)
    for step in range(rank):
        magnitude = np.abs(work)  # zero in the rows and columns of the pivots before
        row, column, best = _best(magnitude if strict else magnitude.take(columns, axis=1))
        if not strict:
            column = int(columns[column]) if best > 0.0 else column
            row_any, column_any, best_any = _best(magnitude)
            if not best >= PREFERENCE * best_any or best == 0.0:
                row, column, best = row_any, column_any, best_any
        if not best > (STRICT if strict else RANK) * size:
            raise PartitionError(
                "the chosen independent coordinates cannot move the mechanism here (it is at a dead centre): "
                f"{step} of {rank} others follow from them; choose other independent coordinates"
                if strict
                else f"the constraints have rank {step} here and {rank} elsewhere"
            )
        rows[step], dependent[step] = row, columns[column] if strict else column
        work -= work[:, column, None] * (work[row] / work[row, column])
        work[row] = 0.0
    chosen = set(dependent.tolist())
    order = [i for i in map(int, independent) if i not in chosen]
    kept = np.array(order + sorted(set(range(n)) - chosen - set(order)), dtype=np.intp)
    inverse: Array = np.asarray(inv(J[rows[:, None], dependent]), dtype=np.float64)
    B = np.zeros((n, n - rank))
    B[kept, np.arange(n - rank)] = 1.0
    B[dependent] = -inverse @ J[rows[:, None], kept]
    return Partition(dependent, kept, rows, inverse, B)


def _best(magnitude: Array) -> tuple[int, int, float]:
    if not magnitude.size:
        return 0, 0, 0.0
    row, column = divmod(int(magnitude.argmax()), magnitude.shape[1])
    return row, column, float(magnitude[row, column])
