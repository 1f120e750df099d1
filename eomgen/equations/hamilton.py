"""Stage equations: Kinematics -> TreeEquations by Hamilton's canonical equations.

q' = dH/dp, p' = -dH/dq + Q with H(q, p, t) = (p - b) . M^-1 (p - b) / 2 - T_0 + V, where T = v . M v / 2 + b . v + T_0
(Shabana, Computational Dynamics, sec. 4.11; Goldstein, Classical Mechanics, 3rd ed., sec. 8.1).  H is formed on the
graph, with M^-1 by L^T D L from the tips inwards; accelerations are the total derivative of dH/dp.  Where q' = N v,
for Euler parameters, the momenta of angular velocities w obey p' = -N^T dH/dq - w x p + Q (the canonical form of the
equations of Boltzmann and Hamel; Poincare, 1901).

Where constraints are to be embedded, M of the tree alone may be singular and so H not exist: there -dH/dq at constant p
is taken as dL/dq at constant v, which Legendre's transformation says it is, and p' is formed as a derivative of p.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.differentiate import gradient, jacobian, jvp, vjp
from ..graph.substitute import substitute
from ..graph.symmetric import solve_with_pivots
from ..kinematics import Kinematics
from ..kinematics.loads import drive_inertias
from .energies import form_energies, generalized_forces
from .equations import Rows, TreeEquations

WRITTEN = 24  #: velocities up to which H is written out


def derive(kinematics: Kinematics) -> TreeEquations:
    """Canonical equations of the spanning tree, or of a bare Lagrangian."""
    graph, v = kinematics.graph, list(kinematics.v)
    n = len(v)
    kinetic, potential = form_energies(kinematics)
    for j, inertia in drive_inertias(kinematics).items():
        kinetic = kinetic + 0.5 * inertia * (v[j] * v[j])
    for name, inertia in cut_drives(kinematics):
        loop = kinematics.loop_coordinates
        rate = loop.rates[loop.names.index(name)]
        kinetic = kinetic + 0.5 * inertia * (rate * rate)
    momenta = gradient(kinetic, v)
    entries = jacobian(momenta, v)
    mass = tuple(tuple(entries.get((max(i, j), min(i, j)), graph.zero) for j in range(n)) for i in range(n))
    forces = generalized_forces(kinematics)
    accelerations: tuple[Expr, ...] | None = None
    pivots: tuple[Expr, ...] = ()
    if kinematics.constraints.labels or n > WRITTEN:
        slopes = gradient(kinetic - potential, list(kinematics.q))
        rates = [s + f for s, f in zip(_turned(kinematics, slopes, momenta), forces, strict=True)]
    else:
        accelerations, pivots, rates = _canonical(kinematics, (kinetic, potential), momenta, mass, forces)
    drift = jvp(momenta, kinematics.flow | kinematics.clock)
    total = kinematics.total_derivative(momenta)
    return TreeEquations(
        method="hamilton",
        mass_matrix=mass,
        bias=tuple(d - r for d, r in zip(drift, rates, strict=True)),
        inverse_dynamics=tuple(d - r for d, r in zip(total, rates, strict=True)),
        kinetic_energy=kinetic,
        potential_energy=potential,
        accelerations=accelerations,
        pivots=pivots,
        canonical=(*momenta, *rates),
    )


def cut_drives(kinematics: Kinematics) -> list[tuple[str, Expr]]:
    """Inertias of drives on coordinates of cut joints."""
    joints = kinematics.mechanism.joints
    return [
        (s.coordinates[0], s.armature)
        for s in joints
        if s.armature is not None and s.coordinates[0] not in kinematics.freedoms
    ]


def _turned(kinematics: Kinematics, slopes: Sequence[Expr], momenta: Sequence[Expr]) -> list[Expr]:
    """Slopes by q -> generalized forces: N^T slopes, less w x p of turned axes."""
    if not kinematics.balls:
        return list(slopes)
    graph = kinematics.graph
    result = vjp(list(kinematics.rates), list(slopes), list(kinematics.v))
    for _, j in kinematics.balls:
        w, p = (vec.vector(graph, x[j : j + 3]) for x in (kinematics.v, momenta))
        result[j : j + 3] = vec.sub(vec.vector(graph, result[j : j + 3]), vec.cross(w, p))
    return result


def _canonical(
    kinematics: Kinematics,
    energies: tuple[Expr, Expr],
    momenta: list[Expr],
    mass: Rows,
    forces: Sequence[Expr],
) -> tuple[tuple[Expr, ...], tuple[Expr, ...], list[Expr]]:
    """v', the pivots of M and p', from H(q, p), then written in v by p = dT/dv."""
    graph = kinematics.graph
    kinetic, potential = energies
    still = dict.fromkeys(kinematics.v, graph.zero)
    p = [graph.symbol(f"momentum[{k}]") for k in range(len(momenta))]
    excess = [a - b for a, b in zip(p, substitute(momenta, still), strict=True)]
    velocities, pivots = solve_with_pivots(mass, excess)
    hamiltonian = potential - substitute([kinetic], still)[0]
    for a, b in zip(excess, velocities, strict=True):
        hamiltonian = hamiltonian + 0.5 * (a * b)
    slopes = [-s for s in gradient(hamiltonian, list(kinematics.q))]
    rates = [s + f for s, f in zip(_turned(kinematics, slopes, p), forces, strict=True)]
    along = kinematics.flow | dict(zip(p, rates, strict=True)) | kinematics.clock
    accelerations = jvp(velocities, along)  # of dH/dp, which the velocities are
    here = dict(zip(p, momenta, strict=True))
    found = substitute([*accelerations, *rates], here)
    return tuple(found[: len(p)]), tuple(pivots), found[len(p) :]
