"""Stage numeric: a closed position, other values of held coordinates -> the position reached by moving there steadily.

The way to stay on the branch the mechanism is on: small steps along the straight line of the held values.
"""

from __future__ import annotations

import numpy as np

from ..errors import AssemblyError
from .closure import DAMPING, Equations, System, close, closed
from .projection import largest
from .scales import Array, Indices, Position, Scales

STEP = 0.1  #: largest scaled change of a held value in one step
JUMP = 0.6  #: largest scaled change of any coordinate in one step
SMALLEST = 2.0**-10  #: of STEP, before giving up
LONGEST = 200.0  #: scaled distance too long to walk
TRIALS = 5000  #: steps at most, those taken back included


def follow(
    position: Position,
    start: Array,
    scales: Scales,
    held: Indices,
    values: Array,
    equations: Equations | None = None,
) -> Array:
    """Move held coordinates, and functions y(q), from where they are to new values; the others follow.

    Parameters
    ----------
    position : callable
        q (n,) -> C (m,), C_q (m, n).
    start : (n,) array
        A closed position.
    held : (k,) array of int
        Coordinates that are led; all four Euler parameters of a rotation or none.
    values : (k,) array
        Their values at the end, reached exactly.
    equations : Equations, optional
        Functions of q that are led to values as well.

    Returns
    -------
    (n,) array

    Raises
    ------
    AssemblyError
        The way is blocked (a dead centre of a led coordinate), longer than 200 rad or length scales, or too winding
        for the number of steps allowed, as the many turns of a fine thread are.
    """
    q, target = np.array(start), np.array(start)
    target[held] = values
    moving = scales.velocities(held)
    free = np.ones_like(scales.q)
    free[moving] = 0.0
    way = (1.0 - free) * scales.distance(target, start)
    gap = equations.difference(equations.evaluate(q)[0]) if equations else np.empty(0)
    length = max(largest(way), largest(gap / equations.scales) if equations else 0.0)
    if not length <= LONGEST:
        raise AssemblyError(f"the way from the reference position is too long ({length:.3g} rad or length scales)")
    done, step = 0.0, min(1.0, STEP / length) if length else 1.0
    usual, trials = step, 0
    while done < 1.0:
        trials += 1
        if trials > TRIALS:
            raise AssemblyError(f"the way is too winding: {TRIALS} steps lead through {100 * done:.0f} % of it")
        reached = min(1.0, done + step)
        trial = np.array(q)
        trial[held] = values if reached == 1.0 else scales.move(start, reached * way)[held]
        part = equations._replace(values=equations.values + (1.0 - reached) * gap) if equations else None
        system = System(position, scales, free, part)
        for damping in (0.0, DAMPING):
            moved, residual = close(system, trial, steps=15, damping=damping)
            if closed(residual):
                break
        if closed(residual) and largest(scales.distance(moved, q)) <= JUMP:
            q, done = moved, reached
            step = min(2.0 * step, usual)
        else:
            step *= 0.5
            if step < SMALLEST * usual:
                raise AssemblyError(f"the way is blocked after {100 * done:.0f} % of it")
    return q
