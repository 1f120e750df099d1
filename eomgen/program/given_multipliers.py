"""Stage program, multipliers of given equations: M a + h + C_q^T l = 0 -> l of (q, v, a), for outputs."""

from __future__ import annotations

from ..equations.tree_equations import TreeEquations
from ..graph.core import Expr
from ..kinematics import Kinematics
from .factor import factorize, solve


def multiplier_values(kinematics: Kinematics, equations: TreeEquations) -> dict[Expr, Expr]:
    """What the named multipliers stand for: l = -(C_q C_q^T)^-1 C_q (M a + h), of independent constraints."""
    given = kinematics.mechanism.given
    if given is None or not given.multipliers:
        return {}
    graph, rows = kinematics.graph, kinematics.constraints.jacobian
    gram = [[_dot(graph.zero, one, other) for other in rows] for one in rows]
    right = [-_dot(graph.zero, row, equations.inverse_dynamics) for row in rows]
    values = solve(factorize(gram, range(-1, len(rows) - 1)), right)
    names = {f"constraint_{k + 1}": name for k, name in enumerate(given.multipliers)}
    return {
        graph.symbol(names[label]): value for label, value in zip(kinematics.constraints.labels, values, strict=True)
    }


def _dot(total: Expr, one: tuple[Expr, ...], other: tuple[Expr, ...]) -> Expr:
    for x, y in zip(one, other, strict=True):
        total = total + x * y
    return total
