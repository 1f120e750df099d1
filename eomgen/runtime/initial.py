"""Values by name -> an assembled position or state."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from copy import copy
from typing import NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array, Indices, parts, rank
from ..base.assembly import (
    RESTARTS,
    ClosureSystem,
    CutJoints,
    VelocityEquations,
    assemble_velocity,
    close,
    closed,
    starts,
)
from ..base.continuation import follow
from ..base.limits.constraints import (
    ACCEPTED,
    BRANCH_STEP,
    CONVERGED,
    COUPLED,
    GONE,
    INDEPENDENT,
    MEASURED,
    ONE_BRANCH,
    PASSED,
    SHORT,
    STILL,
    UNMOVED,
)
from ..base.scales import largest
from ..base.texts import place_of_marker
from ..errors import TO_BE_FINITE, AssemblyError, UsageError, calls_within, cannot, not_finite
from .argument_checks import UnknownNameError, unknown, without_dots
from .kernels import Kernels, constraint_system, place
from .layout import warn_of_fixed

# -- rank at other parameters ------------------------------------------------------------------------------------------


def require_rank(kernels: Kernels, J: Array) -> None:
    """Refuse parameters with which more constraint rows are independent than with the declared ones.

    J (n_c, n_v) is the scaled constraint Jacobian at an assembled position.
    """
    layout = kernels.layout
    pairs = list(zip(layout.p, kernels.context.p, layout.info.p_values, strict=True))
    changed = [name for name, value, declared in pairs if value != declared]
    if not changed:
        return
    result = rank(J).rank
    if result > layout.rank:
        raise UsageError(
            f"with the given {', '.join(changed)}, {result} constraint rows are independent, but with the declared "
            f"values {layout.rank} are, and these determine the degrees of freedom; declare values like the given ones",
            code="EG-REDUNDANT",
        )


# -- velocities at change points ---------------------------------------------------------------------------------------

# Where rank is lost, C_q v + C_t = 0 lets through mixtures of the velocities of several branches, which no motion has.
# One has accelerations too: with L^T C_q = 0, the rates of C_q v + C_t at constant v, b(v), must fulfil L^T b(v) = 0.
# These equations are quadratic in v, and each branch is a solution: the tangent cone of the constraints.


STARTS = 60  #: from which the branches are looked for
ROUNDS = 40  #: of Newton's method from each


def where_lost(system: ClosureSystem, q: Array) -> Array:
    """The position where rank is lost beside a closed q, which by itself tells it to the root of its residual only.

    With L and R of the directions lost, L^T J R = 0 is linear in the distance from there.
    """
    moves = np.flatnonzero(system.free)
    if not len(moves):
        return q
    least, best = largest(system.evaluate(q)[0]), q
    for _ in range(2):
        J = system.evaluate(best)[1][:, moves]
        U, sizes, V = algebra.svd(J)
        kept = int(np.count_nonzero(sizes > PASSED * sizes[0]))
        L, R = U[:, kept:], np.zeros((len(system.free), len(moves) - kept))
        R[moves] = V[kept:].T
        if not (L.size and R.size):
            break

        def left(y: Array, q: Array = best, L: Array = L, R: Array = R) -> Array:
            return (L.T @ system.evaluate(system.scales.move(q, R @ y))[1] @ R).ravel()

        steps = BRANCH_STEP * np.eye(R.shape[1])
        slopes = np.array([left(y) - left(-y) for y in steps]).T / (2.0 * BRANCH_STEP)
        P, heard, Q = algebra.svd(slopes)
        k = int(np.count_nonzero(heard > COUPLED))
        y = -Q[:k].T @ ((P[:, :k].T @ left(np.zeros(len(steps)))) / heard[:k])
        trial = system.scales.move(best, R @ y)
        size = largest(system.evaluate(trial)[0])
        if not (size <= least and largest(y) <= PASSED):
            break
        least, best = size, trial
    return best


def on_branches(kernels: Kernels, t: float, q: Array, J: Array, raw: Mapping[str, Sequence[Array]], v: Array) -> Array:
    """The velocities (n,) or (n, m) of the only branch that has the given ones, or AssemblyError; see StartBranch."""
    if v.ndim > 1:
        return np.array([on_branches(kernels, t, q, J, raw, column) for column in v.T]).T
    for part in _parts(kernels, J, raw):
        v = StartBranch(kernels, t, q, J, raw, part).complete(v)
    return v


def _parts(kernels: Kernels, J: Array, raw: Mapping[str, Sequence[Array]]) -> Iterator[tuple[Indices, Indices]]:
    """Rows and velocities of loops that are connected, by given velocities too."""
    known = kernels.layout.scales.known
    fixed = [row != 0.0 for gradients in raw.values() for row in gradients]
    pattern = np.array([*(np.ones(J.shape, dtype=bool) if known is None else known), *fixed])
    for levels in parts(pattern):
        rows = np.concatenate([level.rows for level in levels])
        if len(rows := np.sort(rows[rows < len(J)])):
            yield rows, np.sort(np.concatenate([level.columns for level in levels]))


class StartBranch:
    """The branches at one position where rank is lost, of loops each of which is connected with the others.

    Others may be as fast as they like: speeds are those of the coordinates that the lost rows know.  J (n_c, n_v) is
    the scaled C_q at the closed position q; ``given`` has the scaled gradients of the velocities given, by name, and
    ``part`` the rows of these loops and their velocities.
    """

    def __init__(
        self,
        kernels: Kernels,
        t: float,
        q: Array,
        J: Array,
        raw: Mapping[str, Sequence[Array]],
        part: tuple[Indices, Indices],
    ) -> None:
        self.kernels, self.t, self.q, self.names = kernels, t, q, list(raw)
        self.layout = kernels.layout
        self.scales = self.layout.scales
        (m, n), (rows, columns) = J.shape, part
        U, sizes, V = algebra.svd(J[np.ix_(rows, columns)])
        kept = int(np.count_nonzero(sizes > GONE * sizes[0]))
        self.lost, free = np.zeros((m, len(rows) - kept)), np.zeros((n, len(columns) - kept))
        self.lost[rows], free[columns] = U[:, kept:], V[kept:].T
        fixed = np.array([row for gradients in raw.values() for row in gradients])
        if len(fixed):
            _, sizes, V = algebra.svd(fixed @ free)
            free = free @ V[int(np.count_nonzero(sizes > GONE)) :].T
        self.free, self.columns = free, columns

    def bends(self, v: Array, speed: float) -> Array:
        """L^T b(v) (k,) over the square of a speed, of scaled velocities v."""
        h = BRANCH_STEP / speed
        ends = []
        for side in (h, -h):
            x = np.concatenate([self.scales.move(self.q, side * v), v * self.scales.q])
            ends.append(self.kernels.velocity_constraints(x, t=self.t + side) / self.scales.c)
        return np.asarray(self.lost.T @ (ends[0] - ends[1]) / (2.0 * h * speed**2))

    def complete(self, v: Array) -> Array:
        """The velocities (n,) of the only branch that has the given ones."""
        heard = np.abs(self.lost).max(axis=1, initial=0.0) > GONE
        speed = float(self.scales.row_speeds(v)[heard].max(initial=0.0))
        if not speed > ACCEPTED * self.scales.speed(v):
            return v  # at rest nothing decides the branch
        d = np.zeros(len(v))
        d[self.columns] = (v / self.scales.q)[self.columns]
        here = self.bends(d, speed)
        slopes = self._slopes(d, speed)
        undecided = self._heard(slopes)
        if not undecided.shape[1] and np.abs(here).max(initial=0.0) <= ONE_BRANCH:
            return v
        result = self._roots(d, undecided * speed, speed, here)
        if not result and self.free.size:  # midway between branches slopes vanish
            ways = np.random.default_rng(2).normal(size=(2, self.free.shape[1]))
            slopes = np.vstack([slopes, *(self._slopes(d + speed * self.free @ way, speed) for way in ways)])
            undecided = self._heard(slopes)
            result = self._roots(d, undecided * speed, speed, here)
        result = [v + w * self.scales.q for w in result]
        if len(result) != 1:
            faults = slopes[: len(here)] @ (self.free.T @ undecided) if undecided.shape[1] else here
            raise self._refusal(v, faults, undecided, result)
        return result[0]

    def _slopes(self, d: Array, speed: float) -> Array:
        """How L^T b changes along the free directions, (k, f)."""
        steps = [speed * w for w in self.free.T]
        up, down = (np.array([self.bends(d + side * w, speed) for w in steps]) for side in (1.0, -1.0))
        return np.asarray(0.5 * (up - down).reshape(len(steps), self.lost.shape[1]).T)

    def _heard(self, slopes: Array) -> Array:
        """The free directions (n, u) that slopes see."""
        if not slopes.size:
            return np.empty((len(self.free), 0))
        _, sizes, V = algebra.svd(slopes)
        return np.asarray(self.free @ V[: int(np.count_nonzero(sizes > COUPLED))].T)

    def _roots(self, d: Array, W: Array, speed: float, here: Array) -> list[Array]:
        """What W y leads from d to branches; quadratic in y, so that their coefficients are differences."""
        k = W.shape[1]
        if not k:
            return []
        unit = np.eye(k)

        def value(y: Array) -> Array:
            return self.bends(d + W @ y, speed)

        up, down = (np.array([value(side * e) for e in unit]) for side in (1.0, -1.0))
        K = 0.5 * (up - down).T
        H = np.empty((len(here), k, k))
        for i in range(k):
            H[:, i, i] = 0.5 * (up[i] + down[i]) - here
            for j in range(i):
                both = value(unit[i] + unit[j]) - up[i] - up[j] + here
                H[:, i, j] = H[:, j, i] = 0.5 * both
        random, result = np.random.default_rng(1), list[Array]()
        for n in range(STARTS):
            y = random.normal(size=k) * (0.0, 1.0, 3.0)[min(n, 1 + n % 2)]
            for _ in range(ROUNDS):
                F = here + K @ y + (H @ y) @ y
                y = y - algebra.pinv(K + 2.0 * H @ y, rcond=GONE) @ F
            size = 1.0 + float(np.abs(y).max())
            if not np.abs(here + K @ y + (H @ y) @ y).max() <= ONE_BRANCH * size**2:
                continue
            way = W @ y
            if all(np.abs(way - other).max() > COUPLED * speed * size for other in result):
                result.append(way)
        return result

    def _refusal(self, v: Array, faults: Array, undecided: Array, result: list[Array]) -> AssemblyError:
        layout = self.layout
        rows = np.abs(self.lost @ faults.reshape(len(faults), -1)).max(axis=1)
        labels = [layout.constraint_labels[i] for i in np.flatnonzero(rows > 0.1 * rows.max())]
        where = f"the mechanism is at a change point of {', '.join(labels[:6])}{place(layout.q, self.q)}"
        if not undecided.shape[1]:
            listed = ", ".join(f"{n} = {x:.6g}" for n, x in zip(layout.v, v, strict=True) if n in self.names)
            return AssemblyError(
                f"{where}, and no motion continues with the velocities {listed or 'there'}; give those of one "
                "branch, or start a little beside this position",
                code="EG-UNDETERMINED",
            )
        wanted, left = list[str](), undecided.copy()
        size = np.abs(undecided).max(axis=1)
        for _ in range(undecided.shape[1]):
            i = int(np.argmax(np.linalg.norm(left, axis=1) >= 0.5 * np.linalg.norm(left, axis=1).max()))
            wanted.append(layout.v[i])
            row = left[i] / np.linalg.norm(left[i])
            left = left - np.outer(left @ row, row)
            left[size == 0.0] = 0.0
        listed = " or ".join(
            "(" + ", ".join(f"{n} = {x[layout.v.index(n)]:.12g}" for n in wanted) + ")" for x in result[:4]
        ) + (" or ..." if len(result) > 4 else "")
        several = f"branches found have {listed}" if result else "no branch was found that has them"
        return AssemblyError(
            f"{where}, where the given velocities do not distinguish its branches: {several}; give "
            f"{' and '.join(wanted)} too, or start a little beside this position",
            code="EG-UNDETERMINED",
        )


# -- assembly ----------------------------------------------------------------------------------------------------------

# Values given explicitly are held exactly. Declared initial values are held too, as long as the given ones leave them
# room: one after the other in the order of the model, each if it is independent of those before. The values are
# followed from the model's reference position, so that the mechanism stays on its branch; where that way is blocked,
# the loops are closed from the nearest guess, and a warning says so.


class NamedValues(NamedTuple):
    """Values by the name of a coordinate, its rate, a loop coordinate or its rate."""

    positions: dict[str, float]
    rates: dict[str, float]


class Wanted(NamedTuple):
    """A value besides coordinates and rates that is held: of an output, or of a marker's place or velocity."""

    name: str
    scale: float  #: typical size
    of_velocities: bool
    evaluate: Callable[
        [Array, float], tuple[float, Array]
    ]  #: (q, t) -> y, dy/dq by velocities; y = y_v v + y_0: y_0, y_v


def find_wanted(kernels: Kernels, name: str, t: float) -> Wanted | None:
    """The function that an output or a place of a marker is; None if the name is neither.

    Refuses an output that depends on accelerations, or on velocities otherwise than linearly, and an unknown marker.
    """
    if result := place_of_marker(name):
        return _of_marker(kernels, name, *result)
    plain = kernels.layout.plain(name)  # tip_x of an instance leg is leg.tip_x too
    return _of_output(kernels, plain, t) if plain in kernels.layout.y else None


def _of_output(kernels: Kernels, name: str, t: float) -> Wanted:
    layout, places = kernels.layout, kernels.layout.place_scales
    n_q, n_v, k = layout.n_q, layout.n_v, layout.y.index(name)
    outputs, slopes = kernels.motion_outputs, kernels.output_derivatives
    zero = np.zeros(n_v)
    # at one position a slope may vanish that counts elsewhere, as sin(q) does at 0
    tried = [layout.q_reference + turn * np.linspace(0.7, 1.3, n_q) for turn in (0.0, 0.3, -0.2)]
    result = np.array([[slopes(q, v, zero, t=t)[k] for v in (zero, np.linspace(0.3, 1.1, n_v))] for q in tried])
    by_q, by_v, by_a = (np.nan_to_num(part) for part in np.split(result, (n_q, n_q + n_v, n_q + 2 * n_v), axis=-1)[:3])
    if by_a.any() or not np.allclose(by_v[:, 0], by_v[:, 1]):
        on = "accelerations" if by_a.any() else "velocities, and not linearly"
        raise cannot(
            f"the output {name!r} depends on {on}, so it cannot be given as an initial value; give coordinates"
        )
    of_velocities = bool(by_v.any())

    def evaluate(q: Array, t: float) -> tuple[float, Array]:
        row = slopes(q, zero, zero, t=t)[k]
        y = float(outputs(q, zero, zero, t=t)[k])
        if of_velocities:
            return y, np.asarray(row[n_q : n_q + n_v])
        return y, np.asarray(row[:n_q] @ places.rates(q, np.eye(len(places.q))))

    known = {"m": layout.length, "rad": 1.0}.get(layout.unit(name).removesuffix("/s"))
    size = float(np.abs(by_v if of_velocities else by_q).max(initial=0.0))
    return Wanted(name, known or size or 1.0, of_velocities, evaluate)


def _of_marker(kernels: Kernels, name: str, what: str, marker: str) -> Wanted:
    """A coordinate of the place of a marker or of a body's origin, or of its velocity."""
    from ..base.picture_data import read_picture

    layout, axis, of_velocities = kernels.layout, "xyz".index(what[-1]), what.startswith("v")
    poses, twists = kernels.poses, kernels.inertial_terms
    data = read_picture(layout.metadata, kernels.context.p)
    marker = layout.plain(marker)  # leg.thigh.knee of an instance leg
    if marker not in data.markers and marker not in layout.bodies:
        raise unknown("marker or body", marker, (*data.markers, *layout.bodies))
    known = marker in data.markers
    body = data.markers[marker].body if known else layout.bodies.index(marker)
    place = data.markers[marker].position if known else np.zeros(3)
    if body < 0:
        kind = "velocity" if of_velocities else "position"
        raise UnknownNameError(f"{name!r} is a {kind} on the ground, which does not move")
    motions = np.eye(layout.n_v, layout.n_v + 1)  # each velocity alone, and rest

    def evaluate(q: Array, t: float) -> tuple[float, Array]:
        pose = poses(q, t=t)[body]
        every = twists(np.repeat(q[:, None], layout.n_v + 1, axis=1), motions, np.zeros_like(motions), t=t)
        turning, moving = every[body, :6].reshape(2, 3, -1)
        rates = pose[axis, :3] @ (moving + np.cross(turning, place, axisa=0, axisb=0, axisc=0))
        y = rates[-1] if of_velocities else pose[axis, :3] @ place + pose[axis, 3]
        return float(y), rates[:-1] - rates[-1]

    return Wanted(name, layout.length, of_velocities, evaluate)


class Initial:
    """Assembly of one model with one set of parameters at one time, which matters for driven constraints only.

    Names are those of values that may be held; outputs and places of markers can be among them, and those declared are
    held too.
    """

    def __init__(self, kernels: Kernels, t: float = 0.0, names: Iterable[str] | None = None) -> None:
        self.kernels = kernels
        self.layout = layout = kernels.layout
        self.t = t
        self.system = constraint_system(kernels).at(t)
        self._C_q = kernels.kernel("constraint_jacobian", nan=True)
        self.scales, self.place = layout.scales, layout.place_scales
        self.coordinates = layout.q + layout.loops
        self.wanted: dict[str, Wanted] = {}
        if names is not None:
            result = (find_wanted(kernels, name, t) for name in dict.fromkeys([*names, *layout.initial_outputs]))
            self.wanted = {one.name: one for one in result if one is not None}
        if self.wanted:
            self.layout = copy(layout)
            self.layout.initial = {**layout.initial, **layout.initial_outputs}
            self._hold([one for one in self.wanted.values() if not one.of_velocities])

    def _hold(self, wanted: Sequence[Wanted]) -> None:
        """Take functions of positions among the coordinates that can be held."""
        cut, n = self.system.cut, len(self.place.q)

        def evaluate(q: Array, t: float) -> tuple[Array, Array]:
            (y, y_q), result = cut.evaluate(q, t), [one.evaluate(q, t) for one in wanted]
            return np.append(y, [value for value, _ in result]), np.vstack(
                [y_q.reshape(-1, n), *(x for _, x in result)]
            )

        names, scales = tuple(one.name for one in wanted), np.append(cut.scales, [one.scale for one in wanted])
        joints = CutJoints(cut.names + names, cut.kinds + ("turn",) * len(names), scales, evaluate)
        self.system = self.system._replace(cut=joints)

    def sort(self, values: Mapping[str, float]) -> NamedValues:
        """Split values into positions and rates; raises UsageError for a name that is neither."""
        layout, wanted = self.layout, self.wanted
        rates = layout.v + layout.loop_rates
        raw = {name: x for name, x in values.items() if place_of_marker(name)}
        raw |= without_dots({name: x for name, x in values.items() if name not in raw}, layout.instances)
        for name in raw:
            if name in wanted or name in self.coordinates or name in rates:
                continue
            if name in layout.p:
                raise UnknownNameError(f"{name!r} is a parameter, not a coordinate; bind(p={{{name!r}: ...}}) sets it")
            if name in layout.parameter_rates:
                names = ", ".join(n for n in layout.v if not n.endswith("_dot"))
                what = "angular velocity" if layout.quaternion_slots else "velocities"
                raise UnknownNameError(f"{name!r} follows from the {what}; give one of {names} instead")
            if name in layout.y:
                raise UnknownNameError(f"{name!r} is an output, which cannot be given here; give coordinates or rates")
            raise unknown("coordinate or rate", name, self.coordinates + rates + layout.y)
        fast = {n: x for n, x in raw.items() if (wanted[n].of_velocities if n in wanted else n in rates)}
        return NamedValues(self.system.settle({n: x for n, x in raw.items() if n not in fast}), fast)

    # functions of q

    def rate(self, q: Array) -> Array:
        """C_t (n_c,)."""
        return self.kernels.velocity_constraints(np.concatenate([q, np.zeros(self.layout.n_v)]), t=self.t)

    def follow(self, start: Array, fixed: Mapping[str, float]) -> Array:
        """From a closed position steadily to held values; raises AssemblyError when blocked."""
        q = follow(self.system, start, fixed)
        if not self.system.aligned(q):
            raise AssemblyError("the axes of a joint flipped on the path there", code="EG-UNDETERMINED")
        return q

    def reference(self, raw: Iterable[str] = (), rough: bool = True) -> Array:
        """The reference position, closed again for these parameters and this time.

        Declared values lead there but those to be `given`; unless ``rough``, it warns where they leave its branch.
        """
        if (moved := self.moved_reference(raw, rough)) is not None:
            return moved
        declared = self.sort(self.layout.initial).positions
        try:
            return self.close_near(self.layout.q_reference, declared, restarts=2)
        except AssemblyError:
            return self.system.close(self.layout.q_reference, {}).q

    def close_near(self, start: Array, fixed: Mapping[str, float], restarts: int = RESTARTS) -> Array:
        """The closed position near a start, also where Newton's steps halve the distance only, as at a change point."""
        result = self.system.close(start, fixed, restarts)
        if result.residual > CONVERGED:
            return where_lost(self.system.closure(fixed), result.q)
        return result.q

    def used(self, declared: dict[str, float]) -> dict[str, float]:
        """Declared values of which a start is made; refuses one that is no number with the parameters bound."""
        if self.layout.rebound is not None:
            p, undefined = self.layout.rebound
            if bad := [undefined[name] for name in declared if name in undefined]:
                raw = ", ".join(f"{name} = {x:.6g}" for name, x in zip(self.layout.p, p, strict=True))
                raise not_finite(f"{bad[0]} is no number with {raw}: {TO_BE_FINITE}")
            warn_of_fixed(self.layout, p, declared)
        return declared

    def moved_reference(self, raw: Iterable[str], rough: bool) -> Array | None:
        """Where drivers by this time, or bound parameters, bring the reference position; None without, or blocked."""
        if not self.t or largest(self.scales.residual(self.system.position(self.layout.q_reference)[0])) <= CONVERGED:
            return None if self.layout.rebound is None else self._at_parameters(raw, rough)
        first = Initial(self.kernels).reference(raw, rough)
        try:
            return follow(self.system.at(0.0), first, {}, self.t)
        except AssemblyError as error:
            self.tell_branch(f"the position at t = {self.t:.6g} s", error)
            return None

    def _at_parameters(self, raw: Iterable[str], rough: bool) -> Array | None:
        """The reference position with the initial values of now, but those to be `given`; None if they are as declared.

        The values are followed from those at the declared parameters; where these do not close the loops of now, from
        the closed position nearest to them.  Where that is blocked, the loops are closed anew, with a warning unless
        ``rough``.
        """
        layout, system = self.layout, self.system
        declared = {**layout.info.initial, **layout.info.initial_outputs}
        before = self.sort({name: declared[name] for name in layout.initial}).positions
        now = self.sort(layout.initial).positions
        if before == now:
            return None
        known = [name for name in raw if name in (*system.names, *system.cut.names)]
        wanted = now = {name: value for name, value in now.items() if name not in known}
        blocked = start = None
        ways: tuple[dict[str, float], ...] = (before, {})
        for fixed in ways:
            try:
                start = system.close(layout.q_reference, fixed).q
                wanted = self.compatible(start, known, now) if known else now
                return self.follow(start, wanted)
            except AssemblyError as error:
                blocked = error
        result = self.close_near(layout.q_reference, wanted)
        changed = {name: value for name, value in wanted.items() if value != before.get(name)}
        # where they stand still at the reference, it is on no branch of theirs
        if start is not None and not rough and len(self.compatible(start, (), changed)) == len(changed):
            self.tell_branch(", ".join(f"{name} = {value:.6g}" for name, value in changed.items()), blocked)
        return result

    def tell_branch(self, what: str, error: AssemblyError | None) -> None:
        """Warn that a position was found by closing the loops anew."""
        warnings.warn(
            f"{what} cannot be reached from the reference position on the same branch: {error}.  The loops are closed "
            "from the nearest guess instead; branches() gives all positions found, assemble() the one near a guess",
            stacklevel=calls_within() + 1,
        )

    @np.errstate(all="ignore")
    def assembled(self, raw: Mapping[str, float], rough: bool = False) -> Array:
        """Position with the given values exact, and the declared ones where they leave room.

        Warns where that leaves the branch of the reference position, unless the values are a ``rough`` guess.
        """
        layout = self.layout
        declared = {name: x for name, x in self.sort(layout.initial).positions.items() if name not in raw}
        if not layout.n_h and not any(name in self.system.cut.names for name in (*declared, *raw)):
            return self.system.with_values(layout.q_reference, {**self.used(declared), **raw})
        if not raw:
            if (moved := self.moved_reference((), rough)) is None:
                return self.close_near(layout.q_reference, self.used(declared))
            return self.follow(moved, self.used(self.compatible(moved, {}, declared)))
        try:
            start = self.reference(raw, rough)
        except AssemblyError:
            return self.close_near(layout.q_reference, raw)  # these parameters close somewhere else, if anywhere
        soft = self.used(self.compatible(start, raw, declared))
        blocked = None
        for fixed in ({**raw, **soft}, raw):
            try:
                return self.follow(start, fixed)
            except AssemblyError as error:
                blocked = error
        try:
            result = self.close_near(start, {**raw, **soft}, restarts=4 if soft else RESTARTS)
        except AssemblyError:
            if not soft:
                raise
            result = self.close_near(start, raw)
        # where they stand still at the reference, it is on no branch of theirs
        if not rough and len(self.compatible(start, (), raw)) == len(raw):
            self.tell_branch(place(tuple(raw), np.array(list(raw.values()))).removeprefix(", "), blocked)
        return result

    def from_guess(self, guess: Mapping[str, float]) -> Array:
        """Position near a guess: its values are kept as far as they can be, independent coordinates first."""
        layout = self.layout
        if not layout.n_h:
            return self.assembled(guess, rough=True)
        favoured = [layout.velocity_labels[i] for i in layout.independent]
        ordered = {name: guess[name] for name in favoured if name in guess} | dict(guess)
        if set(guess) <= set(favoured):
            with suppress(AssemblyError):
                return self.assembled(guess, rough=True)
        from ..base.assembly import close_nearest

        declared = {**self.sort(layout.guess).positions, **self.sort(layout.initial).positions}
        declared = self.used({k: v for k, v in declared.items() if k not in guess})
        start = self.system.with_values(layout.q_reference, {**declared, **guess})
        soft = self.compatible(start, {}, {**ordered, **declared})
        for fixed in (soft, {k: v for k, v in soft.items() if k in guess}):
            result = close_nearest(self.system, start, fixed, guess)
            if result is not None:
                return result.q
        return self.system.close(start, {}).q

    def branches(self, raw: Mapping[str, float], first: Array, tries: int = 60, many: int = 16) -> list[Array]:
        """Every position found that holds the given values and, if they leave freedom, further ones of `first`.

        Each is searched around too, until there are more than `many`.
        """
        layout, result = self.layout, [first]
        there = dict(zip(layout.q, first.tolist(), strict=True))
        favoured = [n for i in layout.independent if (n := layout.velocity_labels[i]) in there]
        rest = {} if raw else self.sort(layout.initial).positions
        more = self.compatible(first, raw, rest | {n: there[n] for n in (*favoured, *layout.q)})
        freedom = max(layout.n_q - layout.n_h - len(raw), 0)  # a singular position seems to have more freedom
        system = self.system.closure({**raw, **dict([*more.items()][:freedom])})
        for here in result:  # which grows: the legs of a platform flip one by one
            for start in starts(here, system.free, self.place, tries if len(result) <= many or here is first else 0):
                q, residual = close(system, start)
                if closed(residual) and self.system.aligned(q) and all(self.apart(q, other) for other in result):
                    result.append(q)
        return result

    def apart(self, a: Array, b: Array) -> bool:
        """Whether two positions differ by more than full turns of angles."""
        kinds = self.layout.coordinate_kinds if self.layout.general_rates else self.layout.velocity_kinds
        gap = np.abs(self.place.distance(a, b))
        turns = np.array([kind != "length" for kind in kinds], dtype=bool)
        gap[turns] = np.abs((gap[turns] + np.pi) % (2 * np.pi) - np.pi)
        if largest(gap) <= MEASURED or largest(gap[~turns]) > MEASURED or not self.layout.n_bodies:
            return largest(gap) > MEASURED
        poses = self.kernels.kernel("poses", nan=True)  # Euler angles describe each rotation twice
        return not largest((poses(a, t=self.t) - poses(b, t=self.t))[:, :3, :3].ravel()) <= MEASURED

    def side(self, q: Array) -> float:
        """det(J_d): its sign tells the branches of a position apart, 0 is a dead centre."""
        layout = self.layout
        J = self.scaled_jacobian(q)
        dependent = np.delete(np.arange(layout.n_v), layout.independent)
        return float(np.linalg.det(J[np.ix_(layout.rows, dependent)])) if len(layout.rows) else 1.0

    # velocities

    def velocities(self, q: Array, raw: Mapping[str, float | Array] | None) -> Array:
        """Velocities with the given rates exact, and the declared ones where they leave room; None: declared exact.

        Rates of shape (m,) give m motions at this position, velocities (n, m).
        """
        if self.layout.n_c:
            require_rank(self.kernels, self.scaled_jacobian(q))
        declared = {name: x for name, x in self.sort(self.layout.initial).rates.items() if name not in (raw or {})}
        if raw is not None:
            self._require_motion(q, raw)
            declared = self.compatible(q, raw, declared, positions=False) if declared else {}
        fixed: dict[str, float | Array] = {**(raw or {}), **self.used(declared)}
        return self.on_branch(q, self._solve_rates(q, fixed), list(fixed))

    def on_branch(self, q: Array, v: Array, names: Sequence[str]) -> Array:
        """Velocities (n,) or (n, m), of which those named were given, as those of a motion also at a change point.

        Raises
        ------
        AssemblyError
            The position is a change point, and no branch has the velocities given, or several have.
        """
        rank = self.layout.rank
        if rank in (0, len(v)) or not np.any(v):
            return v  # what drivers move entirely is refused there by what solves for it
        sizes = algebra.singular_values(J := self.scaled_jacobian(q))
        if sizes[rank - 1] > GONE * sizes[0]:
            return v

        return on_branches(self.kernels, self.t, q, J, {n: self.gradients(q, n) for n in names}, v)

    def scaled_jacobian(self, q: Array) -> Array:
        """J (n_c, n_v): C_q, scaled."""
        return self.scales.jacobian(self._C_q(q, t=self.t))

    def _require_motion(self, q: Array, raw: Mapping[str, float | Array]) -> None:
        """Refuse the rate of a coordinate that stands still at q, whatever moves: it would need boundless rates."""
        layout = self.layout
        if not layout.n_c:
            return
        J = self.scaled_jacobian(q)
        basis = algebra.svd(J)[2][rank(J).rank :]
        driven = self._solve_rates(q, {}) / self.scales.q  # what driven constraints impose
        for name, values in raw.items():
            value = max(np.ravel(values).tolist(), key=abs)
            scale = self.scales.q[layout.v.index(name)] if name in layout.v else self.rate_equation(q, name)[2]
            row = self.gradients(q, name)[0]
            still = np.linalg.norm(basis @ row) < STILL * max(1.0, float(np.linalg.norm(row)))
            if still and abs(row @ driven) < UNMOVED and abs(value / scale) > SHORT:
                moves = np.linalg.norm(basis, axis=0)
                ordered = dict.fromkeys([*layout.independent, *np.argsort(-moves, kind="stable")])
                others = [layout.v[i] for i in ordered if moves[i] > 0.1]
                instead = " or ".join(others[:2])
                remedy = f"give {instead} instead, or another position" if others else "no velocity is possible here"
                raise AssemblyError(
                    f"{name} = {value:.6g} cannot be reached: the constraints allow no such velocity here, as "
                    f"at a dead centre or across a blade{place(layout.q, q)}; {remedy}",
                    code="EG-CONTRADICTION",
                )

    def _solve_rates(self, q: Array, fixed: Mapping[str, float | Array]) -> Array:
        layout = self.layout
        columns = np.broadcast_shapes(*map(np.shape, fixed.values()))
        v = np.zeros((layout.n_v, *columns))
        indices = [layout.v.index(name) for name in fixed if name in layout.v]
        v[indices] = np.reshape([np.broadcast_to(fixed[layout.v[i]], columns) for i in indices], v[indices].shape)
        others = [name for name in fixed if name not in layout.v]
        if not (layout.n_c or others):
            return v
        equations = None
        if others:
            y_q, y_t, scales = map(np.array, zip(*(self.rate_equation(q, name) for name in others), strict=True))
            wanted = np.array([np.broadcast_to(fixed[name], columns) for name in others])
            equations = VelocityEquations(y_q, y_t, wanted, scales, others)
        C_q, labels = self._C_q(q, t=self.t), layout.constraint_labels
        return assemble_velocity(C_q, self.rate(q), self.scales, v, indices, equations, layout.v, labels)

    def rate_equation(self, q: Array, name: str) -> tuple[Array, float, float]:
        """y_q (n,), y_t and the typical size of a rate y' = y_q v + y_t that is no velocity of the tree."""
        if name in self.wanted:
            y_t, y_q = self.wanted[name].evaluate(q, self.t)
            return y_q, y_t, self.wanted[name].scale
        layout, zero, k = self.layout, np.zeros(self.layout.n_v), self.layout.loop_rates.index(name)
        rest = self.kernels.loop_coordinates(q, zero, zero, t=self.t)[1]
        return self.system.cut.evaluate(q, self.t)[1][k], rest[k], layout.loop_scales[k]

    # which values can be held together

    def compatible(
        self, q: Array, raw: Iterable[str], rest: Mapping[str, float], positions: bool = True
    ) -> dict[str, float]:
        """Those of `rest`, in order, that are independent of the constraints, of `given` and of each other at q.

        Nonholonomic constraints count for rates only, where `positions` is False.
        """
        layout, scales = self.layout, self.place if positions else self.scales
        C_q = self.system.position(q)[1][: self.layout.n_h] if positions else self._C_q(q, t=self.t)
        rows = [*scales.jacobian(C_q), *(row for name in raw for row in self.gradients(q, name))]
        stacked = np.reshape(rows, (len(rows), len(scales.q)))
        basis = algebra.svd(stacked)[2][: rank(stacked).rank] if rows else stacked
        kept = {}
        for name, value in rest.items():
            added = basis
            for row in self.gradients(q, name):
                length = np.linalg.norm(row)
                left = row - added.T @ (added @ row)
                left -= added.T @ (added @ left)
                size = np.linalg.norm(left)
                if not (length > UNMOVED and size > INDEPENDENT * length):
                    break
                added = np.vstack([added, left / size])
            else:
                basis = added
                kept[name] = value
        # Euler parameters are held together or not at all
        whole = [layout.q[i : i + 4] for i, _ in layout.quaternion_slots]
        torn = {name for four in whole if not all(name in kept for name in four) for name in four}
        return {name: value for name, value in kept.items() if name not in torn}

    def gradients(self, q: Array, name: str) -> list[Array]:
        """Scaled gradients of a coordinate or rate: three for e0, which stands for its rotation, none for e1 .. e3."""
        layout = self.layout
        if name in layout.v:
            return [np.eye(layout.n_v)[layout.v.index(name)]]
        if name in self.wanted and self.wanted[name].of_velocities:
            row, _, scale = self.rate_equation(q, name)
            return [row * self.scales.q / scale]
        if name in layout.loop_rates:
            name = layout.loops[layout.loop_rates.index(name)]
        return self.system.gradients(q, name)
