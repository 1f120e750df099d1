"""Stage reading, base: what a derivation answers -> its quantities in SymPy, with their named parts kept."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

from ..equations import TreeEquations
from ..errors import UsageError
from ..graph.core import Expr, Graph
from ..graph.substitute import symbols_of
from ..kinematics import Kinematics
from ..kinematics.mobility import Mobility
from ..kinematics.state import acceleration_name
from .put_in import put_in, read_value
from .quantities import Quantities
from .written import write

Derived = tuple[Kinematics, Mobility, TreeEquations]
Names = list[tuple[str, Expr]]
Choose = Callable[[Quantities], Sequence[Expr]]
ChooseNames = Callable[[Quantities], Sequence[tuple[str, Expr]]]


class WrittenQuantity(NamedTuple):
    """A quantity in SymPy, entry by entry, with its named parts; ``formed`` gives it as the derivation formed it."""

    named: list[tuple[Any, Any]]
    flat: list[Any]
    formed: Callable[[], tuple[list[Expr], Names]]


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

    @cached_property
    def _rates(self) -> frozenset[str]:
        v = self.kinematics.velocity_names
        return frozenset((*v, *map(acceleration_name, v)))

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
            Of a quantity by name the one wanted, such as ``"rod"``.

        Returns
        -------
        intermediates : list of (sympy.Symbol, sympy.Expr)
            In an order in which each uses only those before it; empty where the quantity is written out.
        value : sympy.Expr or sympy.Matrix
            What the attribute gives.

        Examples
        --------
        >>> import eomgen as eg
        >>> m = eg.Model("mass")
        >>> slider = m.prismatic("rail", m.ground, m.body("block", mass="m"), coordinate="s")
        >>> _ = m.parameter("m")
        >>> m.derive().written("T")
        ([], m*s_dot**2/2)
        """
        value = getattr(self, name)
        key = name if part is None else f"{name}.{part}"
        value = value if part is None else value[part]
        if key not in self._named:
            raise UsageError(f"{key!r} is no quantity that is written; there are {', '.join(sorted(self._named))}")
        return self._named[key], value

    @property
    def _known(self) -> tuple[str, ...]:
        """Names for which values can be put in."""
        k = self.kinematics
        own = (*k.names, *k.velocity_names, *map(acceleration_name, k.velocity_names), *k.parameter_names)
        momenta = (f"p_{label}" for label in k.velocity_labels)
        graph = Graph()
        later = {
            name
            for given in self._put_in
            for at, value in given.items()
            for name in symbols_of([read_value(graph, at, value)])
        }
        return (*own, *k.input_names, "t", *momenta, *sorted(later.difference(own)))
