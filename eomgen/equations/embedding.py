"""Stage equations: Kinematics -> TreeEquations by Shabana's embedding technique, evaluated recursively.

M = B^T M_body B and h = B^T (M_body gamma - Q_v - Q_e), with body velocities B v (Computational Dynamics, sec. 5.7 and
ch. 7).  B is never formed: h is one outward and one inward sweep (Newton-Euler; Featherstone, RBDA, table 5.1) and M is
summed over composite bodies (table 6.2), all in link axes.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..frames import GROUND
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.differentiate import jvp
from ..graph.vectors import Mat3, Vec3
from ..kinematics import Kinematics, Link, Twist
from .equations import TreeEquations


@dataclass(frozen=True)
class SpatialInertia:
    """Mass, first moment m c and inertia about the link's origin, in link axes."""

    mass: Expr
    moment: Vec3
    inertia: Mat3

    def times(self, twist: Twist) -> Twist:
        """(moment about the origin, force) of a twist or spatial acceleration: Featherstone, RBDA, eq. 2.63."""
        angular, linear = twist
        turn = vec.add(vec.times(self.inertia, angular), vec.cross(self.moment, linear))
        push = vec.sub(vec.scale(self.mass, linear), vec.cross(self.moment, angular))
        return turn, push


def derive(kinematics: Kinematics) -> TreeEquations:
    """Equations of the spanning tree by the embedding technique."""
    graph = kinematics.graph
    inertias = [_spatial_inertia(link) for link in kinematics.links]
    kinetic = graph.zero
    for inertia, twist in zip(inertias, kinematics.twists, strict=True):
        turn, push = inertia.times(twist)
        kinetic = kinetic + (vec.dot(twist[0], turn) + vec.dot(twist[1], push))
    rest = tuple(graph.zero for _ in kinematics.v)
    return TreeEquations(
        method="embedding",
        mass_matrix=_composite_mass_matrix(kinematics, inertias),
        bias=_sweep(kinematics, inertias, rest),
        inverse_dynamics=_sweep(kinematics, inertias, kinematics.a),
        kinetic_energy=0.5 * kinetic,
        potential_energy=_potential(kinematics),
    )


def _symmetric(a: Mat3) -> Mat3:
    """The upper triangle, mirrored."""
    return (a[0], (a[0][1], a[1][1], a[1][2]), (a[0][2], a[1][2], a[2][2]))


def _steiner(mass: Expr, arm: Vec3) -> Mat3:
    """mass (|c|^2 1 - c c^T)."""
    x, y, z = arm
    mx, my, mz = vec.scale(mass, arm)
    return (
        (my * y + mz * z, -(mx * y), -(mx * z)),
        (-(mx * y), mx * x + mz * z, -(my * z)),
        (-(mx * z), -(my * z), mx * x + my * y),
    )


def _sum(a: Mat3, b: Mat3) -> Mat3:
    return (vec.add(a[0], b[0]), vec.add(a[1], b[1]), vec.add(a[2], b[2]))


def _spatial_inertia(link: Link) -> SpatialInertia:
    moment = vec.scale(link.mass, link.com)
    return SpatialInertia(link.mass, moment, _symmetric(_sum(link.inertia, _steiner(link.mass, link.com))))


def _cross_motion(twist: Twist, other: Twist) -> Twist:
    """twist x other for motions (Featherstone, RBDA, eq. 2.31)."""
    return vec.cross(twist[0], other[0]), vec.add(vec.cross(twist[0], other[1]), vec.cross(twist[1], other[0]))


def _cross_force(twist: Twist, wrench: Twist) -> Twist:
    """twist x* (moment, force) (Featherstone, RBDA, eq. 2.32)."""
    return vec.add(vec.cross(twist[0], wrench[0]), vec.cross(twist[1], wrench[1])), vec.cross(twist[0], wrench[1])


def _add(a: Twist, b: Twist) -> Twist:
    return vec.add(a[0], b[0]), vec.add(a[1], b[1])


def _project(column: Twist, wrench: Twist) -> Expr:
    return vec.dot(column[0], wrench[0]) + vec.dot(column[1], wrench[1])


def _lift(link: Link, wrench: Twist) -> Twist:
    """A wrench on the link (moment about its origin, force), about the parent's origin in parent axes."""
    push = link.up(wrench[1])
    return vec.add(link.up(wrench[0]), vec.cross(link.position, push)), push


def _sweep(kinematics: Kinematics, inertias: list[SpatialInertia], a: tuple[Expr, ...]) -> tuple[Expr, ...]:
    """Newton-Euler: spatial accelerations outwards, wrenches inwards, projected on the joints."""
    graph, links = kinematics.graph, kinematics.links
    along = kinematics.flow
    base: Twist = (vec.zero(graph), vec.neg(kinematics.mechanism.gravity))  # gravity as an acceleration of ground
    accelerations: list[Twist] = []
    wrenches: list[Twist] = []
    applied = _applied_wrenches(kinematics)
    for k, link in enumerate(links):
        acceleration = link.down_twist(accelerations[link.parent] if link.parent != GROUND else base)
        twist = kinematics.twists[k]
        for c, column in enumerate(link.columns):
            rate = kinematics.v[link.first + c]
            flow = jvp([*column[0], *column[1]], along)  # the column's own change, zero but for Euler angles
            change: Twist = _add(
                ((flow[0], flow[1], flow[2]), (flow[3], flow[4], flow[5])), _cross_motion(twist, column)
            )
            for factor, motion in ((a[link.first + c], column), (rate, change)):
                acceleration = _add(acceleration, (vec.scale(factor, motion[0]), vec.scale(factor, motion[1])))
        accelerations.append(acceleration)
        inertia = inertias[k]
        wrench = _add(inertia.times(acceleration), _cross_force(twist, inertia.times(twist)))
        wrenches.append((vec.sub(wrench[0], applied[k][0]), vec.sub(wrench[1], applied[k][1])))
    result = [-f for f in _coordinate_forces(kinematics)]
    for k in reversed(range(len(links))):
        link = links[k]
        for c, column in enumerate(link.columns):
            result[link.first + c] = result[link.first + c] + _project(column, wrenches[k])
        if link.parent != GROUND:
            wrenches[link.parent] = _add(wrenches[link.parent], _lift(link, wrenches[k]))
    return tuple(result)


def _applied_wrenches(kinematics: Kinematics) -> list[Twist]:
    """Force elements' wrench on each link, about its origin in link axes."""
    graph, poses = kinematics.graph, kinematics.poses
    total: list[Twist] = [(vec.zero(graph), vec.zero(graph)) for _ in kinematics.links]
    for terms in kinematics.forces:
        for load in terms.marker_loads:
            if load.marker.body == GROUND:
                continue
            k = poses.link_of[load.marker.body]
            rotation = poses.link(k).rotation
            push = vec.transpose_times(rotation, load.force)
            turn = vec.transpose_times(rotation, load.torque)
            arm = poses.marker_in_link(load.marker).position
            total[k] = _add(total[k], (vec.add(turn, vec.cross(arm, push)), push))
    return total


def _coordinate_forces(kinematics: Kinematics) -> list[Expr]:
    """Force elements along coordinates, those of cut joints through their y_q."""
    graph, loop = kinematics.graph, kinematics.loop_coordinates
    total = [graph.zero] * len(kinematics.v)
    for terms in kinematics.forces:
        for load in terms.coordinate_loads:
            if load.coordinate in kinematics.names:
                j = kinematics.freedoms.index(load.coordinate)
                total[j] = total[j] + load.value
            else:
                row = loop.jacobian[loop.names.index(load.coordinate)]
                total = [f + load.value * entry for f, entry in zip(total, row, strict=True)]
    return total


def _composite_mass_matrix(kinematics: Kinematics, inertias: list[SpatialInertia]) -> tuple[tuple[Expr, ...], ...]:
    """M_ij = s_i . I^c_max(i,j) s_j along each branch, composite inertias summed inwards."""
    graph, links, n = kinematics.graph, kinematics.links, len(kinematics.v)
    composite = list(inertias)
    rows = [[graph.zero] * n for _ in range(n)]
    for k in reversed(range(len(links))):
        link = links[k]
        if link.parent != GROUND:
            composite[link.parent] = _merge(composite[link.parent], _shift(link, composite[k]))
        for c, column in enumerate(link.columns):
            i = link.first + c
            wrench = composite[k].times(column)
            for d in range(c + 1):
                rows[i][link.first + d] = rows[link.first + d][i] = _project(link.columns[d], wrench)
            outer, at = link, link.parent
            while at != GROUND:
                wrench = _lift(outer, wrench)
                outer = links[at]
                for d, other in enumerate(outer.columns):
                    rows[i][outer.first + d] = rows[outer.first + d][i] = _project(other, wrench)
                at = outer.parent
    return tuple(tuple(row) for row in rows)


def _merge(a: SpatialInertia, b: SpatialInertia) -> SpatialInertia:
    return SpatialInertia(a.mass + b.mass, vec.add(a.moment, b.moment), _symmetric(_sum(a.inertia, b.inertia)))


def _rotate(rotation: Mat3, inertia: Mat3) -> Mat3:
    """R I R^T of a symmetric I."""
    half = vec.product(rotation, inertia)
    upper = [[vec.dot(half[i], rotation[j]) if j >= i else half[i][j] for j in range(3)] for i in range(3)]
    return _symmetric(tuple(tuple(row) for row in upper))  # type: ignore[arg-type]


def _shift(link: Link, inertia: SpatialInertia) -> SpatialInertia:
    """A spatial inertia in parent axes about the parent's origin (Featherstone, RBDA, eq. 2.66)."""
    moment = link.up(inertia.moment)
    turned = _rotate(link.turn, _rotate(link.joint_rotation, inertia.inertia))
    p = link.position
    # I' = R I R^T + m (p^2 1 - p p^T) + 2 (p . h) 1 - p h^T - h p^T, written with h + m p / 2
    half = vec.add(moment, vec.scale(0.5 * inertia.mass, p))
    cross = 2.0 * vec.dot(p, half)
    shifted = tuple(
        tuple(
            turned[i][j] - (p[i] * half[j] + half[i] * p[j]) + (cross if i == j else 0.0) if j >= i else turned[i][j]
            for j in range(3)
        )
        for i in range(3)
    )
    return SpatialInertia(inertia.mass, vec.add(moment, vec.scale(inertia.mass, p)), _symmetric(shifted))  # type: ignore[arg-type]


def _potential(kinematics: Kinematics) -> Expr:
    """Gravity on the centres of mass in ground axes, and the springs."""
    total = kinematics.graph.zero
    for k, link in enumerate(kinematics.links):
        pose = kinematics.poses.link(k)
        center = vec.add(pose.position, vec.times(pose.rotation, link.com))
        total = total - link.mass * vec.dot(kinematics.mechanism.gravity, center)
    for terms in kinematics.forces:
        if terms.potential is not None:
            total = total + terms.potential
    return total
