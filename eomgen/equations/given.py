"""Stage equations: Kinematics of given equations of motion M v' = f -> TreeEquations, as they are."""

from __future__ import annotations

from ..graph.core import Expr
from ..kinematics import Kinematics
from .tree_equations import TreeEquations

GIVEN = "given"  #: what stands where the name of a method would


def take_given(kinematics: Kinematics) -> TreeEquations:
    """The equations of a mechanism that has them; only the lower triangle of M is read."""
    given = kinematics.mechanism.given
    assert given is not None
    n = len(kinematics.v)
    lower = given.mass_matrix
    mass = tuple(tuple(lower[max(i, j)][min(i, j)] for j in range(n)) for i in range(n))
    bias = tuple(-f for f in given.forcing)
    inverse: list[Expr] = []
    for row, h in zip(mass, bias, strict=True):
        total = h
        for entry, a in zip(row, kinematics.a, strict=True):
            total = total + entry * a
        inverse.append(total)
    return TreeEquations(
        method=GIVEN,
        mass_matrix=mass,
        bias=bias,
        inverse_dynamics=tuple(inverse),
        kinetic_energy=given.kinetic_energy,
        potential_energy=given.potential_energy,
    )
