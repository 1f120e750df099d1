"""Loops whose state is far from any change point -> the shortest straight-line form.

All motions are v = B y with the preferred velocities y: B follows from the rows by orthogonal combinations
(:mod:`.linear_algebra`), block by block, so that every leg of a platform is paid for by itself.  With weights
W = S^-2 of the coordinates the nearest motion is the one with B^T W (v - B y) = 0, of as many unknowns as there are
freedoms; so the step onto the constraints, velocities and accelerations share B, and no matrix has the size of the
rows.

Where columns of B are long, or what they follow from is nearly dependent, the forms of :mod:`.loop_systems` take over.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

from ..base.limits.constraints import LOST
from ..expr.core import Expr, substitute
from ..expr.schedule import count
from ..native.limits import CROSSINGS_NEAR_SQUARE
from .linear_algebra import (
    Leg,
    OrthogonalFactor,
    Row,
    SparseFactor,
    connected,
    factorize,
    fronts,
    quadratic_form,
    rows_of,
    times,
    transpose,
    work,
)
from .loop_systems import SPREAD, LoopBlocks, embedded_accelerations, largest, total_magnitude
from .terms import SystemTerms

ENDLESS = 1e300  #: the length of a step that is not known here
ROW = 64  #: columns beside one from which on rows tell what is near, as columns of 160 four-bars no longer can
SAVED = 0.7  #: part of the operations of the ordinary blocks that others take at most which are tried before them
LONGER = 4  #: times as many multiplications as those these may take: 320 four-bars in a row take 0.6 of the time


class MotionLoops(LoopBlocks):
    """The expressions of both blocks, by motions."""

    passes = 1, 1

    def __init__(self, terms: SystemTerms) -> None:
        super().__init__(terms)
        self.lost = 1.0
        self.dependent = [k for k in range(terms.n_v) if k not in terms.preferred]
        place = {k: j for j, k in enumerate(self.dependent)}
        self._left = [{place[k]: x for k, x in row.items() if k in place} for row in self.rows]
        self.order = fronts(self._left, len(self.dependent))
        weights = [1.0 / s for s in self.s]
        self.weights = [x * x for x in weights]

    @property
    def estimate(self) -> int:
        """About how many multiplications the linear algebra takes, by the pattern alone."""
        total = work(self.order or (), 1) + self.terms.n_dof**3 // 6
        for part in connected(self._left):
            rows = [row for row, left in zip(self.rows, self._left, strict=True) if not part.isdisjoint(left)]
            freedoms = len(set().union(*rows)) - len(part)
            total += len(part) * freedoms * (freedoms + 2)
        return total

    @property
    def possible(self) -> bool:
        """Whether there is a mass matrix, all rows are of positions, and hold the dependent velocities."""
        return self.order is not None and self.h == len(self.J) and not self.terms.by_columns

    # -- motions --------------------------------------------------------------------------------------------------
    @cached_property
    def _factor(self) -> OrthogonalFactor:
        assert self.order is not None
        return OrthogonalFactor(self._left, len(self.dependent), self.order)

    def _particular(self, right: Sequence[Expr]) -> tuple[list[Expr], list[Expr]]:
        """x (n,) with C_q x = right and no independent part, and what redundant rows leave of right."""
        x = [self.terms.graph.zero] * self.terms.n_v
        result, left = self._factor.solve(right)
        for k, value in zip(self.dependent, result, strict=True):
            x[k] = value
        return x, left

    @cached_property
    def _motions(self) -> list[Row]:
        """B (n rows of f)."""
        zero = self.terms.graph.zero
        columns = [self._particular([-row.get(k, zero) for row in self.rows])[0] for k in self.terms.preferred]
        for k, column in zip(self.terms.preferred, columns, strict=True):
            column[k] = self.terms.graph.one
        return [{j: x[i] for j, x in enumerate(columns) if not x[i].is_zero} for i in range(self.terms.n_v)]

    @cached_property
    def _columns(self) -> list[Row]:
        return transpose(self._motions, self.terms.n_dof)

    @cached_property
    def _legs(self) -> list[Leg]:
        """The parts that fewer rows hold than freedoms drive."""
        zero, one, result = self.terms.graph.zero, self.terms.graph.one, list[Leg]()
        for part in self._factor.parts:
            places = [i for i, row in enumerate(self._left) if not part.isdisjoint(row)]
            rows = [self.rows[i] for i in places]
            C = [{r: -row[k] for r, row in enumerate(rows) if k in row} for k in self.terms.preferred]
            if len(places) < sum(map(bool, C)):
                units = [[one if j == i else zero for j in range(len(self._left))] for i in places]
                K = rows_of([self._particular(unit)[0] for unit in units])
                result.append(({self.dependent[k] for k in part}, K, C))
        return result

    @cached_property
    def _weighted(self) -> list[Row]:
        return [{i: x * self.weights[i] for i, x in column.items()} for column in self._columns]

    @cached_property
    def _products(self) -> list[Row]:
        """B^T W B."""
        return quadratic_form(self._columns, [{k: x} for k, x in enumerate(self.weights)], self._legs)

    @cached_property
    def _nearest(self) -> SparseFactor:
        return factorize(self._products)

    def _along(self, x: Sequence[Expr]) -> list[Expr]:
        """y (f,) for which B y is nearest to x."""
        return self._nearest.solve(times(self._weighted, x))

    @cached_property
    def _in_a_row(self) -> bool:
        """Whether a column is compared with so many others that what it has across them is small away from change
        points, too: 0.4 / n of the last crank of n four-bars in a row, where every loop leaves a row to the next.
        """
        return self._factor.longest > ROW

    def _follows(self) -> list[Expr]:
        """Whether the dependent velocities follow well from the independent ones: not by columns that are nearly
        parallel, or short beside others, nor so that they move many times as fast.
        """
        graph, s = self.terms.graph, self.s
        result = self._independent(LOST if self._in_a_row else CROSSINGS_NEAR_SQUARE)
        for j, k in enumerate(self.terms.preferred):
            square = self._products[j][j] * (s[k] * s[k])
            result.append(graph.apply("lt", square, graph.constant(SPREAD * SPREAD)))
        return result

    def _independent(self, limit: float) -> list[Expr]:
        """Whether every column has more than this part of its square across those before it."""
        graph, s = self.terms.graph, self.s
        scales = [s[k] * s[k] for k in self.dependent]
        lengths = [x * k for x, k in zip(self._factor.squares, scales, strict=True)]
        least: dict[int, Expr] = {}
        for part in self._factor.parts:
            least |= dict.fromkeys(part, largest([lengths[k] for k in part]) * CROSSINGS_NEAR_SQUARE)
        result = []
        for columns, ordinary, apart in self._factor.apart:
            for k in columns:
                ordinary, apart = ordinary * graph.apply("max", lengths[k], least[k]), apart * scales[k]
            result.append(graph.apply("lt", ordinary * limit, apart))
        return result

    # -- blocks ---------------------------------------------------------------------------------------------------
    def closing(self) -> list[Expr]:
        """As of LoopBlocks; the length is endless where another form is to take the step."""
        graph, e = self.terms.graph, self.residuals
        size = total_magnitude(e) * (self.unit / float(self.h))
        d, rest = self._particular(e)
        left = total_magnitude(rest) * self.unit if rest else graph.zero
        dz = [x - y for x, y in zip(d, times(self._motions, self._along(d)), strict=True)]
        length = total_magnitude([x * (1.0 / s) for x, s in zip(dz, self.s, strict=True)])
        length = graph.apply("select", self.all_of(self._follows()), length, graph.constant(ENDLESS))
        return [size, left, length, *(-x for x in dz)]

    def _moved(self, conditions: list[Expr]) -> list[Expr]:
        v = self.terms.symbols(self.terms.v)
        particular, _ = self._particular([-x for x in self.scaled(self.terms.constraint_rate)])
        y = [v[k] for k in self.terms.preferred]
        missed = [a - b - c for a, b, c in zip(v, particular, times(self._motions, y), strict=True)]
        y = [a + b for a, b in zip(y, self._along(missed), strict=True)]
        return [a + b for a, b in zip(particular, times(self._motions, y), strict=True)]

    def _accelerate(self, moved: dict[Expr, Expr], conditions: list[Expr]) -> tuple[list[Expr], list[Expr]]:
        terms = self.terms
        here = substitute([*terms.bias, *terms.gamma], moved)
        gamma = self.scaled(here[terms.n_v :])
        particular, _ = self._particular([-x for x in gamma])
        a, checks = embedded_accelerations(terms, self._motions, particular, here[: terms.n_v], self._legs)
        conditions += self._follows()
        if self._in_a_row:  # else columns tell already that no change point is near
            columns = self.all_of(self._independent(CROSSINGS_NEAR_SQUARE))
            conditions.append(terms.graph.apply("or", columns, self.separate_rows()))
        if self.redundant:  # whose rates may contradict each other
            rate = self.scaled(terms.constraint_rate)
            conditions += [self.is_met(list(moved.values()), rate), self.is_met(a, gamma)]
        return a, checks

    def _far(self) -> Expr:
        """Where this form is sound, no change point is near."""
        return self.terms.graph.one


def motion_loops(loops: LoopBlocks | None, longest: int) -> MotionLoops | None:
    """The form of right-hand sides away from change points, where the ordinary one takes many more operations.

    Mechanisms of few velocities have no use for it: their ordinary form is left for pivots near change points.
    """
    if loops is None or not loops.gentle:
        return None
    shorter = MotionLoops(loops.terms)
    if not shorter.possible or shorter.estimate > LONGER * longest:
        return None
    result, ordinary = (one.operations + count(one.closing()).total for one in (shorter, loops))
    return shorter if result < SAVED * ordinary else None
