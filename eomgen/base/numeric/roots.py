"""A function of one number -> where it is 0, and where it is least."""

from __future__ import annotations

from collections.abc import Callable
from math import isnan

from ..limits.numbers import EPS

STEPS = 100  #: of one search for a root
GOLDEN = 0.3819660112501051
SECTIONS = 60  #: of one search for a minimum


def find_root(value: Callable[[float], float], a: float, b: float, fa: float, fb: float) -> float:
    """A root between two places with values of different sign; the last place where the value is no number.

    R. P. Brent, Algorithms for Minimization without Derivatives, 1973, chapter 4; to four roundings.
    """
    if fa == 0.0:
        return a
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
        fb = value(b)
        if isnan(fb):
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
        found = value(t)
        if found < best:
            left, right = (left, at) if low else (at, right)
            best, at = found, t
        else:
            left, right = (t, right) if low else (left, t)
    return at
