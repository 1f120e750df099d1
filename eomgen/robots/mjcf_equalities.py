"""Robots, MJCF's equality constraints: those with a counterpart -> loop joints and couplings.

They are soft in MuJoCo and hold exactly here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base.algebra import from_quaternion
from ..base.limits.numbers import IMPEDANCE
from .mjcf_actuators import fixed_tendon
from .robot import Loop, Sum, Tie
from .robot_frames import Placement, moved

if TYPE_CHECKING:
    from .mjcf_compiled import Compiled

CONNECT, WELD, JOINT, TENDON = 0, 1, 2, 3  # mjtEq
_BODY, _SITE = 1, 6  # mjtObj
SLOWEST = 1.0  #: rad/s: an equality that comes back to its place more slowly hardly holds in MuJoCo


def read_equalities(reader: Compiled) -> None:
    """Take in the equality constraints that are active."""
    m, robot = reader.m, reader.robot
    for k in range(m.neq):
        name = reader.name("eq", k)
        place = reader.place(name, "connect", "weld", "joint", "tendon")
        kind = m.eq_type[k]
        if not m.eq_active0[k] or reader.off("EQUALITY", "CONSTRAINT"):
            robot.notes.append(f"left out: the equality {name}, which is not active")
            continue
        if kind in (CONNECT, WELD) and m.eq_objtype[k] in (_BODY, _SITE):
            robot.loops.append(_loop(reader, k, name, place))
        elif kind in (JOINT, TENDON) and (tie := _tie(reader, k, name, place)) is not None:
            robot.ties.append(tie)
        else:
            robot.notes.append(f"left out: the equality {name}, which has no counterpart")
            continue
        if yielding := _yielding(reader, k):
            robot.notes.append(f"the equality {name} holds exactly here; MuJoCo lets it yield far ({yielding})")


def _yielding(reader: Compiled, k: int) -> str:
    """The attributes that make an equality so soft in MuJoCo that it hardly holds; empty if there are none."""
    m = reader.m
    first, second = map(float, m.eq_solref[k])  # time constant and damping ratio, or minus stiffness and minus damping
    least, most = np.clip(m.eq_solimp[k][:2], IMPEDANCE, 1.0 - IMPEDANCE).tolist()
    stiffness = 1.0 / (first * second) ** 2 if first > 0.0 < second else -first
    slow = stiffness < (SLOWEST * most) ** 2 and (first > 0.0) == (second > 0.0)  # of mixed signs it takes its default
    scale = float(m.eq_data[k][10]) if m.eq_type[k] == WELD else 1.0
    return " and ".join(["solref"] * slow + ["torquescale"] * (0.0 < scale * scale < min(1.0, 1.0 / least - 1.0)))


def _loop(reader: Compiled, k: int, name: str, place: tuple[str, int]) -> Loop:
    m, bodies, data = reader.m, reader.names["body"], reader.m.eq_data[k]
    weld = m.eq_type[k] == WELD
    kind = "weld" if weld and data[10] else "spherical"  # torquescale 0: the weld's rows of rotation vanish
    ids = m.eq_obj1id[k], m.eq_obj2id[k]
    if m.eq_objtype[k] == _SITE:
        frames = [Placement(from_quaternion(*m.site_quat[i]), np.array(m.site_pos[i])) for i in ids]
        if weld and data[6:10].any():
            frames[0] = frames[0] @ Placement(from_quaternion(*data[6:10]), np.array(data[3:6]))
        links = [bodies[m.site_bodyid[i]] for i in ids]
    else:
        links = [bodies[i] for i in ids]
        if not weld:
            frames = [moved(data[:3]), moved(data[3:6])]
        else:  # the second body's anchor, and where it is and how it is turned as the first sees it
            frames = [Placement(from_quaternion(*data[6:10]), np.array(data[3:6])), moved(data[:3])]
    return Loop(name, kind, (links[0], frames[0]), (links[1], frames[1]), place)


def _tie(reader: Compiled, k: int, name: str, place: tuple[str, int]) -> Tie | None:
    """y - y(0) = c0 + c1 (x - x(0)) + ... + c4 (x - x(0))^4 of joint coordinates, or of lengths of fixed tendons."""
    m = reader.m
    summed = _joint if m.eq_type[k] == JOINT else _tendon
    left = summed(reader, m.eq_obj1id[k])
    right = summed(reader, m.eq_obj2id[k]) if m.eq_obj2id[k] >= 0 else Sum(())
    if left is None or right is None:
        return None
    return Tie(name, left, right, tuple(float(c) for c in m.eq_data[k][: 5 if right.parts else 1]), place)


def _joint(reader: Compiled, j: int) -> Sum | None:
    if reader.m.jnt_type[j] < 2:
        return None
    return Sum(((reader.names["joint"][j], 1.0),), -float(reader.m.qpos0[reader.m.jnt_qposadr[j]]))


def _tendon(reader: Compiled, k: int) -> Sum | None:
    parts = fixed_tendon(reader, k)
    return Sum(parts, -float(reader.m.tendon_length0[k])) if parts else None
