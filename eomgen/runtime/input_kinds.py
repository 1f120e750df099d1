"""Stage runtime: the kinds of inputs that vary: by values at times, by an expression, by a function of time alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..base.algebra import Array


class Tabulated:
    """An input by its values at times, or a rate of one.

    Attributes
    ----------
    times : (k,) array
    order : int
        As the compiled loop knows it; 0: constant between the times.
    corners : bool
        Whether integrators step on the times where pieces meet.
    """

    times: Array
    order: int
    corners: bool

    def __call__(self, t: Any, x: Any = None) -> Any:
        """The value at time t, a number or an array of them."""
        raise NotImplementedError

    def beside(self, t: Any, at: Any) -> Any:
        """The value at t of the piece that holds at time ``at``."""
        raise NotImplementedError

    def derivative(self) -> Tabulated:
        """The rate between the jumps of the value."""
        raise NotImplementedError

    def kinks(self) -> Array:
        """Times where integrators start anew."""
        raise NotImplementedError

    def encode(self) -> tuple[int, Array, Array]:
        """Order, times and values as the compiled loop reads them."""
        raise NotImplementedError


class Expressed:
    """An input by an expression of time, coordinates, velocities and parameters.

    Attributes
    ----------
    text : str
        The expression in words; what a model declares says so.
    depends_on_state : bool
        Whether it reads the state.
    """

    text: str
    depends_on_state: bool

    @property
    def tape(self) -> Any:
        """As the compiled loop plays it."""
        raise NotImplementedError

    @property
    def branches(self) -> bool:
        """Whether it has conditions, at which it may jump or bend."""
        raise NotImplementedError

    def function(self, p: Array) -> Callable[[float, Array], float]:
        """f(t, x) at given parameters (n_p,)."""
        raise NotImplementedError

    def switches(self, p: Array) -> Callable[[float, Array], list[float]]:
        """What changes its sign where a condition does."""
        raise NotImplementedError

    def slopes(self, p: Array) -> Callable[[float, Array], Array]:
        """Its derivatives (1 + n_x + n_p,) by t, x and p, as f(t, x) at given parameters (n_p,)."""
        raise NotImplementedError

    def rate(self, name: str, rate: str) -> Expressed | None:
        """The derivative by time along the motion, of an input called ``name``; None where it is not known."""
        return None


class OfTime:
    """A function of time alone, as f(t, x); its rate is that of the object's own ``derivative()``."""

    def __init__(self, function: Any) -> None:
        self.function = function

    def __call__(self, t: float, x: Any = None) -> Any:
        """The value at time t."""
        return self.function(t)

    def derivative(self) -> Any:
        """The rate, as the object says it; None where it says none."""
        derivative = getattr(self.function, "derivative", None)
        found = derivative() if callable(derivative) else None
        return of_time(found, True) if callable(found) else found


def of_time(function: Callable[..., Any], rate: bool = False) -> Callable[..., Any]:
    """The function itself, or as f(t, x) one that takes the time alone and has ``derivative()`` or is itself a rate.

    So does one of one argument, or whose second has a number by default, as the splines of SciPy have the order of a
    derivative there.
    """
    from inspect import signature

    if not rate and not callable(getattr(function, "derivative", None)):
        return function
    try:
        taken = [p for p in signature(function).parameters.values() if p.kind is not p.KEYWORD_ONLY]
    except (TypeError, ValueError):
        return function
    alone = len(taken) == 1 and taken[0].kind is not taken[0].VAR_POSITIONAL
    return OfTime(function) if alone or (len(taken) > 1 and isinstance(taken[1].default, int | float)) else function
