"""Analysis: one contact in space that closes -> its impulses, by the direction in which it slides after the impact.

Friction opposite to the direction u = (cos a, sin a) is P = P_n w, w = (1, -mu u).  The normal law y_n+ = 0 gives

    P_n = -c_n / D,    D = W_n w,    y_t+ = c_t + P_n W_t w,

and y_t+ must lie along u: F(a) = u x (D c_t - c_n W_t w) = 0, a sum of cosines and sines of a and 2 a, so of the fourth
degree in z = exp(i a).  All directions are found, where iterations for the impulses themselves may lead nowhere.
"""

from __future__ import annotations

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.numbers import EPS
from ..numeric.contact_problem import ContactProblem

SAMPLES = 8  #: of a sum of waves up to those of 2 a: 5 or more determine it
ORDERS = np.array([2, 1, 0, -1, -2])  #: of its waves exp(i n a)
POLISHED = 3  #: Newton's iterations for the angle of a root, 1e-8 where two roots are near


def impulses_in_space(problem: ContactProblem, tolerance: float) -> Array | None:
    """Impulses (1, 3) of a contact that slides, or holds, up to a residual (m/s); None where it can do neither.

    Of several those that take most energy from the velocities c.
    """
    W, c, mu = problem.W, problem.c[0], float(problem.mu[0])
    found = [-algebra.lstsq(W, c)]
    for a in _angles(W, c, mu).tolist():
        w = np.array([1.0, -mu * np.cos(a), -mu * np.sin(a)])
        gives = float(W[0] @ w)
        if gives * -c[0] > 0.0:
            found.append(-c[0] / gives * w)
    fit = [P for P in found if problem.size(problem.misses(P[None])[0]) <= tolerance]
    return min(fit, key=lambda P: float(P @ (c + 0.5 * W @ P)))[None] if fit else None


def _angles(W: Array, c: Array, mu: float) -> Array:
    """Zeros of F, among them all directions in which the contact can slide."""
    a = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    u = np.array([np.cos(a), np.sin(a)])
    moved = W @ np.vstack([np.ones(SAMPLES), -mu * u])
    y = moved[0] * c[1:, None] - c[0] * moved[1:]
    waves = (np.fft.fft(u[0] * y[1] - u[1] * y[0]) / SAMPLES)[ORDERS]
    orders = ORDERS if abs(waves[0]) > EPS * np.abs(waves).max() else ORDERS[1:-1]
    waves = waves[2 - orders]
    if not abs(waves[0]) > 0.0:
        return np.zeros(0)
    companion = np.eye(len(waves) - 1, k=-1, dtype=complex)
    companion[0] = -waves[1:] / waves[0]
    angles = np.angle(algebra.eigvals(companion))
    for _ in range(POLISHED):
        each = waves * np.exp(1j * np.outer(angles, orders))
        value, slope = each.sum(axis=1).real, (1j * orders * each).sum(axis=1).real
        angles = angles - np.where(np.abs(slope) > np.abs(value), value / np.where(slope == 0.0, 1.0, slope), 0.0)
    return np.asarray(angles)
