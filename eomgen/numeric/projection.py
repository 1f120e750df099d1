"""Stage numeric: a state near the constraint manifold -> the nearest state on it, position and velocity level.

The correction is the minimum-norm Newton step ``-J^T (J J^T)^-1 e`` in scaled coordinates.  It does not depend on any
partition of the coordinates, so a partition that goes bad at a dead centre costs no digits.  A relative Tikhonov term
in ``J J^T`` carries redundant rows and configurations where the rank drops; see :mod:`.gram`.  In position steps it is
as large as the mean scaled residual: rows that depend on each other on the manifold only gain a false rank off it, of
the size of the distance, whose Newton step would run along the motion.  Near convergence, where steps are far shorter
than the distance to lost rank, it goes below the weakest row that something is left of.
"""

from __future__ import annotations

import numpy as np

from ..base.algebra import Array
from ..base.limits.constraints import ACCEPTED, EXACT, GENTLE, HINDERED, NEAR, SETTLED, SHORT, TIKHONOV
from ..base.limits.numbers import EPS, ROUNDED
from ..errors import NonFiniteError, ProjectionError
from .gram import gram_solver, least, smaller, weakness
from .scales import GivenRates, Position, Rate, Scales

STEPS = 25  #: Newton steps at most
DAMPING = 0.5  #: largest scaled Newton step


def largest(values: Array) -> float:
    """The largest magnitude, 0.0 of nothing, NaN if one is NaN."""
    return float(np.abs(values).max()) if values.size else 0.0


def within(e: Array, limit: float, rounded: Array) -> bool:
    """Whether each scaled residual (m,) is at most the limit, or what rounding leaves of it (m,)."""
    return bool((np.abs(e) <= np.maximum(limit, rounded)).all())


def correct_position(
    position: Position, q: Array, scales: Scales, given: GivenRates | None = None
) -> tuple[Array, Array]:
    """The nearest q with C(q) = 0, and C_q there.

    Parameters
    ----------
    position : callable
        q (n,) -> C (m,), C_q (m, n).
    q : (n,) array
        Coordinates near the manifold; not changed.
    scales : Scales
    given : GivenRates, optional
        Where q' is given as N(q, t) v + b(q, t).

    Returns
    -------
    q : (n,) array
    C_q : (m, n) array

    Raises
    ------
    ProjectionError
        No convergence to a scaled residual of 1e-10, or of the rounding of q, in 25 steps.
    NonFiniteError
        The constraints are not finite.
    """
    before, last = np.inf, False
    for step in range(STEPS + 1):
        C, C_q = position(q)
        e = scales.residual(C)
        size = largest(e)
        if last or size == 0.0 or (step and size <= EXACT):
            return q, C_q
        if not np.isfinite(size):
            raise NonFiniteError("the constraints are not finite")
        J = scales.jacobian(C_q[: len(e)])
        rounded = scales.rounding(q, J) if given is None else np.zeros(len(e))
        if step and size > 0.5 * before and within(e, SETTLED, rounded):
            return q, C_q
        if step == STEPS:
            break
        z = gram_solver(J, max(GENTLE, float(np.abs(e).mean())))(e)
        dz = J.T @ z
        if largest(e - J @ dz) > HINDERED * size and not within(e, EXACT, 0.0625 * rounded):
            weak = weakness(J, z)
            if size < NEAR * weak:
                dz = J.T @ gram_solver(J, smaller(weak))(e)
        left = e - J @ dz
        if given is not None and largest(left) > HINDERED * size:
            dq = beyond_velocities(J, e, given.gradient(q), scales)[1]  # as of the length of Euler parameters
            q = q - dq * (DAMPING / max(largest(dq), DAMPING))
        longest = largest(dz)
        # one step at least: near configurations where rows depend on each other a small residual is no small distance
        last = longest <= SHORT and largest(left) <= EXACT
        part = DAMPING / longest if longest > DAMPING else 1.0
        q = scales.move(q, -part * dz) if given is None else given.move(q, -part * scales.q * dz)
        before = size
    if within(e, ACCEPTED, rounded):
        return q, C_q
    raise ProjectionError(f"the projection onto the constraints stopped at a scaled residual of {size:.1e}")


def beyond_velocities(J: Array, y: Array, gradient: Array, scales: Scales) -> tuple[Array, Array]:
    """The smallest scaled d that changes the residual by y (h,) or (h, k), and the least dq for what d leaves."""
    d, solve, rows = least(J, y, J.T @ (0.0 * y), largest(y)), gram_solver(J), gradient / scales.c[: len(y), None]
    for _ in range(2):  # it ends where something is left, of the size of its term
        d = d + J.T @ solve(y - J @ d)
    return d, np.asarray(rows.T @ gram_solver(rows, TIKHONOV)(y - J @ d))


def correct_velocity(C_q: Array, C_t: Array, v: Array, scales: Scales) -> Array:
    """The nearest v (n,) with C_q v + C_t = 0."""
    x, y = v / scales.q, -scales.residual(C_t)
    noise = np.maximum(scales.row_speeds(v), np.abs(y))
    return np.asarray(scales.q * least(scales.jacobian(C_q), y, x, noise))


def project(
    position: Position, rate: Rate, q: Array, v: Array, scales: Scales, given: GivenRates | None = None
) -> tuple[Array, Array]:
    """The nearest state on the manifold, position level first, then velocity level.

    Parameters
    ----------
    position : callable
        q (n,) -> C (m,), C_q (m, n).
    rate : callable
        q (n,) -> C_t (m,).
    q, v : (n,) arrays
    scales : Scales

    Returns
    -------
    q, v : (n,) arrays

    Raises
    ------
    ProjectionError, NonFiniteError
        As :func:`correct_position`.
    """
    if not scales.c.size:
        return q, v
    C, C_q = position(q)
    if _is_closed(C, C_q, rate(q), q, v, scales, given):
        return q, v
    q, C_q = correct_position(position, q, scales, given)
    return q, correct_velocity(C_q, rate(q), v, scales)


def _is_closed(C: Array, C_q: Array, C_t: Array, q: Array, v: Array, scales: Scales, given: GivenRates | None) -> bool:
    """Whether a state is on the constraints to rounding, at both levels; it then stays as it is, to the last bit.

    Of n terms each is rounded, and the roundings add up as the root of n.
    """
    rounding, J = EPS * float(np.sqrt(len(scales.q))), scales.jacobian(C_q)
    placed = largest(scales.rounding(q, J[: len(C)])) / ROUNDED if given is None else 0.0
    moved = largest(np.abs(J) @ np.abs(v / scales.q) + np.abs(scales.residual(C_t)))
    if not largest(scales.residual(C)) <= max(EXACT, rounding * placed):
        return False
    return largest(scales.residual(C_q @ v + C_t)) <= max(EXACT * max(1.0, scales.speed(v)), rounding * moved)


def minimum_norm(C_q: Array, y: Array, scales: Scales, noise: Array | None = None, order: int = 1) -> Array:
    """The smallest scaled x (n, k) with C_q x = y (m, k); y must be consistent, as rates of redundant rows are.

    Never form the pseudo-inverse by y = I: with redundant rows its parts outside the range are 1e12 times as large as
    the result, and leave four digits of it.  Noise and order are those of :func:`~.gram.least`.
    """
    z = y / scales.c[: len(y), None]
    x = np.zeros((C_q.shape[1], y.shape[1]))
    x = least(scales.jacobian(C_q), z, x, largest(z) if noise is None else noise, order)
    return np.asarray(scales.q[:, None] * x)


def tangent_projector(C_q: Array, scales: Scales) -> Array:
    """``P = I - S^2 C_q^T (C_q S^2 C_q^T)^+ C_q`` (n, n).

    The derivative, at a point of the manifold, of the projected q by q and of the projected v by v.
    """
    if not len(C_q):
        return np.eye(len(scales.q))
    return np.asarray(np.eye(len(scales.q)) - minimum_norm(C_q, C_q, scales))
