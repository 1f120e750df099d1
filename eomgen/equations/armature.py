"""Stage equations: the inertia of drives, added to the equations of any method.

A rotor geared to a coordinate y adds J y'^2 / 2 to the kinetic energy, hence J y_q^T y'' to the equations (its
gyroscopic effect is left out, as in MuJoCo and Pinocchio); for a coordinate of the tree that is J on the diagonal of M.
"""

from __future__ import annotations

from dataclasses import replace

from ..graph.core import Expr
from ..graph.substitute import substitute
from ..kinematics import Kinematics
from .equations import Method, TreeEquations


def with_armature(method: Method) -> Method:
    """The method, with the inertia of drives added to what it derives."""

    def derive(kinematics: Kinematics) -> TreeEquations:
        return add_armature(kinematics, method(kinematics))

    return derive


def add_armature(kinematics: Kinematics, tree: TreeEquations) -> TreeEquations:
    """Add J y_q^T y_q to M, and its part to bias, inverse dynamics and kinetic energy."""
    drives = [(s.coordinates[0], s.armature) for s in kinematics.mechanism.joints if s.armature is not None]
    if not drives:
        return tree
    graph, loop = kinematics.graph, kinematics.loop_coordinates
    n = len(kinematics.v)
    mass = [list(row) for row in tree.mass_matrix]
    bias, inverse, kinetic = list(tree.bias), list(tree.inverse_dynamics), tree.kinetic_energy
    still = dict.fromkeys(kinematics.a, graph.zero)
    for name, inertia in drives:
        if name in kinematics.names:
            k = kinematics.names.index(name)
            slope: list[Expr] = [graph.one if j == k else graph.zero for j in range(n)]
            rate, acceleration, rest = kinematics.v[k], kinematics.a[k], graph.zero
        else:
            k = loop.names.index(name)
            slope, rate, acceleration = list(loop.jacobian[k]), loop.rates[k], loop.accelerations[k]
            rest = substitute([acceleration], still)[0]
        for i in range(n):
            if slope[i].is_zero:
                continue
            for j in range(n):
                mass[i][j] = mass[i][j] + inertia * (slope[i] * slope[j])
            bias[i] = bias[i] + inertia * (slope[i] * rest)
            inverse[i] = inverse[i] + inertia * (slope[i] * acceleration)
        kinetic = kinetic + 0.5 * inertia * (rate * rate)
    return replace(
        tree,
        mass_matrix=tuple(tuple(row) for row in mass),
        bias=tuple(bias),
        inverse_dynamics=tuple(inverse),
        kinetic_energy=kinetic,
    )
