"""Stage kinematics: Kinematics and values of parameters -> constraints and slopes as functions of numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..graph.core import Expr
from ..graph.evaluate import compile_evaluator
from ..numeric.closure import close
from ..numeric.constraint_system import RESTARTS, Assembly, ConstraintSystem, CutJoints
from ..numeric.nearest_branch import close_nearest
from ..numeric.scales import Scales, Space
from .kinematics import Kinematics
from .row_scales import row_scales

Array = NDArray[np.float64]


class ConstraintFunctions:
    """The constraints of a kinematics as functions of numbers, with numbers for parameters and inputs."""

    def __init__(self, kinematics: Kinematics, values: Mapping[str, float]) -> None:
        self.kinematics = kinematics
        self.values = dict(values)
        c, loop = kinematics.constraints, kinematics.loop_coordinates
        self.n, self.m, self.h = len(kinematics.v), len(c.labels), len(c.values)
        space = Space.of(self.n, kinematics.quaternion_slots)
        self.neutral = np.zeros(len(kinematics.names)) if space is None else space.neutral()
        self._names = (*kinematics.names, *self.values, "t")
        self._hints = self._compile([value for _, value in kinematics.hints])
        length, *sizes = self._compile([kinematics.length_scale, *row_scales(kinematics)])(self.neutral, 0.0)
        self.length_scale = float(length)
        self.scales = place = Scales.of_kinds(kinematics.velocity_kinds, sizes, self.length_scale, space)
        self._position = position = self._split(c.values, c.jacobian)
        if kinematics.given_rates:  # positions do not move with velocities
            place = Scales.of_kinds(kinematics.kinds, sizes[: self.h], self.length_scale)
            position = self._split(c.values, c.slopes, len(kinematics.names))
        sizes_of_loops = np.array([self.length_scale if kind == "length" else 1.0 for kind in loop.kinds])
        cut = CutJoints(loop.names, loop.kinds, sizes_of_loops, self._split(loop.values, loop.jacobian))
        aligned = self._compile(list(c.aligned)) if c.aligned else None
        self.system = ConstraintSystem(position, place, kinematics.names, kinematics.kinds, c.labels, cut, aligned)

    def _compile(self, outputs: Sequence[Expr]) -> Callable[[Array, float], Array]:
        evaluator, rest = compile_evaluator(list(outputs), self._names), list(self.values.values())

        def call(q: Array, t: float) -> Array:
            with np.errstate(all="ignore"):
                return np.array(evaluator([*map(float, q), *rest, t]), dtype=float)

        return call

    def _split(
        self, values: Sequence[Expr], slopes: Sequence[Sequence[Expr]], width: int | None = None
    ) -> Callable[[Array, float], tuple[Array, Array]]:
        """Functions and their slopes (n_v wide by default) in one evaluation; those that vanish are not evaluated."""
        zero, k, shape = self.kinematics.graph.zero.id, len(values), (len(slopes), self.n if width is None else width)
        held = [(i, j, e) for i, row in enumerate(slopes) for j, e in enumerate(row) if e.id != zero]
        rows, columns = [i for i, _, _ in held], [j for _, j, _ in held]
        evaluate = self._compile([*values, *(e for _, _, e in held)])

        def call(q: Array, t: float) -> tuple[Array, Array]:
            found, matrix = evaluate(q, t), np.zeros(shape)
            matrix[rows, columns] = found[k:]
            return found[:k], matrix

        return call

    def position(self, q: Array, t: float = 0.0) -> tuple[Array, Array]:
        """C (h,) of the holonomic rows and C_q (m, n) of all."""
        return self._position(q, t)

    def with_rows(self, rows: Sequence[int]) -> ConstraintSystem:
        """The system with some of the constraint rows only."""
        chosen = np.array(rows, dtype=int)
        system = self.system

        def evaluate(q: Array, t: float) -> tuple[Array, Array]:
            C, C_q = system.evaluate(q, t)
            return C[chosen[chosen < self.h]], C_q[chosen[chosen < len(C_q)]]

        scales = system.scales._replace(c=system.scales.c[chosen[chosen < len(system.scales.c)]])
        return system._replace(evaluate=evaluate, scales=scales, labels=[system.labels[i] for i in rows])

    def place_jacobian(self, q: Array) -> Array:
        """J of the holonomic rows, scaled as positions are."""
        return self.system.scales.jacobian(self.system.position(q)[1][: self.h])

    def scaled_jacobian(self, q: Array, t: float = 0.0) -> Array:
        """J (m, n)."""
        return self.scales.jacobian(self.position(q, t)[1])

    def close(
        self,
        given: Mapping[str, float],
        guess: Mapping[str, float],
        restarts: int = RESTARTS,
        system: ConstraintSystem | None = None,
    ) -> Assembly:
        """Assemble with the given values exact, near the guess; with the rows of another system if there is one."""
        system = self.system if system is None else system
        given, guess = system.settle(given), system.settle(guess)
        start = system.with_values(system.with_values(self.neutral, guess), given)
        rough = system.wanted(guess)
        if rough is not None:  # come near the guessed coordinates of cut joints first
            start = close(system.closure(given)._replace(equations=rough), start)[0]
        return system.close(self._hinted(start, {**given, **guess}, system.t), given, restarts)

    def close_nearest(self, given: Mapping[str, float], guess: Mapping[str, float]) -> Assembly:
        """Assemble with the given values exact, on the branch that is nearest to the guess."""
        settled = self.system.settle(given), self.system.settle(guess)
        known = {**settled[0], **settled[1]}
        if guess:
            found = close_nearest(self.system, self.neutral, *settled, lambda q: self._hinted(q, known, self.system.t))
            if found is not None:
                return found
        return self.close(given, guess)

    def _hinted(self, q: Array, known: Mapping[str, float], t: float) -> Array:
        """A position with the coordinates of contact points that nobody knows where they may be."""
        for (name, _), value in zip(self.kinematics.hints, self._hints(q, t), strict=True):
            if name not in known and np.isfinite(value):
                q = self.system.with_values(q, {name: value})
        return q
