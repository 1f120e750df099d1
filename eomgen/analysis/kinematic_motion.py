"""Analysis: positions, velocities and accelerations over a range -> KinematicAnalysis, a Trajectory without forces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.analyses import SLACK
from ..errors import cannot
from ..numeric.projection import largest
from ..runtime.columns import Columns, describe, units_of
from ..runtime.run_parts import Residuals
from ..runtime.trajectory import Trajectory
from .driven_coordinates import DrivenCoordinates
from .singular import Singular

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

METHOD = "kinematic"


class MotionColumns(Columns):
    """Columns of a motion whose accelerations are known, and come from no force.  NaN where it is not defined."""

    def __init__(self, module: BoundModel, t: Array, x: Array, u: Array, a: Array) -> None:
        super().__init__(module, t, x, u)
        self.a = a

    @cached_property
    def slopes(self) -> Array:
        """x' (n_x, n_t)."""
        n_q = self.module.n_q
        q, v = self.x[:n_q], self.x[n_q:]
        space = self.module.layout.space
        return np.concatenate([v if space is None else space.rates(q, v), self.a])

    def _outputs(self) -> Array:
        module, n_q = self.module, self.module.n_q
        if not module.metadata.get("output_accelerations", True):
            kernel = module.kernels.timed("outputs", nan=True)
            return kernel(self.t, self.x, u=self._varying())
        motion = module.kernels.motion("motion_outputs")
        return motion(self.x[:n_q], self.x[n_q:], self.a, u=self._varying(), t=self.t)

    @cached_property
    def energies(self) -> Array:
        """Kinetic, potential and total energy (3, n_t)."""
        T, V = self.module.kernels.state("energy", nan=True)(self.x, u=self._varying(), t=self.t)
        return np.array([T, V, T + V])


class KinematicAnalysis(Trajectory):
    """The motion over a range of time or of prescribed coordinates, as a :class:`~..runtime.trajectory.Trajectory`.

    Attributes
    ----------
    q, v, a : (n_q, n_t), (n_v, n_t), (n_v, n_t) arrays
        Velocities and accelerations are NaN where the prescribed coordinates do not determine them.
    led : tuple of str
        The prescribed coordinates; none if drivers alone move the mechanism.
    singular : list of Singular
        Singular positions met, in order.
    stop : Singular or None
        Where the range ended early.
    complete : bool
        Whether the whole range was reached.
    """

    def __init__(
        self,
        module: BoundModel,
        motion: tuple[Array, Array, Array, Array],
        columns: MotionColumns,
        header: dict[str, Any],
        found: Sequence[Singular],
        stop: Singular | None,
        led: tuple[str, ...],
        **rest: Any,
    ) -> None:
        t, _, _, self.a = motion
        super().__init__(t, columns.x, columns, header, **rest)
        self._module = module
        self.singular, self.stop, self.led = list(found), stop, led

    @property
    def complete(self) -> bool:
        """Whether the whole range was reached."""
        return self.stop is None

    def turning_points(self, name: str) -> list[tuple[float, float]]:
        """Dead centres of a coordinate: (time, value) where its rate changes sign.

        Between two points of the range the coordinate is taken as the cubic through its values and rates there.

        Parameters
        ----------
        name : str
            A column that has a rate, ``name_dot``.

        Raises
        ------
        UsageError
            The time is constant in the range, or the column has no rate.
        """
        if name + "_dot" not in self.names:
            raise cannot(f"{name!r} has no rate among the columns")
        if len(self.t) < 2 or not np.diff(self.t).any():
            raise cannot("the time is constant in this range, so there are no rates; give t together with the values")
        y, rate = self[name], self[name + "_dot"]
        found = []
        for k in np.flatnonzero((rate[:-1] * rate[1:] < 0.0) | (rate[:-1] == 0.0)):
            h = self.t[k + 1] - self.t[k]
            d0, d1, dy = rate[k] * h, rate[k + 1] * h, y[k + 1] - y[k]
            cubic = np.array([d0 + d1 - 2 * dy, 3 * dy - 2 * d0 - d1, d0, y[k]])
            roots = np.roots(np.polyder(cubic)) if cubic[:3].any() else np.zeros(1)
            inside = [
                float(r.real) for r in np.atleast_1d(roots) if abs(r.imag) < SLACK and -SLACK <= r.real <= 1 + SLACK
            ]
            if inside:
                x = min(inside, key=lambda r: abs(r - d0 / (d0 - d1)) if d0 != d1 else r)
                found.append((float(self.t[k] + x * h), float(np.polyval(cubic, x))))
        return found

    def __repr__(self) -> str:
        over = (
            f"of {', '.join(self.led)}"
            if self.led
            else f"t = {self.t[0]:.6g} .. {self.t[-1]:.6g} s"
            if self.t.size
            else ""
        )
        end = "" if self.stop is None else f", ends early: {self.stop}"
        return f"<KinematicAnalysis of {self.name}: {len(self)} points {over}{end}>"


def keep(
    driven: DrivenCoordinates,
    t: Array,
    parts: Sequence[tuple[Array, Array, Array]],
    found: Sequence[Singular],
    stop: Singular | None,
    asked: int,
    led: tuple[str, ...],
    *,
    u: Array | None = None,
    header: Mapping[str, Any] | None = None,
    **rest: Any,
) -> KinematicAnalysis:
    """Put an analysis together from its pieces; ``asked`` points were asked for.

    ``u`` (n_u, n_t) are inputs that vary; ``header`` has metadata that comes first, ``rest`` what a Trajectory takes.
    """
    module = driven.module
    q, v, a = (np.concatenate([part[i] for part in parts], axis=1) for i in range(3))
    x = np.concatenate([q, v])
    if u is None:
        u = np.repeat(module.u[:, None], len(t), axis=1)
    columns = MotionColumns(module, t, x, u, a)
    complete = describe(module) | {
        "method": METHOD,
        "rtol": None,
        "atol": None,
        "span": [float(t[0]), float(t[-1])] if t.size else [],
        "led": list(led),
        "singular": [str(s) for s in found],
        "status": 0 if stop is None else -1,
        "message": "the whole range" if stop is None else f"{len(t)} of {asked} points: {stop}",
        "residuals": residuals(module, t, x)._asdict(),
        "units": units_of(module, columns.names),
        **(header or {}),
    }
    return KinematicAnalysis(module, (t, q, v, a), columns, complete, found, stop, led, **rest)


def residuals(module: BoundModel, t: Array, x: Array) -> Residuals:
    """How well the constraints are kept, all rows, where the motion is defined."""
    n = module.n_q
    if not module.n_rows or not t.size:
        return Residuals()
    position = largest(module.constraints.every(x[:n], t=t))
    fine = np.isfinite(x).all(axis=0)
    rate = module.kernels.state("velocity_constraints")(x[:, fine], t=t[fine]) if fine.any() else np.empty(0)
    return Residuals(position, largest(rate), position, largest(rate))
