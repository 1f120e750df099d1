"""Stage kinematics: resolved force elements -> their wrenches on links and their forces along coordinates."""

from __future__ import annotations

from ..frames import GROUND
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.spatial import Wrench
from .kinematics import Kinematics


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


def drive_inertias(kinematics: Kinematics) -> dict[int, Expr]:
    """Inertias of drives on coordinates of the tree, by the index of the velocity."""
    found: dict[int, Expr] = {}
    for spec in kinematics.mechanism.joints:
        if spec.armature is not None and spec.coordinates[0] in kinematics.velocity_labels:
            found[kinematics.velocity_labels.index(spec.coordinates[0])] = spec.armature
    return found


def drives_cut_joint(kinematics: Kinematics) -> bool:
    """Whether a drive's inertia is on a cut joint, where it couples the coordinates of the tree through y_q.

    A loop can close without any row (two hinges on one axis), and its cut joint still turn a drive.
    """
    loop = kinematics.loop_coordinates.names
    return any(spec.armature is not None and spec.coordinates[0] in loop for spec in kinematics.mechanism.joints)
