"""Times and states of an integrator's steps -> the end of a run whose steps lead nowhere.

Next to a singular position, or where a force jumps, an integrator may go on for days in steps just above rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.numbers import TINY
from ..base.limits.runs import ENDLESS, ENOUGH, FEW, HOPELESS, MOST_NUMBERS, MOST_STEPS, NOTICED, SHORT, STEEP, STILL
from ..errors import SimulationError
from ..runtime.failure import place

WINDOW = 200  #: steps judged together
MANY = 100_000  #: steps left that a run may take at any stall_check
IN_PLACE = 1_000_000  #: steps left that it may take where nothing of it gets on, held between two sides of a jump
HALVED = 10  #: times that an interval is halved in which a rate jumps: a change that is not one shrinks to 1/1024
LEAST = 10.0  #: spacings of numbers at a time that a step has at least, in all methods of SciPy but LSODA
HINDERED = 0.1  #: part of what its rate says up to which a state that moves is held
REMEDY = (
    "look for a force that jumps (smooth it), a singular position, or very fast motions in a long run (try an "
    "implicit method, Radau)"
)


class StallCheck:
    """Watches how a run advances.

    A run crawls if its mean step would take more than ``MANY`` further steps and is less than ``SHORT`` of its span,
    while either the state stands still or it is at a known singularity: a short impact moves the state.  So it does if
    it would take more than ``IN_PLACE`` and is held where a rate jumps, as in sliding modes, and none of its states
    goes as its rate says; where others do, as they may end the sliding, it may take ``MOST_STEPS``.

    Parameters
    ----------
    start, end : float
        Of the run (s).
    x : (n_x,) array
        First state; of what follows it in those looked at, as derivatives by parameters, nothing is judged.
    n_q : int
        Number of positions; velocities follow.
    max_step : float
        The user's; steps that it keeps short are not a crawl.
    troubled : callable
        (t, x) -> whether the state is at a known singularity.
    rhs : callable
        f(t, x).
    kept : int
        Numbers that the run keeps of each step.
    """

    def __init__(
        self, start: float, end: float, x: Array, n_q: int, max_step: float, troubled: Callable[[float, Array], bool],
        rhs: Callable[[float, Array], Array], kept: int = 0,
    ) -> None:  # fmt: skip
        self.start, self.taken, self.kept = start, 0, kept
        self.end, self.parts = end, (slice(n_q), slice(n_q, None))
        self.limit, self.shortest = SHORT * abs(end - start), 0.1 * max_step
        self.troubled, self.rhs = troubled, rhs
        self.steps = self.slow = 0
        self.t, self.x = start, x
        self.largest: Array | None = None  #: magnitude of each state at the windows before

    def look(self, t: float, x: Array, steps: int = 1) -> None:
        """Take note of so many further steps, the last of which came to x at t."""
        self.steps += steps
        self.taken += steps
        self._require_end(t)
        if self.steps < WINDOW:
            return
        x = x[: len(self.x)]
        step, moved = abs(t - self.t) / self.steps, np.abs(x - self.x)
        largest = np.abs(self.x) if self.largest is None else self.largest
        time = abs(t - self.t)
        self.t, self.x, self.steps = t, np.array(x), 0
        self.largest = np.fmax(largest, np.abs(self.x))
        if step > self.shortest or abs(self.end - t) < MANY * step:
            return
        still = np.concatenate([moved[part] <= STILL * self.largest[part].max(initial=0.0) for part in self.parts])
        crawl = Crawling(t, self.x, step)
        lost = step <= LEAST * np.spacing(abs(t))  # SciPy's LSODA goes on where the time does not
        if lost or (step <= self.limit and (still.all() or self.troubled(t, self.x))):
            raise crawl
        if abs(self.end - t) > IN_PLACE * step:
            self.slow += 1  # sliding is looked for in the 1st, 2nd, 4th, 8th ...: it takes 12 n_x + 1 evaluations
            if abs(self.end - t) > MOST_STEPS * step:
                moved[still] = 0.0
            if self.slow & (self.slow - 1) == 0 and slides(self.rhs, crawl, moved, time):
                raise crawl

    def _require_end(self, t: float) -> None:
        """Refuse to go on for ever, or to fill the memory."""
        if self.taken * self.kept > MOST_NUMBERS:
            raise SimulationError(
                f"the run has taken {self.taken} steps up to t = {t:.6g} s of {self.end:.6g} s, and more cannot be "
                "kept; give a shorter span, or in Python the times to store, t_eval",
                code="EG-TOO-LARGE",
            )
        wanted, gone = abs(self.end - t) * self.taken, abs(t - self.start)
        if (self.taken > ENOUGH and wanted > ENDLESS * gone) or (self.taken > FEW and wanted > HOPELESS * gone):
            more = abs(self.end - t) / max(abs(t - self.start), TINY) * self.taken
            raise SimulationError(
                f"the run has taken {self.taken} steps up to t = {t:.6g} s and needs {more:.1e} more to reach "
                f"t = {self.end:.6g} s, which would take too long; give a shorter span, or looser tolerances",
                code="EG-ENDLESS",
            )


def slides(rhs: Callable[[float, Array], Array], crawl: Crawling, moved: Array, time: float) -> bool:
    """Whether a run is held where a rate jumps, so that none of its states goes as its rate says.

    Parameters
    ----------
    rhs : callable
        f(t, x).
    crawl : Crawling
        Time, state and mean step.
    moved : (n_x,) array
        What the states have changed in a while.
    time : float
        The while (s).
    """
    t, x = crawl.t, crawl.x
    with np.errstate(all="ignore"):
        f = np.array(rhs(t, x))
        rates, jumped = np.abs(f), False
        for j, size in enumerate(np.fmax(10.0 * crawl.step * np.abs(f), NOTICED * np.abs(x))):
            low, high = x.copy(), x.copy()
            low[j], high[j] = x[j] - size, x[j] + size
            below, above = np.array(rhs(t, low)), np.array(rhs(t, high))
            change = np.abs(above - below)
            if not np.isfinite(change).all():
                continue
            rates = np.fmax(rates, np.fmax(np.abs(below), np.abs(above)))
            i = int(np.argmax(change - NOTICED * rates))
            for _ in range(HALVED):
                middle = low + 0.5 * (high - low)
                between = np.array(rhs(t, middle))
                if abs(above[i] - between[i]) > abs(between[i] - below[i]):
                    low, below = middle, between
                else:
                    high, above = middle, between
            jumped = jumped or bool(abs(above[i] - below[i]) > 0.5 * change[i] > NOTICED * rates[i])
    return jumped and bool((moved <= HINDERED * time * rates).all())


def steepest(rhs: Callable[[float, Array], Array], crawl: Crawling, names: tuple[str, ...], atol: Any) -> str:
    """Which rate is steepest in which state where a run crawls, in words; empty if none is steep for the steps.

    Parameters
    ----------
    rhs : callable
        f(t, x).
    crawl : Crawling
    names : names of the states
    atol : float or (n_x,) array
        Absolute tolerance; the changes tried are no less, nor less than the motion of ten steps.
    """
    t, x = crawl.t, crawl.x
    found, words = 0.0, ""
    sizes = np.fmax(np.broadcast_to(atol, x.shape), 10.0 * crawl.step * np.abs(np.array(rhs(t, x))))
    sizes = np.fmax(sizes, NOTICED * np.abs(x))
    for j, size in enumerate(sizes):
        low, high = x.copy(), x.copy()
        low[j] -= size
        high[j] += size
        change = np.abs(np.array(rhs(t, high)) - np.array(rhs(t, low)))
        if not np.isfinite(change).all():
            continue
        slope = change / (2 * size)
        i = int(slope.argmax())
        if slope[i] * crawl.step > max(found * crawl.step, STEEP):
            found = slope[i]
            words = f"the rate of {names[i]} changes by {change[i]:.3g} where {names[j]} changes by {2 * size:.1g}"
    return words


def describe_crawl(crawl: Crawling, names: tuple[str, ...], end: float, method: str, steep: str) -> str:
    """The message of a run that crawls."""
    why = f": {steep}" if steep else ""
    return (
        f"{method} stopped at t = {crawl.t:.9g} s of {end:.6g} s{place(names, crawl.x)}: with steps "
        f"of {crawl.step:.1e} s on average it makes no progress{why}; {REMEDY}"
    )


# -- the end of such a run ---------------------------------------------------------------------------------------------


class Crawling(Exception):
    """Raised inside an integration whose steps lead nowhere.

    Parameters
    ----------
    t : float
    x : (n_x,) array
    step : float
        Mean length of the last steps (s).
    """

    def __init__(self, t: float, x: Array, step: float) -> None:
        super().__init__(t, x, step)
        self.t, self.x, self.step = t, x, step
