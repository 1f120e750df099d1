"""Stage program: SystemTerms -> Hessians of the inverse dynamics and of a tree's right-hand side, times a direction.

With weights w and a direction d the result is sum_i w_i (d2 f_i / dz2) d, which is the derivative along d of J^T w: one
reverse sweep over one forward sweep, a few times as long as f, however many unknowns z has (A. Griewank, A. Walther,
*Evaluating Derivatives*, 2nd ed. (2008), section 5.3).
"""

from __future__ import annotations

from collections.abc import Sequence

from ..graph.core import Expr
from ..graph.count import count
from ..graph.differentiate import jvp, vjp
from ..graph.substitute import substitute
from .factor import Factor, factorize, solve
from .terms import SystemTerms


def hessian_product(
    rows: Sequence[Expr], weights: Sequence[Expr], wrt: Sequence[Expr], direction: Sequence[Expr]
) -> list[Expr]:
    """sum_i weights[i] (d2 rows[i] / dwrt2) direction."""
    return vjp(jvp(rows, dict(zip(wrt, direction, strict=True))), weights, wrt)


class TreeHessian:
    """The accelerations of a tree, differentiated twice.

    Parameters
    ----------
    terms : SystemTerms
        Of a tree.
    accelerations : sequence of Expr
        (n,) of q and v.
    weights : sequence of Expr
        (n_x,) of q' and v'.
    direction : sequence of Expr
        (n_x + n_u,) changes of q, v and u.
    """

    def __init__(
        self, terms: SystemTerms, accelerations: Sequence[Expr], weights: Sequence[Expr], direction: Sequence[Expr]
    ) -> None:
        self.terms = terms
        self.accelerations = accelerations
        self.weights, self.direction = weights, direction
        self.z = self._symbols((*terms.q, *terms.v, *terms.u))

    def _symbols(self, names: Sequence[str]) -> list[Expr]:
        return [self.terms.graph.symbol(name) for name in names]

    def shortest(self) -> list[Expr]:
        """By the formula of the accelerations or by that of the inverse dynamics, whichever takes fewer operations."""
        found = [self.by_accelerations()]
        if self.terms.mass_matrix:
            found.append(self.by_inverse_dynamics())
        return min(found, key=lambda one: count(one).total)

    @property
    def _rates(self) -> list[Expr]:
        """q'"""
        return list(self.terms.q_dot)

    def by_accelerations(self) -> list[Expr]:
        """From the formula of v'."""
        return hessian_product([*self._rates, *self.accelerations], self.weights, self.z, self.direction)

    def by_inverse_dynamics(self) -> list[Expr]:
        """From r(z, a(z)) = 0 differentiated twice, r = M a + h.

        With a' = -M^-1 r_z d and w' = -M^-1 w the products of Hessians of r by (z, a) along (d, a') are (g, g_a); the
        accelerations change with z too, which adds -r_z^T M^-1 g_a.
        """
        terms, n_q = self.terms, len(self.terms.q)
        factor: Factor = factorize(terms.mass_matrix, terms.parent)
        r, a = list(terms.inverse_dynamics), self._symbols(terms.a)
        along = dict(zip(self.z, self.direction, strict=True))
        rate = [-x for x in solve(factor, jvp(r, along))]
        weights = [-x for x in solve(factor, self.weights[n_q:])]
        kept = [self._symbols([f"{name}({x})" for x in terms.a]) for name in ("rate", "weight")]
        g = hessian_product(r, kept[1], [*self.z, *a], [*self.direction, *kept[0]])
        g = substitute(g, dict(zip((*kept[0], *kept[1]), (*rate, *weights), strict=True)))
        moved = vjp(r, solve(factor, g[len(self.z) :]), self.z)
        turned = hessian_product(self._rates, self.weights[:n_q], self.z, self.direction)
        total = [x - y + z for x, y, z in zip(g, moved, turned, strict=False)]
        return substitute(total, dict(zip(a, self.accelerations, strict=True)))
