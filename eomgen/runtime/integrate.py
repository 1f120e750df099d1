"""Stage runtime: right-hand side, solver, corners of the inputs -> times, states and events, through SciPy.

Runs ``solve_ivp`` once between two corners of tabulated inputs, so that no corner is stepped over, and joins the parts.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..errors import UsageError
from ..numeric.scales import Array
from .names import require, require_time_and_state, unknown
from .pace import Pace, watch_steps

METHODS = ("RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA")


class Solution(NamedTuple):
    """What an integration came to."""

    t: Array  #: (n_t,)
    x: Array  #: (n_x, n_t)
    t_events: list[Array]
    x_events: list[Array]  #: (n_x, k) for each event
    dense: Callable[[Array], Array] | None
    status: int  #: SciPy's: 0 end reached, 1 terminal event, -1 failed
    message: str
    counts: dict[str, int]
    ends: tuple[float, float]  #: first and last time reached


class Event:
    """A user's event with the number of times it may still happen."""

    def __init__(self, function: Any) -> None:
        if not callable(function):
            raise UsageError(f"an event must be a function f(t, x), not {function!r}")
        require_time_and_state("an event", function)
        self.function = function
        self.terminal = getattr(function, "terminal", None) or 0
        self.direction = getattr(function, "direction", 0)

    def __call__(self, t: float, x: Array) -> float:
        """The user's function."""
        return float(self.function(t, x))


class Joined:
    """Dense output of several parts of a run."""

    def __init__(self, parts: Sequence[Callable[[Array], Array]], ends: Sequence[float]) -> None:
        self.parts = parts
        self.ends = np.array(ends)  # of all parts but the last
        self.forward = len(ends) < 2 or ends[-1] > ends[0]

    def __call__(self, t: Array) -> Array:
        """States (n_x, k) at times (k,)."""
        which = np.searchsorted(self.ends if self.forward else -self.ends, t if self.forward else -t)
        columns = [self.parts[k](t[which == k]) for k in np.unique(which)]
        result = np.empty((columns[0].shape[0], len(t)))
        for k, block in zip(np.unique(which), columns, strict=True):
            result[:, which == k] = block
        return result


def choose_solver(method: Any) -> Any:
    """SciPy's class for a name, or the OdeSolver subclass itself."""
    scipy = require("scipy.integrate", "scipy", "simulate")
    if isinstance(method, str):
        if method not in METHODS:
            raise unknown("method", method, METHODS)
        return getattr(scipy, method)
    if isinstance(method, type) and issubclass(method, scipy.OdeSolver):
        return method
    raise UsageError(f"method must be one of {', '.join(METHODS)}, or a subclass of OdeSolver, not {method!r}")


def check_options(solver: Any, options: Collection[str], own: Collection[str]) -> None:
    """Refuse options that one of SciPy's own methods would only warn about.

    Parameters
    ----------
    solver : OdeSolver subclass
        One that is not SciPy's may take anything.
    options : names
    own : names
        Options of ``simulate`` itself, to suggest.

    Raises
    ------
    UsageError
    """
    from inspect import signature

    if not solver.__module__.startswith("scipy."):
        return
    taken = [*signature(solver.__init__).parameters]
    allowed = [name for name in taken if name not in ("self", "fun", "t0", "y0", "t_bound", "extraneous")]
    for name in options:
        if name not in allowed:
            raise unknown(f"option of simulate with {solver.__name__}", name, [*own, *allowed])


def takes_jacobian(solver: Any) -> bool:
    """Whether a solver class has an argument ``jac``."""
    from inspect import signature

    return "jac" in signature(solver.__init__).parameters


def integrate(
    rhs: Callable[[float, Array], Array],
    nodes: Sequence[float],
    x0: Array,
    solver: Any,
    t_eval: Array | None,
    events: Sequence[Event],
    dense: bool,
    options: dict[str, Any],
    pace: Pace,
) -> Solution:
    """Integrate over the parts between `nodes` (start, corners, end).

    Raises
    ------
    Crawling
        The steps lead nowhere, as `pace` judges.
    """
    scipy = require("scipy.integrate", "scipy", "simulate")
    times: list[Array] = []
    states: list[Array] = []
    t_events: list[list[Array]] = [[] for _ in events]
    x_events: list[list[Array]] = [[] for _ in events]
    pieces: list[Any] = []
    counts = {"nfev": 0, "njev": 0, "nlu": 0}
    x = x0
    for k in range(len(nodes) - 1):
        span, last = (nodes[k], nodes[k + 1]), k == len(nodes) - 2
        asked = None if t_eval is None else _between(t_eval, span, last)
        first = (
            {} if "first_step" not in options else {"first_step": min(options["first_step"], abs(span[1] - span[0]))}
        )
        part = scipy.solve_ivp(
            rhs,
            span,
            x,
            method=watch_steps(solver, pace),
            t_eval=asked,
            events=list(events) or None,
            dense_output=dense,
            **options | first,
        )
        for key in counts:
            counts[key] += int(getattr(part, key, 0) or 0)
        t, y = np.asarray(part.t), np.asarray(part.y).reshape(len(x0), len(part.t))
        for e in range(len(events)):
            t_events[e].append(np.asarray(part.t_events[e]))
            x_events[e].append(np.asarray(part.y_events[e]).reshape(len(part.t_events[e]), len(x0)).T)
            if events[e].terminal:
                events[e].terminal = max(events[e].terminal - len(part.t_events[e]), 1)
        if dense and part.sol is not None:
            pieces.append(part.sol)
        done = last or part.status != 0
        if t_eval is None:
            skip = 1 if k else 0  # a part starts where the last one ended
            times.append(t[skip:])
            states.append(y[:, skip:])
        else:
            keep = len(t) if done else len(t) - 1  # the corner was asked for only to go on from
            times.append(t[:keep])
            states.append(y[:, :keep])
        if done:
            break
        x = y[:, -1]
    joined = pieces[0] if len(pieces) == 1 else Joined(pieces, nodes[1 : len(pieces)]) if pieces else None
    all_times = np.concatenate(times)
    ends = (nodes[0], nodes[0])
    if pieces:
        ends = (float(pieces[0].ts[0]), float(pieces[-1].ts[-1]))
    elif all_times.size:
        ends = (float(all_times[0]), float(all_times[-1]))
    return Solution(
        all_times,
        np.concatenate(states, axis=1),
        [np.concatenate(found) for found in t_events],
        [np.concatenate(found, axis=1) for found in x_events],
        joined,
        int(part.status),
        str(part.message),
        counts,
        ends,
    )


def _between(t_eval: Array, span: tuple[float, float], last: bool) -> Array:
    start, end = span
    forward = end >= start
    after = t_eval >= start if forward else t_eval <= start
    before = t_eval < end if forward else t_eval > end
    if last:
        return np.asarray(t_eval[after & (before | (t_eval == end))])
    return np.append(t_eval[after & before], end)
