"""Kinematics -> loads on links, wrenches that joints and constraints must exert, energies.

Newton's and Euler's equations of each body (Shabana, Computational Dynamics, ch. 6: constraint forces), and the
virtual work of each constraint equation in a displacement of each body alone: ``dC = D . (dr, dtheta)``, so that a
multiplier l with M v' + h + C_q^T l = 0 acts on the body as the wrench -l D.  All in ground axes; wrenches are (force,
moment about the body's origin).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

from ..elements.forces.force import CoordinateLoad, Force, MarkerLoad
from ..elements.frames import GROUND, Frame, Marker
from ..expr import vectors as vec
from ..expr.core import Expr, substitute, symbols_of
from ..expr.differentiate import jacobian, vjp
from ..expr.records import Record
from ..expr.spatial import Twist, Wrench
from ..expr.tensors import add_matrices, shift_tensor, symmetric
from ..expr.vectors import Vec3
from ..model.mechanism import Body, JointSpec
from .closing import COMMON, closing_gradients
from .kinematics import Kinematics
from .loops import couple
from .motion import MarkerMotion
from .tree import Poses

# -- loads -------------------------------------------------------------------------------------------------------------


def applied_wrenches(kinematics: Kinematics) -> list[Wrench]:
    """Force elements' wrench on each link, about its origin in link axes."""
    graph, poses = kinematics.graph, kinematics.poses
    total: list[Wrench] = [(vec.zero(graph), vec.zero(graph)) for _ in kinematics.links]
    for terms in graph.marked(kinematics.forces):
        for load in graph.marked(terms.marker_loads):
            if load.marker.body == GROUND:
                continue
            k = poses.link_of[load.marker.body]
            rotation = poses.link(k).rotation
            push = vec.transpose_times(rotation, load.force)
            turn = vec.transpose_times(rotation, load.torque)
            arm = poses.marker_in_link(load.marker).position
            total[k] = vec.add(total[k][0], vec.add(turn, vec.cross(arm, push))), vec.add(total[k][1], push)
    return total


def coordinate_forces(kinematics: Kinematics) -> list[Expr]:
    """Force elements along coordinates, those of cut joints through their y_q."""
    graph, loop = kinematics.graph, kinematics.loop_coordinates
    total = [graph.zero] * len(kinematics.v)
    place = {name: j for j, name in enumerate(kinematics.velocity_labels)}
    for terms in graph.marked(kinematics.forces):
        for load in terms.coordinate_loads:
            if load.coordinate in place:
                j = place[load.coordinate]
                total[j] = total[j] + load.value
            else:
                row = loop.jacobian[loop.names.index(load.coordinate)]
                total = [f + load.value * entry for f, entry in zip(total, row, strict=True)]
    return total


def virtual_power(kinematics: Kinematics, loads: Iterable[MarkerLoad | CoordinateLoad]) -> list[Expr]:
    """Generalized forces of loads (n_v,): Q = sum F . d(velocity)/dv."""
    motion, loop = kinematics.motion, kinematics.loop_coordinates
    total = [kinematics.graph.zero] * len(kinematics.v)
    pairs: list[tuple[Expr, Expr]] = []
    for load in loads:
        if isinstance(load, MarkerLoad):
            moved = *motion.velocity(load.marker), *motion.angular_velocity(load.marker)
            pairs += zip(moved, (*load.force, *load.torque), strict=True)
        elif load.coordinate in kinematics.velocity_labels:
            j = kinematics.velocity_labels.index(load.coordinate)
            total[j] = total[j] + load.value
        else:
            pairs.append((loop.rates[loop.names.index(load.coordinate)], load.value))
    pairs = [(x, w) for x, w in pairs if not (x.is_zero or w.is_zero)]
    if not pairs:
        return total
    powers = vjp([x for x, _ in pairs], [w for _, w in pairs], list(kinematics.v))
    return [a + b for a, b in zip(total, powers, strict=True)]


class Drive(NamedTuple):
    """The rotor of a drive geared to a coordinate y of the tree or of a cut joint: its inertia and how y moves.

    A loop can close without any row (two hinges on one axis), and its cut joint still turn a drive.
    """

    coordinate: str
    velocity: int  #: index of y' in v, -1 for a coordinate of a cut joint
    inertia: Expr
    rate: Expr
    acceleration: Expr
    slope: Sequence[Expr]  #: y_q (n_v,)

    @property
    def kinetic_energy(self) -> Expr:
        """J y'^2 / 2."""
        return 0.5 * self.inertia * (self.rate * self.rate)


def find_drives(kinematics: Kinematics) -> list[Drive]:
    """The drives with an inertia, in the order of the joints."""
    k, loop, unit = kinematics, kinematics.loop_coordinates, [kinematics.graph.zero] * len(kinematics.v)
    result = []
    for name, inertia in ((s.coordinates[0], s.armature) for s in k.mechanism.joints if s.armature is not None):
        if name in k.velocity_labels:
            j = k.velocity_labels.index(name)
            result.append(Drive(name, j, inertia, k.v[j], k.a[j], [*unit[:j], k.graph.one, *unit[j + 1 :]]))
        else:
            j = loop.names.index(name)
            result.append(Drive(name, -1, inertia, loop.rates[j], loop.accelerations[j], loop.jacobian[j]))
    return result


def drive_inertias(kinematics: Kinematics) -> dict[int, Expr]:
    """Inertias of drives on coordinates of the tree, by the index of the velocity."""
    return {drive.velocity: drive.inertia for drive in find_drives(kinematics) if drive.velocity >= 0}


def cut_drives(kinematics: Kinematics) -> list[Drive]:
    """Drives on coordinates of cut joints, where they couple the coordinates of the tree through y_q."""
    return [drive for drive in find_drives(kinematics) if drive.velocity < 0]


def mass_parents(kinematics: Kinematics) -> tuple[int, ...]:
    """Per velocity the next one towards ground (-1: none) by which M is sparse, always a smaller index.

    A drive on a cut joint ties branches, so that all are one chain.
    """
    return tuple(range(-1, len(kinematics.v) - 1)) if cut_drives(kinematics) else kinematics.parent


Row6 = tuple[Expr, ...]  # force, moment


class CutJoint(Record):
    """A cut joint: by how much its equations and coordinates change when S moves against P, about S, ground axes."""

    spec: JointSpec
    rows: tuple[tuple[str, Row6], ...]  #: label, dC
    coordinates: tuple[tuple[str, Row6], ...]  #: name, dy


class _Displaced(Poses):
    """Poses in which each body is moved a little: by symbols that stand for 0."""

    def __init__(self, kinematics: Kinematics, origins: list[Vec3], moves: list[tuple[Vec3, Vec3]]) -> None:
        super().__init__(kinematics.mechanism, kinematics.links)
        self._true, self._origins, self._moves = kinematics.poses, origins, moves

    def link(self, link: int, base: int = GROUND, within: Frame | None = None) -> Frame:
        frame = self._true.link(link)
        if link == GROUND:
            return frame
        body = self.links[link].body
        shift, turn = self._moves[body]
        arm = vec.sub(frame.position, self._origins[body])
        columns = [vec.add(c, vec.cross(turn, c)) for c in vec.transpose(frame.rotation)]
        rotation = vec.transpose((columns[0], columns[1], columns[2]))
        return Frame(rotation, vec.add(frame.position, vec.add(shift, vec.cross(turn, arm))))

    def between(self, start: Marker, end: Marker) -> tuple[int, Frame]:
        return GROUND, Frame.identity(self.graph)


class JointWrenches:
    """The straight-line parts of joint reactions of a mechanism with bodies; each is formed when first used."""

    def __init__(self, kinematics: Kinematics) -> None:
        self.kinematics = kinematics
        self.mechanism = kinematics.mechanism
        self.specs = kinematics.mechanism.joints
        self.cut_specs = [self.specs[k] for k in kinematics.topology.cut]

    # -- what metadata tells of it --------------------------------------------------------------------------------
    @cached_property
    def columns(self) -> list[int]:
        """Joint of each free direction of joints that have coordinates, in order."""
        return [k for k, spec in enumerate(self.specs) if spec.joint.role != "loop" for _ in spec.joint.velocities]

    @cached_property
    def reach(self) -> list[int]:
        """Joint of each equation of joints without coordinates, those that vanish identically too."""
        return [
            k
            for k in self.kinematics.topology.cut
            if self.specs[k].joint.role == "loop"
            for _ in self._closure_labels(self.specs[k])
        ]

    def _closure_labels(self, spec: JointSpec) -> list[str]:
        graph = self.kinematics.graph
        return [row.label for row in spec.joint.closure(graph, vec.identity(graph), vec.zero(graph))]

    @property
    def size(self) -> int:
        """Length of :attr:`geometry`."""
        rows = len(self.kinematics.constraints.labels)
        directions = len(self.columns) + len(self.reach) + len(self.kinematics.loop_coordinates.names)
        return 6 * (rows * len(self.mechanism.bodies) + directions) + 3 * len(self.specs)

    @property
    def needed_size(self) -> int:
        """Length of :attr:`needed`."""
        return 6 * (len(self.mechanism.bodies) + len(self.cut_specs))

    def metadata(self) -> dict[str, Any]:
        """Names and numbers that go with the arrays: bodies of joints, order of the tree, joint of each row."""
        number = {spec.name: k for k, spec in enumerate(self.specs)}
        cut = {self.specs[k].name for k in self.kinematics.topology.cut}
        coupled = set(self.kinematics.coupled)
        labels = self.kinematics.constraints.labels
        owner = [label.partition(".")[0] for label in labels]
        return {
            "tree": [[b.body, b.parent, b.joint, int(b.reversed)] for b in self.kinematics.topology.branches],
            "ends": [[s.predecessor.body, s.successor.body] for s in self.specs],
            "columns": self.columns,
            "velocities": [
                self.kinematics.velocity_names.index(name) if name in self.kinematics.velocity_names else -1
                for s in self.specs
                if s.joint.role != "loop"
                for name in s.velocities
            ],
            "reach": self.reach,
            "rows": [
                number[o] if o in cut and label not in coupled else -1 for o, label in zip(owner, labels, strict=True)
            ],
            "loops": [k for k in self.kinematics.topology.cut for _ in self.specs[k].coordinates],
            "cut": list(self.kinematics.topology.cut),
        }

    # -- placements -----------------------------------------------------------------------------------------------
    @cached_property
    def origins(self) -> list[Vec3]:
        """Origins of the bodies, ground axes."""
        motion = self.kinematics.motion
        return [motion.position(motion.body(k)) for k in range(len(self.mechanism.bodies))]

    @cached_property
    def cut(self) -> list[CutJoint]:
        """Gradients of the equations and coordinates of cut joints."""
        return [self._cut_joint(spec) for spec in self.cut_specs]

    def _cut_joint(self, spec: JointSpec) -> CutJoint:
        graph, poses = self.kinematics.graph, self.kinematics.poses
        closing = closing_gradients(self.kinematics, spec)
        to_ground = poses.marker(spec.predecessor).rotation
        gradients: list[Row6] = []
        for push, turn in closing.gradients:
            gradients.append((*vec.times(to_ground, push), *vec.times(to_ground, turn)))
        labels = closing.labels
        if closing.common:  # then these rows are along common axes (see close_loop)
            base, common = poses.between(spec.predecessor, spec.successor)
            axes = vec.product(poses.link(base).rotation, common.rotation)
            for k, label in enumerate(COMMON):
                gradients[labels.index(label)] = (*(row[k] for row in axes), *vec.zero(graph))
        named = [f"{spec.name}.{label}" for label in labels]
        return CutJoint(
            spec,
            tuple(zip(named, gradients[: len(named)], strict=True)),
            tuple(zip(spec.coordinates, gradients[len(named) :], strict=True)),
        )

    def _on_ends(self, spec: JointSpec, gradient: Row6) -> dict[int, Row6]:
        """A wrench on S about S, and its opposite on P, about the origins of the two bodies."""
        point = self.kinematics.poses.marker(spec.successor).position
        first, second = spec.predecessor.body, spec.successor.body
        result = {body: _about(gradient, point, self.origins[body]) for body in (second, first) if body != GROUND}
        return {body: tuple(-x for x in six) if body == first else six for body, six in result.items()}

    # -- the kernels ----------------------------------------------------------------------------------------------
    @cached_property
    def on_bodies(self) -> dict[str, dict[int, Row6]]:
        """D of each constraint row, body by body; rows that vanish identically are there too."""
        return self.element_rows() | {
            label: self._on_ends(joint.spec, gradient) for joint in self.cut for label, gradient in joint.rows
        }

    @cached_property
    def geometry(self) -> Row6:
        """D of the constraint rows (n_c, n_bodies, 6); S of the joints (n_j, 3); their free directions as (linear,
        angular) at S (n_f, 6); gradients of the equations of joints without coordinates (n_r, 6), and of the
        coordinates of cut joints (n_loop_coordinates, 6), for displacements of S."""
        graph, n = self.kinematics.graph, len(self.mechanism.bodies)
        empty = (graph.zero,) * 6
        flat: list[Expr] = []
        for label in self.kinematics.constraints.labels:
            wrenches = self.on_bodies[label]
            for body in range(n):
                flat += wrenches.get(body, empty)
        for spec in self.specs:
            flat += self.kinematics.poses.marker(spec.successor).position
        for spec in self.specs:
            if spec.joint.role != "loop":
                flat += self._free_directions(spec)
        for joint in self.cut:
            if joint.spec.joint.role == "loop":
                for _, gradient in joint.rows:
                    flat += gradient
        for joint in self.cut:
            for _, gradient in joint.coordinates:
                flat += gradient
        return tuple(flat)

    def _free_directions(self, spec: JointSpec) -> list[Expr]:
        graph = self.kinematics.graph
        values = [self.kinematics.motion.coordinates[name][0] for name in spec.coordinates]
        axes = self.kinematics.poses.marker(spec.successor).rotation
        flat: list[Expr] = []
        for angular, linear in spec.joint.subspace(graph, values):
            flat += [*vec.times(axes, linear), *vec.times(axes, angular)]
        return flat

    def element_rows(self) -> dict[str, dict[int, Row6]]:
        """D of the equations of constraint elements, body by body; what acts along coordinates of the tree is not in
        it."""
        kinematics, graph = self.kinematics, self.kinematics.graph
        if not kinematics.coupled:
            return {}
        names = [[f"move({b},{k})" for k in range(6)] for b in range(len(self.mechanism.bodies))]
        symbols = [[graph.symbol(name) for name in six] for six in names]
        moves = [((s[0], s[1], s[2]), (s[3], s[4], s[5])) for s in symbols]
        changes: dict[str, Expr] = {}
        for joint in self.cut:
            for name, gradient in joint.coordinates:
                change = graph.zero
                for body, wrench in self._on_ends(joint.spec, gradient).items():
                    for x, d in zip(symbols[body], wrench, strict=True):
                        change = change + x * d
                changes[name] = change
        known = kinematics.motion.coordinates
        placed = {n: (y + changes[n] if n in changes else y, r, a) for n, (y, r, a) in known.items()}
        moving = {n: (y, r + changes[n] if n in changes else r, a) for n, (y, r, a) in known.items()}
        plain, state, turning = kinematics.poses, kinematics.motion.state, kinematics.motion.turning
        displaced = MarkerMotion(_Displaced(kinematics, self.origins, moves), kinematics.twists, state, placed, turning)
        pushed = MarkerMotion(plain, self._pushed_twists(moves), state, moving, turning)
        rows = [r for r in couple(self.mechanism, displaced).rows if r.level == "position"]
        rows += [r for r in couple(self.mechanism, pushed).rows if r.level != "position"]
        every = [s for six in symbols for s in six]
        entries = jacobian([row.expression for row in rows], every)
        at_rest = dict.fromkeys(every, graph.zero)
        result: dict[str, dict[int, Row6]] = {}
        for k, row in enumerate(rows):
            result[row.label] = {}
            for b in range(len(symbols)):
                six = [entries.get((k, 6 * b + j), graph.zero) for j in range(6)]
                if not all(x.is_zero for x in six):
                    result[row.label][b] = tuple(substitute(six, at_rest))
        return result

    def _pushed_twists(self, moves: list[tuple[Vec3, Vec3]]) -> list[Twist]:
        """Twists of the links with a velocity added to each body alone."""
        twists: list[Twist] = []
        for k, (link, (angular, linear)) in enumerate(zip(self.kinematics.links, self.kinematics.twists, strict=True)):
            frame = self.kinematics.poses.link(k)
            shift, turn = moves[link.body]
            arm = vec.sub(frame.position, self.origins[link.body])
            spin = vec.transpose_times(frame.rotation, turn)
            moved = vec.transpose_times(frame.rotation, vec.add(shift, vec.cross(turn, arm)))
            twists.append((vec.add(angular, spin), vec.add(linear, moved)))
        return twists

    @cached_property
    def needed(self) -> Row6:
        """Per body (6): rate of its momentum less gravity and force elements, what joints and constraints exert.

        Loads along coordinates of cut joints act on both bodies, and stand behind, per cut joint (6) on S about S;
        those along coordinates of the tree pass through their joints and are left in.
        """
        kinematics, poses = self.kinematics, self.kinematics.poses
        order = sorted(range(len(kinematics.links)), key=lambda k: kinematics.links[k].body)
        momenta: list[Expr] = []
        for k in order:
            turning, push = kinematics.links[k].spatial.times(*kinematics.twists[k])
            axes = poses.link(k).rotation
            momenta += [*vec.times(axes, push), *vec.times(axes, turning)]
        rates = kinematics.total_derivative(momenta)
        total: list[list[Expr]] = []
        for b, k in enumerate(order):
            link, frame = kinematics.links[k], poses.link(k)
            p: Vec3 = (momenta[6 * b], momenta[6 * b + 1], momenta[6 * b + 2])
            force: Vec3 = (rates[6 * b], rates[6 * b + 1], rates[6 * b + 2])
            speed = vec.times(frame.rotation, kinematics.twists[k][1])
            moment = vec.add((rates[6 * b + 3], rates[6 * b + 4], rates[6 * b + 5]), vec.cross(speed, p))
            gravity = self.mechanism.gravity
            force = vec.sub(force, vec.scale(link.spatial.mass, gravity))
            moment = vec.sub(moment, vec.cross(vec.times(frame.rotation, link.spatial.moment), gravity))
            total.append(list(_about((*force, *moment), frame.position, self.origins[b])))
        for terms in kinematics.forces:
            for load in terms.marker_loads:
                if load.marker.body != GROUND:
                    point, body = poses.marker(load.marker).position, load.marker.body
                    _take(total, body, _about((*load.force, *load.torque), point, self.origins[body]))
        through = [[kinematics.graph.zero] * 6 for _ in self.cut]
        for name, value in self.loads_on_cut():
            k, gradient = next((k, g) for k, joint in enumerate(self.cut) for n, g in joint.coordinates if n == name)
            for body, wrench in self._on_ends(self.cut[k].spec, gradient).items():
                _take(total, body, tuple(value * x for x in wrench))
            _take(through, k, tuple(-(value * x) for x in gradient))
        total += through
        return tuple(x for six in total for x in six)

    def loads_on_cut(self) -> list[tuple[str, Expr]]:
        """Force elements and inertias of drives along coordinates of cut joints."""
        loads = [(c.coordinate, c.value) for terms in self.kinematics.forces for c in terms.coordinate_loads]
        loads += [(d.coordinate, -(d.inertia * d.acceleration)) for d in cut_drives(self.kinematics)]
        return [(name, value) for name, value in loads if name in self.kinematics.loop_coordinates.names]


def _take(total: list[list[Expr]], body: int, wrench: Row6) -> None:
    total[body] = [a - b for a, b in zip(total[body], wrench, strict=True)]


def find_wrenches(kinematics: Kinematics) -> JointWrenches | None:
    """The parts of joint reactions of a mechanism with bodies."""
    return None if kinematics.mechanism.bare or not kinematics.mechanism.bodies else JointWrenches(kinematics)


# -- reactions on the graph --------------------------------------------------------------------------------------------

# What every body needs less what the constraint equations exert on it is summed from the tips of the tree to ground
# (Featherstone, RBDA, sec. 5.3), as :mod:`~eomgen.analysis.reactions` does on numbers.


def joint_reactions(wrenches: JointWrenches, multipliers: Mapping[str, Expr]) -> dict[str, Row6]:
    """Wrench (force, moment) that P exerts on S at S, along the axes of S, of each joint.

    Components along the directions in which a joint is free contain what acts along its coordinates.  Multipliers are
    given by the labels of rows, those that vanish identically too, with M v' + h + C_q^T l = 0.
    """
    kinematics, poses = wrenches.kinematics, wrenches.kinematics.poses
    count = len(wrenches.mechanism.bodies)
    sixes = [wrenches.needed[6 * k : 6 * k + 6] for k in range(count + len(wrenches.cut))]
    total = [list(six) for six in sixes[:count]]
    for label, multiplier in multipliers.items():
        for body, row in wrenches.on_bodies.get(label, {}).items():
            total[body] = [x + multiplier * d for x, d in zip(total[body], row, strict=True)]
    result: dict[str, Row6] = {}
    for branch in reversed(kinematics.topology.branches):
        spec = wrenches.specs[branch.joint]
        here, at = total[branch.body], wrenches.origins[branch.body]
        moved = _about(here, at, poses.marker(spec.successor).position)
        result[spec.name] = tuple(-x for x in moved) if branch.reversed else moved
        if branch.parent != GROUND:
            base = total[branch.parent]
            lifted = _about(here, at, wrenches.origins[branch.parent])
            total[branch.parent] = [x + y for x, y in zip(base, lifted, strict=True)]
    for joint, load in zip(wrenches.cut, sixes[count:], strict=True):
        loaded = list(load)
        for label, gradient in joint.rows:
            if label in multipliers:
                loaded = [x - multipliers[label] * d for x, d in zip(loaded, gradient, strict=True)]
        result[joint.spec.name] = tuple(loaded)
    turned: dict[str, Row6] = {}
    for spec in wrenches.specs:
        if spec.name in result:
            axes, wrench = poses.marker(spec.successor).rotation, result[spec.name]
            force = vec.transpose_times(axes, (wrench[0], wrench[1], wrench[2]))
            turned[spec.name] = (*force, *vec.transpose_times(axes, (wrench[3], wrench[4], wrench[5])))
    return turned


def _about(wrench: Sequence[Expr], start: Vec3, end: Vec3) -> Row6:
    """A wrench about ``start``, about ``end`` instead."""
    force: Vec3 = (wrench[0], wrench[1], wrench[2])
    moment = vec.add((wrench[3], wrench[4], wrench[5]), vec.cross(vec.sub(start, end), force))
    return (*force, *moment)


# -- energies ----------------------------------------------------------------------------------------------------------

# The methods that work with spatial inertias share these; Lagrange's method derives its equations from energies of its
# own.


def kinetic_energy(kinematics: Kinematics) -> Expr:
    """T = sum of twist . (inertia twist) / 2 over the bodies (J), each in its link's axes about its origin."""
    total = kinematics.graph.zero
    for link, (omega, v) in total.graph.marked(zip(kinematics.links, kinematics.twists, strict=True)):
        turning, linear = link.spatial.times(omega, v)
        total = total + (vec.dot(omega, turning) + vec.dot(v, linear))
    return 0.5 * total


def gravity_on_links(kinematics: Kinematics) -> Iterator[tuple[Expr, Vec3]]:
    """Of each link g . r of its origin, and g in its axes, carried outwards so that no ground pose is needed."""
    result: list[tuple[Expr, Vec3]] = []
    for link in kinematics.graph.marked(kinematics.links):
        at_ground = kinematics.graph.zero, kinematics.mechanism.gravity
        height, pull = at_ground if link.parent == GROUND else result[link.parent]
        result.append((height + vec.dot(pull, link.position), link.down(pull)))
        yield result[-1]


def potential_energy(kinematics: Kinematics) -> Expr:
    """V of gravity on the first moments and of the springs (J)."""
    total = kinematics.graph.zero
    for link, (height, pull) in zip(kinematics.links, gravity_on_links(kinematics), strict=True):
        total = total - (link.spatial.mass * height + vec.dot(pull, link.spatial.moment))
    for terms in kinematics.forces:
        if terms.potential is not None:
            total = total + terms.potential
    return total


# -- inertial terms ----------------------------------------------------------------------------------------------------

# In both the equations of a tree are linear: with the twist (w, v) of a body, the rates (alpha, A) of its origin less
# gravity, and its mass m, first moment m c and inertia I about the origin, the joints need the wrench
#
#     force = m A + alpha x mc + w x (w x mc),   moment = I alpha + w x I w + mc x A
#
# (C. G. Atkeson, C. H. An, J. M. Hollerbach, Estimation of inertial parameters of manipulator loads and links,
# Int. J. Robotics Research 5(3) (1986), 101-119, eq. 8 to 14).  All is in the axes of the body that the user described.


MOTION = 12  #: numbers of the motion of one body


def inertial_terms(kinematics: Kinematics) -> list[Expr]:
    """Per body, in the order of the mechanism: w, v, alpha, A less gravity (12); m, m c, I xx yy zz xy xz yz (10)."""
    graph, links = kinematics.graph, kinematics.links
    twists: list[Twist] = []
    for link, (angular, linear) in zip(links, kinematics.twists, strict=True):
        turned = vec.times(link.frame.rotation, angular)
        shift = vec.cross(link.frame.position, turned)
        twists.append((turned, vec.add(vec.times(link.frame.rotation, linear), shift)))
    rates = kinematics.total_derivative([x for angular, linear in twists for x in (*angular, *linear)])
    motions: dict[int, list[Expr]] = {}
    for k, (link, (_, gravity)) in enumerate(zip(links, gravity_on_links(kinematics), strict=True)):
        angular, linear = twists[k]
        alpha, change = (vec.three(rates, 6 * k + at) for at in (0, 3))
        fall = vec.times(link.frame.rotation, gravity)
        lifted = vec.sub(vec.add(change, vec.cross(angular, linear)), fall)
        motions[link.body] = [*angular, *linear, *alpha, *lifted]
    still = [graph.zero] * MOTION
    return [x for k, body in enumerate(kinematics.mechanism.bodies) for x in (*motions.get(k, still), *_inertia(body))]


def _inertia(body: Body) -> list[Expr]:
    """m, m c, I about the origin; as given where they were given so."""
    moment = body.moment if body.moment is not None else vec.scale(body.mass, body.com)
    about = body.inertia_origin
    if about is None:
        about = add_matrices(symmetric(body.inertia), shift_tensor(body.mass, body.com))
    diagonal = (about[0][0], about[1][1], about[2][2])
    return [body.mass, *moment, *diagonal, about[0][1], about[0][2], about[1][2]]


# -- contacts between groups -------------------------------------------------------------------------------------------

# Which shapes are near each other, and how velocities move them.  The twist of a body about the origin of the ground is
# the sum of the same columns for all bodies that a velocity moves, so that one column for each velocity says the motion
# of all (R. Featherstone, Rigid Body Dynamics Algorithms, 2008, section 4.3.1).


def near_pairs(kinematics: Kinematics) -> list[Expr]:
    """The list of each contact, one after the other."""
    result = [x for force in kinematics.mechanism.forces for x in force.near(kinematics.motion)]
    return kinematics.resolve(result)


def motion_axes(kinematics: Kinematics) -> list[Expr]:
    """Per velocity the angular velocity that it causes (3), and the velocity (3) of the point at the origin."""
    result = [kinematics.graph.zero] * (6 * len(kinematics.v))
    for k, link in enumerate(kinematics.links):
        place = kinematics.poses.link(k)
        for n, (angular, linear) in enumerate(link.columns, link.first):
            turning = vec.times(place.rotation, angular)
            moving = vec.add(vec.times(place.rotation, linear), vec.cross(place.position, turning))
            result[6 * n : 6 * n + 6] = [*turning, *moving]
    return kinematics.resolve(result)


def describe_contacts(kinematics: Kinematics) -> dict[str, Any]:
    """What is known of contacts beside their numbers.

    ``lists`` has name, numbers and shapes of each contact; ``moved_by`` the last velocity that moves each shape, -1 for
    ground; ``parents`` the velocity before each towards ground; ``bodies`` the body of each shape.  ``rigid_only``
    names contacts without a law of force; ``rigid_by_motion`` those whose friction or restitution as rigid bodies
    depends on velocities or first-order states, and on which.
    """
    forces = [force for force in kinematics.mechanism.forces if force.near(kinematics.motion)]
    if not forces:
        return {}
    last = {GROUND: -1}
    for branch, link in zip(kinematics.topology.branches, kinematics.links, strict=True):
        last[branch.body] = link.first + len(link.columns) - 1 if link.columns else last[branch.parent]
    listed = [[force.name, len(force.near(kinematics.motion)), len(force.met_shapes())] for force in forces]
    bodies = [body for force in forces for _, body in force.met_shapes()]
    return {
        "rigid_contacts": {
            "lists": listed,
            "moved_by": [last[body] for body in bodies],
            "parents": list(kinematics.parent),
            "bodies": [kinematics.motion.body(body).label for body in bodies],
        },
        **({"rigid_by_motion": moving} if (moving := _by_motion(kinematics, forces)) else {}),
        **({"rigid_only": rigid} if (rigid := [force.name for force in forces if force.is_rigid]) else {}),
    }


def _by_motion(kinematics: Kinematics, forces: Sequence[Force]) -> dict[str, list[str]]:
    """Velocities and states on which what is near depends, by contact."""
    moving = (*kinematics.velocity_names, *kinematics.state_names)
    used = {force.name: symbols_of(kinematics.resolve(list(force.near(kinematics.motion)))) for force in forces}
    return {name: result for name, of in used.items() if (result := [one for one in moving if one in of])}
