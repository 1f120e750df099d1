"""Stage describe, mass properties: mass, centre of mass inertia as expressions; turning, shifting, adding them."""

from __future__ import annotations

from collections.abc import Sequence

from ..graph import vectors as vec
from ..graph.core import Expr, Graph
from ..graph.vectors import Mat3, Vec3
from ..records import dataclass


@dataclass(frozen=True)
class MassProperties:
    """Mass (kg), centre of mass (m) and inertia about it (kg m^2), in body axes."""

    mass: Expr
    com: Vec3
    inertia: Mat3


def point(graph: Graph, mass: Expr, at: Vec3) -> MassProperties:
    """A point mass."""
    o = vec.zero(graph)
    return MassProperties(mass, at, (o, o, o))


def symmetric(upper: Mat3) -> Mat3:
    """The upper triangle, mirrored."""
    return (upper[0], (upper[0][1], upper[1][1], upper[1][2]), (upper[0][2], upper[1][2], upper[2][2]))


def add_tensors(a: Mat3, b: Mat3) -> Mat3:
    """a + b"""
    return (vec.add(a[0], b[0]), vec.add(a[1], b[1]), vec.add(a[2], b[2]))


def turn_tensor(rotation: Mat3, inertia: Mat3) -> Mat3:
    """R I R^T of a symmetric I: from the axes that R turns to the axes it is written in."""
    half = vec.product(rotation, inertia)
    return symmetric(vec.product(half, vec.transpose(rotation)))


def shift_tensor(mass: Expr, arm: Vec3) -> Mat3:
    """mass (|d|^2 1 - d d^T): what a point at a distance d adds (Huygens-Steiner)."""
    x, y, z = arm
    mx, my, mz = vec.scale(mass, arm)
    return symmetric(
        ((my * y + mz * z, -(mx * y), -(mx * z)), (x, mx * x + mz * z, -(my * z)), (x, x, mx * x + my * y))
    )


def combine(graph: Graph, parts: Sequence[MassProperties]) -> MassProperties:
    """The sum of parts; a coordinate of the centre of mass that all share stays as it is written."""
    if len(parts) == 1:
        return parts[0]
    mass = graph.zero
    moment = vec.zero(graph)
    for part in parts:
        mass = mass + part.mass
        moment = vec.add(moment, vec.scale(part.mass, part.com))
    x, y, z = (
        parts[0].com[k] if all(part.com[k] == parts[0].com[k] for part in parts) else moment[k] / mass for k in range(3)
    )
    o = vec.zero(graph)
    inertia: Mat3 = (o, o, o)
    for part in parts:
        arm = vec.sub(part.com, (x, y, z))
        inertia = add_tensors(inertia, add_tensors(part.inertia, shift_tensor(part.mass, arm)))
    return MassProperties(mass, (x, y, z), inertia)
