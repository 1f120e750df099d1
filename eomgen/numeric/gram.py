"""Stage numeric: constraint rows J and what they have to give -> the least x with J x = y, near lost rank as well.

Passes with the factor of J J^T + term, the rest taken in the rows themselves, so that its squared conditioning costs
no digits: of a part along a singular value s (relative to the largest) each leaves term / (s^2 + term).  The first
term, GENTLE, does for s far above 1e-4 in a few passes.  Where something is left, it lies along the weak rows that it
points out; the term is lowered below their s^2, at most to TIKHONOV, unless the rest is nothing but rounding.

Near a configuration of lost rank that takes care (P. C. Hansen, *Rank-Deficient and Discrete Ill-Posed Problems*, 1998,
7.2: stop at the noise).  The position is known to eps / s along weak rows, since C is known to eps.  J turns with it,
so C_q v is known to V eps / s and gamma, with the square of v, to V^2 eps / s^2.  A smaller rest along those rows tells
nothing: taking it for true would divide it by s once more.  A mechanism that nearly changes its mode swings round with
gamma of the size V^2, and has its rest taken down to s = 1e-6; one that passes through the change point has gamma of
the size s V^2 and is left to go straight on within s = 1e-5, where only noise would turn it.  V is that of
the loop: rocker and coupler of another one that turn a thousand times as fast are no noise here.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.constraints import BELOW, EXACT, FAST, GENTLE, TIKHONOV, UNMOVED
from ..base.limits.numbers import SUMMED
from ..errors import NonFiniteError, ProjectionError

PASSES = 50  #: at most


def gram_solver(J: Array, relative: float = GENTLE) -> Callable[[Array], Array]:
    """``(J J^T + relative max(diag) I)^-1`` as a function of e (m,) or (m, k).

    Rows that are all zero to rounding, as where parameters alone decide whether a loop closes, ask for no step: the
    term is then 1.

    Raises
    ------
    NonFiniteError
        J, or a square of its entries, is not finite.
    """
    G = J @ J.T
    size = G.diagonal().max(initial=0.0)
    G.flat[:: len(G) + 1] += relative * size if size > UNMOVED * UNMOVED else 1.0
    if not np.isfinite(G).all():
        raise NonFiniteError("the constraint Jacobian is not finite")
    try:
        L = np.linalg.cholesky(G)
    except np.linalg.LinAlgError:
        raise ProjectionError("because of rounding, J J^T of the constraints is not positive definite") from None
    return lambda e: np.asarray(algebra.solve(L.T, algebra.solve(L, e)))


def weakness(J: Array, z: Array) -> float:
    """The square of the singular value of J along z (m,) or (m, k), relative to the largest row of J."""
    d = J.T @ z
    size = float((J * J).sum(axis=1).max() * (z * z).sum())
    return float((d * d).sum()) / size if size > 0.0 else 1.0


def along(z: Array, noise: Array | float) -> float:
    """The root mean square of the noise of rows (m,) over a combination z of them, (m,) or (m, k)."""
    square = float((z * z).sum())
    return float(np.sqrt(((z.T * noise) ** 2).sum() / square)) if square > 0.0 else float(np.max(noise, initial=0.0))


def smaller(weak: float) -> float:
    """The term for rows that are so weak."""
    return max(TIKHONOV, BELOW * weak)


def least(J: Array, y: Array, x: Array, noise: Array | float, order: int = 1) -> Array:
    """The x nearest to a given one with J x = y.

    Parameters
    ----------
    J : (m, n) array
        Scaled Jacobian; redundant rows allowed, with y to match.
    y : (m,) or (m, k) array
    x : (n,) or (n, k) array
        To begin with; not changed.
    noise : (m,) array or float
        What 1e-15 of the position makes of y: for rates V, the size of the velocities that a row knows; for
        accelerations, V^2.
    order : int
        How often y was differentiated: 1 for rates, 2 for accelerations.

    Returns
    -------
    x : array
        J x = y to rounding, but for what is below ``1e-15 noise / s^order`` along rows of singular value s.

    Raises
    ------
    ProjectionError
        More than that is left: the rows contradict each other.
    """
    relative, before = GENTLE, np.inf
    solve = gram_solver(J, relative)
    size = float(np.sqrt((J * J).sum(axis=1).max()))
    for _ in range(PASSES):
        e = y - J @ x
        if not (np.abs(e) > SUMMED * (np.abs(J) @ np.abs(x) + np.abs(y))).any():
            break
        z = solve(e)
        length = float(np.abs(e).max())
        if length > FAST * before:
            weak = weakness(J, z)
            if not float(np.sqrt((e * e).sum())) * weak ** (0.5 * order) > EXACT * size * along(z, noise):
                break
            if relative > TIKHONOV:
                relative = min(0.1 * relative, smaller(weak))
                solve = gram_solver(J, max(TIKHONOV, relative))
                z = solve(e)
            elif length > 0.5 * before:
                break
        x = x + J.T @ z
        before = length
    return x
