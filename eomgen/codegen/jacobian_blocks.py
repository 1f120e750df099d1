"""SystemTerms -> derivatives of the residuals, and the Jacobian of a small tree as straight-line code.

Derivatives of the forces M a + h come by recursion over composite bodies where that takes fewer operations than
differentiating their formula.  For a tree d(v')/dx = -M^-1 d(M a + h)/dx at a = v', with the factor of M known
(J. Carpentier, N. Mansard, Analytical derivatives of rigid body dynamics algorithms, RSS 2018).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

from ..expr.core import Expr, reachable, substitute
from ..expr.differentiate import jacobian
from ..expr.schedule import count
from ..mechanics.methods.embedding import ForceSlopes
from .factor import factorize, path, positivity
from .linear_algebra import SparseFactor
from .program import Limits
from .terms import SystemTerms

Entries = dict[tuple[int, int], Expr]

PER_PAIR = 60  #: operations of the recursion for each pair of velocities on one path, at least


class ResidualSlopes:
    """Derivatives by [q; v] of r1 = M a + h + C_q^T l, r2 = C_q a + gamma and r3 = C_q v + C_t."""

    def __init__(self, terms: SystemTerms, limits: Limits) -> None:
        self.terms, self.limits = terms, limits

    @cached_property
    def forces(self) -> ForceSlopes | None:
        """The recursion, where the tree has one that is not too long."""
        return ForceSlopes(self.terms.kinematics) if self.recursive else None

    @cached_property
    def recursive(self) -> bool:
        """Whether the tree has the recursion, and pairs of velocities on one path to ground are few enough for it."""
        pairs = sum(len(path(self.terms.parent, k)) for k in range(self.terms.n_v))
        return self.terms.differentiable and PER_PAIR * pairs <= self.limits.jacobian_recursive

    @cached_property
    def operations(self) -> int:
        """Of the derivatives of M a + h by the recursion."""
        return count(list(self.by_recursion.values())).total

    @cached_property
    def by_recursion(self) -> Entries:
        """Derivatives of M a + h by recursion over composite bodies."""
        assert self.forces is not None
        return self.joined(self.forces, self.terms.symbols(self.terms.a))

    def joined(self, forces: ForceSlopes, a: Sequence[Expr]) -> Entries:
        n_q = len(self.terms.q)
        return forces.by_position(a) | {(i, n_q + k): value for (i, k), value in forces.by_velocity.items()}

    def is_short(self, rows: Sequence[Expr]) -> bool:
        """Whether differentiating the formula is not too long to be tried."""
        nodes = len(reachable(self.terms.graph, (r.id for r in rows)))
        return (len(self.terms.q) + self.terms.n_v) * nodes <= self.limits.jacobian_nodes

    def by_formula(self) -> Entries:
        """Derivatives of M a + h from its formula."""
        return jacobian(list(self.terms.inverse_dynamics), self.terms.symbols((*self.terms.q, *self.terms.v)))

    @cached_property
    def entries(self) -> Entries:
        """All that are not identically zero, in terms of (q, v, a, multipliers)."""
        terms = self.terms
        rest = [*terms.acceleration_residual, *terms.velocity_constraints]
        wrt = self.terms.symbols((*terms.q, *terms.v))
        if not self.recursive:
            forces = [x + y for x, y in zip(terms.inverse_dynamics, terms.constraint_forces, strict=True)]
            return jacobian([*forces, *rest], wrt)
        entries = jacobian([*terms.constraint_forces, *rest], wrt)
        own = self.by_recursion
        if self.is_short(terms.inverse_dynamics):
            other = self.by_formula()
            own = own if self.operations < count(list(other.values())).total else other
        for key, value in own.items():
            entries[key] = entries[key] + value if key in entries else value
        return entries

    def packed(self) -> list[Expr]:
        """r1_q, r1_v, r2_q, r2_v, r3_q, each row-major."""
        terms, zero = self.terms, self.terms.graph.zero
        n_q, n, m = len(terms.q), terms.n_v, terms.n_c
        result = []
        for first, size, columns in ((0, n, "qv"), (n, m, "qv"), (n + m, m, "q")):
            for column in columns:
                start, width = (0, n_q) if column == "q" else (n_q, n)
                result += [self.entries.get((first + i, start + k), zero) for i in range(size) for k in range(width)]
        return result


def unrolled_jacobian(terms: SystemTerms, slopes: ResidualSlopes) -> tuple[list[Expr], list[Expr]] | None:
    """The Jacobian of a tree, row-major, and checks of its mass matrix; None if it would be too long.

    Of the derivatives by recursion and by formula those that make it shorter.
    """
    symbols = terms.symbols((*terms.q, *terms.v))
    if not _fits(terms, slopes.limits, len(symbols)):
        return None
    found: list[tuple[Entries, Solved]] = []
    if slopes.forces is not None:
        solved = solve_tree(terms, slopes.forces.mass_matrix, slopes.forces.bias)
        found.append((slopes.joined(slopes.forces, solved.accelerations), solved))
    if (terms.accelerations is None or not found) and slopes.is_short(terms.inverse_dynamics):
        solved = solve_tree(terms, terms.mass_matrix, terms.bias)
        found.append((_at(terms, slopes.by_formula(), solved.accelerations), solved))
    if not found:
        return None
    rates = jacobian(list(terms.q_dot), symbols)
    made = [(_rows(terms, rates, entries, solved, len(symbols)), solved.checks) for entries, solved in found]
    rows, checks = min(made, key=lambda one: count([*one[0], *one[1]]).total)
    return (rows, checks) if count(rows).total <= slopes.limits.jacobian_nodes else None


def unrolled_shift(
    terms: SystemTerms, slopes: ResidualSlopes, names: Sequence[str]
) -> tuple[list[Expr], list[Expr]] | None:
    """The derivative of a tree's right-hand side by inputs or parameters, and checks, like the Jacobian."""
    if not terms.mass_matrix or not _fits(terms, slopes.limits, len(names)):
        return None
    symbols = terms.symbols(names)
    solved = solve_tree(terms, terms.mass_matrix, terms.bias)
    found = jacobian(list(terms.inverse_dynamics), symbols)
    rows = _rows(terms, {}, _at(terms, found, solved.accelerations), solved, len(names))
    return (rows, solved.checks) if count(rows).total <= slopes.limits.jacobian_nodes else None


def _at(terms: SystemTerms, entries: Entries, accelerations: Sequence[Expr]) -> Entries:
    """Derivatives at these accelerations."""
    mapping = dict(zip(terms.symbols(terms.a), accelerations, strict=True))
    return dict(zip(entries, substitute(list(entries.values()), mapping), strict=True))


class Solved(NamedTuple):
    """The factor of a tree's mass matrix, its accelerations, and the conditions for them to exist."""

    factor: SparseFactor
    accelerations: list[Expr]
    checks: list[Expr]


def solve_tree(terms: SystemTerms, mass: Sequence[Sequence[Expr]], bias: Sequence[Expr]) -> Solved:
    """The accelerations of a tree with this mass matrix and bias."""
    factor = factorize(mass, terms.parent)
    return Solved(factor, factor.solve([-h for h in bias]), positivity(mass, factor, terms.coordinate_scales))


def _fits(terms: SystemTerms, limits: Limits, columns: int) -> bool:
    """Whether so many solutions with the factor are not too long for straight-line code."""
    substitutions = sum(1 + 4 * len(path(terms.parent, k)) for k in range(terms.n_v))
    return not (terms.general_rates or terms.by_columns) and columns * substitutions <= limits.jacobian_nodes


def _rows(terms: SystemTerms, rates: Entries, forces: Entries, solved: Solved, width: int) -> list[Expr]:
    """Derivatives of x', row-major, from those of q' and of M a + h."""
    zero, n_q, n = terms.graph.zero, len(terms.q), terms.n_v
    columns = [
        [
            *(rates.get((i, k), zero) for i in range(n_q)),
            *solved.factor.solve([-forces.get((i, k), zero) for i in range(n)]),
        ]
        for k in range(width)
    ]
    return [column[i] for i in range(n_q + n) for column in columns]
