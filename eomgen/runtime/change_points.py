"""Stage runtime: the states of a run -> where the mobility itself changes on the way.

At a change point the constraint Jacobian loses rank: a parallelogram lies flat and could go on as an antiparallelogram.
Between stored states the run is followed by Runge-Kutta's method in short steps.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..limits.constraints import PASSED as SINGULAR
from ..numeric.scales import Array

if TYPE_CHECKING:
    from .module import Module

DIP = 0.5  #: a smallest singular value that falls below this part of its largest over the run is looked at
SUBSTEPS = 24  #: between stored states
LEVELS = 3  #: times that the neighbourhood of the smallest value is looked at more closely


class ChangePoint(NamedTuple):
    """A moment at which the mechanism has more degrees of freedom than elsewhere."""

    time: float  #: (s)
    degrees_of_freedom: int  #: there
    coordinates: dict[str, float]

    def __str__(self) -> str:
        shown = ", ".join(f"{name} = {value:.4g}" for name, value in list(self.coordinates.items())[:6])
        more = ", ..." if len(self.coordinates) > 6 else ""
        freedoms = f"{self.degrees_of_freedom} degree{'s' * (self.degrees_of_freedom != 1)} of freedom"
        return f"t = {self.time:.6g} s, {freedoms} at {shown}{more}"


def singular_values(module: Module, t: Array, x: Array, u: Array | None = None) -> Array:
    """Singular values of the scaled constraint Jacobian relative to the largest, (k, min(m, n))."""
    layout = module.layout
    C_q = np.moveaxis(module.constraint_jacobian(x[: layout.n_q], t=t, u=u, rows="all"), -1, 0)
    J = module.layout.scales.jacobian(C_q)
    values = np.linalg.svd(J, compute_uv=False)
    return np.asarray(values / np.maximum(values[:, :1], 1e-300))


def find_change_points(module: Module, t: Array, x: Array, u: Array) -> list[ChangePoint]:
    """Where a run passed configurations in which rank is lost.

    Parameters
    ----------
    module : Module
        With the parameters of the run.
    t : (n_t,) array
    x : (n_x, n_t) array
        Projected.
    u : (n_u, n_t) array

    Returns
    -------
    list of ChangePoint
    """
    rank = module.layout.rank
    if not rank or len(t) < 2:
        return []
    led = bool(module.layout.constraint_inputs)
    least = singular_values(module, t, x, u if led else None)[:, rank - 1]
    padded = np.concatenate([[np.inf], least, [np.inf]])
    dips = np.flatnonzero((least <= padded[:-2]) & (least <= padded[2:]) & (least < DIP * least.max()))
    found: list[ChangePoint] = []
    for k in dips.tolist():
        first, last = max(k - 1, 0), min(k + 1, len(t) - 1)
        times, states = _follow(module, t[first : last + 1], x[:, first], u[:, first : last + 1])
        point = _closest(module, times, states, partial(_between, t, u) if led else None)
        if point is not None and not (found and abs(point.time - found[-1].time) <= 1e-9 + 1e-6 * abs(point.time)):
            found.append(point)
    return found


def _follow(module: Module, t: Array, x: Array, u: Array) -> tuple[Array, Array]:
    """States at SUBSTEPS times per stored step, from the first on."""
    rhs = module.kernels.timed("rhs", nan=True)
    times = np.concatenate([np.linspace(a, b, SUBSTEPS, endpoint=False) for a, b in pairwise(t)])
    times = np.append(times, t[-1])

    def slope(at: float, state: Array) -> Array:
        if not len(u):
            return np.asarray(rhs(at, state))
        return np.asarray(rhs(at, state, u=np.array([np.interp(at, t, row) for row in u])))

    states = [np.array(x)]
    for a, b in pairwise(times):
        h, y = b - a, states[-1]
        k1 = slope(a, y)
        k2 = slope(a + h / 2, y + h / 2 * k1)
        k3 = slope(a + h / 2, y + h / 2 * k2)
        k4 = slope(b, y + h * k3)
        following = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        if not np.isfinite(following).all():  # exactly on the spot: go past it on the tangent
            following = y + h * np.where(np.isfinite(k1), k1, 0.0)
        states.append(following)
    return times, np.array(states).T


def _between(t: Array, u: Array, times: Array) -> Array:
    """Inputs (n_u, k) at times (k,) between those stored."""
    order = np.argsort(t, kind="stable")
    return np.array([np.interp(times, t[order], row[order]) for row in u])


def _closest(
    module: Module, times: Array, states: Array, inputs: Callable[[Array], Array] | None
) -> ChangePoint | None:
    """The state nearest to a loss of rank, if it is one."""
    rank = module.layout.rank
    n = module.n_q
    for _ in range(LEVELS):
        values = singular_values(module, times, states, inputs and inputs(times))
        k = int(np.argmin(values[:, rank - 1]))
        first, last = max(k - 1, 0), min(k + 1, len(times) - 1)
        if np.unique(times[first : last + 1]).size < last - first + 1:
            break  # as near as times can be told apart
        part = np.linspace(0.0, 1.0, 4 * SUBSTEPS + 1)
        between = times[first] + (times[last] - times[first]) * part
        states = np.array([np.interp(between, times, row) for row in states]) if last - first < 2 else _parabola(
            times[first : last + 1], states[:, first : last + 1], between
        )  # fmt: skip
        times = between
    values = singular_values(module, times, states, inputs and inputs(times))
    k = int(np.argmin(values[:, rank - 1]))
    if values[k, rank - 1] > SINGULAR:
        return None
    freedoms = module.layout.n_v - int(np.count_nonzero(values[k] > 10.0 * SINGULAR))
    return ChangePoint(float(times[k]), freedoms, dict(zip(module.q_names, states[:n, k].tolist(), strict=True)))


def _parabola(t: Array, x: Array, at: Array) -> Array:
    """The parabola through three states."""
    a, b, c = t
    w = np.array([
        (at - b) * (at - c) / ((a - b) * (a - c)),
        (at - a) * (at - c) / ((b - a) * (b - c)),
        (at - a) * (at - b) / ((c - a) * (c - b)),
    ])  # fmt: skip
    return np.asarray(x @ w)
