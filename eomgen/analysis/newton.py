"""Analysis: equations near iterates -> an iterate at which they hold, by Newton's iteration and what helps it.

Steps are judged by the corrections that they leave, not by residuals (the natural monotonicity test: P. Deuflhard,
Newton Methods for Nonlinear Problems, 2004, algorithm NLEQ-ERR, section 3.3.2).  Neither the scale nor the mixture of
the equations matters then: a stiff spring stretched by the curvature of a step is one small correction away.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.analyses import ARRIVED, DAMPING, GAINED, SHORTEST
from ..base.limits.numbers import TINY
from ..numeric.projection import largest
from .linear_step import Solver

if TYPE_CHECKING:
    from .search import Search, SearchPoint

STEPS = 200  #: at most
LONGEST = 0.5  #: largest scaled step of a coordinate
STIFFEST = 1e16  #: largest damping of a step
POLISHED = 8  #: most steps after the correction has reached rounding
CONTRACTS = 0.5  #: part of a correction that the next one may be


def newton(
    search: Search, point: SearchPoint, plain: bool = False, reach: float = np.inf
) -> tuple[SearchPoint, int, bool]:
    """The last iterate, the number of steps, and whether it is balanced.

    plain: whole steps, whatever they lead to; reach: largest scaled distance from the start.
    """
    part, before, start, last = 1.0, None, point.q, np.inf
    for step in range(STEPS):
        solver = Solver(search.linearize(point))
        residual = search.residual(point.here, point.here)
        change = solver.solve(residual)
        shown = solver.shown(change)
        size, longest = float(np.linalg.norm(shown)), search.longest(solver.linear.moved @ change)
        if not np.isfinite(size):
            return point, step, False
        arrived = solver.arrived(residual, change, search.rounded(point))
        if arrived and (size <= ARRIVED or size > CONTRACTS * last):
            return _polished(search, point, solver, change), step, True
        if size <= ARRIVED or largest(search.layout.place_scales.distance(point.q, start)) > reach:
            return point, step, False
        most = 1.0 if plain else min(1.0, LONGEST / max(longest, LONGEST))
        if before is not None:
            apart = float(np.linalg.norm(before[1] - shown))
            part = float(np.linalg.norm(before[0]) * np.linalg.norm(before[1])) * before[2] / max(apart * size, TINY)
        part, retried = most if plain else min(most, part), False
        there, grown = None, None
        while part >= SHORTEST * most:
            there = search.step(point, solver.linear.moved @ (part * change), solver.linear.changed @ (part * change))
            if there is None:
                part *= 0.5
                continue
            left = solver.shown(solver.solve(search.residual(there.here, point.here)))
            if plain:
                break
            off = float(np.linalg.norm(left - (1.0 - part) * shown))
            wanted = 0.5 * size * part**2 / max(off, TINY)
            if np.linalg.norm(left) > (1.0 - 0.25 * part) * size:
                if arrived:  # rounding: no correction gets smaller
                    return _polished(search, point, solver, change), step, True
                there, part, retried = None, min(wanted, 0.5 * part), True
            elif min(wanted, most) >= 4.0 * part and not retried:
                there, part, retried = None, min(wanted, most), True
            else:
                grown = left, part
                break
        if there is None:
            return point, step, arrived
        point, last = there, size
        before = None if grown is None or plain else (shown, grown[0], grown[1])
    return point, STEPS, False


def _polished(search: Search, point: SearchPoint, solver: Solver, change: Array) -> SearchPoint:
    """The iterate of whole steps from here, as long as each halves the residual.

    Where stiff forces stand beside soft ones, a correction within rounding of the stiff ones may leave more than that
    of the soft ones; the next steps have only these left.
    """
    sizes = solver.sizes
    left = float(np.linalg.norm(search.residual(point.here, point.here) / sizes))
    for _ in range(POLISHED):
        there = search.step(point, solver.linear.moved @ change, solver.linear.changed @ change)
        if there is None:
            break
        after = float(np.linalg.norm(search.residual(there.here, point.here) / sizes))
        if not after < left:
            break
        point, left, enough = there, after, after > 0.5 * left or largest(solver.shown(change)) <= ARRIVED
        if enough:
            break
        solver = Solver(search.linearize(point))
        if len(solver.sizes) != len(sizes):
            break
        change = solver.solve(search.residual(point.here, point.here))
    return point


def marquardt(search: Search, point: SearchPoint) -> tuple[SearchPoint, int, bool]:
    """Down the residual: Levenberg and Marquardt's steps, with columns scaled by the largest norms that they have had.

    J. J. More, The Levenberg-Marquardt algorithm, Lecture Notes in Mathematics 630 (1978), 105-116; the damping follows
    the gain (H. B. Nielsen, Damping parameter in Marquardt's method, IMM-REP-1999-05).
    """
    damping, growth, columns = DAMPING, 2.0, np.zeros(0)
    start = Solver(search.linearize(point)).sizes
    for step in range(STEPS):
        solver, here = Solver(search.linearize(point)), point.here
        residual = search.residual(here, here)
        change = solver.solve(residual)
        if not residual.any() or solver.arrived(residual, change, search.rounded(point)):
            return point, step, False  # near enough for Newton's iteration, which tells rounding from what is left
        same = len(start) == len(solver.sizes)
        sizes = start if same else solver.sizes
        J, r = solver.linear.J / sizes[:, None], residual / sizes
        norms = np.linalg.norm(J, axis=0)
        columns = np.maximum(columns, norms) if len(columns) == len(norms) else norms
        scale = np.where(columns > 0.0, columns, 1.0)
        there = None
        while damping < STIFFEST:
            stacked = np.vstack([J, np.sqrt(damping) * np.diag(scale)])
            change = algebra.lstsq(stacked, np.concatenate([-r, np.zeros(len(scale))]), rcond=None)
            there = search.step(point, solver.linear.moved @ change, solver.linear.changed @ change)
            gain = -1.0
            if there is not None:
                lower = float(r @ r) - float(np.sum((search.residual(there.here, here) / sizes) ** 2))
                gain = lower / max(float(change @ (damping * scale**2 * change - J.T @ r)), TINY)
            if gain > GAINED:
                damping, growth = damping * max(1.0 / 3.0, 1.0 - (2.0 * gain - 1.0) ** 3), 2.0
                break
            there, damping, growth = None, damping * growth, 2.0 * growth
        if there is None:
            return point, step, False
        point = there
    return point, STEPS, False
