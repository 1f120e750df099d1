"""What a derivation answers -> its quantities in SymPy, with their named parts kept."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple

from ..base.names import hint
from ..base.notation import split_rate
from ..describe.visit import Undotted
from ..equations import TreeEquations
from ..errors import NonFiniteError, at_odds, incomplete
from ..graph.core import Expr, Graph, copied, symbols_of
from ..graph.evaluate import evaluate
from ..kinematics import Kinematics
from ..kinematics.mobility import Mobility
from ..kinematics.topology import acceleration_name
from ..runtime.argument_checks import UnknownNameError
from .methods import momentum_names, put_in, read_value, read_values
from .quantities import Quantities, needed, write

if TYPE_CHECKING:
    from .named_parts import ByName

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
    if name not in orders:
        return sympy.Symbol(name)
    base, order = orders[name]
    return dynamicsymbols(base, order)


# -- quantities in SymPy -----------------------------------------------------------------------------------------------


Derived = tuple[Kinematics, Mobility, TreeEquations]
Names = list[tuple[str, Expr]]
Choose = Callable[[Quantities], Sequence[Expr]]
ChooseNames = Callable[[Quantities], Sequence[tuple[str, Expr]]]


class WrittenQuantity(NamedTuple):
    """A quantity in SymPy, entry by entry, with its named parts; ``formed`` gives it as the derivation formed it."""

    named: list[tuple[Any, Any]]
    flat: list[Any]
    formed: Callable[[], tuple[list[Expr], Names]]


#: Attributes that are written as one, and those of which each body, marker or joint has one.
WHOLE = (
    *("T", "V", "lagrangian", "momenta", "mass_matrix", "force", "quadratic_velocity", "generalized_forces"),
    *("constraints", "velocity_constraints", "constraint_jacobian", "gamma", "velocity_transformation"),
    *("velocity_offset", "acceleration_offset", "body_velocity_transformation", "body_mass_matrix"),
    *("gibbs_function", "hamiltonian", "momentum_rates", "block_system", "tree_system", "state_rates"),
    "sampled_values",
)
SHOWN = 8  #: names that a message lists
BY_NAME = ("poses", "velocities", "accelerations", "loop_coordinates", "free_bodies", "joint_forces")


class WritesQuantities(ABC):
    """How quantities of a derivation are formed and written."""

    kinematics: Kinematics
    mobility: Mobility

    @abstractmethod
    def fresh(self) -> Derived:
        """A copy of what was derived, in a graph of its own."""

    @abstractmethod
    def again(self) -> WritesQuantities:
        """The same with nothing made yet."""

    @property
    def _symbol(self) -> Callable[[str], Any]:
        """Name -> the SymPy object that stands for it."""
        import sympy

        return sympy.Symbol  # type: ignore[no-any-return]

    @property
    def _put_in(self) -> tuple[Mapping[str, Any], ...]:
        """Values that are put in for names, one mapping after the other."""
        return ()

    @cached_property
    def _named(self) -> dict[str, list[tuple[Any, Any]]]:
        """Intermediates of what was written, by quantity."""
        return {}

    @cached_property
    def _all(self) -> dict[str, WrittenQuantity]:
        """What was written, by quantity."""
        return {}

    def __getstate__(self) -> dict[str, Any]:
        """Without what gives quantities as they were formed, which are functions here."""
        return {name: value for name, value in vars(self).items() if name != "_all"}

    def _write(
        self,
        name: str,
        choose: Choose,
        prefix: str = "",
        given: ChooseNames | None = None,
    ) -> list[Any]:
        """Expressions of the quantities in SymPy; their named parts are kept under the name.

        Each is formed in a copy of its own, so that what is read depends on the model alone.
        """
        formed, names = self._form(choose, given)
        prefix = prefix or f"{name.replace('.', '_')}_"
        k = self.kinematics
        of_motion = given is not None
        written = write(
            formed, self._symbol, prefix, names, self._rates, k.parameter_names, k.euler_parameters, of_motion
        )
        if self._put_in:
            values = [*written.expressions, *(x for _, x in written.intermediates)]
            self._require_finite(name, values, f"with {self._told}")
        self._named[name] = written.intermediates
        self._all[name] = WrittenQuantity(*written, lambda: self._form(choose, given))
        return written.expressions

    def _form(self, choose: Choose, given: ChooseNames | None) -> tuple[list[Expr], Names]:
        """Expressions of the quantities with values put in, and what names in them stand for."""
        quantities = Quantities(*self.fresh())
        expressions = list(choose(quantities))
        names = list(given(quantities)) if given is not None else []
        expressions += [x for _, x in names]
        for values in self._put_in:
            expressions = put_in(expressions, values)
        count = len(expressions) - len(names)
        return expressions[:count], [(name, x) for (name, _), x in zip(names, expressions[count:], strict=True)]

    def as_formed(self, name: str, part: str | None = None) -> WrittenQuantity:
        """A quantity as it was written and, to compare with, as it was formed; keys are those of :meth:`written`.

        Parts that were written together, such as those of generalized forces, are in the whole.
        """
        value, key = getattr(self, name), f"{name}.{part}"
        if isinstance(value, Mapping) and part is not None:
            value[part]
        if key not in self._all and name not in self._all:  # made before this went through pickle
            return self.again().as_formed(name, part)
        return self._all[key if key in self._all else name]

    def with_values(self, expressions: Sequence[Expr]) -> list[Expr]:
        """Expressions of the model with what was put in, in a graph of their own; as they are, where nothing was."""
        found = copied(list(expressions)) if self._put_in else list(expressions)
        for values in self._put_in:
            found = put_in(found, values)
        return found

    def numbers_put_in(self) -> dict[str, float | None]:
        """Numbers of the names for which values were put in, with declared values of what these hold; None without."""
        m, names = self.kinematics.mechanism, list(dict.fromkeys(name for given in self._put_in for name in given))
        quantities: list[Any] = [*m.parameters, *m.inputs]
        declared = {x.name: x.value for x in quantities if x.value is not None}
        graph = Graph()
        values = self.with_values([graph.symbol(name) for name in names])
        return {
            name: None if symbols_of([x]).difference(declared) else float(evaluate([x], declared)[0])
            for name, x in zip(names, values, strict=True)
        }

    @property
    def _told(self) -> str:
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

    @cached_property
    def _rates(self) -> frozenset[str]:
        v = self.kinematics.velocity_names
        return frozenset((*v, *map(acceleration_name, v)))

    def _plain(self, name: str) -> str:
        """``left_hinge`` of ``left.hinge`` in an instance of a component; any other name as it is."""
        return Undotted(self.kinematics.mechanism.instances).coordinate(name)

    def _read(self, given: Any, what: str = "symbol") -> dict[str, Any]:
        """Values that a user puts in for names."""
        allowed = self.kinematics.parameter_names if what == "parameter" else self._known
        return read_values(given, allowed, what, self._plain)

    def _by_name(self, what: str, names: Sequence[str], make: Callable[[str], Any]) -> ByName[Any]:
        from .named_parts import ByName

        return ByName(what, names, make, self._plain)

    def _matrix(self, name: str, choose: Callable[[Quantities], Sequence[Sequence[Expr]]], columns: int) -> Any:
        import sympy

        rows: list[Sequence[Expr]] = []

        def flat(quantities: Quantities) -> list[Expr]:
            rows[:] = choose(quantities)
            return [x for row in rows for x in row]

        written = self._write(name, flat)
        return sympy.Matrix(len(rows), columns, written)

    def _column(self, name: str, choose: Callable[[Quantities], Sequence[Expr]]) -> Any:
        return self._matrix(name, lambda s: [(x,) for x in choose(s)], 1)

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

        if name not in (*WHOLE, *BY_NAME):
            meant = hint(name, (*WHOLE, *BY_NAME), quoted=False) or f"there are {', '.join((*WHOLE, *BY_NAME))}"
            raise UnknownNameError(f"{name!r} is no quantity that is written; {meant}")
        value = getattr(self, name)
        if name in BY_NAME:
            if part is None:
                there = ", ".join(map(repr, tuple(value)[:SHOWN])) or "there are none"
                raise incomplete(f"{name!r} are written one by one; give the name of one as part: {there}")
            whole = value[part]
            return self._named[f"{name}.{part if part in tuple(value) else self._plain(part)}"], whole
        if part is None:
            named = self._named[name]  # those of the mass matrix and the force are chosen together
            return needed(named, value) if name in ("mass_matrix", "force") else named, value
        if not isinstance(value, NamedSum):
            raise at_odds(f"{name!r} has no parts; leave {part!r} out")
        return needed(self._named[name], value[part]), value[part]

    @property
    def _own(self) -> tuple[str, ...]:
        """Names of coordinates, their derivatives, parameters and inputs, and the time."""
        k = self.kinematics
        rates = (*k.velocity_names, *map(acceleration_name, k.velocity_names))
        return (*k.names, *rates, *k.parameter_names, *k.input_names, "t")

    @property
    def _known(self) -> tuple[str, ...]:
        """Names for which values can be put in."""
        return (*self._own, *momentum_names(self.kinematics), *self.names_put_in)

    @property
    def names_put_in(self) -> tuple[str, ...]:
        """Names that the model does not have and that values put in have brought."""
        graph = Graph()
        values = (read_value(graph, name, value) for given in self._put_in for name, value in given.items())
        return tuple(sorted({name for value in values for name in symbols_of([value])}.difference(self._own)))

    def values_put_in(self) -> list[list[tuple[str, Any]]]:
        """What was put in, one list after the other: names, and numbers as given or SymPy expressions."""
        return [[(name, self._as_given(value)) for name, value in given.items()] for given in self._put_in]

    def _as_given(self, value: Any) -> Any:
        if isinstance(value, float | int):
            return value
        return write([read_value(Graph(), "", value)], self._symbol).expressions[0]

    def symbols_put_in(self, names: Sequence[str]) -> list[Any]:
        """What stands for names after values have been put in, in SymPy: their symbols, where none were."""
        graph = Graph()
        found = [graph.symbol(name) for name in names]
        for values in self._put_in:
            found = put_in(found, values)
        return write(found, self._symbol).expressions
