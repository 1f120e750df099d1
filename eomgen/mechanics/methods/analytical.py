"""Kinematics -> T, V and the forces without a potential, what analytical mechanics starts from."""

from __future__ import annotations

from ...elements.forces import CoordinateLoad, MarkerLoad
from ...elements.frames import GROUND
from ...expr import vectors as vec
from ...expr.core import Expr, substitute
from ...expr.differentiate import gradient, jvp
from ...expr.identity import vanishes
from ...expr.schedule import count
from ...expr.vectors import Vec3
from .. import Kinematics
from ..wrenches import virtual_power


def form_energies(kinematics: Kinematics, differentiated: bool = False) -> tuple[Expr, Expr]:
    """T and V; of a bare Lagrangian its terms of second degree in the velocities, and V = -L(v = 0).

    T + V is then the energy v . dL/dv - L, in which terms linear in the velocities cancel.

    ``differentiated``: without the potentials of elements whose forces enter by virtual power instead.
    """
    bare = kinematics.mechanism.lagrangian
    graph = kinematics.graph
    if bare is not None:
        v = list(kinematics.v)
        momenta = gradient(bare.expression, v)
        at_rest, *first_degree = substitute([bare.expression, *momenta], dict.fromkeys(v, graph.zero))
        quadratic = bare.expression - at_rest
        if not all(vanishes(first_degree)):
            quadratic = graph.zero
            for rate, inertial in zip(v, jvp(momenta, dict(zip(v, v, strict=True))), strict=True):  # M v
                quadratic = quadratic + 0.5 * (rate * inertial)
        return quadratic, -at_rest
    kinetic, potential = graph.zero, graph.zero
    # g . r of each link's origin and g in link axes, outwards from ground, so that no ground pose is needed
    heights: list[tuple[Expr, Vec3]] = []
    for k, (link, (angular, linear)) in enumerate(zip(kinematics.links, kinematics.twists, strict=True)):
        height, pull = (graph.zero, kinematics.mechanism.gravity) if link.parent == GROUND else heights[link.parent]
        height = height + vec.dot(pull, link.position)
        pull = link.down(pull)
        heights.append((height, pull))
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
    return [a + b for a, b in zip(virtual_power(kinematics, loads), _bare_forces(kinematics), strict=True)]


def _bare_forces(kinematics: Kinematics) -> list[Expr]:
    """Given generalized forces less the gradient of Rayleigh's dissipation function."""
    bare, graph = kinematics.mechanism.lagrangian, kinematics.graph
    if bare is None:
        return [graph.zero] * len(kinematics.v)
    drag = gradient(bare.dissipation, list(kinematics.v))
    return [f - d for f, d in zip(bare.forces, drag, strict=True)]
