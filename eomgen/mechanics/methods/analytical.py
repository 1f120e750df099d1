"""Kinematics -> T, V and the forces without a potential, what analytical mechanics starts from."""

from __future__ import annotations

from ...elements.forces import CoordinateLoad, MarkerLoad
from ...elements.frames import GROUND
from ...expr import vectors as vec
from ...expr.core import Expr
from ...expr.schedule import count
from ...expr.vectors import Vec3
from .. import Kinematics
from ..wrenches import virtual_power


def form_energies(kinematics: Kinematics, differentiated: bool = False) -> tuple[Expr, Expr]:
    """T and V.

    ``differentiated``: without the potentials of elements whose forces enter by virtual power instead.
    """
    graph = kinematics.graph
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
    return virtual_power(kinematics, loads)
