"""Analysis: a Module and led coordinates -> positions, velocities and accelerations at single points of a path.

The system is C(q, t) = 0 with y(q) = the led values, as many as there are degrees of freedom (Haug, Computer Aided
Kinematics and Dynamics of Mechanical Systems, ch. 3): its scaled Jacobian K = [C_q; y_q] has full column rank but at
singular positions, where the led coordinates do not determine the motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.analyses import NULL
from ..errors import EomgenError
from ..numeric.closure import ClosureSystem, WantedValues, close, closed
from ..numeric.constraint_system import ConstraintSystem
from ..numeric.continuation import Continuation
from ..numeric.curves import Point, Tangent
from ..numeric.scales import Scales
from ..runtime.constraint_kernels import constraint_system

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

STEPS = 25  #: Newton steps


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
        self.system: ConstraintSystem = constraint_system(kernels)
        self._rate = kernels.state("velocity_constraints", nan=True)
        known = layout.rank and "kinematics" in kernels.core.names
        self._kinematics = kernels.state("kinematics", nan=True) if known else None
        self._loops = kernels.motion("loop_coordinates") if layout.n_loop_coordinates else None
        chosen = [layout.velocity_labels[i] for i in layout.independent]
        #: whether the compiled kernel leads the same coordinates
        self.direct = self._kinematics is not None and list(led) == chosen and set(chosen) <= set(layout.q)
        wanted = self.system.wanted(dict.fromkeys(led, 0.0), self.led)
        nothing = WantedValues(lambda q: (np.empty(0), np.empty((0, layout.n_v))), np.empty(0), np.empty(0), [], [])
        self._wanted = nothing if wanted is None else wanted
        self.led_scales, self.wraps = self._wanted.scales, np.array(self._wanted.angles, dtype=bool)
        self._zero = np.zeros(layout.n_v)
        independent = layout.rows if layout.rank else np.empty(0, dtype=np.intp)
        self._square = np.concatenate([independent, layout.n_c + np.arange(len(led))]).astype(np.intp)

    # positions

    def led_values(self, q: Array, t: float) -> Array:
        """y (k,) at a position."""
        return self.system.at(t).measure(self.led, q)[0]

    def equations(self, t: float, y: Array) -> WantedValues:
        """The led coordinates as equations."""
        measure = self.system.at(t).measure
        return self._wanted._replace(evaluate=lambda q: measure(self.led, q), values=y)

    def closure(self, t: float, y: Array) -> ClosureSystem:
        """The constraints and the led coordinates, all of them as equations."""
        return ClosureSystem(self.system.at(t).position, self.scales, np.ones(self.layout.n_v), self.equations(t, y))

    def matrix(self, q: Array, t: float) -> Array:
        """K (n_c + k, n_v), scaled."""
        return self.closure(t, self._wanted.values).evaluate(q)[1]

    def position(self, t: float, y: Array, guess: Array) -> Array | None:
        """The closed position (n_q,) next to a guess; None if Newton's iteration finds none."""
        if self.direct:
            assert self._kinematics is not None
            still = np.zeros(2 * len(y))
            q = self._kinematics(np.concatenate([y, still, guess]), t=t)[: self.layout.n_q]
            return q if np.isfinite(q).all() else None
        q, residual = close(self.closure(t, y), guess, STEPS, damping=None)
        return q if closed(residual) else None

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
        if not len(q):  # nothing moves, and no singular value says so
            return Tangent(q, 1.0, 1.0, q, np.zeros(len(K)))
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
        loops = () if self._loops is None else self._loops(q, v, a, t=t)[2]
        own = dict(zip((*layout.velocity_labels, *layout.loops), (*a, *loops), strict=True))
        gap = y2 - np.array([own[name] for name in self.led])
        right = np.concatenate([np.zeros(layout.n_c), gap / self.led_scales])
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


class DrivenPath(NamedTuple):
    """A straight path of a driven mechanism: t and the led values are linear in s."""

    driven: DrivenCoordinates
    t: float
    y: Array
    t1: float  #: dt/ds
    y1: Array  #: dy/ds

    @property
    def scales(self) -> Scales:
        """The scales of positions."""
        return self.driven.scales

    def at(self, s: float) -> tuple[float, Array]:
        """Time and led values."""
        return self.t + s * self.t1, self.y + s * self.y1

    def beyond(self, s: float) -> DrivenPath:
        """The rest of the path from s on."""
        return DrivenPath(self.driven, *self.at(s), self.t1, self.y1)

    def tangent(self, s: float, q: Array) -> Tangent:
        """The direction at a position of the path."""
        return self.driven.tangent(self.at(s)[0], q, self.t1, self.y1)

    def solve(self, s: float, guess: Array) -> Point | None:
        """The point next to a guess."""
        q = self.driven.position(*self.at(s), guess)
        return None if q is None else Point(s, q, self.tangent(s, q))


class DrivenContinuation(Continuation):
    """A continuation along such a path."""

    curve: DrivenPath
