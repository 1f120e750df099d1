"""SystemTerms -> derivatives of the residuals, the Jacobian of a small tree and that of loops as straight-line code.

Derivatives of the forces M a + h come by recursion over composite bodies where that takes fewer operations than
differentiating their formula.  For a tree d(v')/dx = -M^-1 d(M a + h)/dx at a = v', with the factor of M known
(J. Carpentier, N. Mansard, Analytical derivatives of rigid body dynamics algorithms, RSS 2018).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

from ..contact.pairs import list_operands
from ..expr.core import Expr, reachable, substitute
from ..expr.differentiate import jacobian, jvp
from ..expr.schedule import count
from ..expr.tensors import dot, total
from ..mechanics.methods.embedding import ForceSlopes
from .linear_algebra import SparseFactor, factorize_tree, path, positivity
from .loop_systems import BodyLoops
from .program import BY_BODIES, Block, Limits, Port
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
        chosen = self.by_recursion
        if self.is_short(terms.inverse_dynamics):
            other = self.by_formula()
            chosen = chosen if self.operations < count(list(other.values())).total else other
        for key, value in chosen.items():
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
    result: list[tuple[Entries, Solved]] = []
    if slopes.forces is not None:
        solved = solve_tree(terms, slopes.forces.mass_matrix, slopes.forces.bias)
        result.append((slopes.joined(slopes.forces, solved.accelerations), solved))
    if (terms.accelerations is None or not result) and slopes.is_short(terms.inverse_dynamics):
        solved = solve_tree(terms, terms.mass_matrix, terms.bias)
        result.append((_at(terms, slopes.by_formula(), solved.accelerations), solved))
    if not result:
        return None
    rates = jacobian(list(terms.q_dot), symbols)
    made = [(_rows(terms, rates, entries, solved, len(symbols)), solved.checks) for entries, solved in result]
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
    result = jacobian(list(terms.inverse_dynamics), symbols)
    rows = _rows(terms, {}, _at(terms, result, solved.accelerations), solved, len(names))
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
    factor = factorize_tree(mass, terms.parent)
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


# -- loops -------------------------------------------------------------------------------------------------------------
class LoopSlopes:
    """The derivatives of a right-hand side by articulated bodies with multipliers, along directions.

    Implicit differentiation of r1 = M a + h + C_q^T l = 0 and r2 = C_q a + gamma = 0 at the projected state: the
    changes (da, dl) along a direction solve the same system as (a, l) do, so that the pivots of bodies and of rows are
    used again and a column costs a sweep over the bodies (A. Sathya and J. Carpentier, IEEE Trans. Robotics 41 (2025),
    430-449).  What depends on the state alone is computed once; the blocks of directions read it as coefficients.
    """

    def __init__(self, loops: BodyLoops) -> None:
        self.loops, terms = loops, loops.terms
        self.terms = terms
        self.dq, self.dv, self.q, self.v, self.a = (
            terms.symbols(terms.ports[name]) for name in ("dq", "dv", "q", "v", "a")
        )

    # -- directions -----------------------------------------------------------------------------------------------
    def _positions(self) -> list[Expr]:
        """The change of the projected q; Euler parameters keep their part along themselves."""
        loops, terms = self.loops, self.terms
        rates = list(terms.q_dot)
        N = jacobian(rates, self.v)
        z = [self.dq[k] if k >= 0 else terms.graph.zero for k in terms.coordinate_of]
        for i, j in terms.quaternion_slots:
            e, de = self.q[i : i + 4], self.dq[i : i + 4]
            factor = 4.0 / (e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3])
            for c in range(3):
                z[j + c] = total([N[i + m, j + c] * factor * de[m] for m in range(4) if (i + m, j + c) in N])
        if loops.h:
            z = loops.nearest(z, [terms.graph.zero] * loops.h, loops.h, *loops.holonomic)
        moved = substitute(rates, dict(zip(self.v, z, strict=True)))
        for i, _ in terms.quaternion_slots:
            e, de = self.q[i : i + 4], self.dq[i : i + 4]
            along = dot(e, de) / dot(e, e)
            moved[i : i + 4] = [x + y * along for x, y in zip(moved[i : i + 4], e, strict=True)]
        return moved

    def _velocities(self, dq: Sequence[Expr], dv: list[Expr]) -> list[Expr]:
        """The change of the projected v, q changing by dq."""
        turned = jvp(self.terms.velocity_constraints, dict(zip(self.q, dq, strict=True)))
        r = self.loops.scaled(turned)
        return self.loops.nearest(dv, r, len(r), *self.loops.of_velocities)

    # -- accelerations --------------------------------------------------------------------------------------------
    def _changed(self, r1: Sequence[Expr], r2: Sequence[Expr]) -> list[Expr]:
        """da of the change of both residuals."""
        rest = self.loops.scaled(r2)
        solved, _ = self.loops.move(rest, [-x for x in r1])
        return self.loops.nearest(solved.accelerations, rest, len(rest), self.loops.solver[0], 1)

    def _along(self, dq: Sequence[Expr], dv: Sequence[Expr]) -> list[Expr]:
        """dq' and da along a projected direction."""
        terms, motion = self.terms, self.loops.motion
        assert motion is not None
        l = self.terms.symbols(terms.multipliers)
        r1, r2 = terms.force_residual, terms.acceleration_residual
        seeds = dict(zip((*self.q, *self.v), (*dq, *dv), strict=True))
        changes = jvp([*terms.q_dot, *r1, *r2], seeds)
        n_q, n = len(self.q), terms.n_v
        da = self._changed(changes[n_q : n_q + n], changes[n_q + n :])
        multipliers = self.loops.scaled(self.loops.multipliers)
        here = dict(zip((*self.a, *l), (*motion.accelerations, *multipliers), strict=True))
        return substitute(substitute([*changes[:n_q], *da], here), dict(zip(self.v, self.loops.moved, strict=True)))

    @cached_property
    def _columns(self) -> tuple[list[Expr], list[Expr]]:
        zero, dq = self.terms.graph.zero, self._positions()
        by_position = self._along(dq, self._velocities(dq, [zero] * len(self.v)))
        rows = len(self.loops.J)
        still = self.loops.nearest(list(self.dv), [zero] * rows, rows, *self.loops.of_velocities)
        return by_position, self._along([zero] * len(self.q), still)

    # -- stages ---------------------------------------------------------------------------------------------------
    @cached_property
    def coefficients(self) -> list[Expr]:
        """What columns take from the state, parameters apart."""
        graph = self.terms.graph
        parameters = set(self.terms.p)
        directions = {x.id for x in (*self.dq, *self.dv)}
        fixed: set[int] = set()
        turning: set[int] = set()
        result: dict[int, None] = {}
        both = [y.id for column in self._columns for y in column]
        for i in reachable(graph, both):
            kind, *args = graph.nodes[i]
            if kind == "const" or (kind == "sym" and args[0] in parameters):
                fixed.add(i)
            elif i in directions:
                turning.add(i)
            elif kind != "sym":
                if not turning.isdisjoint(args):
                    turning.add(i)
                    needed = [j for k in args if k not in turning for j in list_operands(graph, k)]
                    result.update(dict.fromkeys(k for k in needed if k not in fixed))
                elif fixed.issuperset(args):
                    fixed.add(i)
        result.update(dict.fromkeys(i for i in both if i not in turning and i not in fixed))
        return [Expr(graph, i) for i in result]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Symbols of the coefficients."""
        return tuple(f"coefficient[{k}]" for k in range(len(self.coefficients)))

    def block(self, name: str, ports: Sequence[Port], checks: Sequence[Expr]) -> Block:
        """A block of :data:`BY_BODIES` with the ports of q, v, dq, dv.

        ``loop_slopes``: projected velocities (n,), whether all is sound, whether no change point can be near, then the
        coefficients.  The others: the changes of [q'; v'] along dq and along dv, of the coefficients.
        """
        if name == BY_BODIES[0]:
            outputs, more = self.loops.dynamics()
            n = self.terms.n_v
            every = (*outputs[:n], *outputs[2 * n :], *self.coefficients)
            return Block(name, tuple(ports[:2]), every, (len(every),), (*checks, *more), public=False)
        mapping = dict(zip(self.coefficients, self.terms.symbols(self.names), strict=True))
        which = BY_BODIES.index(name) - 1
        changes = substitute(self._columns[which], mapping)
        arguments = (Port("coefficients", self.names), ports[2 + which])
        return Block(name, arguments, tuple(changes), (len(changes),), public=False)
