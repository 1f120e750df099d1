"""loops whose accelerations come from articulated bodies that carry the multipliers of constraints."""

from __future__ import annotations

from functools import cached_property

from ...base.algebra import diagonal_blocks
from ...base.limits.constraints import KEPT, LEFT, TIKHONOV
from ...base.limits.crossings import NEAR_SQUARE
from ...equations.articulated import ConstraintRow, TreeMotion
from ...graph.core import Expr
from ...graph.substitute import substitute
from ..factor import outward
from ..linear_algebra import dot, times, transpose
from .loop_blocks import NOTHING, LoopBlocks, apart, largest, total_magnitude


class BodyLoops(LoopBlocks):
    """No partition and no mass matrix; sound where elimination keeps enough of every inertia."""

    passes = 3, 1  # what is left of both is looked at
    multipliers: list[Expr]  #: of the scaled rows, once there is a motion

    @cached_property
    def motion(self) -> TreeMotion | None:
        """The accelerations by articulated bodies, at the given velocities; None where some joint moves no mass."""
        terms = self.terms
        if terms.constrained is None:
            return None
        rows = [ConstraintRow(row, x * i) for row, x, i in zip(self.rows, terms.gamma, self.inverse, strict=True)]
        solved = terms.constrained(rows, TIKHONOV if self.redundant else 0.0)
        if any(d.is_zero for d in solved.pivots):
            return None
        self.multipliers = list(solved.multipliers)
        for _ in range(self.solutions - 1 if self.redundant else 0):  # with what the term in G has left of the rows
            left = times(self.rows, solved.accelerations)
            again = [ConstraintRow(row.entries, row.rest + x) for row, x in zip(rows, left, strict=True)]
            more = terms.constrained(again, TIKHONOV, loaded=False)
            total = tuple(a + b for a, b in zip(solved.accelerations, more.accelerations, strict=True))
            self.multipliers = [a + b for a, b in zip(self.multipliers, more.multipliers, strict=True)]
            solved = solved._replace(accelerations=total)
        return solved

    def _accelerate(self, moved: dict[Expr, Expr], conditions: list[Expr]) -> tuple[list[Expr], list[Expr]]:
        terms, graph, solved = self.terms, self.terms.graph, self.motion
        assert solved is not None
        conditions.append(self.is_sound)
        gamma = [x * i for x, i in zip(terms.gamma, self.inverse, strict=True)]
        pushed = [g * l for g, l in zip(solved.row_sizes, solved.multipliers, strict=True)]
        here = substitute([*solved.accelerations, *gamma, *pushed], moved)
        a, gamma, pushed = here[: terms.n_v], here[terms.n_v : -len(pushed)], here[-len(pushed) :]
        left = [x + y for x, y in zip(gamma, times(self.rows, a), strict=True)]
        moving = zip(a[: terms.n_v - terms.n_states], self.s, strict=False)
        size = total_magnitude([*(x / s for x, s in moving), *(x * self.unit for x in pushed)])
        conditions.append(graph.apply("lt", total_magnitude(left) * self.unit, size * LEFT + NOTHING))
        dz = times(transpose(self.J, terms.n_v), self._solver[0].solve(left))
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
        columns = [graph.apply("lt", size * NEAR_SQUARE, part) for size, part in angles]
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
                usual = largest(
                    [x * (1.0 / len(self.J[m])) for m, x in zip(rows, squares, strict=True) if x is not None]
                )
                # columns that are short beside the usual entry have no angle but that of their rounding
                angles.append((self.terms.graph.apply("max", size, usual * usual * NEAR_SQUARE), part))
        return angles
