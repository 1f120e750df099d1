"""Stage kinematics: Kinematics and values of parameters -> constraints and slopes as functions of numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy

import numpy as np
from numpy.typing import NDArray

from ..graph.core import Expr
from ..graph.evaluate import compile_evaluator
from ..numeric import (
    Assembly,
    Scales,
    assemble,
)
from ..numeric.assembly import RESTARTS
from ..numeric.closure import ClosureSystem, WantedValues, close
from ..numeric.scales import Space
from ..numeric.space import settle
from .kinematics import Kinematics
from .row_scales import row_scales

Array = NDArray[np.float64]


class ConstraintFunctions:
    """C, C_q, loop coordinates and alignment of a kinematics as NumPy functions of q, with numbers for the rest."""

    def __init__(self, kinematics: Kinematics, values: Mapping[str, float]) -> None:
        self.kinematics = kinematics
        self.values = dict(values) | {"t": 0.0}
        c, loop = kinematics.constraints, kinematics.loop_coordinates
        self.n, self.m, self.k = len(kinematics.v), len(c.labels), len(loop.names)
        self.h = len(c.values)
        space = Space.of(self.n, kinematics.quaternion_slots)
        self.neutral = np.zeros(len(kinematics.names)) if space is None else space.neutral()
        self._names = (*kinematics.names, *self.values)
        self._rest = list(self.values.values())
        self.rows = np.arange(self.m)  #: those that count
        self._position = self._compile([*c.values, *_flat(c.jacobian)])
        self._loop = self._compile([*loop.values, *_flat(loop.jacobian)])
        self._aligned = self._compile(list(c.aligned))
        self._hints = self._compile([value for _, value in kinematics.hints])
        length, *sizes = self._compile([kinematics.length_scale, *row_scales(kinematics)])(self.neutral)
        self.length_scale = float(length)
        self.scales = Scales.of_kinds(kinematics.velocity_kinds, sizes, self.length_scale, space)
        self.place, self._slopes = self.scales, None  # positions move with velocities, unless q' is given
        if kinematics.given_rates:
            self.place = Scales.of_kinds(kinematics.kinds, sizes[: self.h], self.length_scale)
            self._slopes = self._compile([*c.values, *_flat(c.slopes)])

    def _compile(self, outputs: list[Expr]):  # type: ignore[no-untyped-def]
        evaluator = compile_evaluator(outputs, self._names)
        rest = self._rest

        def call(q: Array) -> Array:
            with np.errstate(all="ignore"):
                return np.array(evaluator([*map(float, q), *rest]), dtype=float)

        return call

    def position(self, q: Array) -> tuple[Array, Array]:
        """C (h,) of the holonomic rows and C_q (m, n) of all."""
        flat = self._position(q)
        J = flat[self.h :].reshape(self.m, self.n)
        return (flat[: self.h], J) if len(self.rows) == self.m else (flat[self.rows[self.rows < self.h]], J[self.rows])

    def with_rows(self, rows: Sequence[int]) -> ConstraintFunctions:
        """The same with some of the constraint rows only."""
        result = copy(self)
        result.rows = np.array(rows, dtype=int)
        result.scales = self.scales._replace(c=self.scales.c[result.rows])
        return result

    def set_time(self, t: float) -> None:
        """Take all functions at another time than 0."""
        self._rest[-1] = t

    def place_position(self, q: Array) -> tuple[Array, Array]:
        """What positions are closed with: :meth:`position`, or C and dC/dq (h, n_q) where q' is given."""
        if self._slopes is None:
            return self.position(q)
        flat = self._slopes(q)
        return flat[: self.h], flat[self.h :].reshape(self.h, len(q))

    def place_jacobian(self, q: Array) -> Array:
        """J of the holonomic rows, scaled as positions are."""
        return self.place.jacobian(self.place_position(q)[1][: self.h])

    def loop(self, q: Array) -> tuple[Array, Array]:
        """Coordinates y (k,) of cut joints and y_q (k, n)."""
        flat = self._loop(q)
        return flat[: self.k], flat[self.k :].reshape(self.k, self.n)

    def aligned(self, q: Array) -> Array:
        """Numbers that are positive unless an axis is flipped."""
        return np.asarray(self._aligned(q))

    def scaled_jacobian(self, q: Array) -> Array:
        """J (m, n)."""
        return self.scales.jacobian(self.position(q)[1])

    def settle(self, values: Mapping[str, float]) -> dict[str, float]:
        """Named values with all four Euler parameters of a rotation where some are given."""
        k, loop = self.kinematics, self.kinematics.loop_coordinates
        return settle((*k.names, *loop.names), (*k.kinds, *loop.kinds), values)

    def _equations(self, wanted: Mapping[str, float]) -> WantedValues | None:
        """Values for coordinates of cut joints as equations."""
        loop = self.kinematics.loop_coordinates
        picked = [j for j, n in enumerate(loop.names) if n in wanted]
        if not picked:
            return None
        scale = {"length": self.length_scale, "angle": 1.0, "turn": 1.0, "parameter": 1.0}

        def measure(q: Array) -> tuple[Array, Array]:
            y, y_q = self.loop(q)
            return y[picked], y_q[picked]

        return WantedValues(
            measure,
            np.array([wanted[loop.names[j]] for j in picked]),
            np.array([scale[loop.kinds[j]] for j in picked]),
            [loop.kinds[j] == "angle" for j in picked],
            [loop.names[j] for j in picked],
        )

    def close(self, given: Mapping[str, float], guess: Mapping[str, float], restarts: int = RESTARTS) -> Assembly:
        """Assemble with the given values exact, near the guess."""
        k = self.kinematics
        given, guess = self.settle(given), self.settle(guess)
        neutral = dict(zip(k.names, self.neutral, strict=True))
        start = np.array([given.get(n, guess.get(n, neutral[n])) for n in k.names], dtype=float)
        held = [j for j, n in enumerate(k.names) if n in given]
        rough = self._equations(guess)
        if rough is not None:  # come near the guessed coordinates of cut joints first
            free = np.ones(len(self.place.q))
            free[self.place.velocities(held)] = 0.0
            start = close(ClosureSystem(self.place_position, self.place, free, rough), start)[0]
        for (name, _), value in zip(k.hints, self._hints(start), strict=True):
            if name not in given and name not in guess and np.isfinite(value):
                start[k.names.index(name)] = value
        equations = self._equations(given)
        return assemble(
            self.place_position,
            start,
            self.place,
            held=held,
            equations=equations,
            alignment=self.aligned if k.constraints.aligned else None,
            names=k.names,
            labels=[k.constraints.labels[i] for i in self.rows],
            restarts=restarts,
        )


def _flat(rows: Sequence[Sequence[Expr]]) -> list[Expr]:
    return [e for row in rows for e in row]
