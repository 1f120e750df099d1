"""Stage runtime: independent values -> the motion of the whole tree, on the branch of a known closed position.

From that position the independent coordinates are led in small steps along a straight line, each step being one Newton
iteration of the kernel ``kinematics`` from the last point.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..errors import EvaluationError, ProjectionError, UsageError
from ..limits.motions import WALKED
from ..numeric.scales import Array
from .failure import place
from .kernels import Kernels
from .room import read_numbers

STEP = 0.1  #: largest scaled change of an independent coordinate in one step
JUMP = 0.6  #: largest scaled change of any coordinate in one step; more may be another branch
HALVINGS = 8  #: of a step, before giving up


class DependentMotion:
    """Solves the dependent coordinates of one model, never switching branch silently."""

    def __init__(self, kernels: Kernels) -> None:
        self.layout = layout = kernels.layout
        self.fail = kernels.fail
        if layout.rank:
            self.kernel = kernels.state("kinematics", nan=True)
        self.scales_i = layout.scales.q[layout.independent]
        self._still = np.zeros(2 * layout.n_dof)

    def newton(self, q_i: Array, v_i: Array, a_i: Array, guess: Array, t: float) -> Array:
        """[q, v, a] (3 n,) by one Newton iteration from a guess, wherever it leads."""
        layout = self.layout
        if not layout.rank:
            result = np.empty((3, layout.n_v))
            result[:, layout.independent] = q_i, v_i, a_i
            return result.ravel()
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
        return self.newton(q_i, v_i, a_i, self.advance(near, q_i, t), t)

    def advance(self, q: Array, target: Array, t: float, halvings: int = HALVINGS) -> Array:
        """From a closed q to independent values not farther than one step, in parts where that is too far."""
        reached = self.kernel(np.concatenate([target, self._still, q]), t=t)[: self.layout.n_q]
        if np.abs(self.layout.scales.distance(reached, q)).max() <= JUMP:  # False for NaN
            return reached
        if not halvings:
            raise self._blocked(target, reached)
        middle = 0.5 * (q[self.layout.independent_q] + target)
        half = self.advance(q, middle, t, halvings - 1)
        return self.advance(half, target, t, halvings - 1)

    def walk(self, start: Array, target: Array, t: float) -> Array:
        """From a closed q along the straight line to independent values."""
        if not self.layout.rank:
            return start
        origin = start[self.layout.independent_q]
        way = target - origin
        length = float(np.abs(way / self.scales_i).max(initial=0.0))
        self._require_near(target, length)
        steps = int(np.ceil(length / STEP))
        q = start
        try:
            for k in range(1, steps + 1):
                q = self.advance(q, target if k == steps else origin + k / steps * way, t)
        except EvaluationError as error:
            raise self._too_far(target, error) from None
        return q

    def walk_all(self, start: Array, targets: Array) -> list[Array]:
        """The same for columns of targets (n_dof, k), at t = 0.

        With one degree of freedom all columns lie on one line.  It is walked once, over points at fixed distances from
        the start, so that the result of a column does not depend on the others.
        """
        if self.layout.n_dof != 1 or not self.layout.rank:
            return [self.walk(start, targets[:, j], 0.0) for j in range(targets.shape[1])]
        known: dict[int, list[Array]] = {1: [start], -1: [start]}
        origin, step = start[self.layout.independent_q[0]], STEP * self.scales_i[0]
        result = []
        for target in targets.T:
            sign = 1 if target[0] >= origin else -1
            points = known[sign]
            self._require_near(target, abs(float(target[0]) - origin) / self.scales_i[0])
            count = int(abs(target[0] - origin) / step)
            try:
                while len(points) <= count:
                    points.append(self.advance(points[-1], np.array([origin + sign * len(points) * step]), 0.0))
                result.append(self.advance(points[count], target, 0.0))
            except EvaluationError as error:
                raise self._too_far(target, error) from None
        return result

    def _require_near(self, target: Array, length: float) -> None:
        if not length <= WALKED:
            raise UsageError(
                f"the way to {self._place(target)} is {length:.3g} rad or length scales long, and positions are led "
                f"along {WALKED:g} at most, in small steps that stay on the branch; give a nearer position (whole "
                "turns less, where the mechanism repeats itself), or guess=, a position to start from"
            )

    def _place(self, target: Array) -> str:
        return place([self.layout.velocity_labels[i] for i in self.layout.independent], target).removeprefix(", ")

    def _blocked(self, target: Array, found: Array) -> EvaluationError:
        """Why the step to independent values failed."""
        if np.isfinite(found).all() or self.kernel.failure is None:
            words = f"the position {self._place(target)} lies on another branch, or too near to a dead centre"
            return ProjectionError(words, 0.0, target)
        status, t, x = self.kernel.failure
        error = self.fail.exception("kinematics", status, t, x)
        return type(error)(f"{self._place(target)}: {error}", t, target)

    def _too_far(self, target: Array, error: EvaluationError) -> EvaluationError:
        return type(error)(f"the way to {self._place(target)} is blocked at {error}", error.time, target)


def motions(
    path: DependentMotion,
    reference: Callable[[float], Array],
    given: Sequence[ArrayLike | None],
    guess: Array | None,
    t: Array,
) -> tuple[Array, Array, Array]:
    """Positions, velocities and accelerations of the whole tree, each column for itself.

    Parameters
    ----------
    path : DependentMotion
    reference : callable
        t -> the closed position (n,) to start from.
    given : three arrays (n_dof,) or (n_dof, k), or None
        q_i, v_i, a_i; None is zero.
    guess : (n,) array, optional
        Start of Newton's iteration instead of a walk.
    t : () or (k,) array

    Returns
    -------
    q, v, a : (n,) or (n, k) arrays
    """
    layout = path.layout
    n_q, n, size = layout.n_q, layout.n_v, layout.n_dof
    labels, width = ("q_i", "v_i", "a_i"), n_q + 2 * n
    arrays = [None if x is None else read_numbers(what, x, width) for what, x in zip(labels, given, strict=True)]
    columns = max((part.shape[1:] for part in arrays if part is not None), key=len, default=())
    parts = []
    for name, part in zip(labels, arrays, strict=True):
        full = np.zeros((size, *columns)) if part is None else part
        if full.shape not in ((size,), (size, *columns)) or full.ndim > 2:
            raise UsageError(f"{name} must have shape ({size},) or ({size}, k), not {full.shape}")
        if not np.isfinite(full).all():
            raise UsageError(f"{name} must be finite")
        parts.append(np.broadcast_to(full if full.shape[1:] == columns else full[:, None], (size, *columns)))
    q, v, a = (part if columns else part[:, None] for part in parts)
    if t.shape not in ((), q.shape[1:]):
        raise UsageError(f"t must be a number or have shape {q.shape[1:]}, one a position, not {t.shape}")
    times = np.broadcast_to(t, q.shape[1:])
    if guess is not None:
        if guess.shape != (layout.n_q,):
            raise UsageError(f"guess must have shape ({layout.n_q},), not {guess.shape}")
        near = [guess] * q.shape[1]
    elif (times == 0.0).all():
        near = path.walk_all(reference(0.0), q)
    else:  # driven constraints have another reference at each time
        near = [path.walk(reference(float(time)), q[:, j], float(time)) for j, time in enumerate(times)]
    solve = path.motion if guess is None else path.newton
    result = np.empty((n_q + 2 * n, q.shape[1]))
    for j in range(q.shape[1]):
        result[:, j] = solve(q[:, j], v[:, j], a[:, j], near[j], float(times[j]))
    if not columns:
        result = result[:, 0]
    return result[:n_q], result[n_q : n_q + n], result[n_q + n :]
