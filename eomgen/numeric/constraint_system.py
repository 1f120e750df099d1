"""Stage numeric: constraints and cut joints as functions of numbers -> closed positions, by assembly or by following.

One record for all: kinematics fills it with evaluated expressions, runtime with the kernels of a module.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from ..base.algebra import Array, Indices
from ..errors import AssemblyError
from .closure import ClosureSystem, WantedValues, close, closed
from .projection import largest
from .scales import Scales
from .space import settle
from .starts import starts

RESTARTS = 24  #: further starts near the guess


class Assembly(NamedTuple):
    """An assembled position."""

    q: Array  #: (n_q,)
    residual: float  #: largest scaled residual
    restarts: int  #: starts needed besides the guess
    distance: float  #: largest scaled distance of a coordinate from the guess


class CutJoints(NamedTuple):
    """Coordinates y of the joints that close loops, as functions of the tree."""

    names: tuple[str, ...]
    kinds: tuple[str, ...]  #: 'length', 'angle' (equal up to full turns), 'turn' or 'parameter'
    scales: Array  #: (k,) the length scale for lengths, 1 for others
    evaluate: Callable[[Array, float], tuple[Array, Array]]  #: (q, t) -> y (k,), y_q (k, n)


class ConstraintSystem(NamedTuple):
    """C(q, t) = 0 of one mechanism with numbers for its parameters, at one time."""

    evaluate: Callable[[Array, float], tuple[Array, Array]]  #: (q, t) -> C (h,), C_q (m, n), holonomic rows first
    scales: Scales  #: of positions
    names: tuple[str, ...]  #: (n_q,) of the coordinates
    kinds: tuple[str, ...]  #: (n_q,) 'length', 'angle' or 'parameter'
    labels: Sequence[str]  #: (m,) of the rows
    cut: CutJoints
    alignment: Callable[[Array, float], Array] | None = None  #: (q, t) -> positive but where a joint's axes are flipped
    t: float = 0.0

    def at(self, t: float) -> ConstraintSystem:
        """The same at another time."""
        return self._replace(t=t)

    def position(self, q: Array) -> tuple[Array, Array]:
        """C (h,) and C_q (m, n)."""
        return self.evaluate(q, self.t)

    def aligned(self, q: Array) -> bool:
        """Whether no joint closes with its axes flipped."""
        return self.alignment is None or bool((np.asarray(self.alignment(q, self.t)) > 0.0).all())

    def settle(self, values: Mapping[str, float]) -> dict[str, float]:
        """Named values with all four Euler parameters of a rotation where some are given."""
        return settle((*self.names, *self.cut.names), (*self.kinds, *self.cut.kinds), values)

    def with_values(self, q: Array, values: Mapping[str, float]) -> Array:
        """A position with coordinates of the tree replaced; loops are not closed."""
        result = np.array(q)
        for name, value in values.items():
            if name in self.names:
                result[self.names.index(name)] = value
        return result

    def indices(self, names: Mapping[str, float]) -> Indices:
        """Places in q of the coordinates among the names that belong to the tree."""
        return np.array([self.names.index(name) for name in names if name in self.names], dtype=np.intp)

    def measure(self, names: Sequence[str], q: Array) -> tuple[Array, Array]:
        """Coordinates y (k,) of the tree or of cut joints, and y_q (k, n)."""
        y, y_q = np.empty(len(names)), np.zeros((len(names), len(self.scales.q)))
        cut = None if all(name in self.names for name in names) else self.cut.evaluate(q, self.t)
        for k, name in enumerate(names):
            if name in self.names:
                i = self.names.index(name)
                y[k], y_q[k, self.scales.velocities([i])[0]] = q[i], 1.0
            elif cut is not None:
                j = self.cut.names.index(name)
                y[k], y_q[k] = cut[0][j], cut[1][j]
        return y, y_q

    def wanted(self, values: Mapping[str, float], names: Sequence[str] | None = None) -> WantedValues | None:
        """Values as equations, of cut joints alone where no names are given; None if there are none."""
        if names is None:
            names = [name for name in values if name in self.cut.names]
        if not names:
            return None
        sizes = {name: self.scales.q[self.scales.velocities([i])[0]] for i, name in enumerate(self.names)}
        sizes |= dict(zip(self.cut.names, self.cut.scales, strict=True))
        kinds = dict(zip(self.cut.names, self.cut.kinds, strict=True))
        numbers, scales = np.array([values[name] for name in names]), np.array([sizes[name] for name in names])
        return WantedValues(
            partial(self.measure, names), numbers, scales, [kinds.get(n) == "angle" for n in names], names
        )

    def closure(self, held: Mapping[str, float]) -> ClosureSystem:
        """The equations where these values are held."""
        free = np.ones(len(self.scales.q))
        free[self.scales.velocities(self.indices(held))] = 0.0
        return ClosureSystem(self.position, self.scales, free, self.wanted(held))

    @np.errstate(all="ignore")
    def close(self, guess: Array, held: Mapping[str, float], restarts: int = RESTARTS) -> Assembly:
        """Close the loops.

        Parameters
        ----------
        guess : (n_q,) array
        held : mapping of str to float
            Coordinates of the tree or of cut joints and their exact values.
        restarts : int
            Largest number of further starts, at fixed places around the guess.

        Returns
        -------
        Assembly
            The first closed position found without flipped axes; from a good guess the nearest one.

        Raises
        ------
        AssemblyError
            With the rows that stay open, what was held, and whether leaving the given values free helps.
        """
        system, guess = self.closure(held), self.with_values(guess, held)
        best, least, flipped = guess, np.inf, False
        for attempt, start in enumerate(starts(guess, system.free, self.scales, restarts)):
            q, residual = close(system, start)
            if not closed(residual):
                if residual < least:
                    best, least = q, residual
            elif not self.aligned(q):
                flipped = True
            else:
                return Assembly(q, residual, attempt, largest(self.scales.distance(q, guess)))
        from .assembly_failure import AssemblyFailure

        moved = self.scales.velocities(self.indices(held))
        failure = AssemblyFailure(system, guess, moved, best, flipped, self.names, self.labels, restarts)
        raise AssemblyError(failure.message(), [label for label, _ in failure.open_rows()])

    def gradients(self, q: Array, name: str) -> list[Array]:
        """Scaled gradients of a coordinate: three for e0, which stands for its rotation, none for e1 .. e3."""
        if name in self.names:
            index, unit, space = self.names.index(name), np.eye(len(self.scales.q)), self.scales.space
            if space is not None and any(i < index < i + 4 for i, _ in space.quaternion_slots):
                return []
            return [unit[k] for k in self.scales.velocities([index])]
        index = self.cut.names.index(name)
        return [np.asarray(self.cut.evaluate(q, self.t)[1][index] * self.scales.q / self.cut.scales[index])]
