"""Equations and Trajectory -> change of the energy, held against the work of forces and inputs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..contact.pairs import PairCall
from ..expr import vectors as vec
from ..expr.core import Expr, reachable, substitute
from ..expr.evaluate import evaluate

if TYPE_CHECKING:
    from ..api.equations import Equations
    from ..mechanics import Kinematics
    from ..runtime.bound_model import BoundModel
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


def balance_energy(equations: Equations, trajectory: Trajectory) -> EnergyBalance | None:
    """Hold the energy of a run against the work done on it.

    Parameters
    ----------
    equations : Equations
    trajectory : Trajectory
        With dense output where :func:`counts_work` says so.

    Returns
    -------
    EnergyBalance
        None where the model does not know its energy.
    """
    if not trajectory.has_energies:
        return None
    T, _, energy = trajectory.energies
    largest = float(np.abs(T).max())
    work = None if trajectory.metadata["method"] == MOREAU else _work(equations.kinematics, trajectory)
    at_once = np.where(np.diff(trajectory.t) == 0.0, np.diff(energy), 0.0)  # before and after a reset
    jumps = np.concatenate([[0.0], np.cumsum(at_once)])
    balance = None
    if work is not None and largest:
        balance = float(np.abs(energy - energy[0] - work - jumps).max()) / largest
    return EnergyBalance(
        float(energy[0]),
        float(energy[-1]),
        None if work is None else float(work[-1]),
        trajectory.energy_drift,
        balance,
        float(jumps[-1]),
    )


def _work(kinematics: Kinematics, trajectory: Trajectory) -> NDArray[np.float64] | None:
    """Work done up to each time (n_t,), by Gauss's quadrature of the power over each step; None if not known."""
    if kinematics.mechanism.bare or not all(e.is_zero for e in kinematics.constraints.time_derivative):
        return None  # constraints that move do work of their own
    values = dict(trajectory.metadata["parameters"])
    graph, names = kinematics.graph, kinematics.input_names
    held = {u: float(trajectory[u][0]) for u in names if not np.ptp(trajectory[u])}
    power = substitute([_power(kinematics)], {graph.symbol(u): graph.constant(value) for u, value in held.items()})[0]
    if power.is_zero:
        return np.zeros(len(trajectory.t))
    if _without_fallback(power):
        return None
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    start, step = trajectory.t[:-1, None], np.diff(trajectory.t)[:, None]
    times = (start + step * (nodes + 1.0) / 2.0).ravel()
    between = trajectory.at(times)
    values |= {"t": times, **dict(zip(trajectory.x_names, between.x, strict=True)), **{u: between[u] for u in names}}
    watts = np.broadcast_to(evaluate([power], values)[0], times.shape).reshape(-1, POINTS)
    return np.concatenate([[0.0], np.cumsum((watts * weights).sum(axis=1) * step[:, 0] / 2.0)])


def takes_impulses(module: BoundModel, options: Mapping[str, Any]) -> bool:
    """Whether a run is one of method moreau, in which impulses of contacts do work at their instants."""
    return bool(options.get("method", module.info.simulation["method"]) == MOREAU)


def counts_work(equations: Equations) -> bool:
    """Whether the work of a run is summed between its steps: something without a potential does work that is known."""
    kinematics = equations.kinematics
    if kinematics.mechanism.bare or not all(e.is_zero for e in kinematics.constraints.time_derivative):
        return False
    power = _power(kinematics)
    return not power.is_zero and not _without_fallback(power)


def uncounted_functions(equations: Equations) -> list[str]:
    """Functions that the power depends on and that NumPy cannot evaluate: the work of such a run is not known."""
    return _without_fallback(_power(equations.kinematics))


def _without_fallback(power: Expr) -> list[str]:
    graph = power.graph
    called = {graph.nodes[i][0] for i in reachable(graph, [power.id])} & graph.calls.keys()
    return sorted({function.name for function, _ in (graph.calls[key] for key in called) if _lacks_fallback(function)})


def _lacks_fallback(function: object) -> bool:
    """Whether NumPy cannot evaluate a function, as it can sums over pairs of shapes."""
    return not isinstance(function, PairCall) and getattr(function, "evaluator", None) is None


def _power(kinematics: Kinematics) -> Expr:
    """Power (W) of all that has no potential in force elements: wrench . twist at their markers, in ground axes."""
    motion, power = kinematics.motion, kinematics.graph.zero
    for terms in kinematics.forces:
        for load in terms.marker_remainder:
            power = power + vec.dot(load.force, motion.velocity(load.marker))
            power = power + vec.dot(load.torque, motion.angular_velocity(load.marker))
        for along in terms.coordinate_remainder:
            power = power + along.value * motion.coordinate(along.coordinate)[1]
    return kinematics.resolve([power])[0]
