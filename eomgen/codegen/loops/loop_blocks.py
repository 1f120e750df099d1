"""SystemTerms with loops -> what the straight-line blocks of their right-hand side have in common.

``closing`` is one Newton step onto the constraints, ``dynamics`` everything at the closed position: velocities brought
onto the constraints, then the accelerations, by the embedded system (:mod:`.embedded_loops`) or by articulated bodies
(:mod:`.body_loops`), with every zero known.  Where ``dynamics`` says that it is not sound, drivers take the algorithms
of :mod:`eomgen.numeric`, which pivot.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cached_property

from ...base.limits.constraints import GENTLE, LEFT, LOST, TIKHONOV, UNMOVED, VANISHED
from ...base.limits.crossings import NEAR_SQUARE, SMALL
from ...base.limits.numbers import ROW
from ...graph.core import Expr
from ...kinematics.row_groups import ALL, UNIT
from ..linear_algebra import Row, SparseFactor, dot, factorize, fill, gram, in_parts, rows_of, times, transpose
from ..terms import SystemTerms

NOTHING = 1e-100  #: what is this small need not be told from 0
LARGE = 8  #: velocities above which configurations of lost rank are passed here too, pivoting being slow


def largest(values: Sequence[Expr]) -> Expr:
    """The largest of some values; NaN if one is."""
    first, *rest = values
    for value in rest:
        first = first.graph.apply("max", first, value)
    return first


def total_magnitude(values: Sequence[Expr]) -> Expr:
    """The sum of absolute values, which takes no comparisons."""
    graph = values[0].graph
    total = graph.zero
    for x in values:
        total = total + graph.apply("abs", x)
    return total


def summands(x: Expr) -> list[Expr]:
    """The terms of a sum of sums, each once."""
    found: list[Expr] = []
    waiting, seen = [x], {x}
    while waiting:
        y = waiting.pop()
        operation, *ids = y.node
        operands = [] if operation not in ("add", "sub", "neg") else [Expr(x.graph, i) for i in ids]
        if not operands:
            found.append(y)
        waiting += [y for y in operands if y not in seen]
        seen.update(operands)
    return found


def estimate(jacobian: Sequence[Sequence[Expr]], n_dof: int) -> int:
    """About how many multiplications the linear algebra of the embedded system takes, by the pattern of C_q (m, n)."""
    touching: dict[int, set[int]] = {}
    held = rows_of(jacobian)
    for i, row in enumerate(held):
        for k in row:
            touching.setdefault(k, set()).add(i)
    n = len(jacobian[0]) if jacobian else 0
    pattern = [dict.fromkeys(sorted({j for k in row for j in touching[k]})) for row in held]
    return 2 * fill(pattern) + n * n_dof * n_dof + n_dof**3 // 6


def apart(p: Expr, q: Expr, r: Expr, t: Expr) -> tuple[Expr, Expr, Expr]:
    """Of two columns (p, r) and (q, t) the product of their squares, that times the sine's square, the determinant."""
    determinant = p * t - q * r
    return (p * p + r * r) * (q * q + t * t), determinant * determinant, determinant


class LoopBlocks(ABC):
    """The expressions of both blocks.

    Parameters
    ----------
    terms : SystemTerms
        With constraint rows and at least one degree of freedom.
    """

    #: Linear corrections with GENTLE of velocities, whose errors gamma squares, and of accelerations.
    passes: tuple[int, int]
    #: Solutions that leave no trace of the term TIKHONOV of redundant rows, each for what the last one left.
    solutions = 2

    def __init__(self, terms: SystemTerms) -> None:
        self.terms = terms
        self.s = terms.coordinate_scales
        one = terms.graph.one
        alike = len(set(terms.constraint_scales)) == 1
        #: 1 / scale of the rows; where all are alike it cancels but for the sizes of residuals
        self.inverse = [one if alike else 1.0 / s for s in terms.constraint_scales]
        self.unit = 1.0 / terms.constraint_scales[0] if alike else one
        self.rows = [{k: x * self.inverse[i] for k, x in row.items()}
                     for i, row in enumerate(rows_of(terms.constraint_jacobian))]  # fmt: skip
        self.J = [{k: x * self.s[k] for k, x in row.items()} for row in self.rows]
        self.h = len(terms.constraints)
        self.gentle = terms.n_v > LARGE
        self.lost = VANISHED if self.gentle else LOST
        #: whether there are more rows than their rank
        self.redundant = len(self.J) > terms.n_v - terms.n_dof

    def _regularised(self, rows: Sequence[Row], relative: Expr | float) -> tuple[SparseFactor, Expr]:
        """The factor of J J^T + relative max(diag) I, and what was added."""
        G = gram(rows)
        size = largest([row.get(i, self.terms.graph.zero) for i, row in enumerate(G)])
        graph, term = self.terms.graph, size * relative
        if self.terms.n_dof == self.terms.n_v:  # rows that are zero at the declared parameters ask for no step
            term = graph.apply("select", graph.apply("lt", graph.constant(UNMOVED * UNMOVED), size), term, graph.one)
        for i, row in enumerate(G):
            row[i] = row.get(i, graph.zero) + term
        return factorize(G, term), term

    # -- position -------------------------------------------------------------------------------------------------
    def closing(self) -> list[Expr]:
        """Mean scaled residual; sizes of what linear theory leaves of it, and of the scaled step; the step (n,)."""
        graph = self.terms.graph
        if not self.h:
            return [graph.zero] * (3 + self.terms.n_v)
        e = self.residuals
        rows = self.J[: self.h]
        size = total_magnitude(e) * (self.unit / float(self.h))
        factor, term = self._regularised(rows, graph.apply("max", graph.constant(GENTLE), size))
        z = factor.solve(e)
        dz = times(transpose(rows, self.terms.n_v), z)
        left = total_magnitude(z) * term * self.unit
        return [size, left, total_magnitude(dz), *(-s * d for s, d in zip(self.s, dz, strict=True))]

    @cached_property
    def residuals(self) -> list[Expr]:
        """The scaled holonomic rows (h,); all zero where rounding is all that is left of them."""
        graph = self.terms.graph
        e = [x * i for x, i in zip(self.terms.constraints, self.inverse, strict=False)]
        if self.gentle:
            e = [graph.apply("select", self._closed, graph.zero, x) for x in e]
        return e

    @property
    def guards(self) -> list[Expr]:
        """What is 0 where no step is to be made, as all residuals count as zero."""
        graph = self.terms.graph
        return [graph.apply("select", self._closed, graph.zero, graph.one)] if self.gentle and self.h else []

    @cached_property
    def _closed(self) -> Expr:
        """Whether no row is farther off than its own sum is rounded: its step would be noise, large near lost rank."""
        graph = self.terms.graph
        beyond = [graph.apply("abs", row) - ROW * total_magnitude(summands(row)) for row in self.terms.constraints]
        return graph.apply("le", largest(beyond), graph.zero)

    # -- velocity and acceleration --------------------------------------------------------------------------------
    @cached_property
    def _solver(self) -> tuple[SparseFactor, tuple[int, int]]:
        """The factor of J J^T and a term, and how many passes of both corrections leave no trace of that."""
        if self.gentle:
            return self._regularised(self.J, GENTLE)[0], self.passes
        if self.redundant:
            return self._regularised(self.J, TIKHONOV)[0], (self.solutions, self.solutions)
        return factorize(gram(self.J)), (1, 1)

    def _corrected(self, x: list[Expr], r: Sequence[Expr], conditions: list[Expr], order: int = 1) -> list[Expr]:
        """The nearest x with C_q x + r = 0; where configurations may lose rank, that nothing is left is a condition.

        Velocities are of order 1, accelerations of order 2.
        """
        factor, passes = self._solver
        e = [a + b for a, b in zip(r, times(self.rows, x), strict=True)]
        dz = times(transpose(self.J, self.terms.n_v), factor.settle(e, passes[order - 1]))
        x = [a - s * b for a, s, b in in_parts(list(zip(x, self.s, dz, strict=True)), x)]
        if self.gentle:
            conditions.append(self.held(x, r))
        return x

    def held(self, x: Sequence[Expr], r: Sequence[Expr]) -> Expr:
        """Whether nothing is left of C_q x + r, r scaled as the rows are."""
        left = total_magnitude([a + b for a, b in zip(r, times(self.rows, x), strict=True)]) * self.unit
        moving = self.terms.n_v - self.terms.n_states
        size = total_magnitude([a * (1.0 / s) for a, s in zip(x[:moving], self.s, strict=False)])
        return self.terms.graph.apply("lt", left, size * LEFT + NOTHING)

    def nearest(self, x: Sequence[Expr], r: Sequence[Expr], rows: int, factor: SparseFactor, passes: int) -> list[Expr]:
        """The nearest x with C_q x + r = 0 of so many rows, r scaled as they are, by passes with their factor.

        All but the last are taken at once, of what each leaves, which needs no rows; what rounding leaves of these the
        last one mends.
        """
        x, J = list(x), self.J[:rows]
        columns = transpose(J, self.terms.n_v)
        for together in (passes - 1, 1) if passes > 1 else (1,):
            e = [a + b for a, b in zip(r, times(self.rows[:rows], x), strict=True)]
            dz = times(columns, factor.settle(e, together))
            x = [a - k * b for a, k, b in in_parts(list(zip(x, self.s, dz, strict=True)), x)]
        return x

    @cached_property
    def holonomic(self) -> tuple[SparseFactor, int]:
        """The factor of the holonomic rows, and passes by it after which a change of position is projected."""
        if self.h == len(self.J):
            return self.factor, self.corrections
        return self.regularised(self.J[: self.h]), self.passes[0]

    @property
    def factor(self) -> SparseFactor:
        """Of J J^T, of all rows."""
        return self._solver[0]

    @property
    def corrections(self) -> int:
        """Passes by it after which velocities are projected."""
        return self._solver[1][0]

    def regularised(self, rows: Sequence[Row]) -> SparseFactor:
        """The factor of J J^T of some rows, which may depend on each other."""
        return self._regularised(rows, GENTLE)[0]

    @cached_property
    def moved(self) -> list[Expr]:
        """Projected velocities (n,)."""
        return self._moved([])

    def _moved(self, conditions: list[Expr]) -> list[Expr]:
        v = [self.terms.graph.symbol(name) for name in self.terms.v]
        rate = [x * i for x, i in zip(self.terms.constraint_rate, self.inverse, strict=True)]
        return self._corrected(v, rate, conditions)

    def dynamics(self) -> tuple[list[Expr], list[Expr]]:
        """Projected velocities (n,), accelerations (n,), 1 if these are sound, 1 if no change point can be near; and
        checks of the inertia.
        """
        v = [self.terms.graph.symbol(name) for name in self.terms.v]
        conditions: list[Expr] = []
        moved = self._moved(conditions)
        a, checks = self._accelerate(dict(zip(v, moved, strict=True)), conditions)
        conditions.append(self.long_rows(self.lost))
        return [*moved, *a, self.all_of(conditions), self._far()], checks

    @abstractmethod
    def _accelerate(self, moved: dict[Expr, Expr], conditions: list[Expr]) -> tuple[list[Expr], list[Expr]]:
        """Accelerations (n,) and checks of the inertia, with velocities -> projected ones; conditions are added."""

    @abstractmethod
    def _far(self) -> Expr:
        """1 where no change point can be near."""

    def all_of(self, conditions: Sequence[Expr]) -> Expr:
        """Whether all conditions hold."""
        sound = self.terms.graph.one
        for condition in conditions:
            sound = condition if sound == self.terms.graph.one else self.terms.graph.apply("and", sound, condition)
        return sound

    @property
    def groups(self) -> tuple[int, ...]:
        """Per row the group with which its length is compared."""
        return self.terms.row_groups or (ALL,) * len(self.J)

    @cached_property
    def row_squares(self) -> list[Expr]:
        """The squares of the lengths of the scaled rows."""
        zero = self.terms.graph.zero
        return [zero if (x := dot(row, row)) is None else x for row in self.J]

    @cached_property
    def short_squares(self) -> dict[int, Expr]:
        """Squares of the lengths at which rows of each group are short."""
        graph, members = self.terms.graph, dict[int, list[Expr]]()
        for square, group in zip(self.row_squares, self.groups, strict=True):
            members.setdefault(group, []).append(square)
        unit = graph.constant(1.0) / (self.unit * self.unit)
        found = {}
        for group, own in members.items():
            if group == ALL:
                size = largest(self.row_squares)
            else:
                size = unit if group == UNIT else graph.apply("max", largest(own), unit * (SMALL * SMALL))
            found[group] = size * NEAR_SQUARE
        return found

    def long_rows(self, part: float = 1.0) -> Expr:
        """Whether as many rows as their rank are not short beside their group, or shorter by a part of that square.

        A row may vanish where rank is lost; what is left of it then is rounding, and all ratios of its entries with it.
        """
        graph = self.terms.graph
        limits = {group: square * part for group, square in self.short_squares.items()}
        long = [graph.apply("lt", limits[k], x) for k, x in zip(self.groups, self.row_squares, strict=True)]
        return self._as_many_as_the_rank(long)

    def separate_rows(self) -> Expr:
        """Whether as many rows as the rank are neither short beside their group nor near to those before them."""
        graph, pivots, limits = self.terms.graph, self._solver[0].pivots, self.short_squares
        separate = []
        for pivot, square, group in zip(pivots, self.row_squares, self.groups, strict=True):
            apart = graph.apply("lt", square * NEAR_SQUARE, pivot)
            separate.append(graph.apply("and", apart, graph.apply("lt", limits[group], square)))
        return self._as_many_as_the_rank(separate)

    def _as_many_as_the_rank(self, rows: Sequence[Expr]) -> Expr:
        """Whether a condition holds for as many rows as their rank."""
        if not self.redundant:
            return self.all_of(rows)
        graph, held = self.terms.graph, self.terms.graph.zero
        for row in rows:
            held = held + row
        return graph.apply("lt", self.terms.n_v - self.terms.n_dof - 0.5, held)
