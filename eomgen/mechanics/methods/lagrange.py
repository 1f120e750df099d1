"""Kinematics -> TreeEquations by Lagrange's equations, differentiated on the graph.

d/dt (dT/dv) - dT/dq + dV/dq = Q (Shabana, Computational Dynamics, sec. 4.4 ff.).  T and V come from the velocity
recursion and are linear in the number of bodies; one reverse gradient and one forward derivative keep the equations
linear too.  Where q' = N v, for Euler parameters, the equations are those of
Boltzmann and Hamel with the structure constants of rotations, w being angular velocities in turned axes:
d/dt (dT/dv) + w x dT/dw - N^T (dT/dq - dV/dq) = Q_v (Meirovitch, Methods of Analytical Dynamics, 1970, sec. 4.13).
"""

from __future__ import annotations

from .. import Kinematics
from .analytical import form_energies, momentum_equations
from .tree_equations import TreeEquations, take_given


def derive(kinematics: Kinematics) -> TreeEquations:
    """Lagrange's equations of the spanning tree; those of a bare Lagrangian are given."""
    if kinematics.mechanism.bare:
        return take_given(kinematics, "lagrange")
    tree = momentum_equations(kinematics, "lagrange", *form_energies(kinematics))
    tree.canonical = ()
    return tree
