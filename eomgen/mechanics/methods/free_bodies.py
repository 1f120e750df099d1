"""Kinematics -> the equations of motion of every body set free, reactions of all joints as unknowns.

Spatial accelerations and wrenches in link axes (Featherstone, RBDA, ch. 2): the rates of the components of a twist in
body axes, so that A_k = X A_p + S a + S' v + V_k x S v, and I A_k + V_k x* I V_k is the sum of all wrenches on body k.
"""

from __future__ import annotations

from collections.abc import Sequence

from ...elements.frames import GROUND, Frame
from ...expr import vectors as vec
from ...expr.core import Expr, substitute
from ...expr.differentiate import hessian, jacobian, jvp
from ...expr.records import Record
from ...expr.spatial import Twist, Wrench, add, cross_motion, cross_wrench, dot, scaled, sub
from ...expr.tensors import combined, skew, solve_symmetric
from ...expr.vectors import Rows
from ...model.mechanism import JointSpec
from .. import Kinematics
from ..closing import pose_symbols, put_pose
from ..constraint_functions import Units
from ..wrenches import applied_wrenches, coordinate_forces, drive_inertias, kinetic_energy, potential_energy
from .recursions import along_joints
from .tree_equations import LinearSystem, TreeEquations, linear_system


def seen_from(frame: Frame, twist: Twist) -> Twist:
    """A twist at the origin of a frame's holder, at the frame and in its axes."""
    angular, linear = twist
    moved = vec.add(linear, vec.cross(angular, frame.position))
    return vec.transpose_times(frame.rotation, angular), vec.transpose_times(frame.rotation, moved)


def wrench_at(frame: Frame, wrench: Wrench) -> Wrench:
    """A wrench at a frame, about the origin of its holder and in the holder's axes."""
    turn, push = (vec.times(frame.rotation, x) for x in wrench)
    return vec.add(turn, vec.cross(frame.position, push)), push


class FreeBodies:
    """What every body and joint contributes, beside the unknowns; lists run over the links.

    Attributes
    ----------
    products : accelerations relative to the parent at a = 0, S' v + V x S v
    loads : I A at A = 0: V x* I V less the wrenches of the force elements
    forces : (n_v,) generalized forces of force elements along coordinates of the tree
    drives : inertias of drives by the index of the velocity
    """

    def __init__(self, kinematics: Kinematics) -> None:
        self.kinematics = kinematics
        self.graph = kinematics.graph
        self.base: Twist = vec.zero(self.graph), vec.neg(kinematics.mechanism.gravity)
        self.products = self._products()
        self.loads = []
        for link, twist, applied in zip(kinematics.links, kinematics.twists, applied_wrenches(kinematics), strict=True):
            self.loads.append(sub(cross_wrench(twist, link.spatial.times(*twist)), applied))
        self.forces = [self.graph.zero] * len(kinematics.v)
        self.along_cut: dict[str, Expr] = {}
        place = {name: j for j, name in enumerate(kinematics.velocity_labels)}
        for load in (load for terms in kinematics.forces for load in terms.coordinate_loads):
            if load.coordinate in place:
                self.forces[place[load.coordinate]] = self.forces[place[load.coordinate]] + load.value
            else:
                self.along_cut[load.coordinate] = self.along_cut.get(load.coordinate, self.graph.zero) + load.value
        self.drives = drive_inertias(kinematics)

    def _products(self) -> list[Twist]:
        kinematics = self.kinematics
        columns = [x for link in kinematics.links for column in link.columns for part in column for x in part]
        flows = jvp(columns, kinematics.q_dot_direction | kinematics.time_direction)
        result: list[Twist] = []
        at = 0
        for link, twist in zip(kinematics.links, kinematics.twists, strict=True):
            relative = change = (vec.zero(self.graph), vec.zero(self.graph))
            for c, column in enumerate(link.columns):
                rate = kinematics.v[link.first + c]
                six = flows[at : at + 6]
                relative = add(relative, scaled(rate, column))
                change = add(change, scaled(rate, ((six[0], six[1], six[2]), (six[3], six[4], six[5]))))
                at += 6
            result.append(add(change, cross_motion(twist, relative)))
        return result

    def relative(self, k: int, motions: Sequence[Twist]) -> Twist:
        """Acceleration of link k less what the parent's and the velocities make of it: S a."""
        link = self.kinematics.links[k]
        above = motions[link.parent] if link.parent != GROUND else self.base
        return sub(sub(motions[k], link.down_twist(above)), self.products[k])

    def balances(self, motions: Sequence[Twist], reactions: Sequence[Wrench]) -> list[Wrench]:
        """I A + V x* I V less all wrenches on each body; a reaction acts on its link and back on the parent."""
        links = self.kinematics.links
        result = [
            sub(add(link.spatial.times(*motion), load), reaction)
            for link, motion, load, reaction in zip(links, motions, self.loads, reactions, strict=True)
        ]
        for link, reaction in zip(links, reactions, strict=True):
            if link.parent != GROUND:
                result[link.parent] = add(result[link.parent], link.lift(reaction))
        return result

    def powers(self, k: int, reaction: Wrench, a: Sequence[Expr], pulls: Sequence[Expr]) -> list[Expr]:
        """S^T f of joint k less the forces along its coordinates, of drives and (``pulls``) of couplings too."""
        link = self.kinematics.links[k]
        result = []
        for c, column in enumerate(link.columns):
            j = link.first + c
            rest = self.forces[j] - pulls[j]
            if j in self.drives:
                rest = rest - self.drives[j] * a[j]
            result.append(dot(column, reaction) - rest)
        return result

    @property
    def couplings(self) -> list[int]:
        """The constraint rows that are not those of cut joints."""
        c = self.kinematics.constraints
        return [i for i, label in enumerate(c.labels) if label in self.kinematics.coupled]


class FreeBodyCut(Record):
    """A cut joint between two bodies: rows W of C' = W V with V the twist of S relative to P, in S axes at S."""

    outer: int  #: link of the predecessor, GROUND for ground
    inner: int
    holder: Frame  #: marker P in its link
    marker: Frame  #: marker S in its link
    pose: Frame  #: S in P
    rows: Rows  #: (closure equations, then measured coordinates; 6)
    rest: tuple[Expr, ...]  #: C'' less W times the rate of V
    kinds: tuple[str, ...]  #: 'length' or 'angle' for each closure equation
    bend: Twist  #: what relative motion adds to the rate of V
    loads: tuple[Expr, ...]  #: along the measured coordinates
    inertia: Expr | None  #: of the drive on the first of them

    @property
    def closing(self) -> int:
        """Number of closure equations."""
        return len(self.kinds)

    def accelerations(self, motions: Sequence[Twist], base: Twist) -> list[Expr]:
        """C'' and y'' in terms of the accelerations of the links."""
        first, second = (motions[k] if k != GROUND else base for k in (self.outer, self.inner))
        above = seen_from(self.pose, seen_from(self.holder, first))
        relative = add(sub(seen_from(self.marker, second), above), self.bend)
        six = [*relative[0], *relative[1]]
        return [combined(rest, row, six) for row, rest in zip(self.rows, self.rest, strict=True)]

    def push(self, balances: list[Wrench], multipliers: Sequence[Expr], accelerations: Sequence[Expr]) -> None:
        """Take the joint's wrench, -W^T multipliers and its loads, off the balances of its two bodies."""
        weights = [*multipliers, *(-x for x in self.loads)]
        if self.inertia is not None:
            weights[self.closing] = weights[self.closing] + self.inertia * accelerations[self.closing]
        zero = self.rows[0][0].graph.zero if self.rows else None
        if zero is None:
            return
        six = [zero] * 6
        for row, weight in zip(self.rows, weights, strict=True):
            six = [f + entry * weight for f, entry in zip(six, row, strict=True)]
        wrench = (six[0], six[1], six[2]), (six[3], six[4], six[5])
        if self.inner != GROUND:
            balances[self.inner] = add(balances[self.inner], wrench_at(self.marker, wrench))
        if self.outer != GROUND:
            transferred = wrench_at(self.holder, wrench_at(self.pose, wrench))
            balances[self.outer] = sub(balances[self.outer], transferred)


def cut_joints(bodies: FreeBodies) -> list[FreeBodyCut]:
    """The joints that close loops, as constraints between two free bodies."""
    kinematics = bodies.kinematics
    return [_cut(bodies, kinematics.mechanism.joints[k]) for k in kinematics.topology.cut]


def _cut(bodies: FreeBodies, spec: JointSpec) -> FreeBodyCut:
    kinematics, graph = bodies.kinematics, bodies.graph
    poses = kinematics.poses
    pose = poses.relative(spec.predecessor, spec.successor)
    links = [poses.link_of[m.body] for m in (spec.predecessor, spec.successor)]
    holder, marker = (poses.marker_in_link(m) for m in (spec.predecessor, spec.successor))
    first, second = (_twist(kinematics, m, k) for m, k in zip((holder, marker), links, strict=True))
    above = seen_from(pose, first)
    relative = sub(second, above)
    measured = any(name in bodies.along_cut for name in spec.coordinates) or spec.armature is not None
    kinds, rows, rest = _differentiate(bodies, spec, pose, relative, measured)
    return FreeBodyCut(
        outer=links[0],
        inner=links[1],
        holder=holder,
        marker=marker,
        pose=pose,
        rows=rows,
        rest=rest,
        kinds=kinds,
        bend=cross_motion(relative, above),
        loads=tuple(bodies.along_cut.get(name, graph.zero) for name in spec.coordinates) if measured else (),
        inertia=spec.armature,
    )


def _twist(kinematics: Kinematics, frame: Frame, link: int) -> Twist:
    still = (vec.zero(kinematics.graph), vec.zero(kinematics.graph))
    return seen_from(frame, kinematics.twists[link]) if link != GROUND else still


def _differentiate(
    bodies: FreeBodies, spec: JointSpec, pose: Frame, relative: Twist, measured: bool
) -> tuple[tuple[str, ...], Rows, tuple[Expr, ...]]:
    """W and W' V of the closure equations, and of the coordinates if they are needed, as functions of the pose.

    R' = R [omega] and p' = R v for a twist (omega, v) in S axes.
    """
    graph = bodies.graph
    R, p = pose_symbols(graph, "")
    twist = [graph.symbol(f"V[{i}]") for i in range(6)]
    cross = skew((twist[0], twist[1], twist[2]))
    flow = put_pose(R, p, vec.product(R, cross), vec.times(R, (twist[3], twist[4], twist[5])))
    closure = spec.joint.closure(graph, R, p)
    values = [c.expression for c in closure] + (spec.joint.measure(graph, R, p) if measured else [])
    rates = jvp(values, flow)
    entries = jacobian(rates, twist)
    flat = [entries.get((i, j), graph.zero) for i in range(len(values)) for j in range(6)]
    here = put_pose(R, p, pose.rotation, pose.position) | dict(zip(twist, (*relative[0], *relative[1]), strict=True))
    result = substitute([*flat, *jvp(rates, flow)], here)
    rows = tuple(tuple(result[6 * i : 6 * i + 6]) for i in range(len(values)))
    return tuple(c.kind for c in closure), rows, tuple(result[6 * len(values) :])


# -- free body system --------------------------------------------------------------------------------------------------

# M and h, which other calls of a module want, come from the same balances, summed from the tips inwards.


def free_body_equations(kinematics: Kinematics, method: str, with_joints: bool) -> TreeEquations:
    """The linear system of a method, with M, h and energies from the balances of the bodies.

    ``with_joints``: the accelerations of joint coordinates are unknowns too.
    """
    bodies = FreeBodies(kinematics)
    system = _system(bodies, with_joints)
    inverse = _inverse_dynamics(bodies)
    return TreeEquations(
        method=method,
        mass=hessian(inverse, kinematics.a),
        bias=tuple(substitute(inverse, dict.fromkeys(kinematics.a, bodies.graph.zero))),
        inverse_dynamics=tuple(inverse),
        kinetic_energy=kinetic_energy(kinematics),
        potential_energy=potential_energy(kinematics),
        system=system,
    )


def _system(bodies: FreeBodies, with_joints: bool) -> LinearSystem:
    kinematics = bodies.kinematics
    unknowns, units = Unknowns(kinematics), Units(kinematics)
    rates = [units.of(kind) for kind in kinematics.velocity_kinds]
    motions: list[Twist] = []
    reactions: list[Wrench] = []
    a: list[Expr] = []
    for link in kinematics.links:
        motions.append(unknowns.six(units.motion))
        if with_joints:
            a += unknowns.take(rates[link.first : link.first + len(link.columns)])
        reactions.append(unknowns.six(units.wrench))
    relative = [bodies.relative(k, motions) for k in range(len(motions))]
    if not with_joints:  # a = S^+ of the relative acceleration
        for link, motion in zip(kinematics.links, relative, strict=True):
            gram = [[dot(x, y) for y in link.columns] for x in link.columns]
            a += solve_symmetric(gram, [dot(column, motion) for column in link.columns])
    forces = Forces(bodies, cut_joints(bodies), unknowns, units)
    balances = bodies.balances(motions, reactions)
    closing = forces.close(balances, motions, a)
    residuals: list[Expr] = []
    sizes: list[Expr] = []
    for k, (link, balance, joint) in enumerate(zip(kinematics.links, balances, relative, strict=True)):
        along = range(link.first, link.first + len(link.columns))
        for j, column in zip(along, link.columns, strict=True):
            joint = sub(joint, scaled(a[j], column))
        powers = bodies.powers(k, reactions[k], a, forces.pulls)
        if not with_joints:
            # across the joint no relative acceleration, along it no force: parts of one vector, at right angles
            for j, column, power in zip(along, link.columns, powers, strict=True):
                joint = add(joint, scaled(power * (rates[j] * rates[j] / units.energy), column))
            powers = []
        residuals += [*joint[0], *joint[1], *powers, *balance[0], *balance[1]]
        sizes += [*units.motion, *(units.force[j] for j in along if with_joints), *units.wrench]
    return forces.solve(residuals, sizes, closing, a)


def _inverse_dynamics(bodies: FreeBodies) -> list[Expr]:
    """M a + h of the tree without drives: reactions from the balances, tips first, and their part along each joint."""
    kinematics, graph = bodies.kinematics, bodies.graph
    motions: list[Twist] = []
    for link, product in zip(kinematics.links, bodies.products, strict=True):
        motion = add(link.down_twist(motions[link.parent] if link.parent != GROUND else bodies.base), product)
        for c, column in enumerate(link.columns):
            motion = add(motion, scaled(kinematics.a[link.first + c], column))
        motions.append(motion)
    none: Wrench = vec.zero(graph), vec.zero(graph)
    wrenches = bodies.balances(motions, [none] * len(motions))
    return along_joints(kinematics.links, wrenches, coordinate_forces(kinematics))


class Unknowns:
    """Symbols z[0], z[1], ..., handed out in order, and their sizes."""

    def __init__(self, kinematics: Kinematics) -> None:
        self.graph = kinematics.graph
        self.symbols: list[Expr] = []
        self.sizes: list[Expr] = []

    def take(self, sizes: Sequence[Expr]) -> list[Expr]:
        """The next symbols, one of each size."""
        first = len(self.symbols)
        self.symbols += [self.graph.symbol(f"z[{first + k}]") for k in range(len(sizes))]
        self.sizes += sizes
        return self.symbols[first:]

    def six(self, sizes: Sequence[Expr]) -> Twist:
        """The next six, as a twist or wrench."""
        x = self.take(sizes)
        return (x[0], x[1], x[2]), (x[3], x[4], x[5])


class Forces:
    """Multipliers of cut joints and couplings, their equations, and what they do to bodies and joints."""

    def __init__(self, bodies: FreeBodies, cuts: Sequence[FreeBodyCut], unknowns: Unknowns, units: Units) -> None:
        self.bodies, self.cuts, self.unknowns = bodies, cuts, unknowns
        self.first = len(unknowns.symbols)
        self.rows = bodies.couplings
        kinds = [[units.of(kind) for kind in cut.kinds] for cut in cuts]
        coupled = [units.of(bodies.kinematics.constraints.kinds[i]) for i in self.rows]
        self.sizes = [*(size for sizes in kinds for size in sizes), *coupled]  #: of the constraints
        self.multipliers = [unknowns.take([units.energy / size for size in sizes]) for sizes in kinds]
        self.along = unknowns.take([units.energy / size for size in coupled])
        constraints = bodies.kinematics.constraints
        self.pulls = [bodies.graph.zero] * len(bodies.kinematics.v)  # C_q^T l of the couplings
        for i, l in zip(self.rows, self.along, strict=True):
            self.pulls = [f + entry * l for f, entry in zip(self.pulls, constraints.jacobian[i], strict=True)]

    def close(self, balances: list[Wrench], motions: Sequence[Twist], a: Sequence[Expr]) -> list[Expr]:
        """Apply the wrenches of cut joints to the balances; return all constraint equations."""
        residuals: list[Expr] = []
        for cut, multipliers in zip(self.cuts, self.multipliers, strict=True):
            accelerations = cut.accelerations(motions, self.bodies.base)
            cut.push(balances, multipliers, accelerations)
            residuals += accelerations[: cut.closing]
        constraints = self.bodies.kinematics.constraints
        return residuals + [combined(constraints.gamma[i], constraints.jacobian[i], a) for i in self.rows]

    def solve(
        self, residuals: Sequence[Expr], sizes: Sequence[Expr], closing: Sequence[Expr], a: Sequence[Expr]
    ) -> LinearSystem:
        """The system of all equations, the constraints last."""
        relaxed = [(len(residuals) + k, self.first + k) for k in range(len(closing))]
        sizes = [*sizes, *self.sizes, *self.unknowns.sizes]
        return linear_system([*residuals, *closing], self.unknowns.symbols, relaxed, sizes, a)
