"""Equations -> what notebooks and terminals show of them, and views with values substituted."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

from ..errors import UnavailableError, at_odds
from ..runtime.argument_checks import find_lacking
from .quantities import Formed, Written
from .readable import Derived, Readable, dynamic_symbols


class Displayed(Readable):
    """Equations that show themselves, and give the same quantities with values substituted or in functions of time."""

    # -- display ------------------------------------------------------------------------------------------------------
    def __repr__(self) -> str:
        return self._text

    def _repr_html_(self) -> str:
        from .writers import facts_html

        return facts_html(self) + self._equations_html

    def _repr_latex_(self) -> str:
        from .writers import equations_latex

        return equations_latex(self)

    @cached_property
    def _text(self) -> str:
        from .writers import equations_text

        return equations_text(self)

    @cached_property
    def _equations_html(self) -> str:
        from .writers import equations_html

        return equations_html(self)

    def again(self) -> ReadingView:
        """The same quantities, none of them made yet."""
        return ReadingView(self, self._symbol, self._substituted)

    def as_formed(self, name: str, part: str | None = None) -> tuple[Written, Formed]:
        """A quantity as it was written and, to compare with, as it was formed.

        Parts that were written together, such as those of generalized forces, are in the whole.
        """
        value, key = getattr(self, name), f"{name}.{part}"
        if isinstance(value, Mapping) and part is not None:
            value[part]
        if key not in self._forms and name not in self._forms:  # made before this went through pickle
            return self.again().as_formed(name, part)
        key = key if key in self._forms else name
        return self._written[key], self._forms[key]()

    # -- the same with other symbols or values ------------------------------------------------------------------------
    def with_dynamicsymbols(self) -> ReadingView:
        """The same quantities in functions of time, as ``sympy.physics.mechanics.dynamicsymbols`` makes them.

        ``theta`` becomes theta(t) and ``theta_dot`` its derivative; velocities that are no rates of coordinates, inputs
        and multipliers are functions of time too; parameters stay symbols.

        Returns
        -------
        ReadingView
        """
        return ReadingView(self, dynamic_symbols(self.kinematics), self._substituted)

    def subs(self, values: Mapping[Any, Any]) -> ReadingView:
        """The same quantities with values substituted, all at once, after derivatives have been taken.

        Parameters
        ----------
        values : mapping
            Name, symbol or function of time of a coordinate, velocity, acceleration, parameter or input, or ``"t"`` ->
            number, text or SymPy expression.

        Returns
        -------
        ReadingView

        Raises
        ------
        UsageError
            An unknown name, or a value that is no expression.
        """
        return ReadingView(self, self._symbol, (*self._substituted, self._read(values)))

    def with_parameters(self, values: Mapping[Any, Any] | None = None, /, **named: Any) -> ReadingView:
        """The same quantities with values substituted for parameters: ``with_parameters(l=0.5)``; see :meth:`subs`.

        Parameters
        ----------
        values : mapping, optional
            Values by name, where names are no words of Python: ``with_parameters({"left.l": 0.5})``.
        **named
            Values by name.

        Returns
        -------
        ReadingView

        Raises
        ------
        UsageError
            An unknown name, one that is given twice, or a value that is no expression.
        """
        read = {} if values is None else self._read(values, "parameter")
        more = self._read(named, "parameter")
        if both := sorted({*read} & {*more}):
            raise at_odds(f"parameter {both[0]!r} is given twice; give it one value")
        return ReadingView(self, self._symbol, (*self._substituted, read | more))


class ReadingView(Displayed):
    """Equations to read, with values substituted or with functions of time; all quantities of :class:`Readable`.

    Made by ``subs``, ``with_parameters`` and ``with_dynamicsymbols`` of equations and of other views.

    Attributes
    ----------
    source : Displayed
        The equations of which this is a view.
    """

    if not TYPE_CHECKING:  # type checkers know all attributes

        def __getattr__(self, name: str) -> Any:
            lacks = not name.startswith("_") and not hasattr(type(self), name)
            if lacks and hasattr(type(self.source), name):
                raise UnavailableError(
                    f"a view of equations has no {name!r}: a view is for reading, not for compiling and "
                    f"counting; use the equations, .source of the view",
                )
            return find_lacking(self, "a view of equations", name)

    def __init__(self, source: Displayed, symbols: Callable[[str], Any], values: tuple[Mapping[str, Any], ...]) -> None:
        self.source: Displayed = source.source if isinstance(source, ReadingView) else source
        self.kinematics, self.mobility = source.kinematics, source.mobility
        self._symbol, self._substituted = symbols, tuple(mapping for mapping in values if mapping)

    def fresh(self) -> Derived:
        return self.source.fresh()

    @property
    def method(self) -> str:
        return self.source.method

    def explain(self, level: str = "full") -> Any:
        """The worked solution with the substituted values of parameters and inputs; see ``explain`` of equations.

        The formulas are compared with the compiled module at these values.

        Raises
        ------
        UnavailableError
            A value was substituted for a coordinate, a velocity, an acceleration or the time: the steps of a solution
            differentiate by them.  Or a value holds a name that is no parameter or input of the model.
        """
        if not self._substituted:
            return self.source.explain(level)  # type: ignore[attr-defined]
        k = self.kinematics
        known = {*k.parameter_names, *k.input_names}
        moving = sorted({name for mapping in self._substituted for name in mapping}.difference(known))
        strange = sorted({*self.names_substituted}.difference(known))
        if moving:
            raise UnavailableError(
                f"explain has no view with {self._view}: the steps of a solution differentiate by {', '.join(moving)}; "
                "put in values of parameters and inputs alone, and give those of coordinates and velocities by "
                "model.initial, which the calculation line by line begins with"
            )
        if strange:
            raise UnavailableError(
                f"explain has no view with {self._view}: the model has no parameter or input {', '.join(strange)}, so "
                "that the compiled module cannot be compared with it; put in numbers or parameters of the model"
            )
        return self.source.explained(self.in_plain_symbols(), level)  # type: ignore[attr-defined]

    def in_plain_symbols(self) -> Readable:
        plain = self.source._symbol
        return self if self._symbol is plain else ReadingView(self.source, plain, self._substituted)
