"""Stage describe, the builder's first-order states: those with a rate, and those that are sampled."""

from __future__ import annotations

from typing import Any

from .described import Described
from .description import without_defaults
from .sympy_face import symbol


class StateMethods(Described):
    """The part of Model that declares first-order states."""

    def state(
        self, name: str, rate: Any = None, initial: Any = 0.0, unit: str = "", doc: str = "", latex: str = ""
    ) -> Any:
        """Declare a first-order state s with s' = rate: an activation, a pressure, what a filter or controller holds.

        Parameters
        ----------
        name : str
            Identifier; its rate is ``<name>_dot``.
        rate : number, str or SymPy expression
            In t, parameters, inputs, coordinates, their rates, states, positions and velocities of markers, outputs
            of these and quantities of force elements.
        initial : number, str or SymPy expression, optional
            Where runs begin, 0 unless given; of parameters, if an expression.
        unit, doc, latex : str, optional
            Those of :meth:`parameter`; an initial value that is a number has this unit.

        Returns
        -------
        sympy.Symbol
        """
        given = {"rate": rate, "initial": initial, "unit": unit, "doc": doc, "latex": latex}
        defaults = {"rate": None, "initial": 0.0, "unit": "", "doc": "", "latex": ""}
        self._add("states", name, without_defaults(given, defaults))
        return symbol(name)

    def sampled(
        self, name: str, value: Any = None, period: Any = None, *, offset: Any = 0.0, initial: Any = 0.0,
        unit: str = "", doc: str = "", latex: str = "",
    ) -> Any:  # fmt: skip
        """Declare a state that is held, and renewed at the times offset + k period: what a digital controller gives.

        States of one period and offset are renewed together, in the order of their declaration; each takes those
        before it at their new values.

        Parameters
        ----------
        name : str
            Identifier; ``<name>_samples`` counts the samples and ``<name>_sampled`` is the event, for the first state
            of each period and offset.
        value : number, str or SymPy expression
            The new value, of what the rate of a :meth:`state` may depend on.  Without one the state keeps its value,
            unless a run gives a function for it: ``simulate(controllers={name: f})``.
        period : number, str or SymPy expression
            Time from one sampling time to the next (s), of parameters, if an expression.
        offset : number, str or SymPy expression, optional
            A sampling time (s), 0 unless given.
        initial : number, str or SymPy expression, optional
            The value before the first sampling time.
        unit, doc, latex : str, optional
            Those of :meth:`state`.

        Returns
        -------
        sympy.Symbol
        """
        given = {"sampled": value, "period": period, "offset": offset, "initial": initial}
        given |= {"unit": unit, "doc": doc, "latex": latex}
        defaults = {"sampled": None, "period": None, "offset": 0.0, "initial": 0.0, "unit": "", "doc": "", "latex": ""}
        self._add("states", name, without_defaults(given, defaults))
        return symbol(name)
