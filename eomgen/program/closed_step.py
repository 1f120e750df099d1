"""Stage program: constraint rows -> first and second derivatives of the step onto them, where they hold.

The step is n(q) = N(q) d, d = -S J^T G^-1 e with e the scaled residuals, J their scaled Jacobian, G = J J^T.  Where
e = 0 derivatives of G^-1 meet only the changes of e: with y = G^-1 e' along a direction and weights k of n,

    m = S N^T k,  l = G^-1 J m,  r = m - J^T l,
    k . N d'' = -(J'_1 r) . y_2 + (J'_1^T l) . (J^T y_2) - (J'_2 r) . y_1 + (J'_2^T l) . (J^T y_1) - l . e''.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

from ..graph.core import Expr
from ..graph.differentiate import jvp, vjp
from ..graph.substitute import substitute
from .loop_blocks import LoopBlocks
from .second_order import hessian_product
from .sparse import times, transpose

#: Part of w1 . w2 that Euler parameters lose along themselves in turns by w: 1 - cos(|w| / 2) derived twice.
TURNED = 0.25


class ClosedStep:
    """The step onto the constraints.

    Parameters
    ----------
    loops : LoopBlocks
        With holonomic rows.
    """

    def __init__(self, loops: LoopBlocks) -> None:
        self.loops, self.terms = loops, loops.terms
        self.q, self.v = self._symbols(self.terms.q), self._symbols(self.terms.v)
        self.J = loops.J[: loops.h]
        self.columns = transpose(self.J, self.terms.n_v)
        self.e = [x * i for x, i in zip(self.terms.constraints, loops.inverse, strict=False)]
        self.rates = list(self.terms.q_dot)

    def _symbols(self, names: Sequence[str]) -> list[Expr]:
        return [self.terms.graph.symbol(name) for name in names]

    def _named(self, what: str, count: int) -> list[Expr]:
        return self._symbols([f"{what}[{k}]" for k in range(count)])

    # -- linear maps ----------------------------------------------------------------------------------------------
    def _solved(self, right: Sequence[Expr]) -> list[Expr]:
        """G^-1 right, by passes that leave no trace of the term in the factor."""
        factor, passes = self.loops.holonomic
        y = factor.solve(right)
        for _ in range(passes - 1):
            left = [x - z for x, z in zip(right, times(self.J, times(self.columns, y)), strict=True)]
            y = [x + z for x, z in zip(y, factor.solve(left), strict=True)]
        return y

    def _scaled(self, x: Sequence[Expr]) -> list[Expr]:
        return [a * s for a, s in zip(x, self.loops.s, strict=True)]

    def _moved(self, d: Sequence[Expr]) -> list[Expr]:
        """N d."""
        return substitute(self.rates, dict(zip(self.v, d, strict=True)))

    @cached_property
    def _weights(self) -> tuple[list[Expr], list[Expr]]:
        """Symbols k of weights, and N^T k."""
        k = self._named("weight of a step", len(self.q))
        return k, vjp(self.rates, k, self.v)

    def _pulled_back(self, weights: Sequence[Expr]) -> list[Expr]:
        """N^T weights."""
        k, pulled = self._weights
        return substitute(pulled, dict(zip(k, weights, strict=True)))

    def _change(self, direction: Sequence[Expr]) -> list[Expr]:
        """y along a direction of q."""
        return self._solved(jvp(self.e, dict(zip(self.q, direction, strict=True))))

    def _from(self, y: Sequence[Expr]) -> list[Expr]:
        """The change of d."""
        return [-x for x in self._scaled(times(self.columns, y))]

    # -- derivatives ----------------------------------------------------------------------------------------------
    def along(self, direction: Sequence[Expr]) -> list[Expr]:
        """P' direction, P' = I + n'."""
        moved = self._moved(self._from(self._change(direction)))
        return [x + y for x, y in zip(direction, moved, strict=True)]

    def pulled(self, weights: Sequence[Expr]) -> list[Expr]:
        """P'^T weights."""
        l = self._solved(times(self.J, self._scaled(self._pulled_back(weights))))
        return [x - y for x, y in zip(weights, vjp(self.e, l, self.q), strict=True)]

    def curved(self, weights: Sequence[Expr], direction: Sequence[Expr]) -> list[Expr]:
        """sum_i weights[i] (d2 n_i / dq2) direction."""
        terms, n, h = self.terms, self.terms.n_v, self.loops.h
        m = self._scaled(self._pulled_back(weights))
        l_value = self._solved(times(self.J, m))
        r_value = [x - y for x, y in zip(m, times(self.columns, l_value), strict=True)]
        y_value = self._change(direction)
        lifted, change = times(self.columns, y_value), self._from(y_value)
        k, l, r, y, t, d = (
            self._named(f"{what} of a step", count)
            for what, count in (("pull", len(self.q)), ("load", h), ("rest", n), ("row", h), ("lift", n), ("change", n))
        )
        seeds = dict(zip(self.q, direction, strict=True))
        turned_rest, turned_load = jvp(times(self.J, r), seeds), jvp(times(self.columns, l), seeds)
        rows = [x - z for x, z in zip(times(self.J, turned_load), turned_rest, strict=True)]
        turning = vjp(jvp(self.rates, seeds), k, self.v)  # of d along the other direction
        for i, j in terms.quaternion_slots:
            along = sum((a * b for a, b in zip(k[i + 1 : i + 4], self.q[i + 1 : i + 4], strict=True)), k[i] * self.q[i])
            turning[j : j + 3] = [x - TURNED * along * z for x, z in zip(turning[j : j + 3], d[j : j + 3], strict=True)]
        rows = [x - z for x, z in zip(rows, times(self.J, self._scaled(turning)), strict=True)]
        found = vjp(self.e, self._solved(rows), self.q)
        both = [*times(self.J, r), *times(self.J, t), *self._moved(d)]
        other = vjp(both, [*(-x for x in y), *l, *k], self.q)
        bent = hessian_product(self.e, l, self.q, direction)
        total = [a + b - c for a, b, c in zip(found, other, bent, strict=True)]
        known = (*weights, *l_value, *r_value, *y_value, *lifted, *change)
        return substitute(total, dict(zip((*k, *l, *r, *y, *t, *d), known, strict=True)))
