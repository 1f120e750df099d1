"""Stage numeric: a rough guess, values to hold -> coordinates with all loops closed, or a message that says why not."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ..errors import AssemblyError
from ..limits.constraints import CONTRADICTION, MEASURED
from . import algebra
from .assembly_velocity import Rates, VelocityEquations, assemble_velocity
from .closure import FAR, ClosureSystem, WantedValues, close, closed, remoteness
from .projection import largest
from .ranks import rank
from .scales import Array, Indices, Position, Scales

__all__ = ["Assembly", "Rates", "VelocityEquations", "WantedValues", "assemble", "assemble_velocity", "starts"]

RESTARTS = 24  #: further starts near the guess
RADII = (0.05, 0.2, 0.5, 1.0, 1.6, 2.4)  #: scaled distance of the starts, each used for a few
PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71)


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
        q -> (n_a,) numbers that are positive unless a loop closes with a joint's axes flipped.
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
    failure = _Failure(system, guess, held, best, flipped, names, labels, restarts)
    raise AssemblyError(failure.message(), [label for label, _ in failure.open_rows()])


def starts(guess: Array, free: Array, scales: Scales, restarts: int) -> Iterator[Array]:
    """The guess, then `restarts` places around it, ever farther away; the same ones every time."""
    yield guess
    for k in range(restarts):
        radius = RADII[min(k * len(RADII) // restarts, len(RADII) - 1)]
        # Halton sequence; the shifted index keeps later coordinates from repeating earlier ones
        unit = [_halton(k + 1 + 7 * (i // len(PRIMES)), PRIMES[i % len(PRIMES)]) for i in range(len(free))]
        yield scales.move(guess, radius * free * (2.0 * np.array(unit) - 1.0))


def _halton(index: int, base: int) -> float:
    value, part = 0.0, 1.0
    while index:
        part /= base
        value += part * (index % base)
        index //= base
    return value


class _Failure(NamedTuple):
    """Everything needed to say why an assembly failed."""

    system: ClosureSystem
    guess: Array
    held: Indices
    best: Array
    flipped: bool
    names: Sequence[str]
    labels: Sequence[str]
    restarts: int

    def message(self) -> str:
        given = self._given(self.guess, self.system.equations.values if self.system.equations else np.empty(0))
        if self.flipped:
            return (
                f"the loops close only with the axes of a joint flipped{self._with(given)}; "
                "give initial values nearer to the wanted position"
            )
        gaps = "the largest gaps are " + ", ".join(f"{label} {gap:.3g}" for label, gap in self.open_rows())
        contradiction = self._contradiction()
        if contradiction:
            return contradiction
        if not given:
            tried = f"({self.restarts + 1} starts tried)"
            return f"the loops do not close from the given guess {tried}: {gaps}; {self._advice()}"
        free = ClosureSystem(self.system.position, self.system.scales, np.ones_like(self.system.free))
        for start in starts(self.best, free.free, free.scales, self.restarts // 2):
            with np.errstate(all="ignore"):
                q, residual = close(free, start)
            if closed(residual):
                break
        else:
            return (
                f"the loops do not close{self._with(given)}, nor with these values left free "
                f"({self.restarts + 1} starts tried): {gaps}; {self._advice()}"
            )
        near = self._given(q, self.system.equations.evaluate(q)[0] if self.system.equations else np.empty(0))
        dof = len(free.free) - rank(free.evaluate(q)[1]).rank
        if len(given) > dof:
            return (
                f"the given values {', '.join(given)} are inconsistent: {len(given)} values for {dof} "
                f"degree{'s' if dof != 1 else ''} of freedom, and with all of them held {gaps}; "
                f"give fewer, or consistent ones such as {', '.join(near)}"
            )
        return f"the loops cannot close{self._with(given)}: {gaps}; a closed position nearby has {', '.join(near)}"

    def _contradiction(self) -> str:
        """Words for open rows that no position can satisfy together: they depend on each other everywhere."""
        m = len(self.system.position(self.best)[0])
        labels = (list(self.labels) or [f"C[{i}]" for i in range(m)])[:m]
        gaps = [(labels.index(label), label, gap) for label, gap in self.open_rows() if label in labels]
        rows = [i for i, _, _ in gaps]
        if not rows:
            return ""
        for start in starts(self.best, np.ones_like(self.system.free), self.system.scales, 3):
            C, C_q = self.system.position(start)
            J, e = self.system.scales.jacobian(C_q)[rows], self.system.scales.residual(C)[rows]
            if not np.isfinite(J).all():
                return ""
            out_of_reach = algebra.svd(J)[0][:, rank(J).rank :]
            if largest(out_of_reach.T @ e) <= MEASURED:
                return ""
        names = ", ".join(f"{label} (off by {gap:.3g})" for _, label, gap in gaps)
        if len(gaps) == 1:
            return (
                f"the constraint {names} can never hold: no coordinate changes it; take it away, or correct its values"
            )
        return (
            f"the constraints {names} contradict each other: they restrict the same motion and cannot hold together; "
            "take one away, or make their values agree"
        )

    def _advice(self) -> str:
        e, J = self.system.evaluate(self.guess)
        far = remoteness(e, np.sqrt((J * J).sum(axis=1)))
        if far > FAR:
            away = f"the guess is far away (about {far:.2g} times the mechanism's size)"
            return f"{away}: give a better one, or check the dimensions"
        return "check the dimensions, or give a better guess"

    def _with(self, given: list[str]) -> str:
        return f" with {', '.join(given)}" if given else ""

    def _given(self, q: Array, y: Array) -> list[str]:
        names = self.names or [f"q[{i}]" for i in range(len(q))]
        coordinates = [f"{names[i]} = {q[i]:.6g}" for i in self.system.scales.coordinates(self.held)]
        functions = self.system.equations.names if self.system.equations else ()
        return coordinates + [f"{name} = {value:.6g}" for name, value in zip(functions, y, strict=True)]

    def open_rows(self) -> list[tuple[str, float]]:
        """The three rows that stay open the most: label and gap."""
        C = self.system.position(self.best)[0]
        e, found = self.system.scales.residual(C), list(C)
        labels = list(self.labels) or [f"C[{i}]" for i in range(len(C))]
        if self.system.equations:
            y = self.system.equations.difference(self.system.equations.evaluate(self.best)[0])
            e = np.concatenate([e, y / self.system.equations.scales])
            found += list(y)
            labels += list(self.system.equations.names)
        worst = np.argsort(-np.abs(e), kind="stable")[:3].tolist()
        order = [i for i in worst if not abs(e[i]) <= CONTRADICTION] or worst[:1]
        return [(labels[i], abs(float(found[i]))) for i in order]
