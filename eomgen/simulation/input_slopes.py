"""Simulation: the inputs of a run -> their derivatives by time, state and parameters, exact or refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..base.algebra import Array
from ..errors import cannot
from ..runtime.input_kinds import Tabulated
from ..runtime.layout import Layout
from ..runtime.signal_rates import rate_places
from ..runtime.signals import Forcing


class SlopesNow(NamedTuple):
    """Derivatives of all inputs at a time and state."""

    by_t: Array  #: (n_u,)
    by_x: Array  #: (n_u, n_x)
    by_p: Array  #: (n_u, n_p)


class InputSlopes:
    """Derivatives of the inputs of one run.

    An expression is differentiated on the graph, a table piece by piece.  A Python function is called without the
    state from here on: one that reads it has derivatives that nobody knows.

    Parameters
    ----------
    layout : Layout
    forcing : Forcing
        Attached to the module of the run.
    p : (n_p,) array
    """

    def __init__(self, layout: Layout, forcing: Forcing, p: Array) -> None:
        self.layout = layout
        self.formulas = {i: formula.slopes(p) for i, formula in forcing.formulas.items()}
        self.forcing = forcing
        self.rates = rate_places(layout)
        self.tables: dict[int, Tabulated] = {}
        self.functions: set[int] = set()
        for i, signal in forcing.varying.items():
            if i in self.formulas:
                continue
            if isinstance(signal, Tabulated):
                self.tables[i] = signal.derivative()
            else:
                self.functions.add(i)
                forcing.varying[i] = AtOneState(layout.u[i], signal)

    @property
    def by_state_or_parameters(self) -> bool:
        """Whether an input may depend on more than time."""
        return bool(self.formulas)

    def __call__(self, t: float, x: Array) -> SlopesNow:
        """The derivatives; NaN by time for a Python function, unless its rate is an input too."""
        n_u, n_x, n_p = self.layout.n_u, self.layout.n_x, self.layout.n_p
        every = np.zeros((n_u, 1 + n_x + n_p))
        for i, slopes in self.formulas.items():
            every[i] = slopes(t, x)
        within = self.forcing.within
        for i, table in self.tables.items():
            every[i, 0] = table.beside(t, t if within is None else min(max(t, within[0]), within[1]))
        for i in self.functions:
            rate = self.rates.get(i)
            every[i, 0] = np.nan if rate is None else self.forcing(t, x)[rate]
        return SlopesNow(every[:, 0], every[:, 1 : 1 + n_x], every[:, 1 + n_x :])


class AtOneState:
    """A user's function f(t, x) as one of time alone.

    Parameters
    ----------
    name : str
        Of the input.
    function : callable f(t, x)
    """

    def __init__(self, name: str, function: Callable[[float, Any], float]) -> None:
        self.name, self.function = name, function

    def __call__(self, t: float, x: Array) -> float:
        """The value, without the state.

        Raises
        ------
        UsageError
            The function reads the state.
        """
        try:
            return self.function(t, None)
        except Exception:
            self.function(t, x)  # a fault of its own comes out as it is
        raise cannot(
            f"input {self.name} is a Python function of the state, and its derivatives are not known; give it as an "
            'expression in a text, such as "-k*theta", or as a function of time alone'
        )
