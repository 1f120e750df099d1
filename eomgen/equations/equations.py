"""Stage equations: Kinematics -> TreeEquations, what every method of derivation must deliver for the spanning tree."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..graph.core import Expr
from ..kinematics import Kinematics


@dataclass(frozen=True)
class TreeEquations:
    """M(q) a + h(t, q, v, u) = generalized forces not in the model, on the coordinates of the spanning tree.

    Loops enter later, by B^T (M a + h) = 0 with the constraints of the kinematics; their multipliers do no work.

    Attributes
    ----------
    mass_matrix : (n_v, n_v) rows, symmetric
    bias : (n_v,) h, with gravity, force elements and inputs
    inverse_dynamics : (n_v,) M a + h formed in one go, cheaper than the product
    kinetic_energy, potential_energy : J; gravity and springs
    """

    method: str
    mass_matrix: tuple[tuple[Expr, ...], ...]
    bias: tuple[Expr, ...]
    inverse_dynamics: tuple[Expr, ...]
    kinetic_energy: Expr
    potential_energy: Expr


Method = Callable[[Kinematics], TreeEquations]
