"""Stage runtime: right-hand side, solver, corners of the inputs -> times, states and events, through SciPy.

Runs ``solve_ivp`` once between two corners of tabulated inputs, so that no corner is stepped over, and joins the parts.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import UsageError
from ..limits.runs import INSTANT
from ..numeric.scales import Array
from .events import GO_ON, Event
from .names import require, unknown
from .pace import Pace, watch_steps
from .resets import Resets

if TYPE_CHECKING:
    from .solver_state import Pause

KEPT = 10**7  #: numbers at most of the steps that are kept besides what t_eval asks for
UNDER_WAY = 2  #: a status beside SciPy's
WORDS = {
    0: "The solver successfully reached the end of the integration interval.",
    1: "A termination event occurred.",
}
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
    steps: tuple[Array, Array] | None = None  #: (k,), (n_x, k) of every step, where others are stored; k = 0: too many


class Interrupted(KeyboardInterrupt):
    """An interrupt inside an integration, with what there was.

    Parameters
    ----------
    solution : Solution
        The steps up to there.
    """

    def __init__(self, solution: Solution) -> None:
        super().__init__()
        self.solution = solution


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
            raise unknown("method", method, (*METHODS, "Taylor", "RK4"))
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
    reset: Callable[[float, Array, list[int]], Array] | None = None,
    enter: Callable[[float, float], None] | None = None,
    pause: Pause | None = None,
) -> Solution:
    """Integrate over the parts between `nodes` (start, corners, end), and from each event that resets the state.

    Raises
    ------
    Crawling
        The steps lead nowhere, as `pace` judges.
    ZenoError
        Resets follow each other ever faster, or lead nowhere.
    Interrupted
        Ctrl-C.
    """
    scipy = require("scipy.integrate", "scipy", "simulate")
    times: list[Array] = []
    states: list[Array] = []
    t_events: list[list[Array]] = [[] for _ in events]
    x_events: list[list[Array]] = [[] for _ in events]
    pieces: list[Any] = []
    walked: list[tuple[float, Array]] = []
    counts = {"nfev": 0, "njev": 0, "nlu": 0}
    x, k, start, jumped = x0, 0, nodes[0], True
    resets = Resets(events, rhs, nodes[0], nodes[-1])
    status, message, resumed = UNDER_WAY, "", False
    if pause is not None and pause.checkpoint.kept is not None:
        try:
            x, k, start, status = pause.go_on(
                (times, states, walked), (t_events, x_events), counts, events, resets, len(nodes) - 1
            )
        except (KeyError, TypeError, ValueError, IndexError) as error:
            raise pause.checkpoint.damaged(error) from None
        jumped, resumed = False, True
    while status == UNDER_WAY:
        span, last = (start, nodes[k + 1]), k == len(nodes) - 2
        if enter is not None:
            enter(nodes[k], nodes[k + 1])
        asked = None if t_eval is None else _between(t_eval, span, last)
        stored = resumed or (jumped and resets.count > 0)  # what is asked for here, before a reset or a checkpoint
        if asked is not None and stored and asked.size and asked[0] == start:
            asked = asked[1:]
        first = (
            {} if "first_step" not in options else {"first_step": min(options["first_step"], abs(span[1] - span[0]))}
        )
        counted = [event.terminal for event in events]
        for event in events:
            event.terminal = event.terminal if event.action == GO_ON else 1
        trail: list[tuple[float, Array]] = [(start, x)]
        counted_before = {key: pause.carried.get(key, 0) if pause is not None else 0 for key in counts}
        try:
            part = scipy.solve_ivp(
                rhs, span, x, method=watch_steps(solver, pace, trail, pause), t_eval=asked, events=list(events) or None,
                dense_output=dense, **options | first,
            )  # fmt: skip
        except KeyboardInterrupt as interrupt:
            raise Interrupted(_cut_short(times, states, trail, t_events, x_events, nodes[0], counts)) from interrupt
        for key in counts:
            counts[key] += int(getattr(part, key, 0) or 0) - counted_before[key]
        resumed = pause is not None and pause.cut and part.status == 0
        if pause is not None and not resumed:
            pause.carried = {}  # an event in the same step: the next part begins anew
        if part.status == 1:
            _complete(part, events, trail)
        t, y = np.asarray(part.t), np.asarray(part.y).reshape(len(x0), len(part.t))
        fired: list[int] = []
        over = False
        for e, event in enumerate(events):
            t_events[e].append(np.asarray(part.t_events[e]))
            x_events[e].append(np.asarray(part.y_events[e]).reshape(len(part.t_events[e]), len(x0)).T)
            event.terminal, happened = counted[e], len(part.t_events[e])
            if event.action != GO_ON and part.status == 1 and happened:
                fired.append(e)
            if event.terminal:
                over = over or happened >= event.terminal
                event.terminal = max(event.terminal - happened, 1)
        fired = [] if over else fired
        if dense and part.sol is not None:
            pieces.append(part.sol)
        ended = float(part.t_events[fired[0]][-1]) if fired else float(span[1])
        if t_eval is not None:
            walked += trail[0 if jumped else 1 :]
            if part.status == 1:  # an event, beyond which the last step went
                walked[-1] = _stopped(part, nodes[-1] >= nodes[0])
        done = (last and not fired and not resumed) or part.status == -1 or (part.status == 1 and not fired)
        if t_eval is None:
            skip = 0 if jumped else 1  # a part starts where the last one ended
            times.append(t[skip:])
            states.append(y[:, skip:])
        else:
            keep = len(t) if done or fired or last or resumed else len(t) - 1  # the corner was asked for to go on from
            times.append(t[:keep])
            states.append(y[:, :keep])
        message = str(part.message)
        if done:
            status = int(part.status)
            break
        jumped = bool(fired)
        if fired and reset is not None:
            before = x_events[fired[0]][-1][:, -1]
            x = reset(ended, before, fired)
            resets.note(ended, before, x, fired)
            start = ended
            if start == nodes[-1]:
                status = 0
                break
        elif resumed and pause is not None:
            x, start = pause.carried["y"], pause.carried["t"]
            pause.keep((times, states, walked), (t_events, x_events), counts, events, resets, (x, k, start, UNDER_WAY))
        else:
            x, k, start = y[:, -1], k + 1, nodes[k + 1]
    if pause is not None and status >= 0:
        pause.keep((times, states, walked), (t_events, x_events), counts, events, resets, (x, k, start, status))
    joined = (
        pieces[0] if len(pieces) == 1 else Joined(pieces, [float(p.ts[-1]) for p in pieces[:-1]]) if pieces else None
    )
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
        status,
        WORDS.get(status, message),
        counts,
        ends,
        _columns(walked, len(x0)) if t_eval is not None else None,
    )


def _complete(part: Any, events: Sequence[Event], trail: Sequence[tuple[float, Array]]) -> None:
    """Add the events of the same instant to that at which SciPy stopped: it tells of one alone.

    An event whose value has changed sign since the beginning of the step, and that was not found before, is at that
    instant, but for rounding; so is one that is to change it within the rounding of the time.
    """
    sign = 1.0 if trail[-1][0] >= trail[0][0] else -1.0
    found = [(sign * times[-1], k) for k, times in enumerate(part.t_events) if len(times)]
    latest, first = max(found)
    t, x = sign * latest, np.array(part.y_events[first][-1])
    began, state = next((point for point in reversed(trail) if sign * point[0] < latest), (t, x))
    step, instant = abs(t - began), INSTANT * max(abs(t), 1e-3)
    for e, event in enumerate(events):
        if len(part.t_events[e]) and sign * part.t_events[e][-1] > sign * began:
            continue
        a, b = event(began, state), event(t, x)
        crossed = a * b <= 0.0 or abs(b) * step <= instant * abs(a - b)
        if crossed and ((a < 0.0 and event.direction >= 0) or (a > 0.0 and event.direction <= 0)):
            part.t_events[e] = np.append(part.t_events[e], t)
            part.y_events[e] = np.vstack([np.asarray(part.y_events[e]).reshape(-1, len(x)), x])


def _columns(walked: Sequence[tuple[float, Array]], n: int) -> tuple[Array, Array]:
    """Times (k,) and states (n, k) of steps; none where they are more than KEPT."""
    kept = walked if len(walked) * (1 + n) <= KEPT else []
    return np.array([t for t, _ in kept]), np.array([x for _, x in kept]).reshape(len(kept), n).T


def _stopped(part: Any, forward: bool) -> tuple[float, Array]:
    """Time and state of the event that ended a part, which is the last of all."""
    found = [(float(t[-1]), x[-1]) for t, x in zip(part.t_events, part.y_events, strict=True) if len(t)]
    return max(found, key=lambda pair: pair[0] if forward else -pair[0])


def _cut_short(
    times: Sequence[Array],
    states: Sequence[Array],
    trail: Sequence[tuple[float, Array]],
    t_events: Sequence[Sequence[Array]],
    x_events: Sequence[Sequence[Array]],
    start: float,
    counts: dict[str, int],
) -> Solution:
    """What was stored of the parts before, and the steps of the one that was interrupted."""
    n = len(trail[0][1])
    skip = 1 if times and times[-1].size and times[-1][-1] == trail[0][0] and len(trail) > 1 else 0
    t, x = np.array([t for t, _ in trail[skip:]]), np.array([x for _, x in trail[skip:]]).T.reshape(n, -1)
    return Solution(
        np.concatenate([*times, t]),
        np.concatenate([*states, x], axis=1),
        [np.concatenate([np.empty(0), *found]) for found in t_events],
        [np.concatenate([np.empty((n, 0)), *found], axis=1) for found in x_events],
        None,
        -1,
        "The run was interrupted.",
        counts,
        (start, trail[-1][0]),
    )


def _between(t_eval: Array, span: tuple[float, float], last: bool) -> Array:
    start, end = span
    forward = end >= start
    after = t_eval >= start if forward else t_eval <= start
    before = t_eval < end if forward else t_eval > end
    if last:
        return np.asarray(t_eval[after & (before | (t_eval == end))])
    return np.append(t_eval[after & before], end)
