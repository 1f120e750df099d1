"""Other forms of the equations of motion: in independent coordinates alone, and in coordinates and momenta.

From a known closed position the independent coordinates are led along a straight line, each point being found by one
Newton iteration of the kernel ``kinematics``, so that the branch stays the same.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base import algebra
from ..base.algebra import Array, correlated
from ..base.continuation import ASTRAY, LONG, STEPS, Continuation, StraightPath, Tangent, interpolate
from ..base.limits.constraints import STATE
from ..base.limits.numbers import SINGULAR
from ..base.limits.positions import FOLLOWED
from ..base.scales import largest
from ..errors import (
    EvaluationError,
    PartitionError,
    ProjectionError,
    UnavailableError,
    at_odds,
    ill_shaped,
    no_number,
    too_large,
)
from .argument_checks import both_names, read_number, read_numbers, read_state
from .kernels import Kernels, place
from .layout import Layout
from .refusals import require_support, require_switched

# -- the motion of the whole tree --------------------------------------------------------------------------------------

STEP = 0.1  #: largest scaled change of an independent coordinate that one Newton iteration may make
EARLY = 1000  #: steps after which a way is refused that is too long at the present rate of the dependent coordinates
JUMP = 0.6  #: largest scaled change of any coordinate in one iteration; more may be another branch


class DependentMotion:
    """Solves the dependent coordinates of one model, never switching branch silently."""

    def __init__(self, kernels: Kernels) -> None:
        self.layout = layout = kernels.layout
        self.fail = kernels.fail
        if layout.rank:
            self.kernel = kernels.kernel("kinematics", nan=True)
        self.scales, self.scales_i = layout.scales, layout.scales.q[layout.independent_moving]
        self.drifts = False  #: whether the time alone moves the mechanism where a path is followed
        self.failed = np.empty(0)  #: what the kernel gave where it found nothing

    def newton(self, q_i: Array, v_i: Array, a_i: Array, guess: Array, t: float) -> Array:
        """[q, v, a] (3 n,) by one Newton iteration from a guess, wherever it leads."""
        layout = self.layout
        if not layout.rank:
            q, motion = np.empty(layout.n_q), np.empty((2, layout.n_v))
            q[layout.independent_q] = q_i
            motion[:, layout.independent] = v_i, a_i
            return np.concatenate([q, motion.ravel()])
        result = self.kernel(np.concatenate([q_i, v_i, a_i, guess]), t=t)
        if not np.isfinite(result).all():
            raise self._blocked(q_i, result)
        return result

    def motion(self, q_i: Array, v_i: Array, a_i: Array, near: Array, t: float) -> Array:
        """[q, v, a] (3 n,) from a closed position not farther than one step."""
        if not self.layout.rank:
            return self.newton(q_i, v_i, a_i, near, t)
        result = self.kernel(np.concatenate([q_i, v_i, a_i, near]), t=t)
        if np.abs(self.layout.scales.distance(result[: self.layout.n_q], near)).max() <= JUMP:  # False for NaN
            return result
        return self.newton(q_i, v_i, a_i, self.follow(near, q_i, t), t)

    def solve(self, t: float, y: Array, t1: float, y1: Array, guess: Array) -> tuple[Array, Tangent] | None:
        """The position next to a guess by one Newton iteration of the kernel, and its direction at this time."""
        n_q, n = len(guess), len(self.scales.q)
        result = self._kinematics(t, y, y1, guess)
        if not np.isfinite(result).all():
            self.failed = result
            return None
        q, v = result[:n_q], result[n_q : n_q + n]
        if self.drifts:  # the time stands still here
            v = v - self._kinematics(t, y, np.zeros_like(y1), q)[n_q : n_q + n]
        return q, Tangent(v)

    def tangent(self, t: float, q: Array, t1: float, y1: Array) -> Tangent:
        """The direction at a position."""
        result = self.solve(t, q[self.layout.independent_q], t1, y1, q)
        return Tangent(np.zeros_like(self.scales.q)) if result is None else result[1]

    def _kinematics(self, t: float, y: Array, rate: Array, guess: Array) -> Array:
        rest = np.zeros(self.layout.n_states)  # states stand still
        return np.asarray(self.kernel(np.concatenate([y, rate, rest, np.zeros_like(rate), rest, guess]), t=t))

    def _way(self, start: Array, y1: Array, t: float) -> tuple[DependentMotion, Continuation]:
        """The notes and the continuation from a closed q along independent coordinates; s is the scaled distance."""
        y, n_q = start[self.layout.independent_q], len(start)
        motion = copy(self)  # notes of one path are neither another's nor another thread's
        motion.drifts = bool(self._kinematics(t, y, np.zeros_like(y), start)[n_q : n_q + len(self.scales.q)].any())
        return motion, Continuation(StraightPath(motion, t, y, 0.0, y1), start, fewest=1)

    def follow(self, start: Array, target: Array, t: float) -> Array:
        """From a closed q along the straight line to independent values."""
        if not self.layout.rank:
            return start
        origin = start[self.layout.independent_q]
        length = float(np.abs((target - origin) / self.scales_i).max(initial=0.0))
        self._require_near(target, length)
        y1 = (target - origin) / (length or 1.0)
        motion, way = self._way(start, y1, t)
        self._go_on(way, target, length)
        result = way.reach(length)
        if result is None:
            raise self._too_far(target, self._blocked(origin + way.points[-1].s * y1, motion.failed))
        return result.q

    def follow_all(self, start: Array, targets: Array) -> list[Array]:
        """The same for columns of targets (n_dof, k), at t = 0.

        With one degree of freedom all columns lie on one line.  It is followed once, over points at whole distances
        from the start, so that the result of a column does not depend on the others.
        """
        if len(self.layout.independent_q) != 1 or not self.layout.rank:
            return [self.follow(start, targets[:, j], 0.0) for j in range(targets.shape[1])]
        origin, unit, n_q = start[self.layout.independent_q], self.scales_i[0], self.layout.n_q
        lengths = (targets[0] - origin[0]) / unit
        self._require_near(targets[:, np.abs(lengths).argmax()], float(np.abs(lengths).max()))
        result = np.full((n_q, len(lengths)), np.nan)
        for sense in (1.0, -1.0):
            chosen = np.flatnonzero((lengths >= 0.0) == (sense > 0.0))
            if not chosen.size:
                continue
            _, way = self._way(start, np.array([sense * unit]), 0.0)
            farthest = float(np.abs(lengths[chosen]).max(initial=0.0))
            while not way.blocked and way.points[-1].s <= farthest:
                self._go_on(way, targets[:, chosen[0]], np.floor(way.points[-1].s) + 1.0)
            guesses = interpolate(way.points, way.scales, np.abs(lengths[chosen]))
            x = np.concatenate([targets[:, chosen], np.zeros((2 * self.layout.n_dof, len(chosen))), guesses])
            collected = self.kernel(x, t=0.0)[:n_q]
            for j, q, guess in zip(chosen, collected.T, guesses.T, strict=True):
                near = np.abs(self.scales.distance(q, guess)).max() <= ASTRAY  # False for NaN
                result[:, j] = q if near else self.follow(start, targets[:, j], 0.0)
        return list(result.T)

    def _go_on(self, way: Continuation, target: Array, end: float) -> None:
        """Follow a way to s = end; refuse one on which the dependent coordinates move farther than can be followed."""
        if way.to(end, steps=EARLY) or way.blocked:
            return
        here = way.points[-1]
        rate = largest(here.tangent.rate / self.layout.scales.q)
        self._require_near(target, (end - here.s) * rate, LONG * STEPS)
        if not way.to(end) and not way.blocked:
            self._require_near(target, np.inf)

    def _require_near(self, target: Array, length: float, most: float = FOLLOWED) -> None:
        if not length <= most:
            raise too_large(
                f"the path to {self._place(target)} is {length:.3g} rad or length scales long, and at most "
                f"{most:g} "
                "are allowed, in small steps that stay on the branch; give a nearer position (without whole turns), "
                "or guess=, a position to start from"
            )

    def _place(self, target: Array) -> str:
        return place([self.layout.velocity_labels[i] for i in self.layout.independent_moving], target).removeprefix(
            ", "
        )

    def _blocked(self, target: Array, result: Array) -> EvaluationError:
        """Why the step to independent values failed."""
        if np.isfinite(result).all() or self.kernel.failure is None:
            message = f"the position {self._place(target)} lies on another branch, or too near to a dead centre"
            return ProjectionError(message, 0.0, target)
        status, t, x = self.kernel.failure
        error = self.fail.exception("kinematics", status, t, x)
        return type(error)(f"{self._place(target)}: {error}", t, target)

    def _too_far(self, target: Array, error: EvaluationError) -> EvaluationError:
        return type(error)(f"the path to {self._place(target)} is blocked at {error}", error.time, target)


def motions(
    path: DependentMotion,
    reference: Callable[[float], Array],
    raw: Sequence[ArrayLike | None],
    guess: Array | None,
    t: Array,
) -> tuple[Array, Array, Array]:
    """Positions, velocities and accelerations (n,) or (n, k) of the whole tree, each column for itself.

    Given are q_i, v_i and a_i, (n_dof,) or (n_dof, k), None for zero.  ``reference(t)`` is the closed position to start
    from; from a guess (n,) Newton's iteration starts instead of following from there.
    """
    layout = path.layout
    n_q, n, size = layout.n_q, layout.n_v, len(layout.independent_q)
    labels, width = ("q_i", "v_i", "a_i"), n_q + 2 * n
    arrays = [None if x is None else read_numbers(what, x, width) for what, x in zip(labels, raw, strict=True)]
    columns = max((part.shape[1:] for part in arrays if part is not None), key=len, default=())
    parts = []
    for name, part in zip(labels, arrays, strict=True):
        full = np.zeros((size, *columns)) if part is None else part
        if full.shape not in ((size,), (size, *columns)) or full.ndim > 2:
            raise ill_shaped(f"{name} must have shape ({size},) or ({size}, k), not {full.shape}")
        if not np.isfinite(full).all():
            raise no_number(f"{name} must be finite")
        parts.append(np.broadcast_to(full if full.shape[1:] == columns else full[:, None], (size, *columns)))
    q, v, a = (part if columns else part[:, None] for part in parts)
    v, a = (np.concatenate([part, np.zeros((layout.n_states, part.shape[1]))]) for part in (v, a))
    if t.shape not in ((), q.shape[1:]):
        raise ill_shaped(f"t must be a number or have shape {q.shape[1:]}, one a position, not {t.shape}")
    times = np.broadcast_to(t, q.shape[1:])
    if guess is not None:
        if guess.shape != (layout.n_q,):
            raise ill_shaped(f"guess must have shape ({layout.n_q},), not {guess.shape}")
        near = [guess] * q.shape[1]
    elif (times == 0.0).all():
        near = path.follow_all(reference(0.0), q)
    else:  # driven constraints have another reference at each time
        near = [path.follow(reference(float(time)), q[:, j], float(time)) for j, time in enumerate(times)]
    solve = path.motion if guess is None else path.newton
    result = np.empty((n_q + 2 * n, q.shape[1]))
    for j in range(q.shape[1]):
        result[:, j] = solve(q[:, j], v[:, j], a[:, j], near[j], float(times[j]))
    if not columns:
        result = result[:, 0]
    moving = layout.moving
    return result[:n_q], result[n_q : n_q + moving], result[n_q + n : n_q + n + moving]


# -- the minimal form --------------------------------------------------------------------------------------------------

AMPLIFIED = 10.0  #: v_d / v_i above which a dead centre is near
REMEMBERED = 7  #: calls that the next one is compared with, less one
SUDDEN = 3.0  #: a change of velocity this many times what the accelerations explain is a change of branch


class Memory(threading.local):
    """What the calls of one thread leave for its next one.

    Attributes
    ----------
    q : (n_q,) array or None
        Where Newton's iteration starts; in a new thread, the position that was set last.
    recent : list of (time, velocities and accelerations)
        Of the last calls.
    """

    def __init__(self, start: list[Array | None]) -> None:
        self.q = start[0]
        self.recent: list[tuple[float, Array]] = []


class Minimal:
    """The equations of motion in independent coordinates and velocities only: x = [q_i; v_i].

    First-order states follow: x = [q_i; v_i; s].

    The set of independent coordinates is fixed.  The dependent ones are solved by Newton's iteration, starting from the
    last converged position, which is the only memory a call leaves; :meth:`reset` sets it.  Each thread has a memory of
    its own, so that threads do not disturb one another; a new thread begins where :meth:`reset` was told last.  A step
    that would end on another branch of the mechanism is refused.

    Attributes
    ----------
    x_names : tuple of str
        Names of the entries of x.
    q_names, v_names, s_names : tuple of str
        Their parts.
    n_x : int
    """

    def __init__(self, module: Any) -> None:
        layout: Layout = module.layout
        layout.require_minimal_form()
        self._module = module
        self._layout = layout
        self._path = DependentMotion(module.kernels)
        self.q_names = tuple(layout.q[i] for i in layout.independent_q)
        self.v_names, self.s_names = tuple(layout.v[i] for i in layout.independent_moving), layout.states
        self.x_names = self.q_names + self.v_names + self.s_names
        self.n_x = len(self.x_names)
        self._start: list[Array | None] = [None]
        self._memory = Memory(self._start)

    def __repr__(self) -> str:
        return f"<minimal form of {self._layout.name}: x = [{', '.join(self.x_names)}]>"

    def reset(self, q: ArrayLike | None = None) -> None:
        """Set the position from which the next Newton iteration starts.

        Parameters
        ----------
        q : (n_q,) array, optional
            Position of the whole tree, closed or nearly; the assembled initial position by default.
        """
        start = self._module.assemble() if q is None else np.array(read_state("q", q, self._layout.q))
        self._start[0] = self._memory.q = start
        self._memory.recent = []

    def x0(self, values: Mapping[str, float] | None = None, /, *, t: float = 0.0, **named: float) -> Array:
        """Assembled initial state (n_x,), from the same named values as ``Module.x0``; calls :meth:`reset`."""
        x = self._module.x0(values, t=t, **named)
        require_switched(self._layout, x[self._layout.n_x - self._layout.n_states :])
        self.reset(x[: self._layout.n_q])
        return self.reduce(x)

    def reduce(self, x: ArrayLike) -> Array:
        """The independent part (n_x,) or (n_x, k) of full states (2 n,) or (2 n, k)."""
        full = read_numbers("x", x)
        layout = self._layout
        if full.ndim not in (1, 2) or len(full) != layout.n_x:
            raise ill_shaped(f"x must be of shape ({layout.n_x},) or ({layout.n_x}, k), not {full.shape}")
        return np.concatenate([full[layout.independent_q], full[layout.n_q + layout.independent]])

    def expand(self, x_min: ArrayLike, t: ArrayLike = 0.0) -> Array:
        """Compute full states x = [q; v] from minimal ones.

        Parameters
        ----------
        x_min : (n_x,) or (n_x, k) array
            Columns are taken one after the other, each starting from the position of the one before.
        t : float or (k,) array

        Returns
        -------
        (2 n,) or (2 n, k) array

        Raises
        ------
        ProjectionError, PartitionError
            A position out of reach, or at a dead centre of the independent coordinates.
        """
        x = read_numbers("x", x_min, self._layout.n_x)
        if x.shape[:1] != (self.n_x,) or x.ndim > 2:
            raise ill_shaped(f"x must have shape ({self.n_x},) or ({self.n_x}, k), not {x.shape}")
        if x.ndim == 1:
            return self._solve(read_number("t", t), x)
        times = read_numbers("t", t)
        if times.shape not in ((), x.shape[1:]):
            raise ill_shaped(f"t must be a number or have shape {x.shape[1:]}, one a state, not {times.shape}")
        times = np.broadcast_to(times, x.shape[1:])
        result = np.empty((self._layout.n_x, x.shape[1]))
        for j in range(x.shape[1]):
            result[:, j] = self._solve(float(times[j]), x[:, j])
        self._memory.recent = []
        return result

    @both_names
    def rhs(self, t: float, x: ArrayLike, p: Any = None, u: ArrayLike | None = None) -> Array:
        """Derivative (n_x,) of x = [q_i; v_i].

        Parameters
        ----------
        t : float
        x : (n_x,) array
        p : None
            Parameters belong to the module: ``module.bind(p=...).minimal``.
        u : (n_u,) array, optional
            Inputs.

        Raises
        ------
        PartitionError
            The independent coordinates cannot move the mechanism here, or a dead centre was crossed.
        ProjectionError
            The position is out of reach.
        """
        if p is not None:
            raise at_odds("the minimal form takes its parameters from its module: module.bind(p=...).minimal")
        state = read_state("x", x, self.x_names)
        t = read_number("t", t)
        memory = self._memory
        before = memory.q
        full = self._solve(t, state)
        x_dot = self._module.rhs(t, full, u=u)
        moving = slice(self._layout.n_q, self._layout.n_q + self._layout.moving)
        motion = np.concatenate([full[moving], x_dot[moving]])
        self._check_crossing(t, motion, state, before)
        memory.recent = [*memory.recent[-REMEMBERED:], (t, motion)]
        return self.reduce(x_dot)

    def _solve(self, t: float, x: Array) -> Array:
        n, k = self._layout.n_q, len(self._layout.independent_q)
        memory = self._memory
        if memory.q is None:
            self.reset()
        assert memory.q is not None
        q_i, v_i = x[:k], x[k:]
        way = np.abs((q_i - memory.q[self._layout.independent_q]) / self._path.scales_i)
        near = memory.q
        if way.size and not way.max() <= STEP:
            if not np.isfinite(way).all():
                raise no_number(f"x is not finite: {x}")
            near = self._path.follow(near, q_i, t)
        full = self._path.motion(q_i, v_i, np.zeros_like(v_i), near, t)[: self._layout.n_x]
        memory.q = full[:n].copy()
        return full

    def _check_crossing(self, t: float, motion: Array, x: Array, before: Array | None) -> None:
        """Refuse a reflection at a dead centre of the independent coordinates.

        Near it they look the same on both sides, so an integrator can step across and come back on the old branch: the
        dependent velocities then reverse at once, which no acceleration explains.
        """
        layout = self._layout
        scales, chosen = layout.scales.q[: layout.moving], layout.independent_moving
        if not layout.rank or before is None or not len(chosen):
            return
        v, a = np.abs(motion.reshape(2, -1) / scales).max(axis=1)
        largest = np.abs(motion[chosen] / scales[chosen]).max()
        if v <= AMPLIFIED * largest:
            return
        for time, other in self._memory.recent:
            gap = abs(t - time)
            v_other, a_other = np.abs(other.reshape(2, -1) / scales).max(axis=1)
            own_other = np.abs(other[chosen] / scales[chosen]).max()
            if v_other <= AMPLIFIED * own_other or gap == 0.0 or min(v, v_other) * gap > 1.0:
                continue
            change = (motion - other)[: layout.moving] / scales
            turned = (motion[: layout.moving] / scales) @ (other[: layout.moving] / scales) < 0.0
            if turned and np.abs(change).max() > SUDDEN * max(a, a_other) * gap:
                self._memory.q = before
                raise PartitionError(
                    f"t = {t:.6g}: {', '.join(self.q_names)} passed a dead centre, so the branch is not known any "
                    "more; "
                    "choose other independent coordinates, or integrate the full state",
                    t,
                    x,
                )


# -- coordinates and momenta -------------------------------------------------------------------------------------------


class Canonical:
    """Hamilton's equations of a model derived by method ``hamilton``, on ``z = [q; p]`` with p = dT/dv (n_v,).

    q are all coordinates of the tree, and p their momenta, those of angular velocities where Euler parameters are.
    With constraints the equations are embedded: of the velocities only those are taken that the constraints allow,
    and p' holds the forces of the constraints.  States are single vectors (n_z,).

    Attributes
    ----------
    z_names, p_names : tuple of str
    n_z : int
    """

    def __init__(self, module: Any) -> None:
        layout = module.layout
        require_support(layout, "the canonical form")
        if layout.sizes.n_momenta != layout.n_v:
            raise UnavailableError(
                f"model {layout.name!r} was derived by method {layout.info.method!r}, which has no momenta; "
                "derive it with method='hamilton'"
            )
        self._module = module
        self.p_names = tuple(f"p_{name}" for name in layout.velocity_labels)
        self.z_names = layout.q + self.p_names
        self.n_z = len(self.z_names)
        self._terms = module.kernels.canonical

    def __repr__(self) -> str:
        return f"<canonical form of {self._module.name}: z = [{', '.join(self.z_names)}]>"

    def momenta(self, x: ArrayLike, t: float = 0.0) -> Array:
        """The momenta p (n_v,) of a state x = [q; v]."""
        return np.array(self._terms(x, t=t)[0])

    def of(self, x: ArrayLike, t: float = 0.0) -> Array:
        """The canonical state z (n_z,) of a state x = [q; v], which is projected first."""
        closed: Array = self._module.project(x, t=t)
        return np.concatenate([closed[: self._module.n_q], self.momenta(closed, t)])

    def z0(self, values: Mapping[str, float] | None = None, /, *, t: float = 0.0, **named: float) -> Array:
        """An assembled canonical state (n_z,), from the same named values as ``Module.x0``."""
        return self.of(self._module.x0(values, t=t, **named), t)

    def expand(self, z: ArrayLike, t: float = 0.0) -> Array:
        """The state x = [q; v] (n_x,) with these momenta, on the constraints.

        Raises
        ------
        SingularMassMatrixError
            No inertia is behind some motion.
        UsageError
            A wrong shape.
        """
        module, layout = self._module, self._module.layout
        z = read_state("z", z, self.z_names)
        n, s = layout.n_q, layout.scales.q
        q, p = z[:n], z[n:]
        rate, N = np.zeros(layout.n_c), np.eye(layout.n_v)
        if layout.n_c:
            q = module.project(np.concatenate([q, np.zeros(layout.n_v)]), t=t)[:n]
            J = layout.scales.jacobian(module.kernels.constraint_jacobian(q, t=t))
            rest = np.concatenate([q, np.zeros(layout.n_v)])
            rate = layout.scales.residual(module.velocity_constraints(rest, t=t, rows="all"))
            N = algebra.svd(J)[2][layout.rank :].T
            least = -algebra.lstsq(J, rate, rcond=STATE)
        else:
            least = np.zeros(layout.n_v)
        still = self.momenta(np.concatenate([q, np.zeros(layout.n_v)]), t)  # what p is at v = 0
        M = s[:, None] * module.kernels.mass_matrix(q, t=t) * s
        right = N.T @ (s * (p - still) - M @ least)  # N^T (M v + b) = N^T p, v = least + N y
        embedded = N.T @ M @ N
        sizes = algebra.eigvalsh(correlated(embedded)) if np.isfinite(embedded).all() else np.zeros(1)
        if layout.info.indefinite:
            sizes = np.abs(sizes)
        if sizes.min(initial=np.inf) <= SINGULAR:  # momenta determine no velocities
            raise module.kernels.fail.exception("canonical", 2, t, np.concatenate([q, np.zeros(layout.n_v)]))
        y = algebra.solve(embedded, right)
        return np.concatenate([q, s * (least + N @ y)])

    def rhs(self, t: float, z: ArrayLike) -> Array:
        """z' = [q'; p'] (n_z,): q' = dH/dp and p' = -dH/dq + Q, with the forces of constraints.

        A pure function, which plain SciPy integrates.
        """
        module, layout = self._module, self._module.layout
        x = self.expand(z, t)
        q, v = x[: layout.n_q], x[layout.n_q :]
        rates = np.array(self._terms(x, t=t)[1])
        if layout.n_c:  # -C_q^T l = M a + h
            rates += module.kernels.inverse_dynamics(q, v, module.rhs(t, x)[layout.n_q :], t=t)
        return np.concatenate([layout.scales.rates(q, v), rates])

    def hamiltonian(self, z: ArrayLike, t: float = 0.0) -> float:
        """H = p v - L (J), which is the energy T + V where nothing is driven in time."""
        x, n = self.expand(z, t), self._module.n_q
        still = np.concatenate([x[:n], np.zeros(len(x) - n)])
        moving = self.momenta(x, t) - self.momenta(still, t)  # M v: T may have linear terms, L of a Lagrangian others
        return float(0.5 * moving @ x[n:] - self._module.energy(still, t=t)[0] + self._module.energy(x, t=t)[1])
