"""Axes in which the links of a tree are described: four choices, each of which lowers the operations of its equations.

The gains on the 46 examples and the robots of ``benchmarks``, of right-hand sides (all four choices -> without it):

- :class:`AxisTurns`, x of links in loops: none of the examples; planar four-bars that lie obliquely 412 .. 432 -> 510.
- :func:`resolve_parallel`, common axes of parallel hinges: 13 examples by 0.3 to 3.6 %, their M and bias by 1 to 15 %;
  a hand of three fingers 2,366 -> 2,501, a quadruped 3,397 -> 3,541.
- :func:`turn_links`, own axes of what slides: a satellite 552 -> 672, a quadrotor with a load 583 -> 738.
- :func:`regroup`, inertia moved to parents: 30 examples by 0.2 to 16 %; a humanoid 8,296 -> 8,629.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..base.limits.numbers import ROUNDED
from ..elements.frames import GROUND, Frame, Marker
from ..elements.joints import euler
from ..expr import vectors as vec
from ..expr.core import Expr, Graph
from ..expr.evaluate import evaluate
from ..expr.identity import random_point
from ..expr.records import Record
from ..expr.spatial import Twist, Wrench
from ..expr.tensors import subtract_matrices, symmetric
from ..expr.vectors import Mat3, Rows, Vec3
from ..model.mechanism import Mechanism
from .topology import Branch, Topology
from .tree import JointRates, Link, SpatialInertia, link_twists, no_inertia

# -- axis turns --------------------------------------------------------------------------------------------------------

# What a joint lets free about and along its z axis alone does not change if both of its markers turn about z by the
# same angle. Along which direction x then lies is chosen for the link: along an arm, a hinge's axis or an axis of the
# parent. Without that, mechanisms that lie obliquely in ground carry three components where straight ones carry two.


#: What an entry costs that is neither 0, nor 1 in its own place, also one of a centre of mass, which enters no equation
#: of loops; an exchange of axes is nearly free.
MULTIPLIED, OF_CENTRE, EXCHANGED = 1.0, 0.5, 0.1


class _Directions(NamedTuple):
    """What becomes shorter in good axes: arms to joints as parts of their size, and axes of joints."""

    lengths: list[np.ndarray]
    centres: list[np.ndarray]  #: as lengths, to centres of mass
    axes: list[np.ndarray]


class AxisTurns:
    """The turns of a mechanism's joints, from ground outwards.

    Only links beyond an axis that is oblique in its parent's link frame are turned, those whose constants are numbers.
    Nothing is turned where no joint closes a loop.
    """

    def __init__(self, mechanism: Mechanism, topology: Topology, symbols: Mapping[str, Expr]) -> None:
        self.mechanism, self.topology, self.symbols = mechanism, topology, symbols
        self._open: set[int] = set()  # bodies beyond an oblique axis

    def turned(self, branch: Branch, holder: Mat3, inner: Frame) -> Mat3 | None:
        """The rotation about z by which both markers of a joint turn; None for none.

        ``holder`` is its marker on the parent, in the parent's link frame, ``inner`` that on the body.
        """
        if not self.topology.cut:
            return None
        H, F = numbers(holder), numbers(inner.rotation)
        if H is None or F is None or not self._symmetric(branch):
            return None
        if branch.parent not in self._open and np.count_nonzero(np.abs(H[:, 2]) > ROUNDED) < 2:
            return None
        self._open.add(branch.body)
        directions = _Directions([], [], [])
        if not self._collect(branch, np.eye(3), directions):
            return None
        angles = {0.0}
        for x, y in (tuple(v[:2].tolist()) for v in (*directions.lengths, *directions.centres, *directions.axes, *H)):
            if math.hypot(x, y) > ROUNDED:
                angles |= {math.remainder(math.atan2(y, x) + k * math.pi / 2, 2 * math.pi) for k in range(4)}
        costs = {a: _cost(a, H, directions) for a in angles}
        best = min(angles, key=lambda a: (round(costs[a], 3), abs(a)))
        if costs[0.0] - costs[best] < MULTIPLIED / 2:
            return None
        graph = self.mechanism.graph
        c, s = graph.constant(math.cos(best)), graph.constant(math.sin(best))
        return ((c, -s, graph.zero), (s, c, graph.zero), (graph.zero, graph.zero, graph.one))

    def _collect(self, branch: Branch, axes: np.ndarray, directions: _Directions) -> bool:
        """Note the arms and axes of a link, and those of links on hinges parallel to its own, in common axes.

        False where a symbol lengthens an arm along an axis, as it would stand in two. Other arms with symbols are left
        out, as rounding would keep their entries from 0, and centres with symbols.
        """
        _, inner = self._ends(branch)
        origin = inner.frame.position
        if (F := numbers(inner.frame.rotation)) is None:
            return True
        points = [(directions.centres, self.mechanism.bodies[branch.body].com)]
        for marker in self._others[branch.body]:
            if marker is not inner:
                points.append((directions.lengths, marker.frame.position))
                if (R := numbers(marker.frame.rotation)) is not None:
                    directions.axes.append(axes @ F.T @ R[:, 2])
        for arms, point in points:
            if (ends := numbers([point, origin])) is not None:
                if size := np.abs(ends).max(axis=1).sum():
                    arm = axes @ F.T @ (ends[0] - ends[1])
                    arms.append(np.where(np.abs(arm) <= ROUNDED * size, 0.0, arm / size))
            elif arms is directions.lengths and any(
                np.count_nonzero(np.abs(axes @ F.T @ arm) > ROUNDED * size) == 1 for arm, size in _growth(origin, point)
            ):
                return False
        for child in self._children.get(branch.body, ()):
            outer, _ = self._ends(child)
            R = numbers(outer.frame.rotation)
            if R is None or abs((F.T @ R)[2, 2] - 1.0) > ROUNDED or not self._symmetric(child):
                continue
            if not self._collect(child, axes @ F.T @ R, directions):
                return False
        return True

    def _ends(self, branch: Branch) -> tuple[Marker, Marker]:
        spec = self.mechanism.joints[branch.joint]
        ends = (spec.predecessor, spec.successor)
        return (ends[1], ends[0]) if branch.reversed else ends

    def _symmetric(self, branch: Branch) -> bool:
        """Whether a joint turns and slides about and along z alone, so that it looks the same from all around z."""
        spec = self.mechanism.joints[branch.joint]
        q = [self.symbols[name] for name in spec.coordinates]
        (rotation, position), columns = (
            spec.joint.pose(self.mechanism.graph, q),
            spec.joint.subspace(self.mechanism.graph, q),
        )
        others = [*position[:2], *(x for column in columns for part in column for x in part[:2])]
        c, s = rotation[0][0], rotation[1][0]
        return all(x.is_zero for x in others) and about_z(rotation) and rotation[1][1] == c and rotation[0][1] == -s

    @cached_property
    def _others(self) -> dict[int, list[Marker]]:
        """The markers of joints on each body."""
        result: dict[int, list[Marker]] = {}
        for spec in self.mechanism.joints:
            for marker in (spec.predecessor, spec.successor):
                result.setdefault(marker.body, []).append(marker)
        return result

    @cached_property
    def _children(self) -> dict[int, list[Branch]]:
        result: dict[int, list[Branch]] = {}
        for branch in self.topology.branches:
            result.setdefault(branch.parent, []).append(branch)
        return result


def about_z(rotation: Mat3) -> bool:
    """Whether a rotation leaves the z axis alone."""
    others = (rotation[0][2], rotation[1][2], rotation[2][0], rotation[2][1])
    return rotation[2][2].value == 1.0 and all(x.is_zero for x in others)


def numbers(rows: Sequence[Sequence[Expr]]) -> np.ndarray | None:
    """Constant entries; None if one is not."""
    values = [[x.value for x in row] for row in rows]
    return None if any(x is None for row in values for x in row) else np.array(values, dtype=float)


def _growth(start: Vec3, end: Vec3) -> list[tuple[np.ndarray, float]]:
    """How an arm with symbols grows with each of them, from values drawn, and the sizes of what cancels in it."""
    random = np.random.default_rng(7)
    both = (*start, *end)
    old, new = random_point(both, random), random_point(both, random)
    result = []
    for name in old:
        a, b = np.reshape(np.subtract(evaluate(both, old | {name: new[name]}), evaluate(both, old)), (2, 3))
        result.append((b - a, float(np.abs(a).max() + np.abs(b).max())))
    return result


def _cost(angle: float, H: np.ndarray, directions: _Directions) -> float:
    """How many constants stay that are multiplied with."""
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    cost = 0.0
    for weight, arms in ((MULTIPLIED, directions.lengths), (OF_CENTRE, directions.centres)):
        cost += weight * sum(np.count_nonzero(np.abs(turn.T @ x) > ROUNDED) for x in arms)
    for i, row in enumerate(H @ turn):
        for j, x in enumerate(row):
            cost += _entry(x, i == j)
    for x in directions.axes:
        cost += sum(_entry(y, i == 2) for i, y in enumerate(turn.T @ x))
    return cost


def _entry(x: float, exact: bool) -> float:
    if abs(x) <= ROUNDED:
        return 0.0
    if abs(abs(x) - 1.0) <= ROUNDED:
        return 0.0 if exact and x > 0 else EXCHANGED
    return MULTIPLIED


# -- parallel axes -----------------------------------------------------------------------------------------------------

# Between links that only turn about one direction nothing need be rotated: vectors keep the components they have in the
# axes of the first, and the sums of the angles since then turn the constants of each link (first moments, inertia,
# distances) instead.  For a planar chain these are absolute angles.


class ResolvedLink(Link):
    """A link whose parent is resolved in other axes than its own: ``axes`` turns parent link axes to those."""

    axes: Mat3

    def down(self, x: Vec3) -> Vec3:
        return super().down(vec.transpose_times(self.axes, x))

    def up(self, x: Vec3) -> Vec3:
        return vec.times(self.axes, super().up(x))

    def up_inertia(self, inertia: SpatialInertia) -> SpatialInertia:
        turned = inertia.turned(self.joint_rotation).turned(self.turn).turned(self.axes)
        return turned.shifted(self.position)


class Resolved(Record):
    """Links, their angular velocities and what goes with them, in the axes they are resolved in."""

    links: tuple[Link, ...]
    twists: tuple[Twist, ...]
    rates: list[JointRates]
    applied: list[Wrench]
    axes: tuple[Mat3 | None, ...]  #: link axes to the axes it is resolved in; None where they are the same

    @classmethod
    def in_link_axes(
        cls, links: Sequence[Link], twists: Sequence[Twist], rates: list[JointRates], applied: list[Wrench]
    ) -> Resolved:
        """As they are."""
        return cls(tuple(links), tuple(twists), rates, applied, (None,) * len(links))

    def inertias(self, spatial: Sequence[SpatialInertia]) -> list[SpatialInertia]:
        """Inertias in link axes -> in these axes."""
        return [i if axes is None else i.turned(axes) for i, axes in zip(spatial, self.axes, strict=True)]

    def with_columns(self, links: Sequence[Link]) -> Resolved:
        """The same with other columns, of these links."""
        pairs = zip(self.links, links, strict=True)
        return replace(self, links=tuple(replace(one, columns=other.columns) for one, other in pairs))


def resolve_parallel(
    graph: Graph, links: Sequence[Link], v: tuple[Expr, ...], rates: Sequence[JointRates], applied: Sequence[Wrench]
) -> Resolved:
    """Choose the axes; links on which no parallel hinge hangs keep their own."""
    still = vec.identity(graph)
    constants: list[Mat3] = []  # the turns between markers since the first of the row
    sums: list[Expr | None] = []  # the angles since then; None for the first
    axes: list[Mat3 | None] = []
    resolved: list[Link] = []
    for link in links:
        angle = _hinge_angle(link)
        holder = axes[link.parent] if link.parent != GROUND else None
        follows = angle is not None and link.parent != GROUND and _hinge_angle(links[link.parent]) is not None
        if follows and angle is not None and about_z(link.turn):
            before = sums[link.parent]
            total = angle if before is None else before + angle
            constant = vec.product(constants[link.parent], link.turn)
            constants.append(constant)
            sums.append(total)
            axes.append(vec.product(constant, euler(graph, "z", [total])[0]))
            position = link.position if holder is None else vec.times(holder, link.position)
            resolved.append(replace(link, turn=still, joint_rotation=still, position=position))
            continue
        constants.append(still)
        sums.append(None)
        axes.append(None)
        if holder is not None:
            values = {f.name: getattr(link, f.name) for f in fields(Link)}
            link = ResolvedLink(**values | {"position": vec.times(holder, link.position)}, axes=holder)
        resolved.append(link)
    moved = []
    for link, rate in zip(links, rates, strict=True):
        holder = axes[link.parent] if link.parent != GROUND else None
        if holder is not None:
            rate = replace(rate, slide=vec.times(holder, rate.slide), slide_rate=vec.times(holder, rate.slide_rate))
        moved.append(rate)
    loads = [
        load if turn is None else (vec.times(turn, load[0]), vec.times(turn, load[1]))
        for load, turn in zip(applied, axes, strict=True)
    ]
    return Resolved(tuple(resolved), tuple(link_twists(graph, tuple(resolved), v)), moved, loads, tuple(axes))


def _hinge_angle(link: Link) -> Expr | None:
    """The angle about z of a link that does nothing but turn about it; else None."""
    if len(link.columns) != 1 or not about_z(link.joint_rotation):
        return None
    angular, linear = link.columns[0]
    if not all(x.is_zero for x in (angular[0], angular[1], *linear)):
        return None
    c, s = link.joint_rotation[0][0], link.joint_rotation[1][0]
    graph, positive = c.graph, s.node[0] == "sin"
    inner = s.node if positive else graph.nodes[s.node[1]] if s.node[0] == "neg" else ("",)
    if c.node[0] != "cos" or inner[0] != "sin" or inner[1] != c.node[1]:
        return None
    angle = Expr(graph, c.node[1])
    return angle if positive else -angle


# -- link axes ---------------------------------------------------------------------------------------------------------

# The velocity of a free joint is along the axes of its marker on the parent, so that its columns of the motion subspace
# are full of sines and cosines.  Along the link's own axes they are unit vectors, and whatever is projected on them or
# eliminated with them is shorter: with w = R v for these three velocities the system M v' + h = 0 becomes
# (R M R^T) w' + R h = 0, where v' = R^T w' (w' taken at rest, as h holds the velocity terms).  What hangs on ground by
# such a joint falls freely: gravity is left out of h and added to v'. The accelerations of examples/satellite.yaml take
# 535 operations so and 641 otherwise, those of quadrotor_load.yaml 569 and 724.


class SlidingTriple(Record):
    """Three velocities of a link: the first, link axes to the axes they are along, gravity in these if it falls."""

    link: int
    first: int
    rotation: Mat3
    gravity: Vec3 | None


class Turned(Record):
    """M w' + h = 0 in turned velocities; ``form`` derives (M, h) when first used."""

    form: Callable[[], tuple[Rows, tuple[Expr, ...]]]
    blocks: tuple[SlidingTriple, ...]

    @cached_property
    def system(self) -> tuple[Rows, tuple[Expr, ...]]:
        """M and h."""
        return self.form()

    def accelerations(self, solution: Sequence[Expr]) -> list[Expr]:
        """v' from w'."""
        return turn_back(self.blocks, solution)


def turn_links(links: Sequence[Link], gravity: Vec3) -> tuple[tuple[Link, ...], tuple[SlidingTriple, ...]]:
    """The links with unit vectors for the columns of such joints, and where these are."""
    turned: list[Link] = []
    blocks: list[SlidingTriple] = []
    for k, link in enumerate(links):
        if _slides_along_parent(link):
            graph = link.mass.graph
            unit = [(vec.zero(graph), axis) for axis in vec.identity(graph)]
            fall = vec.transpose_times(link.turn, gravity) if link.parent == GROUND else None
            blocks.append(SlidingTriple(k, link.first, link.joint_rotation, fall))
            link = replace(link, columns=(*unit, *link.columns[3:]))
        turned.append(link)
    return tuple(turned), tuple(blocks)


def turn_forces(blocks: Sequence[SlidingTriple], forces: Sequence[Expr]) -> list[Expr]:
    """Forces along the velocities v -> along w."""
    result = list(forces)
    for b in blocks:
        x, y, z = forces[b.first : b.first + 3]
        result[b.first : b.first + 3] = vec.transpose_times(b.rotation, (x, y, z))
    return result


def turn_back(blocks: Sequence[SlidingTriple], accelerations: Sequence[Expr]) -> list[Expr]:
    """w' -> v'."""
    result = list(accelerations)
    for b in blocks:
        x, y, z = accelerations[b.first : b.first + 3]
        along = vec.times(b.rotation, (x, y, z))
        result[b.first : b.first + 3] = along if b.gravity is None else vec.add(along, b.gravity)
    return result


def falling(blocks: Sequence[SlidingTriple]) -> frozenset[int]:
    """Links from which outwards gravity is left out."""
    return frozenset(b.link for b in blocks if b.gravity is not None)


def _slides_along_parent(link: Link) -> bool:
    """Whether the first three columns are the axes of the joint's marker on the parent, and not link axes already."""
    axes = link.joint_rotation
    if len(link.columns) < 3 or axes == vec.identity(axes[0][0].graph):
        return False
    return all(
        linear == axes[c] and all(x.is_zero for x in angular) for c, (angular, linear) in enumerate(link.columns[:3])
    )


# -- inertia moved to parents ------------------------------------------------------------------------------------------

# What a joint lets a link do relative to its parent leaves some combinations of the ten inertial parameters without any
# effect on the difference between the two (M. Gautier and W. Khalil, Direct calculation of minimum set of inertial
# parameters of serial robots, IEEE Trans. Robotics and Automation 6 (1990), 368-373): carried by the parent they give
# the same kinetic energy and the same work of gravity. Links are left with seven parameters or fewer. Kept by its link,
# the rest need not look like a body: masses vanish and moments of inertia may be negative.


def regroup(graph: Graph, links: tuple[Link, ...]) -> list[SpatialInertia]:
    """Spatial inertia of every link after moving towards ground all that can be moved; what reaches ground is gone."""
    inertias = [link.spatial for link in links]
    for k in graph.marked(reversed(range(len(links)))):
        link = links[k]
        part = movable(graph, link, inertias[k])
        if part.is_zero:
            continue
        inertias[k] = _less(inertias[k], part)
        if link.parent != GROUND:
            turned_part = part.turned(link.turn) if link.columns else part.turned(link.joint_rotation).turned(link.turn)
            inertias[link.parent] = inertias[link.parent].plus(turned_part.shifted(link.position))
    return inertias


def movable(graph: Graph, link: Link, inertia: SpatialInertia) -> SpatialInertia:
    """The part of a link's inertia that acts alike on its parent.

    Weld: all.  No rotation: the inertia tensor, which feels angular velocity only.  Rotation about a fixed point: the
    mass; about the z axis only: also the first moment along z and yy of the tensor, as xx = yy = yy, zz = 0.
    """
    o = vec.zero(graph)
    nothing = no_inertia(graph)
    if not link.columns:
        return inertia
    turns = [angular for angular, _ in link.columns]
    if all(x.is_zero for turn in turns for x in turn):
        return SpatialInertia(graph.zero, o, inertia.inertia)
    if any(not x.is_zero for _, linear in link.columns for x in linear):
        return nothing
    if len(turns) == 1 and turns[0][0].is_zero and turns[0][1].is_zero:
        yy = inertia.inertia[1][1]
        tensor: Mat3 = ((yy, graph.zero, graph.zero), (graph.zero, yy, graph.zero), o)
        return SpatialInertia(inertia.mass, (graph.zero, graph.zero, inertia.moment[2]), tensor)
    return SpatialInertia(inertia.mass, o, (o, o, o))


def _less(a: SpatialInertia, b: SpatialInertia) -> SpatialInertia:
    tensor = symmetric(subtract_matrices(a.inertia, b.inertia))
    return SpatialInertia(a.mass - b.mass, vec.sub(a.moment, b.moment), tensor)
