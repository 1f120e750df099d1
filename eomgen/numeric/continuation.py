"""Stage numeric: a closed position, other values of held coordinates -> the position reached by moving there steadily.

The way to stay on the branch the mechanism is on: small steps along the straight line of the held values.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..errors import AssemblyError
from .closure import DAMPING, ClosureSystem, WantedValues, close, closed
from .projection import largest
from .scales import Array, Indices, Position, Scales

STEP = 0.1  #: largest scaled change of a held value in one step
JUMP = 0.6  #: largest scaled change of any coordinate in one step
SMALLEST = 2.0**-10  #: of STEP, before giving up
TIMED = 0.3  #: STEP of a walk in time, which is predicted
TRIES = 4000  #: its steps and halvings
LONGEST = 200.0  #: scaled distance too long to walk
TRIALS = 5000  #: steps at most, those taken back included


def follow(
    position: Position,
    start: Array,
    scales: Scales,
    held: Indices,
    values: Array,
    equations: WantedValues | None = None,
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
    equations : WantedValues, optional
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
        system = ClosureSystem(position, scales, free, part)
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
                raise AssemblyError(
                    f"the way is blocked after {100 * done:.0f} % of it: there the loops stay open by "
                    f"{residual:.2g} (scaled), or the mechanism jumps, as at a dead centre of what is led; "
                    "lead another coordinate, or give a position on the other side"
                )
    return q


def follow_time(position: Callable[[float], Position], start: Array, scales: Scales, end: float) -> Array:
    """From a closed position at t = 0 to another time, in steps short enough to stay on the branch.

    Parameters
    ----------
    position : callable
        t -> (q (n,) -> C (m,), C_q (m, n)).
    start : (n,) array
        A closed position at t = 0.
    scales : Scales
    end : float
        Time; what moves only because of it is moved.

    Returns
    -------
    (n,) array

    Raises
    ------
    AssemblyError
        The way is blocked, or too long.
    """
    q, t, step = np.array(start), 0.0, end / 64.0
    slope = np.zeros_like(scales.q)  # scaled motion per time in the last step
    free = np.ones_like(scales.q)
    for _ in range(TRIES):
        if t == end:
            return q
        reached = end if abs(end - t) <= abs(step) else t + step
        ahead = scales.move(q, slope * (reached - t))
        trial, residual = close(ClosureSystem(position(reached), scales, free), ahead, steps=15)
        change = scales.distance(trial, q)
        if closed(residual) and largest(change) <= TIMED:
            q, t, slope = trial, reached, change / (reached - t)
            step *= 2.0 if largest(change) < 0.4 * TIMED else 1.0
        else:
            step *= 0.5
            if abs(step) < SMALLEST**2 * abs(end):
                break
    raise AssemblyError(f"the way from t = 0 to t = {end:.6g} s is blocked at t = {t:.6g} s")
