"""Stage equations: Kinematics -> TreeEquations, what every method of derivation must deliver for the spanning tree."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from types import FunctionType

from ..graph.core import Expr
from ..graph.differentiate import jacobian
from ..graph.substitute import substitute
from ..kinematics import Kinematics
from ..kinematics.link_axes import Turned
from ..records import dataclass
from .articulated import TreeMotion

Rows = tuple[tuple[Expr, ...], ...]


@dataclass(frozen=True)
class LinearSystem:
    """K z = r, whose solution holds the accelerations: what the forms solve that keep reactions as unknowns.

    Attributes
    ----------
    unknowns : names of the symbols z
    places : (row, column) of the entries of K that do not vanish identically
    entries : those entries, of (t, q, v, u)
    right : r
    relaxed : (row, column) of constraint equations and their reactions.  Where constraints are redundant, K is
        singular; solvers subtract a small number there and refine the result until K z = r holds.
    sizes : of each equation, then of each unknown, its unit made of a length, a mass and 1 s, of parameters only: what
        K is balanced from, so that results do not depend on units.  Entries of a redundant equation may be nothing but
        rounding, so that those of constraints are not scaled by the size of their entries at all.
    accelerations : (n_v,) a in terms of z and the state
    """

    unknowns: tuple[str, ...]
    places: tuple[tuple[int, int], ...]
    entries: tuple[Expr, ...]
    right: tuple[Expr, ...]
    relaxed: tuple[tuple[int, int], ...]
    sizes: tuple[Expr, ...]
    accelerations: tuple[Expr, ...]


def linear_system(
    residuals: Sequence[Expr],
    unknowns: Sequence[Expr],
    relaxed: Sequence[tuple[int, int]],
    sizes: Sequence[Expr],
    accelerations: Sequence[Expr],
) -> LinearSystem:
    """The system whose residuals K z - r are given, linear in the symbols z."""
    entries = jacobian(list(residuals), list(unknowns))
    places = tuple(sorted(place for place, entry in entries.items() if not entry.is_zero))
    still = dict.fromkeys(unknowns, unknowns[0].graph.zero)
    return LinearSystem(
        unknowns=tuple(str(z.node[1]) for z in unknowns),
        places=places,
        entries=tuple(entries[place] for place in places),
        right=tuple(-r for r in substitute(list(residuals), still)),
        relaxed=tuple(relaxed),
        sizes=tuple(sizes),
        accelerations=tuple(accelerations),
    )


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
    system : the linear system that the method solves for its accelerations; None where M and h are enough
    canonical : (2 n_v,) of a method in canonical variables: p = dT/dv, then -dH/dq + Q; else empty
    turned : the same system in velocities in which it is shorter, where there are free joints; else None
    constrained : (rows, term) -> what the constraints' multipliers leave of the accelerations, of a method that has it
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
        system: LinearSystem | None = None,
        canonical: tuple[Expr, ...] = (),
        turned: Turned | None = None,
        constrained: Callable[..., TreeMotion] | None = None,
    ) -> None:
        if isinstance(mass_matrix, FunctionType) or isinstance(constrained, FunctionType):
            raise TypeError("a function that holds expressions is not copied with them: give a functools.partial")
        self.method = method
        self._mass_matrix = mass_matrix
        self.bias = bias
        self.inverse_dynamics = inverse_dynamics
        self.kinetic_energy = kinetic_energy
        self.potential_energy = potential_energy
        self.accelerations = accelerations
        self.pivots = pivots
        self.system = system
        self.canonical = canonical
        self.turned = turned
        self.constrained = constrained

    def without_accelerations(self) -> TreeEquations:
        """The same equations, to be solved with M."""
        same = copy(self)
        same.accelerations, same.pivots = None, ()
        return same

    def take_mass_matrix(self, other: TreeEquations) -> None:
        """Have the mass matrix of the same system by another method."""
        self._mass_matrix = other._mass_matrix

    @property
    def mass_matrix(self) -> Rows:
        """M, row by row."""
        if callable(self._mass_matrix):
            self._mass_matrix = self._mass_matrix()
        return self._mass_matrix


Method = Callable[[Kinematics], TreeEquations]
