"""Kinematics -> TreeEquations by Lagrange's equations, differentiated on the graph.

d/dt (dT/dv) - dT/dq + dV/dq = Q (Shabana, Computational Dynamics, sec. 4.4 ff.).  T and V come from the velocity
recursion and are linear in the number of bodies; one reverse gradient and one forward derivative keep the equations
linear too.  Where q' = N v, for Euler parameters, the equations are those of
Boltzmann and Hamel with the structure constants of rotations, w being angular velocities in turned axes:
d/dt (dT/dv) + w x dT/dw - N^T (dT/dq - dV/dq) = Q_v (Meirovitch, Methods of Analytical Dynamics, 1970, sec. 4.13).
"""

from __future__ import annotations

from ...elements.forces.force import CoordinateLoad, MarkerLoad
from ...elements.frames import GROUND
from ...expr import vectors as vec
from ...expr.core import Expr
from ...expr.differentiate import gradient, hessian, jvp, vjp
from ...expr.schedule import count
from ...expr.vectors import Vec3
from .. import Kinematics
from ..wrenches import gravity_on_links, virtual_power
from .tree_equations import TreeEquations, direct_equations


def derive(kinematics: Kinematics) -> TreeEquations:
    """Lagrange's equations of the spanning tree; those of a bare Lagrangian are given."""
    if kinematics.mechanism.bare:
        return direct_equations(kinematics, "lagrange")
    tree = momentum_equations(kinematics, "lagrange", *form_energies(kinematics))
    tree.canonical = ()
    return tree


def form_energies(kinematics: Kinematics, differentiated: bool = False) -> tuple[Expr, Expr]:
    """T and V.

    ``differentiated``: without the potentials of elements whose forces enter by virtual power instead.
    """
    graph = kinematics.graph
    kinetic, potential = graph.zero, graph.zero
    links = zip(kinematics.links, kinematics.twists, gravity_on_links(kinematics), strict=True)
    for k, (link, (angular, linear), (height, pull)) in enumerate(links):
        center = vec.add(linear, vec.cross(angular, link.com))
        if link.parent == GROUND:
            center = min(center, _velocity(kinematics, k), key=lambda v: count([vec.dot(v, v)]).total)
        spin = vec.dot(angular, vec.times(link.inertia, angular))
        kinetic = kinetic + (link.mass * vec.dot(center, center) + spin)
        potential = potential - link.mass * (height + vec.dot(pull, link.com))
    for force in kinematics.forces:
        if force.potential is not None and not (differentiated and force.force.by_power):
            potential = potential + force.potential
    return 0.5 * kinetic, potential


def _velocity(kinematics: Kinematics, k: int) -> Vec3:
    """Velocity of a link's centre of mass in ground axes, in which that of a free body is the rate of its place."""
    pose, link = kinematics.poses.link(k), kinematics.links[k]
    x, y, z = kinematics.total_derivative(pose.position)
    turned = vec.times(pose.rotation, vec.cross(kinematics.twists[k][0], link.com))
    return vec.add((x, y, z), turned)


def generalized_forces(kinematics: Kinematics) -> list[Expr]:
    """Q of everything whose potential is not differentiated, by virtual power: Q = sum F . d(velocity)/dv."""
    loads: list[MarkerLoad | CoordinateLoad] = []
    for terms in kinematics.forces:
        loads += terms.marker_loads if terms.force.by_power else terms.marker_remainder
        loads += terms.coordinate_remainder
    return virtual_power(kinematics, loads)


def momentum_equations(kinematics: Kinematics, method: str, kinetic: Expr, potential: Expr) -> TreeEquations:
    """dp/dt = p' with p = dL/dv and p' = dL/dq + Q, which are its canonical part, as M v' + h = 0.

    Where q' = N v, for Euler parameters: p' = N^T dL/dq - w x p + Q of angular velocities w in turned axes.
    """
    q, v = kinematics.q, kinematics.v
    L = kinetic - form_energies(kinematics, differentiated=True)[1]
    momenta, slopes = gradient(L, v), gradient(L, q)
    if kinematics.quaternion_slots:
        slopes = vjp(kinematics.rates, slopes, v)
    for _, j in kinematics.quaternion_slots:
        w, p, slope = (vec.three(x, j) for x in (v, momenta, slopes))
        slopes[j : j + 3] = vec.sub(slope, vec.cross(w, p))
    rates = [s + f for s, f in zip(slopes, generalized_forces(kinematics), strict=True)]
    drift, total = (
        jvp(momenta, kinematics.q_dot_direction | kinematics.time_direction),
        kinematics.total_derivative(momenta),
    )
    return TreeEquations(
        method=method,
        mass=hessian(momenta, v),
        bias=tuple(d - r for d, r in zip(drift, rates, strict=True)),
        inverse_dynamics=tuple(d - r for d, r in zip(total, rates, strict=True)),
        kinetic_energy=kinetic,
        potential_energy=potential,
        canonical=(*momenta, *rates),
    )
