"""Stage equations: Kinematics -> TreeEquations by Shabana's embedding technique, evaluated recursively.

M = B^T M_body B and h = B^T (M_body gamma - Q_v - Q_e), with body velocities B v (Computational Dynamics, sec. 5.7 and
ch. 7).  B is never formed: h is one outward and one inward sweep (Newton-Euler; Featherstone, RBDA, table 5.1) and M is
summed over composite bodies (table 6.2), all in link axes.  The sweep carries U = [alpha] + [omega] [omega], by which a
point of a link at r accelerates at A + U r, and takes force and moment from U (W. Khalil, J.-F. Kleinfinger, Minimum
operations and minimum parameters of the dynamic models of tree structure robots, IEEE J. Robotics and Automation 3
(1987), 517-526).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from ..frames import GROUND
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.count import count
from ..graph.spatial import Wrench, add, dot
from ..graph.vectors import Mat3, Vec3
from ..kinematics import Kinematics
from ..kinematics.energies import kinetic_energy, potential_energy
from ..kinematics.joint_rates import joint_rates, slide_accelerations
from ..kinematics.link_axes import Rows, SlidingTriple, Turned, falling, turn_forces, turn_links
from ..kinematics.link_inertia import SpatialInertia
from ..kinematics.loads import applied_wrenches, coordinate_forces, drive_inertias
from ..kinematics.parallel import Resolved, resolve_parallel
from ..kinematics.regroup import regroup
from .composite_bodies import composite_mass_matrix
from .tree_equations import TreeEquations


def derive(kinematics: Kinematics) -> TreeEquations:
    """Equations of the spanning tree by the embedding technique."""
    graph, a = kinematics.graph, kinematics.a
    rates, applied = joint_rates(kinematics), applied_wrenches(kinematics)
    rest = tuple(graph.zero for _ in kinematics.v)
    own = Resolved.in_own_axes(kinematics.links, kinematics.twists, rates, applied)
    given = [link.spatial for link in kinematics.links]
    inertias = regroup(graph, kinematics.links)
    inverse = _sweep(kinematics, own, inertias, a)
    plain = _sweep(kinematics, own, given, a)
    if count(plain).total < count(inverse).total:  # grouping symbols is work too
        inertias, inverse = given, plain
    chosen, mass, bias = own, composite_mass_matrix(own.links, inertias), _sweep(kinematics, own, inertias, rest)
    common = resolve_parallel(graph, kinematics.links, kinematics.v, rates, applied)
    if any(axes is not None for axes in common.axes):
        turned_inertias = common.inertias(inertias)
        other = composite_mass_matrix(common.links, turned_inertias), _sweep(kinematics, common, turned_inertias, rest)
        if _cost(*other) < _cost(mass, bias):
            chosen, inertias, (mass, bias) = common, turned_inertias, other
            inverse = _sweep(kinematics, chosen, inertias, a)
    own_axes, blocks = turn_links(kinematics)
    resolved = chosen.with_columns(own_axes.links)
    turned = partial(_turned_system, kinematics, resolved, inertias, rest, blocks)
    return TreeEquations(
        method="embedding",
        mass_matrix=mass,
        bias=bias,
        inverse_dynamics=inverse,
        kinetic_energy=kinetic_energy(kinematics),
        potential_energy=potential_energy(kinematics),
        turned=Turned(turned, blocks) if blocks else None,
    )


def _turned_system(
    kinematics: Kinematics,
    resolved: Resolved,
    inertias: list[SpatialInertia],
    rest: tuple[Expr, ...],
    blocks: Sequence[SlidingTriple],
) -> tuple[Rows, tuple[Expr, ...]]:
    """M and h in turned velocities."""
    matrix = [list(row) for row in composite_mass_matrix(resolved.links, inertias)]
    for k, drive in drive_inertias(kinematics).items():
        matrix[k][k] = matrix[k][k] + drive
    return tuple(map(tuple, matrix)), _sweep(kinematics, resolved, inertias, rest, blocks)


def _cost(mass: Rows, bias: Sequence[Expr]) -> int:
    """Operations of the lower triangle and the bias, sines and cosines as many as they last."""
    found = count([*(x for i, row in enumerate(mass) for x in row[: i + 1]), *bias])
    return found.total + 12 * (found.functions.get("sin", 0) + found.functions.get("cos", 0))


def _turning(omega: Vec3, alpha: Vec3) -> Mat3:
    """U = [alpha] + [omega] [omega]."""
    x, y, z = omega
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    return (
        (-(yy + zz), xy - alpha[2], xz + alpha[1]),
        (xy + alpha[2], -(xx + zz), yz - alpha[0]),
        (xz - alpha[1], yz + alpha[0], -(xx + yy)),
    )


def _moment(inertia: Mat3, omega: Vec3, alpha: Vec3, turning: Mat3) -> Vec3:
    """J alpha + omega x J omega, with the products of omega in U."""
    squares = [w * w for w in omega]
    result = []
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        own = inertia[i][i] * alpha[i] + (inertia[k][k] - inertia[j][j]) * (omega[j] * omega[k])
        # alpha_j - omega_i omega_k = -U_ki, alpha_k + omega_i omega_j = U_ji
        mixed = inertia[i][k] * turning[j][i] - inertia[i][j] * turning[k][i]
        result.append(own + mixed + inertia[j][k] * (squares[j] - squares[k]))
    return result[0], result[1], result[2]


def _sweep(
    kinematics: Kinematics,
    resolved: Resolved,
    inertias: list[SpatialInertia],
    a: tuple[Expr, ...],
    blocks: Sequence[SlidingTriple] = (),
) -> tuple[Expr, ...]:
    """Newton-Euler: accelerations outwards, wrenches inwards, projected on the joints, some of them turned."""
    graph, links, twists = kinematics.graph, resolved.links, resolved.twists
    still = vec.zero(graph)
    lifted = vec.neg(kinematics.mechanism.gravity)  # gravity as an acceleration of ground
    two = graph.constant(2.0)
    motions: list[tuple[Vec3, Mat3, Vec3]] = []  # alpha, U, A of each link
    wrenches: list[Wrench] = []
    applied = resolved.applied
    slides = slide_accelerations(kinematics, resolved.rates, a)
    afloat = falling(blocks)
    for k, link in enumerate(links):
        rate, omega = resolved.rates[k], twists[k][0]
        above, base = still, (still, (still, still, still), still if k in afloat else lifted)
        if link.parent != GROUND:
            above, base = twists[link.parent][0], motions[link.parent]
        relative = vec.add(rate.slide_rate, slides[k])
        coriolis = vec.scale(two, vec.cross(above, rate.slide))
        linear = link.down(vec.add(vec.add(base[2], vec.times(base[1], link.position)), vec.add(relative, coriolis)))
        alpha = vec.add(link.down(base[0]), vec.add(rate.spin_rate, vec.cross(link.down(above), rate.spin)))
        for c, (angular, _) in enumerate(link.columns):
            alpha = vec.add(alpha, vec.scale(a[link.first + c], angular))
        turning = _turning(omega, alpha)
        motions.append((alpha, turning, linear))
        inertia = inertias[k]
        push = vec.add(vec.scale(inertia.mass, linear), vec.times(turning, inertia.moment))
        turn = vec.add(_moment(inertia.inertia, omega, alpha, turning), vec.cross(inertia.moment, linear))
        wrenches.append((vec.sub(turn, applied[k][0]), vec.sub(push, applied[k][1])))
    result = [-f for f in turn_forces(blocks, coordinate_forces(kinematics))]
    for k in reversed(range(len(links))):
        link = links[k]
        for c, column in enumerate(link.columns):
            result[link.first + c] = result[link.first + c] + dot(column, wrenches[k])
        if link.parent != GROUND:
            wrenches[link.parent] = add(wrenches[link.parent], link.lift(wrenches[k]))
    return tuple(result)
