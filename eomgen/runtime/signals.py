"""Stage runtime: inputs as a user gives them (number, table, function) -> u(t, x) for kernels."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from ..errors import UsageError
from ..numeric.scales import Array
from .layout import Layout, number
from .names import check_names, require_time_and_state

KINKS = 1000  #: at most so many corners of tables are stepped on exactly


class Table:
    """Piecewise linear in time, constant before and after.

    Parameters
    ----------
    name : str
        For messages.
    times, values : (k,) arrays
        Times must increase.
    """

    def __init__(self, name: str, times: Any, values: Any) -> None:
        self.times, self.values = np.array(times, dtype=float), np.array(values, dtype=float)
        if self.times.ndim != 1 or self.times.shape != self.values.shape or not self.times.size:
            raise UsageError(
                f"input {name}: times and values must be two lists of the same length, "
                f"not shapes {self.times.shape} and {self.values.shape}"
            )
        if not (np.isfinite(self.times).all() and np.isfinite(self.values).all()):
            raise UsageError(f"input {name}: times and values must be finite")
        falling = np.flatnonzero(np.diff(self.times) <= 0.0)
        if falling.size:
            k = int(falling[0])
            raise UsageError(f"input {name}: times must increase, not go from {self.times[k]} to {self.times[k + 1]}")

    def __call__(self, t: float, x: Array) -> float:
        """The value at time t."""
        return float(np.interp(t, self.times, self.values))

    def kinks(self) -> Array:
        """Times where the slope changes."""
        slopes = np.concatenate([[0.0], np.diff(self.values) / np.diff(self.times), [0.0]])
        size = np.abs(slopes).max()
        return np.asarray(self.times[np.abs(np.diff(slopes)) > 1e-9 * size])


class Lapse(NamedTuple):
    """A value of an input that is not finite."""

    name: str
    time: float
    value: float

    def __str__(self) -> str:
        return (
            f"input {self.name} is {self.value} at t = {self.time:.6g} s; "
            "its function must return a finite number at every time and state"
        )


class Forcing:
    """The inputs of one run.

    Parameters
    ----------
    layout : Layout
    inputs : mapping of str to number, (times, values) or callable f(t, x), optional
        Inputs not named keep their bound values.

    Attributes
    ----------
    constants : dict of str to float
    varying : dict of int to callable
        f(t, x) by the index of the input.
    lapse : Lapse or None
        The last value that was not finite at a finite state.  Inside an integration it only shortens the step.
    """

    def __init__(self, layout: Layout, inputs: Mapping[str, Any] | None) -> None:
        given = inputs or {}
        if not isinstance(given, Mapping):
            raise UsageError(f"inputs must be a mapping of names, not {type(given).__name__}")
        check_names("input", given, layout.u)
        self.constants: dict[str, float] = {}
        self.varying: dict[int, Callable[[float, Array], float]] = {}
        self.feedback = False
        for name, value in given.items():
            if callable(value):
                require_time_and_state(f"input {name}: its function", value)
                self.varying[layout.u.index(name)] = value
                self.feedback = True
            elif isinstance(value, (tuple, list)) and len(value) == 2 and np.ndim(value[0]) > 0:
                self.varying[layout.u.index(name)] = Table(name, *value)
            elif np.ndim(value) == 0:
                self.constants[name] = number(f"input {name}", value)
            else:
                raise UsageError(f"input {name} must be a number, (times, values) or a function f(t, x), not {value!r}")
        self.base = np.zeros(layout.n_u)
        self.names = layout.u
        self.lapse: Lapse | None = None

    def require_finite(self) -> None:
        """Raise UsageError if a value was not finite."""
        if self.lapse is not None:
            raise UsageError(str(self.lapse))

    def __bool__(self) -> bool:
        """Whether anything varies."""
        return bool(self.varying)

    def __call__(self, t: float, x: Array) -> Array:
        """u (n_u,) at time t and state x."""
        u = self.base.copy()
        for index, signal in self.varying.items():
            try:
                value = signal(t, x)
            except Exception as error:
                error.add_note(f"raised by the function of input {self.names[index]}, called as f({t:.6g}, x)")
                raise
            u[index] = one = value if type(value) is float else self._one_number(index, t, value)
            if not isfinite(one) and np.isfinite(x).all():
                self.lapse = Lapse(self.names[index], t, one)
        return u

    def _one_number(self, index: int, t: float, value: Any) -> float:
        """What is no float as one, if it is a number: an integer, a NumPy scalar, an array of shape ()."""
        if value is not None and not isinstance(value, str) and np.shape(value) == ():
            try:
                return float(value)
            except (TypeError, ValueError):
                pass
        shown = f"an array of shape {np.shape(value)}" if isinstance(value, np.ndarray) and value.ndim else repr(value)
        raise UsageError(
            f"input {self.names[index]} must be one number at each time, but its function returned {shown} "
            f"at t = {t:.6g} s"
        )

    def sample(self, t: Array, x: Array) -> Array:
        """u (n_u, k) at times (k,) and states (n_x, k)."""
        u = np.repeat(self.base[:, None], len(t), axis=1)
        if self.varying:
            for j in range(len(t)):
                u[:, j] = self(float(t[j]), x[:, j])
        return u

    def corners(self, start: float, end: float) -> list[float]:
        """Times strictly between start and end at which to restart the integrator, in its direction."""
        low, high = min(start, end), max(start, end)
        found = {
            float(time)
            for signal in self.varying.values()
            if isinstance(signal, Table)
            for time in signal.kinks()
            if low < time < high
        }
        ordered = sorted(found, reverse=end < start)
        return ordered if len(ordered) <= KINKS else ordered[:: -(-len(ordered) // KINKS)]

    def jacobian(self, t: float, x: Array, rhs: Callable[..., Array]) -> Array | None:
        """What inputs that depend on the state add to the Jacobian: df/du du/dx, by differences; None if nothing."""
        if not self.feedback:
            return None
        u, n = self(t, x), len(x)
        du = np.zeros((len(u), n))
        for j in range(n):
            h = 1e-6 * max(1.0, abs(x[j]))
            moved = np.array(x, dtype=float)
            moved[j] += h
            du[:, j] = (self(t, moved) - u) / h
        if not du.any():
            return None
        f = rhs(t, x, u=u)
        result = np.zeros((n, n))
        for k in np.flatnonzero(du.any(axis=1)):
            h = 1e-6 * max(1.0, abs(u[k]))
            pushed = u.copy()
            pushed[k] += h
            result += np.outer((rhs(t, x, u=pushed) - f) / h, du[k])
        return result
