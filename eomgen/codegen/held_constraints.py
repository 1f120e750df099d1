"""Constraints that close and open: rows w = w0 + W f -> their multipliers.

While a constraint is closed its w is 0, else its multiplier is; both are linear in the multipliers and in the forces of
laws.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ..base.limits.constraints import HELD_STEP
from ..base.limits.numbers import SINGULAR
from ..forces.branches import where
from ..graph.core import Expr
from ..graph.evaluate import compile_evaluator
from ..graph.substitute import symbols_of
from ..kinematics import Kinematics
from ..kinematics.eliminate import Matrix, total
from ..kinematics.switched import SwitchedRow


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
    on = [closed(row) for row in rows]
    A = switched_matrix(inner, on)
    right = [[-(s * w) for s, w in zip(on, found.still[n:], strict=True)]]
    right += [[-(s * row[j]) for s, row in zip(on, found.gain[n:], strict=True)] for j in range(count)]
    first, *columns = solve_switched(A, right)
    still = [_with(N, row[count:], first) for N, row in zip(found.still[:n], found.gain, strict=False)]
    gain = [[_with(row[j], row[count:], columns[j]) for j in range(count)] for row in found.gain[:n]]
    return LinearValues(still, gain)


def longest_step(kinematics: Kinematics) -> dict[str, float]:
    """``max_step`` (s) of runs of a model whose constraints close and open; empty without any."""
    values = {p.name: p.value for p in kinematics.mechanism.parameters}
    rates = kinematics.resolve([s.stabilisation for s in kinematics.mechanism.switched])
    if not rates or any(values.get(name) is None for name in symbols_of(rates)):
        return {}
    return {"max_step": HELD_STEP / max(compile_evaluator(rates, tuple(values))(list(values.values())))}


def closed(row: SwitchedRow) -> Expr:
    """1 while the constraint of a row is closed."""
    graph = row.rest.graph
    return graph.apply("lt", 0.5, graph.symbol(row.state))


def switched_matrix(inner: Matrix, on: Sequence[Expr]) -> Matrix:
    """Negative definite: that of the rows that are closed, -1 on the diagonal of the others."""
    size = range(len(on))
    return [[on[i] * inner[i][j] * on[j] + ((on[i] - 1.0) if i == j else 0.0) for j in size] for i in size]


def solve_switched(given: Matrix, right: Sequence[Sequence[Expr]]) -> list[list[Expr]]:
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
