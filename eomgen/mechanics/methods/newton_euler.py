"""Kinematics -> Newton-Euler equations in absolute accelerations and the reactions of all joints.

Every body is set free and every joint, of the tree and cut ones alike, replaced by its reaction (Shabana,
Computational Dynamics, ch. 3 and sec. 7.6).  Unknowns are the six accelerations of each body, the six components of
the wrench through each joint of the tree, and a multiplier for each equation of a cut joint or coupling.
"""

from __future__ import annotations

from ...expr.core import Expr
from ...expr.spatial import add, dot, scaled, sub
from ...expr.tensors import solve_symmetric
from .. import Kinematics
from ..constraint_functions import Units
from .free_bodies import Forces, FreeBodies, Unknowns, cut_joints, free_body_equations
from .tree_equations import LinearSystem, TreeEquations


def derive(kinematics: Kinematics) -> TreeEquations:
    """Newton-Euler equations of all bodies."""
    return free_body_equations(kinematics, "newton_euler", _system(kinematics))


def _system(kinematics: Kinematics) -> LinearSystem:
    bodies, unknowns, units = FreeBodies(kinematics), Unknowns(kinematics), Units(kinematics)
    pairs = [(unknowns.six(units.motion), unknowns.six(units.wrench)) for _ in kinematics.links]
    motions, reactions = [m for m, _ in pairs], [f for _, f in pairs]
    relative = [bodies.relative(k, motions) for k in range(len(pairs))]
    a: list[Expr] = []
    for link, motion in zip(kinematics.links, relative, strict=True):  # a = S^+ of the relative acceleration
        gram = [[dot(x, y) for y in link.columns] for x in link.columns]
        a += solve_symmetric(gram, [dot(column, motion) for column in link.columns])
    cuts = cut_joints(bodies)
    forces = Forces(bodies, cuts, unknowns, units)
    pulls = forces.pulls
    residuals: list[Expr] = []
    sizes: list[Expr] = []
    balances = bodies.balances(motions, reactions)
    closing = forces.close(balances, motions, a)
    for k, (link, balance) in enumerate(zip(kinematics.links, balances, strict=True)):
        # across the joint no relative acceleration, along it no force: two parts of one vector that are at right angles
        joint = relative[k]
        for c, column in enumerate(link.columns):
            joint = sub(joint, scaled(a[link.first + c], column))
        for c, power in enumerate(bodies.powers(k, reactions[k], a, pulls)):
            column = link.columns[c]
            size = units.of(kinematics.velocity_kinds[link.first + c])
            joint = add(joint, scaled(power * (size * size / units.energy), column))  # in the unit of accelerations
        residuals += [*joint[0], *joint[1], *balance[0], *balance[1]]
        sizes += [*units.motion, *units.wrench]
    return forces.solve(residuals, sizes, closing, a)
