"""Quantities -> Newton's and Euler's equations of every body set free, in ground axes.

Every joint is cut, and what it does is drawn as a force and a moment (Shabana, Computational Dynamics, sec. 3.3): of
joints of the spanning tree as unknown components, of joints that close loops by the multipliers of their equations.
Moments are about the centre of mass.
"""

from __future__ import annotations

from ..elements.frames import GROUND
from ..expr import vectors as vec
from ..expr.core import Expr
from ..expr.spatial import Wrench
from ..expr.vectors import Vec3
from ..mechanics.methods.free_bodies import FreeBodies
from ..mechanics.wrenches import JointWrenches
from .quantities import Quantities, Row
from .symbols import multiplier_names, wrench_names


class BodiesApart:
    """The equations of all bodies set free.

    ``A_F_x`` .. and ``A_M_x`` .. are what joint A of the spanning tree does to the body that it carries (the other one
    gets the opposite), at the joint; ``lambda_1`` .. are the multipliers of the constraint equations.
    """

    def __init__(self, quantities: Quantities) -> None:
        quantities.require_method("equations of free bodies", "newton_euler", "amalgamated")
        self.quantities = quantities
        self.kinematics, self.graph = quantities.kinematics, quantities.graph
        self.links = {link.body: k for k, link in enumerate(self.kinematics.links)}
        self.bodies = [body.name for body in self.kinematics.mechanism.bodies]
        self.joints = [self.kinematics.mechanism.joints[b.joint].name for b in self.kinematics.topology.branches]

    def _unknown(self, joint: str) -> tuple[Vec3, Vec3]:
        """Force and moment of a joint."""
        m_x, m_y, m_z, f_x, f_y, f_z = map(self.graph.symbol, wrench_names(self.kinematics, joint))
        return (f_x, f_y, f_z), (m_x, m_y, m_z)

    def _centre(self, body: int) -> Vec3:
        pose = self.kinematics.poses.link(self.links[body])
        return vec.add(pose.position, vec.times(pose.rotation, self.kinematics.links[self.links[body]].com))

    def balance(self, name: str) -> tuple[Vec3, ...]:
        """Of a body m a_c and the force that it is, then J alpha + omega x J omega and the moment, each (3,)."""
        body = self.bodies.index(name)
        force, moment = self._weight_and_elements(body)
        for wrench in (*self._from_joints(body), *self._from_cut_joints(body)):
            moment, force = vec.add(moment, wrench[0]), vec.add(force, wrench[1])
        rate, turning = self._inertia(name, body)
        return rate, force, turning, moment

    def _inertia(self, name: str, body: int) -> tuple[Vec3, Vec3]:
        """m a_c, and J alpha + omega x J omega."""
        link = self.kinematics.links[self.links[body]]
        motion, marker = self.kinematics.motion, self.quantities.markers[name]
        spec = self.kinematics.mechanism.bodies[body]
        omega, alpha = (motion.turning_of(marker, own_axes=True, rate=rate) for rate in (False, True))
        spin = vec.cross(omega, vec.times(spec.inertia, omega))
        turn = vec.times(motion.rotation(marker), vec.add(vec.times(spec.inertia, alpha), spin))
        return vec.scale(link.mass, self.quantities.acceleration(name).center_of_mass), turn

    def _about_centre(self, body: int, point: Vec3, force: Vec3, moment: Vec3) -> Wrench:
        arm = vec.sub(point, self._centre(body))
        return vec.add(moment, vec.cross(arm, force)), force

    def _weight_and_elements(self, body: int) -> tuple[Vec3, Vec3]:
        """Weight and the loads of force elements at markers: force, moment about the centre of mass."""
        kinematics = self.kinematics
        force = vec.scale(kinematics.links[self.links[body]].mass, kinematics.mechanism.gravity)
        moment = vec.zero(self.graph)
        for load in (load for terms in kinematics.forces for load in terms.marker_loads):
            if load.marker.body == body:
                point = kinematics.motion.position(load.marker)
                turned, push = self._about_centre(body, point, load.force, load.torque)
                moment, force = vec.add(moment, turned), vec.add(force, push)
        return force, moment

    def _from_joints(self, body: int) -> list[Wrench]:
        """What the joints of the tree do to a body."""
        result: list[Wrench] = []
        for k, (link, joint) in enumerate(zip(self.kinematics.links, self.joints, strict=True)):
            parent = self.kinematics.links[link.parent].body if link.parent != GROUND else GROUND
            if body not in (link.body, parent):
                continue
            point = self.kinematics.poses.link(k).position
            force, moment = self._unknown(joint)
            if body == parent:
                force, moment = vec.neg(force), vec.neg(moment)
            result.append(self._about_centre(body, point, force, moment))
        return result

    def _multipliers(self) -> dict[str, Expr]:
        """The multiplier of each constraint equation that counts, by its label."""
        labels = self.kinematics.constraints.labels
        names = multiplier_names(self.kinematics, len(self.quantities.rows))
        return {labels[i]: self.graph.symbol(n) for i, n in zip(self.quantities.rows, names, strict=True)}

    def _from_cut_joints(self, body: int) -> list[Wrench]:
        """What the joints that close loops do to a body: -lambda dC, and the loads along their coordinates."""
        multipliers, joints = self._multipliers(), JointWrenches(self.kinematics)
        loads: dict[str, Expr] = {}
        for name, value in joints.loads_on_cut():
            loads[name] = loads.get(name, self.graph.zero) + value
        result: list[Wrench] = []
        for cut in joints.cut:
            ends = (cut.spec.predecessor.body, cut.spec.successor.body)
            if body not in ends:
                continue
            point = self.kinematics.poses.marker(cut.spec.successor).position
            weighted = [(-multipliers[label], six) for label, six in cut.rows if label in multipliers]
            weighted += [(loads[name], six) for name, six in cut.coordinates if name in loads]
            for factor, six in weighted:
                factor = factor if body == ends[1] else -factor
                force, moment = vec.scale(factor, (six[0], six[1], six[2])), vec.scale(factor, (six[3], six[4], six[5]))
                result.append(self._about_centre(body, point, force, moment))
        return result

    def along_joint(self, name: str) -> list[tuple[Expr, Expr]]:
        """Along each free direction of a joint of the tree: its component of the reaction, and what drives it.

        Force elements along the coordinate and constraint elements, by their multipliers, drive it; the inertia of a
        drive (armature) takes its part of that.
        """
        k = self.joints.index(name)
        link, bodies = self.kinematics.links[k], FreeBodies(self.kinematics)
        rotation = self.kinematics.poses.link(k).rotation
        force, moment = self._unknown(name)
        pulls = self._pulls()
        armature = self.kinematics.mechanism.joints[self.kinematics.topology.branches[k].joint].armature
        result = []
        for c, (angular, linear) in enumerate(link.columns):
            turn, push = vec.times(rotation, angular), vec.times(rotation, linear)
            j = link.first + c
            drive = bodies.forces[j] - pulls[j]
            if armature is not None:
                drive = drive - armature * self.kinematics.a[j]
            result.append((vec.dot(turn, moment) + vec.dot(push, force), drive))
        return result

    def _pulls(self) -> Row:
        """C_q^T lambda of the constraint elements."""
        constraints, multipliers = self.kinematics.constraints, self._multipliers()
        total = [self.graph.zero] * len(self.kinematics.v)
        for label, row in zip(constraints.labels, constraints.jacobian, strict=True):
            if label in self.kinematics.coupled and label in multipliers:
                total = [x + multipliers[label] * entry for x, entry in zip(total, row, strict=True)]
        return tuple(total)
