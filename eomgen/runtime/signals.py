"""Stage runtime: inputs as a user gives them (number, table, function) -> u(t, x) for kernels."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from math import inf, isfinite, nextafter
from typing import Any, NamedTuple

import numpy as np

from ..base.algebra import Array
from ..base.limits.runs import CONTINUOUS, DIFFERENCE
from ..base.texts import shown
from ..errors import UsageError, ill_shaped, ill_typed, no_number, not_finite, off_range
from .input_kinds import Expressed, Tabulated, of_time
from .input_texts import is_formula, read_formula
from .layout import Layout
from .near_names import check_names, require_mapping, require_time_and_state, unknown, without_dots
from .room import as_real, read_number, read_numbers

KINKS = 1000  #: at most so many corners of tables are stepped on exactly by SciPy's methods
#: How a table goes on between its times -> the order of its pieces.
ORDERS = {"linear": 1, "zero-order": 0, "cubic": 3}


class Signal(Tabulated):
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
        self.interpolation, self.order, self.corners = interpolation, ORDERS[interpolation], corners
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

    def beside(self, t: Any, at: Any) -> Any:
        """The value at t of the piece that holds at time ``at``."""
        return self(at if self.order == 0 and self.corners else t)

    def derivative(self) -> Tabulated:
        """The rate between the jumps of the value."""
        from .signal_rates import TableRate

        return TableRate(self.times, self._pieces, self.corners).derivative()

    def jumps(self, order: int) -> Array:
        """Times at which the derivative of an order jumps; 0: the value."""
        from .signal_rates import jumps

        return jumps(self.times, self._pieces, self.values, order)

    @property
    def _pieces(self) -> Array:
        from .signal_rates import pieces_of

        return pieces_of(self.times, self.values, self.coefficients if self.order == 3 else None, self.order)

    @cached_property
    def coefficients(self) -> Array:
        """Rows (k, 4) of value, slope, half the curvature and a sixth of the third derivative at each time."""
        result = np.zeros((len(self.times), 4))
        result[:, 0] = self.values
        if len(self.times) > 1:
            from ..numeric.splines import slopes

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
        return np.asarray(self.times[np.abs(np.diff(rates)) > CONTINUOUS * size])

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

    feedback = foreign = False
    within: tuple[float, float] | None = None  #: first and last number in the part between two corners
    span: tuple[float, float] | None = None
    lapse: Lapse | None = None
    unsettled: frozenset[str] = frozenset()  #: numbers that are given later, for each run of an ensemble

    def __init__(self, layout: Layout, inputs: Mapping[str, Any] | None) -> None:
        given = {} if inputs is None else inputs
        require_mapping("inputs", given)
        given = without_dots(given, layout.instances)
        check_names("input", given, (*layout.u, *(name for name in layout.input_rates if name not in layout.u)))
        self.layout = layout
        self.constants: dict[str, float] = {}
        self.varying: dict[int, Callable[[float, Array], float]] = {}
        self.formulas: dict[int, Expressed] = {}
        values = self.values = {name: self._read(name, value) for name, value in given.items()}
        self.derived = self._derive(layout, values) if layout.input_rates else {}
        values |= {name: value for name, (_, _, value) in self.derived.items()}
        for name, tape in layout.metadata.get("signals", {}).items():
            if name not in values:
                from .tapes import DeclaredSignal

                values[name] = DeclaredSignal(tape, layout.metadata["signal_slopes"][name])
        for name, value in values.items():
            if name not in layout.u:
                continue  # only its rates stand in the equations
            index = layout.u.index(name)
            if isinstance(value, Expressed):
                self.formulas[index] = value
                self.feedback = self.feedback or value.depends_on_state
            elif isinstance(value, float):
                self.constants[name] = value
            else:
                self.varying[index] = value
                if not isinstance(value, Tabulated):
                    self.feedback = self.foreign = True
        #: whether constraints depend on inputs that vary
        self.constrained = bool(values) and not {*self.varying, *self.formulas}.isdisjoint(layout.constraint_inputs)
        self.base, self.parameters = np.zeros(layout.n_u), np.zeros(layout.n_p)
        self.names = layout.u

    @staticmethod
    def _derive(layout: Layout, values: Mapping[str, Any]) -> dict[str, tuple[str, int, Any]]:
        """Rates that the equations need and that follow from what is given."""
        from .signal_rates import derive, fill_rates

        return fill_rates(layout, values, derive)

    def _read(self, name: str, value: Any) -> Any:
        """What a user gives as a number, a Signal, a Formula or a function."""
        if isinstance(value, Signal):
            return value
        if callable(value):
            value = of_time(value)
            require_time_and_state(f"input {name}: its function", value)
            return value
        if is_formula(value):
            return read_formula(self.layout, value, f"input {name}")
        if isinstance(value, (tuple, list)) and len(value) == 2 and isinstance(value[0], (Sequence, np.ndarray)):
            try:
                return Signal(*value)
            except UsageError as error:
                raise UsageError(f"input {name}: {error}", code=error.code) from None
        found = as_real(value)
        if found is None or found.ndim:
            raise ill_typed(
                f"input {name} must be a number, (times, values), a Signal, an expression as text or a function "
                f"f(t, x), not {shown(value)}"
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
            from .rate_checks import require_agreement
            from .signal_rates import require_smooth

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
        held = all(isinstance(s, Signal) and s.order == 0 and s.corners for s in self.varying.values())
        return held and not self.formulas

    def encode(self) -> list[tuple[Any, ...]]:
        """The inputs that vary, as the compiled loop takes them."""
        if not (self.varying or self.formulas):
            return []
        tables: list[tuple[Any, ...]] = [(i, *s.encode()) for i, s in self.varying.items() if isinstance(s, Tabulated)]
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
                inner = inside != t and isinstance(signal, Tabulated)
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
        found = as_real(value)
        if found is not None and not found.ndim:
            return float(found)
        many = isinstance(value, np.ndarray) and value.ndim
        returned = f"an array of shape {value.shape}" if many else shown(value)
        raise ill_shaped(
            f"input {self.names[index]} must be one number at each time, but its function returned {returned} "
            f"at t = {t:.6g} s"
        )

    def sample(self, t: Array, x: Array) -> Array:
        """u (n_u, k) at times (k,) and states (n_x, k)."""
        at_once = getattr(next(iter(self.formulas.values()), None), "sample_all", None)
        if at_once is not None and (found := at_once(self, t)) is not None:
            return np.asarray(found)
        u = np.repeat(self.base[:, None], len(t), axis=1)
        tables = {i: signal for i, signal in self.varying.items() if isinstance(signal, Tabulated)}
        for j in range(len(t) if len(self.varying) > len(tables) else 0):
            u[:, j] = self(float(t[j]), x[:, j])
        edges = None if self.span is None else _inside(*self.span)
        for i, signal in tables.items():
            inner = t if edges is None else np.clip(t, *edges)
            u[i] = signal(t) if isinstance(signal, Signal) else signal.beside(t, inner)
        return u

    def corners(self, start: float, end: float, every_jump: bool = False) -> list[float]:
        """Times strictly between start and end at which to restart the integrator, in its direction.

        Where they are more than KINKS, only some, unless ``every_jump``: compiled loops take any number.
        """
        if self.span != (start, end):
            self.begin(start, end)
        if not self.varying:
            return []
        low, high = min(start, end), max(start, end)

        def found(jumps: bool) -> list[float]:
            tables = (s for s in self.varying.values() if isinstance(s, Tabulated))
            signals = (s for s in tables if (s.order == 0) == jumps)
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
