"""Robots, MJCF's actuators and fixed tendons: those that act on joints of one degree -> drives.

A drive of length L = sum c_j q_j has the force f = gain u + b0 + b1 L + b2 L', and pushes c_j f along q_j.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .robot import Drive

if TYPE_CHECKING:
    from .mjcf import _Reader

_JOINT, _JOINT_IN_PARENT, _TENDON = 0, 1, 3  # mjtTrn
_FIXED_GAIN, _AFFINE_BIAS, _NO_BIAS = 0, 1, 0  # mjtGain, mjtBias
_WRAP_JOINT = 1  # mjtWrap

Parts = tuple[tuple[str, float], ...]


def read_actuators(reader: _Reader) -> None:
    """Take in actuators, and springs and dampers along tendons."""
    m, robot = reader.m, reader.robot
    left = []
    for k in range(m.nu):
        name = m.actuator(k).name or f"actuator{k}"
        parts = _actuated(reader, k)
        plain = m.actuator_dyntype[k] == 0 and m.actuator_gaintype[k] == _FIXED_GAIN
        if not parts or not plain or m.actuator_biastype[k] not in (_NO_BIAS, _AFFINE_BIAS):
            left.append(name)
            continue
        affine = m.actuator_biastype[k] == _AFFINE_BIAS
        b0, b1, b2 = (float(b) if affine else 0.0 for b in m.actuator_biasprm[k][:3])
        place = reader.place(name, "motor", "position", "velocity", "general", "damper", "intvelocity")
        robot.drives.append(Drive(name, parts, float(m.actuator_gainprm[k][0]), (b0, b1, b2), place))
    if left:
        robot.notes.append(f"left out: actuators that do not push along joints by a linear law ({', '.join(left)})")
    _tendons(reader)


def _actuated(reader: _Reader, k: int) -> Parts:
    m = reader.m
    target, gear = m.actuator_trnid[k][0], float(m.actuator_gear[k][0])
    if m.actuator_trntype[k] in (_JOINT, _JOINT_IN_PARENT) and m.jnt_type[target] >= 2:
        return ((reader.names["joint"][target], gear),)
    if m.actuator_trntype[k] == _TENDON:
        return tuple((joint, gear * c) for joint, c in fixed_tendon(reader, target))
    return ()


def fixed_tendon(reader: _Reader, k: int) -> Parts:
    """Joints and coefficients of a tendon whose length is a sum of joint coordinates."""
    m = reader.m
    wraps = range(m.tendon_adr[k], m.tendon_adr[k] + m.tendon_num[k])
    if any(m.wrap_type[w] != _WRAP_JOINT for w in wraps):
        return ()
    return tuple((reader.names["joint"][m.wrap_objid[w]], float(m.wrap_prm[w])) for w in wraps)


def _tendons(reader: _Reader) -> None:
    m, robot = reader.m, reader.robot
    left = []
    for k in range(m.ntendon):
        name = m.tendon(k).name or f"tendon{k}"
        parts = fixed_tendon(reader, k)
        stiffness, damping = float(m.tendon_stiffness[k]), float(m.tendon_damping[k])
        low, high = (float(x) for x in m.tendon_lengthspring[k])
        if stiffness or damping:
            if parts and (low == high or not stiffness):
                law = (stiffness * low, -stiffness, -damping)
                robot.drives.append(Drive("", parts, 0.0, law, reader.place(name, "fixed")))
            else:
                left.append(name)
        if m.tendon_armature[k]:
            robot.notes.append(f"left out: the armature of the tendon {name}")
    if left:
        robot.notes.append(f"left out: springs and dampers of the tendons {', '.join(left)}")
