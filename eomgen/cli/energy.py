"""Equations and Trajectory -> change of the energy, held against the work of forces and inputs."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..contact.pairs import PairCall
from ..expr import vectors as vec
from ..expr.core import Expr, reachable, substitute
from ..expr.evaluate import evaluate

if TYPE_CHECKING:
    from ..api.equations import Equations
    from ..runtime.trajectory import Trajectory

MOREAU = "moreau"
POINTS = 8  #: of Gauss's quadrature in each step of the integrator


class EnergyBalance(NamedTuple):
    """How well the energy E = T + V is accounted for (J; the last two relative to the largest T)."""

    initial: float
    final: float
    work: float | None  #: of everything without a potential; None where it is not known
    drift: float  #: max |E - E(0)| / max T
    power_balance: float | None  #: max |E - E(0) - work so far - jumps so far| / max T
    jumps: float  #: what impacts and other resets added to it at their instants, losses negative


class Power:
    """Power (W) of all that has no potential in a model's force elements: wrench . twist at their markers.

    Attributes
    ----------
    uncounted : list of str
        Functions that it depends on and that NumPy cannot evaluate: the work of such a run is not known.
    counts : bool
        Whether the work of a run is summed between its steps: something does work, and all of it is known.
    """

    def __init__(self, equations: Equations) -> None:
        kinematics = equations.kinematics
        motion, power = kinematics.motion, kinematics.graph.zero
        for terms in kinematics.forces:
            for load in terms.marker_remainder:  # in ground axes
                power = power + vec.dot(load.force, motion.velocity(load.marker))
                power = power + vec.dot(load.torque, motion.angular_velocity(load.marker))
            for along in terms.coordinate_remainder:
                power = power + along.value * motion.coordinate(along.coordinate)[1]
        self.kinematics, self.expression = kinematics, kinematics.resolve([power])[0]
        self.uncounted = _without_fallback(self.expression)
        # constraints that move do work of their own
        self.all = not kinematics.mechanism.bare and all(e.is_zero for e in kinematics.constraints.time_derivative)
        self.counts = self.all and not self.expression.is_zero and not self.uncounted

    def work(self, trajectory: Trajectory) -> NDArray[np.float64] | None:
        """Work done up to each time (n_t,), by Gauss's quadrature over each step; None if not known."""
        if not self.all or trajectory.metadata["method"] == MOREAU:
            return None
        values = dict(trajectory.metadata["parameters"])
        graph, names = self.kinematics.graph, self.kinematics.input_names
        constant = {
            graph.symbol(u): graph.constant(float(trajectory[u][0])) for u in names if not np.ptp(trajectory[u])
        }
        power = substitute([self.expression], constant)[0]
        if power.is_zero:
            return np.zeros(len(trajectory.t))
        if _without_fallback(power):
            return None
        nodes, weights = np.polynomial.legendre.leggauss(POINTS)
        start, step = trajectory.t[:-1, None], np.diff(trajectory.t)[:, None]
        times = (start + step * (nodes + 1.0) / 2.0).ravel()
        between = trajectory.at(times)
        values |= {"t": times, **dict(zip(trajectory.x_names, between.x, strict=True))}
        values |= {u: between[u] for u in names}
        watts = np.broadcast_to(evaluate([power], values)[0], times.shape).reshape(-1, POINTS)
        return np.concatenate([[0.0], np.cumsum((watts * weights).sum(axis=1) * step[:, 0] / 2.0)])


def balance_energy(power: Power, trajectory: Trajectory) -> EnergyBalance | None:
    """Hold the energy of a run against the work done on it; None where the model does not know its energy.

    The run has dense output where the power ``counts``.
    """
    if not trajectory.has_energies:
        return None
    T, _, energy = trajectory.energies
    largest, work = float(np.abs(T).max()), power.work(trajectory)
    at_once = np.where(np.diff(trajectory.t) == 0.0, np.diff(energy), 0.0)  # before and after a reset
    jumps = np.concatenate([[0.0], np.cumsum(at_once)])
    balance = None
    if work is not None and largest:
        balance = float(np.abs(energy - energy[0] - work - jumps).max()) / largest
    done = None if work is None else float(work[-1])
    return EnergyBalance(float(energy[0]), float(energy[-1]), done, trajectory.energy_drift, balance, float(jumps[-1]))


def _without_fallback(power: Expr) -> list[str]:
    """Functions that NumPy cannot evaluate, as it can sums over pairs of shapes."""
    graph = power.graph
    kinds = {graph.nodes[i][0] for i in reachable(graph, [power.id])}
    called = (function for kind, (function, _) in graph.calls.items() if kind in kinds)
    return sorted({f.name for f in called if not isinstance(f, PairCall) and getattr(f, "evaluator", None) is None})
