"""Stage numeric: compliance of contacts, velocities without impulses, friction -> natural maps, their Newton steps.

:mod:`~eomgen.numeric.contact_impulses` says the laws and the methods.
"""

from __future__ import annotations

import numpy as np

from ..base import algebra
from ..base.algebra import Array


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
