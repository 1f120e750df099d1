"""Kinematics -> TreeEquations by Hamilton's canonical equations.

q' = dH/dp, p' = -dH/dq + Q with H(q, p, t) = (p - b) . M^-1 (p - b) / 2 - T_0 + V, where T = v . M v / 2 + b . v + T_0
(Shabana, Computational Dynamics, sec. 4.11; Goldstein, Classical Mechanics, 3rd ed., sec. 8.1).  Momenta are dL/dv.
-dH/dq at constant p is taken as dL/dq at constant v, which Legendre's transformation says it is, and dp/dt = p' is
solved for v': M^-1 inside of H would square what rounding is blown up by, and M of a tree whose constraints are to be
embedded may have no inverse.  Where q' = N v, for Euler parameters, the momenta of angular velocities w obey
p' = -N^T dH/dq - w x p + Q (the canonical form of the equations of Boltzmann and Hamel; Poincare, 1901).
"""

from __future__ import annotations

from ...model.equations import momenta_and_rates
from .. import Kinematics
from ..wrenches import find_drives
from .lagrange import form_energies, momentum_equations
from .tree_equations import TreeEquations, direct_equations


def derive(kinematics: Kinematics) -> TreeEquations:
    """Canonical equations of the spanning tree, or of a bare Lagrangian."""
    bare = kinematics.mechanism.lagrangian
    if bare is not None:
        tree = direct_equations(kinematics, "hamilton")
        momenta, rates = momenta_and_rates(bare, kinematics.q, kinematics.v)
        tree.canonical = (*momenta, *rates)
        return tree
    kinetic, potential = form_energies(kinematics)
    for drive in find_drives(kinematics):
        kinetic = kinetic + drive.kinetic_energy
    return momentum_equations(kinematics, "hamilton", kinetic, potential)
