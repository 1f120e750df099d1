"""Robots, MJCF: a file, compiled by MuJoCo -> a Robot.

MuJoCo's own compiler (package mujoco) resolves defaults, orientations and the inertia of geoms; what it makes is read:
bodies, their joints in order (several joints of a body become links without mass between them), springs, dampers,
inertias of drives, equality constraints, and actuators on joints.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.algebra import about, from_quaternion
from ..describe.joint_data import limits_nothing
from ..errors import at_odds
from .constructs import notes_of
from .mjcf_actuators import read_actuators
from .mjcf_compile import compile_mjcf
from .mjcf_compiled import NOTED, Compiled
from .mjcf_constructs import find_mjcf
from .mjcf_equalities import read_equalities
from .mjcf_files import Scan
from .mjcf_text import Text
from .robot import Robot, RobotJoint, RobotLink, RobotOptions
from .robot_frames import IDENTITY, NOTHING, Inertia, Placement, moved, numbers
from .xml_text import XmlElement

_SLEEP = 1 << 4  # mjtEnableBit
_TYPES = ("free", "spherical", "prismatic", "revolute")  # mjtJoint


def read_mjcf(root: XmlElement, options: RobotOptions) -> Robot:
    """The robot of an MJCF file.

    Raises
    ------
    MissingDependencyError
        mujoco is not installed.
    ModelError
        The file names others outside its folder, or MuJoCo refuses it; with the line where it says one.
    """
    if options.floating:
        raise at_odds(f"{root.file}: an MJCF file itself defines which bodies float; leave floating out")
    scan = Scan(root, options.assets)
    compiled = compile_mjcf(Text(scan.trees, scan.folder, scan.problems), root)
    robot = _MjcfReader(compiled, root, scan.lines).read()
    robot.notes += notes_of(find_mjcf, scan.met)
    robot.notes[:0] = [f"MuJoCo warns: {' '.join(text.split())}" for text in compiled.warnings]
    return robot


class _MjcfReader(Compiled):
    """Reads a compiled model into a Robot."""

    def read(self) -> Robot:
        self._check()
        m, robot = self.m, self.robot
        gravity = np.zeros(3) if self.off("GRAVITY") else m.opt.gravity
        robot.gravity = tuple(numbers(gravity))  # type: ignore[assignment]
        world = self.names["body"][0]
        robot.links[world] = RobotLink(world, (self.root.file, self.root.line))
        for k in range(1, m.nbody):
            self._body(k)
        read_equalities(self)
        read_actuators(self)
        self._note_the_rest()
        return robot

    # -- bodies and joints ----------------------------------------------------------------------------------------
    def _body(self, k: int) -> None:
        m, robot = self.m, self.robot
        name, parent = self.names["body"][k], self.names["body"][m.body_parentid[k]]
        place = self.place(name, "body")
        rotation = from_quaternion(*m.body_iquat[k])
        tensor = rotation @ np.diag(m.body_inertia[k]) @ rotation.T
        inertia = Inertia(float(m.body_mass[k]), np.array(m.body_ipos[k]), (tensor + tensor.T) / 2)
        at = Placement(from_quaternion(*m.body_quat[k]), np.array(m.body_pos[k]))
        inertia_of: dict[str, Inertia] = {}
        joints = range(m.body_jntadr[k], m.body_jntadr[k] + m.body_jntnum[k])
        if not joints:
            robot.joints[f"{name} weld"] = RobotJoint(f"{name} weld", "weld", parent, name, place, outer=at)
        for j in joints:
            last = j == joints[-1]
            child = name if last else f"{name}.{self.names['joint'][j]}"
            still = j == joints[0] and m.body_weldid[m.body_parentid[k]] == 0
            if still and _TYPES[m.jnt_type[j]] == "spherical" and (rotor := float(m.dof_armature[m.jnt_dofadr[j]])):
                own = inertia if last else NOTHING
                inertia_of[child] = replace(own, tensor=own.tensor + rotor * np.eye(3))
                robot.notes.append(
                    f"the armature of the ball joint {self.names['joint'][j]} is part of the inertia of its body"
                )
            if not last:
                robot.links[child] = RobotLink(child, place, inertia_of.get(child, NOTHING))
            joint = self._joint(j, parent, child, at if j == joints[0] else IDENTITY, still)
            robot.joints[joint.name] = joint
            parent = child
        robot.links[name] = RobotLink(name, place, inertia_of.get(name, inertia))

    def _joint(self, j: int, parent: str, child: str, at: Placement, still: bool) -> RobotJoint:
        m, name = self.m, self.names["joint"][j]
        kind = _TYPES[m.jnt_type[j]]
        dof, start = m.jnt_dofadr[j], m.jnt_qposadr[j]
        place = self.place(name, "joint", "freejoint")
        anchor = moved(m.jnt_pos[j])
        joint = RobotJoint(name, kind, parent, child, place, outer=at @ anchor, inner=anchor)
        size = {"free": 6, "spherical": 3}.get(kind, 1)
        if size > 1:
            if kind == "free" and m.dof_armature[dof]:
                message = "armature on a free joint is not supported: it is mass without weight, which no body has"
                self.robot.problem(
                    f"joint.{name}.armature", message, 'set armature="0" there', place, code="EG-UNSUPPORTED"
                )
            for what, acts in (
                ("dry friction", m.dof_frictionloss[dof] and not self.off("FRICTIONLOSS", "CONSTRAINT")),
                ("limit", m.jnt_limited[j] and not self.off("LIMIT", "CONSTRAINT")),
            ):
                if acts:
                    self.robot.notes.append(f"left out: the {what} of the {kind} joint {name}")
            joint = replace(
                joint,
                damping=0.0 if self.off("DAMPER") else float(m.dof_damping[dof]),
                stiffness=0.0 if self.off("SPRING") else float(m.jnt_stiffness[j]),
            )
            if kind == "spherical":
                return joint if still else replace(joint, armature=float(m.dof_armature[dof]))
            pose = Placement(from_quaternion(*m.qpos0[start + 3 : start + 7]), m.qpos0[start : start + 3])
            return replace(joint, outer=IDENTITY, inner=IDENTITY, start=pose)
        axis = numbers(m.jnt_axis[j])
        q0 = float(m.qpos0[start])
        back = Placement(about(axis, -q0), np.zeros(3)) if kind == "revolute" else moved(-q0 * np.array(axis))
        limits: dict[str, float] = {}
        if m.jnt_limited[j] and not self.off("LIMIT", "CONSTRAINT"):
            limits |= dict(zip(("lower", "upper"), numbers(m.jnt_range[j]), strict=True))
        clamp = None
        if m.jnt_actfrclimited[j]:
            clamp = float(m.jnt_actfrcrange[j][0]), float(m.jnt_actfrcrange[j][1])
            limits["effort"] = max(map(abs, clamp))
        return replace(
            joint,
            outer=joint.outer @ back,
            axis=(axis[0], axis[1], axis[2]),
            limits={key: value for key, value in limits.items() if not limits_nothing(key, value)},
            damping=0.0 if self.off("DAMPER") else float(m.dof_damping[dof]),
            dry_friction=0.0 if self.off("FRICTIONLOSS", "CONSTRAINT") else float(m.dof_frictionloss[dof]),
            armature=float(m.dof_armature[dof]),
            stiffness=0.0 if self.off("SPRING") else float(m.jnt_stiffness[j]),
            rest=float(m.qpos_spring[start]),
            initial=q0,
            clamp=clamp,
        )

    # -- what has no counterpart ----------------------------------------------------------------------------------
    def _touching(self) -> bool:
        """Whether two geoms of bodies that move against each other may touch."""
        m = self.m
        if self.off("CONTACT", "CONSTRAINT"):
            return False
        if m.npair:
            return True
        kinds = np.unique(np.stack([m.body_weldid[m.geom_bodyid], m.geom_contype, m.geom_conaffinity], 1), axis=0)
        carrier = m.body_weldid[m.body_parentid[m.body_weldid]]  # of each body: the one its own moves on
        for k, (body, kind, met) in enumerate(kinds):
            others, kinds_there, met_there = kinds[k + 1 :].T
            apart = others != body
            if not self.off("FILTERPARENT"):  # what moves on another does not touch it, but for the world
                apart &= ((carrier[others] != body) | (body == 0)) & ((carrier[body] != others) | (others == 0))
            if (apart & (((kind & met_there) | (kinds_there & met)) != 0)).any():
                return True
        return False

    def _note_the_rest(self) -> None:
        m, notes = self.m, self.robot.notes
        if m.opt.density or m.opt.viscosity:
            notes.append("left out: the forces of the medium (density, viscosity)")
        if self._touching():
            notes.append("left out: contact of geoms")
        if m.body_gravcomp.any():
            notes.append("left out: gravity compensation of bodies (gravcomp)")
        if getattr(m, "nflex", 0):
            notes.append(f"left out: {m.nflex} deformable bodies (flex)")
        if (m.body_mocapid >= 0).any():
            notes.append("bodies moved by motion capture (mocap) stand still")
        if m.opt.enableflags & _SLEEP:
            notes.append("bodies at rest that MuJoCo lets sleep (sleep) move here")
        for key, (flag, what) in NOTED.items():
            if np.any(getattr(m, key, 0)) and not self.off(flag):
                notes.append(f"left out: {what} ({key})")
