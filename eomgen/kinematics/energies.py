"""Stage kinematics, energies: Kinematics -> kinetic and potential energy as graph expressions.

The methods that work with spatial inertias share these; Lagrange's method derives its equations from energies of its
own.
"""

from __future__ import annotations

from ..frames import GROUND
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.vectors import Vec3
from .kinematics import Kinematics


def kinetic_energy(kinematics: Kinematics) -> Expr:
    """T = sum of twist . (inertia twist) / 2 over the bodies (J), each in its link's axes about its origin."""
    total = kinematics.graph.zero
    for link, (omega, v) in total.graph.marked(zip(kinematics.links, kinematics.twists, strict=True)):
        turning, linear = link.spatial.times(omega, v)
        total = total + (vec.dot(omega, turning) + vec.dot(v, linear))
    return 0.5 * total


def potential_energy(kinematics: Kinematics) -> Expr:
    """V of gravity on the first moments, g in link axes carried outwards, and of the springs (J)."""
    graph = kinematics.graph
    total = graph.zero
    heights: list[tuple[Expr, Vec3]] = []
    for link in graph.marked(kinematics.links):
        height, pull = (graph.zero, kinematics.mechanism.gravity) if link.parent == GROUND else heights[link.parent]
        height, pull = height + vec.dot(pull, link.position), link.down(pull)
        heights.append((height, pull))
        total = total - (link.spatial.mass * height + vec.dot(pull, link.spatial.moment))
    for terms in kinematics.forces:
        if terms.potential is not None:
            total = total + terms.potential
    return total
