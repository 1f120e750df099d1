"""Kinematics -> TreeEquations, what every method of derivation must deliver for the spanning tree."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import FunctionType

from ...expr.core import Expr, substitute
from ...expr.differentiate import jacobian
from ...expr.records import Record
from ...expr.tensors import combined
from ...expr.vectors import Rows
from ...model.equations import momenta_and_rates
from .. import Kinematics
from ..link_frames import Turned
from ..wrenches import find_drives
from .recursions import TreeMotion

# -- what a method delivers --------------------------------------------------------------------------------------------


class LinearSystem(Record):
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


@dataclass(eq=False, repr=False)
class TreeEquations:
    """M(q) a + h(t, q, v, u) = generalized forces not in the model, on the coordinates of the spanning tree.

    Loops enter later, by B^T (M a + h) = 0 with the constraints of the kinematics; their multipliers do no work.

    Attributes
    ----------
    method : str
    mass : (n_v, n_v) rows, symmetric, or a function that forms them; read by ``mass_matrix``
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

    method: str
    mass: Rows | Callable[[], Rows]
    bias: tuple[Expr, ...]
    inverse_dynamics: tuple[Expr, ...]
    kinetic_energy: Expr
    potential_energy: Expr
    accelerations: tuple[Expr, ...] | None = None
    pivots: tuple[Expr, ...] = ()
    system: LinearSystem | None = None
    canonical: tuple[Expr, ...] = ()
    turned: Turned | None = None
    constrained: Callable[..., TreeMotion] | None = None

    def __post_init__(self) -> None:
        if isinstance(self.mass, FunctionType) or isinstance(self.constrained, FunctionType):
            raise TypeError("a function that holds expressions is not copied with them: give a functools.partial")

    @property
    def mass_matrix(self) -> Rows:
        """M, row by row, formed when first used."""
        if callable(self.mass):
            self.mass = self.mass()
        return self.mass


Method = Callable[[Kinematics], TreeEquations]


# -- inertia of drives -------------------------------------------------------------------------------------------------

# A rotor geared to a coordinate y adds J y'^2 / 2 to the kinetic energy, hence J y_q^T y'' to the equations (its
# gyroscopic effect is left out, as in MuJoCo and Pinocchio); for a coordinate of the tree that is J on the diagonal of
# M.


def with_armature(method: Method) -> Method:
    """The method, with the inertia of drives added to what it derives."""

    def derive(kinematics: Kinematics) -> TreeEquations:
        return add_armature(kinematics, method(kinematics))

    return derive


def add_armature(kinematics: Kinematics, tree: TreeEquations) -> TreeEquations:
    """Add J y_q^T y_q to M, and its part to bias, inverse dynamics and kinetic energy.

    Accelerations that a method has without M, and a turned system, must hold the inertia of drives already.
    """
    if not (drives := find_drives(kinematics)):
        return tree
    bias, inverse, kinetic = list(tree.bias), list(tree.inverse_dynamics), tree.kinetic_energy
    still = dict.fromkeys(kinematics.a, kinematics.graph.zero)
    for drive in drives:
        rest = substitute([drive.acceleration], still)[0]
        for i, slope in enumerate(drive.slope):
            if not slope.is_zero:
                bias[i] = bias[i] + drive.inertia * (slope * rest)
                inverse[i] = inverse[i] + drive.inertia * (slope * drive.acceleration)
        kinetic = kinetic + drive.kinetic_energy
    mass = partial(_mass_matrix, tree, [(drive.inertia, drive.slope) for drive in drives])
    return replace(tree, mass=mass, bias=tuple(bias), inverse_dynamics=tuple(inverse), kinetic_energy=kinetic)


def _mass_matrix(tree: TreeEquations, slopes: Sequence[tuple[Expr, Sequence[Expr]]]) -> Rows:
    """M of the tree and J y_q^T y_q of each drive."""
    mass = [list(row) for row in tree.mass_matrix]
    for inertia, slope in slopes:
        moving = [i for i, part in enumerate(slope) if not part.is_zero]
        for i in moving:
            for j in moving:
                mass[i][j] = mass[i][j] + inertia * (slope[i] * slope[j])
    return tuple(tuple(row) for row in mass)


# -- equations of the user ---------------------------------------------------------------------------------------------


GIVEN = "given"  #: what stands where the name of a method would


def direct_equations(kinematics: Kinematics, method: str = GIVEN) -> TreeEquations:
    """The equations of a mechanism that has them; only the lower triangle of M is read."""
    equations = kinematics.mechanism.given
    assert equations is not None
    n = len(kinematics.v)
    lower = equations.mass_matrix
    mass = tuple(tuple(lower[max(i, j)][min(i, j)] for j in range(n)) for i in range(n))
    bias = tuple(-f for f in equations.forcing)
    if (bare := kinematics.mechanism.lagrangian) is None:
        moved = [combined(h, row, kinematics.a) for row, h in zip(mass, bias, strict=True)]
    else:  # shorter
        momenta, rates = momenta_and_rates(bare, kinematics.q, kinematics.v)
        moved = [d - r for d, r in zip(kinematics.total_derivative(momenta), rates, strict=True)]
    return TreeEquations(
        method=method,
        mass=mass,
        bias=bias,
        inverse_dynamics=tuple(moved),
        kinetic_energy=equations.kinetic_energy,
        potential_energy=equations.potential_energy,
    )
