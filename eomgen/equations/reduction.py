"""Stage equations: tree equations, constraints -> the embedded system in the independent coordinates, as expressions.

M_e = B^T M B and f_e = -B^T (h + M a_p) with v = B v_i and a = B a_i + a_p (Shabana, sec. 5.7).  For reading: compiled
modules eliminate numerically with pivoting.  Here the pivots are fixed, chosen by their size at the reference.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

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
    graph, n = kinematics.graph, len(kinematics.v)
    free = [kinematics.velocity_labels.index(name) for name in mobility.independent]
    bound = [j for j in range(n) if j not in free]
    if not bound:
        return equations.mass_matrix, tuple(-h for h in equations.bias)
    solved = _eliminate(kinematics, mobility, bound, values)
    unit = {j: k for k, j in enumerate(free)}
    velocity = [  # B, row by row
        [graph.one if unit.get(j) == k else graph.zero for k in range(len(free))]
        if j in unit
        else [-solved[j][i] for i in free]
        for j in range(n)
    ]
    particular = [graph.zero if j in unit else -solved[j][n] for j in range(n)]
    mass = equations.mass_matrix
    weighted = [[_dot(mass[i], [row[k] for row in velocity]) for k in range(len(free))] for i in range(n)]
    rest = [equations.bias[i] + _dot(mass[i], particular) for i in range(n)]
    columns = [[row[k] for row in velocity] for k in range(len(free))]
    matrix = tuple(tuple(_dot(c, [row[k] for row in weighted]) for k in range(len(free))) for c in columns)
    return matrix, tuple(-_dot(c, rest) for c in columns)


def _dot(a: Sequence[Expr], b: Sequence[Expr]) -> Expr:
    total = a[0].graph.zero
    for x, y in zip(a, b, strict=True):
        total = total + x * y
    return total


def _eliminate(
    kinematics: Kinematics, mobility: Mobility, bound: Sequence[int], values: Mapping[str, float]
) -> dict[int, list[Expr]]:
    """Gauss-Jordan on the independent rows of [C_q | gamma] for the dependent columns, column -> its solved row."""
    c = kinematics.constraints
    at = dict(values) | dict(zip(kinematics.names, mobility.q_reference, strict=True))
    at |= dict.fromkeys(kinematics.velocity_names, 0.0)
    rows = [[*c.jacobian[i], c.gamma[i]] for i in mobility.independent_rows]
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
