"""Analysis: rates of gaps and of sliding, and what impulses change of them -> impulses with Coulomb friction.

One gap that closes in the plane is solved exactly by Routh's method.  As the normal impulse P grows from 0, friction is
-mu dP against the sliding velocity; where sliding stops it becomes what holds, -W_nt/W_tt dP, or mu dP the other way if
that is too much.  Compression ends at the impulse P_c at which the gap no longer closes, and Poisson's hypothesis ends
the impact at (1 + e) P_c (E. J. Routh, Dynamics of a System of Rigid Bodies, part I (1905), art. 187; Y. Wang, M. T.
Mason, Two-dimensional rigid-body collisions with friction, J. Appl. Mech. 59 (1992), 635-642).

In space, and where several gaps that move each other are closed, the impulses obey Newton's law of restitution and
Coulomb's law for the velocities after the impact, all together (J. J. Moreau 1988; F. Pfeiffer, C. Glocker, Multibody
Dynamics with Unilateral Contacts (1996), ch. 8):

    0 <= P_n,  0 <= y_n+ + e min(y_n-, 0),  one of them 0;      |P_t| <= mu P_n,  opposite to y_t+ on the edge.

Newton's law may bring in energy where friction acts (T. R. Kane, D. A. Levinson, Dynamics (1985), sec. 5.8).  So
restitutions are then multiplied by the largest factor with which the impulses bring in none, P . (y- + y+) / 2 <= 0;
so too where gaps that are jammed cannot open as fast as all restitutions demand.  The rates y are those of the gaps and
of sliding on what moves by itself: a belt or a racket may still do work on the bodies.

Gaps that move no gap with friction, and all gaps whose coefficient is 0, obey the law without friction.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.algebra import Array
from ..base.limits.impacts import COUPLED, GAINS, GIVES, REACHED, STRUCK
from ..errors import untrue
from ..numeric.contact_impulses import solve_contacts
from ..numeric.contact_problem import ContactProblem
from .impact_law import collide
from .sliding_direction import impulses_in_space

TRIALS = 400  #: iterations for the impulses of one instant
HALVED = 40  #: halvings of the range of the factor of restitutions


class Sliding(NamedTuple):
    """Where gaps have friction: the velocities with which they slide, s in all."""

    names: tuple[str, ...]
    owner: NDArray[np.int64]  #: (s,) the gap of each
    coefficients: Array  #: (k,) of each gap, 0 or greater
    rows: Array  #: (s, n_v) derivatives by v
    rates: Array  #: (s,) before


def strike(
    H: Array, rates: Array, e: Array, rest: Array, mu: Array, owner: NDArray[np.int64], names: Sequence[str]
) -> tuple[Array, Array]:
    """Impulses (k + s,) and the change of velocities (m,), where some of k gaps have friction.

    Gaps that share no body with one of friction greater than 0 obey :func:`.impact_law.collide`, all at once.

    Parameters
    ----------
    H : (m, k + s) array
        As for :func:`.impact_law.collide`, gaps first, then sliding velocities.
    rates, e, rest, mu, owner, names
        As for :func:`strike_rough`.

    Raises
    ------
    UsageError
        No impulses are found.
    """
    k = len(e)
    rubbing = np.flatnonzero(mu[owner] > 0.0)
    used, owner = [*range(k), *(k + rubbing).tolist()], owner[rubbing]
    W = H[:, used].T @ H[:, used]
    rough = sorted(i for group in _coupled(W, k, owner) if np.isin(owner, group).any() for i in group)
    smooth = [i for i in range(k) if i not in rough]
    found, change = np.zeros(len(rates)), np.zeros(len(H))
    if smooth:
        named = [names[i] for i in smooth]
        found[smooth], change = collide(H[:, smooth], rates[smooth], e[smooth], rest[smooth], named)
    if rough:
        of = np.flatnonzero(np.isin(owner, rough))
        places = [*rough, *(k + of).tolist()]
        every = [used[i] for i in places]
        given = rates[every], e[rough], rest[every], mu[rough], np.searchsorted(rough, owner[of])
        found[every] = strike_rough(W[np.ix_(places, places)], *given, [names[i] for i in rough])
        change = change + H[:, every] @ found[every]
    return found, change


def strike_rough(
    W: Array, rates: Array, e: Array, rest: Array, mu: Array, owner: NDArray[np.int64], names: Sequence[str]
) -> Array:
    """Impulses (k + s,) of k gaps, all of them closed, and of friction along s sliding velocities.

    Parameters
    ----------
    W : (k + s, k + s) array
        How impulses change rates: gaps first, then sliding velocities.
    rates, rest : (k + s,) arrays
        Before the impact, and the sizes at which they are rounding.
    e, mu : (k,) arrays
        Restitutions, coefficients of friction.
    owner : (s,) array of int
        The gap of each sliding velocity.
    names : sequence of str
        Of the gaps, for errors.

    Raises
    ------
    UsageError
        No impulses stop the gaps from closing.
    """
    k = len(e)
    rates = np.where(np.abs(rates) <= rest, 0.0, rates)
    found = np.zeros(len(rates))
    for group in _coupled(W, k, owner):
        if not (rates[group] < 0.0).any():
            continue
        places = [[i, *(k + np.flatnonzero(owner == i))] for i in group]
        every = [j for own in places for j in own]
        if len(group) == 1 and len(every) <= 2:
            i = group[0]
            found[every] = _in_the_plane(W[np.ix_(every, every)], rates[every], rest[i], mu[i], e[i], names[i])
        else:
            found[every] = _together(W, rates, places, mu[group], e[group], [names[i] for i in group])
    return found


def _coupled(W: Array, k: int, owner: NDArray[np.int64]) -> list[list[int]]:
    """Gaps that can move by impulses, in sets that do not move each other."""
    of = np.concatenate([np.arange(k), owner])
    size = np.sqrt(np.maximum(np.diag(W), 0.0))
    linked = np.abs(W) > COUPLED * np.outer(size, size)
    left, groups = [i for i in range(k) if W[i, i] > 0.0], list[list[int]]()
    while left:
        group, new = list[int](), [left.pop(0)]
        while new:
            i = new.pop()
            group.append(i)
            near = set(of[linked[of == i].any(axis=0)].tolist())
            new += [j for j in left if j in near]
            left = [j for j in left if j not in near]
        groups.append(sorted(group))
    return groups


def _in_the_plane(W: Array, rates: Array, rest: float, mu: float, e: float, name: str) -> Array:
    """Routh's method: impulses of one gap that closes, along it and, with friction, along the sliding velocity."""
    if len(rates) == 1:
        return np.array([-(1.0 + e) * rates[0] / W[0, 0]])
    (A, B), (_, C) = W
    y_n, y_t = rates
    P, Q, end = 0.0, 0.0, np.inf
    while end > P:
        holds = y_t == 0.0 and (not C > 0.0 or abs(B) <= mu * C)
        if holds:
            pull = -B / C if C > 0.0 else 0.0
        else:
            pull = -mu * float(np.sign(y_t or B))
        rise, turn = A + B * pull, 0.0 if holds else B + C * pull
        stops = -y_t / turn if y_t * turn < 0.0 else np.inf
        opens = end - P
        if end == np.inf:
            opens = -y_n / rise if rise > STRUCK * A else np.inf
        step = min(stops, opens)
        if not np.isfinite(step):
            raise untrue(
                f"gap {name}: friction of {mu:g} jams it, and no impulse stops it from closing; give a smaller "
                "coefficient of friction"
            )
        P, Q, y_n, y_t = P + step, Q + pull * step, y_n + rise * step, y_t + turn * step
        if stops <= opens:
            y_t = 0.0
        if end == np.inf and (opens <= stops or y_n >= -rest):
            end, y_n = (1.0 + e) * P, 0.0
        elif end < np.inf and opens <= stops:
            P = end
    return np.array([P, Q])


def _together(W: Array, rates: Array, places: list[list[int]], mu: Array, e: Array, names: list[str]) -> Array:
    """Impulses of gaps by Newton's and Coulomb's laws for the velocities after, in the order of the places."""
    m, d = len(places), max(map(len, places))
    where = np.full((m, d), -1)
    for row, own in zip(where, places, strict=True):
        row[: len(own)] = own
    there = (where >= 0).ravel()
    chosen = where.ravel()[there]
    full = np.zeros((m * d, m * d))
    full[np.ix_(there, there)] = W[np.ix_(chosen, chosen)]
    flat = np.zeros(m * d)
    flat[there] = rates[chosen]
    before = flat.reshape(m, d)
    back, fast = e * np.minimum(before[:, 0], 0.0), float(np.abs(before).max())
    start = np.zeros((m, d))

    def strike(part: float) -> tuple[Array, float]:
        """Impulses for restitutions times a factor, and how far they are from what is allowed."""
        c = before.copy()
        c[:, 0] += part * back
        problem = ContactProblem(full, c, mu)
        found = solve_contacts(problem, start, REACHED * fast, TRIALS)
        impulses = found.impulses
        if found.residual > GIVES * fast:
            other = impulses_in_space(problem, GIVES * fast) if problem.c.shape == (1, 3) else None
            if other is None:
                return impulses, np.inf
            impulses = other
        P = impulses.ravel()
        work = P * (2.0 * flat + full @ P)
        return impulses, float(work.sum()) - GAINS * float(np.abs(work).sum())

    impulses, gained = strike(1.0)
    if gained > 0.0:
        low, high = 0.0, 1.0
        impulses, gained = strike(0.0)
        if gained > 0.0:
            raise untrue(
                f"the search for impulses of the gaps {', '.join(names)} that obey the laws of impact and friction did "
                "not end, with restitutions of 0 either (there may be some); give smaller coefficients of friction"
            )
        for _ in range(HALVED):
            middle = 0.5 * (low + high)
            tried, gained = strike(middle)
            if gained > 0.0:
                high = middle
            else:
                low, impulses, start = middle, tried, tried
    return impulses.ravel()[there]
