"""Inputs over time as a user gives them (number, table, text, function) -> u(t, x) for kernels, with rates.

What varies is of three kinds: a table of polynomial pieces, an expression, a function of the user's.  The equations may
need rates of inputs as inputs of their own: a number has rate 0, a table the slope of its pieces, a text the derivative
of its expression along the motion, and an object with a method ``derivative()`` says it itself.  Of any other function
no rate is known, and it is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from importlib import import_module
from inspect import signature
from itertools import pairwise
from math import inf, isfinite, nextafter
from typing import Any, NamedTuple

import numpy as np

from ..base.algebra import Array
from ..base.limits.numbers import TINY
from ..base.limits.runs import CONTINUOUS, CONTRADICTS, CONTRADICTS_TABLE, DIFFERENCE, LOCATED, MOMENT
from ..base.operations import OPERATIONS, operations_with, play_arrays
from ..base.splines import curve_coefficients, slopes
from ..base.texts import quote
from ..errors import (
    ExpressionError,
    MissingDependencyError,
    UsageError,
    cannot,
    ill_shaped,
    ill_typed,
    incomplete,
    no_number,
    not_finite,
    off_range,
    untrue,
)
from .argument_checks import (
    as_real,
    check_names,
    read_number,
    read_numbers,
    require_mapping,
    require_time_and_state,
    unknown,
    without_dots,
)
from .layout import Layout

KINKS = 1000  #: at most so many corners of tables are stepped on exactly by SciPy's methods
#: How a table goes on between its times -> the order of its pieces.
ORDERS = {"linear": 1, "zero-order": 0, "cubic": 3}
RATE = 4  #: the order of a derivative of a table
CELLS = 256  #: intervals of a run in which jumps of a text are looked for
BLOCKS, PARTS = 16, 16  #: a run is compared with rates on so many blocks, each of so many intervals
BESIDE = DIFFERENCE  #: part of a run over which an input and its rate are compared beside one time
NONE = np.empty(0)  #: no state


# -- kinds of inputs ---------------------------------------------------------------------------------------------------


class Table:
    """A function of time by polynomial pieces, constant before and after them.

    Parameters
    ----------
    times : (k,) array
    rows : (k + 1, 4) array
        Before the first time, from each time on, after the last: coefficients in powers of the time since.
    order : int
        As the compiled loop knows it; 0: constant between the times, RATE: a derivative of a table, which has the piece
        inside at its ends, so that a run over just the table sees no jump.
    corners : bool
        Whether integrators step on the times where pieces meet.
    """

    def __init__(self, times: Array, rows: Array, order: int, corners: bool) -> None:
        self.times, self.rows, self.order, self.corners = times, rows, order, corners

    def __call__(self, t: Any, x: Any = None) -> Any:
        """The value at time t, a number or an array of them."""
        return self.beside(t, t)

    def beside(self, t: Any, at: Any) -> Any:
        """The value at t of the piece that holds at time ``at``."""
        k = np.searchsorted(self.times, at, side="right")
        if self.order == 0:
            return self.rows[k, 0]
        if self.order == RATE:
            k = np.where(at == self.times[-1], len(self.times) - 1, k)
        return _polynomial(self.rows[k], np.asarray(t) - self.times[np.maximum(k - 1, 0)])[()]

    def derivative(self) -> Table:
        """The rate between the jumps of the value."""
        return Table(self.times, self.rows[:, [1, 2, 3, 3]] * (1.0, 2.0, 3.0, 0.0), RATE, self.corners)

    def jumps(self, order: int) -> Array:
        """Times at which the derivative of an order jumps; 0: the value."""
        here = self
        for _ in range(order):
            here = here.derivative()
        left = _polynomial(here.rows[:-1], np.concatenate([[0.0], np.diff(self.times)]))
        right = here.rows[1:, 0]
        size = max(np.abs(left).max(), np.abs(right).max())
        return np.asarray(self.times[np.abs(right - left) > CONTINUOUS * size])

    def kinks(self) -> Array:
        """Times where integrators start anew."""
        return self.times if self.corners else np.empty(0)

    def encode(self) -> tuple[int, Array, Array]:
        """Order, times and values as the compiled loop reads them: those before the first time hold to it."""
        times = np.concatenate([[self.times[0] - 1.0], self.times])
        return self.order if self.corners else 3, times, self.rows


def _polynomial(c: Array, s: Any) -> Array:
    return np.asarray(c[..., 0] + s * (c[..., 1] + s * (c[..., 2] + s * c[..., 3])))


class Signal(Table):
    """An input over time, given by values at certain times; before and after them the end values hold.

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
        self.times, self.values = (np.array(read_numbers("a table", part)) for part in (times, values))
        if not isinstance(interpolation, str) or interpolation not in ORDERS:
            raise unknown("interpolation", interpolation, ORDERS)
        if self.times.ndim != 1 or self.times.shape != self.values.shape or not self.times.size:
            raise ill_shaped(
                "times and values must be two lists of the same length, "
                f"not shapes {self.times.shape} and {self.values.shape}"
            )
        if not (np.isfinite(self.times).all() and np.isfinite(self.values).all()):
            raise no_number("times and values must be finite")
        falling = np.flatnonzero(np.diff(self.times) <= 0.0)
        if falling.size:
            k = int(falling[0])
            raise off_range(f"times must increase, not go from {self.times[k]} to {self.times[k + 1]}")
        self.interpolation = interpolation
        super().__init__(
            self.times, _rows(self.times, self.values, ORDERS[interpolation]), ORDERS[interpolation], corners
        )

    def __repr__(self) -> str:
        span = f"t = {self.times[0]:.6g} .. {self.times[-1]:.6g} s"
        return f"<Signal: {len(self.times)} points, {span}, {self.interpolation}>"

    def __call__(self, t: Any, x: Any = None) -> Any:
        """The value at time t, a number or an array of them."""
        return np.interp(t, self.times, self.values)[()] if self.order == 1 else super().beside(t, t)

    def beside(self, t: Any, at: Any) -> Any:
        """The value at t of the piece that holds at time ``at``, which differs only where a table holds its values."""
        return self(at if self.order == 0 and self.corners else t)

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
        return np.asarray(self.times[np.abs(np.diff(rates)) > CONTINUOUS * size])

    def encode(self) -> tuple[int, Array, Array]:
        """Order, times and values as the compiled loop reads them."""
        order = 2 if self.order == 0 and not self.corners else self.order  # read at t, inside a step
        return order, self.times, self.rows[1:] if self.order == 3 else self.values


def _rows(times: Array, values: Array, order: int) -> Array:
    """The pieces of a table: value, slope, half the curvature, a sixth of the third derivative of each."""
    if order == 3 and len(times) > 1:
        rows = curve_coefficients(times, values, slopes(times, values, "cubic"), False)
        return np.ascontiguousarray(rows[:, ::-1])
    rows = np.zeros((len(times) + 1, 4))
    rows[0, 0], rows[1:, 0] = values[0], values
    if order:
        rows[1:-1, 1] = np.diff(values) / np.diff(times)
    return rows


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
        result = derivative() if callable(derivative) else None
        return of_time(result, True) if callable(result) else result


def of_time(function: Callable[..., Any], rate: bool = False) -> Callable[..., Any]:
    """The function itself, or as f(t, x) one that takes the time alone and has ``derivative()`` or is itself a rate.

    So does one of one argument, or whose second has a number by default, as the splines of SciPy have the order of a
    derivative there.
    """
    if not rate and not callable(getattr(function, "derivative", None)):
        return function
    try:
        taken = [p for p in signature(function).parameters.values() if p.kind is not p.KEYWORD_ONLY]
    except (TypeError, ValueError):
        return function
    only_argument = len(taken) == 1 and taken[0].kind is not taken[0].VAR_POSITIONAL
    return (
        OfTime(function)
        if only_argument or (len(taken) > 1 and isinstance(taken[1].default, int | float))
        else function
    )


def read_text(layout: Layout, text: str, what: str) -> Expression:
    """An expression as text, where there is a parser."""
    try:
        reader = import_module("..model.input_texts", __package__)
    except ImportError:
        raise MissingDependencyError(
            f"{what}: an expression as text needs eomgen to read it: pip install eomgen, or give a function f(t, x)"
        ) from None
    known = ("t", *layout.x, *layout.p)
    moving = {q: v for q, v in zip(layout.velocity_labels, layout.v, strict=True) if q in layout.q}
    try:
        recorded = reader.record_text(
            text,
            reader.Names(layout.x, layout.p, moving, layout.plain),
            lambda name: unknown("name", name, known, what),
        )
    except ExpressionError as error:
        raise UsageError(f"{what}: {error}", code=error.code) from None
    return _expression(text, recorded)


def _expression(text: str, recorded: Any) -> Expression:
    tape, slopes, rate = recorded
    return Expression(text, tape, slopes, lambda name, of: _expression(f"d/dt ({text})", rate(name, of)))


# -- inputs of a run ---------------------------------------------------------------------------------------------------


DECLARED = "declared by the model"  #: the text of an input that the model has


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

    feedback = foreign = False
    within: tuple[float, float] | None = None  #: first and last number in the part between two corners
    span: tuple[float, float] | None = None
    lapse: Lapse | None = None
    unsettled: frozenset[str] = frozenset()  #: numbers that are given later, for each run of an ensemble

    def __init__(self, layout: Layout, inputs: Mapping[str, Any] | None) -> None:
        raw = {} if inputs is None else inputs
        require_mapping("inputs", raw)
        raw = without_dots(raw, layout.instances)
        check_names("input", raw, (*layout.u, *(name for name in layout.input_rates if name not in layout.u)))
        self.layout = layout
        self.constants: dict[str, float] = {}
        self.varying: dict[int, Callable[[float, Array], float]] = {}
        self.formulas: dict[int, Expression] = {}
        values = self.values = {name: self._read(name, value) for name, value in raw.items()}
        self.derived = fill_rates(layout, values, derive) if layout.input_rates else {}
        values |= {name: value for name, (_, _, value) in self.derived.items()}
        for name, tape in layout.signals.items():
            if name not in values:
                slopes = layout.info.signal_slopes[name]
                values[name] = Expression(DECLARED, tape, lambda slopes=slopes: slopes)  # type: ignore[misc]
        for name, value in values.items():
            if name not in layout.u:
                continue  # only its rates stand in the equations
            index = layout.u.index(name)
            if isinstance(value, Expression):
                self.formulas[index] = value
                self.feedback = self.feedback or value.depends_on_state
            elif isinstance(value, float):
                self.constants[name] = value
            else:
                self.varying[index] = value
                if not isinstance(value, Table):
                    self.feedback = self.foreign = True
        #: whether constraints depend on inputs that vary
        self.constrained = bool(values) and not {*self.varying, *self.formulas}.isdisjoint(layout.constraint_inputs)
        self.base, self.parameters = np.zeros(layout.n_u), np.zeros(layout.n_p)
        self.names = layout.u

    def _read(self, name: str, value: Any) -> Any:
        """What a user gives as a number, a Signal, an Expression or a function."""
        if isinstance(value, Signal | Expression):
            return value
        if callable(value):
            value = of_time(value)
            require_time_and_state(f"input {name}: its function", value)
            return value
        if isinstance(value, str):
            return read_text(self.layout, value, f"input {name}")
        if isinstance(value, (tuple, list)) and len(value) == 2 and isinstance(value[0], (Sequence, np.ndarray)):
            try:
                return Signal(*value)
            except UsageError as error:
                raise UsageError(f"input {name}: {error}", code=error.code) from None
        result = as_real(value)
        if result is None or result.ndim:
            raise ill_typed(
                f"input {name} must be a number, (times, values), a Signal, an expression as text or a function "
                f"f(t, x), not {quote(value)}"
            )
        return read_number(f"input {name}", value)

    def begin(self, start: float, end: float) -> None:
        """Take the times of a run, over which tables must be as smooth as the equations need them.

        Raises
        ------
        UsageError
            A table jumps where its rate is needed, or its rate where the rate of that is; a rate is not that of its
            input.
        """
        self.span = (start, end)
        if self:
            self.enter(start, end)
        if self.layout.input_rates:
            require_smooth(self, start, end)
            require_agreement(self, start, end)

    def again(self) -> Forcing:
        """The same inputs for another run, which has times of its own."""
        other = object.__new__(Forcing)
        other.__dict__.update(self.__dict__)
        return other

    def enter(self, start: float, end: float) -> None:
        """Go on with the part of a run between two corners: at its ends tables have the piece inside it."""
        self.within = _inside(start, end)

    def attach(self, module: Any) -> None:
        """Take the values that a module binds: its inputs where none are given, its parameters in expressions."""
        self.base, self.parameters = module.u, module.p
        for index, formula in self.formulas.items():
            self.varying[index] = formula.function(module.p)

    @property
    def state_dependent(self) -> list[int]:
        """Places in u of the inputs whose rates are inputs too and that depend on the state."""
        bases = {name for name, _, _ in self.derived.values()}
        return [i for i, formula in self.formulas.items() if self.names[i] in bases and formula.depends_on_state]

    @property
    def stepwise(self) -> bool:
        """Whether all inputs are constant between corners."""
        constant = all(isinstance(s, Signal) and s.order == 0 and s.corners for s in self.varying.values())
        return constant and not self.formulas

    def encode(self) -> list[tuple[Any, ...]]:
        """The inputs that vary, as the compiled loop takes them."""
        if not (self.varying or self.formulas):
            return []
        tables: list[tuple[Any, ...]] = [(i, *s.encode()) for i, s in self.varying.items() if isinstance(s, Table)]
        return [*tables, *((i, formula.tape) for i, formula in self.formulas.items())]

    def require_finite(self) -> None:
        """Raise UsageError if a value was not finite."""
        if self.lapse is not None:
            raise not_finite(str(self.lapse))

    def __bool__(self) -> bool:
        """Whether anything varies."""
        return bool(self.varying or self.formulas)

    def __call__(self, t: float, x: Array) -> Array:
        """u (n_u,) at time t and state x."""
        u = self.base.copy()
        inside = t if self.within is None else min(max(t, self.within[0]), self.within[1])
        for index, signal in self.varying.items():
            try:
                inner = inside != t and isinstance(signal, Table)
                seen = x.copy() if self.foreign else x  # a function may change what it is given
                value = signal.beside(t, inside) if inner else signal(t, seen)  # type: ignore[attr-defined]
            except Exception as error:
                error.add_note(f"raised by the function of input {self.names[index]}, called as f({t:.6g}, x)")
                raise
            u[index] = one = value if type(value) is float else self._one_number(index, t, value)
            if not isfinite(one) and np.isfinite(x).all():
                self.lapse = Lapse(self.names[index], t, one)
        return u

    def _one_number(self, index: int, t: float, value: Any) -> float:
        """What is no float as one, if it is a number: an integer, a NumPy scalar, an array of shape ()."""
        result = as_real(value)
        if result is not None and not result.ndim:
            return float(result)
        many = isinstance(value, np.ndarray) and value.ndim
        returned = f"an array of shape {value.shape}" if many else quote(value)
        raise ill_shaped(
            f"input {self.names[index]} must be one number at each time, but its function returned {returned} "
            f"at t = {t:.6g} s"
        )

    def sample(self, t: Array, x: Array) -> Array:
        """u (n_u, k) at times (k,) and states (n_x, k)."""
        if self.formulas and (result := self._sample_texts(t)) is not None:
            return result
        u = np.repeat(self.base[:, None], len(t), axis=1)
        tables = {i: signal for i, signal in self.varying.items() if isinstance(signal, Table)}
        for j in range(len(t) if len(self.varying) > len(tables) else 0):
            u[:, j] = self(float(t[j]), x[:, j])
        edges = None if self.span is None else _inside(*self.span)
        for i, signal in tables.items():
            inner = t if edges is None else np.clip(t, *edges)
            u[i] = signal(t) if isinstance(signal, Signal) else signal.beside(t, inner)
        return u

    def _sample_texts(self, t: Array) -> Array | None:
        """u (n_u, k) in one pass, where all that varies are expressions of time alone, and finite; else None.

        Then they are evaluated one by one, so that a fault tells its place.
        """
        if any(i not in self.formulas or self.formulas[i].depends_on_state for i in self.varying):
            return None
        u = np.repeat(self.base[:, None], len(t), axis=1)
        for i in self.varying:
            u[i] = play_arrays(self.formulas[i].tape, self.parameters, NONE, t)[0]
        return u if np.isfinite(u).all() else None

    def corners(self, start: float, end: float, every_jump: bool = False) -> list[float]:
        """Times strictly between start and end at which to restart the integrator, in its direction.

        Where they are more than KINKS, only some, unless ``every_jump``: compiled loops take any number.
        """
        if self.span != (start, end):
            self.begin(start, end)
        if not self.varying:
            return []
        low, high = min(start, end), max(start, end)

        def times_of(jumps: bool) -> list[float]:
            tables = (s for s in self.varying.values() if isinstance(s, Table))
            signals = (s for s in tables if (s.order == 0) == jumps)
            return sorted({float(t) for signal in signals for t in signal.kinks() if low < t < high})

        jumps, bends = times_of(True), times_of(False)
        every = sorted({*jumps, *bends}, reverse=end < start)
        return every if every_jump or len(every) <= KINKS else every[:: -(-len(every) // KINKS)]

    def jacobian(self, t: float, x: Array, rhs: Callable[..., Array]) -> Array | None:
        """What inputs that depend on the state add to the Jacobian: df/du du/dx, by differences; None if nothing."""
        if not self.feedback:
            return None
        u, n = self(t, x), len(x)
        du = np.zeros((len(u), n))
        for j in range(n):
            h = DIFFERENCE * max(1.0, abs(x[j]))
            moved = np.array(x, dtype=float)
            moved[j] += h
            du[:, j] = (self(t, moved) - u) / h
        if not du.any():
            return None
        f = rhs(t, x, u=u)
        result = np.zeros((n, n))
        for k in np.flatnonzero(du.any(axis=1)):
            h = DIFFERENCE * max(1.0, abs(u[k]))
            pushed = u.copy()
            pushed[k] += h
            result += np.outer((rhs(t, x, u=pushed) - f) / h, du[k])
        return result


def _inside(start: float, end: float) -> tuple[float, float] | None:
    """The least and the greatest number between two times; None where they are one."""
    low, high = min(start, end), max(start, end)
    return None if low == high else (nextafter(low, inf), nextafter(high, -inf))


# -- rates that follow from inputs -------------------------------------------------------------------------------------


def drift(values: Callable[[float], Array], t: float) -> Array:
    """Derivatives by time, (n,), of values that may depend on it, to fourth order."""
    h = (t + MOMENT * max(1.0, abs(t))) - t
    near, far = values(t + h) - values(t - h), values(t + 2.0 * h) - values(t - 2.0 * h)
    return np.asarray((8.0 * near - far) / (12.0 * h))


def moving_inputs(layout: Layout, u: Array) -> Array:
    """Rates (n_u,) of inputs whose rates are among the inputs u (n_u,); 0 of the others."""
    rates = np.zeros(layout.n_u)
    for base, rate in rate_places(layout).items():
        rates[base] = u[rate]
    return rates


def rate_pairs(layout: Layout) -> list[tuple[str, str]]:
    """Inputs, or their rates, each with the rate that is its derivative: (l, l_dot), (l_dot, l_ddot)."""
    return [
        (base, rate)
        for name, of in layout.input_rates.items()
        for (base, order), (rate, times) in pairwise([(name, 0), *of])
        if times == order + 1
    ]


def rate_places(layout: Layout) -> dict[int, int]:
    """Places in u of the inputs whose rates are inputs too, with those of the rates."""
    return {layout.u.index(base): layout.u.index(rate) for base, rate in rate_pairs(layout) if base in layout.u}


def fill_rates(
    layout: Layout, raw: Mapping[str, Any], derive: Callable[[str, str, Any], Any]
) -> dict[str, tuple[str, int, Any]]:
    """Rates that follow from inputs given by name: name -> (the input they are of, how many times it is derived,
    value).
    """
    result: dict[str, tuple[str, int, Any]] = {}
    signals = layout.signals
    for first, rates in layout.input_rates.items():
        last, order, value, at = (first, 0, raw[first], 0) if first in raw else ("", 0, None, 0)
        prescribed = first in raw or first in signals or first not in layout.u
        for rate, times in rates:
            prescribed = prescribed or rate in signals
            if rate in raw:
                if not prescribed and not (isinstance(raw[rate], int | float) and raw[rate] == 0):
                    raise incomplete(f"input {rate} is the rate of {first}, which is constant; give {first} too")
                prescribed = True
                last, order, value, at = rate, times, raw[rate], times
            elif last:
                for _ in range(times - at):
                    value = derive(last, rate, value)
                at = times
                result[rate] = last, times - order, value
    return result


def derive(name: str, rate: str, value: Any) -> Any:
    """The rate of an input given as a number, expression, Signal or function."""
    if isinstance(value, float):
        return 0.0
    if isinstance(value, Expression) and value.rate is not None:
        return value.rate(name, rate)
    derivative = getattr(value, "derivative", None)
    result = derivative() if callable(derivative) else None
    if result is not None:
        return of_time(result, True) if callable(result) else read_number(f"derivative of input {name}", result)
    raise cannot(
        f"input {name}: the equations need its rate {rate}, and the rate of a function is not known; give {rate} too, "
        f"or {name} as text, table or Signal, or as an object with a method derivative()"
    )


# -- refusals of jumps and of wrong rates ------------------------------------------------------------------------------

TimeFunction = Callable[[float], float]


def require_smooth(forcing: Forcing, start: float, end: float) -> None:
    """Refuse tables that jump where their rates are needed, and texts that do not change as their rates say."""
    layout = forcing.layout
    for rate, (name, times, _) in forcing.derived.items():
        table: Any = forcing.values[name]
        if not hasattr(table, "jumps"):
            continue
        jumps = [t for t in table.jumps(times - 1) if min(start, end) < t < max(start, end)]
        if jumps:
            what = "its value" if times == 1 else "its slope" if times == 2 else f"its derivative {times - 1}"
            raise UsageError(
                f"input {name}: the equations need {rate}, but {what} jumps in the {table.interpolation} table at "
                f't = {jumps[0]:.6g} s (an impact); give Signal(times, values, "cubic") over the whole run, a text, or '
                f"{rate} too",
                code="EG-JUMP",
            )
    zero = np.zeros(layout.n_x)
    for first, of in layout.input_rates.items():
        for name, rate in pairwise([first, *(rate for rate, _ in of)]):
            f, g = (forcing.values.get(n) for n in (name, rate))
            if not (isinstance(f, Expression) and isinstance(g, Expression)):
                continue
            follows = rate in forcing.derived or f.text == g.text == DECLARED
            if not follows or not f.branches or start == end:
                continue  # conditions have slope 0: only they can hide a jump
            what = f"input {name}: the equations need its rate {rate}"
            if f.depends_on_state:
                raise UsageError(
                    f"{what}, but conditions on the state can make it jump; write it without them", code="EG-JUMP"
                )
            value, slope = f.function(forcing.parameters), g.function(forcing.parameters)
            jump = find_jump(value, slope, zero, start, end)
            if jump is None:
                jump = find_switch(value, slope, f.switches(forcing.parameters), zero, start, end)
            if jump is not None:
                raise UsageError(
                    f"{what}, but it jumps at t = {jump:.6g} s, which is an impact; write it smoothly", code="EG-JUMP"
                )


def find_jump(
    value: Callable[[float, Array], float], rate: Callable[[float, Array], float], x: Array, start: float, end: float
) -> float | None:
    """A time at which a function jumps that has this rate elsewhere; None if it does not.

    Over an interval the function changes by the integral of its rate, whose error goes with the interval where the rate
    has kinks; a jump stays.
    """
    low, high = min(start, end), max(start, end)
    nodes, weights = np.polynomial.legendre.leggauss(4)

    def gap(a: float, b: float) -> float:
        times = 0.5 * (a + b) + 0.5 * (b - a) * nodes
        integral = 0.5 * (b - a) * sum(w * rate(t, x) for w, t in zip(weights, times, strict=True))
        return float(abs(value(b, x) - value(a, x) - integral))

    edges: list[float] = np.linspace(low, high, CELLS + 1).tolist()
    values = [value(t, x) for t in edges]
    allowed = CONTINUOUS * max(TINY, *map(abs, values))
    for a, b in pairwise(edges):
        left, right = a, b
        while gap(left, right) > allowed:
            middle = 0.5 * (left + right)
            if right - left <= LOCATED * (high - low) or not left < middle < right:
                return middle
            left, right = (left, middle) if gap(left, middle) > gap(middle, right) else (middle, right)
    return None


def find_switch(
    value: Callable[[float, Array], float],
    rate: Callable[[float, Array], float],
    switches: Callable[[float, Array], list[float]],
    x: Array,
    start: float,
    end: float,
) -> float | None:
    """A time at which a function jumps because a condition of it changes, however soon it changes back; None if none.

    The conditions are followed by what they compare, whose signs are looked at on the ends of CELLS intervals of the
    run and on four times inside each.
    """
    low, high = min(start, end), max(start, end)
    inner = 0.5 + 0.5 * np.polynomial.legendre.leggauss(4)[0]
    edges = np.linspace(low, high, CELLS + 1)
    times: list[float] = np.sort(np.concatenate([edges, *(edges[:-1] + s * np.diff(edges) for s in inner)])).tolist()
    signs = np.array([switches(t, x) for t in times]) > 0.0
    beside = LOCATED * (high - low)
    allowed = CONTINUOUS * max(TINY, *(abs(value(t, x)) for t in edges.tolist()))
    for i, k in np.argwhere(signs[1:] != signs[:-1]).tolist():
        left, right = times[i], times[i + 1]
        while right - left > beside and left < (middle := 0.5 * (left + right)) < right:
            left, right = (left, middle) if (switches(middle, x)[k] > 0.0) != signs[i, k] else (middle, right)
        before, after = left - beside, right + beside
        if before < low or after > high:
            continue
        rise = 2.0 * (after - before) * max(abs(rate(before, x)), abs(rate(after, x)))  # what it changes without a jump
        if abs(value(after, x) - value(before, x)) > allowed + rise:
            return 0.5 * (left + right)
    return None


def require_agreement(forcing: Forcing, start: float, end: float) -> None:
    """Refuse rates that are not those of the inputs beside which they are given, and rates bound of held inputs.

    What depends on the state is not compared: how it changes is known along the motion only.
    """
    values, layout, base = forcing.values, forcing.layout, forcing.base
    for first, of in layout.input_rates.items():
        for (name, order), (rate, times) in pairwise([(first, 0), *of]):
            if rate in forcing.derived or times != order + 1 or {name, rate} & forcing.unsettled:
                continue
            if rate not in values:
                bound = base[layout.u.index(rate)] if rate in layout.u else 0.0
                if first in layout.u and bound != 0.0:
                    raise untrue(
                        f"input {rate} is bound to {bound:.6g}, but it is the rate of {name}, which is constant; bind "
                        f"{rate} to 0, or give {name} over time in inputs="
                    )
            elif name in values and start != end:
                f, g = (_of_time(forcing, n) for n in (name, rate))
                if f is None or g is None:
                    continue
                table = any(hasattr(values[n], "times") for n in (name, rate))
                result = find_contradiction(f, g, start, end, CONTRADICTS_TABLE if table else CONTRADICTS)
                if result is not None:
                    t, changes, says = result
                    raise untrue(
                        f"input {rate} is not the rate of {name}: at t = {t:.6g} s {name} changes by {changes:.6g} per "
                        f"second, but {rate} is {says:.6g}; leave {rate} out if {name} is a number, a table or a "
                        "text, or correct it"
                    )
                jump = None if table else find_jump(lambda t, x, f=f: f(t), lambda t, x, g=g: g(t), NONE, start, end)  # type: ignore[misc]
                if jump is not None:
                    raise UsageError(
                        f"input {name}: the equations need its rate {rate}, but {name} jumps at t = {jump:.6g} s; such "
                        "a jump is an impact; write it smoothly",
                        code="EG-JUMP",
                    )


def _of_time(forcing: Forcing, name: str) -> TimeFunction | None:
    """An input as a function of time; None if it reads the state."""
    value: Any = forcing.values[name]
    if isinstance(value, float):
        known = name in forcing.constants and name in forcing.layout.u
        constant = float(forcing.base[forcing.layout.u.index(name)]) if known else value
        return lambda t: constant
    if isinstance(value, Expression):
        if value.depends_on_state:
            return None
        function, zero = value.function(forcing.parameters), np.zeros(forcing.layout.n_x)
        return lambda t: function(t, zero)
    if not isinstance(value, Table):
        try:
            value(forcing.span[0] if forcing.span else 0.0, None)
        except Exception:  # it reads the state; a fault of its own comes out where the run calls it
            return None
    return lambda t: float(value(t, None))


def find_contradiction(
    value: TimeFunction, rate: TimeFunction, start: float, end: float, limit: float
) -> tuple[float, float, float] | None:
    """A time, and there the rate of a function and what is given as its rate; None where they agree.

    Two comparisons must both fail.  What the function changes over parts of the run is the integral of its rate: the
    corners of tables do not matter here.  So is what it changes close to single times, however fast it oscillates.
    """
    low, high = min(start, end), max(start, end)
    nodes, weights = np.polynomial.legendre.leggauss(4)

    def integral(a: float, b: float) -> tuple[float, float]:
        """Of the rate, and of its size."""
        rates: Array = np.array([rate(t) for t in (0.5 * (a + b) + 0.5 * (b - a) * nodes).tolist()])
        return float(0.5 * (b - a) * weights @ rates), float(0.5 * (b - a) * weights @ abs(rates))

    edges: list[float] = np.linspace(low, high, BLOCKS * PARTS + 1).tolist()
    values = np.array([value(t) for t in edges])
    if not np.isfinite(values).all():
        return None  # refused by name where the run meets it
    parts = np.array([integral(a, b) for a, b in pairwise(edges)])
    drift = values - values[0] - np.concatenate([[0.0], np.cumsum(parts[:, 0])])
    least = CONTINUOUS * max(TINY, abs(values).max())
    size = max(abs(np.diff(values)).sum(), parts[:, 1].sum())
    if not abs(drift).max() > limit * size + least:
        return None
    for k in range(BLOCKS):
        t = edges[k * PARTS + PARTS // 2] + 0.1 * (edges[1] - edges[0])
        h = BESIDE * (high - low)
        changes, (says, _) = value(t + h) - value(t - h), integral(t - h, t + h)
        if abs(changes - says) > limit * max(abs(changes), abs(says)) + least * BESIDE:
            return t, changes / (2.0 * h), says / (2.0 * h)
    return None


# -- expressions as tapes, which compiled loops play -------------------------------------------------------------------

#: (operation, operands) one after the other, the numbers among them, and the instructions handed out.
Tape = tuple[list[tuple[str, int, int, int]], list[float], list[int]]


class Expression:
    """An input, or the value of an event, by an expression of time, coordinates, velocities and parameters.

    Parameters
    ----------
    text : str
        As results and messages name it.
    tape : list
        As :mod:`eomgen.expr.schedule` makes them.
    slopes : callable
        Places of the derivatives that do not vanish, among those by t, x and p, and their tape.
    rate : callable, optional
        (name, rate) -> the derivative by time along the motion, of an input called ``name``.
    """

    def __init__(
        self,
        text: str,
        tape: Sequence[Any],
        slopes: Callable[[], Sequence[Any]],
        rate: Callable[[str, str], Expression] | None = None,
    ) -> None:
        code, numbers, out = tape
        self.text, self.rate, self._slopes = text, rate, slopes
        self.tape: Tape = [(str(op), int(a), int(b), int(c)) for op, a, b, c in code], list(numbers), list(out)
        #: whether it reads the state
        self.depends_on_state = any(op == "x" for op, *_ in self.tape[0])
        #: whether it has conditions, at which it may jump or bend
        self.branches = not operations_with(lambda row: row.bends).isdisjoint(op for op, *_ in self.tape[0])

    def function(self, p: Array) -> Callable[[float, Array], float]:
        """f(t, x) at given parameters (n_p,)."""
        play = player(self.tape, p)
        return lambda t, x: play(t, x)[0]

    def switches(self, p: Array) -> Callable[[float, Array], list[float]]:
        """What changes its sign where a condition does: a - b of each comparison of a with b, and a of sign(a)."""
        code, numbers, _ = self.tape
        steps = [(OPERATIONS[op].arity, a, b) for op, a, b, _ in code if op in OPERATIONS and OPERATIONS[op].jumps]
        added = [("sub", a, b, 0) for arity, a, b in steps if arity == 2]
        out = [*range(len(code), len(code) + len(added)), *(a for arity, a, _ in steps if arity == 1)]
        return player(([*code, *added], numbers, out), p)

    def slopes(self, p: Array) -> Callable[[float, Array], Array]:
        """Its derivatives (1 + n_x + n_p,) by t, x and p, as f(t, x) at given parameters (n_p,)."""
        places, tape = self._derived
        play = player(tape, p)

        def slopes(t: float, x: Array) -> Array:
            result = np.zeros(1 + len(x) + len(p))
            result[places] = play(t, x)
            return result

        return slopes

    @cached_property
    def _derived(self) -> tuple[list[int], Sequence[Any]]:
        places, tape = self._slopes()
        return [int(k) for k in places], tape


def joined(tapes: Iterable[Tape]) -> Tape:
    """One tape with the results of several."""
    code: list[tuple[str, int, int, int]] = []
    numbers: list[float] = []
    out: list[int] = []
    for own_code, own_numbers, own_out in tapes:
        start, first = len(code), len(numbers)
        for op, a, b, c in own_code:
            operands = (a + start, b + start, c + start) if op in OPERATIONS else (a + first * (op == "const"), b, c)
            code.append((op, *operands))
        numbers += own_numbers
        out += [start + k for k in own_out]
    return code, numbers, out


def player(tape: Sequence[Any], p: Array) -> Callable[[float, Array], list[float]]:
    """The results of a tape at time t and state x, and at given parameters (n_p,)."""
    code, numbers, out = tape
    fixed = {"const": numbers, "p": p.tolist()}
    first = [fixed[op][a] if op in fixed else 0.0 for op, a, _, _ in code]
    times = [k for k, (op, *_) in enumerate(code) if op == "t"]
    states = [(k, a) for k, (op, a, _, _) in enumerate(code) if op == "x"]
    steps = [(k, row := OPERATIONS[op], at[: row.arity]) for k, (op, *at) in enumerate(code) if op in OPERATIONS]

    def play(t: float, x: Array) -> list[float]:
        results = first.copy()
        for k in times:
            results[k] = t
        for k, a in states:
            results[k] = float(x[a])
        for k, row, at in steps:
            operands = [results[i] for i in at]
            try:
                results[k] = float(row.value(*operands))
            except (ArithmeticError, ValueError):  # outside of its domain, or infinite: as C has it
                with np.errstate(all="ignore"):
                    results[k] = float(row.array(*operands))
        return [results[k] for k in out]

    return play
