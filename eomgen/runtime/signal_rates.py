"""Stage runtime: an input as it is given for a run -> its rates, which the equations may need as inputs of their own.

A number has rate 0, a table the slope of its pieces, a text the derivative of its expression along the motion, and an
object with a method ``derivative()`` says it itself.  Of any other function no rate is known, and it is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.numbers import TINY
from ..base.limits.runs import CONTINUOUS, LOCATED, MOMENT
from ..errors import UsageError, cannot, incomplete
from .input_kinds import Expressed, Tabulated, of_time
from .layout import Layout
from .room import read_number
from .tapes import DeclaredSignal

if TYPE_CHECKING:
    from .protocols import Driven

CELLS = 256  #: intervals of a run in which jumps of a text are looked for


class TableRate(Tabulated):
    """A derivative of a table by time: cubic pieces that may jump where they meet, 0 before and after.

    At the first and the last time it is that of the piece inside, so that a run over just the table sees no jump.

    Parameters
    ----------
    times : (k,) array
    pieces : (k - 1, 4) array
        Coefficients of each piece in powers of the time since its beginning.
    corners : bool
        Whether integrators step on the times where pieces meet.
    """

    order = 4  #: as the compiled loop knows it

    def __init__(self, times: Array, pieces: Array, corners: bool) -> None:
        self.times, self.pieces, self.corners = times, pieces, corners

    def __call__(self, t: Any, x: Any = None) -> Any:
        """The value at time t, a number or an array of them."""
        return self.beside(t, t)

    def beside(self, t: Any, at: Any) -> Any:
        """The value at t of the piece that holds at time ``at``."""
        if not len(self.pieces):
            return np.zeros(np.shape(t))[()]
        k = np.clip(np.searchsorted(self.times, at, side="right") - 1, 0, len(self.pieces) - 1)
        s, c = np.asarray(t) - self.times[k], self.pieces[k]
        value = c[..., 0] + s * (c[..., 1] + s * (c[..., 2] + s * c[..., 3]))
        return np.where((np.asarray(at) < self.times[0]) | (np.asarray(at) > self.times[-1]), 0.0, value)[()]

    def derivative(self) -> TableRate:
        """The derivative of this one."""
        return TableRate(self.times, self.pieces[:, [1, 2, 3, 3]] * (1.0, 2.0, 3.0, 0.0), self.corners)

    def kinks(self) -> Array:
        """Times where integrators start anew."""
        return self.times if self.corners else np.empty(0)

    def encode(self) -> tuple[int, Array, Array]:
        """Order, times and values as the compiled loop reads them: 0 from a time before the first to it, and after."""
        nothing = np.zeros((1, 4))
        times = np.concatenate([[self.times[0] - 1.0], self.times])
        return self.order if self.corners else 3, times, np.concatenate([nothing, self.pieces, nothing])


def pieces_of(times: Array, values: Array, coefficients: Array | None, order: int) -> Array:
    """Rows (k - 1, 4) of a table: value, slope, half the curvature, a sixth of the third derivative of each piece."""
    if coefficients is not None:
        return coefficients[:-1]
    pieces = np.zeros((len(times) - 1, 4))
    pieces[:, 0] = values[:-1]
    if order == 1:
        pieces[:, 1] = np.diff(values) / np.diff(times)
    return pieces


def jumps(times: Array, pieces: Array, values: Array, order: int) -> Array:
    """Times at which the derivative of an order (0: the value) of a table jumps; its end values hold outside."""
    here, ends = TableRate(times, pieces, True), (values[:1], values[-1:])
    for _ in range(order):
        here, ends = here.derivative(), (np.zeros(1), np.zeros(1))
    left = np.concatenate([ends[0], here.beside(times[1:], times[:-1])]) if len(pieces) else ends[0]
    right = np.concatenate([here.beside(times[:-1], times[:-1]), ends[1]]) if len(pieces) else ends[1]
    size = max(np.abs(left).max(), np.abs(right).max())
    return np.asarray(times[np.abs(right - left) > CONTINUOUS * size])


def require_smooth(forcing: Driven, start: float, end: float) -> None:
    """Refuse tables that jump where their rates are needed, and texts that do not change as their rates say.

    Raises
    ------
    UsageError
    """
    layout = forcing.layout
    for rate, (name, times, _) in forcing.derived.items():
        table: Any = forcing.values[name]
        if not hasattr(table, "jumps"):
            continue
        found = [t for t in table.jumps(times - 1) if min(start, end) < t < max(start, end)]
        if found:
            what = "its value" if times == 1 else "its slope" if times == 2 else f"its derivative {times - 1}"
            raise UsageError(
                f"input {name}: the equations need {rate}, but {what} jumps in the {table.interpolation} table at "
                f't = {found[0]:.6g} s (an impact); give Signal(times, values, "cubic") over the whole run, a text, or '
                f"{rate} too",
                code="EG-JUMP",
            )
    zero = np.zeros(layout.n_x)
    for first, of in layout.input_rates.items():
        for name, rate in pairwise([first, *(rate for rate, _ in of)]):
            f, g = (forcing.values.get(n) for n in (name, rate))
            if not (isinstance(f, Expressed) and isinstance(g, Expressed)):
                continue
            follows = rate in forcing.derived or (isinstance(f, DeclaredSignal) and isinstance(g, DeclaredSignal))
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
        own = 2.0 * (after - before) * max(abs(rate(before, x)), abs(rate(after, x)))  # what it changes without a jump
        if abs(value(after, x) - value(before, x)) > allowed + own:
            return 0.5 * (left + right)
    return None


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
    layout: Layout, given: Mapping[str, Any], derive: Callable[[str, str, Any], Any]
) -> dict[str, tuple[str, int, Any]]:
    """Rates that follow from what is given: name -> (the input they are of, how many times it is derived, value).

    Parameters
    ----------
    layout : Layout
    given : mapping
        Inputs of a run, by name.
    derive : callable
        As :func:`derive`.

    Raises
    ------
    UsageError
        A rate is given of an input that is held.
    """
    found: dict[str, tuple[str, int, Any]] = {}
    signals = layout.metadata.get("signals", {})
    for first, rates in layout.input_rates.items():
        last, order, value, at = (first, 0, given[first], 0) if first in given else ("", 0, None, 0)
        led = first in given or first in signals or first not in layout.u
        for rate, times in rates:
            led = led or rate in signals
            if rate in given:
                if not led and not (isinstance(given[rate], int | float) and given[rate] == 0):
                    raise incomplete(f"input {rate} is the rate of {first}, which is constant; give {first} too")
                led = True
                last, order, value, at = rate, times, given[rate], times
            elif last:
                for _ in range(times - at):
                    value = derive(last, rate, value)
                at = times
                found[rate] = last, times - order, value
    return found


def derive(name: str, rate: str, value: Any) -> Any:
    """The rate of an input given as a number, expression, Signal or function.

    Raises
    ------
    UsageError
        It is a function that knows none, or would need accelerations.
    """
    if isinstance(value, float):
        return 0.0
    if isinstance(value, Expressed) and (known := value.rate(name, rate)) is not None:
        return known
    derivative = getattr(value, "derivative", None)
    found = derivative() if callable(derivative) else None
    if found is not None:
        return of_time(found, True) if callable(found) else read_number(f"derivative of input {name}", found)
    raise cannot(
        f"input {name}: the equations need its rate {rate}, and the rate of a function is not known; give {rate} too, "
        f"or {name} as text, table or Signal, or as an object with a method derivative()"
    )
