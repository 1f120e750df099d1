"""The table of quantities: every quantity of derived equations by name, formed, written in SymPy, an attribute each."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property, partial
from importlib import import_module
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from ..base.texts import acceleration_name, hint
from ..errors import NonFiniteError, at_odds, incomplete
from ..expr.core import Expr, Graph, copied, symbols_of
from ..expr.evaluate import evaluate
from ..expr.notation import Notation, split_rate
from ..mechanics import Kinematics
from ..mechanics.methods import TreeEquations
from ..mechanics.mobility import Mobility
from ..model.visit import Undotted
from ..runtime.argument_checks import UnknownNameError

if TYPE_CHECKING:
    from .methods import BlockSystem
    from .named_parts import ByName, NamedSum
    from .near_state import SymbolicLinearization
    from .quantities import Quantities, SpatialMotion, Written
    from .tree_system import TreeParts, TreeSystem

    Choose = Callable[[Quantities], Sequence[Expr]]
    ChooseNames = Callable[[Quantities], Sequence[tuple[str, Expr]]]

# What forms quantities is loaded when one is read: compiling needs none.

# -- functions of time -------------------------------------------------------------------------------------------------


def dynamic_symbols(kinematics: Kinematics) -> Callable[[str], Any]:
    """Name -> SymPy: ``theta`` is theta(t), ``theta_dot`` its derivative, ``theta_ddot`` the second one.

    Velocities that are no rates of coordinates (``ball_wx``), inputs, momenta and multipliers are functions of time as
    well; parameters are plain symbols; t is ``dynamicsymbols._t``.
    """
    from .methods import momentum_names

    orders: dict[str, tuple[str, int]] = {name: (name, 0) for name in kinematics.names}
    loop = kinematics.loop_coordinates.names
    for name in (*kinematics.names, *loop):
        orders |= {name: (name, 0), f"{name}_dot": (name, 1), f"{name}_ddot": (name, 2)}
    for velocity in (*kinematics.velocity_names, *kinematics.state_names):
        base, order = orders.setdefault(velocity, (velocity, 0))
        orders[acceleration_name(velocity)] = (base, order + 1)
    inputs = kinematics.input_names
    for name in inputs:
        base, order = split_rate(name)
        orders[name] = (base, order) if base in inputs else (name, 0)
    orders |= {name: (name, 0) for name in momentum_names(kinematics)}

    return partial(_function_of_time, orders)


def _function_of_time(orders: Mapping[str, tuple[str, int]], name: str) -> Any:
    import sympy
    from sympy.physics.mechanics import dynamicsymbols

    if name == "t":
        return dynamicsymbols._t
    if name not in orders:
        return sympy.Symbol(name)
    base, order = orders[name]
    return dynamicsymbols(base, order)


# -- rows of the table -------------------------------------------------------------------------------------------------


Made = TypeVar("Made")  #: what a quantity is
Derived = tuple[Kinematics, Mobility, TreeEquations]
Names = list[tuple[str, Expr]]
#: What equations must have for a display to name a quantity among those to read next.
ANY, BODIES, PARTS, LOOPS = "any", "bodies", "parts", "loops"
SHOWN = 8  #: names that a message lists


class Quantity(cached_property[Made]):
    """A row of the table: an attribute that ``make`` forms of the equations and its name when first used.

    ``offered`` is of what equations a display names it among those to read next; ``by_name`` whether each body, marker
    or joint has one.
    """

    def __init__(
        self, make: Callable[[Any, str], Made], doc: str | None, offered: str = "", by_name: bool = False
    ) -> None:
        super().__init__(lambda equations: make(equations, self.name))
        self.__doc__, self.offered, self.by_name = doc, offered, by_name

    def __set_name__(self, owner: type[Any], name: str) -> None:
        super().__set_name__(owner, name)
        self.name = name


def scalar(
    doc: str, offered: str = "", form: Callable[[Quantities], Expr] | None = None, prefix: str = ""
) -> Quantity[Any]:
    """A row of one expression, formed by the attribute of its name or by ``form``; its parts begin with ``prefix``."""

    def make(equations: Readable, name: str) -> Any:
        return equations._write(name, lambda s: [(form or attrgetter(name))(s)], prefix)[0]

    return Quantity(make, doc, offered)


def column(doc: str, offered: str = "", form: Choose | None = None) -> Quantity[Any]:
    """A row of a SymPy column."""
    return Quantity(
        lambda eqs, name: eqs._matrix(name, lambda s: [(x,) for x in (form or attrgetter(name))(s)], 1), doc, offered
    )


def matrix(
    columns: Callable[[Readable], int],
    doc: str,
    offered: str = "",
    form: Callable[[Quantities], Sequence[Sequence[Expr]]] | None = None,
) -> Quantity[Any]:
    """A row of a SymPy matrix."""
    return Quantity(lambda eqs, name: eqs._matrix(name, form or attrgetter(name), columns(eqs)), doc, offered)


def quantity(offered: str = "", by_name: bool = False) -> Callable[[Callable[[Any], Made]], Quantity[Made]]:
    """A row that a method makes."""
    return lambda make: Quantity(lambda eqs, _: make(eqs), make.__doc__, offered, by_name)


def _of_method(name: str) -> Callable[[Quantities], Any]:
    """The function of this name that forms a quantity which single methods have."""
    return lambda quantities: getattr(import_module(".methods", __package__), name)(quantities)


def _n(equations: Readable) -> int:
    return int(equations.mobility.n_dof)


def _n_v(equations: Readable) -> int:
    return len(equations.kinematics.v)


def _equations(left: Sequence[Any], right: Sequence[Any]) -> list[Any]:
    import sympy

    return [sympy.Eq(a, b, evaluate=False) for a, b in zip(left, right, strict=True)]


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


# -- the table ---------------------------------------------------------------------------------------------------------

# A class that inherits :class:`Readable` says what was derived (``fresh``), what SymPy object stands for a name, and
# what values are put in; :class:`~.displayed.ReadingView` is the same derivation with other answers.


class Readable(ABC):
    """The quantities of derived equations as SymPy expressions and matrices, each made when first used.

    Matrices of the size of the degrees of freedom belong to the velocities of ``independent``; those of the size of
    the tree to all velocities ``v``.  In open chains both are the same.
    """

    kinematics: Kinematics
    mobility: Mobility

    @abstractmethod
    def fresh(self) -> Derived:
        """A copy of what was derived, in a graph of its own."""

    @abstractmethod
    def again(self) -> Readable:
        """The same with nothing made yet."""

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
        from .methods import model_notation

        return model_notation(self.kinematics, self.names_substituted)

    # -- symbols ------------------------------------------------------------------------------------------------------
    def _symbols(self, names: Sequence[str]) -> tuple[Any, ...]:
        return tuple(map(self._symbol, names))

    @property
    def q(self) -> tuple[Any, ...]:
        """Coordinates of the spanning tree, SymPy symbols."""
        return self._symbols(self.kinematics.names)

    @property
    def v(self) -> tuple[Any, ...]:
        """Velocities of the spanning tree, SymPy symbols."""
        return self._symbols(self.kinematics.velocity_names)

    @property
    def parameters(self) -> tuple[Any, ...]:
        """Parameters, SymPy symbols."""
        return self._symbols(self.kinematics.parameter_names)

    @property
    def states(self) -> tuple[Any, ...]:
        """First-order states, SymPy symbols."""
        return self._symbols(self.kinematics.state_names)

    @property
    def sampled(self) -> tuple[Any, ...]:
        """Sampled states in the order of renewal, behind t for each of their clocks, SymPy symbols."""
        return self._symbols([name for name, _ in self.kinematics.sampled])

    @property
    def momentum_symbols(self) -> tuple[Any, ...]:
        """The symbols of the momenta in ``hamiltonian``, one for each of ``v``."""
        from .methods import momentum_names

        return self._symbols(momentum_names(self.kinematics))

    # -- energies -----------------------------------------------------------------------------------------------------
    T = scalar("Kinetic energy (J).", PARTS)
    V = scalar("Potential energy of gravity and springs (J); of a bare Lagrangian -L at rest.", PARTS)
    lagrangian = scalar("T - V (J).", PARTS, prefix="L_")

    # -- equations of motion ------------------------------------------------------------------------------------------
    @cached_property
    def _motion(self) -> tuple[list[tuple[Any, Any]], Any, Any]:
        import sympy

        n = self.mobility.n_dof
        written = self._write("mass_matrix", lambda s: s.motion[0], "z", lambda s: s.motion[1])
        self._written["force"] = self._written["mass_matrix"]  # they are written together
        self._forms["force"] = self._forms["mass_matrix"]
        return (
            self._written["force"].intermediates,
            sympy.Matrix(n, n, written[: n * n]),
            sympy.Matrix(n, 1, written[n * n :]),
        )

    mass_matrix = Quantity(lambda eqs, _: eqs._motion[1], "sympy.Matrix (n, n), n the degrees of freedom.", ANY)
    force = Quantity(
        lambda eqs, _: eqs._motion[2],
        "sympy.Matrix (n, 1): ``mass_matrix * v' = force``; it is ``quadratic_velocity + generalized_forces``.",
        ANY,
    )

    @property
    def intermediates(self) -> list[tuple[Any, Any]]:
        """Named subexpressions of a large mass matrix and force, in order: (symbol, expression); empty when small."""
        return self._motion[0]

    quadratic_velocity = column(
        "Q_v (n, 1): Coriolis, centrifugal and gyroscopic terms, and what prescribed motions ask for.", PARTS
    )

    @quantity(PARTS)
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

    state_rates = column("s' (n_s, 1) of the first-order states ``states``.", form=attrgetter("kinematics.state_rates"))
    sampled_values = column(
        "What ``sampled`` become (n, 1), one after the other; for t: the time of the next sample.",
        form=lambda s: [x for _, x in s.kinematics.sampled],
    )

    # -- motion of bodies and markers ---------------------------------------------------------------------------------
    def _places(self) -> tuple[str, ...]:
        """Names of bodies and of named markers."""
        from .quantities import require_bodies

        require_bodies(self.kinematics)
        mechanism = self.kinematics.mechanism
        return (*(b.name for b in mechanism.bodies), *(marker.label for marker in mechanism.presentation.named_markers))

    @quantity(BODIES, by_name=True)
    def poses(self) -> ByName[Any]:
        """Pose (4, 4) of each body and named marker in ground axes: ``poses["rod"]``, ``poses["rod.tip"]``."""
        return self._by_name(
            "body or marker", self._places(), lambda one: self._matrix(f"poses.{one}", lambda s: s.pose(one), 4)
        )

    @quantity(BODIES, by_name=True)
    def velocities(self) -> ByName[SpatialMotion]:
        """Velocity of each body and named marker, ground axes: ``velocities["rod"].angular``, ``.linear`` ..."""
        make = partial(self._spatial, "velocities", lambda s, one: s.velocity(one))
        return self._by_name("body or marker", self._places(), make)

    @quantity(BODIES, by_name=True)
    def accelerations(self) -> ByName[SpatialMotion]:
        """Acceleration of each body and named marker, ground axes: ``accelerations["rod"].angular``, ``.linear`` ..."""
        make = partial(self._spatial, "accelerations", lambda s, one: s.acceleration(one))
        return self._by_name("body or marker", self._places(), make)

    def _spatial(self, what: str, of: Callable[[Quantities, str], SpatialMotion], name: str) -> SpatialMotion:
        import sympy

        from .quantities import SpatialMotion

        written = self._write(f"{what}.{name}", lambda s: [x for part in of(s, name) for x in part])
        return SpatialMotion(*(sympy.Matrix(3, 1, written[k : k + 3]) for k in (0, 3, 6)))

    @quantity(by_name=True)
    def loop_coordinates(self) -> ByName[Any]:
        """Coordinates of the joints that close loops, as functions of ``q``: ``loop_coordinates["s"]``."""

        def make(one: str) -> Any:
            return self._write(f"loop_coordinates.{one}", lambda s: [s.loop_coordinates[one]])[0]

        return self._by_name("coordinate of a cut joint", self.kinematics.loop_coordinates.names, make)

    momenta = column("p = dT/dv (n_v, 1), conjugate to the velocities ``v``.", PARTS)

    # -- constraints --------------------------------------------------------------------------------------------------
    constraints = column("C(q, t) (m, 1), which vanishes: the holonomic equations, without redundant ones.", LOOPS)
    velocity_constraints = column(
        "C_q v + C_t (n_c, 1), which vanishes: rates of the holonomic equations, then the nonholonomic ones."
    )
    constraint_jacobian = matrix(
        _n_v, "C_q (n_c, n_v), nonholonomic rows last: the derivative of ``velocity_constraints`` by ``v``.", LOOPS
    )
    gamma = column("gamma (n_c, 1) of C'' = C_q v' + gamma = 0.", LOOPS)
    velocity_transformation = matrix(
        _n, "B (n_v, n) of v = B v_i + b, v_i the velocities of ``independent``; b is ``velocity_offset``.", LOOPS,
        attrgetter("transformation.matrix"),
    )  # fmt: skip
    velocity_offset = column(
        "b (n_v, 1) of v = B v_i + b: what drivers and other motions over time add; 0 without them.",
        form=attrgetter("transformation.offset"),
    )
    acceleration_offset = column(
        "a (n_v, 1) of v' = B v_i' + a.", form=attrgetter("transformation.acceleration_offset")
    )

    @cached_property
    def has_long_loops(self) -> bool:
        """Whether loops make ``mass_matrix`` and ``force`` so long that ``tree_system`` is read more easily."""
        if self.mobility.n_dof in (0, len(self.kinematics.v)):
            return False
        from .quantities import Quantities
        from .tree_system import MANY, is_long

        return is_long(Quantities(*self.fresh())) or len(self.intermediates) > MANY

    @quantity()
    def tree_system(self) -> TreeSystem:
        """M_t v' = f_t + C^T lambda, C v' + gamma = 0: the parts that long ``mass_matrix`` and ``force`` are made of.

        With v' = B v_i' + a, which the constraints give, M = B^T M_t B and f = B^T (f_t - M_t a).  Where
        ``has_long_loops``, ``zeros`` names the coordinates on which M and f do not depend; 0 stands for them in all
        parts.
        """
        import sympy

        from .tree_system import TreeSystem, tree_parts

        n_v, n_c = len(self.kinematics.v), len(self.constraint_names)
        formed: list[TreeParts] = []

        def choose(quantities: Quantities) -> list[Expr]:
            formed[:] = [tree_parts(quantities, self.has_long_loops)]
            return formed[0].flat

        written = iter(self._write("tree_system", choose, "z", lambda _: formed[0].named))
        shapes = ((n_v, n_v), (n_v, 1), (n_c, n_v), (n_c, 1))
        mass, force, C, gamma = (sympy.Matrix(m, n, [next(written) for _ in range(m * n)]) for m, n in shapes)
        return TreeSystem(mass, force, C, gamma, formed[0].zeros)

    # -- of single methods; others refuse them and say which have them ----------------------------------------------
    body_velocity_transformation = matrix(
        _n,
        """B_b (6 n_b, n) of the velocities of all bodies by those of ``independent``.

        Of each body the velocity of its centre of mass in ground axes, then its angular velocity in body axes.
        ``B_b.T * body_mass_matrix * B_b`` is ``mass_matrix``, less the inertia of drives.
        """,
        form=_of_method("body_velocities"),
    )
    body_mass_matrix = matrix(
        lambda eqs: 6 * len(eqs.kinematics.mechanism.bodies),
        "M_b (6 n_b, 6 n_b): mass and inertia of each body, for the velocities of ``body_velocity_transformation``.",
        form=_of_method("body_mass_matrix"),
    )
    gibbs_function = scalar(
        "S (W^2 kg) of method ``gibbs_appell``: dS/dv' = M v' - Q_v on the tree; without terms free of v'.",
        form=_of_method("gibbs_function"),
        prefix="S_",
    )
    hamiltonian = scalar(
        "H(q, p, t) (J) of method ``hamilton``, in the momenta ``p_theta``, ... of ``momentum_symbols``.",
        form=_of_method("hamiltonian"),
        prefix="H_",
    )
    momentum_rates = column(
        "p' = -dH/dq + Q (n_v, 1) of method ``hamilton``, in q and v, without the forces of constraints.",
        form=_of_method("momentum_rates"),
    )

    @quantity()
    def block_system(self) -> BlockSystem:
        """The linear system of methods ``augmented``, ``newton_euler`` and ``amalgamated``.

        ``augmented``: [M C_q^T; C_q 0] [v'; lambda] = [Q + Q_v; -gamma].  Of the others the unknowns are, of each body,
        the rates of its twist in the axes of its joint (``rod_alpha_x``, ``rod_a_x``; gravity subtracted) and the
        wrench of its joint (``A_M_x``, ``A_F_x``), then multipliers.
        """
        import sympy

        from .methods import BlockSystem, block_system

        names: list[str] = []

        def choose(quantities: Quantities) -> list[Expr]:
            result = block_system(quantities)
            names[:] = result.unknowns
            return [*(x for row in result.matrix for x in row), *result.right]

        written, n = self._write("block_system", choose, "K_"), len(names)
        parts = written[: n * n], list(self._symbols(names)), written[n * n :]
        return BlockSystem(*(sympy.Matrix(n, len(x) // n if n else 0, x) for x in parts))

    @quantity(by_name=True)
    def free_bodies(self) -> ByName[FreeBody]:
        """Newton's and Euler's equations of each body, of methods ``newton_euler`` and ``amalgamated``.

        Reactions of the joints of the tree are ``A_F_x``, ..., ``A_M_x``, ... on the body that the joint carries, at
        the joint, in ground axes; those of joints that close loops are written with their multipliers ``lambda_1``, ...
        """
        from .methods import BodiesApart
        from .quantities import Quantities

        BodiesApart(Quantities(*self.fresh()))  # refuses other methods now

        def make(name: str) -> FreeBody:
            written = self._write(f"free_bodies.{name}", lambda s: [x for p in BodiesApart(s).balance(name) for x in p])
            equations = _equations([*written[:3], *written[6:9]], [*written[3:6], *written[9:]])
            return FreeBody(equations[:3], equations[3:])

        return self._by_name("body", [body.name for body in self.kinematics.mechanism.bodies], make)

    @quantity(by_name=True)
    def joint_forces(self) -> ByName[list[Any]]:
        """Of each joint of the tree an equation along each direction in which it is free: reaction = drive.

        The left side is the component of the reaction in ``free_bodies``; the right side what force elements and
        constraint elements exert along the coordinate, 0 if there are none.
        """

        from .methods import BodiesApart
        from .quantities import Quantities

        def make(name: str) -> list[Any]:
            pairs = self._write(
                f"joint_forces.{name}", lambda s: [x for p in BodiesApart(s).along_joint(name) for x in p]
            )
            return _equations(pairs[::2], pairs[1::2])

        joints = BodiesApart(Quantities(*self.fresh())).joints  # refuses other methods
        return self._by_name("joint of the tree", joints, make)

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
            The state is a dead centre: the velocities of ``independent`` do not determine the others.
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

        from .near_state import SymbolicLinearization, here, linearize, over_one_denominator

        values = self._read(at or {})
        states: list[tuple[str, ...]] = []

        def choose(quantities: Quantities) -> Sequence[Expr]:
            result = linearize(quantities, values, equilibrium)
            states.append(result.states)
            return [x for matrix in (result.A, result.B) for row in matrix for x in row]

        written = self._write("linearize", choose, "A_")
        named = self._written.pop("linearize").intermediates
        self._require_finite("linearize", [*written, *(x for _, x in named)], here(values))
        if not named:
            written = [over_one_denominator(x) for x in written]
        (names,), inputs = states, self.kinematics.input_names
        n = len(names)
        A, B = sympy.Matrix(n, n, written[: n * n]), sympy.Matrix(n, len(inputs), written[n * n :])
        return SymbolicLinearization(A, B, names, inputs, named)

    # -- how quantities are formed and written -------------------------------------------------------------------------
    @classmethod
    def rows(cls) -> Iterator[Quantity[Any]]:
        """The rows of the table."""
        return (row for row in vars(Readable).values() if isinstance(row, Quantity))

    def in_plain_symbols(self) -> Readable:
        """The same quantities in plain symbols; these equations, where they are in no functions of time."""
        return self

    @cached_property
    def _symbol(self) -> Callable[[str], Any]:
        """Name -> the SymPy object that stands for it."""
        import sympy

        return sympy.Symbol  # type: ignore[no-any-return]

    #: Values that are put in for names, one mapping after the other.
    _put_in: tuple[Mapping[str, Any], ...] = ()

    @cached_property
    def _written(self) -> dict[str, Written]:
        """What was written, by quantity."""
        return {}

    @cached_property
    def _forms(self) -> dict[str, Callable[[], tuple[list[Expr], Names]]]:
        """What gives each of these as the derivation formed it, with what names in it stand for."""
        return {}

    def _matrix(self, name: str, choose: Callable[[Quantities], Sequence[Sequence[Expr]]], columns: int) -> Any:
        import sympy

        rows: list[Sequence[Expr]] = []

        def flat(quantities: Quantities) -> list[Expr]:
            rows[:] = choose(quantities)
            return [x for row in rows for x in row]

        written = self._write(name, flat)
        return sympy.Matrix(len(rows), columns, written)

    def _by_name(self, what: str, names: Sequence[str], make: Callable[[str], Any]) -> ByName[Any]:
        from .named_parts import ByName

        return ByName(what, names, make, self._plain)

    def __getstate__(self) -> dict[str, Any]:
        """Without the functions that give quantities as they were formed."""
        return {name: value for name, value in vars(self).items() if name != "_forms"}

    def _write(self, name: str, choose: Choose, prefix: str = "", choose_names: ChooseNames | None = None) -> list[Any]:
        """Expressions of the quantities in SymPy; their named parts are kept under the name.

        Each is formed in a copy of its own, so that what is read depends on the model alone.
        """
        formed, names = self._form(choose, choose_names)
        prefix = prefix or f"{name.replace('.', '_')}_"
        written = self.in_sympy(formed, prefix, names, of_motion=choose_names is not None)
        if self._put_in:
            values = [*written.expressions, *(x for _, x in written.intermediates)]
            self._require_finite(name, values, f"with {self._view}")
        self._written[name], self._forms[name] = written, partial(self._form, choose, choose_names)
        return written.expressions

    def in_sympy(
        self,
        formed: Sequence[Expr],
        prefix: str = "z",
        names: Sequence[tuple[str, Expr]] = (),
        of_motion: bool = False,
    ) -> Written:
        """Expressions of one graph in SymPy as they are read, with their named parts ``z0``, ...

        ``names`` stand in them already, in order.  Of M and f (``of_motion``) long roots and denominators that are
        written several times get names in any case.
        """
        from ..expr.simplify import WHOLE, joined_nodes, simplify
        from .quantities import Written, is_short, with_derivatives

        k = self.kinematics
        rates = frozenset((*k.velocity_names, *map(acceleration_name, k.velocity_names)))
        expressions, raw = joined_nodes(formed, names, k.euler_parameters)
        sizes = [WHOLE] if not raw and is_short(expressions) else []
        form = simplify(expressions, raw, rates, prefix, *sizes)
        if form is None:
            return Written([], [])
        named, result = form.sympy(self._symbol, k.parameter_names, prefix, of_motion)
        return Written([(name, with_derivatives(x)) for name, x in named], list(map(with_derivatives, result)))

    def _form(self, choose: Choose, choose_names: ChooseNames | None) -> tuple[list[Expr], Names]:
        """Expressions of the quantities with values put in, and what names in them stand for."""
        from .methods import put_in
        from .quantities import Quantities

        quantities = Quantities(*self.fresh())
        expressions = list(choose(quantities))
        names = list(choose_names(quantities)) if choose_names is not None else []
        expressions += [x for _, x in names]
        for values in self._put_in:
            expressions = put_in(expressions, values)
        count = len(expressions) - len(names)
        return expressions[:count], [(name, x) for (name, _), x in zip(names, expressions[count:], strict=True)]

    def as_formed(self, name: str, part: str | None = None) -> tuple[Written, list[Expr], Names]:
        """A quantity as it was written and, to compare with, as it was formed, with what names in that stand for.

        Parts that were written together, such as those of generalized forces, are in the whole.
        """
        value, key = getattr(self, name), f"{name}.{part}"
        if isinstance(value, Mapping) and part is not None:
            value[part]
        if key not in self._forms and name not in self._forms:  # made before this went through pickle
            return self.again().as_formed(name, part)
        key = key if key in self._forms else name
        return self._written[key], *self._forms[key]()

    def with_values(self, expressions: Sequence[Expr]) -> list[Expr]:
        """Expressions of the model with what was put in, in a graph of their own; as they are, where nothing was."""
        from .methods import put_in

        result = copied(list(expressions)) if self._put_in else list(expressions)
        for values in self._put_in:
            result = put_in(result, values)
        return result

    def numbers_substituted(self) -> dict[str, float | None]:
        """Numbers of the names for which values were put in, with declared values of what these hold; None without."""
        m, names = self.kinematics.mechanism, list(dict.fromkeys(name for named in self._put_in for name in named))
        quantities: list[Any] = [*m.parameters, *m.inputs]
        declared = {x.name: x.value for x in quantities if x.value is not None}
        graph = Graph()
        values = self.with_values([graph.symbol(name) for name in names])
        return {
            name: None if symbols_of([x]).difference(declared) else float(evaluate([x], declared)[0])
            for name, x in zip(names, values, strict=True)
        }

    @property
    def _view(self) -> str:
        """Values that were put in, for messages."""
        return ", then ".join(", ".join(f"{name} = {value}" for name, value in one.items()) for one in self._put_in)

    def _require_finite(self, name: str, written: Sequence[Any], where: str) -> None:
        """Refuse a quantity that divides by zero."""
        import sympy

        if any(x.has(sympy.zoo, sympy.nan, sympy.oo) for x in written):
            raise NonFiniteError(
                f"{name} has no finite value {where}: it divides by zero there, as at a dead centre or where a "
                "rotation is singular; put in other values, or leave one as a symbol"
            )

    def _plain(self, name: str) -> str:
        """``left_hinge`` of ``left.hinge`` in an instance of a component; any other name as it is."""
        return Undotted(self.kinematics.mechanism.presentation.instances).coordinate(name)

    def _read(self, named: Any, what: str = "symbol") -> dict[str, Any]:
        """Values that a user puts in for names."""
        from .methods import read_values

        allowed = self.kinematics.parameter_names if what == "parameter" else self._known
        return read_values(named, allowed, what, self._plain)

    def written(self, name: str, part: str | None = None) -> tuple[list[tuple[Any, Any]], Any]:
        """A quantity with its named parts.

        Parameters
        ----------
        name : str
            An attribute, such as ``"T"`` or ``"poses"``.
        part : str, optional
            Of a quantity by name the one wanted, such as ``"rod"``; of ``generalized_forces`` a force element.

        Returns
        -------
        intermediates : list of (sympy.Symbol, sympy.Expr)
            Those that the quantity needs, in an order in which each uses only those before it; empty where it is
            written out.
        value : sympy.Expr or sympy.Matrix
            What the attribute gives.

        Raises
        ------
        UsageError
            No quantity of this name, or no such part.

        Examples
        --------
        >>> import eomgen as eg
        >>> m = eg.Model("mass")
        >>> slider = m.prismatic("rail", m.ground, m.body("block", mass="m"), coordinate="s")
        >>> _ = m.parameter("m")
        >>> m.derive().written("T")
        ([], m*s_dot**2/2)
        """
        from .named_parts import NamedSum
        from .quantities import needed

        table = {row.name: row for row in self.rows()}
        if name not in table:
            meant = hint(name, tuple(table), quoted=False) or f"there are {', '.join(table)}"
            raise UnknownNameError(f"{name!r} is no quantity that is written; {meant}")
        value = getattr(self, name)
        if table[name].by_name:
            if part is None:
                there = ", ".join(map(repr, tuple(value)[:SHOWN])) or "there are none"
                raise incomplete(f"{name!r} are written one by one; give the name of one as part: {there}")
            whole = value[part]
            return self._written[f"{name}.{part if part in tuple(value) else self._plain(part)}"].intermediates, whole
        if part is None:
            named = self._written[name].intermediates  # those of the mass matrix and the force are chosen together
            return needed(named, value) if name in ("mass_matrix", "force") else named, value
        if not isinstance(value, NamedSum):
            raise at_odds(f"{name!r} has no parts; leave {part!r} out")
        return needed(self._written[name].intermediates, value[part]), value[part]

    @property
    def _own(self) -> tuple[str, ...]:
        """Names of coordinates, their derivatives, parameters and inputs, and the time."""
        k = self.kinematics
        rates = (*k.velocity_names, *map(acceleration_name, k.velocity_names))
        return (*k.names, *rates, *k.parameter_names, *k.input_names, "t")

    @property
    def _known(self) -> tuple[str, ...]:
        """Names for which values can be put in."""
        from .methods import momentum_names

        return (*self._own, *momentum_names(self.kinematics), *self.names_substituted)

    @property
    def names_substituted(self) -> tuple[str, ...]:
        """Names that the model does not have and that values put in have brought."""
        from .methods import read_value

        graph = Graph()
        values = (read_value(graph, name, value) for named in self._put_in for name, value in named.items())
        return tuple(sorted({name for value in values for name in symbols_of([value])}.difference(self._own)))

    def values_substituted(self) -> list[list[tuple[str, Any]]]:
        """What was put in, one list after the other: names, and numbers as given or SymPy expressions."""
        return [[(name, self._as_given(value)) for name, value in named.items()] for named in self._put_in]

    def _as_given(self, value: Any) -> Any:
        if isinstance(value, float | int):
            return value
        from .methods import read_value

        return self.in_sympy([read_value(Graph(), "", value)]).expressions[0]

    def symbols_substituted(self, names: Sequence[str]) -> list[Any]:
        """What stands for names after values have been put in, in SymPy: their symbols, where none were."""
        graph = Graph()
        return self.in_sympy(self.with_values([graph.symbol(name) for name in names])).expressions
