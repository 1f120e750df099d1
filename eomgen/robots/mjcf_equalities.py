"""Robots, MJCF's equality constraints: those with a counterpart -> loop joints and couplings.

They are soft in MuJoCo and hold exactly here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .placement import Placement, from_quaternion, moved
from .robot import Loop, Mimic

if TYPE_CHECKING:
    from .mjcf import _Reader

CONNECT, WELD, JOINT = 0, 1, 2  # mjtEq
_BODY, _SITE = 1, 6  # mjtObj


def read_equalities(reader: _Reader) -> None:
    """Take in the equality constraints that are active."""
    m, robot = reader.m, reader.robot
    for k in range(m.neq):
        name = m.eq(k).name or f"equality{k}"
        place = reader.place(name, "connect", "weld", "joint")
        kind = m.eq_type[k]
        if not m.eq_active0[k]:
            robot.notes.append(f"left out: the equality {name}, which is not active")
        elif kind in (CONNECT, WELD) and m.eq_objtype[k] in (_BODY, _SITE):
            robot.loops.append(_loop(reader, k, name, place))
        elif kind == JOINT and not m.eq_data[k][2:5].any() and _is_scalar(reader, k):
            robot.couplings.append(_coupling(reader, k, name, place))
        else:
            robot.notes.append(f"left out: the equality {name}, which has no counterpart")


def _is_scalar(reader: _Reader, k: int) -> bool:
    joints = [j for j in (reader.m.eq_obj1id[k], reader.m.eq_obj2id[k]) if j >= 0]
    return all(reader.m.jnt_type[j] >= 2 for j in joints)


def _loop(reader: _Reader, k: int, name: str, place: tuple[str, int]) -> Loop:
    m, bodies, data = reader.m, reader.names["body"], reader.m.eq_data[k]
    kind = "spherical" if m.eq_type[k] == CONNECT else "weld"
    ids = m.eq_obj1id[k], m.eq_obj2id[k]
    if m.eq_objtype[k] == _SITE:
        frames = [Placement(from_quaternion(*m.site_quat[i]), np.array(m.site_pos[i])) for i in ids]
        if kind == "weld" and data[6:10].any():
            frames[0] = frames[0] @ Placement(from_quaternion(*data[6:10]), np.array(data[3:6]))
        links = [bodies[m.site_bodyid[i]] for i in ids]
    else:
        links = [bodies[i] for i in ids]
        if kind == "spherical":
            frames = [moved(data[:3]), moved(data[3:6])]
        else:  # the second body's anchor, and where it is and how it is turned as the first sees it
            frames = [Placement(from_quaternion(*data[6:10]), np.array(data[3:6])), moved(data[:3])]
    return Loop(name, kind, (links[0], frames[0]), (links[1], frames[1]), place)


def _coupling(reader: _Reader, k: int, name: str, place: tuple[str, int]) -> tuple[str, str, Mimic, tuple[str, int]]:
    """q1 - q1(0) = c0 + c1 (q2 - q2(0))."""
    m, joints = reader.m, reader.names["joint"]
    first, second = m.eq_obj1id[k], m.eq_obj2id[k]
    c0, c1 = (float(c) for c in m.eq_data[k][:2])
    offset = float(m.qpos0[m.jnt_qposadr[first]]) + c0
    if second < 0:
        return name, joints[first], Mimic("", 0.0, offset), place
    offset -= c1 * float(m.qpos0[m.jnt_qposadr[second]])
    return name, joints[first], Mimic(joints[second], c1, offset), place
