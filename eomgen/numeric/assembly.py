"""Stage numeric: a rough guess, values to hold -> coordinates with all loops closed, or a message that says why not."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..errors import AssemblyError, UnavailableError
from .assembly_velocity import Rates, VelocityEquations, assemble_velocity
from .closure import ClosureSystem, WantedValues, close, closed
from .projection import largest
from .scales import Array, Indices, Position, Scales
from .starts import starts

__all__ = ["Assembly", "Rates", "VelocityEquations", "WantedValues", "assemble", "assemble_velocity"]

RESTARTS = 24  #: further starts near the guess


class Assembly(NamedTuple):
    """An assembled position."""

    q: Array  #: (n,)
    residual: float  #: largest scaled residual
    restarts: int  #: starts needed besides the guess
    distance: float  #: largest scaled distance of a coordinate from the guess


@np.errstate(all="ignore")
def assemble(
    position: Position,
    guess: Array,
    scales: Scales,
    *,
    held: Sequence[int] | Indices = (),
    equations: WantedValues | None = None,
    alignment: Callable[[Array], Array] | None = None,
    names: Sequence[str] = (),
    labels: Sequence[str] = (),
    restarts: int = RESTARTS,
) -> Assembly:
    """Close the loops.

    Parameters
    ----------
    position : callable
        q (n,) -> C (m,), C_q (m, n); all rows, redundant ones included.
    guess : (n,) array
        Start; the held coordinates have their exact values here.
    scales : Scales
    held : sequence of int
        Coordinates that must not move.
    equations : WantedValues, optional
        Values of functions of q to reach exactly.
    alignment : callable, optional
        q -> (n_alignments,) numbers that are positive unless a loop closes with a joint's axes flipped.
    names, labels : sequences of str
        Names of the coordinates (n,) and of the constraint rows (m,), for messages.
    restarts : int
        Largest number of further starts, at fixed places around the guess.

    Returns
    -------
    Assembly
        The first closed position found; from a good guess the nearest one.

    Raises
    ------
    AssemblyError
        With the rows that stay open, what was held, and whether leaving the given values free helps.
    """
    guess = np.asarray(guess, dtype=float)
    held = scales.velocities(held)
    free = np.ones(len(scales.q))
    free[held] = 0.0
    system = ClosureSystem(position, scales, free, equations)
    best, least, flipped = guess, np.inf, False
    for attempt, start in enumerate(starts(guess, free, scales, restarts)):
        with np.errstate(all="ignore"):
            q, residual = close(system, start)
        if not closed(residual):
            if residual < least:
                best, least = q, residual
        elif alignment is not None and not (np.asarray(alignment(q)) > 0.0).all():
            flipped = True
        else:
            return Assembly(q, residual, attempt, largest(scales.distance(q, guess)))
    raise _failed(system, guess, held, best, flipped, names, labels, restarts)


def _failed(system: ClosureSystem, *found: Any) -> AssemblyError:
    """The error that says why; a slim package says only that."""
    try:
        from .assembly_failure import AssemblyFailure
    except UnavailableError:
        return AssemblyError("the loops do not close with the given values; give others, or check the dimensions")
    failure = AssemblyFailure(system, *found)
    return AssemblyError(failure.message(), [label for label, _ in failure.open_rows()])
