"""Simulation: values of events along a run -> where they come to zero, for integrators stepped in Python.

The same as the compiled loop does in C (steppers/crossings.c, event_values.c, event_zero.c), function by function, so
that a run finds the same events by every method: changes of sign between the ends of a step, values that come to zero
and leave again within it, and zeros after a reset, once the value has been seen on its side.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isnan, nan
from typing import NamedTuple

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
from ..errors import ZenoError
from ..numeric.roots import Found, Search, search_least, search_root
from .events import GO_ON, RESET, UNWATCHED, WAIT, Events, EventValues, RunEvent, crowd_of, instant


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
