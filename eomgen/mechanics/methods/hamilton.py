"""Kinematics -> TreeEquations by Hamilton's canonical equations.

q' = dH/dp, p' = -dH/dq + Q with H(q, p, t) = (p - b) . M^-1 (p - b) / 2 - T_0 + V, where T = v . M v / 2 + b . v + T_0
(Shabana, Computational Dynamics, sec. 4.11; Goldstein, Classical Mechanics, 3rd ed., sec. 8.1).  Momenta are dL/dv.
-dH/dq at constant p is taken as dL/dq at constant v, which Legendre's transformation says it is, and dp/dt = p' is
solved for v': M^-1 inside of H would square what rounding is blown up by, and M of a tree whose constraints are to be
embedded may have no inverse.  Where q' = N v, for Euler parameters, the momenta of angular velocities w obey
p' = -N^T dH/dq - w x p + Q (the canonical form of the equations of Boltzmann and Hamel; Poincare, 1901).
"""

from __future__ import annotations

from collections.abc import Sequence

from ...expr import vectors as vec
from ...expr.core import Expr
from ...expr.differentiate import gradient, jacobian, jvp, vjp
from ...model.equations import momenta_and_rates
from .. import Kinematics
from ..wrenches import cut_drives, drive_inertias
from .analytical import form_energies, generalized_forces
from .tree_equations import TreeEquations, take_given


def derive(kinematics: Kinematics) -> TreeEquations:
    """Canonical equations of the spanning tree, or of a bare Lagrangian."""
    graph, v, bare = kinematics.graph, list(kinematics.v), kinematics.mechanism.lagrangian
    n = len(v)
    if bare is not None:
        tree = take_given(kinematics, "hamilton")
        momenta, rates = momenta_and_rates(bare, kinematics.q, v)
        tree.canonical = (*momenta, *rates)
        return tree
    kinetic, potential = form_energies(kinematics)
    for j, inertia in drive_inertias(kinematics).items():
        kinetic = kinetic + 0.5 * inertia * (v[j] * v[j])
    for name, inertia in cut_drives(kinematics):
        loop = kinematics.loop_coordinates
        rate = loop.rates[loop.names.index(name)]
        kinetic = kinetic + 0.5 * inertia * (rate * rate)
    L = kinetic - form_energies(kinematics, differentiated=True)[1]
    momenta = gradient(L, v)
    entries = jacobian(momenta, v)
    mass = tuple(tuple(entries.get((max(i, j), min(i, j)), graph.zero) for j in range(n)) for i in range(n))
    forces = generalized_forces(kinematics)
    slopes = gradient(L, list(kinematics.q))
    rates = [s + f for s, f in zip(_turned(kinematics, slopes, momenta), forces, strict=True)]
    drift = jvp(momenta, kinematics.flow | kinematics.clock)
    total = kinematics.total_derivative(momenta)
    return TreeEquations(
        method="hamilton",
        mass_matrix=mass,
        bias=tuple(d - r for d, r in zip(drift, rates, strict=True)),
        inverse_dynamics=tuple(d - r for d, r in zip(total, rates, strict=True)),
        kinetic_energy=kinetic,
        potential_energy=potential,
        canonical=(*momenta, *rates),
    )


def _turned(kinematics: Kinematics, slopes: Sequence[Expr], momenta: Sequence[Expr]) -> list[Expr]:
    """Slopes by q -> generalized forces: N^T slopes, less w x p of turned axes."""
    if not kinematics.quaternion_slots:
        return list(slopes)
    graph = kinematics.graph
    result = vjp(list(kinematics.rates), list(slopes), list(kinematics.v))
    for _, j in kinematics.quaternion_slots:
        w, p = (vec.vector(graph, x[j : j + 3]) for x in (kinematics.v, momenta))
        result[j : j + 3] = vec.sub(vec.vector(graph, result[j : j + 3]), vec.cross(w, p))
    return result
