"""loops whose accelerations come from the embedded system of the preferred partition."""

from __future__ import annotations

from collections.abc import Sequence

from ...base.algebra import DiagonalBlock, diagonal_blocks
from ...base.limits.constraints import ROUNDED
from ...base.limits.crossings import NEAR_SQUARE
from ...base.limits.numbers import STILL
from ...graph.core import Expr
from ...graph.substitute import substitute
from ..factor import exceeding
from ..linear_algebra import Row, dot, factorize, gram, rows_of, times, transpose
from ..terms import SystemTerms
from .leg_motions import Motions
from .loop_blocks import LoopBlocks, apart, largest

SPREAD = 100.0  #: dependent coordinates may move at most so many times as fast as independent ones (scaled)


def embedded_accelerations(
    terms: SystemTerms, scales: Sequence[Expr], B: Motions, a: Sequence[Expr], bias: Sequence[Expr]
) -> tuple[list[Expr], list[Expr]]:
    """Accelerations a + B y with B^T (M (a + B y) + bias) = 0, and checks of the inertia B^T M B."""
    graph, f = terms.graph, range(terms.n_dof)
    M = rows_of(terms.mass_matrix)
    force = [x + y for x, y in zip(bias, times(M, a), strict=True)]
    columns, embedded = B.columns, B.gram(M)
    factor = factorize([{k: embedded.get((max(i, k), min(i, k)), graph.zero) for k in f} for i in f])
    y = factor.solve([-x for x in times(columns, force)])
    diagonal = {i: row.get(i, graph.zero) for i, row in enumerate(M)}
    squares = [dot({i: x * x for i, x in column.items()}, diagonal) for column in columns]
    units = [scales[k] * scales[k] if terms.n_dof > 1 else graph.one for k in terms.preferred]
    sizes = [graph.zero if x is None else x * k for x, k in zip(squares, units, strict=True)]
    checks = exceeding([d * k for d, k in zip(factor.pivots, units, strict=True)], sizes)
    if terms.n_dof == 1:  # there is no other motion whose inertia tells what nothing is
        moving = {k: scales[k] / scales[terms.preferred[0]] for k, row in enumerate(B.rows) if row}
        reach = dot({k: ratio * ratio for k, ratio in moving.items()}, diagonal)
        if reach is not None:
            checks.append(graph.apply("lt", reach * STILL, factor.pivots[0]))
    return [x + d for x, d in zip(a, times(B.rows, y), strict=True)], checks


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
        held = {k for row in self.J for k in row}
        return held.issuperset(k for k in range(self.terms.n_v) if k not in self.terms.preferred)

    def _accelerate(self, moved: dict[Expr, Expr], conditions: list[Expr]) -> tuple[list[Expr], list[Expr]]:
        terms, graph = self.terms, self.terms.graph
        here = substitute([*terms.bias, *terms.gamma], moved)
        gamma = [x * i for x, i in zip(here[terms.n_v :], self.inverse, strict=True)]
        if self.gentle:
            a = self._corrected([graph.zero] * terms.n_v, gamma, conditions, 2)
            B, _ = self._partition(None, conditions)
        else:
            B, a = self._partition([-x for x in gamma], conditions)
        a, checks = embedded_accelerations(terms, self.s, Motions(B, terms.n_dof), a, here[: terms.n_v])
        return a, checks

    def _far(self) -> Expr:
        """By the columns of the dependent coordinates, which a dead centre of the independent ones makes nearly
        parallel too, where no row vanishes; or by the rows of all.
        """
        graph = self.terms.graph
        columns = [graph.apply("lt", size * NEAR_SQUARE, part) for size, part in self._angles]
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
            sizes, across, determinant = apart(p, q, r, t)
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
                conditions.append(graph.apply("lt", E[i][i] * max(self.lost, ROUNDED), pivot))
                self._angles[E[i][i], pivot] = None
        found = []
        for b in right:
            x = factor.solve(times(columns, b))
            rest = [p - q for p, q in zip(b, times(rows, x), strict=True)]
            found.append([p + q for p, q in zip(x, factor.solve(times(columns, rest)), strict=True)])
        return found
