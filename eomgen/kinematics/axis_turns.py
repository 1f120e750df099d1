"""Stage kinematics: joints whose frames may be turned about their axis -> how far, so that most constants are 0.

What a joint lets free about and along its z axis alone does not change if both of its markers turn about z by the same
angle.  Along which direction x then lies is chosen for the link: along an arm, a hinge's axis or an axis of the parent.
Without that, mechanisms that lie obliquely in ground carry three components where straight ones carry two.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..base.limits.numbers import ROUNDED
from ..describe.mechanism import Mechanism
from ..frames import Frame, Marker
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.vectors import Mat3
from .topology import Branch, Topology

#: What an entry costs that is neither 0, nor 1 in its own place, also one of a centre of mass, which enters no equation
#: of loops; an exchange of axes is nearly free.
MULTIPLIED, OF_CENTRE, EXCHANGED = 1.0, 0.5, 0.1


class _Seen(NamedTuple):
    """What becomes shorter in good axes: arms to joints as parts of their size, and axes of joints."""

    lengths: list[np.ndarray]
    centres: list[np.ndarray]  #: as lengths, to centres of mass
    axes: list[np.ndarray]


class AxisTurns:
    """The turns of a mechanism's joints, from ground outwards.

    Only links beyond an axis that is oblique in its parent's link frame are turned, those whose constants are numbers.
    Nothing is turned where no joint closes a loop.

    Parameters
    ----------
    mechanism : Mechanism
    topology : Topology
    symbols : mapping of str to Expr
        The coordinates of the tree by name.
    """

    def __init__(self, mechanism: Mechanism, topology: Topology, symbols: Mapping[str, Expr]) -> None:
        self.mechanism, self.topology, self.symbols = mechanism, topology, symbols
        self._open: set[int] = set()  # bodies beyond an oblique axis

    def turned(self, branch: Branch, holder: Mat3, inner: Frame) -> Mat3 | None:
        """The rotation about z by which both markers of a joint turn; None for none.

        Parameters
        ----------
        branch : Branch
            The joint in the tree.
        holder : Mat3
            Its marker on the parent, in the parent's link frame.
        inner : Frame
            Its marker on the body.
        """
        if not self.topology.cut:
            return None
        H, F = numbers(holder), numbers(inner.rotation)
        if H is None or F is None or not self._symmetric(branch):
            return None
        if branch.parent not in self._open and np.count_nonzero(np.abs(H[:, 2]) > ROUNDED) < 2:
            return None
        self._open.add(branch.body)
        seen = _Seen([], [], [])
        self._look(branch, np.eye(3), seen)
        angles = {0.0}
        for x, y in (tuple(v[:2].tolist()) for v in (*seen.lengths, *seen.centres, *seen.axes, *H)):
            if math.hypot(x, y) > ROUNDED:
                angles |= {math.remainder(math.atan2(y, x) + k * math.pi / 2, 2 * math.pi) for k in range(4)}
        costs = {a: _cost(a, H, seen) for a in angles}
        best = min(angles, key=lambda a: (round(costs[a], 3), abs(a)))
        if costs[0.0] - costs[best] < MULTIPLIED / 2:
            return None
        graph = self.mechanism.graph
        c, s = graph.constant(math.cos(best)), graph.constant(math.sin(best))
        return ((c, -s, graph.zero), (s, c, graph.zero), (graph.zero, graph.zero, graph.one))

    def _look(self, branch: Branch, axes: np.ndarray, seen: _Seen) -> None:
        """Note the arms and axes of a link, and those of links on hinges parallel to its own, in common axes."""
        _, inner = self._ends(branch)
        F, p = numbers(inner.frame.rotation), numbers([inner.frame.position])
        if F is None or p is None:
            return
        points = [(seen.centres, self.mechanism.bodies[branch.body].com)]
        for marker in self._others[branch.body]:
            if marker is not inner:
                points.append((seen.lengths, marker.frame.position))
                if (R := numbers(marker.frame.rotation)) is not None:
                    seen.axes.append(axes @ F.T @ R[:, 2])
        for arms, point in points:
            if (x := numbers([point])) is not None and (size := np.abs(x).max() + np.abs(p).max()):
                arm = axes @ F.T @ (x - p)[0]
                arms.append(np.where(np.abs(arm) <= ROUNDED * size, 0.0, arm / size))
        for child in self._children.get(branch.body, ()):
            outer, _ = self._ends(child)
            R = numbers(outer.frame.rotation)
            if R is not None and abs((F.T @ R)[2, 2] - 1.0) <= ROUNDED and self._symmetric(child):
                self._look(child, axes @ F.T @ R, seen)

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
        found: dict[int, list[Marker]] = {}
        for spec in self.mechanism.joints:
            for marker in (spec.predecessor, spec.successor):
                found.setdefault(marker.body, []).append(marker)
        return found

    @cached_property
    def _children(self) -> dict[int, list[Branch]]:
        found: dict[int, list[Branch]] = {}
        for branch in self.topology.branches:
            found.setdefault(branch.parent, []).append(branch)
        return found


def turn_frame(frame: Frame, turn: Mat3) -> Frame:
    """The frame turned in itself."""
    return Frame(vec.product(frame.rotation, turn), frame.position)


def about_z(rotation: Mat3) -> bool:
    """Whether a rotation leaves the z axis alone."""
    others = (rotation[0][2], rotation[1][2], rotation[2][0], rotation[2][1])
    return rotation[2][2].value == 1.0 and all(x.is_zero for x in others)


def numbers(rows: Sequence[Sequence[Expr]]) -> np.ndarray | None:
    """Constant entries; None if one is not."""
    values = [[x.value for x in row] for row in rows]
    return None if any(x is None for row in values for x in row) else np.array(values, dtype=float)


def _cost(angle: float, H: np.ndarray, seen: _Seen) -> float:
    """How many constants stay that are multiplied with."""
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    cost = 0.0
    for weight, arms in ((MULTIPLIED, seen.lengths), (OF_CENTRE, seen.centres)):
        cost += weight * sum(np.count_nonzero(np.abs(turn.T @ x) > ROUNDED) for x in arms)
    for i, row in enumerate(H @ turn):
        for j, x in enumerate(row):
            cost += _entry(x, i == j)
    for x in seen.axes:
        cost += sum(_entry(y, i == 2) for i, y in enumerate(turn.T @ x))
    return cost


def _entry(x: float, own: bool) -> float:
    if abs(x) <= ROUNDED:
        return 0.0
    if abs(abs(x) - 1.0) <= ROUNDED:
        return 0.0 if own and x > 0 else EXCHANGED
    return MULTIPLIED
