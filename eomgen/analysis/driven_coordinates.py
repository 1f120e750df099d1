"""Analysis: a Module and led coordinates -> positions, velocities and accelerations at single points of a path.

The system is C(q, t) = 0 with y(q) = the led values, as many as there are degrees of freedom (Haug, Computer Aided
Kinematics and Dynamics of Mechanical Systems, ch. 3): its scaled Jacobian K = [C_q; y_q] has full column rank but at
singular positions, where the led coordinates do not determine the motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import EomgenError
from ..limits.constraints import ACCEPTED, AT_ONCE, SETTLED
from ..limits.motions import NULL
from ..numeric import algebra
from ..numeric.projection import largest, within
from ..numeric.scales import Array

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

STEPS = 25  #: Newton steps
LONGEST = 0.3  #: largest scaled Newton step


class Tangent(NamedTuple):
    """The direction of the motion at one point."""

    rate: Array  #: (n_v,) dq/ds as velocities
    quality: float  #: smallest over largest singular value of K: 0 at a singular position
    sign: float  #: of the determinant of as many independent rows of K as there are columns
    free: Array  #: (n_v,) scaled motion that K restrains least
    rows: Array  #: (n_c + k,) rows of K that hold that motion least


class DrivenCoordinates:
    """Solves for the motion of a module that is led by some of its coordinates.

    Parameters
    ----------
    module : BoundModel
        With parameters and inputs bound.
    led : sequence of str
        Coordinates of the tree or of cut joints, as many as degrees of freedom.
    """

    def __init__(self, module: BoundModel, led: Sequence[str]) -> None:
        self.module, self.led = module, tuple(led)
        self.layout = layout = module.layout
        self.scales = layout.scales
        kernels = module.kernels
        self._C, self._C_q = kernels.state("constraints", nan=True), kernels.state("constraint_jacobian", nan=True)
        self._rate = kernels.state("velocity_constraints", nan=True)
        known = layout.rank and "kinematics" in kernels.core.names
        self._kinematics = kernels.state("kinematics", nan=True) if known else None
        self._loops = kernels.motion("loop_coordinates") if layout.n_loop_coordinates else None
        self._loop_q = kernels.state("loop_coordinate_jacobian", nan=True) if layout.n_loop_coordinates else None
        chosen = [layout.velocity_labels[i] for i in layout.independent]
        #: whether the compiled kernel leads the same coordinates
        self.direct = self._kinematics is not None and list(led) == chosen and set(chosen) <= set(layout.q)
        self.in_tree = [name in layout.q for name in led]
        self.columns = [
            int(self.scales.velocities([layout.q.index(name)])[0]) if tree else layout.loops.index(name)
            for name, tree in zip(led, self.in_tree, strict=True)
        ]
        kinds = [
            layout.coordinate_kinds[layout.q.index(name)] if tree else layout.loop_kinds[layout.loops.index(name)]
            for name, tree in zip(led, self.in_tree, strict=True)
        ]
        self.wraps = np.array([not tree and kind == "angle" for tree, kind in zip(self.in_tree, kinds, strict=True)])
        self.led_scales = np.array([layout.length if kind == "length" else 1.0 for kind in kinds])
        self._zero = np.zeros(layout.n_v)
        n = layout.n_v
        self._rows_y = np.zeros((len(led), n))
        for k, (tree, column) in enumerate(zip(self.in_tree, self.columns, strict=True)):
            if tree:
                self._rows_y[k, column] = self.scales.q[column] / self.led_scales[k]
        independent = layout.rows if layout.rank else np.empty(0, dtype=np.intp)
        self._square = np.concatenate([independent, layout.n_c + np.arange(len(led))]).astype(np.intp)

    # led coordinates

    def led_values(self, q: Array, t: float) -> Array:
        """y (k,) at a position."""
        loops = self._loop_values(q, t)[0] if not all(self.in_tree) else ()
        found = [
            q[self.layout.q.index(name)] if tree else loops[column]
            for name, tree, column in zip(self.led, self.in_tree, self.columns, strict=True)
        ]
        return np.array(found, dtype=float)

    def _loop_values(self, q: Array, t: float, v: Array | None = None, a: Array | None = None) -> Array:
        assert self._loops is not None
        zero = self._zero
        values: Array = np.asarray(self._loops(q, zero if v is None else v, zero if a is None else a, t=t), dtype=float)
        return values

    def _gap(self, q: Array, y: Array, t: float) -> Array:
        """Scaled y(q) - y."""
        gap = self.led_values(q, t) - y
        wrapped = np.remainder(gap + np.pi, 2 * np.pi) - np.pi
        return np.asarray(np.where(self.wraps, wrapped, gap) / self.led_scales)

    def matrix(self, q: Array, t: float) -> Array:
        """K (n_c + k, n_v), scaled."""
        J = self.scales.jacobian(self._C_q(q, t=t)) if self.layout.n_c else np.empty((0, self.layout.n_v))
        rows = self._rows_y
        if not all(self.in_tree):
            assert self._loop_q is not None
            y_q = self._loop_q(q, t=t) * self.scales.q
            rows = rows.copy()
            for k, (tree, column) in enumerate(zip(self.in_tree, self.columns, strict=True)):
                if not tree:
                    rows[k] = y_q[column] / self.led_scales[k]
        return np.concatenate([J, rows])

    # positions

    def closure(self, q: Array, t: float) -> tuple[Array, Array]:
        """C (n_h,) and C_q (n_c, n_v)."""
        return self._C(q, t=t), self._C_q(q, t=t)

    def position(self, t: float, y: Array, guess: Array) -> Array | None:
        """The closed position (n_q,) next to a guess; None if Newton's iteration finds none."""
        if self.direct:
            assert self._kinematics is not None
            still = np.zeros(2 * len(y))
            q = self._kinematics(np.concatenate([y, still, guess]), t=t)[: self.layout.n_q]
            return q if np.isfinite(q).all() else None
        if not np.isfinite(guess).all():
            return None
        q, before = guess, np.inf
        for step in range(STEPS + 1):
            C = self._C(q, t=t)
            e = np.concatenate([self.scales.residual(C), self._gap(q, y, t)])
            size = largest(e)
            if size <= AT_ONCE or not np.isfinite(size):
                return q if size <= AT_ONCE else None
            K = self.matrix(q, t)
            K = np.concatenate([K[: len(C)], K[self.layout.n_c :]])
            rounded = self.scales.rounding(q, K)
            if step and size > 0.5 * before and within(e, SETTLED, rounded):
                return q
            if step == STEPS:
                break
            dz = algebra.lstsq(K, e, rcond=NULL)
            longest = largest(dz)
            q = self.scales.move(q, -dz * min(1.0, LONGEST / longest) if longest else dz)
            before = size
        return q if within(e, ACCEPTED, rounded) else None

    # motion

    def right(self, q: Array, t: float, t1: float, y1: Array) -> Array:
        """Scaled right-hand side of K v = [-C_t t1; y1] where dt/ds = t1 and dy/ds = y1."""
        C_t = np.zeros(self.layout.n_c)
        if t1 and self.layout.n_c:
            C_t = self._rate(np.concatenate([q, self._zero]), t=t)
        return np.concatenate([-t1 * self.scales.residual(C_t), y1 / self.led_scales])

    def tangent(self, t: float, q: Array, t1: float, y1: Array) -> Tangent:
        """dq/ds where dt/ds = t1 and dy/ds = y1."""
        K = self.matrix(q, t)
        U, S, V = algebra.svd(K, full_matrices=False)
        right = U.T @ self.right(q, t, t1, y1)
        small = NULL * S[0]
        rate = V.T @ np.divide(right, S, out=np.zeros_like(S), where=small < S)
        square = K[self._square]
        sign = float(np.linalg.slogdet(square)[0]) if len(square) == len(V) else 1.0
        return Tangent(self.scales.q * rate, float(S[-1] / S[0]), sign, V[-1], U[:, -1])

    def determinant(self, t: float, q: Array) -> float:
        """Signed volume of the independent rows of K; it changes its sign where the motion may branch."""
        K = self.matrix(q, t)[self._square]
        return float(np.linalg.det(K)) if K.shape[0] == K.shape[1] else float("nan")

    def motion(self, t: float, q: Array, y1: Array, y2: Array) -> tuple[Array, Array]:
        """v, a (n_v,) in real time at a closed position, where y' = y1 and y'' = y2; NaN where they are not defined."""
        layout = self.layout
        n_q, n = layout.n_q, layout.n_v
        if self.direct:
            assert self._kinematics is not None
            found = self._kinematics(np.concatenate([self.led_values(q, t), y1, y2, q]), t=t)
            return found[n_q : n_q + n], found[n_q + n :]
        K = self.matrix(q, t)
        v = self.scales.q * algebra.lstsq(K, self.right(q, t, 1.0, y1), rcond=NULL)
        a = self._some_acceleration(t, q, v)
        if not all(self.in_tree):
            second = self._loop_values(q, t, v, a)[2]
        gap = [
            y2[k] - (a[column] if tree else second[column])
            for k, (tree, column) in enumerate(zip(self.in_tree, self.columns, strict=True))
        ]
        right = np.concatenate([np.zeros(layout.n_c), np.array(gap, dtype=float) / self.led_scales])
        a = a + self.scales.q * algebra.lstsq(K, right, rcond=NULL)
        return v, a

    def motions(self, t: Array, y: Array, y1: Array, y2: Array, guesses: Array) -> tuple[Array, Array, Array]:
        """q, v, a (n, k) of many points from guesses (n_q, k); NaN where none is found.  For ``direct`` only."""
        assert self._kinematics is not None
        found = self._kinematics(np.concatenate([y, y1, y2, guesses]), t=t)
        n_q, n = self.layout.n_q, self.layout.n_v
        return found[:n_q], found[n_q : n_q + n], found[n_q + n :]

    def _some_acceleration(self, t: float, q: Array, v: Array) -> Array:
        """An acceleration that fits the constraints, whatever the led coordinates do."""
        layout = self.layout
        if self._kinematics is None:
            return np.zeros(layout.n_v)
        chosen = layout.independent
        if len(layout.independent_q) == len(chosen):
            x = np.concatenate([q[layout.independent_q], v[chosen], np.zeros(len(chosen)), q])
            a = self._kinematics(x, t=t)[layout.n_q + layout.n_v :]
            if np.isfinite(a).all():
                return a
        try:  # the compiled partition is singular here; any dynamics will do
            return self.module.rhs(t, np.concatenate([q, v]))[layout.n_q :]
        except EomgenError:
            return np.full(layout.n_v, np.nan)
