"""Robots, MJCF's actuators and fixed tendons: those that act on joints of one degree -> drives.

A drive of length L = sum c_j q_j has the force f = gain u + b0 + b1 L + b2 L', and pushes c_j f along q_j.  As in
MuJoCo u is cut to ctrlrange, the forces along a tendon are scaled where their sum leaves the tendon's actuatorfrcrange,
f is cut to forcerange, and what all drives together do along a joint to the joint's actuatorfrcrange.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from .robot import Drive, Place

if TYPE_CHECKING:
    from .mjcf_compiled import Compiled

_JOINT, _JOINT_IN_PARENT, _TENDON = 0, 1, 3  # mjtTrn
_FIXED_GAIN, _AFFINE_BIAS, _NO_BIAS = 0, 1, 0  # mjtGain, mjtBias
_WRAP_JOINT = 1  # mjtWrap

Parts = tuple[tuple[str, float], ...]


def read_actuators(reader: Compiled) -> None:
    """Take in actuators, and what else springs, dampers and inertias along joints and fixed tendons add."""
    m, robot = reader.m, reader.robot
    left, idle, nothing = [], [], [0.0] * m.nu
    for k in range(getattr(m, "nactuator", m.nu)):  # of several controls or forces each, since MuJoCo 4
        name = reader.name("actuator", k)
        parts = _actuated(reader, k)
        place = reader.place(name, "motor", "position", "velocity", "general", "damper", "intvelocity")
        damping, armature = (float(getattr(m, f"actuator_{key}", nothing)[k]) for key in ("damping", "armature"))
        _resist(reader, f"actuator {name}", parts, place, damping, armature)
        if reader.off("ACTUATION") or (
            0 <= m.actuator_group[k] < 31 and m.opt.disableactuator >> m.actuator_group[k] & 1
        ):
            idle.append(name)
            continue
        plain = m.actuator_dyntype[k] == 0 and m.actuator_gaintype[k] == _FIXED_GAIN and m.actuator_plugin[k] < 0
        if not parts or not plain or m.actuator_biastype[k] not in (_NO_BIAS, _AFFINE_BIAS):
            left.append(name)
            continue
        affine = m.actuator_biastype[k] == _AFFINE_BIAS
        b0, b1, b2 = (float(b) if affine else 0.0 for b in m.actuator_biasprm[k][:3])
        drive = Drive(name, parts, float(m.actuator_gainprm[k][0]), (b0, b1, b2), place)
        robot.drives.append(replace(drive, **_ranges(reader, k)))
    if left:
        robot.notes.append(f"left out: actuators that do not push along joints by a linear law ({', '.join(left)})")
    if idle:
        robot.notes.append(f"left out: actuators that the file disables ({', '.join(idle)})")
    _tendons(reader)


def _ranges(reader: Compiled, k: int) -> dict[str, Any]:
    """What the control and the force of an actuator are cut to."""
    m = reader.m
    control, output = (getattr(m, key, range(m.nu))[k] for key in ("actuator_ctrladr", "actuator_outadr"))
    found: dict[str, Any] = {}
    if m.actuator_ctrllimited[control] and not reader.off("CLAMPCTRL"):
        found["control"] = tuple(map(float, m.actuator_ctrlrange[control]))
    if m.actuator_forcelimited[output]:
        found["force"] = tuple(map(float, m.actuator_forcerange[output]))
    tendon = m.actuator_trnid[k][0]
    if m.actuator_trntype[k] == _TENDON and m.tendon_actfrclimited[tendon]:
        found["tendon"] = str(tendon)
        found["total"] = tuple(map(float, m.tendon_actfrcrange[tendon]))
    return found


def _actuated(reader: Compiled, k: int) -> Parts:
    m = reader.m
    counts = [getattr(m, key, None) for key in ("actuator_ctrlnum", "actuator_outnum")]
    if any(count is not None and count[k] != 1 for count in counts):
        return ()
    first = getattr(m, "actuator_outadr", range(m.nu))[k]  # gears are those of forces
    target, gear = m.actuator_trnid[k][0], float(m.actuator_gear[first][0])
    if m.actuator_trntype[k] in (_JOINT, _JOINT_IN_PARENT) and m.jnt_type[target] >= 2:
        return ((reader.names["joint"][target], gear),)
    if m.actuator_trntype[k] == _TENDON:
        return tuple((joint, gear * c) for joint, c in fixed_tendon(reader, target))
    return ()


def _resist(reader: Compiled, what: str, parts: Parts, place: Place, damping: float, armature: float) -> None:
    """Add a damper and a rotor along L = sum c_j q_j: of one joint c^2 of each is the joint's own."""
    robot = reader.robot
    damping = 0.0 if reader.off("DAMPER") else damping
    if len(parts) == 1:
        name, c = parts[0]
        joint = robot.joints[name]
        square = c * c
        robot.joints[name] = replace(
            joint, damping=joint.damping + square * damping, armature=joint.armature + square * armature
        )
        return
    if damping and parts:
        robot.drives.append(Drive("", parts, 0.0, (0.0, 0.0, -damping), place))
    elif damping:
        robot.notes.append(f"left out: the damping of the {what}")
    if armature:
        robot.notes.append(f"left out: the armature of the {what}")


def fixed_tendon(reader: Compiled, k: int) -> Parts:
    """Joints and coefficients of a tendon whose length is a sum of joint coordinates."""
    m = reader.m
    wraps = range(m.tendon_adr[k], m.tendon_adr[k] + m.tendon_num[k])
    if any(m.wrap_type[w] != _WRAP_JOINT for w in wraps):
        return ()
    return tuple((reader.names["joint"][m.wrap_objid[w]], float(m.wrap_prm[w])) for w in wraps)


def _tendons(reader: Compiled) -> None:
    m, robot = reader.m, reader.robot
    left = []
    for k in range(m.ntendon):
        name = reader.name("tendon", k)
        parts = fixed_tendon(reader, k)
        place = reader.place(name, "fixed", "spatial")
        _resist(reader, f"tendon {name}", parts, place, float(m.tendon_damping[k]), float(m.tendon_armature[k]))
        stiffness = 0.0 if reader.off("SPRING") else float(m.tendon_stiffness[k])
        low, high = (float(x) for x in m.tendon_lengthspring[k])
        if stiffness and parts and low == high:
            robot.drives.append(Drive("", parts, 0.0, (stiffness * low, -stiffness, 0.0), place))
        elif stiffness:
            left.append(name)
    if left:
        robot.notes.append(f"left out: springs of the tendons {', '.join(left)}")
