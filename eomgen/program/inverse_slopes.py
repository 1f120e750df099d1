"""Stage program: SystemTerms -> derivatives of the inverse dynamics M a + h by q, v and a, by the shortest way."""

from __future__ import annotations

from ..graph.core import Expr
from ..graph.count import count
from ..graph.differentiate import jacobian
from ..graph.traverse import reachable
from .block_groups import SHIFTS
from .jacobian_blocks import Entries, ResidualSlopes, unrolled_jacobian, unrolled_shift
from .terms import SystemTerms


def inverse_slopes(terms: SystemTerms, slopes: ResidualSlopes) -> list[Expr] | None:
    """(n, n_q + 2 n) row-major; None if written out it would be too long.

    By recursion over composite bodies, whose mass matrix comes along, or by differentiating the formula.
    """
    found: list[Entries] = []
    width = len(terms.q) + terms.n_v
    if slopes.forces is not None:
        mass = slopes.mass_matrix
        found.append(slopes.by_recursion | {(i, width + k): x for i, row in enumerate(mass) for k, x in enumerate(row)})
    symbols = [terms.graph.symbol(name) for name in (*terms.q, *terms.v, *terms.a)]
    nodes = len(reachable(terms.graph, (x.id for x in terms.inverse_dynamics)))
    if len(symbols) * nodes <= slopes.limits.jacobian_recursive:
        found.append(jacobian(list(terms.inverse_dynamics), symbols))
    if not found:
        return None
    entries = min(found, key=lambda one: count(list(one.values())).total)
    zero = terms.graph.zero
    return [entries.get((i, k), zero) for i in range(terms.n_v) for k in range(width + terms.n_v)]


def written_derivative(
    terms: SystemTerms, slopes: ResidualSlopes, name: str, unrolled: bool, touching: bool
) -> tuple[list[Expr], list[Expr]] | None:
    """A derivative of the inverse dynamics, or of a small tree's right-hand side, and checks of its mass matrix."""
    if touching and name not in SHIFTS:
        return None
    if name == "inverse_dynamics_derivatives":
        found = inverse_slopes(terms, slopes)
        return None if found is None else (found, [])
    if not unrolled or name not in ("jacobian", *SHIFTS):
        return None
    if name == "jacobian":
        return unrolled_jacobian(terms, slopes)
    return unrolled_shift(terms, slopes, terms.u if SHIFTS[name] == "input" else terms.p)
