"""A function of one number -> where it is 0, and where it is least.

Each search yields the places at which it wants the value, so that many of them can be asked for together.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from math import isnan
from typing import TypeVar

from ..base.limits.numbers import EPS

STEPS = 100  #: of one search for a root
GOLDEN = 0.3819660112501051
SECTIONS = 60  #: of one search for a minimum

Found = TypeVar("Found")
#: Yields places, is sent the value of one function there, and returns what it looked for.
Search = Generator[float, float, Found]


def search_root(a: float, b: float, fa: float, fb: float) -> Search[tuple[float, float, float, float]]:
    """A root between two places with values of different sign and the value there, and the same of its other side.

    It ends where the value is no number.  R. P. Brent, Algorithms for Minimization without Derivatives, 1973,
    chapter 4; to four roundings.
    """
    c, fc, d = a, fa, b - a
    e = d
    for _ in range(STEPS):
        if fb * fc > 0.0:
            c, fc, d = a, fa, b - a
            e = d
        if abs(fc) < abs(fb):
            a, b, c = b, c, b
            fa, fb, fc = fb, fc, fb
        tolerance, m = 2.0 * EPS * (1.0 + abs(b)), 0.5 * (c - b)
        if fb == 0.0 or abs(m) <= tolerance:
            break
        if abs(e) < tolerance or abs(fa) <= abs(fb):
            d = e = m
        else:
            s, q0, r = fb / fa, fa / fc, fb / fc
            p = 2.0 * m * s if a == c else s * (2.0 * m * q0 * (q0 - r) - (b - a) * (r - 1.0))
            q = 1.0 - s if a == c else (q0 - 1.0) * (r - 1.0) * (s - 1.0)
            q, p = (-q if p > 0.0 else q), abs(p)
            if 2.0 * p < 3.0 * m * q - abs(tolerance * q) and p < abs(0.5 * e * q):
                e, d = d, p / q
            else:
                d = e = m
        a, fa = b, fb
        b += d if abs(d) > tolerance else tolerance if m > 0.0 else -tolerance
        fb = yield b
        if isnan(fb):
            break
    return b, fb, c, fc


def search_least(
    left: float, at: float, right: float, best: float, width: float, below: bool = False, sense: float = 1.0
) -> Search[tuple[float, float]]:
    """The least of ``sense`` times a value, and where; or the first that is 0, or ``below`` 0.  Golden section."""
    for _ in range(SECTIONS):
        if best < 0.0 or (best == 0.0 and not below) or abs(right - left) <= width:
            break
        low = abs(at - left) > abs(right - at)
        t = at + GOLDEN * ((left if low else right) - at)
        value = sense * (yield t)
        if value < best:
            left, right = (left, at) if low else (at, right)
            best, at = value, t
        else:
            left, right = (t, right) if low else (left, t)
    return best, at


def carry_out(search: Search[Found], value: Callable[[float], float]) -> Found:
    """What a search finds of one function."""
    try:
        place = next(search)
        while True:
            place = search.send(value(place))
    except StopIteration as end:
        found: Found = end.value
        return found


def find_root(value: Callable[[float], float], low: float, high: float, f_low: float, f_high: float) -> float:
    """A root between two places with values of different sign."""
    return low if f_low == 0.0 else carry_out(search_root(low, high, f_low, f_high), value)[0]
