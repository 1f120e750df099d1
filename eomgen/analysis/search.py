"""A closed position, what is fixed and what is unknown -> a position where all forces are in balance."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array, Indices
from ..base.assembly import close
from ..base.limits.numbers import EPS, TINY
from ..base.scales import largest
from ..errors import AssemblyError, EquilibriumError, EvaluationError, PartitionError, UsageError
from ..runtime.argument_checks import check_names
from ..runtime.initial import Initial
from .balance import Balance, balance_forces, displacement_names, force_slopes, slopes
from .limits import ARRIVED, CLOSE, DIFFERENCES, LEAST_UNKNOWN, MOVING, SHORTEST
from .linearization import BALANCED, residual_accelerations

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

# -- linear steps ------------------------------------------------------------------------------------------------------


RANK = 500.0 * EPS  #: part of the terms of its rows below which a singular value of exact derivatives is rounding


class LinearizedResidual(NamedTuple):
    """Equations near an iterate: J by scaled variables, which move the tree and change unknowns."""

    J: Array  #: (m, k)
    moved: Array  #: (n_v, k) scaled displacements; the first n_z of length 1, at right angles
    changed: Array  #: (j, k) changes of the unknowns
    sizes: Array  #: (m,) of the terms in each row
    noise: float  #: relative error of J
    flow: Array | None  #: (n_v, n_z) how what drives the tree changes along them


class Solver:
    """Solutions of least norm with one J, rows divided by the sizes of their terms."""

    def __init__(self, linear: LinearizedResidual) -> None:
        self.linear = linear
        self.sizes = np.where(linear.sizes > 0.0, linear.sizes, 1.0)
        self.J = linear.J / self.sizes[:, None]
        self.U, values, self.V = algebra.svd(self.J, full_matrices=False)
        self.kept = values > linear.noise
        self.inverse = np.where(self.kept, 1.0 / np.where(self.kept, values, 1.0), 0.0)

    def solve(self, residual: Array) -> Array:
        return np.asarray(-self.V.T @ (self.inverse * (self.U.T @ (residual / self.sizes))))

    def displacements(self, change: Array) -> Array:
        """The correction as a scaled displacement of the tree and a change of scaled unknowns."""
        return np.concatenate([self.linear.moved @ change, change[self.J.shape[1] - len(self.linear.changed) :]])

    def arrived(self, residual: Array, change: Array, numbers: float) -> bool:
        """Whether no correction and no residual is left but for rounding.

        numbers: scaled size of what the position is made of.
        """
        rounding = BALANCED * numbers
        left = residual / self.sizes + self.J @ change
        answers = np.abs(self.V.T) @ (self.inverse[:, None] * np.abs(self.U.T))
        limit = max(ARRIVED, min(CLOSE, rounding * float(answers.sum(axis=1).max(initial=0.0))))
        return largest(self.displacements(change)) <= limit and largest(left) <= rounding


class SearchPoint(NamedTuple):
    """One iterate."""

    q: Array
    s: Array  #: first-order states
    unknowns: Array
    module: BoundModel
    here: Balance


class FixedRow(NamedTuple):
    """A row of a held coordinate."""

    label: str
    name: str
    gradient: Array  #: (n_v,) of the coordinate in its scale, by displacements
    scale: float


class Search:
    """The equations of balance for one model, time and set of held coordinates, and the ways to solve them."""

    def __init__(
        self, module: BoundModel, t: float, fixed: Mapping[str, float], unknowns: Sequence[str], s: Array
    ) -> None:
        layout = module.layout
        self.first = s  #: first-order states where the search begins
        self.scale = np.array(layout.scales.q)  #: (n_v,) of displacements; of states what they are about to change by
        self.moving = layout.n_v - len(s)
        self.scale[self.moving :] = np.maximum(1.0, np.abs(s))
        self.module, self.layout, self.t, self.fixed, self.names = module, layout, t, fixed, tuple(unknowns)
        check_names("parameter or input", self.names, layout.p + layout.u)
        self.parameters = [layout.p.index(name) for name in self.names if name in layout.p]
        self.inputs = [layout.u.index(name) for name in self.names if name in layout.u]
        self.names = tuple(layout.p[k] for k in self.parameters) + tuple(layout.u[k] for k in self.inputs)
        self.supported = bool(fixed) and not self.names

    def bound(self, values: Array) -> BoundModel:
        if not self.names:
            return self.module
        p, u = self.module.p, self.module.u
        count = len(self.parameters)
        p[self.parameters], u[self.inputs] = values[:count], values[count:]
        return self.module.bind(p, u)

    def initial_unknowns(self) -> Array:
        return np.concatenate([self.module.p[self.parameters], self.module.u[self.inputs]])

    def rows_to_hold(self, module: BoundModel, q: Array) -> list[FixedRow]:
        """The held coordinates, three rows for a rotation."""
        initial, layout, result = Initial(module.kernels, self.t), self.layout, []
        for name in self.fixed:
            for row in initial.gradients(q, name):
                moved = np.flatnonzero(row)
                if name in layout.loops:
                    label, scale = name, float(layout.loop_scales[layout.loops.index(name)])
                else:
                    label, scale = displacement_names(layout)[moved[0]], float(layout.scales.q[moved[0]])
                result.append(FixedRow(label, name, row / layout.scales.q, scale))
        return result

    def gradients(self, module: BoundModel, q: Array) -> Array:
        """Gradients (k, n_v) of the held coordinates by displacements, in their scales."""
        rows = [row.gradient for row in self.rows_to_hold(module, q)]
        return np.array(rows).reshape(len(rows), self.layout.n_v)

    def start(self, q: Array) -> SearchPoint:
        """The first iterate; the scales of states become the changes that the linear equations tell there."""
        point = self.at(q, self.first, self.initial_unknowns())
        if len(self.first):
            solver = Solver(self.linearize(point))
            change = solver.linear.moved @ solver.solve(self.residual(point.here, point.here))
            result = np.abs(change[self.moving :]) * self.scale[self.moving :]
            self.scale[self.moving :] = np.maximum(self.scale[self.moving :], np.nan_to_num(result, posinf=0.0))
        return point

    def longest(self, displacement: Array) -> float:
        """The largest entry of a scaled displacement (n_v,), states left out: none leads them out of their range."""
        return largest(displacement[: self.moving])

    def distance(self, a: SearchPoint, b: SearchPoint) -> Array:
        """The scaled displacement (n_v,) from b to a."""
        d = self.layout.scales.distance(a.q, b.q)
        d[self.moving :] = (a.s - b.s) / self.scale[self.moving :]
        return d

    def at(self, q: Array, states: Array, values: Array, preferred: Indices | None = None) -> SearchPoint:
        module = self.bound(values)
        initial = Initial(module.kernels, self.t)
        if self.layout.n_h:
            q = initial.system.close(q, self.fixed, restarts=0).q
        elif self.fixed:
            q = initial.system.with_values(q, self.fixed)
        fixed = self.gradients(module, q) if self.supported else None
        return SearchPoint(q, states, values, module, balance_forces(module, self.t, q, states, fixed, preferred))

    def residual(self, here: Balance, like: Balance) -> Array:
        """What must vanish, at the independent velocities and surplus displacements of another place."""
        s = self.scale
        forces = s[here.velocities] * here.forces if self.supported else (here.a / s)[like.velocities]
        return np.concatenate([forces, (here.v / s)[like.surplus]])

    def linearize(self, point: SearchPoint) -> LinearizedResidual:
        """The equations near an iterate, by displacements of length 1 that are at right angles (scaled)."""
        here, s = point.here, self.scale
        if self.supported:
            K, rates = force_slopes(point.module, self.t, here, lambda q: self.gradients(point.module, q))
            basis, inverse = _orthonormal(here.Z / s[:, None])
            J = np.vstack([s[here.velocities, None] * K, (rates / s[:, None])[here.surplus]]) @ inverse
            sizes = np.abs(here.B * s[here.velocities]).T @ np.abs(point.module.kernels.bias(self.t, here.x))
            sizes = np.concatenate([sizes, np.zeros(len(here.surplus))])
            flow: Array | None = None if len(here.surplus) else basis @ (inverse.T @ K @ inverse)
            return LinearizedResidual(
                J, basis, np.zeros((0, J.shape[1])), sizes + np.abs(J).sum(axis=1), DIFFERENCES, flow
            )
        fixed = self.gradients(point.module, point.q)
        held_by = self._hold_slopes(point.module, here.x)
        result = slopes(point.module, self.t, here.x, fixed, held_by, self.parameters, self.inputs)
        basis, inverse = _orthonormal(result.Z / s[:, None])
        if len(fixed):  # only displacements that leave the held coordinates alone
            split = algebra.svd(fixed * s @ basis)
            free = split[2][len(fixed) :].T
            basis, inverse = basis @ free, inverse @ free
        sizes = np.abs(point.unknowns)
        weights = np.maximum(sizes, LEAST_UNKNOWN * max(1.0, float(sizes.max(initial=0.0))))
        unknown_rates = np.zeros((len(s), len(weights)))
        J = np.vstack([
            (np.hstack([result.by_position @ inverse, result.by_unknown * weights]) / s[:, None])[here.velocities],
            (np.hstack([result.rates @ inverse, unknown_rates]) / s[:, None])[here.surplus],
        ])  # fmt: skip
        moved = np.hstack([basis, result.motion * weights / s[:, None]])
        changed = np.hstack([np.zeros((len(weights), basis.shape[1])), np.diag(weights)])
        flow = (result.by_position + result.rates) @ inverse / s[:, None]
        return LinearizedResidual(J, moved, changed, self._sizes(point, J), RANK, flow)

    def _sizes(self, point: SearchPoint, J: Array) -> Array:
        """Sizes of the terms in each row: a unit displacement, and the forces of the model, each without the others."""
        here, n = point.here, len(point.here.velocities)
        if not n:
            return np.asarray(np.abs(J).sum(axis=1))
        mass = self.mass(point)
        spread = np.abs(algebra.inv(mass)) @ np.abs(mass)
        s = self.scale[here.velocities]
        residual = residual_accelerations(point.module, self.t, here.x, here.B, here.velocities, mass)
        rows = spread @ (np.abs(J[:n]).sum(axis=1) * s) / s
        return np.concatenate([rows + residual, np.abs(J[n:]).sum(axis=1)])

    def _hold_slopes(self, module: BoundModel, x: Array) -> Array:
        """Derivatives (k, n_p) of the held coordinates by the parameters, scaled; only cut joints have some."""
        layout = self.layout
        fixed = self.rows_to_hold(module, x[: layout.n_q])
        rows = np.zeros((len(fixed), layout.n_p))
        if layout.n_loop_coordinates and self.parameters:
            every = module.kernels.assembly_jacobian(x, t=self.t)[layout.n_h + layout.n_c :, layout.n_x + layout.n_u :]
            for k, row in enumerate(fixed):
                if row.name in layout.loops:
                    rows[k] = every[layout.loops.index(row.name)] / row.scale
        return rows

    def drive(self, here: Balance) -> Array:
        """What pulls at the scaled displacements of the tree: accelerations and enforced velocities, or forces."""
        s = self.scale
        return np.asarray(s * here.tree if self.supported else (here.a + here.v) / s)

    def metric(self, point: SearchPoint, basis: Array) -> Array:
        """The metric in which the drive is the gradient of a potential, if there is one."""
        if self.supported:
            return np.eye(basis.shape[1])
        s = self.scale
        return np.asarray(basis.T @ (s[:, None] * point.module.kernels.mass_matrix(point.q, t=self.t) * s) @ basis)

    def mass(self, point: SearchPoint) -> Array:
        B = point.here.B
        return np.asarray(B.T @ point.module.kernels.mass_matrix(point.q, t=self.t) @ B)

    def rounded(self, point: SearchPoint) -> float:
        """Scaled size of the numbers that the position is made of, at least 1."""
        s, q = self.layout.scales, self.layout.space
        sizes = np.abs(point.q) / s.q if q is None else np.abs(point.q[q.plain_q]) / s.q[q.plain_v]
        return max(1.0, float(sizes.max(initial=0.0)))

    def step(self, point: SearchPoint, displacement: Array, change: Array) -> SearchPoint | None:
        """The iterate a scaled displacement (n_v,) and a change of the unknowns away; None where there is none."""
        try:
            q = self.layout.scales.move(point.q, displacement)
            states = point.s + self.scale[self.moving :] * displacement[self.moving :]
            there = self.at(q, states, point.unknowns + change, point.here.velocities)
        except (AssemblyError, EvaluationError, PartitionError, UsageError):
            return None
        finite = np.isfinite(there.here.a).all() and np.isfinite(there.here.tree).all()
        return there if finite else None


def _orthonormal(Z: Array) -> tuple[Array, Array]:
    """Z R^-1 with columns of length 1 at right angles, and R^-1."""
    basis, R = np.linalg.qr(Z)
    return basis, algebra.inv(R)


# -- Newton's iteration ------------------------------------------------------------------------------------------------

# Steps are judged by the corrections that they leave, not by residuals (the natural monotonicity test: P. Deuflhard,
# Newton Methods for Nonlinear Problems, 2004, algorithm NLEQ-ERR, section 3.3.2).  Neither the scale nor the mixture of
# the equations matters then: a stiff spring stretched by the curvature of a step is one small correction away.


STEPS = 200  #: at most
LONGEST = 0.5  #: largest scaled step of a coordinate
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
        readable = solver.displacements(change)
        size, longest = float(np.linalg.norm(readable)), search.longest(solver.linear.moved @ change)
        if not np.isfinite(size):
            return point, step, False
        arrived = solver.arrived(residual, change, search.rounded(point))
        if arrived and (size <= ARRIVED or size > CONTRACTS * last):
            return _polished(search, point, solver, change), step, True
        if size <= ARRIVED or largest(search.layout.place_scales.distance(point.q, start)) > reach:
            return point, step, False
        most = 1.0 if plain else min(1.0, LONGEST / max(longest, LONGEST))
        if before is not None:
            apart = float(np.linalg.norm(before[1] - readable))
            part = float(np.linalg.norm(before[0]) * np.linalg.norm(before[1])) * before[2] / max(apart * size, TINY)
        part, retried = most if plain else min(most, part), False
        there, grown = None, None
        while part >= SHORTEST * most:
            there = search.step(point, solver.linear.moved @ (part * change), solver.linear.changed @ (part * change))
            if there is None:
                part *= 0.5
                continue
            left = solver.displacements(solver.solve(search.residual(there.here, point.here)))
            if plain:
                break
            off = float(np.linalg.norm(left - (1.0 - part) * readable))
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
        before = None if grown is None or plain else (readable, grown[0], grown[1])
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
        point, left, enough = there, after, after > 0.5 * left or largest(solver.displacements(change)) <= ARRIVED
        if enough:
            break
        solver = Solver(search.linearize(point))
        if len(solver.sizes) != len(sizes):
            break
        change = solver.solve(search.residual(point.here, point.here))
    return point


class BalanceRows:
    """What must vanish, in the sizes of its terms at the start, as equations that :func:`close` takes.

    Its places are iterates with the equations near them, or None.
    """

    long = None

    def __init__(self, search: Search, point: SearchPoint) -> None:
        linear = search.linearize(point)
        self.search, self.scales, self.start, self.steps = search, self, (point, linear), 0
        self.sizes = Solver(linear).sizes
        norms = np.linalg.norm(linear.J / self.sizes[:, None], axis=0)
        self.columns = np.diag(1.0 / np.where(norms > 0.0, norms, 1.0))

    def evaluate(self, place: tuple[SearchPoint, LinearizedResidual] | None) -> tuple[Array, Array]:
        """The residual (m,) and its derivatives (m, k); NaN where there is none."""
        shape = len(self.sizes), len(self.columns)
        if place is None or place[1].J.shape != shape:
            return np.full(shape[0], np.nan), np.full(shape, np.nan)
        here = place[0].here
        return self.search.residual(here, here) / self.sizes, place[1].J / self.sizes[:, None]

    def move(
        self, place: tuple[SearchPoint, LinearizedResidual], change: Array
    ) -> tuple[SearchPoint, LinearizedResidual] | None:
        self.steps += 1
        there = self.search.step(place[0], place[1].moved @ change, place[1].changed @ change)
        try:
            return None if there is None else (there, self.search.linearize(there))
        except (AssemblyError, EvaluationError, PartitionError, UsageError):
            return None

    def rounding(self, _: Any, J: Array) -> Array:
        """None of its own: Newton's iteration, which comes last, judges it."""
        return np.zeros(len(J))


def descend(search: Search, point: SearchPoint) -> tuple[SearchPoint, int, bool]:
    """Down the residual, by the damped steps that close loops."""
    rows = BalanceRows(search, point)
    return close(rows, rows.start, STEPS, metric=rows.columns)[0][0], rows.steps, False


# -- viscous descent ---------------------------------------------------------------------------------------------------

# Implicit Euler steps of q' = v'(q) (pseudo-transient continuation: C. T. Kelley, D. E. Keyes, SIAM J. Numer. Anal. 35
# (1998), 508-523), along the forces in the metric of the masses and so down the potential where there is one.  Each is
# solved by Newton's iteration and is as long as that contracts, so that stiff directions that curve are followed.


DESCENT_STEPS = 400  #: at most
TRIES = 60  #: of a step, each with a quarter of the time
CORRECTIONS = 5  #: of a step, at most


def creep(search: Search, point: SearchPoint) -> tuple[SearchPoint, int, bool]:
    """An iterate near which it rests, the number of steps, and False: Newton's iteration has the last word."""
    rate = None
    for step in range(DESCENT_STEPS):
        here = _Flow.at(search, point)
        if here is None:
            return point, step, False
        size = float(np.linalg.norm(here.drive))
        if size == 0.0 or not np.isfinite(size):
            return point, step, False
        rate = size / LONGEST if rate is None else rate
        there, contraction = None, 1.0
        for _ in range(TRIES):
            change = here.implicit(rate, here.drive)
            longest = np.inf if change is None else search.longest(here.basis @ change)
            if change is not None and longest <= LONGEST:
                there, contraction = _corrected(search, point, rate, here.basis @ change)
                if there is not None:
                    break
            rate = 4.0 * max(rate, EPS * here.slope)
        if there is None:
            return point, step, False
        point = there
        if longest <= CLOSE or (rate <= CLOSE**2 * here.slope and contraction < 0.1):
            return point, step + 1, False
        rate *= 0.1 if contraction < 0.1 else 0.3 if contraction < 0.25 else 1.0
    return point, DESCENT_STEPS, False


class _Flow(NamedTuple):
    """What drives the tree at an iterate, along directions of the constraints."""

    basis: Array  #: (n_v, n)
    drive: Array  #: (n,)
    A: Array  #: (n, n) its derivative
    M: Array  #: (n, n) metric
    slope: float  #: size of A

    @classmethod
    def at(cls, search: Search, point: SearchPoint) -> _Flow | None:
        """None where there is none."""
        linear = search.linearize(point)
        if linear.flow is None:
            return None
        basis = linear.moved
        A = basis.T @ linear.flow
        drive = basis.T @ search.drive(point.here)
        return cls(basis, drive, A, search.metric(point, basis), float(np.linalg.norm(A)))

    def implicit(self, rate: float, drive: Array) -> Array | None:
        """(rate - A)^-1 drive; None where that does not lead down a potential."""
        shifted = rate * np.eye(len(self.A)) - self.A
        return np.asarray(algebra.solve(shifted, drive)) if _definite(self.M @ shifted) else None


def _corrected(
    search: Search, start: SearchPoint, rate: float, displacement: Array
) -> tuple[SearchPoint | None, float]:
    """The iterate an implicit step away, None where Newton's iteration does not contract; its first contraction."""
    before, first, point = float(np.linalg.norm(displacement)), 1.0, start
    for k in range(CORRECTIONS):
        there = search.step(point, displacement, np.zeros(0))
        if there is None:
            return None, 1.0
        if k and np.linalg.norm(displacement) <= 0.1 * before:  # what is left is for the next step
            return there, first
        point, before = there, float(np.linalg.norm(displacement))
        here = _Flow.at(search, point)
        assert here is not None
        moved = here.basis.T @ search.distance(point, start)
        change = algebra.lstsq(rate * np.eye(len(here.A)) - here.A, here.drive - rate * moved, rcond=None)
        displacement = here.basis @ change
        size = float(np.linalg.norm(displacement))
        if not size <= CONTRACTS * before:
            return None, 1.0
        first = size / before if k == 0 else first
    return None, 1.0


def _definite(A: Array) -> bool:
    try:
        np.linalg.cholesky(0.5 * (A + A.T))
    except np.linalg.LinAlgError:
        return False
    return True


# -- searches in turn --------------------------------------------------------------------------------------------------


REACH = 2.0  #: scaled distance from the guess at which a balance is not near it


def find_balance(search: Search, q: Array) -> tuple[SearchPoint, int]:
    """From a position: each way in turn until one leads to balance.

    Newton's iteration finds what is near; where it stalls or leads far away, the motion of a very damped mechanism
    leads to a stable equilibrium; the others find what is far, what plain Newton finds, and what damped steps down the
    residual find.
    """
    start = search.start(q)
    first, steps, balanced = newton(search, start, reach=REACH)
    if balanced:
        return first, steps
    ways: list[Callable[[], tuple[SearchPoint, int, bool]]] = [
        lambda: newton(search, start),
        lambda: newton(search, start, plain=True),
        lambda: descend(search, start),
    ]
    if not search.names:
        ways.insert(0, lambda: creep(search, start))
    ends = [start, first]
    for way in ways:
        point, more, balanced = way()
        ends.append(point)
        steps += more
        if not balanced:
            point, more, balanced = newton(search, point)
            steps += more
        if balanced:
            return point, steps
    raise _failure(search, min(ends, key=lambda end: float(np.abs(search.residual(end.here, end.here)).max())))


def _failure(search: Search, point: SearchPoint) -> EquilibriumError:
    here, layout = point.here, search.layout
    names = [layout.velocity_labels[k] for k in here.velocities]
    left = dict(zip(names, here.forces.tolist(), strict=True))
    where = ", ".join(f"{n} = {x:.6g}" for n, x in zip((*layout.q, *layout.states), (*point.q, *point.s), strict=True))
    head = f"no equilibrium of {layout.name!r} found from this guess: "
    rates = np.abs(here.v / layout.scales.q)[here.surplus]
    if rates.size and rates.max() > MOVING:
        worst = int(here.surplus[rates.argmax()])
        return EquilibriumError(
            f"{head}the nonholonomic constraints move {layout.velocity_labels[worst]} at a rate of {here.v[worst]:.6g} "
            f"at {where} even if all independent velocities are 0, so the model cannot stand still there; give another "
            "guess, or constraints that allow a state of rest",
            left,
        )
    scaled = np.abs(here.forces * layout.scales.q[here.velocities])
    worst = int(scaled.argmax())
    what = "rate of the state" if names[worst] in layout.states else "generalized force along"
    return EquilibriumError(
        f"{head}the {what} {names[worst]} is still {here.forces[worst]:.6g} at {where}; give "
        "another guess, or hold a coordinate that no force balances",
        left,
    )
