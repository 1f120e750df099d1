"""Stage numeric: M, h, C_q, gamma of a state -> accelerations, and the exact Jacobian of the right-hand side.

The embedding technique (Shabana, Computational Dynamics, "embedding technique"): ``v = B v_i + b_t``, so that
``B^T M B a_i = -B^T (h + M a_p)`` with a particular solution ``C_q a_p = -gamma``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array, Indices, indefinite_factor, moves_inertia, safely_positive
from ..errors import NonFiniteError, SingularMassMatrixError
from .partitions import Partition, partition
from .projection import beyond_velocities, minimum_norm, project, tangent_projector
from .scales import GivenRates, Position, Rate, Scales


class Terms(NamedTuple):
    """What the equations ``M a + h + C_q^T l = 0``, ``C_q a + gamma = 0`` are made of at one state."""

    M: Array  #: (n, n)
    h: Array  #: (n,)
    C_q: Array  #: (m, n)
    gamma: Array  #: (m,)
    indefinite: bool = False  #: whether M may have negative eigenvalues, where bodies with such inertias were asked for


@lru_cache(maxsize=8)
def lower_triangle(n: int) -> tuple[Indices, ...]:
    """Rows and columns of the entries on and below the diagonal, read only."""
    return tuple(np.tril_indices(n))


def unpack_terms(flat: Array, n: int, m: int, indefinite: bool = False) -> Terms:
    """The block ``terms`` [M lower triangle row by row | h | C_q | gamma] as arrays."""
    lower = n * (n + 1) // 2
    M = np.empty((n, n))
    rows, columns = lower_triangle(n)
    M[rows, columns] = flat[:lower]
    M[columns, rows] = flat[:lower]
    h, C_q, gamma = np.split(flat[lower:], [n, n + m * n])
    return Terms(M, h, C_q.reshape(m, n), gamma, indefinite)


class Embedded(NamedTuple):
    """The system of the degrees of freedom at one configuration, scaled and factorised."""

    M: Array  #: (n, n) scaled mass matrix of the tree
    matrix: Array  #: (n_dof, n_dof) B^T M B
    factor: Array  #: L of matrix = L S L^T, Cholesky's where S is 1
    split: Partition
    signs: Array  #: (n_dof,) diagonal of S, 1 or -1

    def solve(self, f: Array) -> Array:
        """``B (B^T M B)^-1 B^T f``, f (n,) or (n, k)."""
        y = algebra.solve(self.factor, self.split.B.T @ f)
        return np.asarray(self.split.B @ algebra.solve(self.factor.T, (y.T * self.signs).T))


def embed(
    M: Array,
    C_q: Array,
    scales: Scales,
    rank: int,
    independent: Sequence[int] | Indices,
    indefinite: bool = False,
) -> Embedded:
    """Form and factorise the embedded mass matrix.

    Raises
    ------
    SingularMassMatrixError
        A pivot is not above 1e-13 of the terms that its own diagonal entry is the sum of; see :mod:`~..base.algebra`.
    PartitionError
        As :func:`~.partitions.partition`.
    """
    scaled = scales.q[:, None] * M * scales.q
    J = scales.jacobian(C_q)
    split = partition(J, rank, independent, sizes=scales.row_sizes(J))
    matrix = split.B.T @ scaled @ split.B
    if not np.isfinite(matrix).all():
        raise NonFiniteError("the mass matrix is not finite")
    if indefinite:
        size = (split.B**2 * np.abs(scaled.diagonal())[:, None]).sum(axis=0)
        lower, pivots = indefinite_factor(matrix, size)
        return Embedded(scaled, matrix, lower * np.sqrt(np.abs(pivots)), split, np.sign(pivots))
    try:
        factor: Array = np.asarray(np.linalg.cholesky(matrix), dtype=np.float64)
    except np.linalg.LinAlgError:
        raise SingularMassMatrixError("the mass matrix of the degrees of freedom is not positive definite") from None
    # the squares of its diagonal are the pivots of L D L^T
    size = (split.B**2 * scaled.diagonal()[:, None]).sum(axis=0)
    pivots = factor.diagonal() ** 2
    alone = len(size) == 1
    if not safely_positive(pivots, size) or (alone and not moves_inertia(pivots[0], split.B, scaled.diagonal())):
        raise SingularMassMatrixError("the mass matrix of the degrees of freedom is singular")
    return Embedded(scaled, matrix, factor, split, np.ones(len(size)))


def accelerate(terms: Terms, v: Array, scales: Scales, system: Embedded) -> Array:
    """Accelerations a (n,) at a state on the manifold with velocities v (n,)."""
    s = scales.q
    a_p = np.zeros(len(s))
    if len(terms.gamma):
        fastest = scales.speed(v)  # times itself: a power of a float that overflows is no number but an OverflowError
        if not np.isfinite(fastest * fastest):
            raise NonFiniteError("the squares of the velocities overflow")
        a_p = minimum_norm(terms.C_q, -terms.gamma[:, None], scales, scales.row_speeds(v) ** 2, 2)[:, 0] / s
    a = s * (a_p - system.solve(s * terms.h + system.M @ a_p))
    if not np.isfinite(a).all():
        raise NonFiniteError("the accelerations are not finite")
    return np.asarray(a)


def motion(
    terms: Callable[[Array, Array], Terms],
    position: Position,
    rate: Rate,
    q: Array,
    v: Array,
    scales: Scales,
    rank: int,
    independent: Sequence[int] | Indices,
    given: GivenRates | None = None,
) -> tuple[Array, float]:
    """[q, v, q', a] (2 n_x,) of the projected state, and the weakest pivot of the partition there.

    See :func:`embed` and :func:`~.projection.project` for errors.
    """
    q, v = project(position, rate, q, v, scales, given)
    here = terms(q, v)
    system = embed(here.M, here.C_q, scales, rank, independent, here.indefinite)
    rates = scales.rates(q, v) if given is None else given.rates(q, v)
    return np.concatenate([q, v, rates, accelerate(here, v, scales, system)]), system.split.weakest


def rhs(
    terms: Callable[[Array, Array], Terms],
    position: Position,
    rate: Rate,
    q: Array,
    v: Array,
    scales: Scales,
    rank: int,
    independent: Sequence[int] | Indices,
    given: GivenRates | None = None,
) -> Array:
    """x' = [q', a] (n_x,) of :func:`motion`."""
    return motion(terms, position, rate, q, v, scales, rank, independent, given)[0][len(q) + len(v) :]


class DynamicsSlopes(NamedTuple):
    """Derivatives of r1 = M a + h + C_q^T l, r2 = C_q a + gamma, r3 = C_q v + C_t at fixed a, l."""

    r1_q: Array  #: (n, n_q)
    r1_v: Array  #: (n, n)
    r2_q: Array  #: (m, n_q)
    r2_v: Array  #: (m, n)
    r3_q: Array  #: (m, n_q)


def jacobian(
    terms: Callable[[Array, Array], Terms],
    residuals: Callable[[Array, Array, Array, Array], DynamicsSlopes],
    position: Position,
    rate: Rate,
    q: Array,
    v: Array,
    scales: Scales,
    rank: int,
    independent: Sequence[int] | Indices,
    given: GivenRates | None = None,
) -> Array:
    """Derivative (n_x, n_x) of :func:`rhs` by [q; v], projection included.

    Parameters
    ----------
    terms, residuals, position, rate : callables
        (q, v) -> Terms; (q, v, a, l) -> DynamicsSlopes; q -> C, C_q; q -> C_t.
    q, v : (n,) arrays
        A state on the manifold, where the result is exact; others are projected first.
    """
    n, n_q, s = len(v), len(q), scales.q
    q, v = project(position, rate, q, v, scales, given)
    here = terms(q, v)
    system = embed(here.M, here.C_q, scales, rank, independent, here.indefinite)
    split = system.split
    a = accelerate(here, v, scales, system)
    multipliers = np.zeros(len(here.gamma))
    # dependent rows of C_q^T l = -(M a + h); redundant rows carry nothing
    multipliers[split.rows] = split.multipliers(-s * (here.M @ a + here.h)) / scales.c[split.rows]
    r = residuals(q, v, a, multipliers)
    dq, dv = np.eye(n_q, n_q + n), np.eye(n, n_q + n, n_q)
    if len(here.gamma):
        if given is None:
            turn = _project_directions(q, position(q), scales)
        else:  # q and the step back N d, d the smallest with C_q d = -dC, and what that leaves of C
            turn = np.eye(n_q)
            if h := len(position(q)[0]):
                J, gradient = scales.jacobian(here.C_q[:h]), given.gradient(q)
                d, further = beyond_velocities(J, gradient / scales.c[:h, None], gradient, scales)
                turn = turn - given.moved(q, s[:, None] * d) - further
        dq = np.hstack([turn, np.zeros((n_q, n))])
        dv = np.hstack([-minimum_norm(here.C_q, r.r3_q @ turn, scales), tangent_projector(here.C_q, scales)])
    a_p = split.particular(-(r.r2_q @ dq + r.r2_v @ dv) / scales.c[:, None])
    da = s[:, None] * (a_p - system.solve(s[:, None] * (r.r1_q @ dq + r.r1_v @ dv) + system.M @ a_p))
    if not np.isfinite(da).all():
        raise NonFiniteError("the Jacobian is not finite")
    space = given or scales.space
    return np.vstack([dv if space is None else space.change(q, dq, v[:, None], dv), da])


def _project_directions(q: Array, here: tuple[Array, Array], scales: Scales) -> Array:
    """Derivative (n_q, n_q) of the projected q by q at a closed position; lengths of Euler parameters are kept."""
    P = tangent_projector(here[1][: len(here[0])], scales)
    if scales.space is None:
        return P
    unit = np.eye(len(q))
    moved = scales.space.rates(q, P @ scales.space.velocities(q, unit))
    return np.asarray(moved + scales.space.stretch(q, unit))


def embedded_mass(M: Array, C_q: Array, scales: Scales, rank: int, independent: Sequence[int] | Indices) -> Array:
    """``B^T M B`` (n_dof, n_dof) for exactly the given independent coordinates, in their order and units.

    Raises
    ------
    PartitionError
        The coordinates are not independent here.
    """
    J = scales.jacobian(C_q)
    split = partition(J, rank, independent, strict=True, sizes=scales.row_sizes(J))
    s_i = scales.q[split.independent]
    scaled = split.B.T @ (scales.q[:, None] * M * scales.q) @ split.B
    return np.asarray(scaled / s_i[:, None] / s_i)
