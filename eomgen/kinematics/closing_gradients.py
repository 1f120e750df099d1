"""Stage kinematics: a cut joint -> by how much its equations change when S moves against P; rows of C_q from that.

Where chains in space are long, a row from the axes and places of their joints (Jain, Robot and Multibody Dynamics
(2011), ch. 11) takes less than differentiating the products of their rotations: the twist of each joint, seen at the
cut joint, times the wrench by which the equation acts there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ..describe.mechanism import JointSpec
from ..graph import vectors as vec
from ..graph.core import Expr, Graph
from ..graph.count import count
from ..graph.differentiate import jacobian
from ..graph.substitute import substitute
from ..graph.vectors import Mat3, Vec3
from ..records import dataclass
from .angle_sums import Turns
from .kinematics import Kinematics

#: Rows by twists are taken where they and the constraints are shorter than this times those of derivatives.
SHORTER = 0.9
COMMON = ("r_x", "r_y", "r_z")  #: rows along axes that both chains share (see close_loop)


@dataclass(frozen=True)
class ClosingGradients:
    """Equations and coordinates of a cut joint: labels, and dC = force . dr + moment . dtheta, P axes, at S.

    ``common`` tells that the rows of the place are along common axes, not along P's.
    """

    labels: tuple[str, ...]
    gradients: tuple[tuple[Vec3, Vec3], ...]  #: of the equations, then of the coordinates
    common: bool
    in_turns: bool


class PoseEquations(NamedTuple):
    """Equations, then coordinates, of a cut joint as functions of symbols for its relative pose, and what these are."""

    labels: tuple[str, ...]
    expressions: list[Expr]
    rotation: Mat3
    position: Vec3
    turn: Expr
    true: dict[Expr, Expr]
    in_turns: bool


def pose_equations(kinematics: Kinematics, spec: JointSpec) -> PoseEquations:
    """The equations of a cut joint with its relative pose not put in."""
    graph, poses = kinematics.graph, kinematics.poses
    pose = poses.relative(spec.predecessor, spec.successor)
    rotation, position = pose.rotation, pose.position
    R, r = pose_symbols(graph, "")
    turn = graph.symbol("turn(z)")
    angles = [k for k, coordinate in enumerate(spec.joint.coordinates) if coordinate.kind == "angle"]
    turns = turns_about_z(kinematics, spec)
    if turns is None:
        rows = spec.joint.closure(graph, R, r)
    else:
        rows = spec.joint.closure_in_turns(graph, R, r, turn)
    measured = spec.joint.measure(graph, R, r)
    if turns is not None:
        measured[angles[0]] = turn
    true = put_pose(R, r, rotation, position) | ({turn: turns[0]} if turns is not None else {})
    expressions = [*(row.expression for row in rows), *measured]
    return PoseEquations(tuple(row.label for row in rows), expressions, R, r, turn, true, turns is not None)


def turns_about_z(kinematics: Kinematics, spec: JointSpec) -> Turns | None:
    """What :meth:`.tree.Poses.turns` finds of a cut joint with one angle."""
    if sum(coordinate.kind == "angle" for coordinate in spec.joint.coordinates) != 1:
        return None
    rotation = kinematics.poses.relative(spec.predecessor, spec.successor).rotation
    return kinematics.poses.turns(rotation, kinematics.q)


def pose_symbols(graph: Graph, of: str) -> tuple[Mat3, Vec3]:
    """Symbols for a rotation and a place, or for rates of them."""
    R = tuple(tuple(graph.symbol(f"R{of}({i},{k})") for k in range(3)) for i in range(3))
    return R, tuple(graph.symbol(f"r{of}({i})") for i in range(3))  # type: ignore[return-value]


def put_pose(R: Mat3, r: Vec3, rotation: Mat3, position: Vec3) -> dict[Expr, Expr]:
    """Symbols -> values."""
    values = [*(x for row in rotation for x in row), *position]
    return dict(zip([*(x for row in R for x in row), *r], values, strict=True))


def closing_gradients(kinematics: Kinematics, spec: JointSpec) -> ClosingGradients:
    """Differentiate the equations of a cut joint by its relative pose."""
    graph = kinematics.graph
    labels, expressions, R, r, turn, true, in_turns = pose_equations(kinematics, spec)
    entries = jacobian(expressions, [*r, *(R[i][k] for k in range(3) for i in range(3)), turn])
    gradients: list[tuple[Vec3, Vec3]] = []
    for k in range(len(expressions)):
        d = [entries.get((k, j), graph.zero) for j in range(13)]
        moment = (graph.zero, graph.zero, d[12])
        for c in range(3):  # a column of R turns by theta x column
            column = (R[0][c], R[1][c], R[2][c])
            moment = vec.add(moment, vec.cross(column, (d[3 + 3 * c], d[4 + 3 * c], d[5 + 3 * c])))
        x = substitute([d[0], d[1], d[2], *moment], true)
        gradients.append(((x[0], x[1], x[2]), (x[3], x[4], x[5])))
    return ClosingGradients(labels, tuple(gradients), set(labels).issuperset(COMMON), in_turns)


def shortest_rows(kinematics: Kinematics) -> tuple[tuple[Expr, ...], ...]:
    """C_q (m, n), with the rows of cut joints by twists where that is shorter."""
    c = kinematics.constraints
    if kinematics.given_rates or not c.values or not kinematics.topology.cut:
        return c.jacobian
    found = {label: row for k in kinematics.topology.cut for label, row in twist_rows(kinematics, k).items()}
    if not found:
        return c.jacobian
    zero = kinematics.graph.zero
    rows = tuple(
        tuple(zero if x.is_zero else other for x, other in zip(row, found.get(label, row), strict=True))
        for label, row in zip(c.labels, c.jacobian, strict=True)
    )
    shorter = _operations([*c.values, *_flat(rows)]) < SHORTER * _operations([*c.values, *_flat(c.jacobian)])
    return rows if shorter else c.jacobian


def _flat(rows: Sequence[Sequence[Expr]]) -> list[Expr]:
    return [x for row in rows for x in row]


def _operations(outputs: Sequence[Expr]) -> int:
    return count(outputs).total


def twist_rows(kinematics: Kinematics, cut: int) -> dict[str, tuple[Expr, ...]]:
    """Rows of a cut joint by their labels; none of one whose loop lies in a plane, where derivatives are sums."""
    graph, poses, spec = kinematics.graph, kinematics.poses, kinematics.mechanism.joints[cut]
    if turns_about_z(kinematics, spec) is not None:
        return {}
    base, within = poses.between(spec.predecessor, spec.successor)
    closing = closing_gradients(kinematics, spec)
    outer, inner = poses.pair(spec.predecessor, spec.successor)
    rows = {}
    for label, (push, turn) in zip(closing.labels, closing.gradients, strict=False):
        common = closing.common and label in COMMON
        force, moment = vec.times(outer.rotation, push), vec.times(outer.rotation, turn)
        if common:
            force, moment = vec.identity(graph)[COMMON.index(label)], vec.zero(graph)
        row = [graph.zero] * len(kinematics.v)
        for marker, point, sign in (
            (spec.successor, inner.position, 1.0),
            (spec.predecessor, outer.position if common else inner.position, -1.0),
        ):
            for k in graph.marked(poses.ancestors(poses.link_of[marker.body])):
                if k == base:
                    break
                link, frame = poses.links[k], poses.link(k, base, within)
                felt = vec.add(moment, vec.cross(vec.sub(point, frame.position), force))
                for c, (angular, linear) in enumerate(link.columns):
                    entry = vec.dot(vec.times(frame.rotation, angular), felt)
                    entry = entry + vec.dot(vec.times(frame.rotation, linear), force)
                    row[link.first + c] = row[link.first + c] + (entry if sign > 0 else -entry)
        rows[f"{spec.name}.{label}"] = tuple(row)
    return rows
