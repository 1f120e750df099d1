"""Stage kinematics: Mechanism -> Topology, the spanning tree and the joints that close loops.

Which joint of a loop is cut: never one with a chosen independent coordinate if that can be helped; one whose
coordinates the user did not name (and does not drive, and whose angular velocity they did not give) before one they
named; among equals the one that leaves the shortest chains; then the last declared.  Pure constraints (a rod) are
always cut, joints that cannot be cut (a point on a curve) never.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from ..constraints import CoordinateDriver
from ..describe.checks import UNHELD
from ..describe.mechanism import JointSpec, Mechanism
from ..errors import ModelError
from ..frames import GROUND
from ..records import dataclass


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


def _cycle(joints: Sequence[JointSpec], branches: Sequence[Branch], cut: int) -> list[int]:
    """Tree joints on the loop that joint ``cut`` closes."""
    above = {b.body: b for b in branches}

    def chain(body: int) -> list[int]:
        result = []
        while body != GROUND:
            result.append(above[body].joint)
            body = above[body].parent
        return result

    a, b = (chain(end) for end in _ends(joints[cut]))
    return sorted(set(a) ^ set(b))


def _length(branches: Sequence[Branch]) -> int:
    """Sum over bodies of the number of joints to ground."""
    depth = {GROUND: 0}
    for b in branches:
        depth[b.body] = depth[b.parent] + 1
    return sum(depth.values())


def _check_tree(mechanism: Mechanism, tree: Collection[int], branches: Sequence[Branch]) -> None:
    problems = []
    for k, spec in enumerate(mechanism.joints):
        if spec.joint.role == "tree" and k not in tree:
            message = f"a {spec.joint.type_name} joint cannot close a loop, and all joints of its loop are of that kind"
            remedy = "use another type for one joint of the loop"
            problems.append(mechanism.problem(f"joints.{spec.name}", message, remedy))
    held = {branch.body for branch in branches}
    for k, body in enumerate(mechanism.bodies):
        if k not in held:
            problems.append(mechanism.problem(f"bodies.{body.name}", *UNHELD))
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
    improved = True
    while improved:
        improved = False
        for cut in sorted(set(range(len(joints))) - tree):
            best = (_length(branches), -cut)
            swap = None
            for other in _cycle(joints, branches, cut):
                if rank[other] != rank[cut]:
                    continue
                candidate = _walk(n, joints, tree - {other} | {cut})
                score = (_length(candidate), -other)
                if score < best:
                    best, swap = score, other
            if swap is not None:
                tree = tree - {swap} | {cut}
                branches = _walk(n, joints, tree)
                improved = True
    return Topology(tuple(branches), tuple(sorted(set(range(len(joints))) - tree)))
