"""Points of a table -> slopes at the points.

C. de Boor, *A Practical Guide to Splines* (1978), chapter IV: the interpolating spline by its slopes, a tridiagonal
system.  The monotone slopes are those of F. N. Fritsch and J. Butland, A method for constructing local monotone
piecewise cubic interpolants, SIAM J. Sci. Stat. Comput. 5 (1984), with the one-sided ends of C. Moler, *Numerical
Computing with MATLAB* (2004), section 3.6.
"""

from __future__ import annotations

import numpy as np

from . import algebra

Array = np.ndarray


def slopes(x: Array, y: Array, kind: str) -> Array:
    """Slopes at the points x (n,), strictly increasing, of values y (n,), or (n, k) of k tables but for ``monotone``.

    The kind is that of a table, 'cubic', 'natural', 'periodic' or 'monotone'; see :data:`~eomgen.model.fields.TABLES`.
    """
    h = np.diff(x)
    rise = np.diff(y, axis=0) / h.reshape(-1, *[1] * (y.ndim - 1))
    if kind == "monotone":
        return _monotone(h, rise)
    if len(x) == 2:
        return np.concatenate([rise, rise])
    if kind == "periodic":
        return _periodic(h, rise)
    n = len(x)
    lower, diagonal, upper = np.zeros(n), np.zeros(n), np.zeros(n)
    right = np.zeros_like(y, dtype=float)
    lower[1:-1], upper[1:-1], diagonal[1:-1] = h[1:], h[:-1], 2.0 * (h[:-1] + h[1:])
    a, b = (part.reshape(-1, *[1] * (y.ndim - 1)) for part in (h[:-1], h[1:]))
    right[1:-1] = 3.0 * (b * rise[:-1] + a * rise[1:])
    if kind == "natural":
        diagonal[0], upper[0], right[0] = 2.0, 1.0, 3.0 * rise[0]
        diagonal[-1], lower[-1], right[-1] = 2.0, 1.0, 3.0 * rise[-1]
    elif n == 3:  # one parabola through three points
        curvature = (rise[1] - rise[0]) / (h[0] + h[1])
        return np.stack([rise[0] - h[0] * curvature, rise[0] + h[0] * curvature, rise[1] + h[1] * curvature])
    else:
        d, e = h[0] + h[1], h[-1] + h[-2]
        diagonal[0], upper[0] = h[1], d
        right[0] = ((h[0] + 2.0 * d) * h[1] * rise[0] + h[0] ** 2 * rise[1]) / d
        diagonal[-1], lower[-1] = h[-2], e
        right[-1] = (h[-1] ** 2 * rise[-2] + (2.0 * e + h[-1]) * h[-2] * rise[-1]) / e
    return _solve_tridiagonal(lower, diagonal, upper, right)


def _solve_tridiagonal(lower: Array, diagonal: Array, upper: Array, right: Array) -> Array:
    """Elimination without exchanges: the matrices here are diagonally dominant after the first row."""
    pivot, x = diagonal.copy(), right.copy()
    for i in range(1, len(pivot)):
        factor = lower[i] / pivot[i - 1]
        pivot[i] -= factor * upper[i - 1]
        x[i] -= factor * x[i - 1]
    x[-1] /= pivot[-1]
    for i in range(len(pivot) - 2, -1, -1):
        x[i] = (x[i] - upper[i] * x[i + 1]) / pivot[i]
    return x


def _periodic(h: Array, rise: Array) -> Array:
    """The corners of the cyclic matrix are taken apart (Sherman and Morrison)."""
    n = len(h)
    before = np.roll(h, 1)
    tail = [1] * (rise.ndim - 1)
    right = 3.0 * (h.reshape(-1, *tail) * np.roll(rise, 1, axis=0) + before.reshape(-1, *tail) * rise)
    lower, diagonal, upper = h.copy(), 2.0 * (before + h), before.copy()
    if n == 2:  # both neighbours of a point are the other one
        matrix = np.array([[diagonal[0], lower[0] + upper[0]], [lower[1] + upper[1], diagonal[1]]])
        s = algebra.solve(matrix, right)
    else:
        corner_top, corner_bottom = lower[0], upper[-1]  # of unknown n - 1 in row 0, of unknown 0 in row n - 1
        gamma = -diagonal[0]
        diagonal[0] -= gamma
        diagonal[-1] -= corner_top * corner_bottom / gamma
        u = np.zeros(n)
        u[0], u[-1] = gamma, corner_bottom
        p, q = _solve_tridiagonal(lower, diagonal, upper, right), _solve_tridiagonal(lower, diagonal, upper, u)
        v = corner_top / gamma
        s = p - np.multiply.outer(q, (p[0] + v * p[-1]) / (1.0 + q[0] + v * q[-1]))
    return np.concatenate([s, s[:1]])


def _monotone(h: Array, rise: Array) -> Array:
    if len(h) == 1:
        return np.concatenate([rise, rise])
    s = np.zeros(len(h) + 1)
    w1, w2 = 2.0 * h[1:] + h[:-1], h[1:] + 2.0 * h[:-1]
    same = np.sign(rise[:-1]) * np.sign(rise[1:]) > 0.0
    a, b = np.where(same, rise[:-1], 1.0), np.where(same, rise[1:], 1.0)
    s[1:-1] = np.where(same, (w1 + w2) / (w1 / a + w2 / b), 0.0)
    s[0] = _end(h[0], h[1], rise[0], rise[1])
    s[-1] = _end(h[-1], h[-2], rise[-1], rise[-2])
    return s


def _end(h0: float, h1: float, r0: float, r1: float) -> float:
    """Three-point slope at an end, cut so that the shape is kept."""
    d = ((2.0 * h0 + h1) * r0 - h0 * r1) / (h0 + h1)
    if np.sign(d) != np.sign(r0):
        return 0.0
    if np.sign(r0) != np.sign(r1) and abs(d) > 3.0 * abs(r0):
        return float(3.0 * r0)
    return float(d)


def cubic_piece(y0: Array, y1: Array, d0: Array, d1: Array, s: Array) -> Array:
    """The cubic from y0 to y1 at places s from 0 to 1, with derivatives d0 and d1 by s at its ends (Hermite)."""
    return np.asarray(y0 + s * (d0 + s * (3.0 * (y1 - y0) - 2.0 * d0 - d1 + s * (2.0 * (y0 - y1) + d0 + d1))))


def curve_coefficients(x: Array, y: Array, s: Array, linear: bool) -> Array:
    """Coefficients (n + 1, 4) of :class:`~eomgen.expr.functions.Curve` from values and slopes at the points."""
    h = np.diff(x)
    rise = np.diff(y) / h
    t = (s[:-1] + s[1:] - 2.0 * rise) / h
    inside = np.stack([t / h, (rise - s[:-1]) / h - t, s[:-1], y[:-1]], axis=1)
    first = [0.0, 0.0, s[0] if linear else 0.0, y[0]]
    last = [0.0, 0.0, s[-1] if linear else 0.0, y[-1]]
    return np.concatenate([[first], inside, [last]])
