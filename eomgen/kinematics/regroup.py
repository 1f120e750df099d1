"""Stage kinematics: inertia that a joint cannot tell from its parent's -> moved to the parent, exactly.

What a joint lets a link do relative to its parent leaves some combinations of the ten inertial parameters without any
effect on the difference between the two (M. Gautier and W. Khalil, Direct calculation of minimum set of inertial
parameters of serial robots, IEEE Trans. Robotics and Automation 6 (1990), 368-373): carried by the parent they give the
same kinetic energy and the same work of gravity.  Links are left with seven parameters or fewer.
Kept by its link, the rest need not look like a body: masses vanish and moments of inertia may be negative.
"""

from __future__ import annotations

from ..frames import GROUND
from ..graph import vectors as vec
from ..graph.core import Graph
from ..graph.tensors import subtract_matrices, symmetric
from ..graph.vectors import Mat3
from .link_inertia import SpatialInertia, no_inertia
from .tree import Link


def regroup(graph: Graph, links: tuple[Link, ...]) -> list[SpatialInertia]:
    """Spatial inertia of every link after moving towards ground all that can be moved; what reaches ground is gone."""
    inertias = [link.spatial for link in links]
    for k in graph.marked(reversed(range(len(links)))):
        link = links[k]
        part = movable(graph, link, inertias[k])
        if part.is_zero:
            continue
        inertias[k] = _less(inertias[k], part)
        if link.parent != GROUND:
            carried = part.turned(link.turn) if link.columns else part.turned(link.joint_rotation).turned(link.turn)
            inertias[link.parent] = inertias[link.parent].plus(carried.shifted(link.position))
    return inertias


def movable(graph: Graph, link: Link, inertia: SpatialInertia) -> SpatialInertia:
    """The part of a link's inertia that acts alike on its parent.

    Weld: all.  No rotation: the inertia tensor, which feels angular velocity only.  Rotation about a fixed point: the
    mass; about the z axis only: also the first moment along z and yy of the tensor, as xx = yy = yy, zz = 0.
    """
    o = vec.zero(graph)
    nothing = no_inertia(graph)
    if not link.columns:
        return inertia
    turns = [angular for angular, _ in link.columns]
    if all(x.is_zero for turn in turns for x in turn):
        return SpatialInertia(graph.zero, o, inertia.inertia)
    if any(not x.is_zero for _, linear in link.columns for x in linear):
        return nothing
    if len(turns) == 1 and turns[0][0].is_zero and turns[0][1].is_zero:
        yy = inertia.inertia[1][1]
        tensor: Mat3 = ((yy, graph.zero, graph.zero), (graph.zero, yy, graph.zero), o)
        return SpatialInertia(inertia.mass, (graph.zero, graph.zero, inertia.moment[2]), tensor)
    return SpatialInertia(inertia.mass, o, (o, o, o))


def _less(a: SpatialInertia, b: SpatialInertia) -> SpatialInertia:
    tensor = symmetric(subtract_matrices(a.inertia, b.inertia))
    return SpatialInertia(a.mass - b.mass, vec.sub(a.moment, b.moment), tensor)
