"""Stage runtime: independent values -> the motion of the whole tree, on the branch of a known closed position.

From that position the independent coordinates are led in small steps along a straight line, each step being one Newton
iteration of the kernel ``kinematics`` from the last point.
"""

from __future__ import annotations

import numpy as np

from ..errors import EvaluationError, ProjectionError
from ..numeric.scales import Array
from .failure import place
from .kernels import Kernels

STEP = 0.1  #: largest scaled change of an independent coordinate in one step
JUMP = 0.6  #: largest scaled change of any coordinate in one step; more may be another branch
HALVINGS = 8  #: of a step, before giving up


class Path:
    """Solves the dependent coordinates of one model, never switching branch silently."""

    def __init__(self, kernels: Kernels) -> None:
        self.layout = layout = kernels.layout
        self.fail = kernels.fail
        self.kernel = kernels.state("kinematics", nan=True)
        self.scales_i = layout.scales.q[layout.independent]
        self._still = np.zeros(2 * layout.n_dof)

    def motion(self, q_i: Array, v_i: Array, a_i: Array, near: Array, t: float) -> Array:
        """[q, v, a] (3 n,) by one Newton iteration from `near`."""
        x = np.concatenate([q_i, v_i, a_i, near])
        result = self.kernel(x, t=t)
        if not np.isfinite(result).all():
            raise self._failure(q_i)
        return result

    def advance(self, q: Array, target: Array, t: float, halvings: int = HALVINGS) -> Array:
        """From a closed q to independent values not farther than one step, in parts where that is too far."""
        reached = self.kernel(np.concatenate([target, self._still, q]), t=t)[: self.layout.n_q]
        if np.abs((reached - q) / self.layout.scales.q).max() <= JUMP:  # False for NaN
            return reached
        if not halvings:
            raise self._failure(target)
        middle = 0.5 * (q[self.layout.independent] + target)
        half = self.advance(q, middle, t, halvings - 1)
        return self.advance(half, target, t, halvings - 1)

    def walk(self, start: Array, target: Array, t: float) -> Array:
        """From a closed q along the straight line to independent values."""
        origin = start[self.layout.independent]
        way = target - origin
        steps = int(np.ceil(np.abs(way / self.scales_i).max() / STEP)) if way.size else 0
        q = start
        for k in range(1, steps + 1):
            q = self.advance(q, target if k == steps else origin + k / steps * way, t)
        return q

    def walk_all(self, start: Array, targets: Array, t: Array) -> list[Array]:
        """The same for columns of targets (n_dof, k).

        With one degree of freedom all columns lie on one line.  It is walked once, over points at fixed distances from
        the start, so that the result of a column does not depend on the others.
        """
        still = not np.any(t != t[0])
        if self.layout.n_dof != 1 or not still:
            return [self.walk(start, targets[:, j], float(t[j])) for j in range(targets.shape[1])]
        known: dict[int, list[Array]] = {1: [start], -1: [start]}
        origin, step = start[self.layout.independent[0]], STEP * self.scales_i[0]
        result = []
        for target in targets[0]:
            sign = 1 if target >= origin else -1
            points = known[sign]
            count = int(abs(target - origin) / step)
            while len(points) <= count:
                points.append(self.advance(points[-1], np.array([origin + sign * len(points) * step]), float(t[0])))
            result.append(self.advance(points[count], np.array([target]), float(t[0])))
        return result

    def _failure(self, target: Array) -> EvaluationError:
        names = [self.layout.q[i] for i in self.layout.independent]
        where = place(names, target).removeprefix(", ")
        if self.kernel.failure is None:
            return ProjectionError(f"the position {where} lies on another branch, or too near to a dead centre", 0.0, target)
        status, t, x = self.kernel.failure
        error = self.fail.exception("kinematics", status, t, x)
        return type(error)(f"the way to {where} is blocked: {error}", t, target)
