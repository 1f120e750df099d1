"""Analysis: rates of gaps and what impulses change of them -> the impulses of impacts without friction.

Velocities are measured by kinetic energy: z = F^T dc with F F^T the mass matrix of the free velocities c, so that the
columns h of H = F^-1 B^T n give changes of rates, H^T z, and the energy of a change is |z|^2 / 2.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.impacts import ENDLESS, FREE, LEFT, PUSHES, STILL
from ..errors import untrue

ROUNDS = 1000  #: impacts that may follow each other at one instant
FARTHEST = 1e5  #: change of the velocities, relative to the fastest approach, beyond which gaps cannot open together


def collide(H: Array, rates: Array, e: Array, rest: Array, names: Sequence[object]) -> tuple[Array, Array]:
    """Impulses, and the change of velocities, of impacts of some gaps and of coordinates that are locked.

    Newton's law with complementarity, for all gaps together that close or are at rest (Moreau 1988; Glocker and
    Pfeiffer 1995; Brogliato, Nonsmooth Mechanics, 2016, ch. 5): 0 <= g, 0 <= rate+ + e min(rate-, 0), one of the two 0.
    That is the least change of velocities, in the metric of kinetic energy, that opens the gaps fast enough.  A gap
    that was opening and is closing after that makes a further impact at the same instant, with the rates reached so
    far.  Each of these loses the energy sum g (1 - e) |rate-| / 2, so none is ever gained, whatever the restitutions.

    Parameters
    ----------
    H : (m, n) array
        A column for each gap, then for each locked coordinate; 0 for those that nothing can move.
    rates : (n,) array
        Before.
    e : (k,) array
        Restitutions of the k gaps.
    rest : (n,) array
        Rates of these sizes are rounding.
    names : sequence
        Of the gaps and locked coordinates, for errors.

    Returns
    -------
    impulses : (n,) array
    change : (m,) array
        z = H impulses.

    Raises
    ------
    UsageError
        The locked coordinates cannot all stop, or gaps cannot open together as fast as they should.
    """
    count = len(e)
    sizes = np.linalg.norm(H, axis=0)
    sizes = np.where(sizes > 0.0, sizes, 1.0)
    unit, rates, rest = H / sizes, rates / sizes, rest / sizes
    locks, gaps = unit[:, count:], unit[:, :count]
    change: Array = np.zeros(len(H))
    if locks.shape[1]:
        change = np.asarray(algebra.lstsq(locks.T, -rates[count:], rcond=None))
    left = np.abs(locks.T @ change + rates[count:])
    if (left > rest[count:] + LEFT * np.abs(rates[count:]).max(initial=0.0)).any():
        raise untrue("no impulses satisfy the constraints: the locked coordinates cannot all stop; lock fewer")
    free = gaps - locks @ algebra.lstsq(locks, gaps, rcond=None) if locks.shape[1] else gaps
    impulses = np.zeros(count)
    live = np.linalg.norm(free, axis=0) > FREE
    step = _need(rates[:count], e, rest[:count])
    wanted, now = step - gaps.T @ change, rates[:count]
    fastest = float(np.abs(now).max(initial=0.0))
    for k in range(ROUNDS + 1):
        floor = np.maximum(rest[:count], STILL * max(fastest, float(np.abs(now).max(initial=0.0))))
        if k and not (live & (now < -floor)).any():
            break
        wanted = _need(now, e, floor) if k else wanted
        involved = live & (now <= floor)
        found = _least_change(free[:, involved], wanted[involved]) if k < ROUNDS else None
        if found is None:  # what is left after ever smaller impacts at one instant is plastic
            if k == 0 or -now.min() > ENDLESS * fastest:
                jammed = ", ".join(str(name) for name, one in zip(names, involved, strict=False) if one)
                raise untrue(
                    f"the gaps {jammed} cannot open together: bodies are jammed between them, and Newton's law has no "
                    "solution; give them restitution 0"
                )
            involved, wanted, k = live, -now, ROUNDS
            found = _least_change(free[:, involved], wanted[involved])
        z, g = found or (np.zeros(len(H)), np.zeros(int(involved.sum())))
        impulses[involved] += g
        change = change + z
        now = rates[:count] + gaps.T @ change
        if k == ROUNDS:
            break
    held = algebra.lstsq(locks, change - gaps @ impulses, rcond=None) if locks.shape[1] else np.zeros(0)
    return np.concatenate([impulses, held]) / sizes, change


def _need(rates: Array, e: Array, rest: Array) -> Array:
    """What has to be added to rates: 0 <= rate+ + e min(rate-, 0)."""
    return np.where(rates < -rest, -(1.0 + e) * rates, np.where(np.abs(rates) <= rest, 0.0, -rates))


def _least_change(H: Array, need: Array) -> tuple[Array, Array] | None:
    """The smallest z (m,) with H^T z >= need, and g (n,), 0 <= g, with z = H g; None if there is none.

    Columns of H have about length 1.

    A least-distance problem, solved as least squares with positive unknowns (Lawson and Hanson, Solving Least Squares
    Problems, 1974, ch. 23.4).
    """
    most = float(need.max(initial=0.0))
    if not most > 0.0:
        return np.zeros(len(H)), np.zeros(len(need))
    E = np.vstack([H, need / most])
    y = np.zeros(len(E))
    y[-1] = 1.0
    u = _positive_least_squares(E, y)
    r = 1.0 - float(E[-1] @ u)
    if not r > FARTHEST**-2:
        return None
    z, g = most * (H @ u) / r, most * u / r
    P = u > 0.0  # again from the gaps that push, to the last digits
    z_P = np.asarray(algebra.lstsq(H[:, P].T, need[P], rcond=None))
    g_P = np.asarray(algebra.lstsq(H[:, P], z_P, rcond=None))
    slack = FREE * max(most, float(np.abs(z_P).max(initial=0.0)))
    if (g_P >= 0.0).all() and (H.T @ z_P >= need - slack).all():
        g[P], z = g_P, z_P
    return z, g


def _positive_least_squares(E: Array, y: Array) -> Array:
    """u >= 0 that makes |E u - y| least (Lawson and Hanson 1974, ch. 23.3)."""
    n = E.shape[1]
    passive, u, barred = np.zeros(n, dtype=bool), np.zeros(n), np.zeros(n, dtype=bool)
    for _ in range(30 * n + 30):
        w = E.T @ (y - E @ u)
        w[passive | barred] = -np.inf
        j = int(np.argmax(w))
        if not w[j] > PUSHES:
            break
        passive[j] = True
        first = True
        while passive.any():
            s = np.zeros(n)
            s[passive] = algebra.lstsq(E[:, passive], y, rcond=None)
            if first and s[j] <= 0.0:  # a slope that is rounding
                passive[j], barred[j] = False, True
                break
            first = False
            if (s[passive] > 0.0).all():
                u, barred[:] = s, False
                break
            falling = passive & (s <= 0.0)
            reach = u[falling] / (u[falling] - s[falling])
            u = u + float(reach.min()) * (s - u)
            passive[falling] &= reach > reach.min()
            u[~passive] = 0.0
    return u
