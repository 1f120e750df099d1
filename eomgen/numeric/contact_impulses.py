"""Stage numeric: compliance of contacts, velocities without impulses, friction -> impulses of rigid contacts.

Of each contact the impulse P = (P_n, P_t) and the velocity y = c + W P, less what the normal one is to be, obey

    0 <= P_n  _|_  y_n >= 0,      P_t in the disc of radius mu P_n, opposite to y_t on its edge where y_t is not 0

(Signorini and Coulomb).  Both are zeros of the natural maps of P. Alart, A. Curnier, A mixed formulation for frictional
contact problems prone to Newton like solution methods, Comput. Methods Appl. Mech. Eng. 92 (1991), 353-375,

    P_n - max(0, P_n - r y_n),      P_t - (P_t - s y_t) brought into the disc of radius mu max(0, P_n - r y_n),

which a Newton method with the derivatives of the branch at hand solves.  Contacts may be more than there are freedoms:
each round solves for contacts that are a little softer about the impulses of the round before (the proximal point
method, R. T. Rockafellar, SIAM J. Control Optim. 14 (1976), 877-898), which leaves the matrix regular and the solution
as it is.  Where Newton leads nowhere, sweeps over single contacts go on (M. Jean, The non-smooth contact dynamics
method, Comput. Methods Appl. Mech. Eng. 177 (1999), 235-257).  Before all that, many contacts are solved by the edges
of their cones (:mod:`~eomgen.numeric.contact_edges`), or in space by sweeps.  What is left over goes to
:func:`solve_smoothed`.

``templates/c/contacts`` has the same iterations in C; modules with it do them as ``core.solve_contacts``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import EvaluationError
from ..limits.rigid_contacts import MANY, PATIENT, SHARP, SHRINKS, SOFT, SOFTER, SWEEPS, TRIED, WARM
from . import algebra
from .contact_edges import solve_edges
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
        self.scales = np.concatenate(
            [self.normal[:, None], np.repeat(self.across[:, None], self.d - 1, axis=1)], axis=1
        )

    def softer(self, P: Array, part: float) -> ContactProblem:
        """The problem in which each contact is softer by a part of its compliance about impulses P."""
        more = part * self.scales
        made = ContactProblem(self.W + np.diag(more.ravel()), self.c - more * P, self.mu)
        made.normal, made.across, made.scales = self.normal, self.across, self.scales
        return made

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
        A[on, 0] = y_slopes[on, 0] / self.normal[on, None]
        A[holds, 1:] = y_slopes[holds, 1:] / self.across[holds, None, None]
        for i in np.flatnonzero(slides):
            along = pulled[i] / size[i] if size[i] > 0.0 else np.zeros(d - 1)
            normal = unit[i, 0] - y_slopes[i, 0] / self.normal[i]
            moved = unit[i, 1:] - y_slopes[i, 1:] / self.across[i]
            A[i, 1:] = unit[i, 1:] - np.outer(self.mu[i] * along, normal)
            if d > 2 and size[i] > 0.0:
                A[i, 1:] -= reach[i] / size[i] * (moved - np.outer(along, along @ moved))
        return -algebra.solve(A.reshape(m * d, m * d), misses.ravel()).reshape(m, d)

    def smoothed_step(self, P: Array, rounding: float) -> tuple[Array, float]:
        """Impulses after a Newton step for laws rounded over a velocity, and the residual before it (m/s)."""
        m, d = P.shape
        unit, slopes = np.eye(m * d).reshape(m, d, m * d), self.W.reshape(m, d, m * d)
        y = self.velocities(P)
        near, beside = rounding / self.normal, rounding / self.across
        x, dx = P[:, 0] - y[:, 0] / self.normal, unit[:, 0] - slopes[:, 0] / self.normal[:, None]
        root = np.sqrt(x * x + 4.0 * near * near)
        pressed = np.where(x < 0.0, 2.0 * near * near / (np.abs(x) + root), 0.5 * (x + root))
        rise = 0.5 * (1.0 + x / root)
        misses, A = np.empty((m, d)), np.empty((m, d, m * d))
        misses[:, 0], A[:, 0] = P[:, 0] - pressed, unit[:, 0] - rise[:, None] * dx
        if d > 1:
            reach, d_reach = self.mu * pressed, (self.mu * rise)[:, None] * dx
            pulled = P[:, 1:] - y[:, 1:] / self.across[:, None]
            d_pulled = unit[:, 1:] - slopes[:, 1:] / self.across[:, None, None]
            size = np.sqrt((pulled * pulled).sum(axis=1) + beside * beside)
            d_size = (pulled[:, :, None] * d_pulled).sum(axis=1) / size[:, None]
            edge = np.sqrt((size - reach) ** 2 + 4.0 * beside * beside)
            larger = 0.5 * (size + reach + edge)
            d_larger = 0.5 * (d_size + d_reach) + ((size - reach) / (2.0 * edge))[:, None] * (d_size - d_reach)
            part = reach / larger
            d_part = (d_reach - part[:, None] * d_larger) / larger[:, None]
            misses[:, 1:] = P[:, 1:] - part[:, None] * pulled
            A[:, 1:] = unit[:, 1:] - part[:, None, None] * d_pulled - pulled[:, :, None] * d_part[:, None]
        step = algebra.solve(A.reshape(m * d, m * d), misses.ravel()).reshape(m, d)
        return P - step, self.size(misses)

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
    best, least = np.array(P), problem.size(problem.misses(P)[0])
    count = 0
    sweeps = WARM if problem.m >= MANY else 0
    if sweeps and problem.d < 3 and least > tolerance:
        known = least
        best, least = solve_edges(problem, best, least, tolerance)
        sweeps = WARM if not least < known else 0
        P = np.array(best)
    for _ in range(sweeps):
        if least <= tolerance:
            break
        for _ in range(SWEEPS):
            problem.sweep(P)
        size = problem.size(problem.misses(P)[0])
        if size < least:
            best, least = np.array(P), size
    P = np.array(best)
    for part in SOFTER:
        if least <= tolerance or count >= most:
            break
        P, steps = _near(problem.softer(P, part), P, 0.5 * tolerance, min(TRIED, most - count))
        count += max(steps, 1)
        size = problem.size(problem.misses(P)[0])
        if size < least:
            best, least = np.array(P), size
        if least > tolerance:
            P = np.array(best)
            for _ in range(SWEEPS):
                problem.sweep(P)
            size = problem.size(problem.misses(P)[0])
            if size < least:
                best, least = np.array(P), size
    for shrinks in SHRINKS:
        if least <= tolerance or count >= most:
            break
        P, steps, size = solve_smoothed(problem, tolerance, most - count, shrinks)
        count += steps
        if size < least:
            best, least = P, size
    return ContactImpulses(best, count, least)


def solve_smoothed(problem: ContactProblem, tolerance: float, most: int, shrinks: float) -> tuple[Array, int, float]:
    """Impulses by rounded laws that become sharp.

    B. Chen, P. T. Harker, A non-interior-point continuation method for linear complementarity problems, SIAM J. Matrix
    Anal. Appl. 14 (1993), 1168-1190.

    max(0, x) is (x + sqrt(x^2 + 4 e^2)) / 2, with e that shrinks as Newton's method follows; the edge of the disc of
    friction is rounded likewise.

    Returns
    -------
    (m, d) array, int, float
        Impulses, iterations and residual, those of least residual.
    """
    P = np.zeros(problem.c.shape)
    best, least = P, np.inf
    rounding, count, still = 1.0, 0, 0
    speed = float(np.abs(problem.c).max())
    while least > tolerance and count < most and rounding > SHARP and still < PATIENT:
        about = problem.softer(P, SOFT)
        for _ in range(2):
            try:
                P, left = about.smoothed_step(P, rounding * speed)
            except EvaluationError:
                return best, count + 1, least
            count += 1
            if left < 0.1 * rounding * speed:
                break
        size = problem.size(problem.misses(P)[0])
        if size < least:
            best, least = P, size
        still += 1
        if left < rounding * speed:
            rounding, still = rounding * shrinks, 0
    return best, count, least


def _near(problem: ContactProblem, start: Array, tolerance: float, most: int) -> tuple[Array, int]:
    """Newton's iterations for softer contacts, and how many there were; NaN where they have no step."""
    P = np.array(start)
    for count in range(most):
        misses, pressed, pulled = problem.misses(P)
        if problem.size(misses) <= tolerance:
            return P, count
        try:
            P = P + problem.step(P, misses, pressed, pulled)
        except EvaluationError:
            return np.full(P.shape, np.nan), count
    return P, most
