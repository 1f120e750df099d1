"""Simulation: events of the model and of one run -> what integrators watch for, and what happens then.

An event is a zero of an expression or function of time and state.  Those of the model are compiled with it; those given
for a run are its names, expressions as text, or functions f(t, x) with SciPy's attributes.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from math import isfinite, nan
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base.algebra import Array
from ..base.limits.numbers import TINY
from ..base.limits.runs import CROWD, EARLIEST, INSTANT
from ..base.texts import shown
from ..base.value_rules import as_count
from ..errors import ZenoError, calls_within, cannot, ill_typed, no_choice, no_number, off_range
from ..runtime.input_texts import is_formula, read_formula
from ..runtime.layout import Layout
from ..runtime.near_names import check_names, require_time_and_state
from ..runtime.room import as_real

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.formulas import Formula
    from ..runtime.signals import Forcing

GO_ON, RESET, WAIT = 0, 1, 2  #: as in eomgen_loop.h
STOP = 3  #: an integrator stops there and goes on, from another state or the same
UNWATCHED = 2  #: a direction


def instant(t: float) -> float:
    """Times this near to t (s) are one time."""
    return INSTANT * max(abs(t), EARLIEST)


class RunEvent:
    """An event with the number of times it may still happen.

    Parameters
    ----------
    function : callable f(t, x)
        With SciPy's attributes, unless these are given.
    name : str
    terminal : int
        The run ends when it has happened so often; 0: never.
    direction : {1, -1, 0}
        Rising, falling, both; or UNWATCHED.
    action : {GO_ON, RESET, WAIT, STOP}
        Whether the model's kernel gives a new state, or an impact does; STOP in Python's own loops.
    """

    def __init__(
        self,
        function: Any,
        name: str = "",
        terminal: float | None = None,
        direction: float | None = None,
        action: int = GO_ON,
    ) -> None:
        if not callable(function):
            raise ill_typed(f"an event must be a name, an expression or a function f(t, x), not {function!r}")
        require_time_and_state("an event", function)
        self.function, self.action = function, action
        self.name = name or str(getattr(function, "__name__", type(function).__name__))
        self.terminal = _times(self.name, getattr(function, "terminal", None) if terminal is None else terminal)
        given = getattr(function, "direction", 0) if direction is None else direction
        self.direction = int(np.sign(given)) if given != UNWATCHED or direction is None else UNWATCHED
        self.left: tuple[float, float] | None = None  #: time of the last reset, and the side of zero it led to
        self.known = False  #: whether it has had a value other than NaN
        self.source: tuple[Together, int] | None = None  #: what gives the values of several events, and its place there
        self.users = False  #: whether the function is the user's, who must give a number wherever the run comes

    def __call__(self, t: float, x: Array, for_slope: bool = False) -> float:
        """The value at time t and state x; right after a reset, one on the side to which it led.

        Raises
        ------
        UsageError
            The user's function gives no number, or one that is not finite, unless it is ``for_slope``: off the path.
        """
        value = self.function(t, x.copy())  # a function may change what it is given
        found: Any = as_real(value) if self.users else value
        if self.users and (found is None or found.ndim or not (for_slope or isfinite(found))):
            text = shown(value if found is None or found.ndim else float(found))
            raise no_number(
                f"event {self.name} is {text} at t = {t:.6g} s; its function must return a finite number at every "
                "time and state of the run; an expression as a text may be undefined in parts of it"
            )
        return self.seen_value(t, float(found))

    def seen_value(self, t: float, value: float) -> float:
        """The same where the function's value is known."""
        if not isfinite(value):
            return nan
        self.known = True
        if self.left is not None and abs(t - self.left[0]) <= instant(t):
            return self.left[1] * max(abs(value), TINY)
        return value


class Together(NamedTuple):
    """Values of several events, which cost little more than that of one."""

    values: Callable[[float, Array], Sequence[float] | Array]  #: (t, x) -> all of them
    columns: Callable[[Array, Array], Array] | None = None  #: k times and states (n_x, k) -> (n, k), if that is cheaper


class Events:
    """All events of one run.

    Parameters
    ----------
    layout : Layout
    given : None, or one event or several: names, texts, functions; a mapping names them
        None watches all of the model.  Those of the model that reset the state are watched always.
    """

    def __init__(self, layout: Layout, given: Any) -> None:
        self.layout = layout
        self.declared: list[dict[str, Any]] = layout.metadata.get("events") or []
        self.names, self.last = list[str](), ""  #: last: the event whose new state is asked for, as messages name it
        self.model: list[RunEvent] = []
        self.formulas: list[tuple[RunEvent, Formula]] = []
        self.functions: list[RunEvent] = []
        if given is None and not self.declared:
            return
        known = [str(event["name"]) for event in self.declared]
        chosen = set(known) if given is None else set()
        for name, one in _listed(given):
            if isinstance(one, str) and one in known and name is None:
                chosen.add(one)
            elif is_formula(one) or isinstance(one, Mapping):
                self.formulas.append(_of_text(layout, one, name, self.formulas[0][1] if self.formulas else None))
            else:
                self.functions.append(RunEvent(one, name or ""))
                self.functions[-1].users = True
        self.model = [_of_model(event, event["name"] in chosen) for event in self.declared]
        taken: dict[str, int] = {}
        for name in (*known, *(event.name for event, _ in self.formulas), *(event.name for event in self.functions)):
            taken[name] = taken.get(name, 0) + 1
            self.names.append(name if taken[name] == 1 else f"{name}_{taken[name]}")
        if all(event.direction == UNWATCHED for event in self.model):
            self.names, self.model = self.names[len(known) :], []
        if any(event.action == WAIT for event in self.model):
            from .impact import strike_events

            self._strike = strike_events

    def __len__(self) -> int:
        return len(self.names)

    @property
    def resets(self) -> bool:
        """Whether an event changes the state."""
        return any(event.action != GO_ON for event in self.model)

    def encode(self) -> dict[str, Any] | None:
        """As the compiled loop takes them; None if there are none."""
        if not self.names:
            return None
        every = [*self.model, *(event for event, _ in self.formulas), *self.functions]
        texts = [formula for _, formula in self.formulas]
        return {
            "model": len(self.model),
            "tape": texts[0].tape_with(texts[1:]) if texts else None,
            "outside": self.functions,
            "direction": [event.direction for event in every],
            "most": [int(event.terminal) for event in every],
            "action": [event.action for event in every],
            "crowd": crowd_of([event.action for event in every]),
            "resets": self.layout.metadata.get("resets", []) if self.model else [],
        }

    def listed(self, module: BoundModel, forcing: Forcing) -> list[RunEvent]:
        """The same as functions f(t, x), for SciPy's methods."""
        kernel = module.kernels.timed("events", nan=True) if self.model else None
        found: list[RunEvent] = []
        every = _of_kernel(kernel, forcing)
        for i, event in enumerate(self.model):
            function = _unwatched if event.direction == UNWATCHED else _value_of(kernel, forcing, i)
            found.append(RunEvent(function, self.names[i], event.terminal, event.direction, event.action))
            found[-1].source = None if event.direction == UNWATCHED else (every, i)
        p = module.p
        texts = None
        if len(self.formulas) > 1:
            first, *others = (formula for _, formula in self.formulas)
            texts = Together(first.function_with(others, p))
        for i, (event, formula) in enumerate(self.formulas):
            found.append(RunEvent(formula.function(p), event.name, event.terminal, event.direction))
            found[-1].source = None if texts is None else (texts, i)
        return [*found, *self.functions]

    def reset(self, module: BoundModel, forcing: Forcing, t: float, x: Array, fired: Sequence[int]) -> Array:
        """The state after the events that happened at time t."""
        after = np.array(x, dtype=float)
        for i in fired:
            if self.model[i].action == RESET:
                after = self.renewed(module, forcing, t, after, i)
                after = np.asarray(module.project(after, t=t, u=forcing(t, after)))
        gaps = [i for i in fired if self.model[i].action == WAIT]
        if gaps:
            self.last = f" at event {', '.join(self.names[i] for i in gaps)}"
            after = self._strike(module, t, after, self.declared, gaps, forcing)
        self.last = ""
        return after

    def renewed(self, module: BoundModel, forcing: Forcing, t: float, x: Array, event: int) -> Array:
        """The state x with the new values that the model gives at an event."""
        after, resets, self.last = x.copy(), self.layout.metadata["resets"], f" at event {self.names[event]}"
        own = [k for k, (index, _) in enumerate(resets) if index == event]
        after[[resets[k][1] for k in own]] = module.kernels.rows("resets", own, t, after, forcing(t, after))
        return after

    def crowded(self, t: float, count: int) -> ZenoError:
        """The error for resets that never end."""
        return self.crowded_near(t, count, [event.name for event in self.model if event.action != GO_ON])

    @staticmethod
    def crowded_near(t: float, count: int, names: Sequence[str]) -> ZenoError:
        """The same, of named events."""
        return ZenoError(
            f"the events {', '.join(names)} follow each other faster and faster near t = {t:.6g} s, after {count} "
            "resets (Zeno), or a reset repeats without an end; end the run there (terminal: a number of events), use a "
            "contact force for a body that comes to rest, or change the reset"
        )


def crowd_of(actions: Sequence[int]) -> int:
    """How many resets in a row, each right after the one before, count as endless: those of one instant take turns."""
    return max(CROWD, 2 * sum(action in (RESET, WAIT) for action in actions))


def _listed(given: Any) -> list[tuple[str | None, Any]]:
    if given is None:
        return []
    if isinstance(given, Mapping):
        return [(str(name), one) for name, one in given.items()]
    if isinstance(given, Sequence) and not isinstance(given, str):
        return [(None, one) for one in given]
    return [(None, given)]


def _of_text(layout: Layout, given: Any, name: str | None, beside: Formula | None) -> tuple[RunEvent, Formula]:
    """An event by its text, or by a mapping with the keys of a model file."""
    options: dict[str, Any] = {"expression": given} if isinstance(given, str) else dict(given)
    check_names("key of an event", options, ("expression", "terminal", "direction"))
    text = options.get("expression")
    if not isinstance(text, str):
        raise ill_typed(f"event {name or ''}: its expression must be a text, not {text!r}")
    direction = options.get("direction") or 0
    if direction not in (-1, 0, 1):
        raise no_choice(f"event {name or text!r}: direction must be 1, -1 or 0, not {direction!r}")
    event = RunEvent(_only_in_c, name or text, options.get("terminal"), direction)
    return event, read_formula(layout, text, f"event {name or text!r}", beside)


def _of_model(event: Mapping[str, Any], chosen: bool) -> RunEvent:
    action = RESET if event.get("resets") else WAIT if event.get("restitution") is not None else GO_ON
    direction = int(event.get("direction") or 0) if chosen or action != GO_ON else UNWATCHED
    return RunEvent(_only_in_c, str(event["name"]), int(event.get("terminal") or 0), direction, action)


def _only_in_c(t: float, x: Array) -> float:
    """In place of an event's value until :meth:`Events.listed` binds it; compiled loops evaluate it themselves."""
    raise cannot("an event given by name or text has values only in a run; give a function f(t, x) instead")


def _unwatched(t: float, x: Array) -> float:
    """In place of the value of an event that is not watched: SciPy's methods find no zero in it."""
    return nan


def _times(name: str, given: Any) -> int:
    """At which time an event ends the run: 0 for never."""
    plain = given is None or isinstance(given, (bool, np.bool_)) or (isinstance(given, float) and given.is_integer())
    found = int(given or 0) if plain else as_count(given)
    if found is None or found < 0:
        raise off_range(
            f"event {name}: terminal must be true, false, or the number of events that ends the run (1, 2, ...), "
            f"not {shown(given)}"
        )
    return found


_SILENT: ContextVar[bool] = ContextVar("events_silent", default=False)


@contextmanager
def told_by_the_caller() -> Iterator[None]:
    """Within it :func:`warn_of_unknown` is silent: a run that is part of another call, which warns itself."""
    token = _SILENT.set(True)
    try:
        yield
    finally:
        _SILENT.reset(token)


def is_told_by_the_caller() -> bool:
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


def _of_kernel(kernel: Any, forcing: Forcing) -> Together:
    """The kernel of the model's events, which gives all of them, at one time or at several."""
    if not forcing:
        return Together(kernel, kernel)

    def columns(t: Array, x: Array) -> Array:
        u = np.stack([forcing(at, state) for at, state in zip(t.tolist(), x.T, strict=True)], axis=1)
        return np.asarray(kernel(t, x, u=u))

    return Together(lambda t, x: kernel(t, x, u=forcing(t, x)), columns)


def _value_of(kernel: Any, forcing: Forcing, i: int) -> Callable[[float, Array], float]:
    if forcing:
        return lambda t, x: float(kernel(t, x, u=forcing(t, x))[i])
    return lambda t, x: float(kernel(t, x)[i])
