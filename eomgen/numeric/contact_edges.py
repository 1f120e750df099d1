"""Stage numeric: a problem of rigid contacts of one or two directions -> impulses by the edges of their cones.

Impulses of a contact are sums of multipliers, 0 or more, of the edges (1, mu) and (1, -mu) of its cone.  With friction
as if surfaces rose by mu times the speed at which they slide (G. de Saxcé, Z.-Q. Feng, The bipotential method, Math.
Comput. Modelling 28 (1998), 225-245) they are the solution of a convex quadratic problem, which edges that come and go
one by one solve in a finite number of steps (D. Goldfarb, A. Idnani, A numerically stable dual method for solving
strictly convex quadratic programs, Math. Program. 27 (1983), 1-33).  What slides is renewed until it is as it was
(F. Cadoux, Ph.D. thesis, Grenoble, 2009).

Sweeps over single contacts move one impulse at a time and take thousands where light links lie between heavy bodies;
here the number of steps is that of the edges that change.

``eomgen/native/contacts/pivots.c`` does the same.
"""

from __future__ import annotations

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.contacts import FIRM, PIVOTS, RENEWED, SLIPPERY, VAIN
from .contact_problem import ContactProblem


class Edges:
    """The edges of one problem, and those among them that act."""

    def __init__(self, problem: ContactProblem, start: Array) -> None:
        m, d, mu = problem.m, problem.d, problem.mu
        self.problem = problem
        self.ways = np.eye(m * d)  # columns are edges
        own = start.ravel().copy()
        self.asked = np.ones(m * d)
        self.known = np.ones(m * d, bool)
        if d == 2:
            lean = np.stack([mu, -mu], axis=1)
            self.ways[0::2, 1::2], self.ways[1::2, 0::2] = np.eye(m), np.diag(mu)
            self.ways[1::2, 1::2] = -np.diag(mu)
            across = start[:, 1] / np.where(mu > 0.0, mu, 1.0)
            shared = 0.5 * np.stack([start[:, 0] + across, start[:, 0] - across], axis=1)
            lone = np.stack([start[:, 0], np.zeros(m)], axis=1)
            own = np.where((mu * start[:, 0] > 0.0)[:, None], shared, lone).ravel()
            self.asked = np.minimum(1.0, np.maximum(np.abs(lean), SLIPPERY)).ravel()
            self.known[1::2] = mu > 0.0
        self.H = self.ways.T @ problem.W @ self.ways
        self.H += FIRM * np.diag(np.diag(self.H))
        pressed = own > FIRM * np.repeat(start[:, 0], d)
        self.acting: list[int] = [int(k) for k in np.flatnonzero(pressed & (np.diag(self.H) > 0.0))]
        self.own = np.zeros(m * d)
        self.free = np.zeros(m * d)

    def shift(self, y: Array) -> None:
        """Surfaces rise with what slides at velocities y (m, d)."""
        c = self.problem.c.copy()
        if self.problem.d == 2:
            c[:, 0] += self.problem.mu * np.abs(y[:, 1])
        self.free = self.ways.T @ c.ravel()

    def solved(self, b: Array) -> Array:
        """x of H x = b among the edges that act."""
        which = self.acting
        return np.asarray(algebra.solve(self.H[np.ix_(which, which)], b[:, None])[:, 0]) if which else np.zeros(0)

    def settle(self) -> None:
        """Multipliers with which the edges that act have no velocity; those that would pull act no more."""
        while True:
            found = self.solved(-self.free[self.acting])
            self.own[:] = 0.0
            self.own[self.acting] = np.maximum(found, 0.0)
            if not (found < 0.0).any():
                return
            self.acting = [k for k, x in zip(self.acting, found, strict=True) if x >= 0.0]

    def pivot(self, tolerance: float, most: int) -> int:
        """Multipliers for the shifts that are set, in at most so many steps; how many there were."""
        self.settle()
        count = 0
        while count < most:
            y = self.free + self.H @ self.own
            lost = np.where(self.known, y / self.asked, np.inf)
            lost[self.acting] = np.inf
            k = int(np.argmin(lost))
            if not lost[k] < -tolerance:
                return count
            left, done = -float(y[k]), False
            while not done and count < most:
                row = self.H[self.acting, k]
                ratios = self.solved(row)
                rest = max(float(self.H[k, k] - row @ ratios), 0.5 * FIRM * float(self.H[k, k]))
                if not rest > 0.0:
                    return most
                own = self.own[self.acting]
                reach = np.where(ratios > 0.0, own / np.where(ratios > 0.0, ratios, 1.0), np.inf)
                first = int(np.argmin(reach)) if len(reach) else -1
                done = first < 0 or left / rest <= reach[first]
                part = left / rest if done else float(reach[first])
                self.own[self.acting] = own - part * ratios
                self.own[k] += part
                left, count = left - part * rest, count + 1
                if done:
                    self.acting.append(k)
                else:
                    self.own[self.acting.pop(first)] = 0.0
            if not done:
                self.own[k] = 0.0
        return count

    def impulses(self) -> Array:
        """P (m, d)."""
        return np.asarray((self.ways @ np.maximum(self.own, 0.0)).reshape(self.problem.c.shape))


def solve_edges(problem: ContactProblem, start: Array, least: float, tolerance: float) -> tuple[Array, float]:
    """Impulses (m, d) and their residual; those given where none are better.

    Parameters
    ----------
    problem : ContactProblem
        Of one or two directions.
    start : (m, d) array
        A guess, whose residual is ``least``.
    least, tolerance : float
        The residual of the guess (m/s), and that which is good enough.
    """
    edges, best, y = Edges(problem, start), start, problem.velocities(start)
    left, still = PIVOTS * problem.m * problem.d, 0
    for _ in range(RENEWED):
        if still >= VAIN or left <= 0 or least <= tolerance:
            break
        edges.shift(y)
        left -= edges.pivot(0.5 * tolerance, left)
        P = edges.impulses()
        y = problem.velocities(P)
        size = problem.size(problem.misses(P)[0])
        still = 0 if size < least else still + 1
        if size < least:
            best, least = P, size
    return best, least
