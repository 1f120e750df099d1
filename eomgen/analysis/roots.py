"""Analysis: a function of one number and a change of its sign -> the place where it is 0."""

from __future__ import annotations

from collections.abc import Callable

from ..limits.rounding import NEXT

STEPS = 100


def find_root(value: Callable[[float], float], low: float, high: float, f_low: float, f_high: float) -> float:
    """A root between two places with values of different sign, by the Illinois method and bisection.

    (Dowell and Jarratt, BIT 11 (1971) 168; a step that does not halve the bracket in three is followed by a bisection.)
    """
    if f_low == 0.0:
        return low
    widths = [abs(high - low)] * 3
    for _ in range(STEPS):
        if f_high == 0.0 or abs(high - low) <= NEXT * max(abs(high), abs(low)):
            break
        s = high - f_high * (high - low) / (f_high - f_low)
        if abs(high - low) > 0.5 * widths[0] or not min(low, high) < s < max(low, high):
            s = 0.5 * (low + high)
        f = value(s)
        if f * f_high < 0.0 or f == 0.0:
            low, f_low = high, f_high
        else:
            f_low *= 0.5
        high, f_high = s, f
        widths = [*widths[1:], abs(high - low)]
    return high
