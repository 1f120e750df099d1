"""Stage kinematics: Kinematics -> reactions of joints on the graph, linear in accelerations and multipliers.

What every body needs less what the constraint equations exert on it is summed from the tips of the tree to ground
(Featherstone, RBDA, sec. 5.3), as :mod:`~eomgen.analysis.reactions` does on numbers.
"""

from __future__ import annotations

from collections.abc import Mapping

from ..frames import GROUND
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.vectors import Vec3
from .wrenches import JointWrenches, Row6


def carried_reactions(wrenches: JointWrenches, multipliers: Mapping[str, Expr]) -> dict[str, Row6]:
    """Wrench (force, moment) that P exerts on S at S, along the axes of S, of each joint.

    Components along the directions in which a joint is free contain what acts along its coordinates.

    Parameters
    ----------
    wrenches : JointWrenches
    multipliers : mapping
        Of each constraint row by its label, with M v' + h + C_q^T l = 0; also of rows that vanish identically.
    """
    kinematics, poses = wrenches.kinematics, wrenches.kinematics.poses
    count = len(wrenches.mechanism.bodies)
    sixes = [wrenches.needed[6 * k : 6 * k + 6] for k in range(count + len(wrenches.cut))]
    total = [list(six) for six in sixes[:count]]
    for label, multiplier in multipliers.items():
        for body, row in wrenches.on_bodies.get(label, {}).items():
            total[body] = [x + multiplier * d for x, d in zip(total[body], row, strict=True)]
    found: dict[str, Row6] = {}
    for branch in reversed(kinematics.topology.branches):
        spec = wrenches.specs[branch.joint]
        here, at = total[branch.body], wrenches.origins[branch.body]
        moved = _about(here, at, poses.marker(spec.successor).position)
        found[spec.name] = tuple(-x for x in moved) if branch.reversed else moved
        if branch.parent != GROUND:
            base = total[branch.parent]
            lifted = _about(here, at, wrenches.origins[branch.parent])
            total[branch.parent] = [x + y for x, y in zip(base, lifted, strict=True)]
    for joint, load in zip(wrenches.cut, sixes[count:], strict=True):
        loaded = list(load)
        for label, gradient in joint.rows:
            if label in multipliers:
                loaded = [x - multipliers[label] * d for x, d in zip(loaded, gradient, strict=True)]
        found[joint.spec.name] = tuple(loaded)
    turned: dict[str, Row6] = {}
    for spec in wrenches.specs:
        if spec.name in found:
            axes, wrench = poses.marker(spec.successor).rotation, found[spec.name]
            force = vec.transpose_times(axes, (wrench[0], wrench[1], wrench[2]))
            turned[spec.name] = (*force, *vec.transpose_times(axes, (wrench[3], wrench[4], wrench[5])))
    return turned


def _about(wrench: list[Expr], start: Vec3, end: Vec3) -> Row6:
    """A wrench about ``start``, about ``end`` instead."""
    force: Vec3 = (wrench[0], wrench[1], wrench[2])
    moment = vec.add((wrench[3], wrench[4], wrench[5]), vec.cross(vec.sub(start, end), force))
    return (*force, *moment)
