"""Right-hand side, solver, corners of the inputs -> times, states and events, through SciPy."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from math import isnan, nan
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base.algebra import Array
from ..base.limits.runs import (
    ASIDE,
    CROWDED,
    HALVED,
    INSTANT,
    LATE,
    MOMENTARY,
    RESTING,
    SAMPLED,
    TOUCHED,
    TOUCHING,
    TURNING,
)
from ..errors import SimulationError, ZenoError, no_choice
from ..numeric.roots import Found, Search, search_least, search_root
from ..runtime.argument_checks import require, unknown
from .events import GO_ON, RESET, UNWATCHED, WAIT, Events, EventValues, RunEvent, crowd_of, instant

if TYPE_CHECKING:
    from .bound_run import StallCheck

# -- where events come to zero -----------------------------------------------------------------------------------------

# The same as the compiled loop does in C (steppers/crossings.c, event_values.c, event_zero.c), function by function, so
# that a run finds the same events by every method: changes of sign between the ends of a step, values that come to zero
# and leave again within it, and zeros after a reset, once the value has been seen on its side.


class Step(NamedTuple):
    """A step of an integrator."""

    t_old: float
    t: float
    x: Array  #: at t
    between: Callable[[float | Array], Array]  #: the state (n_x,) at a time between, or (n_x, k) at k of them
    length: float  #: of the step to try next, or of this one


class Bracket(NamedTuple):
    """Two times, and values of opposite sign there."""

    event: int
    a: float
    b: float
    fa: float
    fb: float


class Crossings:
    """The events of one run on its way.

    Parameters
    ----------
    events : sequence of RunEvent
    rhs : callable
        (t, x) -> x'.
    start, end : float
        Of the run (s).

    Attributes
    ----------
    t, x : list of lists
        Times and states of each event so far.
    """

    def __init__(
        self, events: Sequence[RunEvent], rhs: Callable[[float, Array], Array], start: float, end: float
    ) -> None:
        self.events, self.rhs, self.span, self.forward = events, rhs, abs(end - start), -1.0 if end < start else 1.0
        n = len(events)
        self.t: list[list[float]] = [[] for _ in events]
        self.x: list[list[Array]] = [[] for _ in events]
        self.fired: list[int] = []  #: those at which the run stopped last
        self.ways: list[float] = []  #: how their values went there
        self.g, self.slope, self.slope_new = np.empty(n), np.empty(n), np.zeros(n)
        self.size, self.leaving, self.touch = np.empty(n), [0] * n, [0] * n
        self.resets, self.crowded, self.last = 0, 0, np.inf
        self.crowd = crowd_of([event.action for event in events])
        self.values = EventValues(events)

    # -- values ---------------------------------------------------------------------------------------------------
    def _slopes(self, t: float, x: Array, f: Array, g: Array, length: float, way: float = 1.0) -> Array:
        """Rates of the values along the motion, by a short way along x', onward (1) or back (-1)."""
        least = max(abs(t), 1.0) * MOMENTARY  # a step that ends with a part of the run may be as short as rounding
        h = way * ASIDE * (length if abs(length) >= least else self.forward * least)
        return (self.values(t + h, x + h * f, for_slope=True) - g) / h

    def arm(self, t: float, x: Array, length: float = 0.0) -> None:
        """Begin at a state; `length` is that of the step to come, with its sign, if it is known."""
        self.g = self.values(t, x)
        self.size = np.abs(self.g)
        self.slope = self._slopes(t, x, np.asarray(self.rhs(t, x)), self.g, length)

    # -- one step -------------------------------------------------------------------------------------------------
    def find(self, step: Step) -> tuple[float, bool] | None:
        """Note the zeros of a step, up to one at which the run stops: its time, and whether the run ends there."""
        new, f = self.values(step.t, step.x), np.asarray(self.rhs(step.t, step.x))
        self.slope_new = self._slopes(step.t, step.x, f, new, step.length)
        brackets = self._brackets(step, new)
        zeros = self._searched(step, [(z.event, self._zero(z)) for z in brackets])
        pairs = zip(zeros, brackets, strict=True)
        found = [(zero, z.event, z.fb - z.fa) for zero, z in pairs if not isnan(zero)]
        found.sort(key=lambda triple: self.forward * triple[0])
        self.fired, self.ways = [], []
        stop: tuple[float, bool] | None = None
        for zero, i, way in found:
            if stop and (stop[1] or abs(zero - stop[0]) > INSTANT * max(abs(stop[0]), self.span)):
                break
            event = self.events[i]
            self.t[i].append(zero)
            self.x[i].append(self._state(step, zero))
            late = abs(step.t - zero) <= LATE * abs(step.t - step.t_old)
            if self.touch[i] and (event.action != GO_ON or late):
                self.leaving[i] = self.touch[i]  # so that it is not found again beside this zero
            if event.terminal and len(self.t[i]) >= event.terminal:
                stop = (zero, True)
            elif event.action != GO_ON:
                stop = stop or (zero, False)
                self.fired.append(i)
                self.ways.append(way)
        order = sorted(range(len(self.fired)), key=self.fired.__getitem__)  # of one instant: as they are declared
        self.fired, self.ways = [self.fired[k] for k in order], [self.ways[k] for k in order]
        self.g, self.slope, self.slope_new = new, self.slope_new, self.slope
        self.slope = self._slopes(step.t, step.x, f, new, step.length, -1.0)
        return stop

    @staticmethod
    def _state(step: Step, t: float) -> Array:
        return np.asarray(step.between(t))

    def _searched(self, step: Step, searches: Sequence[tuple[int, Search[Found]]]) -> list[Found]:
        """Results of searches in the values of events, all of which go on side by side."""
        results: dict[int, Found] = {}
        sent: dict[int, float | None] = dict.fromkeys(range(len(searches)))
        while sent:
            asked: dict[int, float] = {}
            for k, value in sent.items():
                try:
                    asked[k] = searches[k][1].send(value)  # type: ignore[arg-type]  # None begins
                except StopIteration as end:
                    results[k] = end.value
            values = self._scattered(step, [(searches[k][0], t) for k, t in asked.items()])
            sent = dict(zip(asked, values, strict=True))
        return [results[k] for k in range(len(searches))]

    def _scattered(self, step: Step, asked: Sequence[tuple[int, float]]) -> list[float]:
        """Values of events, each at its time."""
        if len(asked) < 2:
            return [self.events[i](t, self._state(step, t)) for i, t in asked]
        times = np.array([t for _, t in asked])
        states = np.ascontiguousarray(np.asarray(step.between(times)).T)
        return self.values.each([i for i, _ in asked], times, states)

    def _brackets(self, step: Step, new: Array) -> list[Bracket]:
        found: list[Bracket] = []
        searched: list[tuple[int, Search[list[Bracket]]]] = []
        for i, event in enumerate(self.events):
            a, b = float(self.g[i]), float(new[i])
            self.touch[i] = 0
            noted = a == 0.0 and bool(self.t[i]) and self.t[i][-1] == step.t_old
            if event.direction != UNWATCHED and not (noted and not self.leaving[i]):
                if self.leaving[i]:
                    searched.append((i, self._after_reset(step, i, b)))
                elif a == 0.0 and self.forward * float(self.slope[i]) * b < 0.0:
                    searched.append((i, self._from_zero(step, i, b)))
                elif (a <= 0.0 <= b) or (a >= 0.0 >= b):
                    found.append(Bracket(i, step.t_old, step.t, a, b))
                elif isnan(a) != isnan(b):
                    searched.append((i, self._within_domain(step, i, a, b)))
                elif self._may_touch(step, i, a, b):
                    searched.append((i, self._touching(step, i, a, b)))
                self.size[i] = np.fmax(self.size[i], abs(b))
        found += [z for several in self._searched(step, searched) for z in several]
        found.sort(key=lambda z: z.event)
        return [z for z in found if not self.events[z.event].direction * (z.fb - z.fa) < 0.0]

    def _after_reset(self, step: Step, i: int, last: float) -> Search[list[Bracket]]:
        """A reset left the value at zero: it has to be seen on its side before it can come back."""
        t, g, seen, side = step.t_old, 0.0, False, self.leaving[i]
        for k in range(HALVED, -1, -1):
            later = step.t if k == 0 else step.t_old + (step.t - step.t_old) * 2.0**-k
            value = last if k == 0 else (yield later)
            if seen and value * side <= 0.0:
                self.leaving[i] = 0
                return [Bracket(i, t, later, g, value)]
            seen = seen or value * side > 0.0
            t, g = later, value
        back = not seen and last * side < 0.0 and abs(step.t - step.t_old) > instant(step.t)  # resets that die away
        self.leaving[i] = 0 if seen or back else side
        event = self.events[i]
        if back and event.direction * side <= 0 and event.action in (RESET, WAIT):
            raise self._endless(step.t)
        return [Bracket(i, step.t_old, step.t_old, float(side), 0.0)] if back else []

    def _from_zero(self, step: Step, i: int, last: float) -> Search[list[Bracket]]:
        """A value that is zero where a step begins, leaves to one side and ends on the other: two zeros."""
        side = 1.0 if self.forward * float(self.slope[i]) > 0.0 else -1.0
        t, g, seen = step.t_old, 0.0, False
        for k in range(HALVED, -1, -1):
            later = step.t if k == 0 else step.t_old + (step.t - step.t_old) * 2.0**-k
            value = last if k == 0 else (yield later)
            if seen and value * side <= 0.0:
                return [Bracket(i, step.t_old, step.t_old, -side, 0.0), Bracket(i, t, later, g, value)]
            seen = seen or value * side > 0.0
            t, g = later, value
        return [Bracket(i, step.t_old, step.t, 0.0, last)]

    def _within_domain(self, step: Step, i: int, a: float, b: float) -> Search[list[Bracket]]:
        """A value that is no number at one end of the step: changes of sign in the part where it is one."""
        t, g, found = step.t_old, a, list[Bracket]()
        for k in range(1, SAMPLED + 1):
            later = step.t_old + k * (step.t - step.t_old) / SAMPLED if k < SAMPLED else step.t
            value = (yield later) if k < SAMPLED else b
            entered = k == 1 or isnan(g)  # a zero at its beginning belongs to no interval before
            last, end = later, value
            if isnan(value) and not isnan(g):
                last, end = yield from self._domain_edge(t, g, later)
            elif isnan(g) and not isnan(value):
                t, g = yield from self._domain_edge(later, value, t)
            if g < 0.0 <= end or g > 0.0 >= end or (entered and g == 0.0 and not isnan(end)):
                found.append(Bracket(i, t, last, g, end))
            t, g = later, value
        way = self.events[i].direction
        return [z for z in found if not way * (z.fb - z.fa) < 0.0][:2]

    @staticmethod
    def _domain_edge(inside: float, g: float, outside: float) -> Search[tuple[float, float]]:
        """The edge of a value's domain, between a time where it is a number and one where it is none.

        The last time found where it is one, and its value there; no further than to where its sign is another.
        """
        first = g
        for _ in range(HALVED):
            if g == 0.0 or (g > 0.0) != (first > 0.0):
                break
            t = 0.5 * (inside + outside)
            value = yield t
            if isnan(value):
                outside = t
            else:
                inside, g = t, value
        return inside, g

    def _may_touch(self, step: Step, i: int, a: float, b: float) -> bool:
        """Whether a value of one sign at both ends may have been at zero between: it comes near and leaves again."""
        h, s = abs(step.t - step.t_old), 1.0 if a > 0.0 else -1.0
        da, db = (self.forward * s * float(slope[i]) * h for slope in (self.slope, self.slope_new))
        if not (a * b > 0.0 and da < 0.0 < db) or max(abs(a), abs(b)) <= RESTING * TOUCHED * self.size[i]:
            return False
        if db * s * a - da * s * b <= -da * db:  # the tangents meet below zero: also a flat touch, (t - 1)**8
            return True
        x = da / (da - db)  # about where the cubic through both is least
        y = 1.0 - x
        least = s * a * y * y * (1 + 2 * x) + da * x * y * y + s * b * x * x * (1 + 2 * y) - db * x * x * y
        return least < 0.5 * min(abs(a), abs(b))

    def _touching(self, step: Step, i: int, a: float, b: float) -> Search[list[Bracket]]:
        s, h = 1.0 if a > 0.0 else -1.0, (step.t - step.t_old) / SAMPLED
        best, at = np.inf, step.t_old
        for k in range(1, SAMPLED):
            t = step.t_old + k * (step.t - step.t_old) / SAMPLED
            if (value := s * (yield t)) < best:
                best, at = value, t
        width = TURNING * abs(step.t - step.t_old)
        best, at = yield from search_least(at - h, at, at + h, best, width, sense=s)
        rounding = TOUCHED * max(self.size[i], abs(b))
        if best < -rounding:
            return [Bracket(i, step.t_old, at, a, s * best), Bracket(i, at, step.t, s * best, b)]
        if best <= rounding:  # it comes to zero here, from one side and back
            self.touch[i] = int(s)
            return [Bracket(i, at, at, a, 0.0)]
        return []

    def _zero(self, bracket: Bracket) -> Search[float]:
        """The zero in a bracket.

        Where the value jumps, the far side of the jump: a run that goes on from the near one would meet it again.
        """
        i, a, b, fa, fb = bracket
        b, fb, c, fc = yield from search_root(a, b, fa, fb)
        if isnan(fb):
            return (yield from self._zero_beside(bracket, b))
        return c if fb * fa > 0.0 > fb * fc and abs(fb) > TOUCHING * float(self.size[i]) else b

    def _zero_beside(self, bracket: Bracket, gap: float) -> Search[float]:
        """The zero in a bracket within which, at a time, the value is no number: on either side; NaN if on none."""
        i, a, b, fa, fb = bracket
        t, g = yield from self._domain_edge(a, fa, gap)
        if g == 0.0 or (g > 0.0) != (fa > 0.0):
            return (yield from self._zero(Bracket(i, a, t, fa, g)))
        t, g = yield from self._domain_edge(b, fb, gap)
        if g == 0.0 or (g > 0.0) != (fb > 0.0):
            return (yield from self._zero(Bracket(i, t, b, g, fb)))
        return nan

    # -- resets ---------------------------------------------------------------------------------------------------
    def arrive(self, t: float, x: Array, length: float) -> None:
        """Take note of values and how fast they change, right before a reset and after it."""
        self.g = self.values(t, x)
        self.slope = self._slopes(t, x, np.asarray(self.rhs(t, x)), self.g, length)

    def depart(self, t: float, x: Array, length: float = 0.0) -> None:
        """Go on from another state, after the events that fired.

        Raises
        ------
        ZenoError
            Resets follow each other ever faster, or one leads nowhere.
        """
        arrived, came = self.slope, np.fmax(np.abs(self.slope), np.abs(self.slope_new))
        at_zero = np.abs(self.g) <= TOUCHING * self.size  # not beyond a jump of an input
        self.arrive(t, x, length)
        for i in np.flatnonzero(~at_zero & (np.abs(self.g) <= TOUCHING * self.size)).tolist():
            if i not in self.fired and self.events[i].action == RESET and abs(self.events[i].direction) == 1:
                self.leaving[i] = self.events[i].direction  # what a reset brings to zero has not fallen to it
        stuck = False
        for i, way in zip(self.fired, self.ways, strict=True):
            rate, action = self.forward * float(self.slope[i]), self.events[i].action
            touching = abs(self.g[i]) <= TOUCHING * self.size[i]
            if self.leaving[i]:  # it only touched zero
                continue
            nowhere = (action == WAIT and rate < 0.0) or not abs(rate) > TOUCHING * came[i]
            back = at_zero[i] and way * self.forward * float(arrived[i]) < 0.0  # less than the accuracy is left
            stuck = stuck or bool(back or (touching and nowhere))
            self.leaving[i] = (1 if rate > 0.0 else -1) if touching else 0
        changed = [self.events[i] for i in self.fired if self.events[i].action in (RESET, WAIT)]
        if changed:
            self.resets += 1
            self.crowded = self.crowded + 1 if abs(t - self.last) < CROWDED * self.span else 0
            self.last = t
        self.fired = []
        if changed and (stuck or self.crowded >= self.crowd):
            raise self._endless(t)

    def _endless(self, t: float) -> ZenoError:
        names = [event.name for event in self.events if event.action in (RESET, WAIT)]
        return Events.crowded_near(t, self.resets, names)

    # -- results --------------------------------------------------------------------------------------------------
    def results(self, n: int) -> tuple[list[Array], list[Array]]:
        """Times (k,) and states (n, k) of each event."""
        return [np.array(times) for times in self.t], [np.array(found).reshape(len(found), n).T for found in self.x]


# -- the run -----------------------------------------------------------------------------------------------------------

# Steps one of SciPy's solvers from corner to corner of tabulated inputs, so that none is stepped over, and from reset
# to reset; what happens after a step is what the compiled loop does (steppers/loop.c).


KEPT = 10**7  #: numbers at most of the steps that are kept besides what t_eval asks for
METHODS = ("RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA")
NAMES = (*METHODS, "Taylor", "RK4", "moreau", "kinematic")  #: all that simulate knows


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
    finite: bool = False  #: whether the states are known to be finite


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
    """Dense output of a run: that of each step, up to where the next one goes on."""

    def __init__(self, pieces: Sequence[tuple[float, Callable[[Array], Array]]], forward: bool) -> None:
        self.ends = np.array([end for end, _ in pieces])
        self.parts = [part for _, part in pieces]
        self.sign = 1.0 if forward else -1.0

    def __call__(self, t: Array) -> Array:
        """States (n_x, k) at times (k,)."""
        at = np.asarray(t, dtype=float)
        which = np.minimum(np.searchsorted(self.sign * self.ends, self.sign * at), len(self.parts) - 1)
        order = np.argsort(which, kind="stable")
        result: Array | None = None
        for places in np.split(order, np.flatnonzero(np.diff(which[order])) + 1):
            block = np.asarray(self.parts[int(which[places[0]])](at[places]))
            result = np.empty((block.shape[0], len(at))) if result is None else result
            result[:, places] = block
        return np.empty((0, 0)) if result is None else result


def choose_solver(method: Any) -> Any:
    """SciPy's class for a name, or the OdeSolver subclass itself."""
    scipy = require("scipy.integrate", "scipy", "simulate")
    if isinstance(method, str):
        if method not in METHODS:
            raise unknown("method", method, NAMES)
        return getattr(scipy, method)
    if isinstance(method, type) and issubclass(method, scipy.OdeSolver):
        return method
    raise no_choice(f"method must be one of {', '.join(METHODS)}, or a subclass of OdeSolver, not {method!r}")


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
    events: Sequence[RunEvent],
    dense: bool,
    options: dict[str, Any],
    stall_check: StallCheck | None,
    reset: Callable[[float, Array, list[int]], Array] | None = None,
    enter: Callable[[float, float], None] | None = None,
) -> Solution:
    """Integrate over the parts between `nodes` (start, corners, end), and from each event that resets the state.

    Raises
    ------
    Crawling
        The steps lead nowhere, as `stall_check` finds.
    ZenoError
        Resets follow each other ever faster, or lead nowhere.
    Interrupted
        Ctrl-C.
    """
    journey = _Journey(rhs, nodes, x0, solver, t_eval, events, dense, options, stall_check)
    try:
        journey.travel(reset, enter)
    except KeyboardInterrupt as interrupt:
        journey.status, journey.message = -1, MESSAGES[-1]
        raise Interrupted(journey.solution()) from interrupt
    finally:
        if enter is not None:
            enter(nodes[0], nodes[-1])  # who asks for inputs from here on asks for those of the whole run
    return journey.solution()


MESSAGES = {
    0: "The solver successfully reached the end of the integration interval.",
    1: "A termination event occurred.",
    -1: "The run was interrupted.",
}


class _Journey:
    """One run on its way."""

    def __init__(
        self, rhs: Any, nodes: Sequence[float], x0: Array, solver: Any, t_eval: Array | None,
        events: Sequence[RunEvent], dense: bool, options: dict[str, Any], stall_check: StallCheck | None,
    ) -> None:  # fmt: skip
        self.rhs, self.nodes, self.solver, self.t_eval = rhs, nodes, solver, t_eval
        self.options, self.stall_check = options, stall_check
        self.t, self.x, self.forward = nodes[0], np.array(x0), nodes[-1] >= nodes[0]
        self.crossings = Crossings(events, rhs, nodes[0], nodes[-1]) if events else None
        self.pieces: list[tuple[float, Any]] | None = [] if dense else None
        self.walked: list[tuple[float, Array]] = []
        self.asked: list[Array] = []
        self.status, self.message = 0, MESSAGES[0]
        self.counts = {"nfev": 0, "njev": 0, "nlu": 0}
        self.kept = True

    def travel(
        self, reset: Callable[[float, Array, list[int]], Array] | None, enter: Callable[[float, float], None] | None
    ) -> None:
        """Go on to the end, a terminal event or a failure."""
        k, armed = 0, False
        self._keep()
        if self.t_eval is not None and self.t_eval.size and self.t_eval[0] == self.t:
            self.asked.append(self.x)
        while k < len(self.nodes) - 1:
            if enter is not None:
                enter(self.nodes[k], self.nodes[k + 1])
            if self.t == self.nodes[k + 1]:
                k += 1
                continue
            solver = self._start(self.nodes[k + 1])
            if self.crossings is not None and not armed:
                self.crossings.arm(self.t, self.x, self._length(solver))
                armed = True
            stop: tuple[float, bool] | None = None
            try:
                while stop is None and solver.status == "running":
                    message = solver.step()
                    if solver.status == "failed":
                        self.status, self.message = -1, str(message)
                        return
                    stop = self._settle(solver)
                    if stop is None and solver.status == "running" and self.stall_check is not None:
                        self.stall_check.look(self.t, self.x)
            finally:
                self._count(solver)
            if stop is None and self.t != self.nodes[k + 1]:
                return  # the solver ended by itself: require_end tells
            if stop is not None and stop[1]:
                self.status, self.message = 1, MESSAGES[1]
                return
            if stop is not None and self.crossings is not None:
                fired = list(self.crossings.fired)
                self.crossings.arrive(self.t, self.x, float(solver.t - solver.t_old))
                if reset is not None:
                    self.x = np.array(reset(self.t, self.x, fired), dtype=float)
                self._keep()
                self.crossings.depart(self.t, self.x)

    def _start(self, end: float) -> Any:
        options = dict(self.options)
        if options.get("first_step") is not None:
            options["first_step"] = min(options["first_step"], abs(end - self.t))
        if callable(jac := options.get("jac")):
            # both the function and the solver may change the state that they are given
            options["jac"] = lambda t, x: jac(t, x.copy())
        solver = self.solver(self.rhs, self.t, self.x.copy(), end, **options)
        if np.isnan(getattr(solver, "h_abs", 0.0)):  # with atol = 0 and a state of 0; SciPy would divide it for ever
            options["first_step"] = min(abs(end - self.t), options.get("max_step", np.inf))
            solver = self.solver(self.rhs, self.t, self.x.copy(), end, **options)
        return solver

    def _length(self, solver: Any) -> float:
        size = getattr(solver, "h_abs", None)
        return (1.0 if self.forward else -1.0) * float(size) if size else 0.0

    def _count(self, solver: Any) -> None:
        for key in self.counts:
            self.counts[key] += int(getattr(solver, key, 0) or 0)

    def _settle(self, solver: Any) -> tuple[float, bool] | None:
        """What a step brought: events, output."""
        t_old, t, x = float(solver.t_old), float(solver.t), np.array(solver.y)
        cache: list[Any] = []

        def between(at: Any) -> Array:
            if not cache:
                cache.append(solver.dense_output())
            if np.ndim(at) and not type(solver).__module__.startswith("scipy."):  # another's may take one time only
                return np.stack([np.asarray(cache[0](one)) for one in np.asarray(at).tolist()], axis=1)
            return np.asarray(cache[0](at))

        stop = None if self.crossings is None else self.crossings.find(Step(t_old, t, x, between, t - t_old))
        end = t if stop is None else stop[0]
        if self.t_eval is not None:
            sign = 1.0 if self.forward else -1.0
            first = len(self.asked)
            last = first + int(np.searchsorted(sign * self.t_eval[first:], sign * end, side="right"))
            for at in self.t_eval[first:last].tolist():
                self.asked.append(x if at == t and stop is None else between(at))
        if self.pieces is not None:
            between(t)
            self.pieces.append((end, cache[0]))
        self.t, self.x = end, x if stop is None else between(end)
        self._keep()
        return stop

    def _keep(self) -> None:
        """Store a step, or a state after a reset; not more than KEPT numbers besides what is asked for."""
        if self.t_eval is None or (self.kept and (len(self.walked) + 1) * (1 + len(self.x)) <= KEPT):
            self.walked.append((self.t, self.x))
        else:
            self.kept = False
            self.walked.clear()

    def solution(self) -> Solution:
        """All of it so far."""
        n, n_asked = len(self.x), len(self.asked)
        steps = _columns(self.walked, n)
        t, x = steps if self.t_eval is None else (self.t_eval[:n_asked], np.array(self.asked).reshape(n_asked, n).T)
        found = ([], []) if self.crossings is None else self.crossings.results(n)
        return Solution(
            t, x, *found, Joined(self.pieces, self.forward) if self.pieces else None, self.status, self.message,
            self.counts, (self.nodes[0], self.t), None if self.t_eval is None else steps,
        )  # fmt: skip


def require_end(solution: Solution, end: float) -> None:
    """Refuse a run that tells of its end without having come there; no run may end early in silence.

    Raises
    ------
    SimulationError
    """
    if solution.status == 0 and solution.ends[1] != end:
        raise SimulationError(
            f"the integrator reports the end, t = {end:.6g} s, but stopped at t = {solution.ends[1]:.6g} s; this is "
            "a fault of the integrator (of eomgen, unless the method is your own); run in parts, or use another method"
        )


def _columns(walked: Sequence[tuple[float, Array]], n: int) -> tuple[Array, Array]:
    """Times (k,) and states (n, k) of steps."""
    return np.array([t for t, _ in walked]), np.array([x for _, x in walked]).reshape(len(walked), n).T
