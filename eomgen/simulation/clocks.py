"""Simulation: the state where a run begins -> that state, with each clock of sampled states at its next time.

A clock is an event, t - offset - k period, and the state that holds k, the number of its next time.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.constraints import MEASURED
from ..base.limits.runs import MOST_STEPS, WHOLE
from ..errors import UsageError, cannot, off_range, untrue
from ..runtime.refusals import require_switched
from .events import instant

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

FINEST = 1e-3  #: part of a period that times must tell apart


def at_next_samples(
    module: BoundModel, t: float, x: Array, span: tuple[float, float] | None = None, initial: Any = None
) -> Array:
    """The state x (n_x,) at time t with clocks whose next time is past set to their first one that is not.

    A sampling time at t itself happens.  A clock that is ahead by more than its period, as that of a state from the end
    of another run, is set back; one that has not begun stays so.

    Raises
    ------
    UsageError
        A period is not positive, a counter not whole, or the `span` of the run goes backwards.
    """
    clocks: list[dict[str, Any]] = module.metadata.get("clocks", [])
    if span is not None:
        require_forward(module, *span)
        require_agreement(module, t, x, initial)
    if not clocks:
        return x
    values = module.kernels.timed("events")
    found = np.array(x, dtype=float)
    for clock in clocks:
        event, place = int(clock["event"]), int(clock["counter"])
        states, first = ", ".join(clock["states"]), np.where(np.arange(len(found)) == place, 0.0, found)
        late, period = _lateness(values, t, found, event, place)[0], _lateness(values, 0.0, first, event, place)[1]
        if not period > 0.0:
            raise off_range(f"the period of {states} is {period:.6g} s; give a positive time between samples")
        start, end = span or (t, t)
        if abs(end - start) > MOST_STEPS * period:
            raise UsageError(
                f"a run from {start:g} to {end:g} s has {abs(end - start) / period:.2g} samples of {states}, one every "
                f"{period:g} s, so it would not end; give a shorter span",
                code="EG-ENDLESS",
            )
        if (latest := max(abs(start), abs(end))) + FINEST * period == latest:
            raise off_range(
                f"the period of {states}, {period:g} s, is lost in rounding at times near {latest:g} s; begin the run "
                "nearer to t = 0"
            )
        if not abs(found[place] - round(found[place])) < WHOLE:
            name = module.x_names[place]
            raise off_range(f"{name} counts samples, so it must be a whole number, not {found[place]:.9g}")
        if late > 0.0 or (found[place] >= 1.0 and late < -period - instant(t)):
            found[place] = max(found[place] + ceil((late - instant(t)) / period), 0.0)
            while found[place] >= 1.0 and _lateness(values, t, _less_one(found, place), event, place)[0] <= instant(t):
                found[place] -= 1.0  # the period has been rounded
        while (late := _lateness(values, t, found, event, place)[0]) > 0.0:  # rounding: its time is this one
            found[place] = max(np.nextafter(found[place], np.inf), found[place] + late / period)
    return found


def _less_one(x: Array, place: int) -> Array:
    return np.where(np.arange(len(x)) == place, x - 1.0, x)


def _lateness(values: Any, t: float, x: Array, event: int, place: int) -> tuple[float, float]:
    """How long ago the next time of a clock was (s), and its period (s)."""
    late, ahead = float(values(t, x)[event]), np.array(x)
    ahead[place] += 1.0
    return late, late - float(values(t, ahead)[event])


def require_forward(module: BoundModel, start: float, end: float) -> None:
    """Refuse a run backwards in time of a model with sampled states, or with constraints that close and open.

    What they were before a sample, and the velocities before an impact, are not known.

    Raises
    ------
    UsageError
    """
    clocks: list[dict[str, Any]] = module.metadata.get("clocks", [])
    if clocks and end < start:
        raise cannot(
            f"a run of sampled states ({', '.join(clocks[0]['states'])}) goes forward in time, not from {start:.6g} s "
            f"to {end:.6g} s"
        )
    switched: list[str] = module.metadata.get("switched", [])
    if switched and end < start:
        raise cannot(
            f"a run of constraints that close and open ({', '.join(switched)}) goes forward in time, not from "
            f"{start:.6g} s to {end:.6g} s"
        )


def require_agreement(module: BoundModel, t: float, x: Array, initial: Any) -> None:
    """Refuse a start at which a constraint that the model declares closed does not hold.

    A state from another run, and constraints that are closed by name in `initial`, are taken as they are: an error that
    was there when a constraint closed dies away in the run.

    Raises
    ------
    UsageError
        Tells the equation, its error and how much of one is allowed.
    """
    layout = module.layout
    require_switched(layout, x[layout.n_x - layout.n_states :])
    rows: list[tuple[str, str, str]] = module.metadata.get("held_rows", [])
    if (
        not rows
        or not (initial is None or isinstance(initial, Mapping))
        or "held_errors" not in module.kernels.core.names
    ):
        return
    found = module.kernels.timed("held_errors")(t, x)
    fast = max(1.0, layout.scales.speed(x[layout.n_q :]))
    for k, (label, state, kind) in enumerate(rows):
        size, unit = (layout.length, "m") if kind == "length" else (1.0, "rad")
        for value, limit, what, per in (
            (found[2 * k], MEASURED * size, "is off by", ""),
            (found[2 * k + 1], MEASURED * size * fast, "changes by", "/s"),
        ):
            if not abs(value) <= limit and state not in (initial or ()):
                name = state.removesuffix("_closed")
                raise untrue(
                    f"constraint {name} is closed at the start, and its equation {label} {what} {value:.6g} "
                    f"{unit}{per} there (up to {limit:.2g} counts as held); give a start where it holds, or "
                    "closed: false"
                )
