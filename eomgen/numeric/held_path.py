"""Stage numeric: a closed position, other values of held coordinates or another time -> the position reached by moving
there steadily, on the branch that the mechanism is on."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.analyses import DRIFTED, NULL
from ..errors import AssemblyError
from .closure import DAMPING, ClosureSystem, close, closed
from .constraint_system import ConstraintSystem
from .continuation import FEWEST, Continuation
from .curves import Point, Tangent
from .projection import largest

LONGEST = 200.0  #: scaled distance too long to follow
TRIALS = 5000  #: steps at most, those taken back included
NEWTON = 15  #: Newton steps to one point


class HeldPath:
    """Closed positions while coordinates, and the time, go along straight lines to given values; s from 0 to 1.

    What is not held moves as little as the constraints allow.

    Parameters
    ----------
    system : ConstraintSystem
        At the time of the start.
    start : (n_q,) array
        A closed position.
    held : mapping of str to float
        Values at the end, reached exactly, of coordinates of the tree (all four Euler parameters of a rotation or none)
        and of cut joints.
    end : float, optional
        Time at the end, that of the start by default.
    """

    def __init__(
        self, system: ConstraintSystem, start: Array, held: Mapping[str, float], end: float | None = None
    ) -> None:
        self.system, self.start, self.scales = system, start, system.scales
        self.end = system.t if end is None else end
        self.held, target = system.indices(held), system.with_values(start, held)
        closure = system.closure(held)
        self.free, self.values = closure.free, target[self.held]
        self.way = (1.0 - self.free) * self.scales.distance(target, start)  # (n,) scaled
        self.equations = equations = closure.equations
        self.gap = equations.difference(equations.evaluate(start)[0]) if equations else np.empty(0)
        self.length = max(largest(self.way), largest(self.gap / equations.scales) if equations else 0.0)

    def _at(self, s: float) -> ConstraintSystem:
        """The constraints at the time there."""
        return self.system.at(self.end if s == 1.0 else self.system.t + s * (self.end - self.system.t))

    def solve(self, s: float, guess: Array) -> Point | None:
        """The point next to a guess; None if Newton's iteration finds none."""
        q = np.array(guess)
        q[self.held] = self.values if s == 1.0 else self.scales.move(self.start, s * self.way)[self.held]
        equations = self.equations and self.equations._replace(values=self.equations.values + (1.0 - s) * self.gap)
        system = ClosureSystem(self._at(s).position, self.scales, self.free, equations)
        for damping in (0.0, DAMPING):
            found, residual = close(system, q, steps=NEWTON, damping=damping)
            if closed(residual):
                found[self.held] = q[self.held]  # Euler parameters are normalised at each step
                return Point(s, found, self.tangent(s, found))
        return None

    def tangent(self, s: float, q: Array) -> Tangent:
        """The direction of the least motion."""
        system = ClosureSystem(self._at(s).position, self.scales, np.ones_like(self.free), self.equations)
        _, J = system.evaluate(q)
        right = -J @ self.way
        if self.equations:
            right[len(right) - len(self.gap) :] -= self.gap / self.equations.scales
        if self.end != self.system.t:
            right[: len(right) - len(self.gap)] -= self._drift(s, q)
        if not len(J) or not np.isfinite(J).all() or not np.isfinite(right).all():
            return Tangent(self.scales.q * self.way)
        return Tangent(self.scales.q * (self.way + algebra.lstsq(J * self.free, right, rcond=NULL)))

    def _drift(self, s: float, q: Array) -> Array:
        """Change of the scaled residual (h,) with s at a position that stands still, by a central difference."""
        sides = [self.scales.residual(self._at(s + h).position(q)[0]) for h in (DRIFTED, -DRIFTED)]
        return np.asarray((sides[0] - sides[1]) / (2.0 * DRIFTED))


def follow(system: ConstraintSystem, start: Array, held: Mapping[str, float], end: float | None = None) -> Array:
    """Move held values, and the time, from where they are to others; the rest follows.

    See :class:`HeldPath` for the parameters.  Returns the position (n_q,) at the end.

    Raises
    ------
    AssemblyError
        The way is blocked (a dead centre of what is held), longer than 200 rad or length scales, or too winding for
        the number of steps allowed, as the many turns of a fine thread are.
    """
    path = HeldPath(system, start, held, end)
    if not path.length <= LONGEST:
        raise AssemblyError(f"the path from the reference position is too long ({path.length:.3g} rad or lengths)")
    timed = path.end != system.t
    continuation = Continuation(path, start, fewest=FEWEST if timed else 1)
    found = continuation.reach(1.0, TRIALS)
    if found is not None:
        return found.q
    last = continuation.points[-1]
    if timed:
        t = system.t + last.s * (path.end - system.t)
        raise AssemblyError(f"the path from t = {system.t:.6g} to t = {path.end:.6g} s is blocked at t = {t:.6g} s")
    if not continuation.blocked:
        raise AssemblyError(f"the path has too many bends: {TRIALS} steps cover {100 * last.s:.0f} % of it")
    raise AssemblyError(
        f"the path is blocked after {100 * last.s:.0f} % of it: the loops cannot close there, or the mechanism jumps, "
        "as at a dead centre of the prescribed coordinate; prescribe another one, or give a position beyond it"
    )
