"""Mass, centre of mass inertia as expressions; turning, shifting, adding them."""

from __future__ import annotations

from collections.abc import Sequence

from ...base.records import dataclass
from ...expr import vectors as vec
from ...expr.core import Expr, Graph
from ...expr.tensors import add_matrices, shift_tensor
from ...expr.vectors import Mat3, Vec3


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
        inertia = add_matrices(inertia, add_matrices(part.inertia, shift_tensor(part.mass, arm)))
    return MassProperties(mass, (x, y, z), inertia)
