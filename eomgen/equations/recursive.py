"""Stage equations: Kinematics -> TreeEquations by the articulated-body method, linear in the number of bodies.

Featherstone, Rigid Body Dynamics Algorithms (2008), ch. 7, in link axes, with two changes.  Linear accelerations are
those of the links' origins, gravity subtracted, so that linear velocities never appear.  A joint of several degrees of
freedom is released one column of its motion subspace at a time, which eliminates its block as L^T D L would.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from ..frames import GROUND
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.count import count
from ..graph.differentiate import jacobian
from ..graph.spatial import Twist, Wrench, add, dot, scaled
from ..graph.tensors import add_matrices, rotate, rotate_symmetric, skew, symmetric
from ..graph.vectors import Mat3
from ..kinematics import Kinematics, Link
from ..kinematics.energies import kinetic_energy, potential_energy
from ..kinematics.joint_rates import JointRates, joint_rates
from ..kinematics.link_axes import SlidingTriple, falling, turn_back, turn_forces, turn_links
from ..kinematics.link_inertia import SpatialInertia
from ..kinematics.loads import applied_wrenches, coordinate_forces, drive_inertias, drives_cut_joint
from ..kinematics.regroup import regroup
from ..records import dataclass
from .tree_equations import TreeEquations

Rows = tuple[tuple[Expr, ...], ...]


@dataclass(frozen=True)
class Articulated:
    """[moment; force] = [[inertia, coupling], [coupling^T, mass]] [angular; linear acceleration] + a wrench."""

    inertia: Mat3
    coupling: Mat3
    mass: Mat3

    def times(self, motion: Twist) -> Wrench:
        """The wrench of an acceleration."""
        angular, linear = motion
        turn = vec.add(vec.times(self.inertia, angular), vec.times(self.coupling, linear))
        return turn, vec.add(vec.transpose_times(self.coupling, angular), vec.times(self.mass, linear))

    def plus(self, other: Articulated) -> Articulated:
        """Both on one link."""
        return Articulated(
            symmetric(add_matrices(self.inertia, other.inertia)),
            add_matrices(self.coupling, other.coupling),
            symmetric(add_matrices(self.mass, other.mass)),
        )

    def released(self, column: Twist, wrench: Wrench, reciprocal: Expr, driven: bool) -> Articulated:
        """What is felt when the column moves freely: I - U U^T / D (Featherstone, RBDA, eq. 7.43).

        ``driven`` tells that D holds the inertia of a drive, which resists along the column.
        """
        turn, push = wrench
        turn_d, push_d = vec.scale(reciprocal, turn), vec.scale(reciprocal, push)
        inertia = [[self.inertia[i][j] - turn[i] * turn_d[j] for j in range(3)] for i in range(3)]
        coupling = [[self.coupling[i][j] - turn[i] * push_d[j] for j in range(3)] for i in range(3)]
        mass = [[self.mass[i][j] - push[i] * push_d[j] for j in range(3)] for i in range(3)]
        zero = reciprocal.graph.zero
        entries = [*column[0], *column[1]]
        if sum(not x.is_zero for x in entries) == 1 and not driven:  # no force along a free unit column: exactly so
            k = next(i for i, x in enumerate(entries) if not x.is_zero)
            for m in range(3):
                if k < 3:
                    inertia[k][m] = inertia[m][k] = coupling[k][m] = zero
                else:
                    mass[k - 3][m] = mass[m][k - 3] = coupling[m][k - 3] = zero
        return Articulated(symmetric(_matrix(inertia)), _matrix(coupling), symmetric(_matrix(mass)))

    def lifted(self, link: Link) -> Articulated:
        """In parent link axes about the parent's origin (Featherstone, RBDA, sec. 7.2)."""
        inertia, coupling, mass = self.inertia, self.coupling, self.mass
        for turn in (link.joint_rotation, link.turn):
            inertia, coupling = rotate_symmetric(turn, inertia), rotate(turn, coupling)
            mass = rotate_symmetric(turn, mass)
        arm = skew(link.position)
        moved = add_matrices(coupling, vec.product(arm, mass))
        ahead = vec.product(coupling, arm)
        behind = vec.product(arm, vec.transpose(moved))
        rows = [[inertia[i][j] - (ahead[i][j] - behind[i][j]) for j in range(3)] for i in range(3)]
        return Articulated(symmetric(_matrix(rows)), moved, mass)


@dataclass(frozen=True)
class Release:
    """One released column: U = I s, D = s . U, and the force left to accelerate it."""

    index: int
    column: Twist
    wrench: Wrench
    pivot: Expr
    reciprocal: Expr
    force: Expr


def derive(kinematics: Kinematics) -> TreeEquations:
    """Equations of the spanning tree; of a tree without loops also its accelerations in closed form."""
    products = _velocity_products(kinematics, joint_rates(kinematics))
    a = kinematics.a
    inertias = [link.spatial for link in kinematics.links]
    loads = _loads(kinematics, inertias)
    inverse = _newton_euler(kinematics, inertias, products, loads, a)
    grouped = regroup(kinematics.graph, kinematics.links)
    lighter = _loads(kinematics, grouped)
    shorter = _newton_euler(kinematics, grouped, products, lighter, a)
    if count(shorter).total <= count(inverse).total:  # grouping symbols is work too
        inertias, loads, inverse = grouped, lighter, shorter
    rest = tuple(kinematics.graph.zero for _ in a)
    tree = not kinematics.constraints.labels and not drives_cut_joint(kinematics)
    accelerations, pivots = _articulated(*turn_links(kinematics), inertias, products, loads) if tree else (None, ())
    return TreeEquations(
        method="recursive",
        mass_matrix=partial(_mass_matrix, kinematics, inverse),
        bias=_newton_euler(kinematics, inertias, products, loads, rest),
        inverse_dynamics=inverse,
        kinetic_energy=kinetic_energy(kinematics),
        potential_energy=potential_energy(kinematics),
        accelerations=accelerations,
        pivots=pivots,
    )


def _matrix(rows: Sequence[Sequence[Expr]]) -> Mat3:
    return tuple(tuple(row) for row in rows)  # type: ignore[return-value]


def _velocity_products(kinematics: Kinematics, rates: list[JointRates]) -> list[Twist]:
    """Acceleration of each link relative to its parent at v' = 0: Coriolis and centripetal terms."""
    graph = kinematics.graph
    products: list[Twist] = []
    for link, rate in zip(kinematics.links, rates, strict=True):
        above = kinematics.twists[link.parent][0] if link.parent != GROUND else vec.zero(graph)
        # below is omega_p x r + 2 r', so that omega_p x below + r'' is what turning axes add
        below = vec.add(vec.cross(above, link.position), vec.scale(graph.constant(2.0), rate.slide))
        linear = link.down(vec.add(vec.cross(above, below), rate.slide_rate))
        products.append((vec.add(rate.spin_rate, vec.cross(link.down(above), rate.spin)), linear))
    return products


def _loads(kinematics: Kinematics, inertias: list[SpatialInertia]) -> list[Wrench]:
    """Wrench on each link at zero acceleration: omega x momentum, less what is applied."""
    result: list[Wrench] = []
    applied = applied_wrenches(kinematics)
    for inertia, (omega, _), (turn, push) in zip(inertias, kinematics.twists, applied, strict=True):
        spin = vec.cross(omega, vec.times(inertia.inertia, omega))
        swing = vec.cross(omega, vec.cross(omega, inertia.moment))
        result.append((vec.sub(spin, turn), vec.sub(swing, push)))
    return result


def _base(kinematics: Kinematics) -> Twist:
    """Acceleration of ground that acts as gravity does."""
    return vec.zero(kinematics.graph), vec.neg(kinematics.mechanism.gravity)


def _newton_euler(
    kinematics: Kinematics,
    inertias: list[SpatialInertia],
    products: list[Twist],
    loads: list[Wrench],
    a: Sequence[Expr],
) -> tuple[Expr, ...]:
    """M a + h: accelerations outwards, wrenches inwards (Featherstone, RBDA, table 5.1)."""
    links = kinematics.links
    motions: list[Twist] = []
    wrenches: list[Wrench] = []
    for k, link in enumerate(links):
        above = motions[link.parent] if link.parent != GROUND else _base(kinematics)
        motion = add(link.down_twist(above), products[k])
        for c, column in enumerate(link.columns):
            motion = add(motion, scaled(a[link.first + c], column))
        motions.append(motion)
        wrenches.append(add(inertias[k].times(*motion), loads[k]))
    result = [-f for f in coordinate_forces(kinematics)]
    for k in reversed(range(len(links))):
        link = links[k]
        for c, column in enumerate(link.columns):
            result[link.first + c] = result[link.first + c] + dot(column, wrenches[k])
        if link.parent != GROUND:
            wrenches[link.parent] = add(wrenches[link.parent], link.lift(wrenches[k]))
    return tuple(result)


def _articulated(
    kinematics: Kinematics,
    blocks: Sequence[SlidingTriple],
    inertias: list[SpatialInertia],
    products: list[Twist],
    loads: list[Wrench],
) -> tuple[tuple[Expr, ...], tuple[Expr, ...]]:
    """v' and the pivots D (Featherstone, RBDA, table 7.1), found in velocities of which some are turned."""
    graph, links = kinematics.graph, kinematics.links
    still = vec.zero(graph)
    bodies = [Articulated(i.inertia, skew(i.moment), _uniform(i.mass)) for i in inertias]
    wrenches = list(loads)
    forces = turn_forces(blocks, coordinate_forces(kinematics))
    afloat = falling(blocks)
    drives = drive_inertias(kinematics)
    releases: list[list[Release]] = [[] for _ in links]
    for k in reversed(range(len(links))):
        link, body, wrench = links[k], bodies[k], wrenches[k]
        for c in reversed(range(len(link.columns))):
            column, index = link.columns[c], link.first + c
            felt = body.times(column)
            pivot = dot(column, felt) + drives.get(index, graph.zero)
            release = Release(index, column, felt, pivot, 1.0 / pivot, forces[index] - dot(column, wrench))
            releases[k].append(release)
            if link.parent != GROUND or c > 0:
                body = body.released(column, felt, release.reciprocal, index in drives)
                wrench = add(wrench, scaled(release.force * release.reciprocal, felt))
        if link.parent != GROUND:
            bodies[link.parent] = bodies[link.parent].plus(body.lifted(link))
            wrench = add(wrench, body.times(products[k]))
            wrenches[link.parent] = add(wrenches[link.parent], link.lift(wrench))
    motions: list[Twist] = []
    accelerations = [graph.zero] * len(kinematics.v)
    pivots = [graph.zero] * len(kinematics.v)
    for k, link in enumerate(links):
        lifted = still if k in afloat else _base(kinematics)[1]
        above = motions[link.parent] if link.parent != GROUND else (still, lifted)
        motion = add(link.down_twist(above), products[k])
        for release in reversed(releases[k]):
            rate = (release.force - dot(release.wrench, motion)) * release.reciprocal
            accelerations[release.index], pivots[release.index] = rate, release.pivot
            motion = add(motion, scaled(rate, release.column))
        motions.append(motion)
    return tuple(turn_back(blocks, accelerations)), tuple(pivots)


def _uniform(mass: Expr) -> Mat3:
    o = mass.graph.zero
    return ((mass, o, o), (o, mass, o), (o, o, mass))


def _mass_matrix(kinematics: Kinematics, inverse: tuple[Expr, ...]) -> Rows:
    """M as the derivative of M a + h by a."""
    entries = jacobian(list(inverse), list(kinematics.a))
    zero, n = kinematics.graph.zero, len(kinematics.v)
    return tuple(tuple(entries.get((max(i, j), min(i, j)), zero) for j in range(n)) for i in range(n))
