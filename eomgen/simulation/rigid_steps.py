"""One step of a mechanism with rigid contacts, forces, impacts and friction at once.

The scheme is Moreau's midpoint rule (J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics, in
Nonsmooth Mechanics and Applications, 1988, 1-82; V. Acary, B. Brogliato, Numerical Methods for Nonsmooth Dynamical
Systems, 2008, section 10.1).  With the position q_m = q + h/2 N v half a step on,

    M (v+ - v) + h b(q_m, (v + v+)/2) = J^T P + C^T L,      C(q+) v+ + C_t = 0,      q+ = q_m + h/2 N v+,

with M, J and C of the middle where nothing else is said, and the laws of rigid contact (eomgen_contacts.h) between
impulses P and velocities J v+. The normal velocity is to be at least -e times the one before where shapes
touch, and -g/h where they are a gap g apart and come to rest on each other (D. E. Stewart, J. C. Trinkle, An implicit
time-stepping scheme for rigid body dynamics with inelastic collisions and Coulomb friction, Int. J. Numer. Methods Eng.
39 (1996), 2673-2691). Where shapes land, an impact without rebound, they go on with a part of the whole impact,
friction and what else acts with it, after which they meet in the middle of the next step, where the rest follows: both
end as the impact at once. What is left of penetrations and of open loops is removed from the positions alone (V. Acary,
Projected event-capturing time-stepping schemes, Comput. Methods Appl. Mech. Eng. 256 (2013), 224-250).

Constraints hold for the velocities at the end of a step and push in the middle, as in SHAKE and its form by velocities
(J. P. Ryckaert, G. Ciccotti, H. J. C. Berendsen, J. Comput. Phys. 23 (1977), 327-341; H. C. Andersen, J. Comput. Phys.
52 (1983), 24-34): but for the closing of loops, of order h^3, a step read backwards is the same step, and loops are of
second order.  C(q+) is not formed: C v+ is aimed at what makes C(q+) v+ + C_t vanish, first at that with which the
constraints hold for the mean of v and v+, and contacts are solved again until they do not feel the difference.

Contacts are those that are near at q_m.  Before and after it bodies move at constant velocities, v and v+, and
``meeting_time`` says how long no two shapes that are apart meet, or go far beside their thickness.  A step whose halves
are longer is done in two.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.contacts import (
    APART,
    CLOSINGS,
    GENTLER,
    GROWN,
    HALVINGS,
    LINKED,
    REMOVED,
    RESTING,
    ROUGH,
    ROUNDS,
    UNSOLVED,
    YIELDING,
)
from ..errors import SimulationError, UsageError, cannot, off_range
from ..numeric.pair_sums import RECORD
from ..runtime.late import LateCore, eager

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.inputs import Forcing


# -- rows of contacts --------------------------------------------------------------------------------------------------


class RigidRows(NamedTuple):
    """Contacts that may act, m of them."""

    pairs: Array  #: (m, 2) numbers of both shapes
    gaps: Array  #: (m,)
    jacobian: Array  #: (m d, n_v): velocities along the normal and across it, of the second shape relative to the first
    friction: Array  #: (m,)
    restitution: Array  #: (m,)
    places: Array  #: (m, 9): normal, first direction across, and point, in ground axes

    def chosen(self, which: Any) -> RigidRows:
        """Some of them."""
        m = len(self.gaps)
        rows = self.jacobian.reshape(m, -1, self.jacobian.shape[1])[which]
        given = (self.pairs[which], self.gaps[which], rows.reshape(-1, self.jacobian.shape[1]))
        return RigidRows(*given, self.friction[which], self.restitution[which], self.places[which])


class RigidContacts:
    """The contacts of a model.

    Raises
    ------
    UsageError
        It has none, or all of them are on soil.
    """

    def __init__(self, module: BoundModel) -> None:
        known = module.metadata.get("rigid_contacts")
        if not known:
            raise cannot(
                f"method moreau is for rigid contact between groups of shapes, and {module.name} has no contacts that "
                "can be rigid (soil yields): describe them by m.contacts(...) without soil, or choose another method"
            )
        self.lists: list[tuple[str, int, int]] = [tuple(row) for row in known["lists"]]
        parents = known["parents"]
        n = len(parents)
        self.moves = np.zeros((len(known["moved_by"]), module.layout.n_v))
        for shape, last in enumerate(known["moved_by"]):
            while last >= 0:
                self.moves[shape, last] = 1.0
                last = parents[last]
        assert n <= module.layout.n_v
        self.near = module.kernels.state("near_pairs")
        self.axes = module.kernels.state("motion_axes")

    def records(self, t: float, q: Array, u: Any) -> Array:
        """Pairs that are near (k, ``RECORD``), shapes numbered over all contacts."""
        every = self.near(q, u=u, t=t)
        found = []
        start = shapes = 0
        for name, numbers, count in self.lists:
            listed = int(every[start])
            room = (numbers - 1) // RECORD
            if listed > room:
                raise SimulationError(
                    f"contacts {name!r}: {listed} pairs of shapes are near each other at t = {t:.6g} s, and there is "
                    f"room for {room}; leave out shapes that overlap others of their body, or put shapes that "
                    "never meet into contacts of their own",
                    code="EG-TOO-LARGE",
                )
            rows = every[start + 1 : start + 1 + RECORD * listed].reshape(listed, RECORD).copy()
            rows[:, :2] += shapes
            found.append(rows)
            start, shapes = start + numbers, shapes + count
        return np.concatenate(found)

    def rows(self, t: float, q: Array, u: Any) -> RigidRows:
        """The contacts at one position.

        Raises
        ------
        UsageError
            A coefficient of friction is negative, or a restitution not within 0 and 1.
        """
        records = self.records(t, q, u)
        pairs, normal, point, flat = records[:, :2].astype(int), records[:, 2:5], records[:, 6:9], records[:, 9:12]
        self._require_law(records)
        planar = (flat != 0.0).any(axis=1)
        lone = np.zeros((len(records), 3))  # an axis far from the normal
        lone[np.arange(len(records)), 2 - np.argmin(np.abs(normal[:, ::-1]), axis=1)] = 1.0
        first = np.cross(np.where(planar[:, None], flat, lone), normal)
        first /= np.maximum(np.sqrt((first * first).sum(axis=1)), np.finfo(float).tiny)[:, None]
        ways = [normal, first]
        if not planar.all():
            ways.append(np.where(planar[:, None], 0.0, np.cross(normal, first)))
        along = np.stack(ways, axis=1)  # (m, d, 3)
        wrench = np.concatenate([np.cross(point[:, None], along), along], axis=2)
        apart = self.moves[pairs[:, 1]] - self.moves[pairs[:, 0]]
        jacobian = apart[:, None] * (wrench @ self.axes(q, u=u, t=t).T)
        laws = records[:, 12], records[:, 13]
        places = np.concatenate([normal, first, point], axis=1)
        return RigidRows(pairs, -records[:, 5], jacobian.reshape(-1, apart.shape[1]), *laws, places)

    def _require_law(self, records: Array) -> None:
        friction, restitution = records[:, 12], records[:, 13]
        bad = ~(friction >= 0.0) | ~((restitution >= 0.0) & (restitution <= 1.0))
        if bad.any():
            k = int(np.argmax(bad))
            starts = np.cumsum([count for *_, count in self.lists])
            name = self.lists[int(np.searchsorted(starts, records[k, 0], side="right"))][0]
            raise off_range(
                f"contacts {name!r}: friction is {friction[k]:.6g} and restitution {restitution[k]:.6g}; friction is "
                "0 or greater, restitution from 0 to 1"
            )


# -- one position ------------------------------------------------------------------------------------------------------


Spot = tuple[int, int, int]  #: two shapes, and the number of the place where they touch


def _numbered(pairs: Sequence[Sequence[int]]) -> list[Spot]:
    """Pairs of shapes, those that touch at several places numbered."""
    found: list[Spot] = []
    seen: dict[tuple[int, int], int] = {}
    for a, b in pairs:
        place = seen.get((a, b), 0)
        seen[a, b] = place + 1
        found.append((a, b, place))
    return found


class Meeting:
    """The contacts of one position, which the two rounds of a step share.

    Attributes
    ----------
    before, start : (m, d) array
        Velocities before the impulses, and a guess of these: those of the same pairs of shapes in the last step.
    spread : (n_v, m d) array
        Velocities by impulses.
    compliance : (m d, m d) array
        Velocities of contacts by impulses.
    scale : float
        (m/s) What the tolerance of their impulses is relative to.
    """

    def __init__(self, held: HeldInertia, rows: RigidRows, v: Array, last: dict[Spot, Array]) -> None:
        m = len(rows.gaps)
        d = len(rows.jacobian) // m
        self.rows, self.scale = rows, 0.0
        self.before = (rows.jacobian @ v).reshape(m, d)
        self.spread = held.inverse @ rows.jacobian.T
        self.compliance = rows.jacobian @ self.spread
        self.keys = _numbered(rows.pairs.tolist())
        none = np.zeros(d)
        self.start = np.array([last.get(key, none)[:d] for key in self.keys])

    def shared(self, values: Array, acts: NDArray[np.bool_]) -> Array:
        """Of each contact (m,) the greatest value of those that act on each other, by impulses (m, d) that are none."""
        m, d = acts.shape
        own = np.diag(self.compliance)
        linked = (self.compliance**2 > LINKED * np.outer(own, own)).reshape(m, d, m, d).any(axis=(1, 3))
        linked &= np.outer(acts.any(axis=1), acts.any(axis=1))
        while not np.array_equal(values, more := np.maximum(values, (linked * values).max(axis=1))):
            values = more
        return values


class HeldInertia:
    """The inertia and the constraints at one position.

    ``inverse`` is the matrix A with which velocities change by A f under impulses f, constraints held.
    """

    def __init__(self, module: BoundModel, t: float, q: Array, u: Any) -> None:
        kernels = module.kernels
        self.module = module
        M = kernels.mass_matrix(q, u=u, t=t)
        self.rows: Array | None = None
        if not module.layout.n_c:
            self.inverse = algebra.inv(M)
            return
        C = kernels.constraint_jacobian(q, u=u, t=t)
        x = np.concatenate([q, np.zeros(module.layout.n_v)])
        self.drift = kernels.velocity_constraints(x, u=u, t=t)
        weight = np.trace(M) / max(float((C * C).sum()), np.finfo(float).tiny)
        whole = algebra.inv(M + weight * (C.T @ C))  # regular where M is singular but constraints hold the rest
        spread = whole @ C.T
        self.back = spread @ algebra.pinv(C @ spread)
        self.rows = C
        self.inverse = whole - self.back @ spread.T
        self.inverse = 0.5 * (self.inverse + self.inverse.T)

    def turn_round(self, v: Array) -> None:
        """Aim at velocities v+ with which the constraints hold for the mean of v and v+."""
        if self.rows is not None:
            self.wanted = -2.0 * self.drift - self.rows @ v

    def aim(self, excess: Array) -> None:
        """Aim at velocities smaller by an excess."""
        if self.rows is not None:
            self.wanted = self.wanted - self.rows @ excess

    def free(self, v: Array) -> Array:
        """Velocities as aimed at, from what forces alone would make of them."""
        return v if self.rows is None else v - self.back @ (self.rows @ v - self.wanted)

    def excess(self, q: Array, v: Array, t: float, u: Any) -> Array:
        """What velocities v (n_v,) at a position have too much for the constraints there, in the metric of here."""
        return np.asarray(self.back @ self.module.kernels.velocity_constraints(np.concatenate([q, v]), u=u, t=t))

    def closing(self, q: Array, t: float, u: Any) -> Array:
        """A displacement (n_v,) that closes the loops: a Newton step."""
        if self.rows is None or not self.module.layout.n_h:
            return np.zeros(self.inverse.shape[0])
        found = self.module.kernels.constraints(q, u=u, t=t)
        return np.asarray(-self.back[:, : len(found)] @ found)


# -- the step ----------------------------------------------------------------------------------------------------------


class ContactImpulses(NamedTuple):
    """What was found."""

    impulses: Array  #: (m, d)
    iterations: int  #: Newton's, and sweeps
    residual: float  #: (m/s) the largest entry of the natural maps, as velocities


class RigidSteps:
    """The steps of one run; attributes tell how well contacts were solved.

    Attributes
    ----------
    residual : float
        (m/s) The largest residual of the impulses of a step.
    missed : int
        Steps one of whose solutions misses its tolerance: for the velocities with which forces act, for the impulses,
        or for what removes penetrations.
    iterations, most : int
        The most that a step took, and the most contacts that acted at once.
    depth : float
        The deepest penetration (m).
    taken : int
        Steps, those among them that others were divided into.
    acting : list of (m, 14) arrays
        Contacts of steps since the list was emptied: both shapes, normal (3), first direction across it (3), point (3),
        impulses along the normal and across it (3), which act on the second shape.
    """

    def __init__(self, module: BoundModel, forcing: Forcing, tolerance: float, iterations: int) -> None:
        self.module, self.forcing = module, forcing
        self.tolerance, self.allowed = tolerance, iterations
        self.contacts = RigidContacts(module)
        self.bias = module.kernels.timed("bias_apart")
        self.residual, self.missed, self.iterations, self.most, self.depth = 0.0, 0, 0, 0, 0.0
        self.taken = 0
        self.acting: list[Array] = []
        self._misses = False
        self._begins = True
        names = module.kernels.core.names
        self._meeting = module.kernels.motion("meeting_time") if "meeting_time" in names else None
        core: Any = eager(module.core)
        self._solve = core.solve_contacts
        self._last: dict[Spot, Array] = {}
        self._in_c = rigid_stepper(module, forcing, self.contacts, tolerance, iterations)

    def move(self, q: Array, d: Array) -> Array:
        """The position that velocities d (n_v,) lead to in unit time."""
        space = self.module.layout.space
        return q + d if space is None else space.normalised(space.move(q, d))

    def step(self, t: float, q: Array, v: Array, h: float) -> tuple[Array, Array]:
        """Position and velocities (n_q,), (n_v,) a time h later.

        Raises
        ------
        SimulationError
            Shapes pass each other in steps that are much shorter.
        """
        return self._whole_or_halves(t, q, v, h, HALVINGS)

    def finish(self) -> None:
        """Count what compiled code did among the rest."""
        if self._in_c is not None:
            done, self._in_c = self._in_c, None
            self.residual, self.depth = max(self.residual, done.residual), max(self.depth, done.depth)
            self.iterations, self.most = max(self.iterations, done.iterations), max(self.most, done.contacts)
            self.missed += done.missed

    def _whole_or_halves(self, t: float, q: Array, v: Array, h: float, left: int) -> tuple[Array, Array]:
        known = self.residual, self.missed, self.iterations, self.most, self.depth
        found = self._one(t, q, v, h)
        if found is not None:
            self.taken += 1
            self._begins = False
            return found
        self.residual, self.missed, self.iterations, self.most, self.depth = known
        if not left:
            raise SimulationError(
                f"moreau stopped at t = {t:.6g} s: shapes move so fast that they may pass through each other even in "
                f"steps of {h:.3g} s; take a smaller step, and see whether the velocities are meant"
            )
        q, v = self._whole_or_halves(t, q, v, 0.5 * h, left - 1)
        return self._whole_or_halves(t + 0.5 * h, q, v, 0.5 * h, left - 1)

    def _passes(self, t: float, q: Array, v: Array, u: Any, h: float) -> bool:
        """Whether shapes that are apart may meet within a time h at constant velocities, or go far by their size."""
        if self._meeting is None:
            return False
        return bool(self._meeting(q, v, np.zeros_like(v), u=u, t=t)[0] < h)

    def _one(self, t: float, q: Array, v: Array, h: float) -> tuple[Array, Array] | None:
        """One step, or None where shapes may pass each other in one of its halves."""
        if self._in_c is not None:
            x = np.concatenate([q, v])
            status = self._in_c.step(t, h, x, x)
            if status == TOO_LONG:
                return None
            if status == DONE:
                self.acting.append(self._in_c.contacts_of_step())
                return x[: len(q)], x[len(q) :]
        return self._in_python(t, q, v, h)

    def _in_python(self, t: float, q: Array, v: Array, h: float) -> tuple[Array, Array] | None:
        """The same here, which says what is wrong where compiled code fails."""
        middle, n_q = t + 0.5 * h, len(q)
        self._misses = False
        q_m = self.move(q, 0.5 * h * v)
        x = np.concatenate([q_m, v])
        u = self.forcing(middle, x) if self.forcing else None
        if self._passes(t, q, v, u, 0.5 * h):
            return None
        if self._begins and self._passes(t, self.move(q, -0.5 * h * v), v, u, 0.5 * h):
            return None  # shapes that touch at the start and approach: later steps end with velocities that part them
        held = HeldInertia(self.module, middle, q_m, u)
        bias = self.bias(middle, x, u=u)
        held.turn_round(v)
        free = held.free(v - h * (held.inverse @ bias))
        rows = self._near(self.contacts.rows(middle, q_m, u), v, free, h)
        meeting = Meeting(held, rows, v, self._last) if rows.gaps.size else None
        x[n_q:] = 0.5 * (v + free)
        # forces that do not change with velocities need one solution, which then is the one that counts
        rough = 1.0 if np.array_equal(self.bias(middle, x, u=u), bias) else ROUGH
        for k in range(ROUNDS):
            new, P = self._contact(meeting, free, h, 1.0 if k else rough)
            if k and held.rows is None:
                break
            x[n_q:] = 0.5 * (v + new)
            again = self.bias(middle, x, u=u)
            settled = k > 0 or (rough == 1.0 and np.array_equal(again, bias))
            if held.rows is not None:
                position = self.move(q_m, 0.5 * h * new)
                position = self.move(position, held.closing(position, t + h, self._at_end(t + h, position, new)))
                excess = held.excess(position, new, t + h, self._at_end(t + h, position, new))
                settled = self._bears(meeting, excess, last=k == ROUNDS - 1) and settled
                held.aim(excess)
            if settled:
                break
            bias = again
            free = held.free(v - h * (held.inverse @ bias))
        if self._passes(middle, q_m, new, u, 0.5 * h):
            return None
        position = self.move(q_m, 0.5 * h * new)
        pushed = np.zeros((len(P), 3))
        pushed[:, : P.shape[1]] = P
        self.acting.append(np.concatenate([rows.pairs, rows.places, pushed], axis=1))
        if rows.gaps.size:
            away = self._out(held, rows, P, new, h, self.tolerance * h * meeting.scale if meeting else 0.0)
            position = self.move(position, away) if away.any() else position
        if held.rows is not None:
            position, new = self._closed(held, t + h, position, new)
        self.missed += self._misses
        return position, new

    def _at_end(self, t: float, q: Array, v: Array) -> Any:
        return self.forcing(t, np.concatenate([q, v])) if self.forcing else None

    def _bears(self, meeting: Meeting | None, excess: Array, last: bool) -> bool:
        """Whether contacts do not feel that velocities are projected by so much; if not in the last round, a miss."""
        felt = 0.0 if meeting is None else float(np.abs(meeting.rows.jacobian @ excess).max())
        if meeting is None or felt <= self.tolerance * meeting.scale:
            return True
        if last:
            self._misses, self.residual = True, max(self.residual, felt)
        return last

    def _closed(self, held: HeldInertia, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Position and velocities on the constraints at t to rounding, by Newton steps along those of the middle."""
        u = self._at_end(t, q, v)
        before = np.inf
        for _ in range(CLOSINGS):
            d = held.closing(q, t, u)
            size = float(np.abs(d).max())
            if not size < 0.5 * before:
                break
            q, before = self.move(q, d), size
        before = np.inf
        for _ in range(CLOSINGS):
            d = held.excess(q, v, t, u)
            size = float(np.abs(d).max())
            if not size < 0.5 * before:
                break
            v, before = v - d, size
        return q, v

    def _near(self, rows: RigidRows, v: Array, free: Array, h: float) -> RigidRows:
        """Contacts that may act in this step: those that touch, or would soon."""
        if not rows.gaps.size:
            return rows
        self.depth = max(self.depth, float(-rows.gaps.min()))
        fastest = max(float(np.abs(rows.jacobian @ velocity).max()) for velocity in (v, free))
        return rows.chosen(np.flatnonzero(rows.gaps <= 2.0 * h * fastest))

    def _contact(self, meeting: Meeting | None, free: Array, h: float, rough: float) -> tuple[Array, Array]:
        """Velocities after the impulses of contacts, and these (m, d), to so many times the tolerance."""
        if meeting is None:
            return free, np.zeros((0, 2))
        rows, before, W = meeting.rows, meeting.before, meeting.compliance
        undisturbed = (rows.jacobian @ free).reshape(before.shape)
        fast = before[:, 0] < -RESTING * np.abs(undisturbed[:, 0] - before[:, 0])
        strikes = fast & (rows.gaps + h * undisturbed[:, 0] < 0.0)
        bounces = strikes & (rows.restitution > 0.0)
        arrive = np.where(rows.gaps > 0.0, -rows.gaps / h, 0.0)
        back = np.where(bounces, -rows.restitution * before[:, 0] - arrive, 0.0)
        scale = meeting.scale = max(float(np.abs(before).max()), float(np.abs(undisturbed).max()))
        lands = strikes & ~bounces & (rows.gaps > 0.0) & (before[:, 0] < -self.tolerance * scale)
        self._rests = ~bounces
        for k in range(GENTLER + 1):
            part = 0.0 if k == GENTLER else 0.5**k
            c = undisturbed.copy()
            c[:, 0] -= arrive + part * back
            landed = self._landing(meeting, undisturbed, c, lands, h, rough) if lands.any() and not k else None
            if landed is None:
                landed = self._impulses(W, c, rows.friction, meeting.start, rough * self.tolerance * scale)
            found = landed
            P = found.impulses.ravel()
            if not back.any():
                break
            after = undisturbed.ravel() + W @ P
            work = float(P @ (after + before.ravel()))  # twice: forces act with the velocity of the middle
            grown = GROWN * float(np.abs(P) @ (np.abs(after) + np.abs(before.ravel())))
            # impacts with friction and restitution may give energy by Newton's law (Kane and Levinson, 1985), and
            # mechanisms that friction jams have none
            if work <= grown and found.residual <= UNSOLVED * scale:
                break
        self._note(found, scale, rough)
        self._last = dict(zip(meeting.keys, found.impulses, strict=True))
        meeting.start = found.impulses
        return free + meeting.spread @ P, found.impulses

    def _landing(
        self, meeting: Meeting, undisturbed: Array, c: Array, lands: NDArray[np.bool_], h: float, rough: float
    ) -> ContactImpulses | None:
        """The part of an impact without rebound that leaves shapes as fast as they meet in the next middle.

        It is a part of all impulses, friction too, between those without the contacts that land and those of the whole
        impact, so that the rest, which comes then, ends as the whole would have.  Contacts that act on each other have
        one part.  None where the impulses are not found.
        """
        rows, W, scale = meeting.rows, meeting.compliance, meeting.scale
        tolerance = rough * self.tolerance * scale
        c = c.copy()
        c[lands, 0] = undisturbed[lands, 0]
        whole = self._impulses(W, c, rows.friction, meeting.start, tolerance)
        c[lands, 0] = APART * scale
        without = self._impulses(W, c, rows.friction, meeting.start, tolerance)
        residual = max(whole.residual, without.residual)
        if not residual <= tolerance:
            return None
        approach = (undisturbed.ravel() + W @ without.impulses.ravel()).reshape(c.shape)[:, 0]
        meets = lands & (approach < 0.0)
        own = np.where(meets, np.maximum(0.0, 1.0 + rows.gaps / np.where(meets, h * approach, 1.0)), 0.0)
        part = meeting.shared(own, (whole.impulses != 0.0) | (without.impulses != 0.0))[:, None]
        impulses = (1.0 - part) * without.impulses + part * whole.impulses
        return ContactImpulses(impulses, max(whole.iterations, without.iterations), residual)

    def _impulses(self, W: Array, c: Array, friction: Array, start: Array, tolerance: float) -> ContactImpulses:
        return ContactImpulses(*self._solve(W, c, friction, start, tolerance, self.allowed))

    def _note(self, found: ContactImpulses, scale: float, rough: float) -> None:
        if rough == 1.0:
            self.residual = max(self.residual, found.residual)
        self._misses = self._misses or not found.residual <= rough * self.tolerance * scale
        self.iterations, self.most = max(self.iterations, found.iterations), max(self.most, len(found.impulses))

    def _out(self, held: HeldInertia, rows: RigidRows, P: Array, new: Array, h: float, least: float) -> Array:
        """A displacement (n_v,) that removes a part of the penetration of contacts that last, with load or without.

        The ``least`` is what velocities within their tolerance make in one step.
        """
        d = len(rows.jacobian) // len(rows.gaps)
        normal = rows.jacobian[::d]
        removed = -REMOVED * rows.gaps
        lasts = (rows.gaps < -least) & self._rests & ((P[:, 0] > 0.0) | (h * (normal @ new) < removed))
        if not lasts.any():
            return np.zeros(len(new))
        J, wanted = normal[lasts], removed[lasts]
        spread = held.inverse @ J.T
        W = J @ spread
        W += YIELDING * np.diag(np.diag(W))
        nothing = np.zeros(len(wanted))
        allowed = self.tolerance * float(wanted.max())
        found = self._impulses(W, -wanted[:, None], nothing, nothing[:, None], allowed)
        self._misses = self._misses or not found.residual <= allowed
        return np.asarray(spread @ found.impulses.ravel())


# -- steps in compiled code --------------------------------------------------------------------------------------------


DONE, TOO_LONG = 0, 1  #: what a step comes back with: eomgen/native/contacts/eomgen_contacts.h
NEEDED = ("mass_matrix", "near_pairs", "motion_axes", "bias_apart")
OF_CONSTRAINTS = ("constraint_jacobian", "velocity_constraints", "constraints")


def rigid_stepper(
    module: BoundModel, forcing: Forcing, contacts: RigidContacts, tolerance: float, iterations: int
) -> Any | None:
    """The compiled steps of one run; None where the module lacks kernels."""
    layout = module.layout
    wanted = [*NEEDED, *(OF_CONSTRAINTS if layout.n_c else ())]
    known = module.kernels.core.names
    if not set(wanted) <= {*known} | ({"constraints"} if not layout.n_h else set()):
        return None
    wanted += ["meeting_time"]
    bound = module.kernels.context
    cores: list[Any] = []
    sources: dict[str, Any] = {}
    for name in wanted:
        if name not in known:
            continue
        core: Any = module.kernels.core
        core = core.having(name) if isinstance(core, LateCore) and name not in core.core.names else eager(core)
        context = bound if core is eager(module.core) else core.context(bound.p, bound.u, UsageError)
        cores.append(core)
        sources[name] = core.address(name), context.c
    space = layout.space
    plain = [(k, k) for k in range(layout.n_q)] if space is None else [*zip(space.plain_q, space.plain_v, strict=True)]
    tables = {
        "rows": layout.rows,
        "plain": np.ravel(plain),
        "balls": np.ravel([] if space is None else space.quaternion_slots),
        "lists": np.ravel([(numbers, count) for _, numbers, count in contacts.lists]),
        "moved": contacts.moves,
    }
    facts = {
        "n_rows": layout.n_c,
        "n_c": len(layout.rows),
        "n_h": int(np.count_nonzero(layout.rows < layout.n_h)),
        "n_spots": sum(numbers for _, numbers, _ in contacts.lists),
    }
    n_work = max(core.sizes["n_work"] for core in cores)
    outside = forcing if forcing.foreign else None
    within = forcing.within or (-np.inf, np.inf)
    signals = [] if outside is not None else forcing.encode()
    stepped: Any = eager(module.core)
    return stepped.rigid_stepper(bound, sources, n_work, facts, tables, tolerance, iterations, signals, outside, within)
