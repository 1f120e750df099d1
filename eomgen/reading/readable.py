"""A derivation -> every quantity of its equations as SymPy, an attribute each."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple

from ..base.notation import Notation
from ..graph.core import Expr
from ..kinematics.topology import acceleration_name
from .methods import (
    BodiesApart,
    block_system,
    body_mass_matrix,
    body_velocities,
    gibbs_function,
    hamiltonian,
    model_notation,
    momentum_names,
    momentum_rates,
)
from .near_state import linearize, told
from .quantities import PointMotion, Quantities, require_bodies
from .tree_system import MANY, TreeParts, TreeSystem, is_long, tree_parts
from .writes_quantities import WritesQuantities

if TYPE_CHECKING:
    from .named_parts import ByName, NamedSum, SpatialMotion

# -- quantities of methods ---------------------------------------------------------------------------------------------


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


# -- quantities of all methods -----------------------------------------------------------------------------------------

# A class that inherits :class:`Readable` says what was derived (``fresh``), what SymPy object stands for a name, and
# what values are put in; :class:`~.displayed.ReadingView` is the same derivation with other answers.


class Readable(QuantitiesOfMethods):
    """The quantities of derived equations as SymPy expressions and matrices, each made when it is first asked for.

    Matrices of the size of the degrees of freedom belong to the velocities of ``independent``; those of the size of
    the tree to all velocities ``v``.  In open chains both are the same.
    """

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.kinematics.mechanism.name

    @property
    @abstractmethod
    def method(self) -> str:
        """Name of the method of derivation."""

    @property
    def independent(self) -> tuple[str, ...]:
        """Names of the independent coordinates."""
        return self.mobility.independent

    @property
    def acceleration_names(self) -> tuple[str, ...]:
        """Names of the accelerations that ``mass_matrix`` and ``force`` are for."""
        k = self.kinematics
        return tuple(acceleration_name(k.velocity_names[k.velocity_labels.index(n)]) for n in self.independent)

    @property
    def constraint_names(self) -> tuple[str, ...]:
        """Names of the rows of ``constraint_jacobian``, such as ``C.r_x`` of joint C; nonholonomic ones last."""
        return tuple(self.kinematics.constraints.labels[i] for i in self.mobility.independent_rows)

    @cached_property
    def notation(self) -> Notation:
        """How names are printed: ``.latex("theta1_dot")``, ``.text(name)``, ``.html(name)``, ``.mathtext(name)``."""
        return model_notation(self.kinematics, self.names_put_in)

    # -- symbols ------------------------------------------------------------------------------------------------------
    @property
    def q(self) -> tuple[Any, ...]:
        """Coordinates of the spanning tree, SymPy symbols."""
        return tuple(map(self._symbol, self.kinematics.names))

    @property
    def v(self) -> tuple[Any, ...]:
        """Velocities of the spanning tree, SymPy symbols."""
        return tuple(map(self._symbol, self.kinematics.velocity_names))

    @property
    def parameters(self) -> tuple[Any, ...]:
        """Parameters, SymPy symbols."""
        return tuple(map(self._symbol, self.kinematics.parameter_names))

    # -- energies -----------------------------------------------------------------------------------------------------
    @cached_property
    def T(self) -> Any:
        """Kinetic energy (J)."""
        return self._write("T", lambda s: [s.kinetic_energy])[0]

    @cached_property
    def V(self) -> Any:
        """Potential energy of gravity and springs (J); of a bare Lagrangian -L at rest."""
        return self._write("V", lambda s: [s.potential_energy])[0]

    @cached_property
    def lagrangian(self) -> Any:
        """T - V (J)."""
        return self._write("lagrangian", lambda s: [s.lagrangian], "L_")[0]

    @cached_property
    def momenta(self) -> Any:
        """p = dT/dv (n_v, 1), conjugate to the velocities ``v``."""
        return self._column("momenta", lambda s: s.momenta)

    # -- equations of motion ------------------------------------------------------------------------------------------
    @cached_property
    def _motion(self) -> tuple[list[tuple[Any, Any]], Any, Any]:
        import sympy

        n = self.mobility.n_dof
        written = self._write("mass_matrix", lambda s: s.motion[0], "z", lambda s: s.motion[1])
        named = self._named["force"] = self._named["mass_matrix"]
        self._all["force"] = self._all["mass_matrix"]  # they are written together
        return named, sympy.Matrix(n, n, written[: n * n]), sympy.Matrix(n, 1, written[n * n :])

    @property
    def mass_matrix(self) -> Any:
        """sympy.Matrix (n, n), n the degrees of freedom."""
        return self._motion[1]

    @property
    def force(self) -> Any:
        """sympy.Matrix (n, 1): ``mass_matrix * v' = force``; it is ``quadratic_velocity + generalized_forces``."""
        return self._motion[2]

    @property
    def intermediates(self) -> list[tuple[Any, Any]]:
        """Named subexpressions of a large mass matrix and force, in order: (symbol, expression); empty when small."""
        return self._motion[0]

    @cached_property
    def quadratic_velocity(self) -> Any:
        """Q_v (n, 1): Coriolis, centrifugal and gyroscopic terms, and what prescribed motions ask for."""
        return self._column("quadratic_velocity", lambda s: s.quadratic_velocity)

    @cached_property
    def generalized_forces(self) -> NamedSum:
        """Q (n, 1) of gravity and all force elements; ``generalized_forces["motor"]`` is that of one alone.

        ``.parts`` is a dict of all.  Gravity is ``"gravity"``; a bare Lagrangian has ``"potential"``, ``"forces"`` and
        ``"dissipation"``.
        """
        import sympy

        from .named_parts import NamedSum

        n = self.mobility.n_dof
        names: list[str] = []

        def choose(s: Quantities) -> list[Expr]:
            names[:] = s.forces
            return [*s.total_force, *(x for force in s.forces.values() for x in force)]

        written = self._write("generalized_forces", choose, "Q_")
        parts = {name: sympy.Matrix(n, 1, written[(k + 1) * n : (k + 2) * n]) for k, name in enumerate(names)}
        return NamedSum.of(written[:n], parts, self._plain)

    @property
    def states(self) -> tuple[Any, ...]:
        """First-order states, SymPy symbols."""
        return tuple(map(self._symbol, self.kinematics.state_names))

    @cached_property
    def state_rates(self) -> Any:
        """s' (n_s, 1) of the first-order states ``states``."""
        return self._column("state_rates", lambda s: s.kinematics.state_rates)

    @property
    def sampled(self) -> tuple[Any, ...]:
        """Sampled states in the order of renewal, behind t for each of their clocks, SymPy symbols."""
        return tuple(self._symbol(name) for name, _ in self.kinematics.sampled)

    @cached_property
    def sampled_values(self) -> Any:
        """What ``sampled`` become (n, 1), one after the other; for t: the time of the next sample."""
        return self._column("sampled_values", lambda s: [x for _, x in s.kinematics.sampled])

    # -- constraints --------------------------------------------------------------------------------------------------
    @cached_property
    def constraints(self) -> Any:
        """C(q, t) (m, 1), which vanishes: the holonomic equations, without redundant ones."""
        return self._column("constraints", lambda s: s.constraints)

    @cached_property
    def velocity_constraints(self) -> Any:
        """C_q v + C_t (n_c, 1), which vanishes: rates of the holonomic equations, then the nonholonomic ones."""
        return self._column("velocity_constraints", lambda s: s.velocity_constraints)

    @cached_property
    def constraint_jacobian(self) -> Any:
        """C_q (n_c, n_v), nonholonomic rows last: the derivative of ``velocity_constraints`` by ``v``."""
        return self._matrix("constraint_jacobian", lambda s: s.constraint_jacobian, len(self.kinematics.v))

    @cached_property
    def gamma(self) -> Any:
        """gamma (n_c, 1) of C'' = C_q v' + gamma = 0."""
        return self._column("gamma", lambda s: s.gamma)

    @cached_property
    def velocity_transformation(self) -> Any:
        """B (n_v, n) of v = B v_i + b, v_i the velocities of ``independent``; b is ``velocity_offset``."""
        return self._matrix("velocity_transformation", lambda s: s.transformation.matrix, self.mobility.n_dof)

    @cached_property
    def velocity_offset(self) -> Any:
        """b (n_v, 1) of v = B v_i + b: what drivers and other motions over time add; 0 without them."""
        return self._column("velocity_offset", lambda s: s.transformation.offset)

    @cached_property
    def acceleration_offset(self) -> Any:
        """a (n_v, 1) of v' = B v_i' + a."""
        return self._column("acceleration_offset", lambda s: s.transformation.acceleration_offset)

    @cached_property
    def has_long_loops(self) -> bool:
        """Whether loops make ``mass_matrix`` and ``force`` so long that ``tree_system`` is read more easily."""
        if self.mobility.n_dof in (0, len(self.kinematics.v)):
            return False
        return is_long(Quantities(*self.fresh())) or len(self.intermediates) > MANY

    @cached_property
    def tree_system(self) -> TreeSystem:
        """M_t v' = f_t + C^T lambda, C v' + gamma = 0: the parts that long ``mass_matrix`` and ``force`` are made of.

        With v' = B v_i' + a, which the constraints give, M = B^T M_t B and f = B^T (f_t - M_t a).  Where
        ``has_long_loops``, ``zeros`` names the coordinates on which M and f do not depend; 0 stands for them in all
        parts.
        """
        import sympy

        n_v, n_c = len(self.kinematics.v), len(self.constraint_names)
        formed: list[TreeParts] = []

        def choose(quantities: Quantities) -> list[Expr]:
            formed[:] = [tree_parts(quantities, self.has_long_loops)]
            return formed[0].flat

        written = iter(self._write("tree_system", choose, "z", lambda _: formed[0].given))
        shapes = ((n_v, n_v), (n_v, 1), (n_c, n_v), (n_c, 1))
        mass, force, C, gamma = (sympy.Matrix(m, n, [next(written) for _ in range(m * n)]) for m, n in shapes)
        return TreeSystem(mass, force, C, gamma, formed[0].zeros)

    # -- motion of bodies and markers ---------------------------------------------------------------------------------
    def _places(self) -> tuple[str, ...]:
        """Names of bodies and of named markers."""
        require_bodies(self.kinematics)
        mechanism = self.kinematics.mechanism
        return (*(b.name for b in mechanism.bodies), *(marker.label for marker in mechanism.named_markers))

    @cached_property
    def poses(self) -> ByName[Any]:
        """Pose (4, 4) of each body and named marker in ground axes: ``poses["rod"]``, ``poses["rod.tip"]``."""
        return self._by_name("body or marker", self._places(), self._pose)

    def _pose(self, name: str) -> Any:
        return self._matrix(f"poses.{name}", lambda s: s.pose(name), 4)

    @cached_property
    def velocities(self) -> ByName[SpatialMotion]:
        """Velocity of each body and named marker, ground axes: ``velocities["rod"].angular``, ``.linear`` ..."""
        return self._by_name(
            "body or marker", self._places(), partial(self._spatial, "velocities", Quantities.velocity)
        )

    @cached_property
    def accelerations(self) -> ByName[SpatialMotion]:
        """Acceleration of each body and named marker, ground axes: ``accelerations["rod"].angular``, ``.linear`` ..."""
        return self._by_name(
            "body or marker", self._places(), partial(self._spatial, "accelerations", Quantities.acceleration)
        )

    def _spatial(self, what: str, of: Callable[[Quantities, str], PointMotion], name: str) -> SpatialMotion:
        import sympy

        from .named_parts import SpatialMotion

        written = self._write(f"{what}.{name}", lambda s: [x for part in of(s, name) for x in part])
        return SpatialMotion(*(sympy.Matrix(3, 1, written[k : k + 3]) for k in (0, 3, 6)))

    @cached_property
    def loop_coordinates(self) -> ByName[Any]:
        """Coordinates of the joints that close loops, as functions of ``q``: ``loop_coordinates["s"]``."""
        return self._by_name("coordinate of a cut joint", self.kinematics.loop_coordinates.names, self._loop_coordinate)

    def _loop_coordinate(self, name: str) -> Any:
        return self._write(f"loop_coordinates.{name}", lambda s: [s.loop_coordinates[name]])[0]

    def in_plain_symbols(self) -> Readable:
        """The same quantities in plain symbols; these equations, where they are in no functions of time."""
        return self
