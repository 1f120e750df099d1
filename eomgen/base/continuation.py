"""A curve of closed positions -> its next points, through singular ones too."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..errors import AssemblyError
from . import algebra
from .algebra import Array
from .assembly import DAMPING, ClosureSystem, ConstraintSystem, close, closed
from .limits.numbers import EPS
from .limits.positions import BLOCKED, DRIFTED, JUMPS, NULL, UNJUDGED
from .scales import Scales, largest
from .splines import cubic_piece

# -- curves ------------------------------------------------------------------------------------------------------------


OFF = 0.1  #: largest part of a step by which a position may miss its prediction
TURNED = 0.3  #: the same of a direction
ASTRAY = 0.02  #: scaled distance of a position from its interpolation that may mean another branch


class Tangent(NamedTuple):
    """The direction of the motion at one point, and how well it is determined."""

    rate: Array  #: (n_v,) dq/ds as velocities
    quality: float = 1.0  #: smallest over largest singular value of K: 0 at a singular position
    sign: float = 1.0  #: of the determinant of as many independent rows of K as there are columns
    free: Array = np.empty(0)  #: (n_v,) scaled motion that K restrains least
    rows: Array = np.empty(0)  #: (n_c + k,) rows of K that hold that motion least


class Point(NamedTuple):
    """One point of a continuation; s is the curve's parameter."""

    s: float
    q: Array
    tangent: Tangent  #: along s


class PositionCurve(Protocol):
    """Positions that depend on one parameter s."""

    @property
    def scales(self) -> Scales:
        """The scales of positions."""

    def tangent(self, s: float, q: Array) -> Tangent:
        """The direction at a position."""

    def solve(self, s: float, guess: Array) -> Point | None:
        """The point next to a guess; None if Newton's iteration finds none."""


class StraightPath(NamedTuple):
    """A straight path of prescribed coordinates: t and their values y are linear in s."""

    driven: Any  #: with ``solve`` and ``tangent`` of time and values, and ``scales``
    t: float
    y: Array
    t1: float  #: dt/ds
    y1: Array  #: dy/ds

    @property
    def scales(self) -> Scales:
        scales: Scales = self.driven.scales
        return scales

    def at(self, s: float) -> tuple[float, Array]:
        return self.t + s * self.t1, self.y + s * self.y1

    def tangent(self, s: float, q: Array) -> Tangent:
        result: Tangent = self.driven.tangent(self.at(s)[0], q, self.t1, self.y1)
        return result

    def solve(self, s: float, guess: Array) -> Point | None:
        result = self.driven.solve(*self.at(s), self.t1, self.y1, guess)
        return None if result is None else Point(s, *result)


def interpolate(points: Sequence[Point], scales: Scales, s: Array) -> Array:
    """Positions (n_q, k) at parameters s (k,) between points of a curve, cubics through them and their directions."""
    if len(points) == 1:
        return np.repeat(points[0].q[:, None], len(s), axis=1)
    nodes = np.array([p.s for p in points])
    values = np.array([p.q for p in points]).T
    slopes = np.array([scales.rates(p.q, p.tangent.rate) for p in points]).T
    k = np.clip(np.searchsorted(nodes, s), 1, len(points) - 1)
    width = nodes[k] - nodes[k - 1]
    x = np.clip((s - nodes[k - 1]) / width, 0.0, 1.0)
    result = cubic_piece(values[:, k - 1], values[:, k], slopes[:, k - 1] * width, slopes[:, k] * width, x)
    for i, _ in scales.space.quaternion_slots if scales.space is not None else ():
        result[i : i + 4] /= np.sqrt((result[i : i + 4] ** 2).sum(axis=0))
    return result


# -- continuation ------------------------------------------------------------------------------------------------------

# Predictor and corrector with step control (Allgower and Georg, Introduction to Numerical Continuation Methods, ch. 2
# and 6). A step counts only if position and direction come out near to what the points before foretold: near a singular
# position another branch is near too, but runs in another direction. A singular position is passed by a jump, to the
# point behind it that continues the motion smoothly, if there is one.


FIRST = 0.1  #: scaled motion in the first step
LONG = 0.35  #: scaled motion aimed at in one step
JUMP = 0.5  #: largest scaled motion in one step
FEWEST = 50  #: steps of a continuation over time
STEPS = 200_000  #: of one continuation


class Continuation:
    """Follows one curve from a position (n_q,) at s = 0.

    ``extent`` is the length in s of the whole range that the curve is a piece of: the pieces of a range to and fro need
    no shorter steps than one way over all of it.  It takes the ``fewest`` steps at least, however still it stands, so
    that short driver pulses are not skipped.
    """

    def __init__(self, curve: PositionCurve, start: Array, extent: float = 0.0, fewest: int = FEWEST) -> None:
        self.curve, self.scales, self.extent, self.fewest = curve, curve.scales, extent, fewest
        self.points = [Point(0.0, start, curve.tangent(0.0, start))]
        self.jumps: list[tuple[Point, Point]] = []
        self.blocked = False
        rate = largest(self.points[0].tangent.rate / self.scales.q)
        self.step = FIRST / rate if rate > 0.0 else 1.0

    def to(self, end: float, steps: int = STEPS) -> bool:
        """Go on until s = end, or beyond if a jump ends there; returns False where the way is blocked before."""
        for _ in range(steps):
            here = self.points[-1]
            left = end - here.s
            if left <= 0.0:
                return True
            longest = max(end, self.extent) / self.fewest
            rate = largest(here.tangent.rate / self.scales.q)
            self.step = min(self.step, longest, LONG / rate if rate > 0.0 else longest)
            h = left if self.step >= left else min(self.step, 0.5 * left)
            result = self.forward(-1, h, end if h == left else here.s + h)
            if result is None:
                self.step = 0.5 * h
                if self.step > BLOCKED * max(1.0, abs(here.s)):
                    continue
                result = self._extrapolate()
                if result is None:
                    self.blocked = True
                    return False
                self.jumps.append((here, result))
                self.step = result.s - here.s
            self.points.append(result)
        return self.points[-1].s >= end

    def reach(self, end: float, steps: int = STEPS) -> Point | None:
        """The point at s = end, found between its ends where a jump goes on; None where the way is blocked before."""
        if not self.to(end, steps=steps):
            return None
        last = self.points[-1]
        if last.s == end:
            return last
        before = self.jumps[-1][0]
        part = (end - before.s) / (last.s - before.s)
        return self.curve.solve(end, self.scales.move(before.q, part * self.scales.distance(last.q, before.q)))

    def forward(self, k: int, h: float, s: float) -> Point | None:
        """One step from a point, None if it fails or is not a smooth continuation."""
        here, before = self.points[k], self.points[max(k - 1, -len(self.points))]
        turned, gap = here.tangent.rate - before.tangent.rate, here.s - before.s
        bend = turned / gap if gap > 0.0 else np.zeros_like(turned)  # the second derivative along s
        ahead = self.scales.move(here.q, (here.tangent.rate + 0.5 * h * bend) * h / self.scales.q)
        if not largest(self.scales.distance(ahead, here.q)) <= JUMP:
            return None
        result = self.curve.solve(s, ahead)
        if result is None:
            return None
        off = largest(self.scales.distance(result.q, ahead))
        move = largest(self.scales.distance(result.q, here.q))
        turn = h * largest((result.tangent.rate - here.tangent.rate - h * bend) / self.scales.q)
        worst = largest(np.array([off / max(OFF * move, UNJUDGED), turn / max(TURNED * move, UNJUDGED)]))
        if not (worst <= 1.0 and move <= JUMP):
            return None
        if h >= 0.999 * self.step:
            self.step = h * (2.0 if worst < 0.1 else 1.4 if worst < 0.4 else 1.0)
        return result

    def _extrapolate(self) -> Point | None:
        """A point behind a singular position, as far from it as one before it, that continues the motion smoothly."""
        here = self.points[-1]
        for size in JUMPS:
            away = (k for k in range(-2, -len(self.points) - 1, -1) if self._moved(k) >= size)
            if (k := next(away, None)) is not None:
                gap = here.s - self.points[k].s
                result = self.forward(k, 2.0 * gap, here.s + gap)
                if result is not None and largest(self.points[k].tangent.rate / self.scales.q) > 0.0:
                    return result
        return None

    def _moved(self, k: int) -> float:
        return largest(self.scales.distance(self.points[-1].q, self.points[k].q))


# -- paths with fixed coordinates --------------------------------------------------------------------------------------

# there steadily, on the branch that the mechanism is on.


LONGEST = 200.0  #: scaled distance too long to follow
TRIALS = 5000  #: steps at most, those taken back included
NEWTON = 15  #: Newton steps to one point


class HeldPath:
    """Closed positions while coordinates, and the time, go along straight lines to given values; s from 0 to 1.

    What is not held moves as little as the constraints allow.  The system is that at the time of the start, a closed
    position; held values are reached exactly, of coordinates of the tree (all four Euler parameters of a rotation or
    none) and of cut joints.  The time at the end is that of the start by default.
    """

    def __init__(
        self, system: ConstraintSystem, start: Array, fixed: Mapping[str, float], end: float | None = None
    ) -> None:
        self.system, self.start, self.scales = system, start, system.scales
        self.end = system.t if end is None else end
        self.fixed, target = system.indices(fixed), system.with_values(start, fixed)
        closure = system.closure(fixed)
        self.free, self.values = closure.free, target[self.fixed]
        self.way = (1.0 - self.free) * self.scales.distance(target, start)  # (n,) scaled
        self.equations = equations = closure.equations
        self.gap = equations.difference(equations.evaluate(start)[0]) if equations else np.empty(0)
        self.length = max(largest(self.way), largest(self.gap / equations.scales) if equations else 0.0)

    def _at(self, s: float) -> ConstraintSystem:
        return self.system.at(self.end if s == 1.0 else self.system.t + s * (self.end - self.system.t))

    def solve(self, s: float, guess: Array) -> Point | None:
        q = np.array(guess)
        q[self.fixed] = self.values if s == 1.0 else self.scales.move(self.start, s * self.way)[self.fixed]
        equations = self.equations and self.equations._replace(values=self.equations.values + (1.0 - s) * self.gap)
        system = ClosureSystem(self._at(s).position, self.scales, self.free, equations)
        for damping in (0.0, DAMPING):
            result, residual = close(system, q, steps=NEWTON, damping=damping)
            if closed(residual):
                result[self.fixed] = q[self.fixed]  # Euler parameters are normalized at each step
                return Point(s, result, self.tangent(s, result))
        return None

    def tangent(self, s: float, q: Array) -> Tangent:
        system = ClosureSystem(self._at(s).position, self.scales, np.ones_like(self.free), self.equations)
        _, J = system.evaluate(q)
        right = -J @ self.way
        if self.equations:
            right[len(right) - len(self.gap) :] -= self.gap / self.equations.scales
        if self.end != self.system.t:
            right[: len(right) - len(self.gap)] -= self._drift(s, q)
        if not len(J) or not np.isfinite(J).all() or not np.isfinite(right).all():
            return Tangent(self.scales.q * self.way)
        return Tangent(self.scales.q * (self.way + algebra.lstsq(J * self.free, right, rcond=NULL)))

    def _drift(self, s: float, q: Array) -> Array:
        """Change of the scaled residual (h,) with s at a position that stands still, by a central difference."""
        sides = [self.scales.residual(self._at(s + h).position(q)[0]) for h in (DRIFTED, -DRIFTED)]
        return np.asarray((sides[0] - sides[1]) / (2.0 * DRIFTED))


def follow(system: ConstraintSystem, start: Array, fixed: Mapping[str, float], end: float | None = None) -> Array:
    """Move held values, and the time, from where they are to others; the rest follows.

    See :class:`HeldPath` for the parameters.  Returns the position (n_q,) at the end.
    """
    path = HeldPath(system, start, fixed, end)
    if not path.length <= LONGEST:
        raise AssemblyError(f"the path from the reference position is too long ({path.length:.3g} rad or lengths)")
    timed = path.end != system.t
    continuation = Continuation(path, start, fewest=FEWEST if timed else 1)
    result = continuation.reach(1.0, TRIALS)
    if result is not None:
        return result.q
    last = continuation.points[-1]
    if timed:
        t = system.t + last.s * (path.end - system.t)
        raise AssemblyError(f"the path from t = {system.t:.6g} to t = {path.end:.6g} s is blocked at t = {t:.6g} s")
    if not continuation.blocked:
        raise AssemblyError(f"the path has too many bends: {TRIALS} steps cover {100 * last.s:.0f} % of it")
    raise AssemblyError(
        f"the path is blocked after {100 * last.s:.0f} % of it: the loops cannot close there, or the mechanism jumps, "
        "as at a dead centre of the prescribed coordinate; prescribe another one, or give a position beyond it"
    )


# -- places along a curve ----------------------------------------------------------------------------------------------


GOLDEN = 0.3819660112501051
SECTIONS = 60  #: of one search, at most


def find_root(value: Callable[[float], float], a: float, b: float, fa: float, fb: float) -> float:
    """A root between two places with values of different sign.

    Illinois' form of the regula falsi (M. Dowell, P. Jarratt, BIT 11 (1971), 168-174), to four roundings.
    """
    for _ in range(SECTIONS):
        c = b - fb * (b - a) / (fb - fa) if fb != fa else 0.5 * (a + b)
        fc = value(c)
        near, a, fa = abs(c - b), *((b, fb) if fb * fc < 0.0 else (a, 0.5 * fa))
        b, fb = c, fc
        if not abs(fb) > 0.0 or near <= 4.0 * EPS * (1.0 + abs(b)):
            break
    return b


def find_least(value: Callable[[float], float], left: float, right: float, width: float) -> float:
    """Where a value is least between two places, to a width, or 0.  Golden section."""
    at = 0.5 * (left + right)
    best = value(at)
    for _ in range(SECTIONS):
        if best <= 0.0 or abs(right - left) <= width:
            break
        low = abs(at - left) > abs(right - at)
        t = at + GOLDEN * ((left if low else right) - at)
        result = value(t)
        if result < best:
            left, right = (left, at) if low else (at, right)
            best, at = result, t
        else:
            left, right = (t, right) if low else (left, t)
    return at
