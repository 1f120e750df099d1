"""Stage equations: Kinematics -> TreeEquations, what every method of derivation must deliver for the spanning tree."""

from __future__ import annotations

from collections.abc import Callable

from ..graph.core import Expr
from ..kinematics import Kinematics

Rows = tuple[tuple[Expr, ...], ...]


class TreeEquations:
    """M(q) a + h(t, q, v, u) = generalized forces not in the model, on the coordinates of the spanning tree.

    Loops enter later, by B^T (M a + h) = 0 with the constraints of the kinematics; their multipliers do no work.

    Attributes
    ----------
    method : str
    mass_matrix : (n_v, n_v) rows, symmetric; may be given as a function and is then formed when it is first asked for
    bias : (n_v,) h, with gravity, force elements and inputs
    inverse_dynamics : (n_v,) M a + h formed in one go, cheaper than the product
    kinetic_energy, potential_energy : J; gravity and springs
    accelerations : (n_v,) a with M a + h = 0, of a method that has them without M; else None
    pivots : (n_v,) with ``accelerations``: all positive exactly where M is positive definite
    """

    def __init__(
        self,
        method: str,
        mass_matrix: Rows | Callable[[], Rows],
        bias: tuple[Expr, ...],
        inverse_dynamics: tuple[Expr, ...],
        kinetic_energy: Expr,
        potential_energy: Expr,
        accelerations: tuple[Expr, ...] | None = None,
        pivots: tuple[Expr, ...] = (),
    ) -> None:
        self.method = method
        self._mass_matrix = mass_matrix
        self.bias = bias
        self.inverse_dynamics = inverse_dynamics
        self.kinetic_energy = kinetic_energy
        self.potential_energy = potential_energy
        self.accelerations = accelerations
        self.pivots = pivots

    @property
    def mass_matrix(self) -> Rows:
        """M, row by row."""
        if callable(self._mass_matrix):
            self._mass_matrix = self._mass_matrix()
        return self._mass_matrix


Method = Callable[[Kinematics], TreeEquations]
