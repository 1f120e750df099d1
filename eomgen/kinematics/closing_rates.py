"""Stage kinematics: cut joints -> what velocities alone make of C'', from the motion of both ends of the joint.

The motion of S against P at v' = 0 comes from two short recursions over the chains, in link axes as in the equations of
motion, whose angular velocities it shares.  Differentiating the products of rotations twice takes several times more
where chains in space are long.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ..describe.mechanism import JointSpec
from ..frames import Frame, Marker
from ..graph import vectors as vec
from ..graph.core import Expr, Graph
from ..graph.count import count
from ..graph.differentiate import jvp
from ..graph.substitute import substitute
from ..graph.tensors import skew
from ..graph.vectors import Mat3, Vec3
from .closing_gradients import COMMON, SHORTER, pose_equations, pose_symbols, put_pose, turns_about_z
from .joint_rates import JointRates, joint_rates
from .kinematics import Kinematics


class EndMotion(NamedTuple):
    """Motion of a marker against the base at v' = 0, in its own axes: as vectors, not as rates of components."""

    spin: Vec3
    velocity: Vec3
    spin_rate: Vec3
    acceleration: Vec3


def shortest_gamma(kinematics: Kinematics) -> tuple[Expr, ...]:
    """Gamma (m,), of cut joints by the motion of their ends where that is shorter."""
    c = kinematics.constraints
    if kinematics.given_rates or c.stabilised is not None or not c.values or not kinematics.topology.cut:
        return c.gamma
    found = end_gammas(kinematics)
    if not found:
        return c.gamma
    still = [rate.is_zero for rate in c.time_derivative]
    values = tuple(
        found[label] if label in found and fixed and not x.is_zero else x
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
    if turns_about_z(kinematics, spec) is not None:
        return {}
    labels, expressions, R, r, _, true, _ = pose_equations(kinematics, spec)
    first, second = _end(kinematics, rates, spec.predecessor, spec), _end(kinematics, rates, spec.successor, spec)
    (R_rate, r_rate), (R_second, r_second) = pose_symbols(graph, "'"), pose_symbols(graph, "''")
    along = put_pose(R, r, R_rate, r_rate)
    change = jvp(expressions[: len(labels)], along)
    bent = jvp(change, along | put_pose(R_rate, r_rate, R_second, r_second))
    pose = poses.relative(spec.predecessor, spec.successor)
    moved = _relative(graph, pose.rotation, pose.position, first, second)
    values = true | put_pose(R_rate, r_rate, *moved[:2]) | put_pose(R_second, r_second, *moved[2:])
    found = dict(zip(labels, substitute(bent, values), strict=True))
    if found.keys() >= set(COMMON):  # these are along axes that both chains share
        outer, inner = poses.pair(spec.predecessor, spec.successor)
        gap = vec.sub(vec.times(inner.rotation, second.acceleration), vec.times(outer.rotation, first.acceleration))
        found.update(zip(COMMON, gap, strict=True))
    return {f"{spec.name}.{label}": x for label, x in found.items()}


def _end(kinematics: Kinematics, rates: Sequence[JointRates], marker: Marker, spec: JointSpec) -> EndMotion:
    """Motion of a marker of a cut joint against the nearest link that carries both."""
    graph, poses = kinematics.graph, kinematics.poses
    base = poses.common(spec.predecessor, spec.successor)
    chain = poses.ancestors(poses.link_of[marker.body])
    spin = velocity = spin_rate = acceleration = vec.zero(graph)
    two = graph.constant(2.0)
    for k in graph.marked(reversed(chain[: chain.index(base)])):
        link, rate = poses.links[k], rates[k]
        # as the equations of motion have it: below is omega_p x r + 2 r'
        below = vec.add(vec.cross(spin, link.position), vec.scale(two, rate.slide))
        product = link.down(vec.add(vec.cross(spin, below), rate.slide_rate))
        turned = vec.add(rate.spin_rate, vec.cross(link.down(spin), rate.spin))
        carried = link.down_twist((spin_rate, acceleration))
        spin_rate, acceleration = vec.add(carried[0], turned), vec.add(carried[1], product)
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
