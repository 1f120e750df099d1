"""Stage equations: the inertia of drives, added to the equations of any method.

A rotor geared to a coordinate y adds J y'^2 / 2 to the kinetic energy, hence J y_q^T y'' to the equations (its
gyroscopic effect is left out, as in MuJoCo and Pinocchio); for a coordinate of the tree that is J on the diagonal of M.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from ..graph.core import Expr
from ..graph.substitute import substitute
from ..kinematics import Kinematics
from .tree_equations import Method, Rows, TreeEquations


def with_armature(method: Method) -> Method:
    """The method, with the inertia of drives added to what it derives."""

    def derive(kinematics: Kinematics) -> TreeEquations:
        return add_armature(kinematics, method(kinematics))

    return derive


def add_armature(kinematics: Kinematics, tree: TreeEquations) -> TreeEquations:
    """Add J y_q^T y_q to M, and its part to bias, inverse dynamics and kinetic energy.

    Accelerations that a method has without M, and a turned system, must hold the inertia of drives already.
    """
    drives = [(s.coordinates[0], s.armature) for s in kinematics.mechanism.joints if s.armature is not None]
    if not drives:
        return tree
    graph, loop = kinematics.graph, kinematics.loop_coordinates
    n = len(kinematics.v)
    bias, inverse, kinetic = list(tree.bias), list(tree.inverse_dynamics), tree.kinetic_energy
    still = dict.fromkeys(kinematics.a, graph.zero)
    slopes: list[tuple[Expr, list[Expr]]] = []
    for name, inertia in drives:
        if name in kinematics.velocity_labels:
            k = kinematics.velocity_labels.index(name)
            slope: list[Expr] = [graph.one if j == k else graph.zero for j in range(n)]
            rate, acceleration, rest = kinematics.v[k], kinematics.a[k], graph.zero
        else:
            k = loop.names.index(name)
            slope, rate, acceleration = list(loop.jacobian[k]), loop.rates[k], loop.accelerations[k]
            rest = substitute([acceleration], still)[0]
        slopes.append((inertia, slope))
        for i in range(n):
            if not slope[i].is_zero:
                bias[i] = bias[i] + inertia * (slope[i] * rest)
                inverse[i] = inverse[i] + inertia * (slope[i] * acceleration)
        kinetic = kinetic + 0.5 * inertia * (rate * rate)

    return TreeEquations(
        method=tree.method,
        mass_matrix=partial(_mass_matrix, tree, slopes),
        bias=tuple(bias),
        inverse_dynamics=tuple(inverse),
        kinetic_energy=kinetic,
        potential_energy=tree.potential_energy,
        accelerations=tree.accelerations,
        pivots=tree.pivots,
        system=tree.system,
        canonical=tree.canonical,
        turned=tree.turned,
        constrained=tree.constrained,
    )


def _mass_matrix(tree: TreeEquations, slopes: Sequence[tuple[Expr, Sequence[Expr]]]) -> Rows:
    """M of the tree and J y_q^T y_q of each drive."""
    mass = [list(row) for row in tree.mass_matrix]
    for inertia, slope in slopes:
        moving = [i for i, part in enumerate(slope) if not part.is_zero]
        for i in moving:
            for j in moving:
                mass[i][j] = mass[i][j] + inertia * (slope[i] * slope[j])
    return tuple(tuple(row) for row in mass)
