"""The motion of prescribed coordinates is followed as a curve, through singular positions too.

The system is C(q, t) = 0 with y(q) = the led values, as many as there are degrees of freedom (Haug, Computer Aided
Kinematics and Dynamics of Mechanical Systems, ch. 3): its scaled Jacobian K = [C_q; y_q] has full column rank but at
singular positions, where the led coordinates do not determine the motion.

At a singular position Newton's iteration fails and beside it digits are lost, though the branch that is followed runs
through smoothly.  Hermite's polynomial through two good points on either side has both; its error falls with the
eighth power of their distance (Stoer and Bulirsch, Introduction to Numerical Analysis, sec. 2.1.5).

At a singular position a motion is possible while the led coordinates (and the drivers) stand still.  Either the branch
goes on through it, beside others (a change point: the sign of det K changes), or the led coordinates turn back there (a
stop: a dead centre of theirs, the end of the mechanism's reach).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.polynomial import polynomial

from ...base import algebra
from ...base.algebra import Array
from ...base.assembly import ClosureSystem, ConstraintSystem, WantedValues, close, closed
from ...base.continuation import (
    ASTRAY,
    SECTIONS,
    Continuation,
    Point,
    StraightPath,
    Tangent,
    find_least,
    find_root,
    interpolate,
)
from ...base.limits.constraints import CONVERGED
from ...base.limits.positions import ALIGNED, JUMPS, NULL, POOR, SAME, SINGULAR, UNJUDGED
from ...base.limits.positions import ASTRAY as ASTRAY_ACROSS
from ...base.scales import Scales, largest
from ...errors import EomgenError
from ..kernels import constraint_system

if TYPE_CHECKING:
    from ..bound_model import BoundModel


# -- prescribed coordinates --------------------------------------------------------------------------------------------


STEPS = 25  #: Newton steps


class DrivenCoordinates:
    """Solves for the motion of a bound module whose driven coordinates are as many as its degrees of freedom.

    They are of the tree or of cut joints.
    """

    def __init__(self, module: BoundModel, driven: Sequence[str]) -> None:
        self.module, self.led = module, tuple(driven)
        self.layout = layout = module.layout
        self.scales = layout.scales
        kernels = module.kernels
        self.system: ConstraintSystem = constraint_system(kernels)
        self._rate = kernels.kernel("velocity_constraints", nan=True)
        known = layout.rank and "kinematics" in kernels.core.names
        self._kinematics = kernels.kernel("kinematics", nan=True) if known else None
        self._loops = kernels.loop_coordinates if layout.n_loop_coordinates else None
        chosen = [layout.velocity_labels[i] for i in layout.independent]
        #: whether the compiled kernel leads the same coordinates
        self.direct = self._kinematics is not None and list(driven) == chosen and set(chosen) <= set(layout.q)
        wanted = self.system.wanted(dict.fromkeys(driven, 0.0), self.led)
        nothing = WantedValues(lambda q: (np.empty(0), np.empty((0, layout.n_v))), np.empty(0), np.empty(0), [], [])
        self._wanted = nothing if wanted is None else wanted
        self.led_scales, self.wraps = self._wanted.scales, np.array(self._wanted.angles, dtype=bool)
        self._zero = np.zeros(layout.n_v)
        independent = layout.rows if layout.rank else np.empty(0, dtype=np.intp)
        self._square = np.concatenate([independent, layout.n_c + np.arange(len(driven))]).astype(np.intp)

    # positions

    def prescribed_values(self, q: Array, t: float) -> Array:
        """y (k,) at a position."""
        return self.system.at(t).measure(self.led, q)[0]

    def equations(self, t: float, y: Array) -> WantedValues:
        """The led coordinates as equations."""
        measure = self.system.at(t).measure
        return self._wanted._replace(evaluate=lambda q: measure(self.led, q), values=y)

    def closure(self, t: float, y: Array) -> ClosureSystem:
        """The constraints and the led coordinates, all of them as equations."""
        return ClosureSystem(self.system.at(t).position, self.scales, np.ones(self.layout.n_v), self.equations(t, y))

    def matrix(self, q: Array, t: float) -> Array:
        """K (n_c + k, n_v), scaled."""
        return self.closure(t, self._wanted.values).evaluate(q)[1]

    def position(self, t: float, y: Array, guess: Array) -> Array | None:
        """The closed position (n_q,) next to a guess; None if Newton's iteration finds none."""
        if self.direct:
            assert self._kinematics is not None
            still = np.zeros(2 * len(y))
            q = self._kinematics(np.concatenate([y, still, guess]), t=t)[: self.layout.n_q]
            return q if np.isfinite(q).all() else None
        q, residual = close(self.closure(t, y), guess, STEPS, damping=None)
        return q if closed(residual) else None

    # motion

    def solve(self, t: float, y: Array, t1: float, y1: Array, guess: Array) -> tuple[Array, Tangent] | None:
        """The closed position next to a guess, and dq/ds there where dt/ds = t1 and dy/ds = y1."""
        q = self.position(t, y, guess)
        return None if q is None else (q, self.tangent(t, q, t1, y1))

    def right(self, q: Array, t: float, t1: float, y1: Array) -> Array:
        """Scaled right-hand side of K v = [-C_t t1; y1] where dt/ds = t1 and dy/ds = y1."""
        C_t = np.zeros(self.layout.n_c)
        if t1 and self.layout.n_c:
            C_t = self._rate(np.concatenate([q, self._zero]), t=t)
        return np.concatenate([-t1 * self.scales.residual(C_t), y1 / self.led_scales])

    def tangent(self, t: float, q: Array, t1: float, y1: Array) -> Tangent:
        """dq/ds where dt/ds = t1 and dy/ds = y1."""
        K = self.matrix(q, t)
        if not len(q):  # nothing moves, and no singular value says so
            return Tangent(q, 1.0, 1.0, q, np.zeros(len(K)))
        U, S, V = algebra.svd(K, full_matrices=False)
        right = U.T @ self.right(q, t, t1, y1)
        small = NULL * S[0]
        rate = V.T @ np.divide(right, S, out=np.zeros_like(S), where=small < S)
        square = K[self._square]
        sign = float(np.linalg.slogdet(square)[0]) if len(square) == len(V) else 1.0
        return Tangent(self.scales.q * rate, float(S[-1] / S[0]), sign, V[-1], U[:, -1])

    def motion(self, t: float, q: Array, y1: Array, y2: Array) -> tuple[Array, Array]:
        """v, a (n_v,) in real time at a closed position, where y' = y1 and y'' = y2; NaN where they are not defined."""
        layout = self.layout
        n_q, n = layout.n_q, layout.n_v
        if self.direct:
            assert self._kinematics is not None
            result = self._kinematics(np.concatenate([self.prescribed_values(q, t), y1, y2, q]), t=t)
            return result[n_q : n_q + n], result[n_q + n :]
        K = self.matrix(q, t)
        v = self.scales.q * algebra.lstsq(K, self.right(q, t, 1.0, y1), rcond=NULL)
        a = self._some_acceleration(t, q, v)
        loops = () if self._loops is None else self._loops(q, v, a, t=t)[2]
        rates = dict(zip((*layout.velocity_labels, *layout.loops), (*a, *loops), strict=True))
        gap = y2 - np.array([rates[name] for name in self.led])
        right = np.concatenate([np.zeros(layout.n_c), gap / self.led_scales])
        a = a + self.scales.q * algebra.lstsq(K, right, rcond=NULL)
        return v, a

    def motions(self, t: Array, y: Array, y1: Array, y2: Array, guesses: Array) -> tuple[Array, Array, Array]:
        """q, v, a (n, k) of many points from guesses (n_q, k); NaN where none is found.  For ``direct`` only."""
        assert self._kinematics is not None
        result = self._kinematics(np.concatenate([y, y1, y2, guesses]), t=t)
        n_q, n = self.layout.n_q, self.layout.n_v
        return result[:n_q], result[n_q : n_q + n], result[n_q + n :]

    def _some_acceleration(self, t: float, q: Array, v: Array) -> Array:
        """An acceleration that fits the constraints, whatever the led coordinates do."""
        layout = self.layout
        if self._kinematics is None:
            return np.zeros(layout.n_v)
        chosen = layout.independent
        if len(layout.independent_q) == len(chosen):
            x = np.concatenate([q[layout.independent_q], v[chosen], np.zeros(len(chosen)), q])
            a = self._kinematics(x, t=t)[layout.n_q + layout.n_v :]
            if np.isfinite(a).all():
                return a
        try:  # the compiled partition is singular here; any dynamics will do
            return self.module.rhs(t, np.concatenate([q, v]))[layout.n_q :]
        except EomgenError:
            return np.full(layout.n_v, np.nan)


class DrivenPath(StraightPath):
    """A straight path of a driven mechanism."""

    driven: DrivenCoordinates

    def along(self, s: float, q: Array, direction: Array) -> tuple[float, Array, Array] | None:
        """The point next to a guess at right angles to a direction (n_v + 1,) of scaled motion and s, and the direction
        of the curve there: where s turns back, too.  None if Newton's iteration finds none.
        """
        for _ in range(STEPS):
            t, y = self.at(s)
            e, K = self.driven.closure(t, y).evaluate(q)
            rows = np.column_stack([K, -self.driven.right(q, t, self.t1, self.y1)])
            if not np.isfinite(rows).all() or not np.isfinite(e).all():
                return None
            step = -algebra.lstsq(np.vstack([rows, direction]), np.append(e, 0.0), rcond=NULL)
            q, s = self.scales.move(q, step[:-1]), s + float(step[-1])
            if largest(step) <= CONVERGED:
                there = algebra.svd(rows)[2][-1]
                return s, q, there * float(np.sign(there @ direction))
        return None


class DrivenContinuation(Continuation):
    """A continuation along such a path."""

    curve: DrivenPath


# -- across a change point ---------------------------------------------------------------------------------------------


REACH = 0.05  #: scaled motion from the middle of an interpolant to its inner supports


class ChangePointInterpolant:
    """The polynomial through points of a continuation and their directions.

    Parameters
    ----------
    supports : sequence of Point
        In order of s.
    """

    def __init__(self, supports: Sequence[Point], scales: Scales) -> None:
        self.supports, self.scales = supports, scales
        first, last = supports[0].s, supports[-1].s
        self.middle, self.half = 0.5 * (first + last), 0.5 * (last - first)
        x, unit = self._place(np.array([p.s for p in supports])), np.eye(2 * len(supports))
        rows = np.concatenate([polynomial.polyval(x, unit).T, polynomial.polyval(x, polynomial.polyder(unit)).T])
        slopes = [self.half * scales.rates(p.q, p.tangent.rate) for p in supports]
        value = algebra.solve(rows, np.array([*(p.q for p in supports), *slopes]))
        self.orders = value, polynomial.polyder(value) / self.half, polynomial.polyder(value, 2) / self.half**2

    def _place(self, s: Any) -> Any:
        return (s - self.middle) / self.half

    def covers(self, s: float) -> bool:
        """Whether s lies between the outer supports."""
        return bool(self.supports[0].s <= s <= self.supports[-1].s)

    def at(self, s: float) -> tuple[Array, Array, Array]:
        """q (n_q,), dq/ds and its derivative as velocities (n_v,)."""
        q, first, second = (polynomial.polyval(self._place(s), order) for order in self.orders)
        space = self.scales.space
        if space is None:
            return q, first, second
        return space.normalized(q), space.velocities(q, first), space.velocities(q, second)


def build_interpolant(
    continuation: DrivenContinuation, before: Point, after: Point, middle: float
) -> ChangePointInterpolant | None:
    """An interpolant over s = middle from good points about it; None where a side is missing.

    Parameters
    ----------
    before, after : Point
        Good points of one smooth branch, on either side of ``middle``.
    """
    scales = continuation.scales
    rate = max(largest(before.tangent.rate / scales.q), largest(after.tangent.rate / scales.q))
    if rate == 0.0 or not before.s < middle < after.s:
        return None
    reach = REACH / rate
    rough = ChangePointInterpolant([before, after], scales)
    supports = []
    for part in (-2.0, -1.0, 1.0, 2.0):
        s = middle + part * reach
        guess = rough.at(s)[0] if rough.covers(s) else _guess_along(continuation, rough, s)
        result = None if guess is None else continuation.curve.solve(s, guess)
        if result is None:
            return None
        supports.append(result)
    interpolant = ChangePointInterpolant(supports, scales)
    for near in (before, after):  # one branch, or several?
        if interpolant.covers(near.s) and largest(scales.distance(interpolant.at(near.s)[0], near.q)) > ASTRAY_ACROSS:
            return None
    return interpolant


def _guess_along(continuation: DrivenContinuation, rough: ChangePointInterpolant, s: float) -> Array | None:
    """A guess outside a rough interpolant, from the nearest points of the continuation or on from an end."""
    scales = continuation.scales
    near = min((*continuation.points, *rough.supports), key=lambda p: abs(p.s - s))
    return scales.move(near.q, near.tangent.rate * (s - near.s) / scales.q)


# -- singular positions ------------------------------------------------------------------------------------------------


LOW = 0.03  #: quality below which a minimum is looked into
SHARE = 0.2  #: of the largest part, from which a coordinate or row is named


class Singular(NamedTuple):
    """A singular position.

    Attributes
    ----------
    kind : {'change point', 'stop'}
    t : float
        Time (s).
    values : dict
        Led coordinate -> its value there.
    q : (n_q,) array
    moving : tuple of str
        Coordinates that can move while the led ones stand still.
    joints : tuple of str
        Joints and constraints whose equations do not hold that motion.
    """

    kind: str
    t: float
    values: Mapping[str, float]
    q: Array
    moving: tuple[str, ...]
    joints: tuple[str, ...]

    @property
    def facts(self) -> dict[str, Any]:
        """All but the position."""
        return {name: value for name, value in self._asdict().items() if name != "q"}

    def __str__(self) -> str:
        place = ", ".join([f"{name} = {value:.9g}" for name, value in self.values.items()] or [f"t = {self.t:.9g} s"])
        if self.kind == "stop":
            what = f"{', '.join(self.values) or 'the drivers'} can go no further"
        else:
            what = "the motion may branch"
        joints = f" (joints {', '.join(self.joints)})" if self.joints else ""
        return f"{self.kind} at {place}: {what}; {', '.join(self.moving)} can still move{joints}"


def name_singular(driven: DrivenCoordinates, kind: str, t: float, q: Array, tangent: Tangent) -> Singular:
    """Put names to a singular position."""
    layout = driven.layout
    free = np.abs(tangent.free)
    moving = tuple(layout.velocity_labels[i] for i in np.flatnonzero(free >= SHARE * free.max()))
    rows = np.abs(tangent.rows[: layout.n_c])
    labels = [layout.constraint_labels[i] for i in np.flatnonzero(rows >= SHARE * np.abs(tangent.rows).max())]
    joints = tuple(dict.fromkeys(label.partition(".")[0] for label in labels))
    values = dict(zip(driven.led, driven.prescribed_values(q, t).tolist(), strict=True))
    return Singular(kind, t, values, q, moving, joints)


def find_singular(
    continuation: DrivenContinuation, before: Point, after: Point
) -> tuple[ChangePointInterpolant, float] | None:
    """The interpolant over a change point between two points, and where on it K is singular; None if it is nowhere.

    There det K changes its sign, or the quality has a minimum.
    """
    path = continuation.curve
    rough = ChangePointInterpolant([before, after], continuation.scales)
    interpolant = build_interpolant(continuation, before, after, _most_singular(path, rough, before.s, after.s))
    if interpolant is None:
        return None
    middle = _most_singular(path, interpolant, interpolant.supports[1].s, interpolant.supports[2].s)
    quality = path.driven.tangent(path.at(middle)[0], interpolant.at(middle)[0], 0.0, path.y1).quality
    return (interpolant, middle) if quality < SINGULAR else None


def _most_singular(path: DrivenPath, interpolant: ChangePointInterpolant, low: float, high: float) -> float:
    """Where on an interpolant the signed quality is 0, or its magnitude least if it keeps its sign."""

    def signed(s: float) -> float:
        tangent = path.tangent(s, interpolant.at(s)[0])
        return tangent.sign * tangent.quality

    f_low, f_high = signed(low), signed(high)
    if f_low * f_high < 0.0:
        return find_root(signed, low, high, f_low, f_high)
    return find_least(lambda s: abs(signed(s)), low, high, (high - low) * 0.6**SECTIONS)


def find_stop(path: DrivenPath, last: Point) -> Point:
    """The stop of a blocked continuation to full precision, where s turns back: a root of its rate along the arc."""
    start = path.along(last.s, last.q, np.append(last.tangent.rate / path.scales.q, 1.0))
    if start is None:
        return last
    s, q, direction = start

    def ahead(h: float) -> tuple[float, Array, Array] | None:
        return path.along(s + h * direction[-1], path.scales.move(q, h * direction[:-1]), direction)

    def rate(h: float) -> float:
        there = ahead(h)
        return float("nan") if there is None else float(there[2][-1])

    for h in JUMPS:
        if (end := rate(h)) < 0.0 < direction[-1]:
            result = ahead(find_root(rate, 0.0, h, float(direction[-1]), end))
            length = max(abs(path.t1), largest(path.y1 / path.driven.led_scales))  # scaled, of a step of 1 in s
            if result is not None and abs(result[0] - last.s) * length < UNJUDGED:
                s, q, _ = result
                return Point(s, q, path.tangent(s, q))
    return last


def find_change_points(
    continuation: DrivenContinuation,
) -> tuple[list[tuple[ChangePointInterpolant, float]], list[Singular]]:
    """Interpolants over the change points of a continuation, and the change points themselves, in order."""
    path = continuation.curve
    jumped = {id(before) for before, _ in continuation.jumps}
    points = continuation.points
    crossings: list[tuple[ChangePointInterpolant, float]] = []
    for k in range(len(points) - 1):
        before, after = points[k], points[k + 1]
        here = None
        if id(before) in jumped or before.tangent.sign != after.tangent.sign:
            here = find_singular(continuation, _good(points, before, after) if id(before) in jumped else before, after)
        elif k + 2 < len(points) and _dips(points[k : k + 3]):
            here = find_singular(continuation, before, points[k + 2])
        if here is not None:
            crossings.append(here)
    result = []
    for interpolant, middle in crossings:
        q = interpolant.at(middle)[0]
        result.append(name_singular(path.driven, "change point", path.at(middle)[0], q, path.tangent(middle, q)))
    return crossings, result


def _dips(points: Sequence[Point]) -> bool:
    """Whether the quality has a low minimum at the second of three points, without a change of sign."""
    first, middle, last = (p.tangent for p in points)
    low = middle.quality < LOW and middle.quality < first.quality and middle.quality <= last.quality
    return low and first.sign == middle.sign == last.sign


def _good(points: Sequence[Point], before: Point, after: Point) -> Point:
    """The last point before a jump that is not too near to the singular position."""
    width = after.s - before.s
    return next(
        (p for p in reversed(points) if p.s <= before.s - 0.5 * width and p.tangent.quality > 0.01 * JUMPS[0]),
        points[0],
    )


# -- the path ----------------------------------------------------------------------------------------------------------


class FollowedPath:
    """A continuation from s = 0 to ``end``, or as far as it goes.

    ``extent`` is that of :class:`~...base.continuation.Continuation`.

    Attributes
    ----------
    reached : float
        The last s that can be reached.
    stop : Singular or None
        What is there, if it is before the end.
    singular : list of Singular
        Change points on the way.
    """

    def __init__(self, path: DrivenPath, start: Array, end: float, extent: float = 0.0) -> None:
        self.path, self.end = path, end
        self.driven = driven = path.driven
        self.continuation = continuation = DrivenContinuation(path, start, extent)
        whole = continuation.to(end)
        self.interpolants, self.singular = find_change_points(continuation)
        self.stop: Singular | None = None
        self.reached = end
        if not whole:
            last = find_stop(path, continuation.points[-1])
            self.reached = last.s
            self.stop = name_singular(driven, "stop", path.at(last.s)[0], last.q, last.tangent)
        self.nodes = np.array([p.s for p in continuation.points])

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
            result = q[:, j], v[:, j], a[:, j]
            q[:, j], v[:, j], a[:, j] = self._one(float(s[j]), guesses[:, j], y1[:, j], y2[:, j], result)
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
        self, s: float, guess: Array, y1: Array, y2: Array, result: tuple[Array, Array, Array]
    ) -> tuple[Array, Array, Array]:
        """The motion at one parameter; ``result`` is that of the compiled kernel, if it leads the same coordinates."""
        driven, scales = self.driven, self.driven.scales
        if self.stop is not None and s >= self._edge:
            nothing = np.full(len(scales.q), np.nan)
            return self.stop.q, nothing, nothing
        t = self.path.at(s)[0]
        interpolant = next((b for b, _ in self.interpolants if b.supports[1].s < s < b.supports[2].s), None)
        if interpolant is not None and driven.tangent(t, interpolant.at(s)[0], 0.0, self.path.y1).quality < POOR:
            return self._interpolated(interpolant, s, y1, y2)
        q, v, a = result
        if not driven.direct or not np.isfinite(q).all() or largest(scales.distance(q, guess)) > ASTRAY:
            q = self._closer(s, guess)
            v, a = driven.motion(t, q, y1, y2)
        return q, v, a

    def _closer(self, s: float, guess: Array) -> Array:
        """The position next to a guess, followed to from the nearest point if Newton's iteration goes astray."""
        driven, scales = self.driven, self.driven.scales
        result = driven.position(*self.path.at(s), guess)
        if result is not None and largest(scales.distance(result, guess)) <= ASTRAY:
            return result
        before = self._neighbours(s)[0] if len(self.nodes) > 1 else self.continuation.points[0]
        t, y = self.path.at(before.s)
        short = DrivenContinuation(self.path._replace(t=t, y=y), before.q)
        short.to(s - before.s)
        return short.points[-1].q

    def _interpolated(
        self, interpolant: ChangePointInterpolant, s: float, y1: Array, y2: Array
    ) -> tuple[Array, Array, Array]:
        """The motion at or beside a change point, where it must run along the path."""
        q, first, second = interpolant.at(s)
        path = self.path.y1
        speed, gain = 1.0 / (self.path.t1 or 1.0), 0.0
        if not self.path.t1:
            k = int(np.argmax(np.abs(path / self.driven.led_scales)))
            speed, gain = y1[k] / path[k], y2[k] / path[k]
        if np.allclose(y1, speed * path, rtol=ALIGNED) and np.allclose(y2, gain * path, rtol=ALIGNED):
            return q, speed * first, speed**2 * second + gain * first
        nothing = np.full_like(first, np.nan)
        return q, nothing, nothing
