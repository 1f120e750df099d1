"""Stage runtime: the kinds of inputs that vary and that compiled loops evaluate themselves, by what they all can do."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..numeric.scales import Array


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
