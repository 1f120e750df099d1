"""Stage equations: tree equations, constraints -> the embedded system in the independent coordinates, as expressions.

M_e = B^T M B and f_e = -B^T (h + M a_p) with v = B v_i and a = B a_i + a_p (Shabana, sec. 5.7).  For reading: compiled
modules eliminate numerically with pivoting.  Here the pivots are fixed, chosen by their size at the reference.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from ..graph.core import Expr
from ..graph.evaluate import evaluate
from ..kinematics import Kinematics
from ..kinematics.mobility import Mobility
from .tree_equations import TreeEquations

Rows = tuple[tuple[Expr, ...], ...]


def reduce_to_independent(
    kinematics: Kinematics, mobility: Mobility, equations: TreeEquations, values: Mapping[str, float]
) -> tuple[Rows, tuple[Expr, ...]]:
    """The mass matrix (n_dof, n_dof) and force (n_dof,) of the independent accelerations.

    Parameters
    ----------
    values : mapping
        Numbers of the parameters, inputs and t, by which pivots are judged.
    """
    if mobility.n_dof == len(kinematics.v):
        return equations.mass_matrix, tuple(-h for h in equations.bias)
    found = transform_velocities(kinematics, mobility, values)
    return found.mass_matrix(equations.mass_matrix), found.force(equations.mass_matrix, [-h for h in equations.bias])


class VelocityTransformation(NamedTuple):
    """v = B v_i + b and a = B a_i + c: the velocities of the tree by the independent ones, and their rates.

    ``matrix`` is B (n_v, n_dof), row by row; ``offset`` is b (n_v,), what drivers and other prescribed motions add;
    ``acceleration_offset`` is c (n_v,).
    """

    matrix: Rows
    offset: tuple[Expr, ...]
    acceleration_offset: tuple[Expr, ...]

    def project(self, forces: Sequence[Expr]) -> tuple[Expr, ...]:
        """B^T Q: generalized forces of the tree along the independent velocities."""
        return tuple(_dot(column, forces) for column in zip(*self.matrix, strict=True))

    def mass_matrix(self, mass: Rows) -> Rows:
        """B^T M B."""
        columns = list(zip(*self.matrix, strict=True))
        weighted = [[_dot(row, column) for row in mass] for column in columns]
        return tuple(tuple(_dot(column, other) for other in weighted) for column in columns)

    def force(self, mass: Rows, right: Sequence[Expr]) -> tuple[Expr, ...]:
        """B^T (Q - M c)."""
        rest = [-f + _dot(row, self.acceleration_offset) for f, row in zip(right, mass, strict=True)]
        return tuple(-x for x in self.project(rest))


def transform_velocities(
    kinematics: Kinematics, mobility: Mobility, values: Mapping[str, float]
) -> VelocityTransformation:
    """B, b and c of the independent velocities of the mobility, with pivots judged by numbers as above."""
    graph, n = kinematics.graph, len(kinematics.v)
    free = [kinematics.velocity_labels.index(name) for name in mobility.independent]
    bound = [j for j in range(n) if j not in free]
    c = kinematics.constraints
    rows = [[*c.jacobian[i], c.gamma[i], c.time_derivative[i]] for i in mobility.independent_rows]
    solved = eliminate(kinematics, mobility, rows, bound, values) if bound else {}
    unit = {j: k for k, j in enumerate(free)}
    matrix = [
        tuple(graph.one if unit[j] == k else graph.zero for k in range(len(free)))
        if j in unit
        else tuple(-solved[j][i] for i in free)
        for j in range(n)
    ]
    rest = [(graph.zero, graph.zero) if j in unit else (-solved[j][n], -solved[j][n + 1]) for j in range(n)]
    return VelocityTransformation(tuple(matrix), tuple(b for _, b in rest), tuple(c for c, _ in rest))


def _dot(a: Sequence[Expr], b: Sequence[Expr]) -> Expr:
    total = a[0].graph.zero
    for x, y in zip(a, b, strict=True):
        total = total + x * y
    return total


def eliminate(
    kinematics: Kinematics,
    mobility: Mobility,
    given: Sequence[Sequence[Expr]],
    bound: Sequence[int],
    values: Mapping[str, float],
) -> dict[int, list[Expr]]:
    """Gauss-Jordan on given rows, as many as there are columns ``bound`` to solve for: column -> its solved row."""
    at = dict(values) | dict(zip(kinematics.names, mobility.q_reference, strict=True))
    at |= dict.fromkeys(kinematics.velocity_names, 0.0)
    rows = [list(row) for row in given]
    numbers = [[float(x) for x in evaluate(row, at)] for row in rows]
    left = list(range(len(rows)))
    pivots: dict[int, int] = {}  # column -> row
    while len(pivots) < len(bound):
        columns = [j for j in bound if j not in pivots]
        # a sparse pivot row swells least; among those of fair size take it
        largest = max(abs(numbers[i][j]) for i in left for j in columns)
        fair = [(i, j) for i in left for j in columns if abs(numbers[i][j]) >= 0.05 * largest]
        i, j = min(fair, key=lambda p: (sum(not x.is_zero for x in rows[p[0]]), p))
        left.remove(i)
        pivots[j] = i
        pivot, size = rows[i][j], numbers[i][j]
        rows[i] = [x / pivot for x in rows[i]]
        numbers[i] = [x / size for x in numbers[i]]
        for k in range(len(rows)):
            factor, amount = rows[k][j], numbers[k][j]
            if k != i and not factor.is_zero:
                rows[k] = [x - factor * y for x, y in zip(rows[k], rows[i], strict=True)]
                numbers[k] = [x - amount * y for x, y in zip(numbers[k], numbers[i], strict=True)]
    return {j: rows[i] for j, i in pivots.items()}
