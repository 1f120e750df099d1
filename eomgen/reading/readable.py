"""The table of quantities: every quantity of derived equations by name, formed, written in SymPy, an attribute each."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property, partial
from operator import attrgetter, itemgetter
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
from ..runtime.argument_checks import UnknownNameError, unknown
from .free_bodies import BodiesApart
from .quantities import (
    BlockSystem,
    Formed,
    Quantities,
    SpatialMotion,
    Written,
    is_short,
    needed,
    require_bodies,
    with_derivatives,
)
from .symbols import model_notation, momentum_names, read_value, read_values, substitute_values

if TYPE_CHECKING:
    from .named_parts import NamedSum
    from .near_state import SymbolicLinearization
    from .tree_system import TreeSystem

# -- functions of time -------------------------------------------------------------------------------------------------


def dynamic_symbols(kinematics: Kinematics) -> Callable[[str], Any]:
    """Name -> SymPy: ``theta`` is theta(t), ``theta_dot`` its derivative, ``theta_ddot`` the second one.

    Velocities that are no rates of coordinates (``ball_wx``), inputs, momenta and multipliers are functions of time as
    well; parameters are plain symbols; t is ``dynamicsymbols._t``.
    """
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
    return dynamicsymbols(*orders[name]) if name in orders else sympy.Symbol(name)


# -- rows of the table -------------------------------------------------------------------------------------------------


Made = TypeVar("Made")  #: what a quantity is
Derived = tuple[Kinematics, Mobility, TreeEquations]
#: What equations must have for a display to name a quantity among those to read next.
ANY, BODIES, PARTS, LOOPS = "any", "bodies", "parts", "loops"
LISTED = 8  #: names that a message lists


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


# Rows are formed by the attribute ``form`` of Quantities, by default the one of their name.


def scalar(doc: str, offered: str = "", prefix: str = "") -> Quantity[Any]:
    """A row of one expression; its parts begin with ``prefix``."""
    return Quantity(lambda eqs, n: eqs._write(n, lambda s: Formed([getattr(s, n)]), prefix)[0][0], doc, offered)


def matrix(columns: Callable[[Readable], int], doc: str, offered: str = "", form: str = "") -> Quantity[Any]:
    """A row of a SymPy matrix."""

    def make(equations: Readable, name: str) -> Any:
        def choose(quantities: Quantities) -> Formed:
            rows = [(x,) if isinstance(x, Expr) else x for x in attrgetter(form or name)(quantities)]
            return Formed([x for row in rows for x in row], extra=len(rows))

        flat, rows = equations._write(name, choose)
        return shaped(flat, (rows, columns(equations)))[0]

    return Quantity(make, doc, offered)


#: A row of a SymPy column.
column = partial(matrix, lambda _: 1)


def each(
    doc: str,
    what: str,
    names: Callable[[Readable], Sequence[str]],
    form: Callable[[Quantities, str], Iterable[Iterable[Expr]]],
    build: Callable[[list[Any]], Made],
    offered: str = "",
) -> Quantity[ByName[Made]]:
    """A row of quantities by name: parts of one are formed, and built of these in SymPy."""

    def make(equations: Readable, name: str) -> ByName[Made]:
        def one(part: str) -> Made:
            flat, _ = equations._write(f"{name}.{part}", lambda s: Formed([x for xs in form(s, part) for x in xs]))
            return build(flat)

        return ByName(what, names(equations), one, equations._plain)

    return Quantity(make, doc, offered, by_name=True)


def symbols(doc: str, names: Callable[[Kinematics], Sequence[str]]) -> property:
    """Symbols in SymPy, by their names."""
    return property(lambda equations: equations._symbols(names(equations.kinematics)), doc=doc)


def quantity(offered: str = "") -> Callable[[Callable[[Any], Made]], Quantity[Made]]:
    """A row that a method makes."""
    return lambda make: Quantity(lambda eqs, _: make(eqs), make.__doc__, offered)


class ByName(Mapping[str, Made]):
    """Quantities by name, each made when first used; ``plain`` gives ``left_rod`` of ``left.rod``."""

    def __init__(
        self, what: str, names: Sequence[str], make: Callable[[str], Made], plain: Callable[[str], str]
    ) -> None:
        self._what, self._names, self._make, self._plain = what, tuple(names), make, plain
        self._made: dict[str, Made] = {}

    def __getitem__(self, name: str) -> Made:
        if name not in self._names and isinstance(name, str):
            name = self._plain(name)
        if name not in self._names:
            raise unknown(self._what, name, self._names)
        if name not in self._made:
            self._made[name] = self._make(name)
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __repr__(self) -> str:
        return f"<by {self._what}: {', '.join(self._names)}>"


def shaped(flat: Iterable[Any], *shapes: tuple[int, int]) -> list[Any]:
    """SymPy matrices of these shapes, of the entries of all of them, row by row."""
    import sympy

    entries = iter(flat)
    return [sympy.Matrix(m, n, [next(entries) for _ in range(m * n)]) for m, n in shapes]


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


def _spatial_motion(flat: list[Any]) -> SpatialMotion:
    return SpatialMotion(*shaped(flat, (3, 1), (3, 1), (3, 1)))


def _equations(left: Sequence[Any], right: Sequence[Any]) -> list[Any]:
    import sympy

    return [sympy.Eq(a, b, evaluate=False) for a, b in zip(left, right, strict=True)]


def _n(equations: Readable) -> int:
    return int(equations.mobility.n_dof)


def _n_v(equations: Readable) -> int:
    return len(equations.kinematics.v)


def _places(equations: Readable) -> tuple[str, ...]:
    """Names of bodies and of named markers."""
    require_bodies(equations.kinematics)
    mechanism = equations.kinematics.mechanism
    return (*(b.name for b in mechanism.bodies), *(marker.label for marker in mechanism.presentation.named_markers))


def _bodies_apart(equations: Readable) -> BodiesApart:
    """The free bodies of the equations; other methods are refused."""
    return BodiesApart(Quantities(*equations.fresh()))


# -- the table ---------------------------------------------------------------------------------------------------------

# A class that inherits :class:`Readable` says what was derived (``fresh``), what SymPy object stands for a name, and
# what values are substituted; :class:`~.displayed.ReadingView` is the same derivation with other answers.


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
        return model_notation(self.kinematics, self.names_substituted)

    # -- symbols ------------------------------------------------------------------------------------------------------
    def _symbols(self, names: Sequence[str]) -> tuple[Any, ...]:
        return tuple(map(self._symbol, names))

    q = symbols("Coordinates of the spanning tree, SymPy symbols.", lambda k: k.names)
    v = symbols("Velocities of the spanning tree, SymPy symbols.", lambda k: k.velocity_names)
    parameters = symbols("Parameters, SymPy symbols.", lambda k: k.parameter_names)
    states = symbols("First-order states, SymPy symbols.", lambda k: k.state_names)
    sampled = symbols(
        "Sampled states in the order of renewal, behind t for each of their clocks, SymPy symbols.",
        lambda k: [name for name, _ in k.sampled],
    )
    momentum_symbols = symbols("The symbols of the momenta in ``hamiltonian``, one for each of ``v``.", momentum_names)

    # -- energies -----------------------------------------------------------------------------------------------------
    T = scalar("Kinetic energy (J).", PARTS)
    V = scalar("Potential energy of gravity and springs (J); of a bare Lagrangian -L at rest.", PARTS)
    lagrangian = scalar("T - V (J).", PARTS, prefix="L_")

    # -- equations of motion ------------------------------------------------------------------------------------------
    @cached_property
    def _motion(self) -> tuple[list[tuple[Any, Any]], Any, Any]:
        n = self.mobility.n_dof
        flat, _ = self._write("mass_matrix", lambda s: Formed(*s.motion), "z")
        self._written["force"] = self._written["mass_matrix"]  # they are written together
        self._forms["force"] = self._forms["mass_matrix"]
        mass, force = shaped(flat, (n, n), (n, 1))
        return self._written["force"].intermediates, mass, force

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
        from .named_parts import NamedSum

        def choose(s: Quantities) -> Formed:
            return Formed([*s.total_force, *(x for force in s.forces.values() for x in force)], extra=[*s.forces])

        (flat, names), n = self._write("generalized_forces", choose, "Q_"), self.mobility.n_dof
        total, *parts = shaped(flat, *[(n, 1)] * (1 + len(names)))
        return NamedSum.of(total, dict(zip(names, parts, strict=True)), self._plain)

    state_rates = column("s' (n_s, 1) of the first-order states ``states``.", form="kinematics.state_rates")
    sampled_values = column(
        "What ``sampled`` become (n, 1), one after the other; for t: the time of the next sample.",
    )

    # -- motion of bodies and markers ---------------------------------------------------------------------------------
    poses = each(
        'Pose (4, 4) of each body and named marker in ground axes: ``poses["rod"]``, ``poses["rod.tip"]``.',
        "body or marker",
        _places,
        Quantities.pose,
        lambda flat: shaped(flat, (4, 4))[0],
        BODIES,
    )
    velocities = each(
        'Velocity of each body and named marker, ground axes: ``velocities["rod"].angular``, ``.linear`` ...',
        "body or marker",
        _places,
        Quantities.velocity,
        _spatial_motion,
        BODIES,
    )
    accelerations = each(
        'Acceleration of each body and named marker, ground axes: ``accelerations["rod"].angular``, ``.linear`` ...',
        "body or marker",
        _places,
        Quantities.acceleration,
        _spatial_motion,
        BODIES,
    )
    loop_coordinates = each(
        'Coordinates of the joints that close loops, as functions of ``q``: ``loop_coordinates["s"]``.',
        "coordinate of a cut joint",
        lambda eqs: eqs.kinematics.loop_coordinates.names,
        lambda s, one: [[s.loop_coordinates[one]]],
        itemgetter(0),
    )

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
        _n,
        "B (n_v, n) of v = B v_i + b, v_i the velocities of ``independent``; b is ``velocity_offset``.",
        LOOPS,
        "transformation.matrix",
    )
    velocity_offset = column(
        "b (n_v, 1) of v = B v_i + b: what drivers and other motions over time add; 0 without them.",
        form="transformation.offset",
    )
    acceleration_offset = column("a (n_v, 1) of v' = B v_i' + a.", form="transformation.acceleration_offset")

    @cached_property
    def has_long_loops(self) -> bool:
        """Whether loops make ``mass_matrix`` and ``force`` so long that ``tree_system`` is read more easily."""
        if self.mobility.n_dof in (0, len(self.kinematics.v)):
            return False
        from .tree_system import MANY, is_long

        return is_long(Quantities(*self.fresh())) or len(self.intermediates) > MANY

    @quantity()
    def tree_system(self) -> TreeSystem:
        """M_t v' = f_t + C^T lambda, C v' + gamma = 0: the parts that long ``mass_matrix`` and ``force`` are made of.

        With v' = B v_i' + a, which the constraints give, M = B^T M_t B and f = B^T (f_t - M_t a).  Where
        ``has_long_loops``, ``zeros`` names the coordinates on which M and f do not depend; 0 stands for them in all
        parts.
        """
        from .tree_system import TreeSystem, tree_parts

        n_v, n_c = len(self.kinematics.v), len(self.constraint_names)
        flat, zeros = self._write("tree_system", lambda s: tree_parts(s, self.has_long_loops), "z")
        mass, force, C, gamma = shaped(flat, (n_v, n_v), (n_v, 1), (n_c, n_v), (n_c, 1))
        return TreeSystem(mass, force, C, gamma, zeros)

    # -- of single methods; others refuse them and say which have them ----------------------------------------------
    body_velocity_transformation = matrix(
        _n,
        """B_b (6 n_b, n) of the velocities of all bodies by those of ``independent``.

        Of each body the velocity of its centre of mass in ground axes, then its angular velocity in body axes.
        ``B_b.T * body_mass_matrix * B_b`` is ``mass_matrix``, less the inertia of drives.
        """,
    )
    body_mass_matrix = matrix(
        lambda eqs: 6 * len(eqs.kinematics.mechanism.bodies),
        "M_b (6 n_b, 6 n_b): mass and inertia of each body, for the velocities of ``body_velocity_transformation``.",
    )
    gibbs_function = scalar(
        "S (W^2 kg) of method ``gibbs_appell``: dS/dv' = M v' - Q_v on the tree; without terms free of v'.", prefix="S_"
    )
    hamiltonian = scalar(
        "H(q, p, t) (J) of method ``hamilton``, in the momenta ``p_theta``, ... of ``momentum_symbols``.", prefix="H_"
    )
    momentum_rates = column(
        "p' = -dH/dq + Q (n_v, 1) of method ``hamilton``, in q and v, without the forces of constraints."
    )

    @quantity()
    def block_system(self) -> BlockSystem:
        """The linear system of methods ``augmented``, ``newton_euler`` and ``amalgamated``.

        ``augmented``: [M C_q^T; C_q 0] [v'; lambda] = [Q + Q_v; -gamma].  Of the others the unknowns are, of each body,
        the rates of its twist in the axes of its joint (``rod_alpha_x``, ``rod_a_x``; gravity subtracted) and the
        wrench of its joint (``A_M_x``, ``A_F_x``), then multipliers.
        """

        def choose(quantities: Quantities) -> Formed:
            matrix, names, right = quantities.block_system
            return Formed([*(x for row in matrix for x in row), *right], extra=names)

        flat, names = self._write("block_system", choose, "K_")
        n = len(names)
        matrix, right, unknowns = shaped([*flat, *self._symbols(names)], (n, n), (n, 1), (n, 1))
        return BlockSystem(matrix, unknowns, right)

    free_bodies = each(
        """Newton's and Euler's equations of each body, of methods ``newton_euler`` and ``amalgamated``.

        Reactions of the joints of the tree are ``A_F_x``, ..., ``A_M_x``, ... on the body that the joint carries, at
        the joint, in ground axes; those of joints that close loops are written with their multipliers ``lambda_1``, ...
        """,
        "body",
        lambda eqs: _bodies_apart(eqs).bodies,
        lambda s, name: BodiesApart(s).balance(name),
        lambda x: FreeBody(_equations(x[:3], x[3:6]), _equations(x[6:9], x[9:])),
    )
    joint_forces = each(
        """Of each joint of the tree an equation along each direction in which it is free: reaction = drive.

        The left side is the component of the reaction in ``free_bodies``; the right side what force elements and
        constraint elements exert along the coordinate, 0 if there are none.
        """,
        "joint of the tree",
        lambda eqs: _bodies_apart(eqs).joints,
        lambda s, name: BodiesApart(s).along_joint(name),
        lambda x: _equations(x[::2], x[1::2]),
    )

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
        from .near_state import SymbolicLinearization, here, linearize, over_one_denominator

        values = self._read(at or {})
        written, names = self._write("linearize", lambda s: linearize(s, values, equilibrium), "A_")
        named = self._written.pop("linearize").intermediates
        self._require_finite("linearize", [*written, *(x for _, x in named)], here(values))
        if not named:
            written = [over_one_denominator(x) for x in written]
        n, inputs = len(names), self.kinematics.input_names
        A, B = shaped(written, (n, n), (n, len(inputs)))
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

    #: Values that stand for names, one mapping after the other.
    _substituted: tuple[Mapping[str, Any], ...] = ()

    @cached_property
    def _written(self) -> dict[str, Written]:
        """What was written, by quantity."""
        return {}

    @cached_property
    def _forms(self) -> dict[str, Callable[[], Formed]]:
        """What gives each of these as the derivation formed it."""
        return {}

    def __getstate__(self) -> dict[str, Any]:
        """Without the functions that give quantities as they were formed."""
        return {name: value for name, value in vars(self).items() if name != "_forms"}

    def _write(self, name: str, choose: Callable[[Quantities], Formed], prefix: str = "") -> tuple[list[Any], Any]:
        """Expressions of the quantities in SymPy, and what else is known; their named parts are kept under the name.

        Each is formed in a copy of its own, so that what is read depends on the model alone.
        """
        flat, named, extra = self._form(choose)
        prefix = prefix or f"{name.replace('.', '_')}_"
        written = self.in_sympy(flat, prefix, named or (), of_motion=named is not None)
        if self._substituted:
            values = [*written.expressions, *(x for _, x in written.intermediates)]
            self._require_finite(name, values, f"with {self._view}")
        self._written[name], self._forms[name] = written, partial(self._form, choose)
        return written.expressions, extra

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

        k = self.kinematics
        rates = frozenset((*k.velocity_names, *map(acceleration_name, k.velocity_names)))
        expressions, raw = joined_nodes(formed, names, k.euler_parameters)
        sizes = [WHOLE] if not raw and is_short(expressions) else []
        form = simplify(expressions, raw, rates, prefix, *sizes)
        if form is None:
            return Written([], [])
        named, result = form.sympy(self._symbol, k.parameter_names, prefix, of_motion)
        return Written([(name, with_derivatives(x)) for name, x in named], list(map(with_derivatives, result)))

    def _form(self, choose: Callable[[Quantities], Formed]) -> Formed:
        """Quantities with the values that were substituted."""
        flat, named, extra = choose(Quantities(*self.fresh()))
        names, parts = zip(*named, strict=True) if named else ((), ())
        whole = [*flat, *parts]
        for values in self._substituted:
            whole = substitute_values(whole, values)
        named = named and list(zip(names, whole[len(flat) :], strict=True))
        return Formed(whole[: len(flat)], named, extra)

    def with_values(self, expressions: Sequence[Expr]) -> list[Expr]:
        """Expressions of the model with the substituted values, in a graph of their own; as they are without any."""
        result = copied(list(expressions)) if self._substituted else list(expressions)
        for values in self._substituted:
            result = substitute_values(result, values)
        return result

    def numbers_substituted(self) -> dict[str, float | None]:
        """Numbers of substituted names, with declared values of what their values hold; None where these have none."""
        m, names = self.kinematics.mechanism, list(dict.fromkeys(name for named in self._substituted for name in named))
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
        """Values that were substituted, for messages."""
        return ", then ".join(
            ", ".join(f"{name} = {value}" for name, value in one.items()) for one in self._substituted
        )

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

        table = {row.name: row for row in self.rows()}
        if name not in table:
            meant = hint(name, tuple(table), quoted=False) or f"there are {', '.join(table)}"
            raise UnknownNameError(f"{name!r} is no quantity that is written; {meant}")
        value = getattr(self, name)
        if table[name].by_name:
            if part is None:
                there = ", ".join(map(repr, tuple(value)[:LISTED])) or "there are none"
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
    def _model_names(self) -> tuple[str, ...]:
        """Names of coordinates, their derivatives, parameters and inputs, and the time."""
        k = self.kinematics
        rates = (*k.velocity_names, *map(acceleration_name, k.velocity_names))
        return (*k.names, *rates, *k.parameter_names, *k.input_names, "t")

    @property
    def _known(self) -> tuple[str, ...]:
        """Names for which values can be substituted."""
        return (*self._model_names, *momentum_names(self.kinematics), *self.names_substituted)

    @property
    def names_substituted(self) -> tuple[str, ...]:
        """Names that the model does not have and that substituted values have brought."""
        graph = Graph()
        values = (read_value(graph, name, value) for named in self._substituted for name, value in named.items())
        return tuple(sorted({name for value in values for name in symbols_of([value])}.difference(self._model_names)))

    def values_substituted(self) -> list[list[tuple[str, Any]]]:
        """What was substituted, one list after the other: names, and numbers as they are or SymPy expressions."""

        def written(value: Any) -> Any:
            is_number = isinstance(value, float | int)
            return value if is_number else self.in_sympy([read_value(Graph(), "", value)]).expressions[0]

        return [[(name, written(value)) for name, value in named.items()] for named in self._substituted]

    def symbols_substituted(self, names: Sequence[str]) -> list[Any]:
        """What stands for names after substitution, in SymPy: their symbols, where none were."""
        graph = Graph()
        return self.in_sympy(self.with_values([graph.symbol(name) for name in names])).expressions
