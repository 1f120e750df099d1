"""Kinematics -> TreeEquations by Shabana's embedding technique, evaluated recursively.

M = B^T M_body B and h = B^T (M_body gamma - Q_v - Q_e), with body velocities B v (Computational Dynamics, sec. 5.7 and
ch. 7).  B is never formed: h is one outward and one inward sweep (Newton-Euler; Featherstone, RBDA, table 5.1) and M is
summed over composite bodies (table 6.2), all in link axes.  The sweep carries U = [alpha] + [omega] [omega], by which a
point of a link at r accelerates at A + U r, and takes force and moment from U (W. Khalil, J.-F. Kleinfinger, Minimum
operations and minimum parameters of the dynamic models of tree structure robots, IEEE J. Robotics and Automation 3
(1987), 517-526).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from functools import partial
from typing import NamedTuple

from ...elements.frames import GROUND
from ...expr import vectors as vec
from ...expr.core import Expr, symbols_of
from ...expr.differentiate import jacobian, jvp
from ...expr.schedule import count
from ...expr.spatial import Twist, Wrench, add, dot
from ...expr.tensors import add_matrices, rotate
from ...expr.vectors import Mat3, Rows, Vec3
from .. import Kinematics
from ..kinematics import joint_rates, slide_accelerations
from ..link_frames import (
    Resolved,
    SlidingTriple,
    Turned,
    falling,
    regroup,
    resolve_parallel,
    turn_forces,
    turn_links,
)
from ..tree import Link, SpatialInertia
from ..wrenches import applied_wrenches, coordinate_forces, cut_drives, drive_inertias, kinetic_energy, potential_energy
from .recursions import along_joints, composite_mass_matrix
from .tree_equations import TreeEquations


def derive(kinematics: Kinematics) -> TreeEquations:
    """Equations of the spanning tree by the embedding technique."""
    graph, a = kinematics.graph, kinematics.a
    rates, applied = joint_rates(kinematics), applied_wrenches(kinematics)
    rest = tuple(graph.zero for _ in kinematics.v)
    links = Resolved.in_link_axes(kinematics.links, kinematics.twists, rates, applied)
    spatial = [link.spatial for link in kinematics.links]
    inertias = regroup(graph, kinematics.links)
    inverse = _sweep(kinematics, links, inertias, a)
    plain = _sweep(kinematics, links, spatial, a)
    if count(plain).total < count(inverse).total:  # grouping symbols is work too
        inertias, inverse = spatial, plain
    chosen, mass, bias = links, composite_mass_matrix(links.links, inertias), _sweep(kinematics, links, inertias, rest)
    common = resolve_parallel(graph, kinematics.links, kinematics.v, rates, applied)
    if any(axes is not None for axes in common.axes):
        turned_inertias = common.inertias(inertias)
        other = composite_mass_matrix(common.links, turned_inertias), _sweep(kinematics, common, turned_inertias, rest)
        if _cost(*other) < _cost(mass, bias):
            chosen, inertias, (mass, bias) = common, turned_inertias, other
            inverse = _sweep(kinematics, chosen, inertias, a)
    axes, blocks = turn_links(kinematics.links, kinematics.mechanism.gravity)
    resolved = chosen.with_columns(axes)
    turned = partial(_turned_system, kinematics, resolved, inertias, rest, blocks)
    return TreeEquations(
        method="embedding",
        mass=mass,
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
    result = count([*(x for i, row in enumerate(mass) for x in row[: i + 1]), *bias])
    return result.total + 12 * (result.functions.get("sin", 0) + result.functions.get("cos", 0))


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
        principal = inertia[i][i] * alpha[i] + (inertia[k][k] - inertia[j][j]) * (omega[j] * omega[k])
        # alpha_j - omega_i omega_k = -U_ki, alpha_k + omega_i omega_j = U_ji
        mixed = inertia[i][k] * turning[j][i] - inertia[i][j] * turning[k][i]
        result.append(principal + mixed + inertia[j][k] * (squares[j] - squares[k]))
    return result[0], result[1], result[2]


def _outwards(
    kinematics: Kinematics,
    resolved: Resolved,
    inertias: Sequence[SpatialInertia],
    a: Sequence[Expr],
    afloat: Collection[int] = (),
) -> tuple[list[tuple[Vec3, Mat3, Vec3]], list[Wrench]]:
    """Angular acceleration, U, acceleration of the origin less gravity of each link; its wrench less what is applied.

    Gravity is left out of links that are ``afloat``.
    """
    graph, links, twists, applied = kinematics.graph, resolved.links, resolved.twists, resolved.applied
    still, two = vec.zero(graph), graph.constant(2.0)
    lifted = vec.neg(kinematics.mechanism.gravity)  # gravity as an acceleration of ground
    motions: list[tuple[Vec3, Mat3, Vec3]] = []
    wrenches: list[Wrench] = []
    slides = slide_accelerations(kinematics, resolved.rates, a)
    for k, link in enumerate(links):
        rate, omega, inertia = resolved.rates[k], twists[k][0], inertias[k]
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
        push = vec.add(vec.scale(inertia.mass, linear), vec.times(turning, inertia.moment))
        turn = vec.add(_moment(inertia.inertia, omega, alpha, turning), vec.cross(inertia.moment, linear))
        wrenches.append((vec.sub(turn, applied[k][0]), vec.sub(push, applied[k][1])))
    return motions, wrenches


def _sweep(
    kinematics: Kinematics,
    resolved: Resolved,
    inertias: Sequence[SpatialInertia],
    a: Sequence[Expr],
    blocks: Sequence[SlidingTriple] = (),
) -> tuple[Expr, ...]:
    """Newton-Euler: accelerations outwards, wrenches inwards, projected on the joints, some of them turned."""
    _, wrenches = _outwards(kinematics, resolved, inertias, a, falling(blocks))
    return tuple(along_joints(resolved.links, wrenches, turn_forces(blocks, coordinate_forces(kinematics))))


# -- tree slopes -------------------------------------------------------------------------------------------------------

# J. Carpentier, N. Mansard, Analytical derivatives of rigid body dynamics algorithms, RSS 2018; S. Singh, R. Russell,
# P. Wensing, Efficient analytical derivatives of rigid-body dynamics using spatial vector algebra, IEEE RA-L 7 (2022),
# 1776-1783. Here in link axes, about link origins, with velocities relative to those origins. Of the bodies from a link
# outwards, with r from the link's origin and v relative to its velocity, the sums needed beside mass, first moment h
# and inertia J are V = sum m v r^T and P = sum m v (twice each), and the wrench of m (a - g).
#
# With the field s x r + l of a column of the motion subspace, which is dr/dq_i, the derivatives of accelerations are
# d(a)/d(q_i') = 2 d/dt (s x r + l) and d(a)/d(q_i) = d2/dt2 (s x r + l). That takes columns that move rigidly with
# their own and all earlier coordinates of their joint, :func:`can_differentiate`. The columns of a slot in Euler
# parameters are fixed in the link instead, and its angular velocity is held fixed there: by angle the rates are those
# of an s fixed in the parent, by velocity there is one such rate and one of an s fixed in the link.
#
# Velocity terms are homogeneous of second degree, so that h follows from its derivative by v and from gravity.


Entries = dict[tuple[int, int], Expr]


class MotionField(NamedTuple):
    """A column of the motion subspace, link axes: the field s x r + l, and its rates as seen from ground."""

    s: Vec3
    l: Vec3
    s_rate: Vec3
    twice_s_rate: Vec3
    twice_l_rate: Vec3


class Lifted(NamedTuple):
    """What column i exerts, about the origin of a link further in: the wrench of its field, and sum m v x field."""

    wrench: Wrench
    whirl: Vec3  #: twice


class Composite(NamedTuple):
    """Bodies from a link outwards."""

    inertia: SpatialInertia
    V: Mat3  #: twice
    P: Vec3  #: twice

    def plus(self, other: Composite) -> Composite:
        """Both, about one point."""
        V = add_matrices(self.V, other.V)
        return Composite(self.inertia.plus(other.inertia), V, vec.add(self.P, other.P))

    def swung(self, x: Vec3) -> Vec3:
        """Twice the sum of m r x (x x v)."""
        return vec.sub(vec.scale(self._trace, x), vec.times(self.V, x))

    def whirled(self, s: Vec3, l: Vec3) -> Vec3:
        """Twice the sum of m v x (s x r + l)."""
        moment = vec.sub(vec.scale(self._trace, s), vec.transpose_times(self.V, s))
        return vec.add(moment, vec.cross(self.P, l))

    @property
    def _trace(self) -> Expr:
        return self.V[0][0] + self.V[1][1] + self.V[2][2]


def can_differentiate(kinematics: Kinematics) -> bool:
    """Whether the formulas of this file hold for a mechanism's tree."""
    mechanism = kinematics.mechanism
    if mechanism.bare or cut_drives(kinematics):
        return False
    places = kinematics.coordinate_of
    for link in kinematics.links:
        for c, (angular, linear) in enumerate(link.columns):
            index = link.first + c
            ahead = () if places[index] < 0 else kinematics.names[places[index] + 1 : _last(kinematics, link)]
            if not symbols_of([*angular, *linear]) <= set(ahead):
                return False
    return True


def _last(kinematics: Kinematics, link: Link) -> int:
    """One more than the last coordinate of the link's joint."""
    end = link.first + len(link.columns)
    return end + sum(slot.velocity < end for slot in kinematics.quaternion_slots)


class ForceSlopes:
    """Derivatives of M a + h on a tree that one :func:`can_differentiate`: M, h, and d(M a + h)/dv by its places."""

    def __init__(self, kinematics: Kinematics) -> None:
        self._kinematics = kinematics
        self._inertias = regroup(kinematics.graph, kinematics.links)
        self._rates = joint_rates(kinematics)
        still = (vec.zero(kinematics.graph), vec.zero(kinematics.graph))
        unloaded = [still] * len(kinematics.links)
        self._resolved = Resolved.in_link_axes(kinematics.links, kinematics.twists, self._rates, unloaded)
        two = kinematics.graph.constant(2.0)
        self._omegas = [twist[0] for twist in kinematics.twists]
        self._twice = [vec.scale(two, omega) for omega in self._omegas]
        self._places = kinematics.coordinate_of
        self._fields = [
            [self._field(k, *column, link.first + c) for c, column in enumerate(link.columns)]
            for k, link in enumerate(kinematics.links)
        ]
        self._lifted: dict[tuple[int, int], Lifted] = {}  # by index of the velocity and link
        n_q, n, zero = len(kinematics.q), len(kinematics.v), kinematics.graph.zero
        forces = applied_forces(kinematics)
        by_state = jacobian(forces, [*kinematics.q, *kinematics.v])
        self._forces_by_position = {key: value for key, value in by_state.items() if key[1] < n_q}
        self._composites, rigid, mass, gravity = self._sum_inwards()
        self.bias = []
        for i in range(n):
            total = zero
            for j in range(n):
                if (i, j) in rigid:
                    total = total + rigid[i, j] * kinematics.v[j]
            self.bias.append(0.5 * total + gravity[i] - forces[i])
        self.by_velocity = rigid
        _subtract(self.by_velocity, {(i, j - n_q): value for (i, j), value in by_state.items() if j >= n_q})
        for index, inertia in drive_inertias(kinematics).items():
            mass[index, index] = mass[index, index] + inertia
        self.mass_matrix = tuple(tuple(mass.get((max(i, j), min(i, j)), zero) for j in range(n)) for i in range(n))

    def _above(self, k: int) -> Vec3:
        """Angular velocity of the parent, link axes."""
        link = self._kinematics.links[k]
        return vec.zero(self._kinematics.graph) if link.parent == GROUND else link.down(self._omegas[link.parent])

    def _field(self, k: int, s: Vec3, l: Vec3, index: int) -> MotionField:
        kinematics = self._kinematics
        if self._places[index] < 0:
            above, still = self._above(k), vec.zero(kinematics.graph)
            return MotionField(s, l, vec.cross(above, s), vec.cross(vec.add(above, self._omegas[k]), s), still)
        x = jvp([*s, *l], kinematics.q_dot_direction)
        linear, moved = (x[0], x[1], x[2]), (x[3], x[4], x[5])
        two = kinematics.graph.constant(2.0)
        return MotionField(
            s,
            l,
            vec.add(vec.cross(self._omegas[k], s), linear),
            vec.add(vec.cross(self._twice[k], s), vec.scale(two, linear)),
            vec.add(vec.cross(self._twice[k], l), vec.scale(two, moved)),
        )

    def _inwards(self, k: int, c: int) -> Iterator[tuple[int, int]]:
        """Links from k to ground, with the number of their columns up to and with column c of link k."""
        columns = c + 1
        while k != GROUND:
            yield k, columns
            k = self._kinematics.links[k].parent
            columns = len(self._kinematics.links[k].columns)

    def _step(self, k: int) -> Vec3:
        """Twice the velocity of the link's origin relative to the parent's, parent axes."""
        link = self._kinematics.links[k]
        slide = vec.scale(self._kinematics.graph.constant(2.0), self._rates[k].slide)
        return slide if link.parent == GROUND else vec.add(vec.cross(self._twice[link.parent], link.position), slide)

    def _single(self, k: int) -> Composite:
        """The body of one link: V = [omega] E with the second moments E."""
        J, half = self._inertias[k].inertia, self._kinematics.graph.constant(0.5)
        diagonal = [half * (J[1][1] + J[2][2] - J[0][0]), half * (J[2][2] + J[0][0] - J[1][1])]
        diagonal.append(half * (J[0][0] + J[1][1] - J[2][2]))
        columns = [[diagonal[i] if i == j else -J[i][j] for i in range(3)] for j in range(3)]
        x, y, z = (vec.cross(self._twice[k], (a, b, c)) for a, b, c in columns)
        return Composite(
            self._inertias[k], vec.transpose((x, y, z)), vec.cross(self._twice[k], self._inertias[k].moment)
        )

    def _outer_body(self, k: int, body: Composite) -> Composite:
        """Bodies from link k outwards, about the parent's origin in parent axes."""
        link, step = self._kinematics.links[k], self._step(k)
        turned = body.inertia.turned(link.joint_rotation).turned(link.turn)
        moved = turned.shifted(link.position)
        P = link.up(body.P)
        arms = add_matrices(_outer(P, link.position), _outer(step, moved.moment))
        V = add_matrices(rotate(link.turn, rotate(link.joint_rotation, body.V)), arms)
        return Composite(moved, V, vec.add(P, vec.scale(turned.mass, step)))

    def _sum_inwards(self) -> tuple[list[Composite], Entries, Entries, list[Expr]]:
        """Composite bodies, derivatives by v, M (lower triangle), and the forces of gravity."""
        kinematics, links = self._kinematics, self._kinematics.links
        bodies = [self._single(k) for k in range(len(links))]
        falling: list[Vec3] = []
        for link in links:
            above = falling[link.parent] if link.parent != GROUND else vec.neg(kinematics.mechanism.gravity)
            falling.append(link.down(above))
        slopes: Entries = {}
        mass: Entries = {}
        gravity = [kinematics.graph.zero] * len(kinematics.v)
        for k in reversed(range(len(links))):
            body = bodies[k]
            for c, field in enumerate(self._fields[k]):
                i = links[k].first + c
                force = body.inertia.times(field.s, field.l)
                gravity[i] = vec.dot(force[1], falling[k])
                turn, push = body.inertia.times(field.twice_s_rate, field.twice_l_rate)
                rate = vec.add(turn, body.swung(field.s)), vec.add(push, vec.cross(field.s, body.P))
                whirl = body.whirled(field.s, field.l)
                for at, columns in self._inwards(k, c):
                    self._lifted[i, at] = Lifted(force, whirl)
                    for d, other in enumerate(self._fields[at][:columns]):
                        j = links[at].first + d
                        mass[i, j] = dot((other.s, other.l), force)
                        slopes[j, i] = dot((other.s, other.l), rate)
                        if j != i:
                            along = vec.dot(other.twice_s_rate, force[0]) + vec.dot(other.s, whirl)
                            slopes[i, j] = along + vec.dot(other.twice_l_rate, force[1])
                    if links[at].parent != GROUND:
                        whirl = vec.add(links[at].up(whirl), vec.cross(self._step(at), links[at].up(force[1])))
                        force, rate = links[at].lift(force), links[at].lift(rate)
            if (p := links[k].parent) != GROUND:
                bodies[p] = bodies[p].plus(self._outer_body(k, body))
        return bodies, slopes, mass, gravity

    def _swept(self, a: Sequence[Expr], motions: list[tuple[Vec3, Mat3, Vec3]]) -> list[list[Twist]]:
        """Per column the second derivative of its field as seen from ground, less s x (acceleration of the origin)."""
        kinematics, two = self._kinematics, self._kinematics.graph.constant(2.0)
        along = kinematics.q_dot_direction | dict(zip(kinematics.v, a, strict=True))
        result: list[list[Twist]] = []
        for k, link in enumerate(kinematics.links):
            _, turning, linear = motions[k]
            result.append([])
            for c, (s, l) in enumerate(link.columns):
                if self._places[link.first + c] < 0:
                    alpha = motions[link.parent][0] if link.parent != GROUND else vec.zero(kinematics.graph)
                    fixed = _turning(self._above(k), link.down(alpha))
                    result[k].append((vec.times(fixed, s), vec.neg(vec.cross(s, linear))))
                    continue
                first = jvp([*s, *l], kinematics.q_dot_direction)
                second = jvp(first, along)
                rates = [vec.cross(self._omegas[k], vec.three(first, at)) for at in (0, 3)]
                second_rates = [vec.add(vec.three(second, 3 * m), vec.scale(two, rates[m])) for m in (0, 1)]
                hat = vec.sub(vec.times(turning, l), vec.cross(s, linear))
                result[k].append((vec.add(vec.times(turning, s), second_rates[0]), vec.add(hat, second_rates[1])))
        return result

    def by_position(self, a: Sequence[Expr]) -> Entries:
        """(row, column) -> d(M a + h)/dq at fixed accelerations a (n,)."""
        links = self._kinematics.links
        motions, wrenches = _outwards(self._kinematics, self._resolved, self._inertias, a)
        swept = self._swept(a, motions)
        slopes: Entries = {}
        for k in reversed(range(len(links))):
            body, (turn, push) = self._composites[k], wrenches[k]
            for c, field in enumerate(self._fields[k]):
                i = links[k].first + c
                moment, force = body.inertia.times(*swept[k][c])
                moment = vec.add(vec.add(moment, body.swung(field.s_rate)), vec.cross(field.s, turn))
                force = vec.add(force, vec.add(vec.cross(field.s_rate, body.P), vec.cross(field.s, push)))
                wrench = vec.add(moment, vec.cross(field.l, push)), force
                for at, columns in self._inwards(k, c):
                    lifted = self._lifted[i, at]
                    for d, other in enumerate(self._fields[at][:columns]):
                        j = links[at].first + d
                        if j == i or at != k or self._places[j] >= 0:
                            slopes[j, i] = dot((other.s, other.l), wrench)
                        else:  # columns of one slot turn with each other
                            slopes[j, i] = self._inner(swept[k][c], field, self._lifted[j, k])
                        if j != i:
                            slopes[i, j] = self._inner(swept[at][d], other, lifted)
                    if links[at].parent != GROUND:
                        wrench = links[at].lift(wrench)
            if (p := links[k].parent) != GROUND:
                wrenches[p] = add(wrenches[p], links[k].lift(wrenches[k]))
        slopes = self._by_coordinates(slopes)
        _subtract(slopes, self._forces_by_position)
        return slopes

    @staticmethod
    def _inner(swept: Twist, field: MotionField, exerted: Lifted) -> Expr:
        """How the force along a column changes as all that carries it moves along another one."""
        along = vec.dot(swept[0], exerted.wrench[0]) + vec.dot(field.s_rate, exerted.whirl)
        return along + vec.dot(swept[1], exerted.wrench[1])

    def _by_coordinates(self, slopes: Entries) -> Entries:
        """Derivatives by angles of spherical joints as those by Euler parameters: d(angles)/de = 4 N^T / e^2."""
        kinematics = self._kinematics
        result = {(i, self._places[j]): value for (i, j), value in slopes.items() if self._places[j] >= 0}
        for slot in kinematics.quaternion_slots:
            e = kinematics.q[slot.coordinate : slot.coordinate + 4]
            rates = list(kinematics.rates[slot.coordinate : slot.coordinate + 4])
            N = jacobian(rates, kinematics.v[slot.velocity : slot.velocity + 3])
            factor = 4.0 / (e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3])
            for i in sorted({i for i, j in slopes if slot.velocity <= j < slot.velocity + 3}):
                angles = [slopes.get((i, slot.velocity + c)) for c in range(3)]
                for m in range(4):
                    total = kinematics.graph.zero
                    for c, slope in enumerate(angles):
                        if slope is not None:
                            total = total + slope * (N[m, c] * factor)
                    result[i, slot.coordinate + m] = total
        return result


def applied_forces(kinematics: Kinematics) -> list[Expr]:
    """Generalized forces (n,) of all force elements, gravity apart."""
    return along_joints(kinematics.links, applied_wrenches(kinematics), [-f for f in coordinate_forces(kinematics)])


def _subtract(entries: Entries, others: Entries) -> None:
    for key, value in others.items():
        entries[key] = entries[key] - value if key in entries else -value


def _outer(a: Vec3, b: Vec3) -> Mat3:
    return vec.scale(a[0], b), vec.scale(a[1], b), vec.scale(a[2], b)
