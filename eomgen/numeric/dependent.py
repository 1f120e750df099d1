"""Stage numeric: independent coordinates, velocities, accelerations -> those of the whole tree."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..base.algebra import Array, Indices
from ..base.limits.constraints import ACCEPTED, EXACT, SETTLED
from ..errors import NonFiniteError, ProjectionError
from .partitions import Partition, partition
from .projection import DAMPING, largest, within
from .scales import Position, Rate, Scales

STEPS = 50  #: Newton steps at most


def solve_dependent(
    position: Position, q: Array, scales: Scales, rank: int, independent: Sequence[int] | Indices
) -> tuple[Array, Array, Partition]:
    """Newton's iteration on the dependent coordinates; the independent ones keep their values.

    Parameters
    ----------
    position : callable
        q (n,) -> C (m,), C_q (m, n).
    q : (n,) array
        Guess, with the wanted values of the independent coordinates.
    scales : Scales
    rank : int
        Number of dependent coordinates.
    independent : sequence of int
        Columns held; the velocities of plain coordinates.

    Returns
    -------
    q : (n,) array
    C_q : (m, n) array
    split : Partition

    Raises
    ------
    ProjectionError
        No convergence in 50 steps.
    PartitionError
        The held coordinates are not independent somewhere on the way.
    """
    before = np.inf
    for step in range(STEPS + 1):
        C, C_q = position(q)
        e = scales.residual(C)
        size = largest(e)
        if not np.isfinite(size):
            raise NonFiniteError("the constraints are not finite")
        J = scales.jacobian(C_q)
        split = partition(J, rank, independent, strict=True, sizes=scales.row_sizes(J))
        rounded = scales.rounding(q, J[: len(e)])
        if size <= EXACT or (step and size > 0.5 * before and within(e, SETTLED, rounded)):
            return q, C_q, split
        if step == STEPS:
            break
        dz = split.particular(e)
        longest = largest(dz)
        if longest > DAMPING:
            dz *= DAMPING / longest
        q = scales.move(q, -dz)
        before = size
    if within(e, ACCEPTED, rounded):
        return q, C_q, split
    raise ProjectionError(
        f"the dependent coordinates were not found: scaled residual {size:.1e} after {STEPS} steps; "
        "the position may be out of reach"
    )


def kinematics(
    position: Position,
    rate: Rate,
    gamma: Callable[[Array, Array], Array],
    q_i: Array,
    v_i: Array,
    a_i: Array,
    guess: Array,
    scales: Scales,
    rank: int,
    independent: Sequence[int] | Indices,
) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration of all coordinates.

    Parameters
    ----------
    position, rate : callables
        q -> C, C_q and q -> C_t.
    gamma : callable
        (q, v) -> gamma (m,) of ``C'' = C_q a + gamma``.
    q_i, v_i, a_i : (n_dof,) arrays
        In the order of `independent`.
    guess : (n,) array
        Start of Newton's iteration for the dependent coordinates.

    Returns
    -------
    q, v, a : (n,) arrays

    Raises
    ------
    ProjectionError, PartitionError
        As :func:`solve_dependent`.
    """
    independent = np.asarray(independent, dtype=np.intp)
    s = scales.q
    q = np.array(guess, dtype=float)
    q[scales.coordinates(independent)] = q_i
    if not rank:
        v, a = np.empty_like(s), np.empty_like(s)
        v[independent], a[independent] = v_i, a_i
        return q, v, a
    q, _, split = solve_dependent(position, q, scales, rank, independent)
    B, s_i = split.B, s[independent]
    v = s * (B @ (v_i / s_i) + split.particular(-scales.residual(rate(q))))
    a = s * (B @ (a_i / s_i) + split.particular(-scales.residual(gamma(q, v))))
    return q, v, a
