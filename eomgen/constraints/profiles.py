"""Constraint elements, cam profiles: an expression of the angle ``theta`` that repeats every turn."""

from __future__ import annotations

import math

import numpy as np

from ..base.limits.numbers import ZERO
from ..graph.core import Expr, atan2, cos, sin
from ..graph.differentiate import jvp
from ..graph.evaluate import evaluate
from ..graph.substitute import substitute, symbols_of
from ..records import dataclass

TRIALS = 5


@dataclass(frozen=True)
class Profile:
    """f(theta), theta from 0 to a full turn; ``local`` is the symbol that stands for theta in ``expression``.

    Beyond one turn it repeats if ``periodic``: theta then is brought back to [0, 2 pi], unless the expression repeats
    of itself.
    """

    expression: Expr
    local: Expr
    periodic: bool = True

    def at(self, angle: Expr) -> Expr:
        """f(angle)."""
        return self._put(self.expression, angle)

    def slope(self, angle: Expr) -> Expr:
        """f'(angle)."""
        return self._put(jvp([self.expression], {self.local: self.local.graph.one})[0], angle)

    def toward(self, x: Expr, y: Expr) -> Expr:
        """f at the direction of (x, y)."""
        return self._insert(self.expression, atan2(-y, -x) + math.pi)

    def _put(self, expression: Expr, angle: Expr) -> Expr:
        if self.periodic and not self.repeats():
            angle = atan2(-sin(angle), -cos(angle)) + math.pi
        return self._insert(expression, angle)

    def _insert(self, expression: Expr, angle: Expr) -> Expr:
        return substitute([expression], {self.local: angle})[0]

    def over_a_turn(self) -> tuple[list[Expr], str] | None:
        """Value and slope, which close after a turn, and the name of their angle; None where they need not."""
        if not self.periodic:
            return None
        (name,) = symbols_of([self.local])
        return [self.expression, *jvp([self.expression], {self.local: self.local.graph.one})], name

    def repeats(self) -> bool:
        """Whether the expression repeats every turn of itself, tried at random values of all symbols."""
        (name,) = symbols_of([self.local])
        others = sorted(symbols_of([self.expression]) - {name})
        random = np.random.default_rng(5)
        theta = np.concatenate([random.uniform(-7.0, 7.0, TRIALS), np.linspace(0.0, 6.2, 2 * TRIALS)])
        for _ in range(2):
            values = dict(zip(others, random.uniform(0.2, 1.4, len(others)).tolist(), strict=True))
            with np.errstate(all="ignore"):
                here, there, back = (
                    np.broadcast_to(evaluate([self.expression], values | {name: theta + k * math.tau})[0], theta.shape)
                    for k in (0, 1, -1)
                )
            size = float(np.abs(here).max())
            if not all(bool((np.abs(x - here) <= ZERO * size).all()) for x in (there, back)):
                return False
        return True
