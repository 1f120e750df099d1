"""Stage program, constraints that close and open: rows w = w0 + W f -> multipliers, and velocities after an impact.

While a constraint is closed its w is 0, else its multiplier is; both are linear in the multipliers and in the forces of
laws.  As one closes, v+ = v- - M^-1 C^T (C M^-1 C^T)^-1 (C v- + C_t) of it and of all that are closed, with M^-1 the
inverse on the motions that the constraints of the mechanism leave: a plastic impact (F. Pfeiffer, C. Glocker, Multibody
Dynamics with Unilateral Contacts (1996), ch. 8, without friction).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ..forces.branches import where
from ..graph.core import Expr
from ..graph.substitute import substitute
from ..kinematics import Kinematics
from ..kinematics.eliminate import Matrix, total
from ..kinematics.switched import SwitchedRow
from ..limits.inertia import SINGULAR


class LinearValues(NamedTuple):
    """Values that are linear in forces: at no force, and what a unit of each force adds."""

    still: list[Expr]
    gain: Matrix


def hold(found: LinearValues, rows: Sequence[SwitchedRow], count: int) -> LinearValues:
    """Values in terms of the forces of laws alone, the multipliers of the rows being solved for.

    The values end with the w of the rows, the forces with their multipliers; ``count`` is that of the laws.
    """
    if not rows:
        return found
    n = len(found.still) - len(rows)
    inner = [row[count:] for row in found.gain[n:]]
    on = [_closed(row) for row in rows]
    A = _switched_matrix(inner, on)
    right = [[-(s * w) for s, w in zip(on, found.still[n:], strict=True)]]
    right += [[-(s * row[j]) for s, row in zip(on, found.gain[n:], strict=True)] for j in range(count)]
    first, *columns = _solve(A, right)
    still = [_with(N, row[count:], first) for N, row in zip(found.still[:n], found.gain, strict=False)]
    gain = [[_with(row[j], row[count:], columns[j]) for j in range(count)] for row in found.gain[:n]]
    return LinearValues(still, gain)


def plastic_impacts(
    kinematics: Kinematics, rows: Sequence[SwitchedRow], inner: Matrix, columns: Matrix
) -> dict[str, tuple[tuple[str, Expr], ...]]:
    """By event, the velocities after a constraint has closed.

    Parameters
    ----------
    inner : matrix
        C M^-1 C^T of the rows with its sign changed.
    columns : matrix
        By row, the accelerations that a unit of its multiplier makes.
    """
    graph, found = kinematics.graph, dict[str, tuple[tuple[str, Expr], ...]]()
    for event in kinematics.mechanism.events:
        set_to = dict(event.reset)
        closing = [s for s in kinematics.mechanism.switched if set_to.get(s.state) == graph.one]
        if not closing:
            continue
        on = [set_to.get(row.state, _closed(row)) for row in rows]
        A = _switched_matrix(inner, on)
        (impulses,) = _solve(A, [[-(s * row.rate) for s, row in zip(on, rows, strict=True)]])
        after = []
        for j, (name, v) in enumerate(zip(kinematics.velocity_names, kinematics.v, strict=True)):
            change = [column[j] * i for column, i in zip(columns, impulses, strict=True)]
            after.append((name, total([v, *change])))
        # equations that may be no numbers while they are open: those of what closes now
        now = {graph.symbol(s.state): set_to[s.state] for s in kinematics.mechanism.switched if s.state in set_to}
        values = substitute([v for _, v in after], now)
        found[event.name] = tuple((name, v) for (name, _), v in zip(after, values, strict=True))
    return found


def _closed(row: SwitchedRow) -> Expr:
    """1 while the constraint of a row is closed."""
    graph = row.rest.graph
    return graph.apply("lt", 0.5, graph.symbol(row.state))


def _switched_matrix(inner: Matrix, on: Sequence[Expr]) -> Matrix:
    """Negative definite: that of the rows that are closed, -1 on the diagonal of the others."""
    size = range(len(on))
    return [[on[i] * inner[i][j] * on[j] + ((on[i] - 1.0) if i == j else 0.0) for j in size] for i in size]


def _solve(given: Matrix, right: Sequence[Sequence[Expr]]) -> list[list[Expr]]:
    """Solutions for a negative semidefinite matrix; a row that follows from those before it gets 0.

    There its pivot is rounding of its own diagonal, and so is all that is left of the row.
    """
    graph, n, A = given[0][0].graph, len(given), [list(row) for row in given]
    columns, pivots = [list(column) for column in right], list[Expr]()
    own = []
    for k in range(n):
        least = SINGULAR * graph.apply("abs", given[k][k])
        own.append(graph.apply("lt", least, graph.apply("abs", A[k][k])))
        pivots.append(where(own[k], A[k][k], 1.0))
        for i in range(k + 1, n):
            ratio = where(own[k], A[i][k] / pivots[k], 0.0)
            for j in range(k + 1, n):
                A[i][j] = A[i][j] - ratio * A[k][j]
            for column in columns:
                column[i] = column[i] - ratio * column[k]
    for x in columns:
        for k in reversed(range(n)):
            rest = total([x[k], *(-(A[k][j] * x[j]) for j in range(k + 1, n))])
            x[k] = where(own[k], rest / pivots[k], 0.0)
    return columns


def _with(base: Expr, factors: Sequence[Expr], values: Sequence[Expr]) -> Expr:
    return total([base, *(k * x for k, x in zip(factors, values, strict=True))])
