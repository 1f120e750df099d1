"""Mechanism -> Topology, the spanning tree, the joints that close loops, the layout of q and v, its length.

Which joint of a loop is cut: never one with a chosen independent coordinate if that can be helped; one whose
coordinates the user did not name (and does not drive, and whose angular velocity they did not give) before one they
named; in a loop of more than LONG joints the one with the most freedoms, since each equation of it is carried through
the whole loop; among equals the one that leaves the shortest chains; then the last declared.  Pure constraints (a rod)
are always cut, joints that cannot be cut (a point on a curve) never.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cached_property
from itertools import combinations

import numpy as np

from ..base.limits.numbers import HAIR, NO_LENGTH
from ..base.texts import acceleration_name
from ..elements.constraints.drivers import CoordinateDriver
from ..elements.frames import GROUND
from ..elements.joints import Distance, QuaternionSlot, RevoluteSpherical, parameter_rates
from ..errors import ModelError
from ..expr import vectors as vec
from ..expr.core import Expr
from ..expr.differentiate import jacobian, jvp
from ..expr.evaluate import Evaluator
from ..expr.identity import rounded_vector, size_of
from ..expr.records import Record
from ..expr.vectors import Vec3
from ..model.checks import UNHELD
from ..model.equations import clock
from ..model.mechanism import JointSpec, Mechanism

#: Joints of a loop above which equations count more than lengths of chains: forces and multipliers of long loops are
#: found by recursion over their bodies, whose work grows with the rows and not with the depth of the tree.
LONG = 32


class Branch(Record):
    """One tree joint: ``body`` hangs on ``parent`` (indices of bodies, GROUND) through joint number ``joint``."""

    body: int
    parent: int
    joint: int
    reversed: bool  #: the tree passes the joint from successor to predecessor


class Topology(Record):
    """The spanning tree in an order where parents come first, and the cut joints in order of declaration."""

    branches: tuple[Branch, ...]
    cut: tuple[int, ...]


def _rank(spec: JointSpec, independent: Collection[str], initial: Collection[str]) -> int:
    if spec.joint.role == "tree":
        return -1
    if spec.joint.role == "loop":
        return 3
    if any(name in independent for name in (*spec.coordinates, *spec.velocities)):
        return 0
    if spec.joint.counts_turns:  # a thread is best kept whole
        return 1
    return (
        1
        if spec.named or not spec.coordinates or any(name in initial for name in (*spec.coordinates, *spec.velocities))
        else 2
    )


class _Forest:
    """Union-find over bodies."""

    def __init__(self, n: int) -> None:
        self.root = list(range(n + 1))  # the last is ground

    def find(self, i: int) -> int:
        while self.root[i] != i:
            self.root[i] = self.root[self.root[i]]
            i = self.root[i]
        return i

    def join(self, i: int, j: int) -> bool:
        a, b = self.find(i), self.find(j)
        self.root[a] = b
        return a != b


def _ends(spec: JointSpec) -> tuple[int, int]:
    return spec.predecessor.body, spec.successor.body


def _walk(n: int, joints: Sequence[JointSpec], tree: Collection[int]) -> list[Branch]:
    """The tree's branches from ground, depth first in order of declaration."""
    touching: list[list[int]] = [[] for _ in range(n + 1)]
    for k in sorted(tree):
        for end in _ends(joints[k]):
            touching[end].append(k)
    branches: list[Branch] = []
    seen = {GROUND}
    stack = [(k, GROUND) for k in reversed(touching[GROUND])]
    while stack:
        k, parent = stack.pop()
        predecessor, successor = _ends(joints[k])
        body = successor if predecessor == parent else predecessor
        if body in seen:
            continue
        seen.add(body)
        branches.append(Branch(body, parent, k, predecessor != parent))
        stack.extend((j, body) for j in reversed(touching[body]) if j != k)
    return branches


class _Depths:
    """How far the bodies of a tree are from ground, and what another cut of a loop would change in the sum of that."""

    def __init__(self, joints: Sequence[JointSpec], branches: Sequence[Branch]) -> None:
        self.joints = joints
        self.above = {b.body: b for b in branches}
        self.depth = {GROUND: 0}
        for b in branches:
            self.depth[b.body] = self.depth[b.parent] + 1
        self.outer_count = dict.fromkeys(self.above, 1)  #: bodies that hang on each, itself included
        for b in reversed(branches):
            if b.parent != GROUND:
                self.outer_count[b.parent] += self.outer_count[b.body]

    def _down_to(self, body: int, top: int) -> list[int]:
        """Bodies on the way from below ``top`` to ``body``."""
        result = []
        while body != top:
            result.append(body)
            body = self.above[body].parent
        return result[::-1]

    def changes(self, cut: int) -> dict[int, int]:
        """By each tree joint on the loop that joint ``cut`` closes: how much longer all is if it is cut instead."""
        a, b = _ends(self.joints[cut])
        top, other = a, b
        while top != other:
            if self.depth[top] < self.depth[other]:
                top, other = other, top
            top = self.above[top].parent
        result: dict[int, int] = {}
        for here, there in ((a, b), (b, a)):
            side, far = self._down_to(here, top), self.depth[there]
            single = [self.outer_count[x] for x in side]
            for k in range(len(side) - 1):
                single[k] -= self.outer_count[side[k + 1]]
            change = 0
            for k in reversed(range(len(side))):  # what is below the joint of this body hangs on the other side then
                change += single[k] * (far + len(side) - k - self.depth[side[k]])
                result[self.above[side[k]].joint] = change
        return result


def _check_tree(mechanism: Mechanism, tree: Collection[int], branches: Sequence[Branch]) -> None:
    problems = []
    for k, spec in enumerate(mechanism.joints):
        if spec.joint.role == "tree" and k not in tree:
            message = f"a {spec.joint.type_name} joint cannot close a loop, and all joints of its loop are of that kind"
            remedy = "use another type for one joint of the loop"
            problems.append(mechanism.problem(f"joints.{spec.name}", message, remedy, "EG-TOPOLOGY"))
    moved = {branch.body for branch in branches}
    for k, body in enumerate(mechanism.bodies):
        if k not in moved:
            problems.append(mechanism.problem(f"bodies.{body.name}", *UNHELD, code="EG-TOPOLOGY"))
    if problems:
        raise ModelError(problems)


def find_topology(mechanism: Mechanism, independent: Collection[str] = ()) -> Topology:
    """Choose the spanning tree, in which joints of coordinates named as independent are kept first.

    Refused are loops of joints that cannot be cut, and bodies that are connected by pure constraints alone.
    """
    joints, n = mechanism.joints, len(mechanism.bodies)
    forest = _Forest(n)
    rates = {n for spec in joints for n, v in zip(spec.velocities, spec.joint.velocities, strict=True) if v.of is None}
    declared = rates.intersection(mechanism.defaults.initial)
    declared |= {str(c.coordinate.node[1]) for c in mechanism.constraints if isinstance(c, CoordinateDriver)}
    rank = [_rank(spec, independent, declared) for spec in joints]
    order = sorted(range(len(joints)), key=lambda k: (rank[k], k))
    tree = {k for k in order if joints[k].joint.role != "loop" and forest.join(*_ends(joints[k]))}
    branches = _walk(n, joints, tree)
    _check_tree(mechanism, tree, branches)
    depths = _Depths(joints, branches)
    improved, before = True, set[frozenset[int]]()
    while improved and frozenset(tree) not in before:
        before.add(frozenset(tree))
        improved = False
        for cut in sorted(set(range(len(joints))) - tree):
            best, swap = (0, 0, -cut), None
            changes = depths.changes(cut)
            long = len(changes) >= LONG
            for other, longer in sorted(changes.items()):
                more = len(joints[cut].velocities) - len(joints[other].velocities) if long else 0
                if rank[other] == rank[cut] and (more, longer, -other) < best:
                    best, swap = (more, longer, -other), other
            if swap is not None:
                tree = tree - {swap} | {cut}
                branches = _walk(n, joints, tree)
                depths = _Depths(joints, branches)
                improved = True
    return Topology(tuple(branches), tuple(sorted(set(range(len(joints))) - tree)))


# -- layout of coordinates ---------------------------------------------------------------------------------------------


class MotionSymbols(Record):
    """Coordinates, velocities, accelerations of the tree and time: names, kinds, symbols, and q' in terms of them.

    ``q`` are the coordinates in the order of ``names``; ``v`` and ``a`` the generalized velocities and their rates, in
    the order of ``velocity_names``.  ``rates`` is q' = N(q) v, which is v itself but for Euler parameters and given
    equations.  ``parent[j]`` is the velocity next to velocity j towards ground, -1 for none (Featherstone, RBDA,
    sec. 6.4).
    """

    names: tuple[str, ...]
    kinds: tuple[str, ...]  #: 'angle', 'length' or 'parameter' per coordinate
    velocity_names: tuple[str, ...]
    velocity_kinds: tuple[str, ...]
    parent: tuple[int, ...]
    quaternion_slots: tuple[QuaternionSlot, ...]  #: where Euler parameters stand in q, and their angular velocity in v
    q: tuple[Expr, ...]
    v: tuple[Expr, ...]
    a: tuple[Expr, ...]
    t: Expr
    rates: tuple[Expr, ...]
    time_direction: dict[Expr, Expr]  #: t' = 1, and the rates of the inputs, as the direction of a derivative
    general_rates: bool  #: whether q' = N(q, t) v + b(q, t) of given equations, beyond q' = v

    @property
    def q_dot_direction(self) -> dict[Expr, Expr]:
        """The rates of the coordinates, q' = N(q) v, as the direction of a derivative."""
        return dict(zip(self.q, self.rates, strict=True))

    @cached_property
    def along(self) -> dict[Expr, Expr]:
        """The direction of d/dt: q' = N v, v' = a, t' = 1, and the rates of the inputs."""
        return {**self.q_dot_direction, **dict(zip(self.v, self.a, strict=True)), **self.time_direction}

    def total_derivative(self, expressions: Sequence[Expr]) -> list[Expr]:
        """d/dt along q' = N v, v' = a, t' = 1, and the rates of the inputs."""
        return jvp(list(expressions), self.along)

    @cached_property
    def coordinate_of(self) -> tuple[int, ...]:
        """Per velocity the coordinate whose rate it is, -1 for none, as for an angular velocity."""
        places = {rate: k for k, rate in reversed([*enumerate(self.rates)])}
        return tuple(places.get(v, -1) for v in self.v)

    @cached_property
    def velocity_labels(self) -> tuple[str, ...]:
        """What each velocity is called where coordinates are chosen: the coordinate whose rate it is, or itself."""
        places = self.coordinate_of
        return tuple(n if k < 0 else self.names[k] for n, k in zip(self.velocity_names, places, strict=True))

    def slopes(self, values: Sequence[Expr], rates: Sequence[Expr]) -> dict[tuple[int, int], Expr]:
        """Derivatives by v of the rates of functions of q: df/dq N."""
        if self.rates == self.v:
            return jacobian(list(values), list(self.q))
        return jacobian(list(rates), list(self.v))


def motion_symbols(mechanism: Mechanism, topology: Topology) -> MotionSymbols:
    """The coordinates and velocities of the tree, in its order."""
    graph, equations = mechanism.graph, mechanism.given
    names: list[str] = []
    kinds: list[str] = []
    velocity_names: list[str] = []
    velocity_kinds: list[str] = []
    parent: list[int] = []
    slots: list[QuaternionSlot] = []
    if equations is not None:
        names, velocity_names = [*equations.coordinates], [*equations.velocities]
        kinds, velocity_kinds = ["angle"] * len(names), ["angle"] * len(velocity_names)
        parent = [*range(-1, len(velocity_names) - 1)]
    last = {GROUND: -1}  # the velocity next to a body towards ground
    for branch in topology.branches:
        spec = mechanism.joints[branch.joint]
        slots += [QuaternionSlot(len(names) + i, len(velocity_names) + j) for i, j in spec.joint.quaternion_slots]
        names += spec.coordinates
        kinds += [coordinate.kind for coordinate in spec.joint.coordinates]
        above = last[branch.parent]
        for name, velocity in zip(spec.velocities, spec.joint.velocities, strict=True):
            parent.append(above)
            above = len(velocity_names)
            velocity_names.append(name)
            velocity_kinds.append(velocity.kind)
        last[branch.body] = above
    q, v = (tuple(map(graph.symbol, listed)) for listed in (names, velocity_names))
    rates = _rates(q, v, slots) if equations is None else equations.rates
    return MotionSymbols(
        names=tuple(names),
        kinds=tuple(kinds),
        velocity_names=tuple(velocity_names),
        velocity_kinds=tuple(velocity_kinds),
        parent=tuple(parent),
        quaternion_slots=tuple(slots),
        q=q,
        v=v,
        a=tuple(graph.symbol(acceleration_name(n)) for n in velocity_names),
        t=graph.symbol("t"),
        rates=rates,
        time_direction=clock(graph, mechanism.inputs),
        general_rates=equations is not None and rates != v,
    )


def _rates(q: Sequence[Expr], v: Sequence[Expr], slots: Sequence[QuaternionSlot]) -> tuple[Expr, ...]:
    """q' = N(q) v: the velocities beside those of Euler parameters are the rates of the other coordinates in order."""
    result = list(v)
    for slot in slots:  # in ascending order, so that places in q are those in the result
        i, j = slot.coordinate, slot.velocity
        result[i : i + 3] = parameter_rates(q[i : i + 4], v[j : j + 3])
    return tuple(result)


# -- the length scale --------------------------------------------------------------------------------------------------


PAIRS = 12  #: joints of a body up to which all distances between them count, beyond it those from the first to all


def length_scale(mechanism: Mechanism) -> Expr:
    """Root mean square of the lengths of rods and of the distances between joints on one body.

    Where there is none, of the distances from joints to centres of mass; 1 if there is none of these either.  A length
    that is nothing beside the radius of gyration of the bodies, as what rounding in a file leaves of a 0, is none.
    Minimum-norm corrections compare lengths with angles; measured in this length, neither units nor frames of bodies
    matter.
    """
    graph = mechanism.graph
    points: dict[int, list[Vec3]] = {}
    squares = []
    for spec in mechanism.joints:
        for marker in (spec.predecessor, spec.successor):
            points.setdefault(marker.body, []).append(marker.frame.position)
        if isinstance(spec.joint, Distance | RevoluteSpherical):
            squares.append(spec.joint.length * spec.joint.length)
    for places in points.values():
        pairs = combinations(places, 2) if len(places) <= PAIRS else ((places[0], x) for x in places[1:])
        squares += [_square(a, b) for a, b in pairs]
    squares = [x for x in squares if not x.is_zero]
    if not squares:
        bodies = [k for k, places in points.items() if k >= 0 and not mechanism.bodies[k].mass.is_zero and places]
        squares = [_square(mechanism.bodies[k].com, x) for k in bodies for x in points[k]]
        squares = [x for x in squares if not x.is_zero]
    if not squares:
        return graph.one
    total = graph.zero
    for square in squares:
        total = total + square
    size = graph.apply("sqrt", total / float(len(squares)))
    least = max(NO_LENGTH, HAIR * _radius_of_gyration(mechanism, size))
    return graph.apply("select", graph.apply("lt", size, least), 1.0, size)  # parameters may make all of them 0


def _radius_of_gyration(mechanism: Mechanism, size: Expr) -> float:
    """That of all bodies with the declared parameters, each about its own centre.

    0 without masses or values, and where parameters given late may change it, unless ``size`` is a hair beside it.
    """
    entries = [x for b in mechanism.bodies for x in (b.mass, b.inertia[0][0], b.inertia[1][1], b.inertia[2][2])]
    if not entries or any(p.value is None for p in mechanism.parameters):
        return 0.0
    numbers = Evaluator([size, *entries], [p.name for p in mechanism.parameters])
    declared, *result = numbers([p.value for p in mechanism.parameters])
    mass, inertia = sum(result[::4]), sum(result) - sum(result[::4])
    radius = float(np.sqrt(0.5 * inertia / mass)) if mass > 0.0 and 0.0 < inertia < np.inf else 0.0
    return radius if declared < HAIR * radius or all(x.node[0] == "const" for x in entries) else 0.0


def _square(a: Vec3, b: Vec3) -> Expr:
    """The square of a distance, exactly 0 where it is rounding of the places."""
    apart = rounded_vector(vec.sub(a, b), size_of(a, b))
    return vec.dot(apart, apart)
