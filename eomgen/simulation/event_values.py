"""Simulation: the events of one run -> their values, those of one source by one call of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.algebra import Array
from .events import RunEvent, Together

AT_ONCE = 1_000_000  #: values of events at several times that are asked for in one call


class EventValues:
    """Values of events, at one state or each at its own.

    Parameters
    ----------
    events : sequence of RunEvent
    """

    def __init__(self, events: Sequence[RunEvent]) -> None:
        self.events = events
        self.together: dict[int, tuple[Together, list[int]]] = {}  #: what gives several values, and of which events
        self.alone: list[int] = []
        for i, event in enumerate(events):
            if event.source is None:
                self.alone.append(i)
            else:
                self.together.setdefault(id(event.source[0]), (event.source[0], []))[1].append(i)

    def __call__(self, t: float, x: Array, for_slope: bool = False) -> Array:
        """The values (n,) of all events at a time and state; ``for_slope``: for a difference quotient, off the path."""
        g = np.empty(len(self.events))
        for i in self.alone:
            g[i] = self.events[i](t, x, for_slope)
        for together, places in self.together.values():
            values = together.values(t, x)
            for i in places:
                event = self.events[i]
                g[i] = event.seen_value(t, float(values[event.source[1]]))  # type: ignore[index]
        return g

    def each(self, asked: Sequence[int], times: Array, states: Array) -> list[float]:
        """The value of event asked[k] at times[k] and states[k], for every k."""
        values: dict[int, float] = {}
        for together, places in self.together.values():
            if together.columns is None or len(asked) < 2:
                continue
            watched = set(places)
            mine = [k for k, i in enumerate(asked) if i in watched]
            size = max(AT_ONCE // len(places), 1)
            for part in (mine[n : n + size] for n in range(0, len(mine), size)):
                table = together.columns(times[part], np.ascontiguousarray(states[part].T))
                for column, k in enumerate(part):
                    event = self.events[asked[k]]
                    values[k] = event.seen_value(float(times[k]), float(table[event.source[1], column]))  # type: ignore[index]
        return [values[k] if k in values else self.events[i](float(times[k]), states[k]) for k, i in enumerate(asked)]
