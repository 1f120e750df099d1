"""Linear algebra and rotations on numbers: NumPy's results, or an error of eomgen's that says what is wrong.

``numpy.linalg`` raises ``LinAlgError`` for matrices that are singular or hold no numbers, which a user's values can
bring about anywhere.  Here such a matrix is a :class:`~..errors.NonFiniteError` or an :class:`~..errors.UnsolvedError`,
which callers handle as every failed evaluation.

Each pivot is compared with its own diagonal entry, whose rounding it carries, so that scales do not interact.  Only
what rounding leaves of a zero, far below any inertia beside it, is compared with the largest entry.

Duff, Erisman and Reid, *Direct Methods for Sparse Matrices* (2nd ed. 2017), chapter 6: rows are matched with columns,
and the strong components (Tarjan 1972) of what then depends on what are the blocks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..errors import EvaluationError, NonFiniteError, SingularMassMatrixError, UnsolvedError
from .limits.numbers import NOTHING, QUARTER, SINGULAR

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.intp]


def _failed(what: str, *matrices: Any) -> EvaluationError:
    if not all(np.isfinite(matrix).all() for matrix in matrices):
        return NonFiniteError(f"{what}: a matrix has entries that are not finite")
    return UnsolvedError(f"{what}: the matrix is singular, or its entries differ too much in size")


class _Told:
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
    with _Told("singular values cannot be found", A):
        U, sizes, Vt = np.linalg.svd(A, full_matrices=full_matrices)
    if not np.isfinite(sizes).all():
        raise _failed("singular values cannot be found", A)
    return U, sizes, Vt


def qr(A: Any, complete: bool = False) -> tuple[Array, Array]:
    """Q of orthonormal columns and the triangle R; ``complete``: Q is square."""
    with _Told("a matrix has no orthonormal basis", A):
        Q, R = np.linalg.qr(A, mode="complete" if complete else "reduced")
    return Q, R


def singular_values(A: Any) -> Array:
    """Singular values, the largest first."""
    with _Told("singular values cannot be found", A):
        sizes = np.asarray(np.linalg.svd(A, compute_uv=False))
    if not np.isfinite(sizes).all():
        raise _failed("singular values cannot be found", A)
    return sizes


def eigh(A: Any) -> tuple[Array, Array]:
    """Eigenvalues and eigenvectors of a symmetric matrix."""
    with _Told("eigenvalues cannot be found", A):
        values, vectors = np.linalg.eigh(A)
    return values, vectors


def eigvalsh(A: Any) -> Array:
    """Eigenvalues of a symmetric matrix, the smallest first."""
    with _Told("eigenvalues cannot be found", A):
        return np.asarray(np.linalg.eigvalsh(A))


def eig(A: Any) -> tuple[Any, Any]:
    """Eigenvalues and eigenvectors, complex where they are."""
    with _Told("eigenvalues cannot be found", A):
        values, vectors = np.linalg.eig(A)
    return values, vectors


def eigvals(A: Any) -> Any:
    """Eigenvalues, complex where they are."""
    with _Told("eigenvalues cannot be found", A):
        return np.linalg.eigvals(A)


def solve(A: Any, b: Any) -> Array:
    """x with A x = b."""
    with _Told("linear equations have no solution", A, b):
        return np.asarray(np.linalg.solve(A, b))


def inv(A: Any) -> Any:
    """A^-1."""
    with _Told("a matrix has no inverse", A):
        return np.linalg.inv(A)


def pinv(A: Any, rcond: float | None = None) -> Array:
    """A^+; entries of A below ``rcond`` of the largest singular value count as zero."""
    with _Told("a matrix has no pseudo-inverse", A):
        return np.asarray(np.linalg.pinv(A) if rcond is None else np.linalg.pinv(A, rcond=rcond))


def lstsq(A: Any, b: Any, rcond: float | None = None) -> Array:
    """The x of least norm with least |A x - b|."""
    with _Told("linear equations have no solution", A, b):
        return np.asarray(np.linalg.lstsq(A, b, rcond=rcond)[0])


def cholesky(A: Any) -> Array:
    """L with L L^T = A."""
    with _Told("a matrix is not positive definite", A):
        return np.asarray(np.linalg.cholesky(A))


def cond(A: Any) -> float:
    """The largest singular value over the smallest."""
    with _Told("a condition number cannot be found", A):
        return float(np.linalg.cond(A))


def norm2(A: Any) -> float:
    """The largest singular value."""
    return float(singular_values(A).max(initial=0.0))


# -- positive definite matrices ----------------------------------------------------------------------------------------


def safely_positive(pivots: Array, sizes: Array) -> bool:
    """Whether each pivot (n,) of L D L^T exceeds 1e-13 of its size (n,) and 1e-22 of the largest; NaN does not."""
    return bool((pivots > np.maximum(SINGULAR * sizes, NOTHING * sizes.max(initial=0.0))).all())


def definite_factor(M: Array, what: str) -> Array:
    """Cholesky's L (n, n) of a mass matrix M, for an analysis that holds for positive definite ones only.

    Raises
    ------
    NonFiniteError
        M is not finite.
    SingularMassMatrixError
        M is not positive definite; ``what`` names the analysis.
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


# -- block triangular form ---------------------------------------------------------------------------------------------


class DiagonalBlock(NamedTuple):
    """Rows that determine as many columns once those of earlier blocks are known."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


def match(rows: Sequence[Mapping[int, object]]) -> dict[int, int] | None:
    """The row of each column where every row has a column of its own; None if there is no such pairing."""
    row_of: dict[int, int] = {}
    column_of: dict[int, int] = {}

    def place(start: int) -> bool:
        came: dict[int, int] = {}  # column -> row it was reached from
        waiting = [start]
        while waiting:
            i = waiting.pop()
            for k in rows[i]:
                if k in came:
                    continue
                came[k] = i
                if k in row_of:
                    waiting.append(row_of[k])
                    continue
                while True:  # every row on the way moves one column on
                    row = came[k]
                    previous = column_of.get(row, -1)
                    row_of[k], column_of[row] = row, k
                    if row == start:
                        return True
                    k = previous
        return False

    return row_of if all(place(i) for i in range(len(rows))) else None


def diagonal_blocks(rows: Sequence[Mapping[int, object]]) -> list[DiagonalBlock] | None:
    """The blocks of a matrix with as many rows as columns; None if it is singular whatever its numbers are."""
    row_of = match(rows)
    if row_of is None:
        return None
    column_of = {i: k for k, i in row_of.items()}
    needs = {i: [row_of[k] for k in rows[i] if k in row_of and row_of[k] != i] for i in range(len(rows))}
    index: dict[int, int] = {}
    low: dict[int, int] = {}
    stack: list[int] = []
    found: list[DiagonalBlock] = []
    for root in range(len(rows)):
        if root in index:
            continue
        work = [(root, iter(needs[root]))]
        index[root] = low[root] = len(index)
        stack.append(root)
        while work:
            i, rest = work[-1]
            step = next(rest, None)
            if step is not None:
                if step not in index:
                    index[step] = low[step] = len(index)
                    stack.append(step)
                    work.append((step, iter(needs[step])))
                elif step in stack:
                    low[i] = min(low[i], index[step])
                continue
            work.pop()
            if work:
                low[work[-1][0]] = min(low[work[-1][0]], low[i])
            if low[i] == index[i]:
                cut = stack.index(i)
                members = sorted(stack[cut:])
                del stack[cut:]
                found.append(DiagonalBlock(tuple(members), tuple(sorted(column_of[j] for j in members))))
    return found


# -- rotation matrices -------------------------------------------------------------------------------------------------


Numbers = Sequence[float]


def quarter_turns(angle: float, snap: float = 0.0) -> tuple[float, float] | None:
    """Exact cosine and sine of an angle (rad) within ``snap``, or rounding, of a multiple of pi/2; None of others."""
    quarter = round(angle / (math.pi / 2))
    if abs(angle - quarter * (math.pi / 2)) <= max(snap, QUARTER * max(1, abs(quarter))):
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarter % 4]
    return None


def cosine_and_sine(angle: float, snap: float = 0.0) -> tuple[float, float]:
    """cos and sin, exact 0 and +-1 within ``snap`` of a multiple of pi/2."""
    return quarter_turns(angle, snap) or (math.cos(angle), math.sin(angle))


def from_roll_pitch_yaw(rpy: Numbers, snap: float = 0.0) -> Array:
    """R (3, 3) turned about fixed axes by roll, pitch and yaw (rad); angles as for :func:`quarter_turns`."""
    (cr, sr), (cp, sp), (cy, sy) = (cosine_and_sine(angle, snap) for angle in rpy)
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


def roll_pitch_yaw(R: Array) -> Array:
    """Fixed-axis angles (3,) of a rotation matrix, good to rounding at any pitch.

    The yaw is read first and the roll from what it leaves, so that an uncertain yaw near pitch = +-pi/2 does no harm
    (the order of Eigen's Euler angles).
    """
    across = math.hypot(R[0, 0], R[1, 0])
    pitch = math.atan2(-R[2, 0], across)
    yaw = math.atan2(R[1, 0], R[0, 0]) if across > 0 else 0.0
    c, s = cosine_and_sine(yaw)
    roll = math.atan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return np.array([roll, pitch, yaw])


def from_quaternion(w: float, x: float, y: float, z: float) -> Array:
    """R (3, 3) of a quaternion of any length, scalar part first."""
    size = w * w + x * x + y * y + z * z
    s = 2.0 / size
    matrix = np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
            [s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)],
            [s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)],
        ]
    )
    nearest = np.round(matrix)
    return nearest if np.abs(matrix - nearest).max() < QUARTER else matrix


def about(axis: Numbers, angle: float) -> Array:
    """R (3, 3) of an angle about a unit axis (Rodrigues' formula)."""
    if angle == 0.0:
        return np.eye(3)
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    c, s = cosine_and_sine(angle)
    return np.asarray(np.eye(3) + s * K + (1 - c) * (K @ K))
