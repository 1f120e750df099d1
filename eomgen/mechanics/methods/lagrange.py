"""Kinematics -> TreeEquations by Lagrange's equations, differentiated on the graph.

d/dt (dT/dv) - dT/dq + dV/dq = Q (Shabana, Computational Dynamics, sec. 4.4 ff.).  T and V come from the velocity
recursion and are linear in the number of bodies; one reverse gradient and one forward derivative keep the equations
linear too.  Where q' = N v, for Euler parameters, the equations are those of
Boltzmann and Hamel with the structure constants of rotations, w being angular velocities in turned axes:
d/dt (dT/dv) + w x dT/dw - N^T (dT/dq - dV/dq) = Q_v (Meirovitch, Methods of Analytical Dynamics, 1970, sec. 4.13).
"""

from __future__ import annotations

from ...expr import vectors as vec
from ...expr.differentiate import gradient, jacobian, jvp, vjp
from .. import Kinematics
from .analytical import form_energies, generalized_forces
from .tree_equations import TreeEquations, take_given


def derive(kinematics: Kinematics) -> TreeEquations:
    """Lagrange's equations of the spanning tree; those of a bare Lagrangian are given."""
    if kinematics.mechanism.bare:
        return take_given(kinematics, "lagrange")
    graph = kinematics.graph
    q, v = list(kinematics.q), list(kinematics.v)
    kinetic, potential = form_energies(kinematics)
    L = kinetic - form_energies(kinematics, differentiated=True)[1]
    momentum = gradient(L, v)
    drift = jvp(momentum, kinematics.flow | kinematics.clock)
    total = kinematics.total_derivative(momentum)
    slope = gradient(L, q)
    if kinematics.quaternion_slots:
        slope = vjp(list(kinematics.rates), slope, v)
    for _, j in kinematics.quaternion_slots:
        w, p = (vec.vector(graph, x[j : j + 3]) for x in (v, momentum))
        slope[j : j + 3] = vec.sub(vec.vector(graph, slope[j : j + 3]), vec.cross(w, p))
    applied = generalized_forces(kinematics)
    entries = jacobian(momentum, v)
    n = len(v)
    return TreeEquations(
        method="lagrange",
        mass_matrix=tuple(tuple(entries.get((max(i, j), min(i, j)), graph.zero) for j in range(n)) for i in range(n)),
        bias=tuple(d - s - f for d, s, f in zip(drift, slope, applied, strict=True)),
        inverse_dynamics=tuple(d - s - f for d, s, f in zip(total, slope, applied, strict=True)),
        kinetic_energy=kinetic,
        potential_energy=potential,
    )
