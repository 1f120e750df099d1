"""Simulation: gaps at the start of a part of a run -> events that find where they close; a look for those missed."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base.algebra import Array
from ..base.limits.impacts import FOUND, STARTED
from ..base.limits.runs import INSTANT
from ..numeric.roots import carry_out, find_root, search_least
from .impact import Gaps

if TYPE_CHECKING:
    from ..runtime.trajectory import Trajectory

RESTING = 0.1  #: the same for one that does not open
SAMPLES = 8  #: places in each step of the solver at which gaps are looked at afterwards
CHUNK = 4096  #: steps at a time


class Watch:
    """When gaps close that may be closed at the beginning.

    A gap that begins at 0 and opens, g = r (t - t0), is watched from its first positive value on: what is watched is
    g + d (1 - (t - t0) r / (2 d)) until the second term is 0, with d a rounding above -g.  It is positive from the
    beginning, and g itself by the time g can be 0 again, unless it opens by less than d.

    Parameters
    ----------
    gaps : Gaps
    t : float
    x : (n_x,) array
    rates : (n,) array
        Of the gaps, at the beginning.
    limits : (n,) array
        Sizes at which gaps count as closed.
    """

    def __init__(self, gaps: Gaps, t: float, x: Array, rates: Array, limits: Array) -> None:
        values = gaps.values(t, x)
        self.gaps, self.start, self.limits = gaps, t, limits
        still = rates <= 0.0
        self.lift = np.where(values <= STARTED * limits, STARTED * limits - np.minimum(values, 0.0), 0.0)
        resting = still & (values <= RESTING * limits)
        self.lift[resting] = (RESTING * limits - np.minimum(values, 0.0))[resting]
        self._key, self._last = (np.nan, b""), values
        self.fall = np.where(resting, 0.0, np.maximum(0.5 * rates, 0.0))

    def values(self, t: Any, x: Array) -> Array:
        """What is watched, (n,) or (n, k)."""
        lift, fall = (self.lift, self.fall) if x.ndim == 1 else (self.lift[:, None], self.fall[:, None])
        return np.asarray(self.gaps.values(t, x) + np.maximum(lift - fall * (t - self.start), 0.0))

    def events(self) -> list[Callable[[float, Array], float]]:
        """Functions f(t, x) that end a run where they fall through 0, in the order of the gaps."""
        found: list[Callable[[float, Array], float]] = []
        for i, name in enumerate(self.gaps.names):

            def closing(t: float, x: Array, i: int = i) -> float:
                key = (t, x.tobytes())
                if key != self._key:  # all gaps are asked for in turn
                    self._key, self._last = key, self.values(t, x)
                return float(self._last[i])

            closing.terminal, closing.direction, closing.__name__ = True, -1.0, name  # type: ignore[attr-defined]
            found.append(closing)
        return found


def first_missed(watch: Watch, piece: Trajectory) -> tuple[float, NDArray[np.bool_]] | None:
    """The first closing of a gap before the end of a piece, and which gaps (n,) close there; None if there is none.

    The solver looks at the ends of its steps; a gap may close and open again in between.

    Parameters
    ----------
    watch : Watch
    piece : Trajectory
        With dense output.
    """
    if len(piece.t) < 2:
        return None
    for a in range(0, len(piece.t) - 1, CHUNK):
        ends = piece.t[a : a + CHUNK + 2]  # one step more than is needed, for dips at its end
        steps = np.diff(ends)
        inner = ends[:-1, None] + steps[:, None] * np.arange(SAMPLES) / SAMPLES
        times = np.append(inner.ravel(), ends[-1])
        values = watch.values(times, piece.at(times).x)
        found = [
            (at, i) for i in range(len(values)) if (at := _first_zero(watch, piece, i, times, values[i])) is not None
        ]
        if found:
            first = min(at for at, _ in found)
            fired = np.zeros(len(values), dtype=bool)
            for at, i in found:
                fired[i] = at <= first + INSTANT * max(abs(first), 1.0)
            return first, fired
    return None


def _first_zero(watch: Watch, piece: Trajectory, i: int, times: Array, values: Array) -> float | None:
    def value(t: float) -> float:
        return float(watch.values(t, piece.at(t).x[:, 0])[i])

    bend = values[:-2] - 2.0 * values[1:-1] + values[2:]
    dips = (values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:]) & (values[1:-1] < bend)
    below = np.flatnonzero(values < 0.0)
    stop = int(below[0]) if below.size else len(values)
    for k in np.flatnonzero(dips) + 1:
        if k >= stop:
            break
        left, middle, right = times[k - 1 : k + 2].tolist()
        search = search_least(left, middle, right, float(values[k]), FOUND * (right - left), below=True)
        low, at = carry_out(search, value)
        if low < 0.0:
            return find_root(value, float(times[k - 1]), at, float(values[k - 1]), low)
    if stop in (0, len(values)) or times[stop] == piece.t[-1]:  # at the end the solver has found it
        return None
    return find_root(value, float(times[stop - 1]), float(times[stop]), float(values[stop - 1]), float(values[stop]))
