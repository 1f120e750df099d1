"""Analysis: a straight path -> the motion at any parameters on it, singular positions included."""

from __future__ import annotations

import numpy as np

from ..base.algebra import Array
from ..base.limits.analyses import ALIGNED, POOR, SAME
from ..numeric.curves import ASTRAY, Point, interpolate
from ..numeric.projection import largest
from .change_point_interpolant import ChangePointInterpolant
from .driven_coordinates import DrivenContinuation, DrivenPath
from .singular import Singular, find_change_points, find_stop, name_singular


class FollowedPath:
    """A continuation from s = 0 to ``end``, or as far as it goes; the way to ``known`` is known to be smooth.

    ``extent`` is that of :class:`~..numeric.continuation.Continuation`.

    Attributes
    ----------
    reached : float
        The last s that can be reached.
    stop : Singular or None
        What is there, if it is before the end.
    singular : list of Singular
        Change points on the way.
    """

    def __init__(self, path: DrivenPath, start: Array, end: float, known: float = 0.0, extent: float = 0.0) -> None:
        self.path, self.end = path, end
        self.driven = driven = path.driven
        self.continuation = continuation = DrivenContinuation(path, start, extent)
        whole = continuation.to(end, known)
        self.interpolants, self.singular = find_change_points(continuation)
        self.stop: Singular | None = None
        self.reached = end
        if not whole:
            self.reached, last = find_stop(continuation, continuation.points[-1])
            self.stop = name_singular(driven, "stop", path.at(self.reached)[0], last.q, last.tangent)
        self.nodes = np.array([p.s for p in continuation.points])

    @property
    def smooth(self) -> bool:
        """Whether it came to its end without a stop, a change point or a leap."""
        return not (self.stop or self.singular or self.interpolants or self.continuation.leaps)

    def holds(self, s: float) -> bool:
        """Whether s can be reached."""
        return bool(s <= self.reached + SAME * max(1.0, self.end))

    def position(self, s: float) -> Array:
        """q (n_q,) at a parameter that can be reached."""
        return self.motion(np.array([s]), None)[0][:, 0]

    def motion(self, s: Array, rates: tuple[Array, Array] | None) -> tuple[Array, Array, Array]:
        """q, v, a (n, k) at parameters s (k,).

        Parameters
        ----------
        s : (k,) array
        rates : two (n_led, k) arrays, optional
            y' and y'' over time; those of the path itself by default, with s as the time where t stands still.
        """
        y1, y2 = self._rates(len(s)) if rates is None else rates
        layout = self.driven.layout
        q, v, a = (np.empty((n, len(s))) for n in (layout.n_q, layout.n_v, layout.n_v))
        guesses = interpolate(self.continuation.points, self.driven.scales, s)
        odd = np.ones(len(s), dtype=bool)
        if self.driven.direct:
            t, y = self._along(s)
            q[:], v[:], a[:] = self.driven.motions(t, y, y1, y2, guesses)
            scales = self.driven.scales
            if scales.space is None:
                with np.errstate(invalid="ignore"):
                    odd = ~(np.abs((q - guesses) / scales.q[:, None]).max(axis=0) <= ASTRAY)
                for interpolant, _ in self.interpolants:
                    odd |= (interpolant.supports[1].s < s) & (s < interpolant.supports[2].s)
                odd |= s >= self._edge
        for j in np.flatnonzero(odd):
            found = q[:, j], v[:, j], a[:, j]
            q[:, j], v[:, j], a[:, j] = self._one(float(s[j]), guesses[:, j], y1[:, j], y2[:, j], found)
        return q, v, a

    @property
    def _edge(self) -> float:
        """The parameter from which on the position is that of the stop."""
        return np.inf if self.stop is None else self.reached - SAME * max(1.0, self.end)

    def _rates(self, k: int) -> tuple[Array, Array]:
        rate = self.path.y1 / (self.path.t1 or 1.0)
        return np.repeat(rate[:, None], k, axis=1), np.zeros((len(rate), k))

    def _along(self, s: Array) -> tuple[Array, Array]:
        return self.path.t + s * self.path.t1, self.path.y[:, None] + self.path.y1[:, None] * s

    def _neighbours(self, s: float) -> tuple[Point, Point]:
        points = self.continuation.points
        k = min(max(int(np.searchsorted(self.nodes, s)), 1), len(points) - 1)
        return points[k - 1], points[k]

    def _one(
        self, s: float, guess: Array, y1: Array, y2: Array, found: tuple[Array, Array, Array]
    ) -> tuple[Array, Array, Array]:
        """The motion at one parameter; ``found`` is that of the compiled kernel, if it leads the same coordinates."""
        driven, scales = self.driven, self.driven.scales
        if self.stop is not None and s >= self._edge:
            nothing = np.full(len(scales.q), np.nan)
            return self.stop.q, nothing, nothing
        t = self.path.at(s)[0]
        interpolant = next((b for b, _ in self.interpolants if b.supports[1].s < s < b.supports[2].s), None)
        if interpolant is not None and driven.tangent(t, interpolant.at(s)[0], 0.0, self.path.y1).quality < POOR:
            return self._interpolated(interpolant, s, y1, y2)
        q, v, a = found
        if not driven.direct or not np.isfinite(q).all() or largest(scales.distance(q, guess)) > ASTRAY:
            q = self._closer(s, guess)
            v, a = driven.motion(t, q, y1, y2)
        return q, v, a

    def _closer(self, s: float, guess: Array) -> Array:
        """The position next to a guess, followed to from the nearest point if Newton's iteration goes astray."""
        driven, scales = self.driven, self.driven.scales
        found = driven.position(*self.path.at(s), guess)
        if found is not None and largest(scales.distance(found, guess)) <= ASTRAY:
            return found
        before = self._neighbours(s)[0] if len(self.nodes) > 1 else self.continuation.points[0]
        short = DrivenContinuation(self.path.beyond(before.s), before.q)
        short.to(s - before.s)
        return short.points[-1].q

    def _interpolated(
        self, interpolant: ChangePointInterpolant, s: float, y1: Array, y2: Array
    ) -> tuple[Array, Array, Array]:
        """The motion at or beside a change point, where it must run along the path."""
        q, first, second = interpolant.at(s)
        t1, path = self.path.t1, self.path.y1
        nothing = np.full_like(first, np.nan)
        if t1:
            if np.allclose(y1, path / t1, rtol=ALIGNED, atol=0.0) and not y2.any():
                return q, first / t1, second / t1**2
            return q, nothing, nothing
        k = int(np.argmax(np.abs(path / self.driven.led_scales)))
        speed, gain = y1[k] / path[k], y2[k] / path[k]
        if np.allclose(y1, speed * path, rtol=ALIGNED) and np.allclose(y2, gain * path, rtol=ALIGNED):
            return q, speed * first, speed**2 * second + gain * first
        return q, nothing, nothing
