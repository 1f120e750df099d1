"""Stage equations: Kinematics -> TreeEquations by Lagrange's equations, differentiated on the graph.

d/dt (dT/dv) - dT/dq + dV/dq = Q (Shabana, Computational Dynamics, sec. 4.4 ff.).  T and V come from the velocity
recursion and are linear in the number of bodies; one reverse gradient and one forward derivative keep the equations
linear too.  A bare Lagrangian goes the same way.  Where q' = N v, for Euler parameters, the equations are those of
Boltzmann and Hamel with the structure constants of rotations, w being angular velocities in turned axes:
d/dt (dT/dv) + w x dT/dw - N^T (dT/dq - dV/dq) = Q_v (Meirovitch, Methods of Analytical Dynamics, 1970, sec. 4.13).
"""

from __future__ import annotations

from collections.abc import Sequence

from ..frames import GROUND
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.differentiate import gradient, jacobian, jvp, vjp
from ..graph.substitute import substitute
from ..kinematics import Kinematics
from .equations import TreeEquations


def derive(kinematics: Kinematics) -> TreeEquations:
    """Lagrange's equations of the spanning tree, or of a bare Lagrangian."""
    graph = kinematics.graph
    q, v = list(kinematics.q), list(kinematics.v)
    kinetic, potential = form_energies(kinematics)
    momentum = gradient(kinetic, v)
    drift = jvp(momentum, kinematics.flow | {kinematics.t: graph.one})
    total = kinematics.total_derivative(momentum)
    slope = gradient(kinetic - potential, q)
    if kinematics.balls:
        slope = vjp(list(kinematics.rates), slope, v)
    for _, j in kinematics.balls:
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


def form_energies(kinematics: Kinematics) -> tuple[Expr, Expr]:
    """T and V; of a bare Lagrangian V = -L(v = 0) and T = L + V."""
    bare = kinematics.mechanism.lagrangian
    graph = kinematics.graph
    if bare is not None:
        at_rest = substitute([bare.expression], dict.fromkeys(kinematics.v, graph.zero))[0]
        return bare.expression - at_rest, -at_rest
    kinetic, potential = graph.zero, graph.zero
    # g . r of each link's origin and g in link axes, outwards from ground, so that no ground pose is needed
    heights: list[tuple[Expr, vec.Vec3]] = []
    for link, (angular, linear) in zip(kinematics.links, kinematics.twists, strict=True):
        height, pull = (graph.zero, kinematics.mechanism.gravity) if link.parent == GROUND else heights[link.parent]
        height = height + vec.dot(pull, link.position)
        pull = link.down(pull)
        heights.append((height, pull))
        center = vec.add(linear, vec.cross(angular, link.com))
        spin = vec.dot(angular, vec.times(link.inertia, angular))
        kinetic = kinetic + (link.mass * vec.dot(center, center) + spin)
        potential = potential - link.mass * (height + vec.dot(pull, link.com))
    for force in kinematics.forces:
        if force.potential is not None:
            potential = potential + force.potential
    return 0.5 * kinetic, potential


def generalized_forces(kinematics: Kinematics) -> list[Expr]:
    """Q of everything without a potential, by virtual power: Q = sum F . d(velocity)/dv."""
    graph, n = kinematics.graph, len(kinematics.v)
    velocities: list[Expr] = []
    weights: list[Expr] = []
    direct = [graph.zero] * n
    loop = kinematics.loop_coordinates
    for terms in kinematics.forces:
        for load in terms.marker_remainder:
            velocities += kinematics.motion.velocity(load.marker)
            weights += load.force
            velocities += kinematics.motion.angular_velocity(load.marker)
            weights += load.torque
        for along in terms.coordinate_remainder:
            if along.coordinate in kinematics.names:
                j = kinematics.freedoms.index(along.coordinate)
                direct[j] = direct[j] + along.value
            else:
                velocities.append(loop.rates[loop.names.index(along.coordinate)])
                weights.append(along.value)
    powers = _weighted(velocities, weights, list(kinematics.v))
    return [a + b + c for a, b, c in zip(direct, powers, _bare_forces(kinematics), strict=True)]


def _weighted(velocities: Sequence[Expr], weights: Sequence[Expr], v: Sequence[Expr]) -> list[Expr]:
    """d(velocities)/dv^T weights, leaving out what is zero."""
    pairs = [(x, w) for x, w in zip(velocities, weights, strict=True) if not (x.is_zero or w.is_zero)]
    if not pairs:
        return [x.graph.zero for x in v]
    return vjp([x for x, _ in pairs], [w for _, w in pairs], v)


def _bare_forces(kinematics: Kinematics) -> list[Expr]:
    """Given generalized forces less the gradient of Rayleigh's dissipation function."""
    bare, graph = kinematics.mechanism.lagrangian, kinematics.graph
    if bare is None:
        return [graph.zero] * len(kinematics.v)
    drag = gradient(bare.dissipation, list(kinematics.v))
    return [f - d for f, d in zip(bare.forces, drag, strict=True)]
