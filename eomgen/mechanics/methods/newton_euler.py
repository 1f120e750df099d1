"""Kinematics -> Newton-Euler equations in absolute accelerations and the reactions of all joints.

Every body is set free and every joint, of the tree and cut ones alike, replaced by its reaction (Shabana,
Computational Dynamics, ch. 3 and sec. 7.6).  Unknowns are the six accelerations of each body, the six components of
the wrench through each joint of the tree, and a multiplier for each equation of a cut joint or coupling.
"""

from __future__ import annotations

from .. import Kinematics
from .free_bodies import free_body_equations
from .tree_equations import TreeEquations


def derive(kinematics: Kinematics) -> TreeEquations:
    """Newton-Euler equations of all bodies."""
    return free_body_equations(kinematics, "newton_euler", with_joints=False)
