"""Links, loads and constraint rows -> mass matrix and accelerations, by recursions over the tree."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from ...elements.frames import GROUND
from ...expr import vectors as vec
from ...expr.core import Expr, Graph
from ...expr.records import Record
from ...expr.spatial import Twist, Wrench, add, dot, scaled
from ...expr.tensors import add_matrices, rotate, rotate_symmetric, skew, symmetric
from ...expr.vectors import Mat3, Rows
from ..tree import Link, SpatialInertia, ancestors

# -- sweeps ------------------------------------------------------------------------------------------------------------


def along_joints(
    links: Sequence[Link], wrenches: list[Wrench], forces: Sequence[Expr], order: Iterable[int] | None = None
) -> list[Expr]:
    """What wrenches, summed inwards, are along the motions of the joints, less forces (n,) there."""
    result = [-f for f in forces]
    for k in reversed(range(len(links))) if order is None else order:
        link = links[k]
        for c, column in enumerate(link.columns):
            result[link.first + c] = result[link.first + c] + dot(column, wrenches[k])
        if link.parent != GROUND:
            wrenches[link.parent] = add(wrenches[link.parent], link.lift(wrenches[k]))
    return result


# -- composite bodies --------------------------------------------------------------------------------------------------


def composite_mass_matrix(links: Sequence[Link], inertias: Sequence[SpatialInertia]) -> Rows:
    """M_ij = s_i . I^c_max(i,j) s_j along each branch, composite inertias summed inwards."""
    n = sum(len(link.columns) for link in links)
    composite = list(inertias)
    graph = links[0].mass.graph
    rows = [[graph.zero] * n for _ in range(n)]
    for k in graph.marked(reversed(range(len(links)))):
        link = links[k]
        if link.parent != GROUND:
            composite[link.parent] = composite[link.parent].plus(link.up_inertia(composite[k]))
        for c, column in enumerate(link.columns):
            i = link.first + c
            wrench = composite[k].times(*column)
            for d in range(c + 1):
                rows[i][link.first + d] = rows[link.first + d][i] = dot(link.columns[d], wrench)
            outer, at = link, link.parent
            while at != GROUND:
                wrench = outer.lift(wrench)
                outer = links[at]
                for d, other in enumerate(outer.columns):
                    rows[i][outer.first + d] = rows[outer.first + d][i] = dot(other, wrench)
                at = outer.parent
    return tuple(tuple(row) for row in rows)


# -- articulated bodies ------------------------------------------------------------------------------------------------

# Featherstone, Rigid Body Dynamics Algorithms (2008), ch. 7, in link axes. A joint of several degrees of freedom is
# released one column of its motion subspace at a time, which eliminates its block as L^T D L would.
#
# Links carry the multiplier of a constraint inwards as an unknown: the wrench on a link is I a + p + sum K_i l_i, and
# row i of the constraints reads K_i . a + r_i - sum_j G_ij l_j = 0 (G = C_q M^-1 C_q^T of the joints passed so far; it
# and M are positive definite, so that nothing is pivoted). The link below which a row has all its joints takes its
# multiplier out, l_i = (K_i . a + r_i - sum_j G_ij l_j) / G_ii, which adds K_i K_i^T / G_ii to I. A loop is thus paid
# for by the links in it, however long the chain is that carries it (A. Sathya and J. Carpentier, Constrained
# articulated body dynamics algorithms, IEEE Trans. Robotics 41 (2025), 430-449; A. Jain, Robot and Multibody Dynamics
# (2011), ch. 11).


class Articulated(Record):
    """[moment; force] = [[inertia, coupling], [coupling^T, mass]] [angular; linear acceleration] + a wrench."""

    inertia: Mat3
    coupling: Mat3
    mass: Mat3

    def times(self, motion: Twist) -> Wrench:
        """The wrench of an acceleration."""
        angular, linear = motion
        turn = vec.add(vec.times(self.inertia, angular), vec.times(self.coupling, linear))
        return turn, vec.add(vec.transpose_times(self.coupling, angular), vec.times(self.mass, linear))

    @classmethod
    def rigid(cls, inertia: SpatialInertia) -> Articulated:
        """A link alone."""
        o, mass = inertia.mass.graph.zero, inertia.mass
        return cls(inertia.inertia, skew(inertia.moment), ((mass, o, o), (o, mass, o), (o, o, mass)))

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
        inertia, coupling, mass = self._with_square(wrench, reciprocal, operator.sub)
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

    def constrained(self, wrench: Wrench, reciprocal: Expr) -> Articulated:
        """What is felt when a constraint that acts by the wrench holds: I + K K^T / G."""
        inertia, coupling, mass = self._with_square(wrench, reciprocal, operator.add)
        return Articulated(symmetric(_matrix(inertia)), _matrix(coupling), symmetric(_matrix(mass)))

    def _with_square(
        self, wrench: Wrench, reciprocal: Expr, combine: Callable[[Expr, Expr], Expr]
    ) -> list[list[list[Expr]]]:
        """The three parts with U U^T / D added or subtracted."""
        turn, push = wrench
        turn_d, push_d = vec.scale(reciprocal, turn), vec.scale(reciprocal, push)
        parts = ((self.inertia, turn, turn_d), (self.coupling, turn, push_d), (self.mass, push, push_d))
        return [[[combine(A[i][j], a[i] * b[j]) for j in range(3)] for i in range(3)] for A, a, b in parts]

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


class Release(Record):
    """One released column: U = I s, D = s . U, and the force left to accelerate it."""

    index: int
    column: Twist
    wrench: Wrench
    pivot: Expr
    reciprocal: Expr
    force: Expr
    rows: Mapping[int, Expr]  #: g_i = s . K_i + c_i of the constraints carried: their multipliers push along the column


class Multiplier(Record):
    """A multiplier taken out: l = (K . a + r - sum G_j l_j) / G."""

    row: int
    wrench: Wrench
    rest: Expr
    reciprocal: Expr
    others: Mapping[int, Expr]


class ConstraintRow(Record):
    """c . v' + rest = 0, entries by the index of the velocity."""

    entries: Mapping[int, Expr]
    rest: Expr


class TreeMotion(NamedTuple):
    """Accelerations (n,), pivots D (n,), multipliers (m,), pivots of G, and G_ii before rows were taken out (m,)."""

    accelerations: tuple[Expr, ...]
    pivots: tuple[Expr, ...]
    multipliers: tuple[Expr, ...]
    row_pivots: tuple[Expr, ...]
    row_sizes: tuple[Expr, ...]


class ArticulatedBodies:
    """One sweep inwards and one outwards over the links, in tree order.

    ``products`` are the accelerations of links relative to their parents at v' = 0, ``loads`` the wrenches on them at
    zero acceleration, less what is applied, ``forces`` (n,) are along the velocities, ``drives`` inertias by velocity.
    ``base`` is per link the acceleration of ground that acts as gravity does, zero below what falls freely.  ``term``
    is added to G relative to the largest diagonal entry of what is taken out at one link: redundant rows need it.
    """

    def __init__(
        self,
        graph: Graph,
        links: Sequence[Link],
        inertias: Sequence[SpatialInertia],
        products: Sequence[Twist],
        loads: Sequence[Wrench],
        forces: Sequence[Expr],
        drives: Mapping[int, Expr],
        base: Sequence[Twist],
        rows: Sequence[ConstraintRow] = (),
        term: float = 0.0,
    ) -> None:
        self.graph, self.links, self.products, self.base = graph, links, products, base
        self.forces, self.drives, self.rows, self.term = forces, drives, rows, term
        self.bodies = [Articulated.rigid(i) for i in inertias]
        self.wrenches = list(loads)
        if rows:
            self._begin_at_rest(inertias)
        self.row_wrenches: list[dict[int, Wrench]] = [{} for _ in links]
        self.rests = [row.rest for row in rows]
        self.coupling: list[dict[int, Expr]] = [{} for _ in rows]  #: G without its diagonal
        self.diagonal = [graph.zero for _ in rows]  #: the diagonal of G
        self.sizes = [graph.zero for _ in rows]
        self.releases: list[list[Release]] = [[] for _ in links]
        self.inner: list[list[Multiplier]] = [[] for _ in links]  #: taken out before the link's joint is released
        self.outer: list[list[Multiplier]] = [[] for _ in links]  #: and after that
        self.last: list[Multiplier] = []  #: taken out on ground
        self.row_pivots = [graph.one for _ in rows]
        self.multipliers = [graph.zero for _ in rows]
        self._find_places()

    def _begin_at_rest(self, inertias: Sequence[SpatialInertia]) -> None:
        """Count accelerations from those at v' = 0: rows have no part in these, and links their own inertia alone."""
        still = vec.zero(self.graph), vec.zero(self.graph)
        rest: list[Twist] = []
        for k, link in self.graph.marked(enumerate(self.links)):
            above = rest[link.parent] if link.parent != GROUND else self.base[k]
            rest.append(add(link.down_twist(above), self.products[k]))
            self.wrenches[k] = add(self.wrenches[k], inertias[k].times(*rest[k]))
        self.products = self.base = [still] * len(self.links)

    def _find_places(self) -> None:
        """Where each row has all its joints: the link on which they hang, or behind the joint of that link itself."""
        link_of = {link.first + c: k for k, link in enumerate(self.links) for c in range(len(link.columns))}
        self.acting: dict[int, list[int]] = {}  #: rows with an entry, by the index of the velocity
        self.at_link: dict[int, list[int]] = {}
        self.at_joint: dict[int, list[int]] = {}
        self.at_ground: list[int] = []
        for i, row in enumerate(self.rows):
            moving = {link_of[k] for k in row.entries}
            for k in row.entries:
                self.acting.setdefault(k, []).append(i)
            if not moving:
                continue  # it holds nothing, and its multiplier is 0
            common = set.intersection(*(set(ancestors(self.links, k)) for k in moving))
            place = max(common)
            if place == GROUND:
                self.at_ground.append(i)
            else:
                (self.at_joint if place in moving else self.at_link).setdefault(place, []).append(i)

    def solve(self) -> TreeMotion:
        """Both sweeps."""
        for k in self.graph.marked(reversed(range(len(self.links)))):
            self._inwards(k)
        self.last = self._take_out(self.at_ground, None)
        self._find_multipliers(self.last, None)
        accelerations = [self.graph.zero] * len(self.forces)
        pivots = list(accelerations)
        motions: list[Twist] = []
        for k, link in self.graph.marked(enumerate(self.links)):
            above = motions[link.parent] if link.parent != GROUND else self.base[k]
            motion = add(link.down_twist(above), self.products[k])
            self._find_multipliers(self.outer[k], motion)
            for release in reversed(self.releases[k]):
                force = release.force - dot(release.wrench, motion)
                for i, g in release.rows.items():
                    force = force - g * self.multipliers[i]
                rate = force * release.reciprocal
                accelerations[release.index], pivots[release.index] = rate, release.pivot
                motion = add(motion, scaled(rate, release.column))
            self._find_multipliers(self.inner[k], motion)
            motions.append(motion)
        rows = tuple(self.multipliers), tuple(self.row_pivots), tuple(self.sizes)
        return TreeMotion(tuple(accelerations), tuple(pivots), *rows)

    # -- inwards --------------------------------------------------------------------------------------------------
    def _inwards(self, k: int) -> None:
        link, row_wrenches = self.links[k], self.row_wrenches[k]
        self.inner[k] = self._take_out(self.at_link.get(k, ()), k)
        for c in reversed(range(len(link.columns))):
            self._release(k, c)
        self.outer[k] = self._take_out(self.at_joint.get(k, ()), k)
        at_rest = add(link.down_twist(self.base[k]), self.products[k]) if link.parent == GROUND else self.products[k]
        for i, wrench in row_wrenches.items():
            self.rests[i] = self.rests[i] + dot(wrench, at_rest)
        if link.parent == GROUND:
            return
        self.bodies[link.parent] = self.bodies[link.parent].plus(self.bodies[k].lifted(link))
        above = add(self.wrenches[k], self.bodies[k].times(self.products[k]))
        self.wrenches[link.parent] = add(self.wrenches[link.parent], link.lift(above))
        onwards = self.row_wrenches[link.parent]
        for i, wrench in row_wrenches.items():
            lifted = link.lift(wrench)
            onwards[i] = add(onwards[i], lifted) if i in onwards else lifted

    def _release(self, k: int, c: int) -> None:
        link, body, row_wrenches = self.links[k], self.bodies[k], self.row_wrenches[k]
        column, index = link.columns[c], link.first + c
        felt = body.times(column)
        pivot = dot(column, felt) + self.drives.get(index, self.graph.zero)
        reciprocal = 1.0 / pivot
        pushes: dict[int, Expr] = {}
        for i in sorted({*row_wrenches, *self.acting.get(index, ())}):
            push = dot(column, row_wrenches[i]) if i in row_wrenches else self.graph.zero
            push = push + self.rows[i].entries.get(index, self.graph.zero)
            if not push.is_zero:
                pushes[i] = push
        force = self.forces[index] - dot(column, self.wrenches[k])
        self.releases[k].append(Release(index, column, felt, pivot, reciprocal, force, pushes))
        if link.parent != GROUND or c > 0 or pushes:
            drive = index in self.drives
            rate = force * reciprocal
            self.bodies[k] = body.released(column, felt, reciprocal, drive)
            self.wrenches[k] = add(self.wrenches[k], scaled(rate, felt))
            for i, push in pushes.items():
                share = push * reciprocal
                still = vec.zero(self.graph)
                row_wrenches[i] = add(row_wrenches.get(i, (still, still)), scaled(-share, felt))
                if not drive:
                    row_wrenches[i] = _with_released(row_wrenches[i], column, self.rows[i].entries.get(index))
                self.rests[i] = self.rests[i] + push * rate
                self.diagonal[i] = self.diagonal[i] + push * share
                self.sizes[i] = self.sizes[i] + push * share
                for j, other in pushes.items():
                    if j < i:
                        self._couple(i, j, share * other)

    def _couple(self, i: int, j: int, change: Expr) -> None:
        value = self.coupling[i].get(j, self.graph.zero) + change
        self.coupling[i][j] = self.coupling[j][i] = value

    def _take_out(self, rows: Sequence[int], k: int | None) -> list[Multiplier]:
        """Take multipliers out at a link, or on ground, those that are coupled with the fewest others first."""
        left, result = list(rows), []
        still = vec.zero(self.graph)
        row_wrenches: dict[int, Wrench] = self.row_wrenches[k] if k is not None else {}
        relaxed = self._term(left)
        while left:
            i = min(left, key=lambda row: (len(self.coupling[row]), row))
            left.remove(i)
            pivot = self.diagonal[i] + relaxed
            reciprocal = 1.0 / pivot
            wrench, others, rest = row_wrenches.pop(i, (still, still)), self.coupling[i], self.rests[i]
            result.append(Multiplier(i, wrench, rest, reciprocal, others))
            self.row_pivots[i] = pivot
            if k is not None:
                self.bodies[k] = self.bodies[k].constrained(wrench, reciprocal)
                self.wrenches[k] = add(self.wrenches[k], scaled(rest * reciprocal, wrench))
            for j, entry in others.items():
                share = entry * reciprocal
                del self.coupling[j][i]
                self.diagonal[j] = self.diagonal[j] - share * entry
                self.rests[j] = self.rests[j] - share * rest
                if k is not None:
                    row_wrenches[j] = add(row_wrenches.get(j, (still, still)), scaled(-share, wrench))
                for other, value in others.items():
                    if other < j:
                        self._couple(j, other, -(share * value))
        return result

    def _term(self, rows: Sequence[int]) -> Expr:
        """What is added to the diagonal of G."""
        if not rows or not self.term:
            return self.graph.zero
        largest = self.diagonal[rows[0]]
        for i in rows[1:]:
            largest = self.graph.apply("max", largest, self.diagonal[i])
        return largest * self.term

    # -- outwards -------------------------------------------------------------------------------------------------
    def _find_multipliers(self, multipliers: Sequence[Multiplier], motion: Twist | None) -> None:
        for one in reversed(multipliers):
            value = one.rest if motion is None else one.rest + dot(one.wrench, motion)
            for j, entry in one.others.items():
                value = value - entry * self.multipliers[j]
            self.multipliers[one.row] = value * one.reciprocal


def _with_released(wrench: Wrench, column: Twist, entry: Expr | None) -> Wrench:
    """What is carried past a free column s along one axis: along s it is the row's own entry, as s . K + c = 0."""
    axes = [(half, k) for half in range(2) for k in range(3) if not column[half][k].is_zero]
    if len(axes) != 1 or column[axes[0][0]][axes[0][1]].value != 1.0:
        return wrench
    (half, place) = axes[0]
    halves = [list(wrench[0]), list(wrench[1])]
    halves[half][place] = column[half][place].graph.zero if entry is None else -entry
    return (halves[0][0], halves[0][1], halves[0][2]), (halves[1][0], halves[1][1], halves[1][2])


def _matrix(rows: Sequence[Sequence[Expr]]) -> Mat3:
    return tuple(tuple(row) for row in rows)  # type: ignore[return-value]
