"""Stage kinematics: Mechanism -> Topology, the spanning tree and the joints that close loops.

Which joint of a loop is cut: never one with a chosen independent coordinate if that can be helped; one whose
coordinates the user did not name (and does not drive, and whose angular velocity they did not give) before one they
named; in a loop of more than LONG joints the one with the most freedoms, since each equation of it is carried through
the whole loop; among equals the one that leaves the shortest chains; then the last declared.  Pure constraints (a rod)
are always cut, joints that cannot be cut (a point on a curve) never.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from ..constraints import CoordinateDriver
from ..describe.checks import UNHELD
from ..describe.mechanism import JointSpec, Mechanism
from ..errors import ModelError
from ..frames import GROUND
from ..records import dataclass

#: Joints of a loop above which equations count more than lengths of chains: forces and multipliers of long loops are
#: found by recursion over their bodies, whose work grows with the rows and not with the depth of the tree.
LONG = 32


@dataclass(frozen=True)
class Branch:
    """One tree joint: ``body`` hangs on ``parent`` (indices of bodies, GROUND) through joint number ``joint``."""

    body: int
    parent: int
    joint: int
    reversed: bool  #: the tree passes the joint from successor to predecessor


@dataclass(frozen=True)
class Topology:
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
        self.carried = dict.fromkeys(self.above, 1)  #: bodies that hang on each, itself included
        for b in reversed(branches):
            if b.parent != GROUND:
                self.carried[b.parent] += self.carried[b.body]

    def _down_to(self, body: int, top: int) -> list[int]:
        """Bodies on the way from below ``top`` to ``body``."""
        found = []
        while body != top:
            found.append(body)
            body = self.above[body].parent
        return found[::-1]

    def changes(self, cut: int) -> dict[int, int]:
        """By each tree joint on the loop that joint ``cut`` closes: how much longer all is if it is cut instead."""
        a, b = _ends(self.joints[cut])
        top, other = a, b
        while top != other:
            if self.depth[top] < self.depth[other]:
                top, other = other, top
            top = self.above[top].parent
        found: dict[int, int] = {}
        for here, there in ((a, b), (b, a)):
            side, far = self._down_to(here, top), self.depth[there]
            alone = [self.carried[x] for x in side]
            for k in range(len(side) - 1):
                alone[k] -= self.carried[side[k + 1]]
            change = 0
            for k in reversed(range(len(side))):  # what is below the joint of this body hangs on the other side then
                change += alone[k] * (far + len(side) - k - self.depth[side[k]])
                found[self.above[side[k]].joint] = change
        return found


def _check_tree(mechanism: Mechanism, tree: Collection[int], branches: Sequence[Branch]) -> None:
    problems = []
    for k, spec in enumerate(mechanism.joints):
        if spec.joint.role == "tree" and k not in tree:
            message = f"a {spec.joint.type_name} joint cannot close a loop, and all joints of its loop are of that kind"
            remedy = "use another type for one joint of the loop"
            problems.append(mechanism.problem(f"joints.{spec.name}", message, remedy, "EG-TOPOLOGY"))
    held = {branch.body for branch in branches}
    for k, body in enumerate(mechanism.bodies):
        if k not in held:
            problems.append(mechanism.problem(f"bodies.{body.name}", *UNHELD, code="EG-TOPOLOGY"))
    if problems:
        raise ModelError(problems)


def find_topology(mechanism: Mechanism, independent: Collection[str] = ()) -> Topology:
    """Choose the spanning tree.

    Parameters
    ----------
    mechanism : Mechanism
        Every body must be connected to ground (the description checks it).
    independent : names of coordinates
        Joints bearing one of these are kept in the tree first.

    Raises
    ------
    ModelError
        A loop has only joints that cannot be cut, or a body is held by pure constraints alone.
    """
    joints, n = mechanism.joints, len(mechanism.bodies)
    forest = _Forest(n)
    rates = {n for spec in joints for n, v in zip(spec.velocities, spec.joint.velocities, strict=True) if v.of is None}
    given = rates.intersection(mechanism.initial)
    given |= {str(c.coordinate.node[1]) for c in mechanism.constraints if isinstance(c, CoordinateDriver)}
    rank = [_rank(spec, independent, given) for spec in joints]
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
