"""Stage program: a right-hand side with loops -> its weighted Hessians times a direction, at a closed state.

With F the rates by the formula of the straight-line blocks and P the projection of q, the right-hand side is
f(q, v, u) = F(P(q), v, u).  At a closed position P' = I + n' with n(q) the step onto the constraints, which two steps
make exact to second order, so that along d and e

    P''(d, e) = P' n''(d, e) + n''(P' d, P' e),
    f''(d, e) = F''(P' d, P' e) + F_q P''(d, e).

Reverse sweeps over forward ones give each term for all e at once (A. Griewank, A. Walther, *Evaluating Derivatives*,
2nd ed. (2008), section 5.3).
"""

from __future__ import annotations

from collections.abc import Sequence

from ..graph.core import Expr
from ..graph.differentiate import jvp, vjp
from ..graph.substitute import substitute
from .loop_blocks import LoopBlocks
from .second_order import hessian_product

TURNED = 0.125  #: part of |w|^2 that Euler parameters lose along themselves in a turn by w, 1 - cos(|w| / 2)


class LoopHessian:
    """The right-hand side of a mechanism with loops, differentiated twice.

    Parameters
    ----------
    loops : LoopBlocks
    weights : sequence of Expr
        (n_x,) of q' and v'.
    direction : sequence of Expr
        (n_x + n_u,) changes of q, v and u.
    """

    def __init__(self, loops: LoopBlocks, weights: Sequence[Expr], direction: Sequence[Expr]) -> None:
        self.loops, self.terms = loops, loops.terms
        self.weights, self.direction = list(weights), list(direction)
        self.q, self.v, self.u = (self._symbols(names) for names in (self.terms.q, self.terms.v, self.terms.u))

    def _symbols(self, names: Sequence[str]) -> list[Expr]:
        return [self.terms.graph.symbol(name) for name in names]

    def _named(self, what: str) -> list[Expr]:
        """Symbols for numbers, one for each coordinate."""
        return self._symbols([f"{what}({name})" for name in self.terms.q])

    def product(self) -> tuple[list[Expr], list[Expr]]:
        """sum_i weights[i] (d2 f_i / d(q, v, u)2) direction; and what is positive where it is sound."""
        n_q, n = len(self.q), self.terms.n_v
        dynamics, checks = self.loops.dynamics()
        moved, accelerations, sound = dynamics[:n], dynamics[n : 2 * n], dynamics[2 * n]
        rates = substitute(list(self.terms.rates or self.v), dict(zip(self.v, moved, strict=True)))
        rows, z = [*rates, *accelerations], [*self.q, *self.v, *self.u]
        if not self.loops.h:
            return hessian_product(rows, self.weights, z, self.direction), [*checks, sound]
        tangent, pull, turned = self._named("tangent"), self._named("pull"), self._named("turned")
        step, dq = self._step(), self.direction[:n_q]
        along = [*tangent, *self.direction[n_q:]]
        bent = hessian_product(rows, self.weights, z, along)
        inner = [x + y for x, y in zip(bent[:n_q], self._at_closed(step, pull, tangent), strict=True)]
        total = [
            *(x + y for x, y in zip(self._pulled(step, inner), self._at_closed(step, turned, dq), strict=True)),
            *bent[n_q:],
        ]
        force = vjp(rows, self.weights, self.q)
        values = [*self._along(step, dq), *force, *self._pulled(step, pull)]
        names = [*tangent, *pull, *turned]
        values[2 * n_q :] = substitute(values[2 * n_q :], dict(zip(pull, force, strict=True)))
        return substitute(total, dict(zip(names, values, strict=True))), [*checks, sound]

    # -- the step onto the constraints ----------------------------------------------------------------------------
    def _step(self) -> list[Expr]:
        """q after a step onto the constraints, to second order in that step."""
        loops, terms, zero = self.loops, self.terms, self.terms.graph.zero
        e = [x * i for x, i in zip(terms.constraints, loops.inverse, strict=False)]
        d = loops.nearest([zero] * terms.n_v, e, loops.h, *loops.holonomic)
        moves = substitute(list(terms.rates or self.v)[: len(self.q)], dict(zip(self.v, d, strict=True)))
        step = [x + y for x, y in zip(self.q, moves, strict=True)]
        for i, j in terms.quaternion_slots:
            lost = (d[j] * d[j] + d[j + 1] * d[j + 1] + d[j + 2] * d[j + 2]) * TURNED
            step[i : i + 4] = [x - lost * y for x, y in zip(step[i : i + 4], self.q[i : i + 4], strict=True)]
        return step

    def _at_closed(self, step: Sequence[Expr], weights: Sequence[Expr], direction: Sequence[Expr]) -> list[Expr]:
        """sum_i weights[i] (d2 step_i / dq2) direction."""
        return self._closed(hessian_product(step, weights, self.q, direction))

    def _along(self, step: Sequence[Expr], direction: Sequence[Expr]) -> list[Expr]:
        """P' direction."""
        return self._closed(jvp(step, dict(zip(self.q, direction, strict=True))))

    def _pulled(self, step: Sequence[Expr], weights: Sequence[Expr]) -> list[Expr]:
        """P'^T weights."""
        return self._closed(vjp(step, weights, self.q))

    def _closed(self, values: Sequence[Expr]) -> list[Expr]:
        """Where the constraints hold: their residuals are known to be 0 there."""
        zero = self.terms.graph.zero
        return substitute(list(values), {x: zero for x in self.terms.constraints if not x.is_zero})
