"""Stage numeric: rough values of some coordinates -> the closed position whose values of them are nearest.

What is not guessed knows nothing of the branch.  So the guessed coordinates are held first, while the others turn to
where the loops are open least; from there the loops are closed.  This is done from several places of the others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from typing import NamedTuple

import numpy as np

from ..base.algebra import Array, Indices
from ..base.limits.analyses import BESIDE
from ..base.limits.constraints import MEASURED
from .closure import ClosureSystem, WantedValues, close, closed
from .constraint_system import Assembly, ConstraintSystem
from .projection import largest
from .ranks import rank
from .starts import starts

TURNED = 16  #: places of what is not guessed, besides the first
SHIFTED = 6  #: places around the guess where what is found lies beside it
ROUGH = 30  #: steps that turn what is not guessed


class Guess(NamedTuple):
    """Rough values of coordinates, and how far a position is from them."""

    system: ConstraintSystem
    start: Array  #: (n_q,) with the values of the tree's coordinates
    velocities: Indices  #: those that move these coordinates
    cut: WantedValues | None  #: coordinates of cut joints

    @classmethod
    def of(cls, system: ConstraintSystem, start: Array, guess: Mapping[str, float]) -> Guess:
        """The values of a guess; ``start`` says where all other coordinates are."""
        moved = np.unique(system.scales.velocities(system.indices(guess)))
        return cls(system, system.with_values(start, guess), moved, system.wanted(guess))

    def distances(self, q: Array) -> Array:
        """Scaled distances (k,) of a position from the guessed values."""
        found = self.system.scales.distance(q, self.start)[self.velocities]
        if self.cut is None:
            return found
        y = self.cut.difference(self.cut.evaluate(q)[0]) / self.cut.scales
        return np.concatenate([found, y])


@np.errstate(all="ignore")
def close_nearest(
    system: ConstraintSystem,
    start: Array,
    given: Mapping[str, float],
    guess: Mapping[str, float],
    adjust: Callable[[Array], Array] | None = None,
) -> Assembly | None:
    """Close the loops on the branch that is nearest to a guess.

    Parameters
    ----------
    system : ConstraintSystem
    start : (n_q,) array
        Where coordinates are that are neither given nor guessed.
    given : mapping of str to float
        Coordinates of the tree or of cut joints and their exact values.
    guess : mapping of str to float
        Rough values of further coordinates, of the tree or of cut joints.
    adjust : function (n_q,) -> (n_q,), optional
        Better places of coordinates that nobody gives, such as those of contact points.

    Returns
    -------
    Assembly or None
        Its distance is that of the guessed coordinates, the largest.  None where no attempt closes the loops.
    """
    rough = {name: value for name, value in guess.items() if name not in given}
    aim = Guess.of(system, system.with_values(start, given), rough)
    free, held = system.closure(given), system.closure({**given, **rough})

    def attempt(place: Array, count: int, first: ClosureSystem | None) -> Assembly | None:
        if first is not None:
            place = close(first, place, steps=ROUGH)[0]
        q, residual = close(free, system.with_values(place if adjust is None else adjust(place), given))
        if not closed(residual) or not system.aligned(q):
            return None
        return Assembly(q, residual, count, float(np.linalg.norm(aim.distances(q))))

    best = attempt(aim.start, 0, free._replace(equations=aim.cut) if aim.cut else None)
    for count, (place, enough) in enumerate(_places(aim, free, held), 1):
        if best is not None and best.distance <= enough:
            break
        found = attempt(place, count, held)
        if found is not None and (best is None or _nearer(found, best, free)):
            best = found
    return best and best._replace(distance=largest(aim.distances(best.q)))


def _places(aim: Guess, free: ClosureSystem, held: ClosureSystem) -> Iterator[tuple[Array, float]]:
    """Where to begin: other places of what is not guessed, then of all that may move; and the distance of a position
    beside which no further one is looked for."""
    scales = aim.system.scales
    for place in islice(starts(aim.start, held.free, scales, TURNED), TURNED if held.free.any() else 0):
        yield place, MEASURED
    for place in islice(starts(aim.start, free.free, scales, 4 * SHIFTED), 1, SHIFTED + 1):
        yield place, BESIDE


def _nearer(found: Assembly, best: Assembly, free: ClosureSystem) -> bool:
    """Whether a position is nearer to the guess than the best one, by more than what moves along a branch."""
    J = free.evaluate(best.q)[1]
    if rank(J).rank < int(free.free.sum()):  # the nearest point of a branch is found to its curvature only
        return best.distance > BESIDE and found.distance < 0.5 * best.distance
    return found.distance < best.distance - MEASURED


def differences(system: ConstraintSystem, q: Array, guess: Mapping[str, float]) -> tuple[tuple[str, float, float], ...]:
    """Guessed coordinates with their guess and their value at a position, the largest scaled difference first."""
    wanted = system.wanted(guess, list(guess))
    if wanted is None:
        return ()
    gaps = wanted.difference(wanted.evaluate(q)[0])
    order = np.argsort(-np.abs(gaps / wanted.scales), kind="stable").tolist()
    return tuple((name := wanted.names[k], guess[name], guess[name] + float(gaps[k])) for k in order)
