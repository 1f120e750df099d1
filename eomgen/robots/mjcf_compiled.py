"""Robots, MJCF: what MuJoCo's compiler made, with the names and places of its elements."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.limits.numbers import LARGEST
from ..errors import ModelError
from .mjcf_files import Lines
from .robot import Place, Robot
from .xml_text import XmlElement

#: Field -> the flag that switches it off, and what a note calls it; noted where a number of it is not zero.
NOTED = {
    "jnt_stiffnesspoly": ("SPRING", "the parts of springs of joints that are not linear"),
    "jnt_springyield": ("SPRING", "the yielding of springs of joints"),
    "dof_dampingpoly": ("DAMPER", "the parts of dampers of joints that are not linear"),
    "tendon_stiffnesspoly": ("SPRING", "the parts of springs along tendons that are not linear"),
    "tendon_springyield": ("SPRING", "the yielding of springs along tendons"),
    "tendon_dampingpoly": ("DAMPER", "the parts of dampers along tendons that are not linear"),
    "tendon_frictionloss": ("FRICTIONLOSS", "the dry friction along tendons"),
    "tendon_limited": ("LIMIT", "the limits of the lengths of tendons"),
    "actuator_dampingpoly": ("DAMPER", "the parts of dampers of actuators that are not linear"),
    "actuator_delay": ("ACTUATION", "the delays of actuators"),
}
#: Field that is read -> what it holds, which must be no larger than LARGEST; ranges may be infinite.
FINITE = {
    "gravity": "the components of gravity",
    "body_mass": "masses",
    "body_inertia": "moments of inertia",
    "body_ipos": "centres of mass",
    "body_iquat": "axes of inertias",
    "body_pos": "places of bodies",
    "body_quat": "rotations of bodies",
    "jnt_pos": "places of joints",
    "jnt_axis": "axes of joints",
    "jnt_stiffness": "stiffnesses of joints",
    "qpos0": "initial positions",
    "qpos_spring": "rest positions of springs",
    "dof_armature": "armatures of joints",
    "dof_damping": "dampings of joints",
    "dof_frictionloss": "dry frictions of joints",
    "site_pos": "places of sites",
    "site_quat": "rotations of sites",
    "eq_data": "data of equalities",
    "wrap_prm": "coefficients of tendons",
    "tendon_stiffness": "stiffnesses of tendons",
    "tendon_damping": "dampings of tendons",
    "tendon_armature": "armatures of tendons",
    "tendon_lengthspring": "rest lengths of tendons",
    "tendon_length0": "lengths of tendons",
    "actuator_gear": "gears of actuators",
    "actuator_gainprm": "gains of actuators",
    "actuator_biasprm": "biases of actuators",
    "actuator_damping": "dampings of actuators",
    "actuator_armature": "armatures of actuators",
}


class Compiled:
    """A compiled model, and the robot that it becomes."""

    def __init__(self, m: Any, root: XmlElement, lines: Lines) -> None:
        self.m, self.root, self.lines = m, root, lines
        self.robot = Robot(root.attributes.get("model") or "robot", root.file)
        self.names = {kind: [self.name(kind, k) for k in range(len(m.names[kind]))] for kind in ("body", "joint")}

    def name(self, kind: str, k: int) -> str:
        """The name of an element; one made from its kind and number if it has none."""
        return self.m.names[kind][k] or f"{'equality' if kind == 'eq' else kind}{k}"

    def off(self, *flags: str) -> bool:
        """Whether the file disables one of these parts of the physics, by the words of mjtDisableBit."""
        passive = ("PASSIVE",) if "SPRING" in flags or "DAMPER" in flags else ()  # both in one, before MuJoCo 3.4
        return any(self.m.opt.disableflags & self.m.flags.get(flag, 0) for flag in (*flags, *passive))

    def _check(self) -> None:
        """Refuse numbers that are not finite or far too large, which MuJoCo takes."""
        for key, what in FINITE.items():
            values = getattr(self.m.opt if key == "gravity" else self.m, key, 0.0)
            if not (np.abs(values) <= LARGEST).all():
                remedy = f"at most {LARGEST:g}, so that products stay finite"
                problem = self.root.problem(
                    "mujoco", f"{what} ({key}) come out too large or not finite", remedy, "EG-RANGE"
                )
                self.robot.problems.append(problem)
        if self.robot.problems:
            raise ModelError(self.robot.problems)

    def place(self, name: str, *tags: str) -> Place:
        """Where an element of a name is; the model's first line if it has none."""
        for tag in tags:
            if (tag, name) in self.lines:
                return self.lines[tag, name]
        return self.root.file, self.root.line
