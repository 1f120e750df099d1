"""Events of the model and of one run -> what integrators watch for, and what happens then.

An event is a zero of an expression or function of time and state.  Those of the model are compiled with it; those given
for a run are its names, expressions as text, or functions f(t, x) with SciPy's attributes.

A clock is an event, t - offset - k period, and the state that holds k, the number of its next time.
"""

from __future__ import annotations

import ast
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextvars import ContextVar
from functools import partial
from math import ceil, isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.algebra import Array
from ...base.limits.constraints import MEASURED
from ...base.limits.runs import CROWD, EARLIEST, INSTANT, MOST_STEPS, WHOLE
from ...base.texts import parse_python, quote
from ...base.value_rules import as_count
from ...errors import (
    SimulationError,
    UsageError,
    ZenoError,
    calls_within,
    cannot,
    ill_typed,
    no_choice,
    no_number,
    off_range,
    untrue,
)
from ..argument_checks import as_real, check_names, require_mapping, require_time_and_state, without_dots
from ..inputs import Expression, joined, read_text
from ..layout import Layout, within
from ..refusals import require_switched

if TYPE_CHECKING:
    from ..bound_model import BoundModel
    from ..inputs import Forcing

GO_ON, RESET, WAIT = 0, 1, 2  #: as in eomgen_steppers.h
PAUSE = 3  #: the loop stops there and goes on, from another state or the same
UNWATCHED = 2  #: a direction


def instant(t: float) -> float:
    """Times this near to t (s) are one time."""
    return INSTANT * max(abs(t), EARLIEST)


class RunEvent:
    """An event with the number of times it may still happen.

    The function f(t, x) is the user's, with SciPy's attributes unless these are given; None where the loop itself
    evaluates it.  ``terminal`` is the number of times that ends the run, 0 for never; ``direction`` 1 rising, -1
    falling, 0 both, or UNWATCHED; ``action`` tells whether the model's kernel gives a new state, or an impact does.
    """

    def __init__(
        self,
        function: Any,
        name: str = "",
        terminal: float | None = None,
        direction: float | None = None,
        action: int = GO_ON,
    ) -> None:
        if function is not None:
            if not callable(function):
                raise ill_typed(f"an event must be a name, an expression or a function f(t, x), not {function!r}")
            require_time_and_state("an event", function)
        self.function, self.action = function, action
        self.name = name or str(getattr(function, "__name__", type(function).__name__))
        self.terminal = _times(self.name, getattr(function, "terminal", None) if terminal is None else terminal)
        raw = getattr(function, "direction", 0) if direction is None else direction
        self.direction = int(np.sign(raw)) if raw != UNWATCHED or direction is None else UNWATCHED

    def __call__(self, t: float, x: Array, for_slope: bool = False) -> float:
        """The value of the user's function at time t and state x."""
        value = self.function(t, x)
        result: Any = as_real(value)
        if result is None or result.ndim or not (for_slope or isfinite(result)):
            text = quote(value if result is None or result.ndim else float(result))
            raise no_number(
                f"event {self.name} is {text} at t = {t:.6g} s; its function must return a finite number at every "
                "time and state of the run; an expression as a text may be undefined in parts of it"
            )
        return float(result)


class Events:
    """All events of one run.

    Parameters
    ----------
    raw : None, or one event or several: names, texts, functions; a mapping names them
        None watches all of the model.  Those of the model that reset the state are watched always.
    controllers : mapping of str to callable, optional
        Functions f(t, x) that give the new values of sampled states without a law, by name.
    """

    def __init__(self, layout: Layout, raw: Any, controllers: Mapping[str, Any] | None = None) -> None:
        self.layout = layout
        #: by the event at which they act, in the order of renewal
        self.controllers = {} if controllers is None else _by_event(layout, controllers)
        self.declared = layout.info.events
        self.over = False  #: whether the last reset ended the run
        self.names, self.last = list[str](), ""  #: last: the event whose new state is requested, as messages name it
        self.model: list[RunEvent] = []
        self.formulas: list[tuple[RunEvent, Expression]] = []
        self.functions: list[RunEvent] = []
        if raw is None and not self.declared:
            return
        known = [str(event["name"]) for event in self.declared]
        chosen = set(known) if raw is None else set()
        for name, one in _listed(raw):
            if isinstance(one, str) and one in known and name is None:
                chosen.add(one)
            elif isinstance(one, str | Mapping):
                self.formulas.append(_of_text(layout, one, name))
            else:
                self.functions.append(RunEvent(one, name or ""))
        self.model = [_of_model(event, event["name"] in chosen) for event in self.declared]
        for i in self.controllers:
            self.model[i].action = WAIT  # compiled loops ask Python there
        taken: dict[str, int] = {}
        for name in (*known, *(event.name for event, _ in self.formulas), *(event.name for event in self.functions)):
            taken[name] = taken.get(name, 0) + 1
            self.names.append(name if taken[name] == 1 else f"{name}_{taken[name]}")
        if all(event.direction == UNWATCHED for event in self.model):
            self.names, self.model = self.names[len(known) :], []
        if any(event.action == WAIT for i, event in enumerate(self.model) if i not in self.controllers):
            from ..impacts.impact import strike_events

            self._strike = strike_events

    def __len__(self) -> int:
        return len(self.names)

    @property
    def resets(self) -> bool:
        """Whether an event changes the state."""
        return any(event.action != GO_ON for event in self.model)

    @property
    def every(self) -> list[RunEvent]:
        """In the order of their names."""
        return [*self.model, *(event for event, _ in self.formulas), *self.functions]

    def encode(self) -> dict[str, Any] | None:
        """As the compiled loop takes them; None if there are none."""
        if not self.names:
            return None
        every, texts = self.every, [formula for _, formula in self.formulas]
        return {
            "model": len(self.model),
            "tape": joined(text.tape for text in texts) if texts else None,
            "outside": self.functions,
            "direction": [event.direction for event in every],
            "most": [int(event.terminal) for event in every],
            "action": [event.action for event in every],
            "crowd": crowd_of([event.action for event in every]),
            "resets": self.layout.info.resets if self.model else [],
        }

    def reset(self, module: BoundModel, forcing: Forcing, t: float, x: Array, fired: Sequence[int]) -> Array:
        """The state after the events that happened at time t."""
        after = np.array(x, dtype=float)
        for i in fired:
            if self.model[i].action == RESET or i in self.controllers:
                after = self.renewed(module, forcing, t, after, i)
                for control in self.controllers.get(i, ()):
                    after[control.place] = control(t, after)
                after = np.asarray(module.project(after, t=t, u=forcing(t, after)))
        gaps = [i for i in fired if self.model[i].action == WAIT and i not in self.controllers]
        if gaps:
            self.last = f" at event {', '.join(self.names[i] for i in gaps)}"
            after = self._strike(module, t, after, self.declared, gaps, forcing)
        self.last = ""
        return after

    def renewed(self, module: BoundModel, forcing: Forcing, t: float, x: Array, event: int) -> Array:
        """The state x with the new values that the model gives at an event."""
        after, resets, self.last = x.copy(), self.layout.info.resets, f" at event {self.names[event]}"
        of_event = [k for k, (index, _) in enumerate(resets) if index == event]
        after[[resets[k][1] for k in of_event]] = module.kernels.rows("resets", of_event, t, after, forcing(t, after))
        return after

    def crowded(self, t: float, count: int) -> SimulationError:
        """The error for resets that never end."""
        names = ", ".join(event.name for event in self.model if event.action != GO_ON)
        how = f"happen again at once after a reset at t = {t:.6g} s, as where a gap stays closed"
        if count > 1:
            how = (
                f"follow each other faster and faster near t = {t:.6g} s, after {count} resets (Zeno), or a reset "
                "repeats without an end"
            )
        return ZenoError(
            f"the events {names} {how}; end the run there (terminal: a number of events), use a contact force for a "
            "body that comes to rest, or change the reset"
        )


def crowd_of(actions: Sequence[int]) -> int:
    """How many resets in a row, each right after the one before, count as endless: those of one instant take turns."""
    return max(CROWD, 2 * sum(action in (RESET, WAIT) for action in actions))


def _listed(raw: Any) -> list[tuple[str | None, Any]]:
    if raw is None:
        return []
    if isinstance(raw, Mapping):
        return [(str(name), one) for name, one in raw.items()]
    if isinstance(raw, Sequence) and not isinstance(raw, str):
        return [(None, one) for one in raw]
    return [(None, raw)]


_INSTANCE = re.compile(r"\b[A-Za-z_]\w*\.")  #: before a dot, also a word of Python


def _of_text(layout: Layout, raw: Any, name: str | None) -> tuple[RunEvent, Expression]:
    """An event by its text, or by a mapping with the keys of a model file."""
    options: dict[str, Any] = {"expression": raw} if isinstance(raw, str) else dict(raw)
    check_names("key of an event", options, ("expression", "terminal", "direction"))
    text = options.get("expression")
    if not isinstance(text, str):
        raise ill_typed(f"event {name or ''}: its expression must be a text, not {text!r}")
    direction = options.get("direction") or 0
    if direction not in (-1, 0, 1):
        raise no_choice(f"event {name or text!r}: direction must be 1, -1 or 0, not {direction!r}")
    event = RunEvent(None, name or text, options.get("terminal"), direction)
    formula = read_text(layout, text, f"event {name or text!r}")
    plain = _INSTANCE.sub("_", text.strip())
    if isinstance(getattr(parse_python(plain).body[0], "value", None), (ast.Compare, ast.BoolOp)):
        remedy = "give the difference of its sides: a - b for a > b"
        raise UsageError(f"event {name or text!r} is a comparison, which has no zero; {remedy}", code="EG-EVENT")
    return event, formula


def _of_model(event: Mapping[str, Any], chosen: bool) -> RunEvent:
    action = RESET if event.get("resets") else WAIT if event.get("restitution") is not None else GO_ON
    direction = int(event.get("direction") or 0) if chosen or action != GO_ON else UNWATCHED
    return RunEvent(None, str(event["name"]), int(event.get("terminal") or 0), direction, action)


def _times(name: str, raw: Any) -> int:
    """At which time an event ends the run: 0 for never."""
    plain = raw is None or isinstance(raw, (bool, np.bool_)) or (isinstance(raw, float) and raw.is_integer())
    result = int(raw or 0) if plain else as_count(raw)
    if result is None or result < 0:
        raise off_range(
            f"event {name}: terminal must be true, false, or the number of events that ends the run (1, 2, ...), "
            f"not {quote(raw)}"
        )
    return result


_SILENT: ContextVar[bool] = ContextVar("events_silent", default=False)


#: Within it warnings of runs are silent: of a run that is part of another call, which warns itself.
inner_run = partial(within, _SILENT)


def is_inner_run() -> bool:
    """Whether a run is part of another call, which warns itself."""
    return _SILENT.get()


def warn_of_unknown(names: Sequence[str]) -> None:
    """Tell the line of the user's that called of events that were no number throughout a run."""
    if names and not _SILENT.get():
        warnings.warn(
            f"event{'s' * (len(names) > 1)} {', '.join(names)}: the value was not a number (NaN) at every step, so "
            "nothing was found; look for a logarithm, root or quotient outside its domain",
            stacklevel=calls_within() + 1,
        )


# -- clocks of sampled states ------------------------------------------------------------------------------------------


FINEST = 1e-3  #: part of a period that times must tell apart


def at_next_samples(
    module: BoundModel, t: float, x: Array, span: tuple[float, float] | None = None, initial: Any = None
) -> Array:
    """The state x (n_x,) at time t with clocks whose next time is past set to their first one that is not.

    A sampling time at t itself happens.  A clock that is ahead by more than its period, as that of a state from the end
    of another run, is set back; one that has not begun stays so.
    """
    clocks = module.info.clocks
    if span is not None:
        require_forward(module, *span)
        require_agreement(module, t, x, initial)
    if not clocks:
        return x
    values = module.kernels.events
    result = np.array(x, dtype=float)
    for clock in clocks:
        event, place = int(clock["event"]), int(clock["counter"])
        states, first = ", ".join(clock["states"]), np.where(np.arange(len(result)) == place, 0.0, result)
        lag, period = _lateness(values, t, result, event, place)[0], _lateness(values, 0.0, first, event, place)[1]
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
        if not abs(result[place] - round(result[place])) < WHOLE:
            name = module.x_names[place]
            raise off_range(f"{name} counts samples, so it must be a whole number, not {result[place]:.9g}")
        if lag > 0.0 or (result[place] >= 1.0 and lag < -period - instant(t)):
            result[place] = max(result[place] + ceil((lag - instant(t)) / period), 0.0)
            earlier = result.copy()
            earlier[place] -= 1.0
            while result[place] >= 1.0 and _lateness(values, t, earlier, event, place)[0] <= instant(t):
                result[place], earlier[place] = earlier[place], earlier[place] - 1.0  # the period has been rounded
        while (lag := _lateness(values, t, result, event, place)[0]) > 0.0:  # rounding: its time is this one
            result[place] = max(np.nextafter(result[place], np.inf), result[place] + lag / period)
    return result


def _lateness(values: Any, t: float, x: Array, event: int, place: int) -> tuple[float, float]:
    """How long ago the next time of a clock was (s), and its period (s)."""
    lag, ahead = float(values(t, x)[event]), np.array(x)
    ahead[place] += 1.0
    return lag, lag - float(values(t, ahead)[event])


def require_forward(module: BoundModel, start: float, end: float) -> None:
    """Refuse a run backwards in time of a model with sampled states, or with constraints that close and open.

    What they were before a sample, and the velocities before an impact, are not known.
    """
    clocks = module.info.clocks
    if clocks and end < start:
        raise cannot(
            f"a run of sampled states ({', '.join(clocks[0]['states'])}) goes forward in time, not from {start:.6g} s "
            f"to {end:.6g} s"
        )
    switched = module.layout.switches
    if switched and end < start:
        raise cannot(
            f"a run of constraints that close and open ({', '.join(switched)}) goes forward in time, not from "
            f"{start:.6g} s to {end:.6g} s"
        )


def require_agreement(module: BoundModel, t: float, x: Array, initial: Any) -> None:
    """Refuse a start at which a constraint that the model declares closed does not hold.

    A state from another run, and constraints that are closed by name in `initial`, are taken as they are: an error that
    was there when a constraint closed dies away in the run.
    """
    layout = module.layout
    require_switched(layout, x[layout.n_x - layout.n_states :])
    rows = module.info.rows_to_hold
    if (
        not rows
        or not (initial is None or isinstance(initial, Mapping))
        or "held_errors" not in module.kernels.core.names
    ):
        return
    result = module.kernels.held_errors(t, x)
    fast = max(1.0, layout.scales.speed(x[layout.n_q :]))
    for k, (label, state, kind) in enumerate(rows):
        size, unit = (layout.length, "m") if kind == "length" else (1.0, "rad")
        for value, limit, what, per in (
            (result[2 * k], MEASURED * size, "is off by", ""),
            (result[2 * k + 1], MEASURED * size * fast, "changes by", "/s"),
        ):
            if not abs(value) <= limit and state not in (initial or ()):
                name = label.partition(".")[0]
                raise untrue(
                    f"constraint {name} is closed at the start, and its equation {label} {what} {value:.6g} "
                    f"{unit}{per} there (up to {limit:.2g} counts as held); give a start where it holds, or "
                    "closed: false"
                )


# -- functions for sampled states --------------------------------------------------------------------------------------


class Controller:
    """A function f(t, x) that gives the new value of one sampled state, at its place in x.

    x (n_x,) is the state right before, with what was renewed before this value.
    """

    def __init__(self, name: str, place: int, function: Callable[[float, Array], Any]) -> None:
        self.name, self.place, self.function = name, place, function

    def __call__(self, t: float, x: Array) -> float:
        """The new value; a SimulationError if it is no finite number."""
        try:
            raw = self.function(t, x.copy())
        except Exception as error:
            error.add_note(f"raised by the controller of {self.name}, called as f({t:.6g}, x)")
            raise
        result = as_real(raw)
        if result is None or result.ndim or not np.isfinite(result):
            raise SimulationError(
                f"the controller of {self.name} must return one finite number, but returned {quote(raw)} "
                f"at t = {t:.6g} s",
                code="EG-NUMBER",
            )
        return float(result)


def _by_event(layout: Layout, raw: Any) -> dict[int, list[Controller]]:
    """Controllers by event; refuses a name of no sampled state without a law, and what is no function f(t, x)."""
    require_mapping("controllers", raw)
    wanted: Mapping[str, Any] = without_dots(raw, layout.instances)
    clocks = layout.info.clocks
    taken = [name for clock in clocks for name in clock["open"]]
    if wanted and not taken:
        raise cannot(
            f"controllers give the values of sampled states without a law, and {layout.name!r} has none; declare one "
            "with m.sampled(name, period=...)"
        )
    check_names("sampled state without a law", wanted, taken)
    for name, function in wanted.items():
        if not callable(function):
            raise ill_typed(f"the controller of {name} must be a function f(t, x), not {quote(function)}")
        require_time_and_state(f"the controller of {name}", function)
    result: dict[int, list[Controller]] = {}
    for clock in clocks:
        controllers = [Controller(n, layout.x.index(n), wanted[n]) for n in clock["open"] if n in wanted]
        if controllers:
            result[int(clock["event"])] = controllers
    return result
