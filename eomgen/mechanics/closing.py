"""Cut joints -> rows of C_q, and what velocities alone make of C''."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ..elements.frames import Frame, Marker
from ..expr import vectors as vec
from ..expr.core import Expr, Graph, substitute
from ..expr.differentiate import jacobian, jvp
from ..expr.records import Record
from ..expr.schedule import count
from ..expr.spatial import add
from ..expr.tensors import skew
from ..expr.vectors import Mat3, Vec3
from ..model.mechanism import JointSpec
from .kinematics import Kinematics, joint_rates
from .loops import closing_equations, turns_about_z
from .tree import JointRates

# -- rows of C_q -------------------------------------------------------------------------------------------------------

# Where chains in space are long, a row from the axes and places of their joints (Jain, Robot and Multibody Dynamics
# (2011), ch. 11) takes less than differentiating the products of their rotations: the twist of each joint, seen at the
# cut joint, times the wrench by which the equation acts there.


#: Rows by twists are taken where they and the constraints are shorter than this times those of derivatives.
SHORTER = 0.9
COMMON = ("r_x", "r_y", "r_z")  #: rows along axes that both chains share (see close_loop)


class ClosingGradients(Record):
    """Equations and coordinates of a cut joint: labels, and dC = force . dr + moment . dtheta, P axes, at S.

    ``common`` tells that the rows of the place are along common axes, not along P's.
    """

    labels: tuple[str, ...]
    gradients: tuple[tuple[Vec3, Vec3], ...]  #: of the equations, then of the coordinates
    common: bool


class PoseEquations(NamedTuple):
    """Equations, then coordinates, of a cut joint as functions of symbols for its relative pose, and what these are."""

    labels: tuple[str, ...]
    expressions: list[Expr]
    rotation: Mat3
    position: Vec3
    turn: Expr
    true: dict[Expr, Expr]


def pose_equations(kinematics: Kinematics, spec: JointSpec) -> PoseEquations:
    """The equations of a cut joint with its relative pose not put in."""
    pose = kinematics.poses.relative(spec.predecessor, spec.successor)
    R, r = pose_symbols(kinematics.graph, "")
    turn = kinematics.graph.symbol("turn(z)")
    turns = turns_about_z(spec, kinematics.poses, kinematics.q)
    rows, measured = closing_equations(spec, Frame(R, r), None if turns is None else turn)
    true = put_pose(R, r, pose.rotation, pose.position) | ({} if turns is None else {turn: turns[0]})
    expressions = [*(row.expression for row in rows), *measured]
    return PoseEquations(tuple(row.label for row in rows), expressions, R, r, turn, true)


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
    labels, expressions, R, r, turn, true = pose_equations(kinematics, spec)
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
    return ClosingGradients(labels, tuple(gradients), set(labels).issuperset(COMMON))


def shortest_rows(kinematics: Kinematics) -> tuple[tuple[Expr, ...], ...]:
    """C_q (m, n), with the rows of cut joints by twists where that is shorter."""
    c = kinematics.constraints
    if kinematics.general_rates or not c.values or not kinematics.topology.cut:
        return c.jacobian
    result = {label: row for k in kinematics.topology.cut for label, row in twist_rows(kinematics, k).items()}
    if not result:
        return c.jacobian
    zero = kinematics.graph.zero
    rows = tuple(
        tuple(zero if x.is_zero else other for x, other in zip(row, result.get(label, row), strict=True))
        for label, row in zip(c.labels, c.jacobian, strict=True)
    )
    new, old = (count([*c.values, *(x for row in some for x in row)]).total for some in (rows, c.jacobian))
    return rows if new < SHORTER * old else c.jacobian


def twist_rows(kinematics: Kinematics, cut: int) -> dict[str, tuple[Expr, ...]]:
    """Rows of a cut joint by their labels; none of one whose loop lies in a plane, where derivatives are sums."""
    graph, poses, spec = kinematics.graph, kinematics.poses, kinematics.mechanism.joints[cut]
    if turns_about_z(spec, poses, kinematics.q) is not None:
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


# -- terms of velocities -----------------------------------------------------------------------------------------------

# The motion of S against P at v' = 0 comes from two short recursions over the chains, in link axes as in the equations
# of motion, whose angular velocities it shares. Differentiating the products of rotations twice takes several times
# more where chains in space are long.


class EndMotion(NamedTuple):
    """Motion of a marker against the base at v' = 0, in its own axes: as vectors, not as rates of components."""

    spin: Vec3
    velocity: Vec3
    spin_rate: Vec3
    acceleration: Vec3


def shortest_gamma(kinematics: Kinematics) -> tuple[Expr, ...]:
    """Gamma (m,), of cut joints by the motion of their ends where that is shorter."""
    c = kinematics.constraints
    if kinematics.general_rates or c.stabilised is not None or not c.values or not kinematics.topology.cut:
        return c.gamma
    result = end_gammas(kinematics)
    if not result:
        return c.gamma
    still = [rate.is_zero for rate in c.time_derivative]
    values = tuple(
        result[label] if label in result and fixed and not x.is_zero else x
        for label, x, fixed in zip(c.labels, c.gamma, still, strict=True)
    )
    shared = [*c.values, *(x for omega, _ in kinematics.twists for x in omega)]
    shorter = count([*shared, *values]).total < SHORTER * count([*shared, *c.gamma]).total
    return values if shorter else c.gamma


def end_gammas(kinematics: Kinematics) -> dict[str, Expr]:
    """Gamma of the rows of cut joints by their labels, of those whose loops do not lie in a plane."""
    rates = joint_rates(kinematics)
    return {label: x for k in kinematics.topology.cut for label, x in _gamma(kinematics, rates, k).items()}


def _gamma(kinematics: Kinematics, rates: Sequence[JointRates], cut: int) -> dict[str, Expr]:
    """Gamma of the rows of a cut joint by their labels; none of one whose loop lies in a plane."""
    graph, poses, spec = kinematics.graph, kinematics.poses, kinematics.mechanism.joints[cut]
    if turns_about_z(spec, poses, kinematics.q) is not None:
        return {}
    labels, expressions, R, r, _, true = pose_equations(kinematics, spec)
    first, second = _end(kinematics, rates, spec.predecessor, spec), _end(kinematics, rates, spec.successor, spec)
    (R_rate, r_rate), (R_second, r_second) = pose_symbols(graph, "'"), pose_symbols(graph, "''")
    along = put_pose(R, r, R_rate, r_rate)
    change = jvp(expressions[: len(labels)], along)
    bent = jvp(change, along | put_pose(R_rate, r_rate, R_second, r_second))
    pose = poses.relative(spec.predecessor, spec.successor)
    moved = _relative(graph, pose.rotation, pose.position, first, second)
    values = true | put_pose(R_rate, r_rate, *moved[:2]) | put_pose(R_second, r_second, *moved[2:])
    result = dict(zip(labels, substitute(bent, values), strict=True))
    if result.keys() >= set(COMMON):  # these are along axes that both chains share
        outer, inner = poses.pair(spec.predecessor, spec.successor)
        gap = vec.sub(vec.times(inner.rotation, second.acceleration), vec.times(outer.rotation, first.acceleration))
        result.update(zip(COMMON, gap, strict=True))
    return {f"{spec.name}.{label}": x for label, x in result.items()}


def _end(kinematics: Kinematics, rates: Sequence[JointRates], marker: Marker, spec: JointSpec) -> EndMotion:
    """Motion of a marker of a cut joint against the nearest link that carries both."""
    graph, poses = kinematics.graph, kinematics.poses
    base = poses.common(spec.predecessor, spec.successor)
    chain = poses.ancestors(poses.link_of[marker.body])
    spin = velocity = spin_rate = acceleration = vec.zero(graph)
    for k in graph.marked(reversed(chain[: chain.index(base)])):
        link, rate = poses.links[k], rates[k]
        spin_rate, acceleration = add(link.down_twist((spin_rate, acceleration)), rate.product(link, spin))
        spin, velocity = link.down_twist((spin, velocity))
        for c, (angular, linear) in enumerate(link.columns):
            speed = kinematics.v[link.first + c]
            spin, velocity = vec.add(spin, vec.scale(speed, angular)), vec.add(velocity, vec.scale(speed, linear))
    place = poses.marker_in_link(marker)
    return _at_marker(place, EndMotion(spin, velocity, spin_rate, acceleration))


def _at_marker(place: Frame, motion: EndMotion) -> EndMotion:
    """Of a link's origin in link axes -> of a marker of the link in its axes."""
    spin, velocity, spin_rate, acceleration = motion
    arm = place.position
    moving = vec.add(velocity, vec.cross(spin, arm))
    bent = vec.add(acceleration, vec.add(vec.cross(spin_rate, arm), vec.cross(spin, vec.cross(spin, arm))))
    return EndMotion(*(vec.transpose_times(place.rotation, x) for x in (spin, moving, spin_rate, bent)))


def _relative(graph: Graph, R: Mat3, r: Vec3, first: EndMotion, second: EndMotion) -> tuple[Mat3, Vec3, Mat3, Vec3]:
    """Rates and second rates of the rotation and the place of S in P axes."""
    spin_p = vec.transpose_times(R, first.spin)
    spin = vec.sub(second.spin, spin_p)
    changed = vec.sub(second.spin_rate, vec.transpose_times(R, first.spin_rate))
    bent = vec.add(changed, vec.cross(spin, spin_p))
    R_rate = vec.product(R, skew(spin))
    R_second = tuple(
        vec.add(a, b) for a, b in zip(vec.product(R_rate, skew(spin)), vec.product(R, skew(bent)), strict=True)
    )
    r_rate = vec.sub(vec.sub(vec.times(R, second.velocity), first.velocity), vec.cross(first.spin, r))
    inertial = vec.sub(vec.times(R, second.acceleration), first.acceleration)
    turning = vec.add(vec.cross(first.spin_rate, r), vec.cross(first.spin, vec.cross(first.spin, r)))
    coriolis = vec.scale(graph.constant(2.0), vec.cross(first.spin, r_rate))
    return R_rate, r_rate, R_second, vec.sub(inertial, vec.add(turning, coriolis))  # type: ignore[return-value]
