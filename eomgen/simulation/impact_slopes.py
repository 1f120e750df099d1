"""Simulation: a state at an event and its changes -> how the state right after a reset or an impact changes.

An impact of one gap with normal n (see :mod:`.impact`) solves

    M (v+ - v-) + C_q^T l = n^T g        C_q v+ + C_t = 0        r+ + e r- = 0,  r = n v + gap_t

with the rows of what is closed for a time among those of C_q, and velocities that a reset has set to v* go to the
nearest on the constraints, (v+ - v*) / s^2 + C_q^T l = 0.  Both are differentiated implicitly; changes of l drop out
along the free motions B, C_q B = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.impacts import OFF
from ..errors import NoDerivativeError
from ..numeric.projection import minimum_norm
from ..runtime.constrained import closed_rows, free_motions, solve_multipliers, with_closed_rows
from .sensitivity_start import assembly_rows
from .variational import Move, Variational

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel


class Strike:
    """The laws that rule velocities at one instant.

    Parameters
    ----------
    module : BoundModel
        With the inputs at that instant bound.
    t : float
    x : (n_x,) array
        The state right after.
    closed : sequence of int
        Equations of constraints that close and open that rule too.
    """

    def __init__(self, module: BoundModel, t: float, x: Array, closed: Sequence[int] = ()) -> None:
        self.module, self.t, self.layout, self.closed = module, t, module.layout, closed
        self.q, self.v = x[: self.layout.n_q], x[self.layout.n_q :]
        self.C_q, self.scales = module.kernels.constraint_jacobian(self.q, t=t, rows="all"), self.layout.scales
        if closed:
            self.C_q, self.scales = with_closed_rows(module, t, x, self.C_q)
        self.B = free_motions(self.C_q, self.scales)
        self._slopes = module.kernels.timed("strike_derivatives")

    def rows(self, v: Array, change: Array, l: Array, g: Array) -> tuple[Array, Array, Array, Array]:
        """Derivatives by [q, v, t, u, p] of M a + C_q^T l - n^T g, of a / s^2 + C_q^T l, of C_q v + C_t and of the
        events' rates."""
        n_v, n_c = self.layout.n_v, self.layout.n_c
        held = np.zeros(self.layout.n_held // 2)
        held[[*self.closed]] = l[n_c:]
        every = self._slopes(self.t, np.concatenate([self.q, v, change, l[:n_c], g, held]))
        ends = np.cumsum([n_v, n_v, n_c, self.layout.n_events])
        first, second, third, fourth, fifth = np.split(every, ends)
        return first, second, np.vstack([third, fifth[[*self.closed]]]), fourth

    def solve(self, metric: Array, dv: Array, force: Array, rate: Array, n: Array, gap: Array) -> Array:
        """The changes (n_v, k) of v+: metric (dv+ - dv) + force = n^T dg along B, C_q dv+ = -rate, n dv+ = -gap."""
        w = -minimum_norm(self.C_q, rate, self.scales) if len(rate) else np.zeros_like(dv)
        B, free, closed = self.B, self.B.shape[1], n @ self.B
        K = np.zeros((free + len(n), free + len(n)))
        K[:free, :free], K[:free, free:], K[free:, :free] = B.T @ metric @ B, -closed.T, closed
        right = np.vstack([B.T @ (metric @ (dv - w) - force), -gap - n @ w])
        return np.asarray(w + B @ algebra.solve(K, right)[:free])


def after_impact(
    run: Variational, module: BoundModel, t: float, v: Array, move: Move, x: Array, event: int, e: float
) -> Array:
    """How the state after the impact of one gap changes, (n_x, k).

    Parameters
    ----------
    run : Variational
    module : BoundModel
        With the inputs at that instant bound.
    t : float
    v : (n_v,) array
        Velocities before.
    move : Move
        Changes of the state before, of time, inputs and parameters.
    x : (n_x,) array
        The state after.
    event : int
        The model's event whose expression is the gap.
    e : float
        Restitution.
    """
    layout, strike = module.layout, Strike(module, t, x, closed_rows(module, x))
    n_q, n_x, names = layout.n_q, layout.n_x, layout.u
    change, none, rest = strike.v - v, np.zeros(len(strike.C_q)), np.zeros(layout.n_events)
    M = module.kernels.mass_matrix(strike.q, t=t)
    n = strike.rows(v, change, none, rest)[3][event : event + 1, n_q:n_x]
    g = np.array(rest)
    g[event] = algebra.lstsq(strike.B.T @ n.T, strike.B.T @ M @ change, rcond=None)[0]
    force = M @ change - n[0] * g[event]
    l = solve_multipliers(strike.C_q[None], force[:, None], strike.scales)[:, 0]
    held = move._replace(x=np.vstack([move.x[:n_q], np.zeros_like(move.x[n_q:])]))
    balance, _, rate, after = strike.rows(strike.v, change, l, g)
    before = strike.rows(v, change, l, g)[3]
    what = f"event {layout.metadata['events'][event]['name']}"
    gap = held.along(after[event : event + 1], what, names) + e * move.along(before[event : event + 1], what, names)
    pushed, rates = held.along(balance, what, names), held.along(rate, what, names)
    return np.vstack([move.x[:n_q], strike.solve(M, move.x[n_q:], pushed, rates, n, gap)])


def after_reset(
    run: Variational, module: BoundModel, t: float, before: Array, move: Move, x: Array, event: int, u: Array
) -> Array:
    """How the state after a reset changes, (n_x, k); arguments as for :func:`after_impact`, u (n_u,) before it."""
    layout = module.layout
    n_q, names, what = layout.n_q, layout.u, f"event {layout.metadata['events'][event]['name']}"
    resets = layout.metadata["resets"]
    chosen = [k for k, (owner, _) in enumerate(resets) if owner == event]
    places = [resets[k][1] for k in chosen]
    slopes = module.kernels.rows("event_derivatives", [layout.n_events + k for k in chosen], t, before, u)
    star, moved = np.array(before), np.array(move.x)
    star[places] = module.kernels.rows("resets", chosen, t, before, u)
    moved[places] = move.along(slopes, what, names)
    dq, dv = moved[:n_q], moved[n_q:]
    if layout.space is not None:
        for i, _ in layout.quaternion_slots:
            dq[i : i + 4] /= np.linalg.norm(star[i : i + 4])
        star[:n_q] = layout.space.normalised(star[:n_q])
        dq = dq - layout.space.stretch(star[:n_q], dq)
    if not layout.n_c:
        return np.vstack([dq, dv])
    off = float(np.abs(layout.scales.distance(x[:n_q], star[:n_q])).max())
    if off > OFF:
        raise NoDerivativeError(
            f"{what} resets coordinates to values that do not close the loops (the projection moves them by {off:.2g}, "
            "scaled), so the derivative is not known; reset all coordinates so that the loops stay closed"
        )
    strike, scales = Strike(module, t, x), layout.scales
    dq = dq - _back(run, module, strike, dq, move)
    star_v = star[n_q:]
    m = solve_multipliers(strike.C_q[None], ((strike.v - star_v) / scales.q**2)[:, None], scales)[:, 0]
    held = run.move(t, x, np.vstack([dq, np.zeros_like(dv)]), move.t)
    _, least, rate, _ = strike.rows(strike.v, strike.v - star_v, m, np.zeros(layout.n_events))
    pushed, rates = held.along(least, what, names), held.along(rate, what, names)
    nothing = np.zeros((0, layout.n_v)), np.zeros((0, dv.shape[1]))
    return np.vstack([dq, strike.solve(np.diag(scales.q**-2), dv, pushed, rates, *nothing)])


def _back(run: Variational, module: BoundModel, strike: Strike, dq: Array, move: Move) -> Array:
    """What brings changes of coordinates (n_q, k) back onto the constraints."""
    layout, t, q = module.layout, strike.t, strike.q
    n_h, n_q, n_x = layout.n_h, layout.n_q, layout.n_x
    if not n_h:
        return np.zeros_like(dq)
    x = np.concatenate([q, np.zeros(layout.n_v)])
    E = assembly_rows(module, t, x, run.inputs(t, x) if run.forcing else None)[:n_h]
    drift = module.velocity_constraints(x, t=t, rows="all")[:n_h]
    off = E[:, :n_q] @ dq + np.multiply.outer(drift, move.t) + E[:, n_x + layout.n_u :] @ move.p
    off = off + E[:, n_x : n_x + layout.n_u] @ run.du
    N = layout.scales.rates(q, np.eye(layout.n_v))
    return layout.scales.rates(q, minimum_norm(E[:, :n_q] @ N, off, layout.scales))
