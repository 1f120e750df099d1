"""Kinematics -> absolute accelerations, joint accelerations and reactions in one sparse linear system.

The amalgamated formulation (Shabana, Computational Dynamics, sec. 7.8: recursive methods, "amalgamated formulations"):
nothing is eliminated, so that every coefficient is simple and most are zero.  Unknowns are the six accelerations of
each body, the accelerations of the joint coordinates, the wrench through each joint of the tree, and a multiplier for
each equation of a cut joint or coupling.
"""

from __future__ import annotations

from ...expr.core import Expr
from ...expr.spatial import scaled, sub
from .. import Kinematics
from ..constraint_functions import Units
from .free_bodies import Forces, FreeBodies, Unknowns, cut_joints, free_body_equations
from .tree_equations import LinearSystem, TreeEquations


def derive(kinematics: Kinematics) -> TreeEquations:
    """The amalgamated equations of all bodies and joints."""
    return free_body_equations(kinematics, "amalgamated", _system(kinematics))


def _system(kinematics: Kinematics) -> LinearSystem:
    bodies, unknowns, units = FreeBodies(kinematics), Unknowns(kinematics), Units(kinematics)
    along = [range(link.first, link.first + len(link.columns)) for link in kinematics.links]
    rates = [units.of(kind) for kind in kinematics.velocity_kinds]
    parts = [
        (unknowns.six(units.motion), unknowns.take([rates[j] for j in joint]), unknowns.six(units.wrench))
        for joint in along
    ]
    motions, reactions = [m for m, _, _ in parts], [f for _, _, f in parts]
    a = [x for _, own, _ in parts for x in own]
    forces = Forces(bodies, cut_joints(bodies), unknowns, units)
    balances = bodies.balances(motions, reactions)
    closing = forces.close(balances, motions, a)
    residuals: list[Expr] = []
    sizes: list[Expr] = []
    for k, (link, balance) in enumerate(zip(kinematics.links, balances, strict=True)):
        joint = bodies.relative(k, motions)
        for c, column in enumerate(link.columns):
            joint = sub(joint, scaled(a[link.first + c], column))
        residuals += [*joint[0], *joint[1], *bodies.powers(k, reactions[k], a, forces.pulls)]
        residuals += [*balance[0], *balance[1]]
        sizes += [*units.motion, *(units.force[j] for j in along[k]), *units.wrench]
    return forces.solve(residuals, sizes, closing, a)
