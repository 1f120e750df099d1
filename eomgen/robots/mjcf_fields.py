"""Robots, MJCF: fields of a compiled model without a counterpart, and those whose numbers must be finite."""

from __future__ import annotations

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
