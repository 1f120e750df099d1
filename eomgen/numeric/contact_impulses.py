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
method, Comput. Methods Appl. Mech. Eng. 177 (1999), 235-257), and one contact in the plane by its four cases: it opens,
holds, or slides to either side.  Before all that, many contacts are solved by the edges of their cones
(:mod:`~eomgen.numeric.contact_edges`), or in space by sweeps.  What is left over goes to :func:`solve_smoothed`.

``eomgen/native/contacts`` has the same iterations in C; modules with it do them as ``core.solve_contacts``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..base.algebra import Array
from ..base.limits.contacts import MANY, PATIENT, SHARP, SHRINKS, SOFT, SOFTER, SWEEPS, TRIED, WARM
from ..errors import EvaluationError
from .contact_edges import solve_edges
from .contact_problem import ContactProblem


class ContactImpulses(NamedTuple):
    """What was found."""

    impulses: Array  #: (m, d)
    iterations: int  #: Newton's, and sweeps
    residual: float  #: (m/s) the largest entry of both maps, as velocities


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
    if not problem.c.any():  # nothing moves: no residual is small beside that
        return ContactImpulses(np.zeros_like(P), 0, 0.0)
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
    if P.shape == (1, 2) and least > tolerance:
        cases = _cases(problem)
        sizes = [problem.size(problem.misses(case)[0]) for case in cases]
        if min(sizes) < least:
            best, least = cases[int(np.argmin(sizes))], min(sizes)
    for shrinks in SHRINKS:
        if least <= tolerance or count >= most:
            break
        P, steps, size = solve_smoothed(problem, tolerance, most - count, shrinks)
        count += steps
        if size < least:
            best, least = P, size
    return ContactImpulses(best, count, least)


def _cases(problem: ContactProblem) -> list[Array]:
    """What a single contact in the plane bears if it opens, holds, or slides to either side, where that can be."""
    (a, b), (_, d) = problem.W.tolist()
    (normal, across), mu = problem.c[0].tolist(), float(problem.mu[0])
    found = [np.zeros((1, 2))]
    if (det := a * d - b * b) > 0.0:
        found.append(np.array([[b * across - d * normal, b * normal - a * across]]) / det)
    for side in (mu, -mu):
        if (stiff := a + side * b) > 0.0 and normal < 0.0:
            push = -normal / stiff
            found.append(np.array([[push, side * push]]))
    return found


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
