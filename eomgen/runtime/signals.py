"""Stage runtime: inputs as a user gives them (number, table, function) -> u(t, x) for kernels."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from ..errors import UsageError
from ..numeric.scales import Array
from ..numeric.splines import slopes
from .layout import Layout, number
from .names import check_names, require_time_and_state, unknown
from .tapes import DeclaredSignal, Formula, is_formula, record_tape

KINKS = 1000  #: at most so many corners of tables are stepped on exactly by SciPy's methods
#: How a table goes on between its times -> the order of its pieces.
ORDERS = {"linear": 1, "zero-order": 0, "cubic": 3}


class Signal:
    """An input over time by its values at given times, the same as the end values before and after.

    Parameters
    ----------
    times, values : (k,) arrays
        Times must increase.
    interpolation : {"linear", "zero-order", "cubic"}
        Between the times: straight lines; the value of the time before, as a controller with a sampling time gives it;
        a spline with continuous curvature (not-a-knot ends).
    corners : bool
        Whether the integrator steps on the times at which the value or its slope jumps and starts anew from there, as
        it should: its accuracy rests on smooth right-hand sides.

    Examples
    --------
    ``mod.simulate((0, 5), inputs={"tau": Signal([0, 1, 2], [0, 0.5, -0.5], "zero-order")})``
    """

    def __init__(self, times: Any, values: Any, interpolation: str = "linear", *, corners: bool = True) -> None:
        self.times, self.values = np.array(times, dtype=float), np.array(values, dtype=float)
        if interpolation not in ORDERS:
            raise unknown("interpolation", interpolation, ORDERS)
        self.interpolation, self.order, self.corners = interpolation, ORDERS[interpolation], corners
        if self.times.ndim != 1 or self.times.shape != self.values.shape or not self.times.size:
            raise UsageError(
                "times and values must be two lists of the same length, "
                f"not shapes {self.times.shape} and {self.values.shape}"
            )
        if not (np.isfinite(self.times).all() and np.isfinite(self.values).all()):
            raise UsageError("times and values must be finite")
        falling = np.flatnonzero(np.diff(self.times) <= 0.0)
        if falling.size:
            k = int(falling[0])
            raise UsageError(f"times must increase, not go from {self.times[k]} to {self.times[k + 1]}")

    def __repr__(self) -> str:
        span = f"t = {self.times[0]:.6g} .. {self.times[-1]:.6g} s"
        return f"<Signal: {len(self.times)} points, {span}, {self.interpolation}>"

    def __call__(self, t: Any, x: Any = None) -> Any:
        """The value at time t, a number or an array of them."""
        if self.order == 1:
            return np.interp(t, self.times, self.values)[()]
        k = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.times) - 1)
        if self.order == 0:
            return self.values[k]
        s = np.where(np.asarray(t) < self.times[0], 0.0, np.asarray(t) - self.times[k])
        c = self.coefficients[k]
        return (c[..., 0] + s * (c[..., 1] + s * (c[..., 2] + s * c[..., 3])))[()]

    @cached_property
    def coefficients(self) -> Array:
        """Rows (k, 4) of value, slope, half the curvature and a sixth of the third derivative at each time."""
        result = np.zeros((len(self.times), 4))
        result[:, 0] = self.values
        if len(self.times) > 1:
            slope, h = slopes(self.times, self.values, "cubic"), np.diff(self.times)
            rise = np.diff(self.values) / h
            bend = (slope[:-1] + slope[1:] - 2.0 * rise) / h
            result[:-1, 1], result[:-1, 2], result[:-1, 3] = slope[:-1], (rise - slope[:-1]) / h - bend, bend / h
        return result

    def kinks(self) -> Array:
        """Times where the value or a derivative jumps."""
        if not self.corners:
            return np.empty(0)
        if self.order == 3:  # its third derivative jumps
            return np.asarray(self.times if len(self.times) > 1 else np.empty(0))
        if self.order == 0:
            return np.asarray(self.times[1:][np.diff(self.values) != 0.0])
        rates = np.concatenate([[0.0], np.diff(self.values) / np.diff(self.times), [0.0]])
        size = np.abs(rates).max()
        return np.asarray(self.times[np.abs(np.diff(rates)) > 1e-9 * size])

    def encode(self) -> tuple[int, Array, Array]:
        """Order, times and values as the compiled loop reads them."""
        order = 2 if self.order == 0 and not self.corners else self.order  # read at t, inside a step
        return order, self.times, self.coefficients if self.order == 3 else self.values


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
    inputs : mapping of str to number, (times, values), Signal, expression or callable f(t, x), optional
        Inputs not named keep their bound values.

    Attributes
    ----------
    constants : dict of str to float
    varying : dict of int to callable
        f(t, x) by the index of the input.
    foreign : bool
        Whether an input is a function of the user's, so that compiled loops cannot evaluate it.
    feedback : bool
        Whether an input may depend on the state.
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
        self.feedback = self.foreign = False
        self.formulas: dict[int, Formula | DeclaredSignal] = {}
        for name, tape in layout.metadata.get("signals", {}).items():
            if name not in given:
                slopes = layout.metadata.get("signal_slopes", {})
                self.formulas[layout.u.index(name)] = declared = DeclaredSignal(tape, slopes[name])
                self.feedback = self.feedback or declared.depends_on_state
        for name, value in given.items():
            index = layout.u.index(name)
            if isinstance(value, Signal):
                self.varying[index] = value
            elif callable(value):
                require_time_and_state(f"input {name}: its function", value)
                self.varying[index] = value
                self.feedback = self.foreign = True
            elif is_formula(value):
                self.formulas[index] = formula = Formula(layout, value, f"input {name}")
                self.feedback = self.feedback or formula.depends_on_state
            elif isinstance(value, (tuple, list)) and len(value) == 2 and np.ndim(value[0]) > 0:
                try:
                    self.varying[index] = Signal(*value)
                except UsageError as error:
                    raise UsageError(f"input {name}: {error}") from None
            elif np.ndim(value) == 0:
                self.constants[name] = number(f"input {name}", value)
            else:
                raise UsageError(
                    f"input {name} must be a number, (times, values), a Signal, an expression as text or a function "
                    f"f(t, x), not {value!r}"
                )
        self.base = np.zeros(layout.n_u)
        self.names = layout.u
        self.lapse: Lapse | None = None

    def attach(self, module: Any) -> None:
        """Take the values that a module binds: its inputs where none are given, its parameters in expressions."""
        self.base = module.u
        for index, formula in self.formulas.items():
            self.varying[index] = formula.function(module.p)

    @property
    def stepwise(self) -> bool:
        """Whether all inputs are constant between corners."""
        held = all(isinstance(s, Signal) and s.order == 0 and s.corners for s in self.varying.values())
        return held and not self.formulas

    def encode(self) -> list[tuple[Any, ...]]:
        """The inputs that vary, as the compiled loop takes them."""
        if not self:
            return []
        tables: list[tuple[Any, ...]] = [(i, *s.encode()) for i, s in self.varying.items() if isinstance(s, Signal)]
        for i, formula in self.formulas.items():
            tables.append((i, formula.tape if isinstance(formula, DeclaredSignal) else record_tape([formula])))
        return tables

    def require_finite(self) -> None:
        """Raise UsageError if a value was not finite."""
        if self.lapse is not None:
            raise UsageError(str(self.lapse))

    def __bool__(self) -> bool:
        """Whether anything varies."""
        return bool(self.varying or self.formulas)

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
        if not self.base.size:
            return np.empty((0, len(t)))
        u = np.repeat(self.base[:, None], len(t), axis=1)
        tables = {i: signal for i, signal in self.varying.items() if isinstance(signal, Signal)}
        if len(self.varying) > len(tables):
            for j in range(len(t)):
                u[:, j] = self(float(t[j]), x[:, j])
        for i, signal in tables.items():
            u[i] = signal(t)
        return u

    def corners(self, start: float, end: float, every_jump: bool = False) -> list[float]:
        """Times strictly between start and end at which to restart the integrator, in its direction.

        Where they are more than KINKS, only some, unless ``every_jump``: compiled loops take any number.
        """
        if not self.varying:
            return []
        low, high = min(start, end), max(start, end)

        def found(jumps: bool) -> list[float]:
            signals = (s for s in self.varying.values() if isinstance(s, Signal) and (s.order == 0) == jumps)
            return sorted({float(t) for signal in signals for t in signal.kinks() if low < t < high})

        jumps, bends = found(True), found(False)
        every = sorted({*jumps, *bends}, reverse=end < start)
        return every if every_jump or len(every) <= KINKS else every[:: -(-len(every) // KINKS)]

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
