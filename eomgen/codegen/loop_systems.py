"""SystemTerms with loops -> the straight-line form of their right-hand side, by bodies or embedded.

``closing`` is one Newton step onto the constraints, ``dynamics`` everything at the closed position: velocities brought
onto the constraints, then the accelerations, by the embedded system or by articulated bodies, with every zero known.
Where ``dynamics`` says that it is not sound, drivers take the algorithms of ``eomgen/native``, which pivot.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cached_property

from ..base.limits.constraints import GENTLE, KEPT, LEFT, LOST, ROUNDED, TIKHONOV, UNMOVED, VANISHED
from ..base.limits.numbers import ROW, STILL
from ..expr.core import Expr, substitute
from ..expr.schedule import count
from ..expr.tensors import total
from ..mechanics.constraint_functions import ALL, UNIT
from ..mechanics.methods.recursions import ConstraintRow, TreeMotion
from ..mechanics.sparse_rows import DiagonalBlock, diagonal_blocks
from ..native.limits import CROSSINGS_NEAR_SQUARE, CROSSINGS_SMALL
from .linear_algebra import (
    Leg,
    Row,
    SparseFactor,
    dot,
    exceeding,
    factorize,
    gram,
    in_parts,
    minimum_degree,
    outward,
    quadratic_form,
    rows_of,
    times,
    transpose,
)
from .terms import SystemTerms

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
    return total(x.graph.apply("abs", x) for x in values)


def summands(x: Expr) -> list[Expr]:
    """The terms of a sum of sums, each once."""
    result: list[Expr] = []
    waiting, seen = [x], {x}
    while waiting:
        y = waiting.pop()
        operation, *ids = y.node
        operands = [] if operation not in ("add", "sub", "neg") else [Expr(x.graph, i) for i in ids]
        if not operands:
            result.append(y)
        waiting += [y for y in operands if y not in seen]
        seen.update(operands)
    return result


def estimate(jacobian: Sequence[Sequence[Expr]], n_dof: int) -> int:
    """About how many multiplications the linear algebra of the embedded system takes, by the pattern of C_q (m, n)."""
    touching: dict[int, set[int]] = {}
    rows = rows_of(jacobian)
    for i, row in enumerate(rows):
        for k in row:
            touching.setdefault(k, set()).add(i)
    n = len(jacobian[0]) if jacobian else 0
    pattern = [dict.fromkeys(sorted({j for k in row for j in touching[k]})) for row in rows]
    return 2 * minimum_degree(pattern)[1] + n * n_dof * n_dof + n_dof**3 // 6


def apart(p: Expr, q: Expr, r: Expr, t: Expr) -> tuple[Expr, Expr, Expr]:
    """Of two columns (p, r) and (q, t) the product of their squares, that times the sine's square, the determinant."""
    determinant = p * t - q * r
    return (p * p + r * r) * (q * q + t * t), determinant * determinant, determinant


class LoopBlocks(ABC):
    """The expressions of both blocks, of terms with constraint rows and at least one degree of freedom."""

    #: Linear corrections with GENTLE of velocities, whose errors gamma squares, and of accelerations.
    passes: tuple[int, int]

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

    def scaled(self, x: Sequence[Expr]) -> list[Expr]:
        """What belongs to rows, the first ones or all, in their scales."""
        return [a * i for a, i in zip(x, self.inverse, strict=False)]

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
        e = self.scaled(self.terms.constraints)
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
    def solver(self) -> tuple[SparseFactor, tuple[int, int]]:
        """The factor of J J^T and a term, and how many passes of both corrections leave no trace of that."""
        if self.gentle:
            return self._regularised(self.J, GENTLE)[0], self.passes
        if self.redundant:
            return self._regularised(self.J, TIKHONOV)[0], (2, 2)
        return factorize(gram(self.J)), (1, 1)

    def _step(self, x: Sequence[Expr], r: Sequence[Expr], rows: int, factor: SparseFactor, passes: int) -> list[Expr]:
        """x less what passes with a factor find of C_q x + r, of so many rows, r scaled as they are."""
        e = [a + b for a, b in zip(r, times(self.rows[:rows], x), strict=True)]
        dz = times(transpose(self.J[:rows], self.terms.n_v), factor.settle(e, passes))
        return [a - s * b for a, s, b in in_parts(list(zip(x, self.s, dz, strict=True)), x)]

    def _corrected(self, x: list[Expr], r: Sequence[Expr], conditions: list[Expr], order: int = 1) -> list[Expr]:
        """The nearest x with C_q x + r = 0; where configurations may lose rank, that nothing is left is a condition.

        Velocities are of order 1, accelerations of order 2.
        """
        factor, passes = self.solver
        x = self._step(x, r, len(self.J), factor, passes[order - 1])
        if self.gentle:
            conditions.append(self.is_met(x, r))
        return x

    def is_met(self, x: Sequence[Expr], r: Sequence[Expr]) -> Expr:
        """Whether nothing is left of C_q x + r, r scaled as the rows are."""
        left = total_magnitude([a + b for a, b in zip(r, times(self.rows, x), strict=True)]) * self.unit
        moving = self.terms.n_v - self.terms.n_states
        size = total_magnitude([a * (1.0 / s) for a, s in zip(x[:moving], self.s, strict=False)])
        return self.terms.graph.apply("lt", left, size * LEFT + NOTHING)

    def nearest(self, x: Sequence[Expr], r: Sequence[Expr], rows: int, factor: SparseFactor, passes: int) -> list[Expr]:
        """The nearest x with C_q x + r = 0 of so many rows.

        All passes but the last are taken at once, of what each leaves, which needs no rows; what rounding leaves of
        these the last one mends.
        """
        for together in (passes - 1, 1) if passes > 1 else (1,):
            x = self._step(x, r, rows, factor, together)
        return list(x)

    @cached_property
    def holonomic(self) -> tuple[SparseFactor, int]:
        """The factor of the holonomic rows, and passes by it after which a change of position is projected."""
        if self.h == len(self.J):
            return self.of_velocities
        return self._regularised(self.J[: self.h], GENTLE)[0], self.passes[0]

    @property
    def of_velocities(self) -> tuple[SparseFactor, int]:
        """The factor of J J^T, of all rows, and passes by it after which velocities are projected."""
        return self.solver[0], self.solver[1][0]

    @cached_property
    def moved(self) -> list[Expr]:
        """Projected velocities (n,)."""
        return self._moved([])

    def _moved(self, conditions: list[Expr]) -> list[Expr]:
        return self._corrected(self.terms.symbols(self.terms.v), self.scaled(self.terms.constraint_rate), conditions)

    def dynamics(self) -> tuple[list[Expr], list[Expr]]:
        """Projected velocities (n,), accelerations (n,), 1 if these are sound, 1 if no change point can be near; and
        checks of the inertia.
        """
        conditions: list[Expr] = []
        moved = self._moved(conditions)
        a, checks = self._accelerate(dict(zip(self.terms.symbols(self.terms.v), moved, strict=True)), conditions)
        conditions.append(self.long_rows(self.lost))
        return [*moved, *a, self.all_of(conditions), self._far()], checks

    @property
    def operations(self) -> int:
        """Of :meth:`dynamics`."""
        outputs, checks = self.dynamics()
        return count([*outputs, *checks]).total

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
        result = {}
        for group, pivots in members.items():
            if group == ALL:
                size = largest(self.row_squares)
            else:
                size = (
                    unit
                    if group == UNIT
                    else graph.apply("max", largest(pivots), unit * (CROSSINGS_SMALL * CROSSINGS_SMALL))
                )
            result[group] = size * CROSSINGS_NEAR_SQUARE
        return result

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
        graph, pivots, limits = self.terms.graph, self.solver[0].pivots, self.short_squares
        separate = []
        for pivot, square, group in zip(pivots, self.row_squares, self.groups, strict=True):
            apart = graph.apply("lt", square * CROSSINGS_NEAR_SQUARE, pivot)
            separate.append(graph.apply("and", apart, graph.apply("lt", limits[group], square)))
        return self._as_many_as_the_rank(separate)

    def _as_many_as_the_rank(self, rows: Sequence[Expr]) -> Expr:
        """Whether a condition holds for as many rows as their rank."""
        if not self.redundant:
            return self.all_of(rows)
        return self.terms.graph.apply("lt", self.terms.n_v - self.terms.n_dof - 0.5, total(rows))


SPREAD = 100.0  #: dependent coordinates may move at most so many times as fast as independent ones (scaled)


def embedded_accelerations(
    terms: SystemTerms, B: Sequence[Row], a: Sequence[Expr], bias: Sequence[Expr], legs: Sequence[Leg] = ()
) -> tuple[list[Expr], list[Expr]]:
    """Accelerations a + B y with B^T (M (a + B y) + bias) = 0, and checks of the inertia B^T M B."""
    graph, f, scales = terms.graph, range(terms.n_dof), terms.coordinate_scales
    M = rows_of(terms.mass_matrix)
    force = [x + y for x, y in zip(bias, times(M, a), strict=True)]
    columns = transpose(B, terms.n_dof)
    factor = factorize([{k: row.get(k, graph.zero) for k in f} for row in quadratic_form(columns, M, legs)])
    y = factor.solve([-x for x in times(columns, force)])
    diagonal = {i: row.get(i, graph.zero) for i, row in enumerate(M)}
    squares = [dot({i: x * x for i, x in column.items()}, diagonal) for column in columns]
    units = [scales[k] * scales[k] if terms.n_dof > 1 else graph.one for k in terms.preferred]
    sizes = [graph.zero if x is None else x * k for x, k in zip(squares, units, strict=True)]
    checks = exceeding([d * k for d, k in zip(factor.pivots, units, strict=True)], sizes)
    if terms.n_dof == 1:  # there is no other motion whose inertia tells what nothing is
        moving = {k: scales[k] / scales[terms.preferred[0]] for k, row in enumerate(B) if row}
        reach = dot({k: ratio * ratio for k, ratio in moving.items()}, diagonal)
        if reach is not None:
            checks.append(graph.apply("lt", reach * STILL, factor.pivots[0]))
    return [x + d for x, d in zip(a, times(B, y), strict=True)], checks


class EmbeddedLoops(LoopBlocks):
    """M_e = B^T M B; sound where the preferred partition is well conditioned."""

    passes = 5, 4  # where weak rows keep something, drivers take more

    def __init__(self, terms: SystemTerms) -> None:
        super().__init__(terms)
        #: squares of a column of the dependent coordinates, and of its part across those before it
        self._angles: dict[tuple[Expr, Expr], None] = {}

    @property
    def determined(self) -> bool:
        """Whether some row holds each dependent coordinate; else the preferred partition is never sound."""
        columns = {k for row in self.J for k in row}
        return columns.issuperset(k for k in range(self.terms.n_v) if k not in self.terms.preferred)

    def _accelerate(self, moved: dict[Expr, Expr], conditions: list[Expr]) -> tuple[list[Expr], list[Expr]]:
        terms, graph = self.terms, self.terms.graph
        here = substitute([*terms.bias, *terms.gamma], moved)
        gamma = self.scaled(here[terms.n_v :])
        if self.gentle:
            a = self._corrected([graph.zero] * terms.n_v, gamma, conditions, 2)
            B, _ = self._partition(None, conditions)
        else:
            B, a = self._partition([-x for x in gamma], conditions)
        a, checks = embedded_accelerations(terms, B, a, here[: terms.n_v])
        return a, checks

    def _far(self) -> Expr:
        """By the columns of the dependent coordinates, which a dead centre of the independent ones makes nearly
        parallel too, where no row vanishes; or by the rows of all.
        """
        graph = self.terms.graph
        columns = [graph.apply("lt", size * CROSSINGS_NEAR_SQUARE, part) for size, part in self._angles]
        far = self.all_of([*columns, self.long_rows()])
        if self.gentle and columns and not self.redundant:
            far = graph.apply("or", far, self.separate_rows())
        return far

    # -- partition ------------------------------------------------------------------------------------------------
    def _partition(self, y: list[Expr] | None, conditions: list[Expr]) -> tuple[list[Row], list[Expr]]:
        """B (n rows of f) with C_q B = 0, the x (n,) with C_q x = y and no independent part.

        No y counts as zero.  Conditions of soundness are added.
        """
        terms, graph = self.terms, self.terms.graph
        dependent = [k for k in range(terms.n_v) if k not in terms.preferred]
        place = {k: j for j, k in enumerate(dependent)}
        left = [{place[k]: x for k, x in row.items() if k in place} for row in self.rows]
        right = [
            y or [graph.zero] * len(left),
            *([-row.get(k, graph.zero) for row in self.rows] for k in terms.preferred),
        ]
        blocks = diagonal_blocks(left) if len(left) == len(dependent) else None
        first: list[Expr] = []
        result: list[list[Expr]] = [[] for _ in terms.preferred]
        if dependent and (blocks is None or any(len(b.rows) > 2 for b in blocks)):
            first, *result = self._least_squares(left, right, conditions)
        elif blocks is not None:  # else rows that hold nothing: parameters alone decide whether they are closed
            first, *result = (self._substitute(left, blocks, r, [] if j else conditions) for j, r in enumerate(right))
        x = [graph.zero] * terms.n_v
        for i, value in zip(dependent, first, strict=True):
            x[i] = value
        B: list[Row] = [{} for _ in range(terms.n_v)]
        sizes: dict[Expr, list[Expr]] = {}  # by the most that is allowed
        for j, k in enumerate(terms.preferred):
            B[k][j] = graph.one
            for i, value in zip(dependent, result[j], strict=True):
                if not value.is_zero:
                    B[i][j] = value
                    sizes.setdefault(SPREAD * self.s[i] / self.s[k], []).append(graph.apply("abs", value))
        conditions += [graph.apply("lt", largest(values), most) for most, values in sizes.items()]
        return B, x

    def _substitute(
        self, rows: list[Row], blocks: list[DiagonalBlock], right: Sequence[Expr], conditions: list[Expr]
    ) -> list[Expr]:
        """Solve block after block, each of one or two rows."""
        graph = self.terms.graph
        x: list[Expr] = [graph.zero] * len(rows)
        for block in blocks:
            b = []
            for i in block.rows:
                total = right[i]
                for k, entry in rows[i].items():
                    if k not in block.columns and not x[k].is_zero:
                        total = total - entry * x[k]
                b.append(total)
            if len(b) == 1:
                x[block.columns[0]] = b[0] / rows[block.rows[0]][block.columns[0]] if not b[0].is_zero else b[0]
                continue
            (i, j), (k, l) = block.rows, block.columns
            p, q, r, t = (rows[m].get(c, graph.zero) for m in (i, j) for c in (k, l))
            sizes, cross, determinant = apart(p, q, r, t)
            conditions.append(graph.apply("lt", sizes * self.lost, cross))
            self._angles[sizes, cross] = None
            inverse = 1.0 / determinant
            x[k] = (t * b[0] - q * b[1]) * inverse
            x[l] = (p * b[1] - r * b[0]) * inverse
        return x

    def _least_squares(
        self, rows: list[Row], right: Sequence[Sequence[Expr]], conditions: list[Expr]
    ) -> list[list[Expr]]:
        """Solve by normal equations, refined once: redundant rows need no choice, and nothing is pivoted."""
        graph = self.terms.graph
        columns = transpose(rows, self.terms.n_v - self.terms.n_dof)
        E = gram(columns)
        factor = factorize(E)
        for i, pivot in enumerate(factor.pivots):
            if not (pivot - E[i][i]).is_zero:
                conditions.append(graph.apply("lt", E[i][i] * max(self.lost, ROUNDED), pivot))
                self._angles[E[i][i], pivot] = None
        result = []
        for b in right:
            x = factor.solve(times(columns, b))
            rest = [p - q for p, q in zip(b, times(rows, x), strict=True)]
            result.append([p + q for p, q in zip(x, factor.solve(times(columns, rest)), strict=True)])
        return result


class BodyLoops(LoopBlocks):
    """No partition and no mass matrix; sound where elimination keeps enough of every inertia."""

    passes = 3, 1  # what is left of both is looked at
    multipliers: list[Expr]  #: of the scaled rows, once there is a motion

    @cached_property
    def motion(self) -> TreeMotion | None:
        """The accelerations by articulated bodies, at the given velocities; None where some joint moves no mass."""
        if self.terms.constrained is None:
            return None
        solved, self.multipliers = self.move(self.scaled(self.terms.gamma))
        return None if any(d.is_zero for d in solved.pivots) else solved

    def move(self, rest: Sequence[Expr], forces: Sequence[Expr] | None = None) -> tuple[TreeMotion, list[Expr]]:
        """The motion with C_q a + rest = 0 under the loads, or under these forces alone; and the multipliers."""
        assert self.terms.constrained is not None
        rows = [ConstraintRow(row, x) for row, x in zip(self.rows, rest, strict=True)]
        solved = self.terms.constrained(rows, TIKHONOV if self.redundant else 0.0, loaded=forces is None, forces=forces)
        if not self.redundant or any(d.is_zero for d in solved.pivots):
            return solved, list(solved.multipliers)
        left = times(self.rows, solved.accelerations)  # by the term in G
        again = [ConstraintRow(row.entries, row.rest + x) for row, x in zip(rows, left, strict=True)]
        more = self.terms.constrained(again, TIKHONOV, loaded=False)
        total = tuple(a + b for a, b in zip(solved.accelerations, more.accelerations, strict=True))
        multipliers = [a + b for a, b in zip(solved.multipliers, more.multipliers, strict=True)]
        return solved._replace(accelerations=total), multipliers

    def _accelerate(self, moved: dict[Expr, Expr], conditions: list[Expr]) -> tuple[list[Expr], list[Expr]]:
        terms, graph, solved = self.terms, self.terms.graph, self.motion
        assert solved is not None
        conditions.append(self.is_sound)
        gamma = self.scaled(terms.gamma)
        pushed = [g * l for g, l in zip(solved.row_sizes, solved.multipliers, strict=True)]
        here = substitute([*solved.accelerations, *gamma, *pushed], moved)
        a, gamma, pushed = here[: terms.n_v], here[terms.n_v : -len(pushed)], here[-len(pushed) :]
        left = [x + y for x, y in zip(gamma, times(self.rows, a), strict=True)]
        moving = zip(a[: terms.n_v - terms.n_states], self.s, strict=False)
        size = total_magnitude([*(x / s for x, s in moving), *(x * self.unit for x in pushed)])
        conditions.append(graph.apply("lt", total_magnitude(left) * self.unit, size * LEFT + NOTHING))
        dz = times(transpose(self.J, terms.n_v), self.solver[0].solve(left))
        a = [x - s * d for x, s, d in zip(a, self.s, dz, strict=True)]
        return a, []

    @property
    def is_sound(self) -> Expr:
        """Whether elimination leaves enough of each inertia, and of what each multiplier moves, at a position."""
        assert self.motion is not None
        pivots = [d * s * s for d, s in zip(self.motion.pivots, self.s, strict=True)]
        kept = list(zip(outward(pivots, self.terms.parent), pivots, strict=True))
        if not self.redundant:
            kept += zip(self.motion.row_sizes, self.motion.row_pivots, strict=True)
        return self.all_of([self.terms.graph.apply("lt", size * KEPT, pivot) for size, pivot in kept])

    def _far(self) -> Expr:
        """By the rows, of which redundant ones keep nothing, or by the columns of the dependent coordinates."""
        graph, separate, angles = self.terms.graph, self.separate_rows(), self._angles_of_columns()
        if angles is None:
            return separate
        columns = [graph.apply("lt", size * CROSSINGS_NEAR_SQUARE, part) for size, part in angles]
        return graph.apply("or", self.all_of([*columns, self.long_rows()]), separate)

    def _angles_of_columns(self) -> list[tuple[Expr, Expr]] | None:
        """Squares of dependent columns and of what they have apart, where they are found one or two at a time."""
        dependent = set(range(self.terms.n_v)).difference(self.terms.preferred)
        left = [{k: x for k, x in row.items() if k in dependent} for row in self.J]
        blocks = diagonal_blocks(left) if len(left) == len(dependent) else None
        if blocks is None or any(len(b.rows) > 2 for b in blocks):
            return None
        angles: list[tuple[Expr, Expr]] = []
        for rows, columns in blocks:
            if len(rows) == 1:
                row, pivot = self.J[rows[0]], left[rows[0]][columns[0]]
                square = dot(row, row)
                angles += [(square, pivot * pivot)] if square is not None else []
            else:
                size, part, _ = apart(*(left[m].get(c, self.terms.graph.zero) for m in rows for c in columns))
                squares = [dot(self.J[m], self.J[m]) for m in rows]
                ordinary = largest(
                    [x * (1.0 / len(self.J[m])) for m, x in zip(rows, squares, strict=True) if x is not None]
                )
                # columns that are short beside the ordinary entry have no angle but that of their rounding
                angles.append((self.terms.graph.apply("max", size, ordinary * ordinary * CROSSINGS_NEAR_SQUARE), part))
        return angles


def straight_loops(terms: SystemTerms, longest: int) -> LoopBlocks | None:
    """The form that takes no pivots, if there is one whose factors take at most so many multiplications."""
    if not terms.n_c or not terms.n_dof or not (terms.mass_matrix or terms.by_columns):
        return None
    if terms.general_rates or terms.system is not None or not terms.projects:
        return None
    bodies = BodyLoops(terms)
    if bodies.motion is not None or terms.by_columns:
        return bodies if bodies.motion is not None else None
    if estimate(terms.constraint_jacobian, terms.n_dof) > longest:
        return None
    loops = EmbeddedLoops(terms)
    return loops if loops.determined else None
