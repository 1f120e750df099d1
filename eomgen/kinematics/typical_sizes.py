"""Stage kinematics: a mechanism in any units -> typical sizes of its motions and forces."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..graph.core import Expr

if TYPE_CHECKING:
    from .kinematics import Kinematics


class Units:
    """Typical sizes of what the equations are made of, in any units: a length, a mass, and 1 s."""

    def __init__(self, kinematics: Kinematics) -> None:
        graph, length = kinematics.graph, kinematics.length_scale
        self.size = {"angle": graph.one, "length": length}
        mass = graph.zero
        for link in kinematics.links:
            turning = link.inertia[0][0] + link.inertia[1][1] + link.inertia[2][2]
            mass = mass + link.mass + turning / (length * length)
        # bodies without inertia are told from the solution, not from a division by zero
        some = graph.make("lt", graph.zero.id, mass.id)
        mass = Expr(graph, graph.make("select", some, mass.id, graph.one.id))
        #: twice the kinetic energy
        self.energy = mass * length * length
        self.motion = [graph.one] * 3 + [length] * 3  #: a twist or acceleration
        self.wrench = [self.energy] * 3 + [self.energy / length] * 3
        #: force along each coordinate of the tree
        self.force = [self.energy / self.of(kind) for kind in kinematics.velocity_kinds]

    def of(self, kind: str | float) -> Expr:
        """The size of a coordinate or constraint of this kind; those without a unit count as angles."""
        return self.size.get(kind, self.size["angle"]) if isinstance(kind, str) else self.size["angle"]
