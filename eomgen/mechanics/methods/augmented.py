"""Kinematics -> the augmented form, accelerations and multipliers in one system of index 1.

[M C_q^T; C_q 0] [a; l] = [-h; -gamma] (Shabana, Computational Dynamics, sec. 6.2 ff., augmented formulation).  Where
Baumgarte's stabilisation is on, gamma holds 2 alpha C' + beta^2 C too, and states are not projected
(J. Baumgarte, Stabilization of constraints and integrals of motion in dynamical systems, Comput. Methods Appl. Mech.
Eng. 1 (1972), 1-16).  Without constraints M a = -h is left, which is solved as the embedding technique does.
"""

from __future__ import annotations

from dataclasses import replace

from ...expr.core import Expr
from .. import Kinematics
from ..constraint_functions import Units
from ..loops import Constraints
from . import embedding
from .tree_equations import LinearSystem, TreeEquations, direct_equations, with_armature


def derive(kinematics: Kinematics) -> TreeEquations:
    """M and h of the tree, or those given, and the system with multipliers."""
    bare = kinematics.mechanism.bare
    tree = direct_equations(kinematics, "augmented") if bare else with_armature(embedding.derive)(kinematics)
    tree.method = "augmented"
    if kinematics.constraints.labels:
        tree.system = _system(kinematics, tree)
    return tree


def _system(kinematics: Kinematics, tree: TreeEquations) -> LinearSystem:
    graph, c, n = kinematics.graph, kinematics.constraints, len(kinematics.v)
    m = len(c.labels)
    entries: dict[tuple[int, int], Expr] = {(i, j): tree.mass_matrix[i][j] for i in range(n) for j in range(n)}
    for i, row in enumerate(c.jacobian):
        entries |= {(n + i, j): entry for j, entry in enumerate(row)}
        entries |= {(j, n + i): entry for j, entry in enumerate(row)}
    places = tuple(sorted(place for place, entry in entries.items() if not entry.is_zero))
    symbols = [graph.symbol(f"z[{k}]") for k in range(n + m)]
    units = Units(kinematics)
    rates, rows = [units.of(kind) for kind in kinematics.velocity_kinds], [units.of(kind) for kind in c.kinds]
    return LinearSystem(
        unknowns=tuple(f"z[{k}]" for k in range(n + m)),
        places=places,
        entries=tuple(entries[place] for place in places),
        right=(*(-h for h in tree.bias), *(-g for g in c.gamma)),
        relaxed=tuple((n + i, n + i) for i in range(m)),
        sizes=(*units.force, *rows, *rates, *(units.energy / size for size in rows)),
        accelerations=tuple(symbols[:n]),
    )


def stabilise(kinematics: Kinematics, alpha: float, beta: float) -> Kinematics:
    """Put Baumgarte's terms into gamma: C'' + 2 alpha C' + beta^2 C = 0; of nonholonomic rows r' + 2 alpha r = 0."""
    c: Constraints = kinematics.constraints
    gamma = [g + 2.0 * alpha * rate for g, rate in zip(c.gamma, c.velocity, strict=True)]
    for i, value in enumerate(c.values):
        gamma[i] = gamma[i] + beta * beta * value
    return replace(kinematics, constraints=replace(c, gamma=tuple(gamma), stabilised=(alpha, beta)))
