"""Stage reading, methods in SymPy: the quantities that one method of derivation has, and equations near a state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from ..graph.core import Expr
from .bodies_apart import BodiesApart
from .names_of_unknowns import momentum_names
from .near_state import linearize
from .of_methods import (
    block_system,
    body_mass_matrix,
    body_velocities,
    gibbs_function,
    hamiltonian,
    momentum_rates,
)
from .quantities import Quantities
from .regular_state import told
from .writes_quantities import WritesQuantities

if TYPE_CHECKING:
    from .named_parts import ByName


class BlockSystem(NamedTuple):
    """A linear system of a method: ``matrix * unknowns = right``, SymPy matrices.

    Attributes
    ----------
    matrix : sympy.Matrix
        (n, n)
    unknowns : sympy.Matrix
        (n, 1), accelerations, reactions and multipliers.
    right : sympy.Matrix
        (n, 1)
    """

    matrix: Any
    unknowns: Any
    right: Any


class FreeBody(NamedTuple):
    """The equations of a body set free, in ground axes, moments about its centre of mass.

    Attributes
    ----------
    force : list of sympy.Eq
        m a_c = weight, force elements and reactions, along x, y, z.
    moment : list of sympy.Eq
        J alpha + omega x J omega = their moments.
    """

    force: list[Any]
    moment: list[Any]


class SymbolicLinearization(NamedTuple):
    """x' = A x + B u near a state, in displacements, velocities and changes of inputs.

    Attributes
    ----------
    A, B : sympy.Matrix
        (n, n), (n, n_u)
    states, inputs : tuple of str
        What the entries of x and u are called, as in ``Module.linearize``.
    intermediates : list of (sympy.Symbol, sympy.Expr)
        Named parts of large matrices, in order.
    """

    A: Any
    B: Any
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    intermediates: list[tuple[Any, Any]]


class QuantitiesOfMethods(WritesQuantities):
    """What the method of derivation has; every other method refuses it and says which have it."""

    @cached_property
    def gibbs_function(self) -> Any:
        """S (W^2 kg) of method ``gibbs_appell``: dS/dv' = M v' - Q_v on the tree; without terms free of v'."""
        return self._write("gibbs_function", lambda s: [gibbs_function(s)], "S_")[0]

    @cached_property
    def hamiltonian(self) -> Any:
        """H(q, p, t) (J) of method ``hamilton``, in the momenta ``p_theta``, ... of ``momentum_symbols``."""
        return self._write("hamiltonian", lambda s: [hamiltonian(s)], "H_")[0]

    @property
    def momentum_symbols(self) -> tuple[Any, ...]:
        """The symbols of the momenta in ``hamiltonian``, one for each of ``v``."""
        return tuple(map(self._symbol, momentum_names(self.kinematics)))

    @cached_property
    def momentum_rates(self) -> Any:
        """p' = -dH/dq + Q (n_v, 1) of method ``hamilton``, in q and v, without the forces of constraints."""
        return self._column("momentum_rates", momentum_rates)

    @cached_property
    def block_system(self) -> BlockSystem:
        """The linear system of methods ``augmented``, ``newton_euler`` and ``amalgamated``.

        ``augmented``: [M C_q^T; C_q 0] [v'; lambda] = [Q + Q_v; -gamma].  Of the others the unknowns are, of each body,
        the rates of its twist in the axes of its joint (``rod_alpha_x``, ``rod_a_x``; gravity subtracted) and the
        wrench of its joint (``A_M_x``, ``A_F_x``), then multipliers.
        """
        import sympy

        names: list[str] = []

        def choose(quantities: Quantities) -> list[Expr]:
            found = block_system(quantities)
            names[:] = found.unknowns
            return [*(x for row in found.matrix for x in row), *found.right]

        written, n = self._write("block_system", choose, "K_"), len(names)
        unknowns = [self._symbol(name) for name in names]
        parts = written[: n * n], unknowns, written[n * n :]
        return BlockSystem(*(sympy.Matrix(n, len(x) // n if n else 0, x) for x in parts))

    @cached_property
    def free_bodies(self) -> ByName[FreeBody]:
        """Newton's and Euler's equations of each body, of methods ``newton_euler`` and ``amalgamated``.

        Reactions of the joints of the tree are ``A_F_x``, ..., ``A_M_x``, ... on the body that the joint carries, at
        the joint, in ground axes; those of joints that close loops are written with their multipliers ``lambda_1``, ...
        """
        BodiesApart(Quantities(*self.fresh()))  # refuses other methods now
        return self._by_name("body", [body.name for body in self.kinematics.mechanism.bodies], self._free_body)

    def _free_body(self, name: str) -> FreeBody:
        written = self._write(f"free_bodies.{name}", lambda s: [x for p in BodiesApart(s).balance(name) for x in p])
        equations = _equations([*written[:3], *written[6:9]], [*written[3:6], *written[9:]])
        return FreeBody(equations[:3], equations[3:])

    @cached_property
    def joint_forces(self) -> ByName[list[Any]]:
        """Of each joint of the tree an equation along each direction in which it is free: reaction = drive.

        The left side is the component of the reaction in ``free_bodies``; the right side what force elements and
        constraint elements exert along the coordinate, 0 if there are none.
        """
        joints = BodiesApart(Quantities(*self.fresh())).joints  # refuses other methods
        return self._by_name("joint of the tree", joints, self._joint_force)

    def _joint_force(self, name: str) -> list[Any]:
        written = self._write(
            f"joint_forces.{name}", lambda s: [x for pair in BodiesApart(s).along_joint(name) for x in pair]
        )
        return _equations(written[::2], written[1::2])

    @cached_property
    def body_velocity_transformation(self) -> Any:
        """B_b (6 n_b, n) of the velocities of all bodies by those of ``independent``.

        Of each body the velocity of its centre of mass in ground axes, then its angular velocity in body axes.
        ``B_b.T * body_mass_matrix * B_b`` is ``mass_matrix``, less the inertia of drives.
        """
        return self._matrix("body_velocity_transformation", body_velocities, self.mobility.n_dof)

    @cached_property
    def body_mass_matrix(self) -> Any:
        """M_b (6 n_b, 6 n_b): mass and inertia of each body, for the velocities of ``body_velocity_transformation``."""
        return self._matrix("body_mass_matrix", body_mass_matrix, 6 * len(self.kinematics.mechanism.bodies))

    def linearize(self, at: Mapping[Any, Any] | None = None, *, equilibrium: bool = False) -> SymbolicLinearization:
        """The equations of motion near a state, x' = A x + B u, in symbols.

        Parameters
        ----------
        at : mapping, optional
            Name or symbol -> number, text or SymPy expression, of coordinates, velocities, parameters and inputs.
            Velocities that are not named are 0; everything else that is not named stays a symbol.
        equilibrium : bool
            Take it that the accelerations vanish at that state, which makes A shorter.

        Returns
        -------
        SymbolicLinearization
            Displacements of the independent coordinates, then the independent velocities, as states.

        Raises
        ------
        UnavailableError
            Constraints depend on inputs, or rates of coordinates are given as functions of velocities.
        SingularMassMatrixError
            The mass matrix has no inverse at the state.
        PartitionError
            The state is a dead centre: the velocities of ``independent`` do not tell the others.
        NonFiniteError
            An entry of A or B has no value at the state, such as for a spring of length 0.
        UsageError
            An unknown name, or a value that is no expression.

        Examples
        --------
        >>> import eomgen as eg
        >>> m = eg.Model("pendulum", gravity=(0, "-g", 0))
        >>> g, l, mass = (m.parameter(name) for name in ("g", "l", "m"))
        >>> hinge = m.revolute("hinge", m.ground, m.body("bob", mass=mass, com=(0, -l, 0)), coordinate="theta")
        >>> m.derive().linearize(at={"theta": 0}).A
        Matrix([
        [   0, 1],
        [-g/l, 0]])
        """
        import sympy

        values = self._read(at or {})
        states: list[tuple[str, ...]] = []

        def choose(quantities: Quantities) -> Sequence[Expr]:
            found = linearize(quantities, values, equilibrium)
            states.append(found.states)
            return [x for matrix in (found.A, found.B) for row in matrix for x in row]

        written = self._write("linearize", choose, "A_")
        self._require_finite("linearize", [*written, *(x for _, x in self._named["linearize"])], told(values))
        (names,), inputs = states, self.kinematics.input_names
        n = len(names)
        A, B = sympy.Matrix(n, n, written[: n * n]), sympy.Matrix(n, len(inputs), written[n * n :])
        return SymbolicLinearization(A, B, names, inputs, self._named.pop("linearize"))


def _equations(left: Sequence[Any], right: Sequence[Any]) -> list[Any]:
    import sympy

    return [sympy.Eq(a, b, evaluate=False) for a, b in zip(left, right, strict=True)]
