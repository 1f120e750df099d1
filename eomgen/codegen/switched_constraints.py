"""Constraints that close and open: rows w = w0 + W f -> their multipliers, and velocities after events.

While a constraint is closed its w is 0, else its multiplier is; both are linear in the multipliers and in the forces of
laws.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from ..base.limits.constraints import MEASURED
from ..base.limits.numbers import SINGULAR
from ..elements.forces.force import where
from ..expr.core import Expr, substitute
from ..expr.tensors import Matrix, combined, dot, total
from ..mechanics import Kinematics
from ..mechanics.switched import SwitchedRow
from ..model.mechanism import Event


class LinearValues(NamedTuple):
    """Values that are linear in forces: at no force, and what a unit of each force adds."""

    still: list[Expr]
    gain: Matrix


def solve_rows(result: LinearValues, rows: Sequence[SwitchedRow], count: int) -> LinearValues:
    """Values in terms of the forces of laws alone, the multipliers of the rows being solved for.

    The values end with the w of the rows, the forces with their multipliers; ``count`` is that of the laws.
    """
    if not rows:
        return result
    n = len(result.still) - len(rows)
    inner = [row[count:] for row in result.gain[n:]]
    on = [row.on for row in rows]
    A = switched_matrix(inner, on)
    right = [[-(s * w) for s, w in zip(on, result.still[n:], strict=True)]]
    right += [[-(s * row[j]) for s, row in zip(on, result.gain[n:], strict=True)] for j in range(count)]
    first, *columns = solve_switched(A, right)
    still = [combined(N, row[count:], first) for N, row in zip(result.still[:n], result.gain, strict=False)]
    gain = [[combined(row[j], row[count:], columns[j]) for j in range(count)] for row in result.gain[:n]]
    return LinearValues(still, gain)


def switched_matrix(inner: Matrix, on: Sequence[Expr]) -> Matrix:
    """Negative definite: that of the rows that are closed, -1 on the diagonal of the others."""
    size = range(len(on))
    return [[on[i] * inner[i][j] * on[j] + ((on[i] - 1.0) if i == j else 0.0) for j in size] for i in size]


def solve_switched(matrix: Matrix, right: Sequence[Sequence[Expr]]) -> list[list[Expr]]:
    """Solutions for a negative semidefinite matrix; a row that follows from those before it gets 0.

    There its pivot is rounding of its own diagonal, and so is all that is left of the row.
    """
    graph, n, A = matrix[0][0].graph, len(matrix), [list(row) for row in matrix]
    columns, pivots = [list(column) for column in right], list[Expr]()
    independent = []
    for k in range(n):
        least = SINGULAR * graph.apply("abs", matrix[k][k])
        independent.append(graph.apply("lt", least, graph.apply("abs", A[k][k])))
        pivots.append(where(independent[k], A[k][k], 1.0))
        for i in range(k + 1, n):
            ratio = where(independent[k], A[i][k] / pivots[k], 0.0)
            for j in range(k + 1, n):
                A[i][j] = A[i][j] - ratio * A[k][j]
            for column in columns:
                column[i] = column[i] - ratio * column[k]
    for x in columns:
        for k in reversed(range(n)):
            rest = total([x[k], *(-(A[k][j] * x[j]) for j in range(k + 1, n))])
            x[k] = where(independent[k], rest / pivots[k], 0.0)
    return columns


# -- velocities after events --------------------------------------------------------------------------------------
#: Equations of a mechanism onto which velocities are brought together with closed ones; of more they are judged only.
MOST = 120


class RowAfter(NamedTuple):
    """One equation after an event: 1 where it has to hold, C' and its slopes by v, C and its size."""

    on: Expr
    jacobian: Sequence[Expr]
    rate: Expr
    error: Expr  #: C; 0 for equations of velocities
    change: Expr  #: of it by the event
    size: Expr


class AfterEvents:
    """The velocities after events; ``columns`` are, by row, the accelerations that a unit of its multiplier makes."""

    def __init__(self, kinematics: Kinematics, rows: Sequence[SwitchedRow], columns: Matrix) -> None:
        self.kinematics, self.rows, self.columns = kinematics, rows, columns

    def velocities(self) -> dict[str, tuple[tuple[str, Expr], ...]]:
        """New velocities by event, of those that close constraints or give coordinates or velocities new values."""
        k = self.kinematics
        moving = {*k.names, *k.velocity_names}
        switched = [s.state for s in k.mechanism.switched]
        result = dict[str, tuple[tuple[str, Expr], ...]]()
        for event in k.mechanism.events:
            reset = dict(event.reset)
            closes = any(reset.get(state) == k.graph.one for state in switched)
            if closes or not moving.isdisjoint(reset):
                result[event.name] = tuple(zip(k.velocity_names, self._after(event, closes), strict=True))
        return result

    def _after(self, event: Event, closes: bool) -> list[Expr]:
        k, reset = self.kinematics, dict(event.reset)
        new = {k.graph.symbol(name): value for name, value in reset.items()}
        v = given_v = substitute(list(k.v), new)
        after = [self._closed(row, reset, new) for row in self.rows]
        lasting = list[RowAfter]()
        if not {*k.names, *k.velocity_names}.isdisjoint(reset):
            lasting = self._lasting(after, new)
            closed = [one._replace(on=row.on) for one, row in zip(after, self.rows, strict=True)] if closes else after
            acting = [*(lasting if len(lasting) <= MOST else ()), *closed]
            v = self._moved(v, v, acting, [self._shortest(one) for one in acting])
        if closes:  # an impact
            v = self._moved(v, given_v, after, [substitute(column, new) for column in self.columns])
        fits = k.graph.one
        for one in (*lasting, *after):
            fits = fits * self._fulfilled(one, given_v, v)
        no_number = k.graph.apply("log", fits)  # 0 where all are fulfilled
        return [x + no_number for x in v]

    def _moved(
        self, v: Sequence[Expr], known: Sequence[Expr], acting: Sequence[RowAfter], columns: Matrix
    ) -> list[Expr]:
        """Velocities that fulfil equations, from v by multiples of columns; their rates are those at ``known``."""
        rates = [_rate(one, known, v) for one in acting]
        inner = [[dot(one.jacobian, column) for column in columns] for one in acting]
        A = switched_matrix(inner, [one.on for one in acting])
        (impulses,) = solve_switched(A, [[-(one.on * rate) for one, rate in zip(acting, rates, strict=True)]])
        return [combined(before, [c[j] for c in columns], impulses) for j, before in enumerate(v)]

    def _closed(self, row: SwitchedRow, reset: Mapping[str, Expr], new: Mapping[Expr, Expr]) -> RowAfter:
        """Equations that may be no numbers while they are open: those of what closes now."""
        on = reset.get(row.state, row.on)
        rate, error, *J = substitute([row.rate, row.errors[0], *row.jacobian], new)
        before = substitute([row.errors[0]], {s: x for s, x in new.items() if s.node[1] == row.state})[0]
        return RowAfter(on, J, rate, error, error - before, self._size(row.kind))

    def _lasting(self, after: Sequence[RowAfter], new: Mapping[Expr, Expr]) -> list[RowAfter]:
        """The equations of the mechanism that are connected with closed ones, beside which they have to hold."""
        c, result = self.kinematics.constraints, []
        on = after[0].on
        for one in after[1:]:
            on = where(one.on, 1.0, on)
        reached = {k for row in self.rows for k, x in enumerate(row.jacobian) if not x.is_zero}
        known = [{k for k, x in enumerate(row) if not x.is_zero} for row in c.jacobian]
        while more := set[int]().union(*(row for row in known if row & reached)) - reached:
            reached |= more
        for i, (J, rate, kind) in enumerate(zip(c.jacobian, c.velocity, c.kinds, strict=True)):
            if not known[i] & reached:
                continue
            value = c.values[i] if i < len(c.values) else self.kinematics.graph.zero
            now, speed, *slopes = substitute([value, rate, *J], new)
            result.append(RowAfter(on, slopes, speed, now, now - value, self._size(kind)))
        return result

    def _shortest(self, one: RowAfter) -> list[Expr]:
        """Of an equation, the change of velocities in its direction, lengths in the length of the mechanism."""
        sizes = (self._size(kind) for kind in self.kinematics.velocity_kinds)
        return [-(j * size * size) for j, size in zip(one.jacobian, sizes, strict=True)]

    def _size(self, kind: str) -> Expr:
        return self.kinematics.length_scale if kind == "length" else self.kinematics.graph.one

    def _fulfilled(self, one: RowAfter, before: Sequence[Expr], after: Sequence[Expr]) -> Expr:
        """1 where an equation holds after the event, or need not hold, else 0."""
        graph, sizes = self.kinematics.graph, [one.size]
        for j, v, w in zip(one.jacobian, before, after, strict=True):
            if not j.is_zero:
                sizes.append(graph.apply("abs", j) * (graph.apply("abs", v) + graph.apply("abs", w)))
        holds = graph.apply("le", graph.apply("abs", _rate(one, before, after)), MEASURED * total(sizes))
        if not one.change.is_zero:  # an error that was there before may stay, and may go
            off = graph.apply("min", graph.apply("abs", one.change), graph.apply("abs", one.error))
            holds = holds * graph.apply("le", off, MEASURED * one.size)
        return where(one.on, holds, 1.0)


def _rate(one: RowAfter, known: Sequence[Expr], v: Sequence[Expr]) -> Expr:
    """C' at velocities v, from that at known ones."""
    return total([one.rate, *(j * (x - y) for j, x, y in zip(one.jacobian, v, known, strict=True) if not j.is_zero)])
