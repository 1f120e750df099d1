"""Analysis: a continuation past a singular position -> position, velocity and acceleration there, from both sides.

At a singular position Newton's iteration fails and beside it digits are lost, though the branch that is followed runs
through smoothly.  Hermite's polynomial through two good points on either side has both; its error falls with the
eighth power of their distance (Stoer and Bulirsch, Introduction to Numerical Analysis, sec. 2.1.5).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.algebra import Array
from ..base.limits.analyses import ASTRAY
from ..numeric.curves import Point
from ..numeric.projection import largest
from ..numeric.scales import Scales
from .driven_coordinates import DrivenContinuation

REACH = 0.05  #: scaled motion from the middle of an interpolant to its inner supports


class ChangePointInterpolant:
    """A polynomial through points of a continuation.

    Parameters
    ----------
    supports : sequence of Point
        In order of s.
    scales : Scales
    """

    def __init__(self, supports: Sequence[Point], scales: Scales) -> None:
        self.supports, self.scales = supports, scales
        self.nodes = np.repeat([p.s for p in supports], 2)
        slopes = np.array([scales.rates(p.q, p.tangent.rate) for p in supports])
        self.coefficients = divided(self.nodes, np.repeat([p.q for p in supports], 2, axis=0), slopes)

    def covers(self, s: float) -> bool:
        """Whether s lies between the outer supports."""
        return bool(self.nodes[0] <= s <= self.nodes[-1])

    def at(self, s: float) -> tuple[Array, Array, Array]:
        """q (n_q,), dq/ds and its derivative as velocities (n_v,)."""
        q, first, second = newton(self.nodes, self.coefficients, s)
        space = self.scales.space
        if space is None:
            return q, first, second
        return space.normalised(q), space.velocities(q, first), space.velocities(q, second)


def divided(nodes: Array, values: Array, slopes: Array) -> Array:
    """Divided differences of values at nodes, each of which comes twice and has one slope."""
    table = np.array(values, dtype=float)
    result = [table[0]]
    for order in range(1, len(nodes)):
        gap = nodes[order:] - nodes[:-order]
        fresh = np.empty((len(gap), table.shape[1]))
        for i, width in enumerate(gap):
            fresh[i] = slopes[i // 2] if width == 0.0 else (table[i + 1] - table[i]) / width
        table = fresh
        result.append(table[0])
    return np.array(result)


def newton(nodes: Array, coefficients: Array, s: float) -> tuple[Array, Array, Array]:
    """Newton's form by Horner's rule: value, first and second derivative."""
    value = np.array(coefficients[-1])
    first, second = np.zeros_like(value), np.zeros_like(value)
    for k in range(len(coefficients) - 2, -1, -1):
        x = s - nodes[k]
        second = second * x + 2.0 * first
        first = first * x + value
        value = value * x + coefficients[k]
    return value, first, second


def build_interpolant(
    continuation: DrivenContinuation, before: Point, after: Point, middle: float
) -> ChangePointInterpolant | None:
    """An interpolant over s = middle from good points about it; None where a side is missing.

    Parameters
    ----------
    continuation : Continuation
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
        guess = rough.at(s)[0] if rough.covers(s) else _along(continuation, rough, s)
        found = None if guess is None else continuation.curve.solve(s, guess)
        if found is None:
            return None
        supports.append(found)
    interpolant = ChangePointInterpolant(supports, scales)
    for near in (before, after):  # one branch, or several?
        if interpolant.covers(near.s) and largest(scales.distance(interpolant.at(near.s)[0], near.q)) > ASTRAY:
            return None
    return interpolant


def _along(continuation: DrivenContinuation, rough: ChangePointInterpolant, s: float) -> Array | None:
    """A guess outside a rough interpolant, from the nearest points of the continuation or on from an end."""
    scales = continuation.scales
    near = min((*continuation.points, *rough.supports), key=lambda p: abs(p.s - s))
    return scales.move(near.q, near.tangent.rate * (s - near.s) / scales.q)
