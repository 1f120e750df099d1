"""Values of some coordinates -> closed positions and velocities nearest to them, or why there are none."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import chain, islice
from typing import Any, NamedTuple, TypeVar

import numpy as np

from ..errors import AssemblyError
from . import algebra
from .algebra import Array, Indices, rank
from .limits.constraints import ACCEPTED, CONTRADICTION, CONVERGED, EXACT, FURTHER_ROWS, MEASURED, STATE, TIKHONOV
from .limits.positions import BESIDE, NULL
from .scales import Position, Scales, largest, settle

# -- starts ------------------------------------------------------------------------------------------------------------


RADII = (0.05, 0.2, 0.5, 1.0, 1.6, 2.4)  #: scaled distance of the starts, each used for a few
PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71)


def starts(guess: Array, free: Array, scales: Scales, restarts: int) -> Iterator[Array]:
    """The guess, then `restarts` places around it, ever farther away; the same ones every time."""
    yield guess
    for k in range(restarts):
        radius = RADII[min(k * len(RADII) // restarts, len(RADII) - 1)]
        # Halton sequence; the shifted index keeps later coordinates from repeating earlier ones
        unit = [_halton(k + 1 + 7 * (i // len(PRIMES)), PRIMES[i % len(PRIMES)]) for i in range(len(free))]
        yield scales.move(guess, radius * free * (2.0 * np.array(unit) - 1.0))


def _halton(index: int, base: int) -> float:
    value, part = 0.0, 1.0
    while index:
        part /= base
        value += part * (index % base)
        index //= base
    return value


# -- closing of loops --------------------------------------------------------------------------------------------------

# Levenberg-damped Gauss-Newton steps of minimum norm in the coordinates that are free to move.


STEPS = 80  #: damped steps at most
DAMPING = 1e-3  #: relative to the largest diagonal entry of J J^T, at first
LEAST, MOST = 1e-8, 1e8  #: the same after a step that gained nothing, and where the search ends
LONGEST = 0.5  #: largest scaled step
FAR = 10.0  #: scaled distance above which steps grow with it
STEEP = 10.0  #: length of a row's scaled gradient above which the row counts less, lest it drown the others


class WantedValues(NamedTuple):
    """Values wanted for functions y(q), such as the coordinates of cut joints."""

    evaluate: Callable[[Array], tuple[Array, Array]]  #: q (n,) -> y (k,), y_q (k, n)
    values: Array  #: (k,) wanted
    scales: Array  #: (k,) the length scale for lengths, 1 for angles
    angles: Sequence[bool]  #: (k,) whether y counts modulo a full turn
    names: Sequence[str]  #: (k,) for messages

    def difference(self, y: Array) -> Array:
        """y - values, angles in [-pi, pi]; not scaled."""
        gap = y - self.values
        return np.where(self.angles, np.remainder(gap + np.pi, 2.0 * np.pi) - np.pi, gap)


class ClosureSystem(NamedTuple):
    """C(q) = 0 and y(q) = values with some coordinates held."""

    position: Position
    scales: Scales
    free: Array  #: (n,) 1.0 for a velocity of a coordinate that may move, 0.0 for a held one
    equations: WantedValues | None = None

    def evaluate(self, q: Array) -> tuple[Array, Array]:
        """Scaled residual e (m + k,) and its scaled Jacobian (m + k, n), zero in the columns of held coordinates."""
        C, C_q = self.position(q)
        e, J = self.scales.residual(C), self.scales.jacobian(C_q[: len(C)])
        if self.equations is not None:
            y, y_q = self.equations.evaluate(q)
            s = self.equations.scales
            e = np.concatenate([e, self.equations.difference(y) / s])
            J = np.vstack([J, y_q * self.scales.q / s[:, None]])
        return e, J * self.free


Q = TypeVar("Q")  #: a position, as the system has it


def close(
    system: Any, q: Q, steps: int = STEPS, damping: float | None = DAMPING, metric: Array | None = None
) -> tuple[Q, float]:
    """Minimize the scaled residual of a :class:`ClosureSystem`, or of equations with the same calls, from q.

    Damping at first: 0 where q is near a closed position, so that directions that hardly count do not creep; None for
    steps of least squares, which keep all digits beside singular positions and may lead far away from them.  Steps are
    the least ones, or the least combinations of the columns of a ``metric`` (n, k) of scaled motions.

    Returns
    -------
    q : (n,) array
        The last point.
    residual : float
        Largest scaled residual there; closed when it is not above ACCEPTED, which rows at their rounding count as.
    """
    e, J = system.evaluate(q)
    long = system.scales.long
    for _ in range(steps):
        size = largest(e)
        if size <= EXACT or not np.isfinite(size):
            break
        K = J if metric is None else J @ metric
        steepness = np.sqrt((K * K).sum(axis=1))
        least = STEEP if metric is None else STATE * largest(steepness)  # a row below it is rounding
        weights = 1.0 / np.where(steepness > least, steepness, 1.0)
        # far from closed, lengths are measured by the distance: angles would turn in circles over it
        far = remoteness(e, steepness)
        unit = np.where(long, 4.0 * far, 1.0) if long is not None and far > FAR and metric is None else 1.0
        K, f = K * weights[:, None] * unit, e * weights
        top = float((K * K).sum(axis=1).max(initial=0.0))
        if top == 0.0 or largest(K.T @ f) <= EXACT * top:
            break  # nothing that may move makes a difference
        dz = _step(K, f, damping, top) if metric is None else metric @ _step(K, f, damping, top)
        longest = largest(dz)
        if longest > LONGEST:
            dz *= LONGEST / longest
        trial = system.scales.move(q, dz * unit)
        e_trial, J_trial = system.evaluate(trial)
        f_trial = e_trial * weights
        gained = float(f @ f - f_trial @ f_trial)
        if not gained > 0.0:  # NaN included
            if size <= CONVERGED:
                break
            damping = max(10.0 * (damping or 0.0), LEAST)
            if damping > MOST:
                break
            continue
        converged = size <= CONVERGED and largest(e_trial) > 0.5 * size
        q, e, J = trial, e_trial, J_trial
        if converged:
            break
        # quadratic convergence at the end needs the damping to vanish with the residual
        if damping:
            damping = min(0.1 * damping, size)
            damping = 0.0 if damping < TIKHONOV else damping
    rounded = system.scales.rounding(q, J)
    accepted = bool((np.abs(e) <= np.maximum(ACCEPTED, rounded)).all())
    return q, min(largest(e), ACCEPTED) if accepted else largest(e)


def _step(K: Array, f: Array, damping: float | None, top: float) -> Array:
    """The damped step of least norm; ``top`` is the largest square of a row's length."""
    if damping is None:
        return -algebra.lstsq(K, f, rcond=NULL)
    G = K @ K.T
    G.flat[:: len(G) + 1] += (damping + TIKHONOV) * top
    return np.asarray(-K.T @ algebra.solve(G, f))


def remoteness(e: Array, steepness: Array) -> float:
    """About how far q is from where all equations hold, in scaled steps."""
    return largest(e / np.maximum(steepness, 1.0))


def closed(residual: float) -> bool:
    """Whether a scaled residual counts as closed."""
    return residual <= ACCEPTED


# -- why loops do not close --------------------------------------------------------------------------------------------


class AssemblyFailure(NamedTuple):
    """Everything needed to say why an assembly failed."""

    system: ClosureSystem
    guess: Array
    fixed: Indices
    best: Array
    flipped: bool
    names: Sequence[str]
    labels: Sequence[str]
    restarts: int

    def message(self) -> str:
        raw = self._values_text(self.guess, self.system.equations.values if self.system.equations else np.empty(0))
        if self.flipped:
            return (
                f"the loops close only with the axes of a joint flipped{self._with(raw)}; "
                "give initial values nearer to the wanted position"
            )
        gaps = "the largest gaps are " + ", ".join(f"{label} {gap:.3g}" for label, gap in self.open_rows())
        contradiction = self._contradiction()
        if contradiction:
            return contradiction
        if not raw:
            tried = f"({self.restarts + 1} starts tried)"
            return f"the loops do not close from the given guess {tried}: {gaps}; {self._advice()}"
        free = ClosureSystem(self.system.position, self.system.scales, np.ones_like(self.system.free))
        for start in starts(self.best, free.free, free.scales, self.restarts // 2):
            with np.errstate(all="ignore"):
                q, residual = close(free, start)
            if closed(residual):
                break
        else:
            return (
                f"the loops do not close{self._with(raw)}, nor with these values left free "
                f"({self.restarts + 1} starts tried): {gaps}; {self._advice()}"
            )
        dof = len(free.free) - rank(free.evaluate(q)[1]).rank
        y = self.system.equations.evaluate(q)[0] if self.system.equations else np.empty(0)
        near = ", ".join(self._values_text(q, y, 12 if len(raw) > dof else 6))
        if len(raw) > dof:
            values = f"{len(raw)} value{'s' if len(raw) != 1 else ''}"
            return (
                f"the given values {', '.join(raw)} are inconsistent: {values} for {dof} "
                f"degree{'s' if dof != 1 else ''} of freedom, and with all of them held {gaps}; "
                f"give fewer, or consistent ones such as {near}"
            )
        return f"the loops cannot close{self._with(raw)}: {gaps}; a closed position nearby has {near}"

    def _contradiction(self) -> str:
        """Words for open rows that no position can satisfy together: they depend on each other everywhere."""
        m = len(self.system.position(self.best)[0])
        labels = (list(self.labels) or [f"C[{i}]" for i in range(m)])[:m]
        gaps = [(labels.index(label), label, gap) for label, gap in self.open_rows() if label in labels]
        rows = [i for i, _, _ in gaps]
        if not rows:
            return ""
        for start in starts(self.best, np.ones_like(self.system.free), self.system.scales, 3):
            C, C_q = self.system.position(start)
            J, e = self.system.scales.jacobian(C_q)[rows], self.system.scales.residual(C)[rows]
            if not np.isfinite(J).all():
                return ""
            out_of_reach = algebra.svd(J)[0][:, rank(J).rank :]
            if largest(out_of_reach.T @ e) <= MEASURED:
                return ""
        names = ", ".join(f"{label} (off by {gap:.3g})" for _, label, gap in gaps)
        if len(gaps) == 1:
            return f"the constraint {names} can never hold: no coordinate changes it; remove it, or correct its values"
        return (
            f"the constraints {names} contradict each other: they restrict the same motion and cannot hold together; "
            "remove one of them, or make their values agree"
        )

    def _advice(self) -> str:
        e, J = self.system.evaluate(self.guess)
        far = remoteness(e, np.sqrt((J * J).sum(axis=1)))
        if far > FAR:
            away = f"the guess is far away (about {far:.2g} times the mechanism's size)"
            return f"{away}: give a better one, or check the dimensions"
        return "check the dimensions, or give a better guess"

    def _with(self, raw: list[str]) -> str:
        return f" with {', '.join(raw)}" if raw else ""

    def _values_text(self, q: Array, y: Array, digits: int = 6) -> list[str]:
        """Held coordinates and functions; 12 digits are as good as the exact values where they are given back."""
        names = self.names or [f"q[{i}]" for i in range(len(q))]
        coordinates = [f"{names[i]} = {q[i]:.{digits}g}" for i in self.system.scales.coordinates(self.fixed)]
        functions = self.system.equations.names if self.system.equations else ()
        return coordinates + [f"{name} = {value:.{digits}g}" for name, value in zip(functions, y, strict=True)]

    def open_rows(self) -> list[tuple[str, float]]:
        """The three rows that stay open the most: label and gap."""
        C = self.system.position(self.best)[0]
        e, result = self.system.scales.residual(C), list(C)
        labels = list(self.labels) or [f"C[{i}]" for i in range(len(C))]
        if self.system.equations:
            y = self.system.equations.difference(self.system.equations.evaluate(self.best)[0])
            e = np.concatenate([e, y / self.system.equations.scales])
            result += list(y)
            labels += list(self.system.equations.names)
        worst = np.argsort(-np.abs(e), kind="stable")[:3].tolist()
        order = [i for i in worst if not abs(e[i]) <= CONTRADICTION] or worst[:1]
        return [(labels[i], abs(float(result[i]))) for i in order]


def describe_contradiction(
    raw: Mapping[str, float], e: Array, row_scales: Array, labels: Sequence[str], limit: float, J: Array
) -> str:
    """Why velocities with the rates to be held, by name, cannot be assembled.

    Of the rows (m,) are the scaled residuals e, their scales and labels, and the limit up to which they are fulfilled;
    J is the scaled Jacobian of the constraints.
    """
    order = [i for i in np.argsort(-np.abs(e), kind="stable")[:3] if not abs(e[i]) <= limit]
    dof = J.shape[1] - rank(J).rank
    where = ", ".join(f"{labels[i]} {abs(e[i] * row_scales[i]):.3g}/s" for i in order)
    values = ", ".join(f"{name} = {value:.6g}" for name, value in raw.items())
    return (
        f"{f'the given velocities {values}' if raw else 'the driven constraints'} are inconsistent with {dof} "
        f"degree{'s' if dof != 1 else ''} of freedom at this position: the largest residuals are {where}; give fewer "
        "or other velocities"
    )


# -- the constraint system ---------------------------------------------------------------------------------------------

# One record for all: kinematics fills it with evaluated expressions, runtime with the kernels of a module.


RESTARTS = 24  #: further starts near the guess


class Assembly(NamedTuple):
    """An assembled position."""

    q: Array  #: (n_q,)
    residual: float  #: largest scaled residual
    restarts: int  #: starts needed besides the guess
    distance: float  #: largest scaled distance of a coordinate from the guess


class CutJoints(NamedTuple):
    """Coordinates y of the joints that close loops, as functions of the tree."""

    names: tuple[str, ...]
    kinds: tuple[str, ...]  #: 'length', 'angle' (equal up to full turns), 'turn' or 'parameter'
    scales: Array  #: (k,) the length scale for lengths, 1 for others
    evaluate: Callable[[Array, float], tuple[Array, Array]]  #: (q, t) -> y (k,), y_q (k, n)


class ConstraintSystem(NamedTuple):
    """C(q, t) = 0 of one mechanism with numbers for its parameters, at one time."""

    evaluate: Callable[[Array, float], tuple[Array, Array]]  #: (q, t) -> C (h,), C_q (m, n), holonomic rows first
    scales: Scales  #: of positions
    names: tuple[str, ...]  #: (n_q,) of the coordinates
    kinds: tuple[str, ...]  #: (n_q,) 'length', 'angle' or 'parameter'
    labels: Sequence[str]  #: (m,) of the rows
    cut: CutJoints
    alignment: Callable[[Array, float], Array] | None = None  #: (q, t) -> positive but where a joint's axes are flipped
    t: float = 0.0

    def at(self, t: float) -> ConstraintSystem:
        return self._replace(t=t)

    def position(self, q: Array) -> tuple[Array, Array]:
        """C (h,) and C_q (m, n)."""
        return self.evaluate(q, self.t)

    def aligned(self, q: Array) -> bool:
        """Whether no joint closes with its axes flipped."""
        return self.alignment is None or bool((np.asarray(self.alignment(q, self.t)) > 0.0).all())

    def settle(self, values: Mapping[str, float]) -> dict[str, float]:
        """Named values with all four Euler parameters of a rotation where some are given."""
        return settle((*self.names, *self.cut.names), (*self.kinds, *self.cut.kinds), values)

    def with_values(self, q: Array, values: Mapping[str, float]) -> Array:
        """A position with coordinates of the tree replaced; loops are not closed."""
        result = np.array(q)
        for name, value in values.items():
            if name in self.names:
                result[self.names.index(name)] = value
        return result

    def indices(self, names: Mapping[str, float]) -> Indices:
        """Places in q of the coordinates among the names that belong to the tree."""
        return np.array([self.names.index(name) for name in names if name in self.names], dtype=np.intp)

    def measure(self, names: Sequence[str], q: Array) -> tuple[Array, Array]:
        """Coordinates y (k,) of the tree or of cut joints, and y_q (k, n)."""
        y, y_q = np.empty(len(names)), np.zeros((len(names), len(self.scales.q)))
        cut = None if all(name in self.names for name in names) else self.cut.evaluate(q, self.t)
        for k, name in enumerate(names):
            if name in self.names:
                i = self.names.index(name)
                y[k], y_q[k, self.scales.velocities([i])[0]] = q[i], 1.0
            elif cut is not None:
                j = self.cut.names.index(name)
                y[k], y_q[k] = cut[0][j], cut[1][j]
        return y, y_q

    def wanted(self, values: Mapping[str, float], names: Sequence[str] | None = None) -> WantedValues | None:
        """Values as equations, of cut joints alone where no names are given; None if there are none."""
        if names is None:
            names = [name for name in values if name in self.cut.names]
        if not names:
            return None
        sizes = {name: self.scales.q[self.scales.velocities([i])[0]] for i, name in enumerate(self.names)}
        sizes |= dict(zip(self.cut.names, self.cut.scales, strict=True))
        kinds = dict(zip(self.cut.names, self.cut.kinds, strict=True))
        numbers, scales = np.array([values[name] for name in names]), np.array([sizes[name] for name in names])
        return WantedValues(
            partial(self.measure, names), numbers, scales, [kinds.get(n) == "angle" for n in names], names
        )

    def closure(self, fixed: Mapping[str, float]) -> ClosureSystem:
        free = np.ones(len(self.scales.q))
        free[self.scales.velocities(self.indices(fixed))] = 0.0
        return ClosureSystem(self.position, self.scales, free, self.wanted(fixed))

    @np.errstate(all="ignore")
    def close(self, guess: Array, fixed: Mapping[str, float], restarts: int = RESTARTS) -> Assembly:
        """Close the loops.

        Parameters
        ----------
        guess : (n_q,) array
        fixed : mapping of str to float
            Coordinates of the tree or of cut joints and their exact values.
        restarts : int
            Largest number of further starts, at fixed places around the guess.

        Returns
        -------
        Assembly
            The first closed position found without flipped axes; from a good guess the nearest one.
        """
        system, guess = self.closure(fixed), self.with_values(guess, fixed)
        best, least, flipped = guess, np.inf, False
        for attempt, start in enumerate(starts(guess, system.free, self.scales, restarts)):
            q, residual = close(system, start)
            if not closed(residual):
                if residual < least:
                    best, least = q, residual
            elif not self.aligned(q):
                flipped = True
            else:
                return Assembly(q, residual, attempt, largest(self.scales.distance(q, guess)))

        moved = self.scales.velocities(self.indices(fixed))
        failure = AssemblyFailure(system, guess, moved, best, flipped, self.names, self.labels, restarts)
        raise AssemblyError(failure.message(), [label for label, _ in failure.open_rows()])

    def gradients(self, q: Array, name: str) -> list[Array]:
        """Scaled gradients of a coordinate: three for e0, which stands for its rotation, none for e1 .. e3."""
        if name in self.names:
            index, unit, space = self.names.index(name), np.eye(len(self.scales.q)), self.scales.space
            if space is not None and any(i < index < i + 4 for i, _ in space.quaternion_slots):
                return []
            return [unit[k] for k in self.scales.velocities([index])]
        index = self.cut.names.index(name)
        return [np.asarray(self.cut.evaluate(q, self.t)[1][index] * self.scales.q / self.cut.scales[index])]


# -- the nearest assembly mode -----------------------------------------------------------------------------------------

# What is not guessed knows nothing of the branch.  So the guessed coordinates are held first, while the others turn to
# where the loops are open least; from there the loops are closed.  This is done from several places of the others.


TURNED = 16  #: places of what is not guessed, besides the first
SHIFTED = 6  #: places around the guess where what is found lies beside it
ROUGH = 30  #: steps that turn what is not guessed


@np.errstate(all="ignore")
def close_nearest(
    system: ConstraintSystem,
    start: Array,
    raw: Mapping[str, float],
    guess: Mapping[str, float],
    adjust: Callable[[Array], Array] | None = None,
) -> Assembly | None:
    """Close the loops on the branch that is nearest to a guess; None where no attempt closes them.

    Values that are given, of coordinates of the tree or of cut joints, are held exactly; guessed are rough values of
    further ones; ``start`` (n_q,) is where all others are, and ``adjust(q)`` gives better places of coordinates that
    nobody gives, such as those of contact points.  The distance of the result is the largest of the guessed
    coordinates.
    """
    rough, scales = {name: value for name, value in guess.items() if name not in raw}, system.scales
    aim, cut = system.with_values(start, {**raw, **rough}), system.wanted(rough)
    # velocities that move coordinates of the tree; np.unique would load numpy.ma
    guessed = np.array(sorted({*scales.velocities(system.indices(rough)).tolist()}), dtype=np.intp)
    free, guided = system.closure(raw), system.closure({**raw, **rough})

    def distances(q: Array) -> Array:
        """Scaled distances of a position from the guessed values."""
        gaps = scales.distance(q, aim)[guessed]
        return gaps if cut is None else np.append(gaps, cut.difference(cut.evaluate(q)[0]) / cut.scales)

    def attempt(place: Array, count: int, first: ClosureSystem | None) -> Assembly | None:
        if first is not None:
            place = close(first, place, steps=ROUGH)[0]
        q, residual = close(free, system.with_values(place if adjust is None else adjust(place), raw))
        if not closed(residual) or not system.aligned(q):
            return None
        return Assembly(q, residual, count, float(np.linalg.norm(distances(q))))

    best = attempt(aim, 0, free._replace(equations=cut) if cut else None)
    # other places of what is not guessed, then of all that may move, while the best position is farther than that
    turned = islice(starts(aim, guided.free, scales, TURNED), TURNED if guided.free.any() else 0)
    shifted = islice(starts(aim, free.free, scales, 4 * SHIFTED), 1, SHIFTED + 1)
    places = chain(((place, MEASURED) for place in turned), ((place, BESIDE) for place in shifted))
    for count, (place, enough) in enumerate(places, 1):
        if best is not None and best.distance <= enough:
            break
        result = attempt(place, count, guided)
        if result is not None and (best is None or _nearer(result, best, free)):
            best = result
    return best and best._replace(distance=largest(distances(best.q)))


def _nearer(result: Assembly, best: Assembly, free: ClosureSystem) -> bool:
    """Whether a position is nearer to the guess than the best one, by more than what moves along a branch."""
    J = free.evaluate(best.q)[1]
    if rank(J).rank < int(free.free.sum()):  # the nearest point of a branch is found to its curvature only
        return best.distance > BESIDE and result.distance < 0.5 * best.distance
    return result.distance < best.distance - MEASURED


def differences(system: ConstraintSystem, q: Array, guess: Mapping[str, float]) -> tuple[tuple[str, float, float], ...]:
    """Guessed coordinates with their guess and their value at a position, the largest scaled difference first."""
    wanted = system.wanted(guess, list(guess))
    if wanted is None:
        return ()
    gaps = wanted.difference(wanted.evaluate(q)[0])
    order = np.argsort(-np.abs(gaps / wanted.scales), kind="stable").tolist()
    return tuple((name := wanted.names[k], guess[name], guess[name] + float(gaps[k])) for k in order)


# -- velocities --------------------------------------------------------------------------------------------------------


class VelocityEquations(NamedTuple):
    """Rates y' = y_q v + y_t wanted for functions y(q), such as the coordinates of cut joints."""

    y_q: Array  #: (k, n)
    y_t: Array  #: (k,)
    values: Array  #: (k,) or (k, m) wanted
    scales: Array  #: (k,)
    names: Sequence[str]  #: (k,) for messages


@np.errstate(all="ignore")
def assemble_velocity(
    C_q: Array,
    C_t: Array,
    scales: Scales,
    guess: Array | None = None,
    fixed: Sequence[int] | Indices = (),
    equations: VelocityEquations | None = None,
    names: Sequence[str] = (),
    labels: Sequence[str] = (),
) -> Array:
    """Velocities with C_q v + C_t = 0 at an assembled position, all rows, nearest to a guess.

    The guess is (n,), or (n, m) for m motions, zero by default; the held velocities have their exact values there.
    Equations are rates of functions of q to reach exactly; names (n,) and labels (m,) are for messages.
    """
    v = np.zeros(C_q.shape[1]) if guess is None else np.array(guess, dtype=float)
    free = np.ones(len(v), dtype=bool)
    free[np.asarray(fixed, dtype=np.intp)] = False
    J, base = scales.jacobian(C_q), C_t / scales.c
    if equations is not None:
        J = np.vstack([J, equations.y_q * scales.q / equations.scales[:, None]])
    inverse = algebra.pinv(J[:, free], rcond=FURTHER_ROWS)
    for k in np.ndindex(v.shape[1:]):  # column by column, so that each has the bits that it has alone
        x, offset = v[(slice(None), *k)], base
        if equations is not None:
            offset = np.concatenate([base, (equations.y_t - equations.values[(slice(None), *k)]) / equations.scales])
        for _ in range(2):
            x[free] -= scales.q[free] * (inverse @ (J @ (x / scales.q) + offset))
        e = J @ (x / scales.q) + offset
        speed = max([1.0, scales.speed(x), *np.abs(offset)])
        if not np.abs(e).max(initial=0.0) <= CONTRADICTION * speed:
            break
    else:
        return v

    raw = {names[i] if names else f"v[{i}]": x[i] for i in fixed}
    row_scales, all_labels = scales.c, list(labels) or [f"C[{i}]" for i in range(len(C_t))]
    if equations is not None:
        values = equations.values[(slice(None), *k)]
        raw |= dict(zip(equations.names, values, strict=True))
        row_scales, all_labels = np.concatenate([row_scales, equations.scales]), [*all_labels, *equations.names]
    raise AssemblyError(
        describe_contradiction(raw, e, row_scales, all_labels, CONTRADICTION * speed, J[: len(C_t)]),
        code="EG-CONTRADICTION",
    )
