"""Simulation: the resets of one run -> where events go on from, and when they follow each other without end."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..base.algebra import Array
from ..base.limits.runs import AHEAD, CROWDED, TOUCHING
from ..errors import ZenoError
from .events import GO_ON, RESET, WAIT, Events, RunEvent, crowd_of


class Resets:
    """What an integrator that starts anew at each reset has to remember.

    Parameters
    ----------
    events : sequence of RunEvent
    rhs : callable
        (t, x) -> x'.
    start, end : float
        Of the run (s).
    """

    def __init__(
        self, events: Sequence[RunEvent], rhs: Callable[[float, Array], Array], start: float, end: float
    ) -> None:
        self.events, self.rhs, self.span = events, rhs, end - start
        self.count, self.crowded, self.last = 0, 0, np.inf
        self.most = crowd_of([event.action for event in events])

    def note(self, t: float, before: Array, after: Array, fired: Sequence[int]) -> None:
        """Take note of events that happened at time t and led from one state to another.

        Raises
        ------
        ZenoError
            Resets follow each other ever faster, or lead nowhere.
        """
        self.count += 1
        self.crowded = self.crowded + 1 if abs(t - self.last) < CROWDED * abs(self.span) else 0
        self.last = t
        for e in fired:
            event = self.events[e]
            came, goes = (self.rate(event, t, state) for state in (before, after))
            stuck = not abs(goes) > TOUCHING * abs(came) or (event.action == WAIT and goes < 0.0)
            stuck = stuck and abs(event(t, after)) <= TOUCHING * abs(came * self.span)  # not where its value jumped
            again = event.direction * came < 0.0  # the zero it just left
            if event.action in (RESET, WAIT) and (stuck or again):
                self.crowded = self.most
            event.left = (t, self.side(event, t, after))
        if self.crowded >= self.most:
            raise self.endless()

    def endless(self) -> ZenoError:
        """The error for resets that never end."""
        return Events.crowded_near(self.last, self.count, [e.name for e in self.events if e.action != GO_ON])

    def rate(self, event: RunEvent, t: float, x: Array) -> float:
        """How fast an event's value changes along the motion, in the direction of the run."""
        h = AHEAD * self.span
        event.left = None
        return float((event(t + h, x + h * np.asarray(self.rhs(t, x)), for_slope=True) - event(t, x)) / abs(h))

    def side(self, event: RunEvent, t: float, x: Array) -> float:
        """The side of zero, 1 or -1, to which the value of an event goes that is zero now; 0 where it stays.

        Its rate tells; where it has none, as that of a body at rest, the value after a midpoint step of the run.
        """
        rate = self.rate(event, t, x)
        if rate != 0.0:
            return float(np.sign(rate))
        h = AHEAD**0.5 * self.span
        middle = x + 0.5 * h * np.asarray(self.rhs(t, x))
        return float(np.sign(event(t + h, x + h * np.asarray(self.rhs(t + 0.5 * h, middle)), for_slope=True)))
