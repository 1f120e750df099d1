"""Kinematics -> absolute accelerations, joint accelerations and reactions in one sparse linear system.

The amalgamated formulation (Shabana, Computational Dynamics, sec. 7.8: recursive methods, "amalgamated formulations"):
nothing is eliminated, so that every coefficient is simple and most are zero.  Unknowns are the six accelerations of
each body, the accelerations of the joint coordinates, the wrench through each joint of the tree, and a multiplier for
each equation of a cut joint or coupling.
"""

from __future__ import annotations

from .. import Kinematics
from .free_bodies import free_body_equations
from .tree_equations import TreeEquations


def derive(kinematics: Kinematics) -> TreeEquations:
    """The amalgamated equations of all bodies and joints."""
    return free_body_equations(kinematics, "amalgamated", with_joints=True)
