"""The steps of a run -> where the mobility itself changes on the way.

At a change point the constraint Jacobian loses rank: a parallelogram lies flat and could go on as an antiparallelogram.
The steps of the integrator are looked at, whatever times were stored, and between them Hermite's polynomial through
their ends, so closely that no pass falls between two looks.  Where the least singular value dips, the polynomial is
laid again through closed states nearer to the dip, until what is lost is lost to rounding.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.constraints import GONE
from ..base.limits.constraints import PASSED as SINGULAR
from ..base.limits.numbers import TINY
from ..base.splines import cubic_piece
from ..errors import EvaluationError

if TYPE_CHECKING:
    from .bound_model import BoundModel

#: Scaled motion between two samples, of coordinates that the constraints hold; a pass takes pi, or half of it.
SPACING = 0.15
MOST = 200_000  #: samples of a run
DIP = 0.5  #: a smallest singular value that falls below this part of its largest over the run is looked at
ENTRIES = 2_000_000  #: of constraint Jacobians held at a time
PARTS = 24  #: of the neighbourhood of a dip, again and again
LEVELS = 10  #: times that it is looked at more closely: 1e-11 of the scaled motion between two samples is left
CLOSER = 1  #: of these times at which the ends are closed again: nearer to the change point that tells no more
SAME = 1e-3  #: of a neighbourhood: dips closer together are one


class ChangePoint(NamedTuple):
    """A time at which the mechanism has more degrees of freedom than elsewhere."""

    time: float  #: when it is passed (s)
    degrees_of_freedom: int  #: at that moment
    coordinates: dict[str, float]  #: their values at that moment (m, rad)

    def __str__(self) -> str:
        listed = ", ".join(f"{name} = {value:.4g}" for name, value in list(self.coordinates.items())[:6])
        more = ", ..." if len(self.coordinates) > 6 else ""
        freedoms = f"{self.degrees_of_freedom} degree{'s' * (self.degrees_of_freedom != 1)} of freedom"
        return f"t = {self.time:.6g} s, {freedoms} at {listed}{more}"


def scaled_jacobians(module: BoundModel, t: Array, x: Array, u: Array | None = None) -> Array:
    """Scaled constraint Jacobians (k, m, n) at times (k,), states (n_x, k) and inputs (n_u, k)."""
    layout = module.layout
    C_q = np.moveaxis(module.kernels.constraint_jacobian(x[: layout.n_q], t=t, u=u), -1, 0)
    return np.asarray(layout.scales.jacobian(C_q))


def singular_values(module: BoundModel, t: Array, x: Array, u: Array | None = None) -> Array:
    """Singular values of the scaled constraint Jacobian relative to the largest, (k, min(m, n))."""
    block = max(1, ENTRIES // (module.layout.n_c * module.layout.n_v))
    result = []
    for k in range(0, len(t), block):
        p = slice(k, k + block)
        J = scaled_jacobians(module, t[p], x[:, p], None if u is None else u[:, p])
        result.append(algebra.singular_values(J))
    values = np.concatenate(result)
    return np.asarray(values / np.maximum(values[:, :1], TINY))


def find_change_points(module: BoundModel, t: Array, x: Array, u: Array) -> list[ChangePoint]:
    """Where a run of a module passed configurations in which rank is lost.

    t (n_t,), x (n_x, n_t) and u (n_u, n_t) are of the integrator's steps; a time that comes twice is that of an event
    that resets the state.
    """
    if not module.layout.rank or len(t) < 2:
        return []
    ends = [0, *(np.flatnonzero(np.diff(t) == 0.0) + 1).tolist(), len(t)]
    looks = [Looks(module, t[a:b], x[:, a:b], u[:, a:b]) for a, b in pairwise(ends) if b - a > 1]
    largest = max((look.least.max() for look in looks), default=0.0)
    result: list[ChangePoint] = []
    for k, look in enumerate(looks):
        if k and looks[k - 1].times[-1] == look.times[0] and look.continues(looks[k - 1]):
            result.append(look.at_start())
        result += look.find(DIP * largest)
    return result


class StatesBetween:
    """States between steps: coordinates by Hermite's polynomial, of degree five where accelerations are known.

    Parameters
    ----------
    t : (k,) array
    x : (n_x, k) array
    u : (n_u, k) array
    """

    def __init__(self, module: BoundModel, t: Array, x: Array, u: Array) -> None:
        self.t, self.x, self.n_q = t, x, module.layout.n_q
        slopes = module.kernels.kernel("rhs", nan=True)(t, x, u=u if len(u) else None)
        known = bool(np.isfinite(slopes).all())
        self.rates = slopes[: self.n_q] if known else np.where(np.isfinite(slopes), slopes, 0.0)[: self.n_q]
        self.bends = slopes[self.n_q :] if known and self.n_q == module.layout.n_v else None

    def __call__(self, times: Array) -> Array:
        """States (n_x, k) at times (k,)."""
        t, forward = self.t, 1.0 if self.t[-1] >= self.t[0] else -1.0
        k = np.clip(np.searchsorted(forward * t, forward * times, side="right") - 1, 0, len(t) - 2)
        h = t[k + 1] - t[k]
        s = (times - t[k]) / h
        q0, q1 = self.x[: self.n_q, k], self.x[: self.n_q, k + 1]
        d0, d1 = self.rates[:, k] * h, self.rates[:, k + 1] * h
        q = cubic_piece(q0, q1, d0, d1, s)
        if self.bends is not None:  # what the second derivatives at the ends lack
            b0 = self.bends[:, k] * h**2 - 6.0 * (q1 - q0) + 4.0 * d0 + 2.0 * d1
            b1 = self.bends[:, k + 1] * h**2 + 6.0 * (q1 - q0) - 2.0 * d0 - 4.0 * d1
            q = q + 0.5 * (s * (1.0 - s)) ** 2 * (b0 * (1.0 - s) + b1 * s)
        v = self.x[self.n_q :, k] * (1.0 - s) + self.x[self.n_q :, k + 1] * s
        return np.concatenate([q, v])


class Looks:
    """The smallest singular value along a part of a run without resets.

    Parameters
    ----------
    module, t, x, u
        As for :func:`find_change_points`.
    """

    def __init__(self, module: BoundModel, t: Array, x: Array, u: Array) -> None:
        self.module, self.t, self.u = module, t, u
        layout = module.layout
        self.rank, self.n_q = layout.rank, layout.n_q
        self.curve = StatesBetween(module, t, x, u)
        ends = scaled_jacobians(module, t[[0, -1]], x[:, [0, -1]], self._inputs(t[[0, -1]]))
        fixed = np.abs(ends).any(axis=(0, 1))
        speed = np.abs(x[self.n_q :] / layout.scales.q[:, None])[fixed].max(axis=0, initial=0.0)
        motion = np.abs(np.diff(t)) * np.maximum(speed[1:], speed[:-1])
        parts = np.maximum(1.0, np.ceil(motion / max(SPACING, float(motion.sum()) / MOST))).astype(int)
        place = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
        self.times = np.append(place * np.repeat(np.diff(t) / parts, parts) + np.repeat(t[:-1], parts), t[-1])
        values = singular_values(module, self.times, self.curve(self.times), self._inputs(self.times))
        self.least = values[:, self.rank - 1]
        self.fixed = fixed

    def continues(self, before: Looks) -> bool:
        """Whether a reset at a change point, where the part before ended, lets the mechanism go on across it."""
        if max(before.least[-1], self.least[0]) > GONE:
            return False
        v, w = before.curve.x[self.n_q :, -1], self.curve.x[self.n_q :, 0]
        return bool((v / self.module.layout.scales.q**2 * w)[self.fixed].sum() > 0.0)

    def at_start(self) -> ChangePoint:
        """The change point at which this part starts."""
        times, state = self.times[:1], self.curve.x[:, :1]
        return self._point(
            float(times[0]), state[:, 0], singular_values(self.module, times, state, self._inputs(times))[0]
        )

    def _inputs(self, times: Array) -> Array | None:
        """Inputs (n_u, k) at times (k,) where constraints depend on them."""
        if not self.module.layout.constraint_inputs:
            return None
        return np.array([np.interp(times, *_rising(self.t, row)) for row in self.u])

    def find(self, limit: float) -> list[ChangePoint]:
        """The change points where the smallest singular value falls below a limit, in order."""
        padded = np.concatenate([[np.inf], self.least, [np.inf]])
        dips = np.flatnonzero((self.least <= padded[:-2]) & (self.least <= padded[2:]) & (self.least < limit))
        result: list[ChangePoint] = []
        for k in dips.tolist():
            first, last = self.times[max(k - 1, 0)], self.times[min(k + 1, len(self.times) - 1)]
            point = self._closest(float(first), float(last))
            if point is None or (result and abs(point.time - result[-1].time) <= SAME * abs(last - first)):
                continue
            if self._crossed(point.time, result[-1].time if result else None):
                result.append(point)
        return result

    def _crossed(self, time: float, before: float | None) -> bool:
        """Whether the run comes to a change point from farther away, the one before too, and leaves it again."""
        forward = self.times[-1] >= self.times[0]
        earlier, later = (self.times < time, self.times > time) if forward else (self.times > time, self.times < time)
        if before is not None:
            earlier &= self.times > before if forward else self.times < before
        return bool((self.least[earlier] > GONE).any() and (self.least[later] > GONE).any())

    def _closest(self, first: float, last: float) -> ChangePoint | None:
        """The state between two times nearest to a loss of rank, if it is one."""
        curve = self.curve
        for level in range(LEVELS):
            if level <= CLOSER:
                ends = np.array([first, last])
                u = np.array([np.interp(ends, *_rising(self.t, row)) for row in self.u]).reshape(-1, 2)
                curve = StatesBetween(self.module, ends, self._closed(curve, ends), u)
            times = np.linspace(first, last, PARTS + 1)
            states = curve(times)
            values = singular_values(self.module, times, states, self._inputs(times))
            least = values[:, self.rank - 1]
            k = int(np.argmin(least))
            first, last = times[max(k - 1, 0)], times[min(k + 1, PARTS)]
            if first == last or least[k] == 0.0:
                break  # as near as times can be told apart
        return None if least[k] > SINGULAR else self._point(float(times[k]), states[:, k], values[k])

    def _point(self, time: float, state: Array, values: Array) -> ChangePoint:
        gone = max(GONE, 10.0 * values[self.rank - 1])
        freedoms = self.module.layout.n_v - int(np.count_nonzero(values > gone))
        coordinates = dict(zip(self.module.q_names, state[: self.n_q].tolist(), strict=True))
        return ChangePoint(time, freedoms, coordinates)

    def _closed(self, curve: StatesBetween, times: Array) -> Array:
        """States of a curve at times, on the constraints; one that cannot be brought there stays as it is."""
        states = curve(times)
        for k, at in enumerate(times):
            try:
                u = self._inputs(times[k : k + 1])
                states[:, k] = self.module.project(states[:, k], t=float(at), u=None if u is None else u[:, 0])
            except EvaluationError:
                continue
        return states


def _rising(t: Array, row: Array) -> tuple[Array, Array]:
    """Times in ascending order and what belongs to them."""
    return (t, row) if t[-1] >= t[0] else (t[::-1], row[::-1])
