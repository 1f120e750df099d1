"""Stage numeric: constraints, held coordinates, further equations -> coordinates that satisfy all, near a guess.

Levenberg-damped Gauss-Newton steps of minimum norm in the coordinates that are free to move.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.analyses import NULL
from ..base.limits.constraints import ACCEPTED, EXACT, SETTLED, TIKHONOV
from .projection import largest, within
from .scales import Position, Scales

STEPS = 80  #: damped steps at most
DAMPING = 1e-3  #: relative to the largest diagonal entry of J J^T, at first
LEAST, MOST = 1e-8, 1e8  #: the same after a step that gained nothing, and where the search ends
LONGEST = 0.5  #: largest scaled step
FAR = 10.0  #: scaled distance above which steps grow with it
STEEP = 10.0  #: length of a row's scaled gradient above which the row counts less, lest it drown the others


class WantedValues(NamedTuple):
    """Values wanted for functions y(q), such as the coordinates of cut joints."""

    evaluate: Callable[[Array], tuple[Array, Array]]  #: q (n,) -> y (k,), y_q (k, n)
    values: Array  #: (k,) wanted
    scales: Array  #: (k,) the length scale for lengths, 1 for angles
    angles: Sequence[bool]  #: (k,) whether y counts modulo a full turn
    names: Sequence[str]  #: (k,) for messages

    def difference(self, y: Array) -> Array:
        """y - values, angles in [-pi, pi]; not scaled."""
        gap = y - self.values
        return np.where(self.angles, np.remainder(gap + np.pi, 2.0 * np.pi) - np.pi, gap)


class ClosureSystem(NamedTuple):
    """C(q) = 0 and y(q) = values with some coordinates held."""

    position: Position
    scales: Scales
    free: Array  #: (n,) 1.0 for a velocity of a coordinate that may move, 0.0 for a held one
    equations: WantedValues | None = None

    def evaluate(self, q: Array) -> tuple[Array, Array]:
        """Scaled residual e (m + k,) and its scaled Jacobian (m + k, n), zero in the columns of held coordinates."""
        C, C_q = self.position(q)
        e, J = self.scales.residual(C), self.scales.jacobian(C_q[: len(C)])
        if self.equations is not None:
            y, y_q = self.equations.evaluate(q)
            s = self.equations.scales
            e = np.concatenate([e, self.equations.difference(y) / s])
            J = np.vstack([J, y_q * self.scales.q / s[:, None]])
        return e, J * self.free


def close(system: ClosureSystem, q: Array, steps: int = STEPS, damping: float | None = DAMPING) -> tuple[Array, float]:
    """Minimise the scaled residual from q.

    Damping at first: 0 where q is near a closed position, so that directions that hardly count do not creep; None for
    steps of least squares, which keep all digits beside singular positions and may lead far away from them.

    Returns
    -------
    q : (n,) array
        The last point.
    residual : float
        Largest scaled residual there; closed when it is not above ACCEPTED, which rows at their rounding count as.
    """
    e, J = system.evaluate(q)
    long = system.scales.long
    for _ in range(steps):
        size = largest(e)
        if size <= EXACT or not np.isfinite(size):
            break
        steepness = np.sqrt((J * J).sum(axis=1))
        weights = 1.0 / np.where(steepness > STEEP, steepness, 1.0)
        # far from closed, lengths are measured by the distance: angles would turn in circles over it
        far = remoteness(e, steepness)
        unit = np.where(long, 4.0 * far, 1.0) if long is not None and far > FAR else np.ones_like(system.scales.q)
        K, f = J * weights[:, None] * unit, e * weights
        top = float((K * K).sum(axis=1).max(initial=0.0))
        if top == 0.0 or largest(K.T @ f) <= EXACT * top:
            break  # nothing that may move makes a difference
        dz = _step(K, f, damping, top)
        longest = largest(dz)
        if longest > LONGEST:
            dz *= LONGEST / longest
        trial = system.scales.move(q, dz * unit)
        e_trial, J_trial = system.evaluate(trial)
        f_trial = e_trial * weights
        gained = float(f @ f - f_trial @ f_trial)
        if not gained > 0.0:  # NaN included
            if size <= SETTLED:
                break
            damping = max(10.0 * (damping or 0.0), LEAST)
            if damping > MOST:
                break
            continue
        settled = size <= SETTLED and largest(e_trial) > 0.5 * size
        q, e, J = trial, e_trial, J_trial
        if settled:
            break
        # quadratic convergence at the end needs the damping to vanish with the residual
        if damping:
            damping = min(0.1 * damping, size)
            damping = 0.0 if damping < TIKHONOV else damping
    rounded = system.scales.rounding(q, J)
    return q, min(largest(e), ACCEPTED) if within(e, ACCEPTED, rounded) else largest(e)


def _step(K: Array, f: Array, damping: float | None, top: float) -> Array:
    """The damped step of least norm; ``top`` is the largest square of a row's length."""
    if damping is None:
        return -algebra.lstsq(K, f, rcond=NULL)
    G = K @ K.T
    G.flat[:: len(G) + 1] += (damping + TIKHONOV) * top
    return np.asarray(-K.T @ algebra.solve(G, f))


def remoteness(e: Array, steepness: Array) -> float:
    """About how far q is from where all equations hold, in scaled steps."""
    return largest(e / np.maximum(steepness, 1.0))


def closed(residual: float) -> bool:
    """Whether a scaled residual counts as closed."""
    return residual <= ACCEPTED
