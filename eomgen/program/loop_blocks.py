"""Stage program: SystemTerms with loops -> the straight-line blocks of their right-hand side.

``closing`` is one Newton step onto the constraints, ``dynamics`` everything at the closed position: velocities brought
onto the constraints, the preferred partition, the embedded system and the accelerations (the algorithms of
:mod:`eomgen.numeric`, with every zero known).  Where ``dynamics`` says that the preferred partition is not well
conditioned, drivers take another one.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

from ..graph.core import Expr
from ..graph.substitute import substitute
from ..limits.constraints import GENTLE, LEFT, LOST, TIKHONOV, UNMOVED, VANISHED
from ..limits.crossings import NEAR_SQUARE
from ..limits.inertia import STILL
from ..limits.rounding import ROW
from ..numeric.triangular import DiagonalBlock, diagonal_blocks
from .factor import exceeding
from .sparse import Row, SparseFactor, dot, factorize, fill, gram, rows_of, times, transpose
from .terms import SystemTerms

#: Linear corrections with GENTLE of velocities, whose errors gamma squares, and of accelerations; where weak rows keep
#: something, drivers take more.
PASSES = 5, 4
NOTHING = 1e-100  #: what is this small need not be told from 0
LARGE = 8  #: velocities above which configurations of lost rank are passed here too, pivoting being slow
SPREAD = 100.0  #: dependent coordinates may move at most so many times as fast as independent ones (scaled)


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


class LoopBlocks:
    """The expressions of both blocks.

    Parameters
    ----------
    terms : SystemTerms
        With constraint rows and at least one degree of freedom.
    """

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
        #: squares of a column of the dependent coordinates, and of its part across those before it
        self._angles: dict[tuple[Expr, Expr], None] = {}

    @property
    def determined(self) -> bool:
        """Whether some row holds each dependent coordinate; else the preferred partition is never sound."""
        held = {k for row in self.J for k in row}
        return held.issuperset(k for k in range(self.terms.n_v) if k not in self.terms.preferred)

    def estimate(self) -> int:
        """About how many multiplications the linear algebra takes."""
        n, f = self.terms.n_v, self.terms.n_dof
        pattern: list[dict[int, object]] = [{} for _ in self.J]
        touching: dict[int, set[int]] = {}
        for i, row in enumerate(self.J):
            for k in row:
                touching.setdefault(k, set()).add(i)
        for i, row in enumerate(self.J):
            pattern[i] = dict.fromkeys(sorted({j for k in row for j in touching[k]}))
        return 2 * fill(pattern) + n * f * f + f**3 // 6

    def _regularised(self, rows: Sequence[Row], relative: Expr | float) -> tuple[SparseFactor, Expr]:
        """The factor of J J^T + relative max(diag) I, and what was added."""
        G = gram(rows)
        size = largest([row.get(i, self.terms.graph.zero) for i, row in enumerate(G)])
        graph, term = self.terms.graph, size * relative
        if self.terms.n_dof == self.terms.n_v:  # rows that are zero at the declared parameters ask for no step
            term = graph.apply("select", graph.apply("lt", graph.constant(UNMOVED * UNMOVED), size), term, graph.one)
        for i, row in enumerate(G):
            row[i] = row.get(i, graph.zero) + term
        return factorize(G), term

    # -- position -------------------------------------------------------------------------------------------------
    def closing(self) -> list[Expr]:
        """Mean scaled residual; sizes of what linear theory leaves of it, and of the scaled step; the step (n,)."""
        graph = self.terms.graph
        if not self.h:
            return [graph.zero] * (3 + self.terms.n_v)
        e = [x * i for x, i in zip(self.terms.constraints, self.inverse, strict=False)]
        if self.gentle:
            closed = self._closed()
            e = [graph.apply("select", closed, graph.zero, x) for x in e]
        rows = self.J[: self.h]
        size = total_magnitude(e) * (self.unit / float(self.h))
        factor, term = self._regularised(rows, graph.apply("max", graph.constant(GENTLE), size))
        z = factor.solve(e)
        dz = times(transpose(rows, self.terms.n_v), z)
        left = total_magnitude(z) * term * self.unit
        return [size, left, total_magnitude(dz), *(-s * d for s, d in zip(self.s, dz, strict=True))]

    def _closed(self) -> Expr:
        """Whether no row is farther off than its own sum is rounded: its step would be noise, large near lost rank."""
        graph = self.terms.graph
        beyond = [graph.apply("abs", row) - ROW * total_magnitude(summands(row)) for row in self.terms.constraints]
        return graph.apply("lt", largest(beyond), graph.zero)

    # -- velocity and acceleration --------------------------------------------------------------------------------
    @cached_property
    def _factor(self) -> tuple[SparseFactor, tuple[int, int]]:
        """The factor of J J^T, and how many passes of both corrections by it leave no trace of its regularisation."""
        if self.gentle:
            factor, term = self._regularised(self.J, GENTLE)
            self._rows_size = term * (1.0 / GENTLE)
            return factor, PASSES
        if len(self.J) > self.terms.n_v - self.terms.n_dof:  # redundant rows
            return self._regularised(self.J, TIKHONOV)[0], (2, 2)
        return factorize(gram(self.J)), (1, 1)

    def _corrected(self, x: list[Expr], r: Sequence[Expr], conditions: list[Expr], order: int = 1) -> list[Expr]:
        """The nearest x with C_q x + r = 0; where configurations may lose rank, that nothing is left is a condition.

        Velocities are of order 1, accelerations of order 2.
        """
        factor, passes = self._factor
        columns = transpose(self.J, self.terms.n_v)
        for _ in range(passes[order - 1]):
            e = [a + b for a, b in zip(r, times(self.rows, x), strict=True)]
            dz = times(columns, factor.solve(e))
            x = [a - s * b for a, s, b in zip(x, self.s, dz, strict=True)]
        if self.gentle:
            graph = self.terms.graph
            left = total_magnitude([a + b for a, b in zip(r, times(self.rows, x), strict=True)]) * self.unit
            size = total_magnitude([a * (1.0 / s) for a, s in zip(x, self.s, strict=True)])
            conditions.append(graph.apply("lt", left, size * LEFT + NOTHING))
        return x

    def dynamics(self) -> tuple[list[Expr], list[Expr]]:
        """Projected velocities (n,), accelerations (n,), 1 if the partition is sound, 1 if no change point can be near;
        and checks of the inertia.
        """
        terms, graph, f = self.terms, self.terms.graph, range(self.terms.n_dof)
        v = [graph.symbol(name) for name in terms.v]
        rate = [x * i for x, i in zip(terms.constraint_rate, self.inverse, strict=True)]
        conditions: list[Expr] = []
        moved = self._corrected(v, rate, conditions)
        here = substitute([*terms.bias, *terms.gamma], dict(zip(v, moved, strict=True)))
        gamma = [x * i for x, i in zip(here[terms.n_v :], self.inverse, strict=True)]
        if self.gentle:
            a = self._corrected([graph.zero] * terms.n_v, gamma, conditions, 2)
            B, _, sound = self._partition(None, conditions)
        else:
            B, a, sound = self._partition([-x for x in gamma], conditions)
        M = rows_of(terms.mass_matrix)
        force = [x + y for x, y in zip(here[: terms.n_v], times(M, a), strict=True)]
        columns = transpose(B, terms.n_dof)
        MB = [{k: x for k, b in enumerate(columns) if (x := dot(row, b)) is not None} for row in M]
        across = transpose(MB, terms.n_dof)
        embedded = {(i, k): dot(columns[i], across[k]) for i in f for k in f if k <= i}
        entries = {key: graph.zero if x is None else x for key, x in embedded.items()}
        factor = factorize([{k: entries[max(i, k), min(i, k)] for k in f} for i in f])
        y = factor.solve([-x for x in times(columns, force)])
        a = [x + d for x, d in zip(a, times(B, y), strict=True)]
        diagonal = {i: row.get(i, graph.zero) for i, row in enumerate(M)}
        squares = [dot({i: x * x for i, x in column.items()}, diagonal) for column in columns]
        units = [self.s[k] * self.s[k] if terms.n_dof > 1 else graph.one for k in terms.preferred]
        sizes = [graph.zero if x is None else x * k for x, k in zip(squares, units, strict=True)]
        checks = exceeding([d * k for d, k in zip(factor.pivots, units, strict=True)], sizes)
        if terms.n_dof == 1:  # there is no other motion whose inertia tells what nothing is
            moving = {k: self.s[k] / self.s[terms.preferred[0]] for k, row in enumerate(B) if row}
            reach = dot({k: ratio * ratio for k, ratio in moving.items()}, diagonal)
            if reach is not None:
                checks.append(graph.apply("lt", reach * STILL, factor.pivots[0]))
        return [*moved, *a, sound, self._far()], checks

    def _far(self) -> Expr:
        """1 where no change point can be near: by the columns of the dependent coordinates, which a dead centre of the
        independent ones makes nearly parallel too, or by the rows of all, which tell only without redundant ones.
        """
        graph, far = self.terms.graph, self.terms.graph.one
        for size, part in self._angles:
            condition = graph.apply("lt", size * NEAR_SQUARE, part)
            far = condition if far == graph.one else graph.apply("and", far, condition)
        if self.gentle and far != graph.one and len(self.J) == self.terms.n_v - self.terms.n_dof:
            pivots = self._factor[0].pivots
            least = pivots[0]
            for pivot in pivots[1:]:
                least = graph.apply("min", least, pivot)
            far = graph.apply("or", far, graph.apply("lt", self._rows_size * NEAR_SQUARE, least))
        return far

    # -- partition ------------------------------------------------------------------------------------------------
    def _partition(self, y: list[Expr] | None, conditions: list[Expr]) -> tuple[list[Row], list[Expr], Expr]:
        """B (n rows of f) with C_q B = 0, the x (n,) with C_q x = y and no independent part, whether all is sound.

        No y counts as zero.  Conditions of soundness may be given, and are added to.
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
        found: list[list[Expr]] = [[] for _ in terms.preferred]
        if dependent and (blocks is None or any(len(b.rows) > 2 for b in blocks)):
            first, *found = self._least_squares(left, right, conditions)
        elif blocks is not None:  # else rows that hold nothing: parameters alone decide whether they are closed
            first, *found = (self._substitute(left, blocks, r, [] if j else conditions) for j, r in enumerate(right))
        x = [graph.zero] * terms.n_v
        for i, value in zip(dependent, first, strict=True):
            x[i] = value
        B: list[Row] = [{} for _ in range(terms.n_v)]
        sizes: dict[Expr, list[Expr]] = {}  # by the most that is allowed
        for j, k in enumerate(terms.preferred):
            B[k][j] = graph.one
            for i, value in zip(dependent, found[j], strict=True):
                if not value.is_zero:
                    B[i][j] = value
                    sizes.setdefault(SPREAD * self.s[i] / self.s[k], []).append(graph.apply("abs", value))
        conditions += [graph.apply("lt", largest(values), most) for most, values in sizes.items()]
        sound = graph.one
        for condition in conditions:
            sound = condition if sound == graph.one else graph.apply("and", sound, condition)
        return B, x, sound

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
            determinant = p * t - q * r
            sizes, across = (p * p + r * r) * (q * q + t * t), determinant * determinant
            conditions.append(graph.apply("lt", sizes * self.lost, across))
            self._angles[sizes, across] = None
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
                conditions.append(graph.apply("lt", E[i][i] * self.lost, pivot))
                self._angles[E[i][i], pivot] = None
        found = []
        for b in right:
            x = factor.solve(times(columns, b))
            rest = [p - q for p, q in zip(b, times(rows, x), strict=True)]
            found.append([p + q for p, q in zip(x, factor.solve(times(columns, rest)), strict=True)])
        return found
