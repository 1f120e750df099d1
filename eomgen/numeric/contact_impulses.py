"""Stage numeric: compliance of contacts, velocities without impulses, friction -> impulses of rigid contacts.

Of each contact the impulse P = (P_n, P_t) and the velocity y = c + W P, less what the normal one is to be, obey

    0 <= P_n  _|_  y_n >= 0,      P_t in the disc of radius mu P_n, opposite to y_t on its edge where y_t is not 0

(Signorini and Coulomb).  Both are zeros of the natural maps of P. Alart, A. Curnier, A mixed formulation for frictional
contact problems prone to Newton like solution methods, Comput. Methods Appl. Mech. Eng. 92 (1991), 353-375,

    P_n - max(0, P_n - r y_n),      P_t - (P_t - s y_t) brought into the disc of radius mu max(0, P_n - r y_n),

which a Newton method with the derivatives of the branch at hand solves.  Where it leads nowhere, sweeps over single
contacts go on (M. Jean, The non-smooth contact dynamics method, Comput. Methods Appl. Mech. Eng. 177 (1999), 235-257).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import EvaluationError
from ..limits.rigid_contacts import BLURRED, HALVINGS, SWEEPS
from . import algebra
from .space import Array


class ContactImpulses(NamedTuple):
    """What was found."""

    impulses: Array  #: (m, d)
    iterations: int  #: Newton's, and sweeps
    residual: float  #: (m/s) the largest entry of both maps, as velocities


class ContactProblem:
    """Contacts of one instant.

    Parameters
    ----------
    compliance : (m d, m d) array
        W; d is 2 in the plane and 3 in space, the normal first.
    free : (m, d) array
        c (m/s).
    friction : (m,) array
        Coefficients, 0 or greater.
    """

    def __init__(self, compliance: Array, free: Array, friction: Array) -> None:
        self.W, self.c, self.mu = compliance, free, friction
        self.m, self.d = free.shape
        diagonal = np.diag(compliance).reshape(free.shape)
        self.normal = diagonal[:, 0]
        self.normal = np.where(self.normal > 0.0, self.normal, 1.0)
        across = diagonal[:, 1:].sum(axis=1)
        self.across = np.where(across > 0.0, across, 1.0)
        self.scales = np.concatenate([self.normal[:, None], np.repeat(self.across[:, None], self.d - 1, axis=1)], axis=1)

    def velocities(self, P: Array) -> Array:
        """y (m, d)."""
        return np.asarray(self.c + (self.W @ P.ravel()).reshape(self.c.shape))

    def misses(self, P: Array) -> tuple[Array, Array, Array]:
        """Both maps (m, d), P_n - r y_n (m,), and P_t - s y_t (m, d - 1)."""
        y = self.velocities(P)
        pressed = P[:, 0] - y[:, 0] / self.normal
        pulled = P[:, 1:] - y[:, 1:] / self.across[:, None]
        reach = self.mu * np.maximum(pressed, 0.0)
        size = np.sqrt((pulled * pulled).sum(axis=1))
        part = np.where(size > reach, reach / np.where(size > 0.0, size, 1.0), 1.0)
        found = np.empty(P.shape)
        found[:, 0] = P[:, 0] - np.maximum(pressed, 0.0)
        found[:, 1:] = P[:, 1:] - part[:, None] * pulled
        return found, pressed, pulled

    def size(self, misses: Array) -> float:
        """The largest entry as a velocity (m/s)."""
        return float(np.abs(misses * self.scales).max(initial=0.0))

    def step(self, P: Array, misses: Array, pressed: Array, pulled: Array) -> Array:
        """Newton's step (m, d)."""
        m, d = P.shape
        y_slopes = self.W.reshape(m, d, m * d)
        A = np.zeros((m, d, m * d))
        unit = np.eye(m * d).reshape(m, d, m * d)
        on = pressed > 0.0
        size = np.sqrt((pulled * pulled).sum(axis=1))
        reach = self.mu * np.maximum(pressed, 0.0)
        slides = on & (size >= reach)
        holds = on & ~slides
        A[~on] = unit[~on]
        A[on, 0] = y_slopes[on, 0] / self.normal[on, None] + BLURRED * unit[on, 0]
        A[holds, 1:] = y_slopes[holds, 1:] / self.across[holds, None, None] + BLURRED * unit[holds, 1:]
        for i in np.flatnonzero(slides):
            along = pulled[i] / size[i] if size[i] > 0.0 else np.zeros(d - 1)
            normal = unit[i, 0] - y_slopes[i, 0] / self.normal[i]
            moved = unit[i, 1:] - y_slopes[i, 1:] / self.across[i]
            A[i, 1:] = unit[i, 1:] - np.outer(self.mu[i] * along, normal)
            if d > 2 and size[i] > 0.0:
                A[i, 1:] -= reach[i] / size[i] * (moved - np.outer(along, along @ moved))
        return -algebra.solve(A.reshape(m * d, m * d), misses.ravel()).reshape(m, d)

    def sweep(self, P: Array) -> None:
        """Each contact for itself, one after the other, in place."""
        d, W = self.d, self.W
        for i in range(self.m):
            rows = slice(i * d, i * d + d)
            y = self.c[i] + W[rows] @ P.ravel()
            normal = max(0.0, float(P[i, 0] - y[0] / self.normal[i]))
            y = y + W[rows, i * d] * (normal - P[i, 0])
            P[i, 0] = normal
            pulled = P[i, 1:] - y[1:] / self.across[i]
            size, reach = float(np.sqrt(pulled @ pulled)), self.mu[i] * normal
            P[i, 1:] = pulled * (reach / size) if size > reach else pulled


def solve_contacts(problem: ContactProblem, start: Array, tolerance: float, most: int) -> ContactImpulses:
    """Impulses (m, d) of rigid contacts.

    Parameters
    ----------
    problem : ContactProblem
    start : (m, d) array
        A guess.
    tolerance : float
        The residual (m/s) that is good enough.
    most : int
        Iterations allowed.
    """
    P = np.array(start)
    misses, pressed, pulled = problem.misses(P)
    best, least = P, problem.size(misses)
    count = 0
    swept = False
    while least > tolerance and count < most:
        count += 1
        try:
            step = problem.step(P, misses, pressed, pulled)
        except EvaluationError:
            step = np.full(P.shape, np.nan)
        part, size = 1.0, problem.size(misses)
        for _ in range(HALVINGS):
            tried = P + part * step
            found = problem.misses(tried)
            new = problem.size(found[0])
            if new < size:
                break
            part *= 0.5
        if new < size:
            P, (misses, pressed, pulled), swept = tried, found, False
        else:  # Newton leads nowhere from here
            if not swept:
                P = np.array(best)
            for _ in range(SWEEPS):
                problem.sweep(P)
            misses, pressed, pulled = problem.misses(P)
            new, swept = problem.size(misses), True
        if new < least:
            best, least = np.array(P), new
    return ContactImpulses(best, count, least)
