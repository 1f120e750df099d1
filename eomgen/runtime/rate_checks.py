"""Stage runtime: rates given beside their inputs -> refused where they are not those of the inputs."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.numbers import TINY
from ..base.limits.runs import CONTINUOUS, CONTRADICTS, CONTRADICTS_TABLE, DIFFERENCE
from ..errors import UsageError, untrue
from .input_kinds import Expressed
from .signal_rates import TableRate, find_jump

if TYPE_CHECKING:
    from .protocols import Driven

OfTime = Callable[[float], float]
NONE = np.empty(0)  #: no state
BLOCKS, CELLS = 16, 16  #: a run is compared on so many parts, each of so many intervals
BESIDE = DIFFERENCE  #: part of a run over which an input and its rate are compared beside one time


def require_agreement(forcing: Driven, start: float, end: float) -> None:
    """Refuse rates that are not those of the inputs beside which they are given, and rates bound of held inputs.

    What depends on the state is not compared: how it changes is known along the motion only.

    Raises
    ------
    UsageError
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
                found = find_contradiction(f, g, start, end, CONTRADICTS_TABLE if table else CONTRADICTS)
                if found is not None:
                    t, changes, says = found
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


def _of_time(forcing: Driven, name: str) -> OfTime | None:
    """An input as a function of time; None if it reads the state."""
    value: Any = forcing.values[name]
    if isinstance(value, float):
        known = name in forcing.constants and name in forcing.layout.u
        constant = float(forcing.base[forcing.layout.u.index(name)]) if known else value
        return lambda t: constant
    if isinstance(value, Expressed):
        if value.depends_on_state:
            return None
        function, zero = value.function(forcing.parameters), np.zeros(forcing.layout.n_x)
        return lambda t: function(t, zero)
    if not isinstance(value, TableRate) and not hasattr(value, "interpolation"):
        try:
            value(forcing.span[0] if forcing.span else 0.0, None)
        except Exception:  # it reads the state; a fault of its own comes out where the run calls it
            return None
    return lambda t: float(value(t, None))


def find_contradiction(
    value: OfTime, rate: OfTime, start: float, end: float, limit: float
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

    edges: list[float] = np.linspace(low, high, BLOCKS * CELLS + 1).tolist()
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
        t = edges[k * CELLS + CELLS // 2] + 0.1 * (edges[1] - edges[0])
        h = BESIDE * (high - low)
        changes, (says, _) = value(t + h) - value(t - h), integral(t - h, t + h)
        if abs(changes - says) > limit * max(abs(changes), abs(says)) + least * BESIDE:
            return t, changes / (2.0 * h), says / (2.0 * h)
    return None
