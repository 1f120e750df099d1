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
from ..graph.differentiate import vjp
from ..graph.substitute import substitute
from .closed_step import ClosedStep
from .loop_blocks import LoopBlocks
from .second_order import hessian_product


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
        rates = substitute(list(self.terms.q_dot), dict(zip(self.v, moved, strict=True)))
        rows, z = [*rates, *accelerations], [*self.q, *self.v, *self.u]
        if not self.loops.h:
            return hessian_product(rows, self.weights, z, self.direction), [*checks, sound]
        tangent, pull, turned = self._named("tangent"), self._named("pull"), self._named("turned")
        step, dq = ClosedStep(self.loops), self.direction[:n_q]
        along = [*tangent, *self.direction[n_q:]]
        bent = hessian_product(rows, self.weights, z, along)
        inner = [x + y for x, y in zip(bent[:n_q], step.curved(pull, tangent), strict=True)]
        total = [
            *(x + y for x, y in zip(step.pulled(inner), step.curved(turned, dq), strict=True)),
            *bent[n_q:],
        ]
        force = vjp(rows, self.weights, self.q)
        values = [*step.along(dq), *force, *step.pulled(pull)]
        names = [*tangent, *pull, *turned]
        values[2 * n_q :] = substitute(values[2 * n_q :], dict(zip(pull, force, strict=True)))
        return substitute(total, dict(zip(names, values, strict=True))), [*checks, sound]
