"""The equations of an impact: Newton's and Poisson's laws, friction, true distances.

Velocities are measured by kinetic energy: z = F^T dc with F F^T the mass matrix of the free velocities c, so that the
columns h of H = F^-1 B^T n give changes of rates, H^T z, and the energy of a change is |z|^2 / 2.

Friction opposite to the direction u = (cos a, sin a) is P = P_n w, w = (1, -mu u).  The normal law y_n+ = 0 gives

    P_n = -c_n / D,    D = W_n w,    y_t+ = c_t + P_n W_t w,

and y_t+ must lie along u: F(a) = u x (D c_t - c_n W_t w) = 0, a sum of cosines and sines of a and 2 a, so of the fourth
degree in z = exp(i a).  All directions are found, where iterations for the impulses themselves may lead nowhere.

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

Friction compares the impulses along both, so a gap written at half its size would have twice the friction.  A distance
changes by n . d where a body moves by d without turning, with n of length 1; so do places along the surface.  The
sliding joints of an open tree move bodies in this way: the parts of n along their directions are known, and together
they are no longer than 1, and just as long where the directions span space.  Of closed loops, whose coordinates depend
on each other, and of directions that span less, a gap that is too small is not told.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ...base import algebra
from ...base.algebra import Array, rank
from ...base.limits.constraints import MEASURED
from ...base.limits.impacts import COUPLED, ENDLESS, FREE, GAINS, GIVES, LEFT, PUSHES, REACHED, STILL, STRUCK
from ...base.limits.numbers import EPS
from ...errors import cannot, untrue

if TYPE_CHECKING:
    from ..bound_model import BoundModel


# -- laws of restitution -----------------------------------------------------------------------------------------------


ROUNDS = 1000  #: impacts that may follow each other at one instant
FARTHEST = 1e5  #: change of the velocities, relative to the fastest approach, beyond which gaps cannot open together


def collide(H: Array, rates: Array, e: Array, rest: Array, names: Sequence[object]) -> tuple[Array, Array]:
    """Impulses (n,), and the change of velocities z = H impulses (m,), of impacts of gaps and of locked coordinates.

    Newton's law with complementarity, for all gaps together that close or are at rest (Moreau 1988; Glocker and
    Pfeiffer 1995; Brogliato, Nonsmooth Mechanics, 2016, ch. 5): 0 <= g, 0 <= rate+ + e min(rate-, 0), one of the two 0.
    That is the least change of velocities, in the metric of kinetic energy, that opens the gaps fast enough.  A gap
    that was opening and is closing after that makes a further impact at the same instant, with the rates reached so
    far.  Each of these loses the energy sum g (1 - e) |rate-| / 2, so none is ever gained, whatever the restitutions.

    H (m, n) has a column for each gap, then for each locked coordinate, 0 for those that nothing can move; rates (n,)
    are those before, of which the sizes ``rest`` are rounding, and e (k,) the restitutions of the k gaps.
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
        result = _least_change(free[:, involved], wanted[involved]) if k < ROUNDS else None
        if result is None:  # what is left after ever smaller impacts at one instant is plastic
            if k == 0 or -now.min() > ENDLESS * fastest:
                jammed = ", ".join(str(name) for name, one in zip(names, involved, strict=False) if one)
                raise untrue(
                    f"the gaps {jammed} cannot open together: bodies are jammed between them, and Newton's law has no "
                    "solution; give them restitution 0"
                )
            involved, wanted, k = live, -now, ROUNDS
            result = _least_change(free[:, involved], wanted[involved])
        z, g = result or (np.zeros(len(H)), np.zeros(int(involved.sum())))
        impulses[involved] += g
        change = change + z
        now = rates[:count] + gaps.T @ change
        if k == ROUNDS:
            break
    reactions = algebra.lstsq(locks, change - gaps @ impulses, rcond=None) if locks.shape[1] else np.zeros(0)
    return np.concatenate([impulses, reactions]) / sizes, change


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


# -- directions of sliding ---------------------------------------------------------------------------------------------


SAMPLES = 8  #: of a sum of waves up to those of 2 a: 5 or more determine it
ORDERS = np.array([2, 1, 0, -1, -2])  #: of its waves exp(i n a)
POLISHED = 3  #: Newton's iterations for the angle of a root, 1e-8 where two roots are near


def impulses_in_space(W: Array, c: Array, mu: float, tolerance: float) -> Array | None:
    """Impulses (3,) of a contact that slides, or holds, up to a residual (m/s); None where it can do neither.

    Of several those that take most energy from the velocities c (3,), which they change by W (3, 3).
    """
    result = [-algebra.lstsq(W, c)]
    for a in _angles(W, c, mu).tolist():
        w = np.array([1.0, -mu * np.cos(a), -mu * np.sin(a)])
        gives = float(W[0] @ w)
        if gives * -c[0] > 0.0:
            result.append(-c[0] / gives * w)
    fit = [P for P in result if _residual(W, c, mu, P) <= tolerance]
    return min(fit, key=lambda P: float(P @ (c + 0.5 * W @ P))) if fit else None


def _residual(W: Array, c: Array, mu: float, P: Array) -> float:
    """How far impulses P (3,) of a contact are from Signorini's and Coulomb's laws (m/s), by their natural maps.

    P. Alart, A. Curnier, A mixed formulation for frictional contact problems prone to Newton like solution methods,
    Comput. Methods Appl. Mech. Eng. 92 (1991), 353-375.
    """
    y, normal, tangential = c + W @ P, W[0, 0] or 1.0, W[1, 1] + W[2, 2] or 1.0
    pressed = max(float(P[0] - y[0] / normal), 0.0)
    pulled = P[1:] - y[1:] / tangential
    part = min(1.0, mu * pressed / max(float(np.sqrt(pulled @ pulled)), np.finfo(float).tiny))
    return float(np.abs([normal * (P[0] - pressed), *(tangential * (P[1:] - part * pulled))]).max())


def _angles(W: Array, c: Array, mu: float) -> Array:
    """Zeros of F, among them all directions in which the contact can slide."""
    a = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    u = np.array([np.cos(a), np.sin(a)])
    moved = W @ np.vstack([np.ones(SAMPLES), -mu * u])
    y = moved[0] * c[1:, None] - c[0] * moved[1:]
    waves = (np.fft.fft(u[0] * y[1] - u[1] * y[0]) / SAMPLES)[ORDERS]
    orders = ORDERS if abs(waves[0]) > EPS * np.abs(waves).max() else ORDERS[1:-1]
    waves = waves[2 - orders]
    if not abs(waves[0]) > 0.0:  # NaN included
        return np.zeros(0)
    companion = np.eye(len(waves) - 1, k=-1, dtype=complex)
    companion[0] = -waves[1:] / waves[0]
    angles = np.angle(algebra.eigvals(companion))
    for _ in range(POLISHED):
        each = waves * np.exp(1j * np.outer(angles, orders))
        value, slope = each.sum(axis=1).real, (1j * orders * each).sum(axis=1).real
        angles = angles - np.where(np.abs(slope) > np.abs(value), value / np.where(slope == 0.0, 1.0, slope), 0.0)
    return np.asarray(angles)


# -- friction ----------------------------------------------------------------------------------------------------------


TRIALS = 400  #: iterations for the impulses of one instant
#: (W, c, friction, start, tolerance, iterations) -> impulses, iterations, residual
Solve: TypeAlias = Callable[[Array, Array, Array, Array, float, int], tuple[Array, int, float]]
HALVED = 40  #: halvings of the range of the factor of restitutions


class Sliding(NamedTuple):
    """Where gaps have friction: the velocities with which they slide, s in all."""

    names: tuple[str, ...]
    owner: NDArray[np.int64]  #: (s,) the gap of each
    coefficients: Array  #: (k,) of each gap, 0 or greater
    rows: Array  #: (s, n_v) derivatives by v
    rates: Array  #: (s,) before


def strike(
    solve: Solve, H: Array, rates: Array, e: Array, rest: Array, mu: Array, owner: NDArray[np.int64],
    names: Sequence[str],
) -> tuple[Array, Array]:  # fmt: skip
    """Impulses (k + s,) and the change of velocities (m,), where some of k gaps have friction.

    Gaps that share no body with one of friction greater than 0 obey :func:`collide`, all at once.  H (m, k + s) is as
    there, gaps first, then sliding velocities; the others are as for :func:`strike_rough`.
    """
    k = len(e)
    rubbing = np.flatnonzero(mu[owner] > 0.0)
    used, owner = [*range(k), *(k + rubbing).tolist()], owner[rubbing]
    W = H[:, used].T @ H[:, used]
    rough = sorted(i for group in _coupled(W, k, owner) if np.isin(owner, group).any() for i in group)
    smooth = [i for i in range(k) if i not in rough]
    result, change = np.zeros(len(rates)), np.zeros(len(H))
    if smooth:
        named = [names[i] for i in smooth]
        result[smooth], change = collide(H[:, smooth], rates[smooth], e[smooth], rest[smooth], named)
    if rough:
        of = np.flatnonzero(np.isin(owner, rough))
        places = [*rough, *(k + of).tolist()]
        every = [used[i] for i in places]
        raw = rates[every], e[rough], rest[every], mu[rough], np.searchsorted(rough, owner[of])
        result[every] = strike_rough(solve, W[np.ix_(places, places)], *raw, [names[i] for i in rough])
        change = change + H[:, every] @ result[every]
    return result, change


def strike_rough(
    solve: Solve, W: Array, rates: Array, e: Array, rest: Array, mu: Array, owner: NDArray[np.int64],
    names: Sequence[str],
) -> Array:  # fmt: skip
    """Impulses (k + s,) of k gaps, all of them closed, and of friction along s sliding velocities.

    W (k + s, k + s) tells how impulses change rates, gaps first; rates and the sizes ``rest`` at which they are
    rounding are those before the impact.  Restitutions e and coefficients mu are (k,); ``owner`` (s,) is the gap of
    each sliding velocity.  ``solve`` is ``solve_contacts`` of ``eomgen._native``.  Refuses where no impulses stop the
    gaps from closing.
    """
    k = len(e)
    rates = np.where(np.abs(rates) <= rest, 0.0, rates)
    result = np.zeros(len(rates))
    for group in _coupled(W, k, owner):
        if not (rates[group] < 0.0).any():
            continue
        places = [[i, *(k + np.flatnonzero(owner == i))] for i in group]
        every = [j for members in places for j in members]
        if len(group) == 1 and len(every) <= 2:
            i = group[0]
            result[every] = _in_the_plane(W[np.ix_(every, every)], rates[every], rest[i], mu[i], e[i], names[i])
        else:
            result[every] = _together(solve, W, rates, places, mu[group], e[group], [names[i] for i in group])
    return result


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


def _together(
    solve: Solve, W: Array, rates: Array, places: list[list[int]], mu: Array, e: Array, names: list[str]
) -> Array:
    """Impulses of gaps by Newton's and Coulomb's laws for the velocities after, in the order of the places."""
    m, d = len(places), max(map(len, places))
    where = np.full((m, d), -1)
    for row, members in zip(where, places, strict=True):
        row[: len(members)] = members
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
        impulses, _, residual = solve(full, c, mu, start, REACHED * fast, TRIALS)
        if residual > GIVES * fast:
            other = impulses_in_space(full, c[0], float(mu[0]), GIVES * fast) if c.shape == (1, 3) else None
            if other is None:
                return impulses, np.inf
            impulses = other[None]
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


# -- distances that gaps stand for -------------------------------------------------------------------------------------


def require_distances(
    module: BoundModel, t: float, q: Array, normals: Array, names: Sequence[str], sliding: Sliding
) -> None:
    """Refuse gaps with friction whose derivatives (n, n_v) by velocities are not those of distances."""
    layout = module.layout
    joints = layout.info.translations
    rubs = np.flatnonzero(sliding.coefficients[sliding.owner] > 0.0)
    depend = layout.n_c or layout.info.rows_to_hold  # coordinates, on each other
    if not joints or not rubs.size or depend or "poses" not in module.kernels.core.names:
        return
    for gap in sorted({*sliding.owner[rubs].tolist()}):
        rubbing = [k for k in rubs.tolist() if sliding.owner[k] == gap]
        rows = np.vstack([normals[gap], sliding.rows[rubbing]])
        said = [f"gap {names[gap]}", *(f"sliding velocity {sliding.names[k]}" for k in rubbing)]
        crossed = [np.abs(rows[:, places]).max(initial=0.0) > MEASURED for _, _, _, places in joints]
        for j in np.flatnonzero(crossed).tolist():
            chain, name = [j], joints[j][0]
            while (inner := joints[chain[-1]][1]) >= 0:
                chain.append(inner)
            places = [k for i in chain if crossed[i] for k in joints[i][3]]
            D = _directions(module, t, q, joints[j][2], places)
            lengths = np.linalg.norm(algebra.lstsq(D, rows[:, places].T, rcond=MEASURED), axis=0)
            exact = rank(D).rank == 3
            for what, length in zip(said, lengths.tolist(), strict=True):
                if length > 1.0 + MEASURED or (exact and MEASURED < length < 1.0 - MEASURED):
                    raise cannot(
                        f"{what} changes by {length:.6g} for each unit of length by which joint {name} moves along it: "
                        "friction compares the impulses along the gap and along its sliding velocity, so the gap must "
                        f"be the distance and the velocity that of its place; divide it by {length:.6g}"
                        f"{'' if exact else ', or more where they move askew'}"
                    )


def _directions(module: BoundModel, t: float, q: Array, body: int, places: Sequence[int]) -> Array:
    """Directions (k, 3) in which velocities at some places move a body; a difference over a length is exact here."""
    scales = module.layout.scales
    units = np.eye(module.layout.n_v)[list(places)]
    ends = np.stack([scales.move(q, side * e) for e in units for side in (0.5, -0.5)])
    origins = np.asarray(module.poses(np.ascontiguousarray(ends.T), t=t))[body, :3, 3]
    return np.asarray((origins[:, ::2] - origins[:, 1::2]) / scales.q[list(places)]).T
