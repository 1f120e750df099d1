"""Identification: parameters, inputs and initial values of a module that reproduce measured motions best.

Weighted least squares by SciPy's ``least_squares``; the derivatives of the motions are those of :mod:`.run_slopes`, or
of :mod:`..simulation.sensitivities` for loops, events and inputs that depend on the state.  Covariance of the
estimates: (J^T J)^-1 of the weighted residuals (Y. Bard, Nonlinear Parameter Estimation, 1974, section 7.5).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.analyses import MEASURED, ROUNDS
from ..base.limits.runs import SENSITIVITY_ATOL, SENSITIVITY_RTOL
from ..errors import (
    ParameterError,
    SimulationError,
    at_odds,
    ill_shaped,
    ill_typed,
    incomplete,
    no_choice,
    off_range,
)
from ..runtime.allowed_parameters import bounds_of
from ..runtime.late_start import fixed_told, tell_fixed
from ..runtime.near_names import check_names, read_names, require, require_mapping, unknown
from ..runtime.refusals import refuse_rigid
from ..runtime.room import read_number
from .experiments import Experiment, read_experiments, read_sigma
from .fit_result import Fit
from .run_slopes import run_slopes

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.trajectory import Trajectory

DERIVATIVES = ("exact", "differences")


def fit(
    module: BoundModel,
    /,
    data: Any,
    parameters: Sequence[str] | Mapping[str, float],
    *,
    initial: Any = None,
    inputs: Any = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    sigma: Any = None,
    derivatives: str = "exact",
    method: Any = "DOP853",
    rtol: float = SENSITIVITY_RTOL,
    atol: float = SENSITIVITY_ATOL,
    **options: Any,
) -> Fit:
    """Find the values at which runs agree best with measured ones.

    Parameters
    ----------
    data : Trajectory, DataFrame, Dataset, mapping, or list of these
        Measured states and outputs by name, over the times ``t`` (a DataFrame may have them as its index); NaN where
        nothing was measured.  Units that a Dataset tells (``attrs["units"]``) are converted.  Of runs, and of tables
        of runs, the states are taken.  A list holds several experiments.  Runs start at the first time.
    parameters : sequence of str, or mapping of str to float
        What to find: parameters, inputs (a constant) and initial values; with values to start from, which otherwise
        are those bound here.
    initial, inputs : optional
        As for ``simulate``; of several experiments a list with one of each, or one for all.
    bounds : mapping of str to (low, high), optional
        Limits of the values; without them those that elements set, such as at least 0 for a mass or a stiffness.
    sigma : float or mapping of str to float, optional
        Standard deviation of the noise of each column.  By default it is found from the residuals, and the fit is
        repeated with it, so that units do not matter.
    derivatives : {'exact', 'differences'}
        Along the steps of the run for trees whose inputs are given over time, else by integration beside the motion;
        or by differences of runs, which give fewer digits, and take less time where exact ones are integrated.
    method, rtol, atol : optional
        Of the runs, as for ``simulate``.
    **options
        ``loss``, ``f_scale``, ``ftol``, ``xtol``, ``gtol`` and ``max_nfev`` of ``scipy.optimize.least_squares``.

    Returns
    -------
    Fit
        ``fit.values``, ``fit.errors``, ``fit.covariance``; ``print(fit)`` reports.

    Raises
    ------
    UsageError
        Unknown names, data that do not fit each other, fewer values than unknowns.
    SimulationError, AssemblyError
        The run from the values at the start fails.
    MissingDependencyError
        SciPy is not installed.
    """
    refuse_rigid(module.layout, "fit")
    least_squares: Any = require("scipy.optimize", "scipy", "fit").least_squares
    check_names("option of fit", options, ("loss", "f_scale", "ftol", "xtol", "gtol", "max_nfev"), ("derivatives",))
    if derivatives not in DERIVATIVES:
        raise no_choice(f"derivatives must be {' or '.join(DERIVATIVES)}, not {derivatives!r}")
    experiments = read_experiments(module, data, initial, inputs)
    problem = _Problem(module, experiments, parameters, {"method": method, "rtol": rtol, "atol": atol})
    problem.tell_fixed()
    limits = _bounds(problem, bounds)
    columns = list(dict.fromkeys(name for one in experiments for name in one.columns))
    known = read_sigma(sigma, columns)
    count = sum(int(np.isfinite(values).sum()) for one in experiments for values in one.columns.values())
    if count <= len(problem.names):
        raise ill_shaped(f"there are {count} measured values, and {len(problem.names)} unknowns; give more data")
    values: Array = problem.start
    found: Any = None
    problem.sigma = known or {name: problem.spread(name) for name in columns}
    problem.residuals(values, told=True)
    for _ in range(1 if known else ROUNDS):
        if found is not None:
            problem.sigma = {name: problem.noise(values, name) for name in columns}
        jac = problem.jacobian if derivatives == "exact" else "2-point"
        found = least_squares(problem.residuals, values, jac=jac, bounds=limits, x_scale="jac", **options)
        values = found.x
    if options.get("loss", "linear") != "linear":  # SciPy weights its derivatives by what the loss takes off
        return Fit(problem, values, np.asarray(found.jac), limits, found, known is not None)
    if not known:
        problem.sigma = {name: problem.noise(values, name) for name in columns}
    return Fit(problem, values, problem.jacobian(values), limits, found, known is not None)


class _Problem:
    """Weighted residuals of all experiments, and their derivatives."""

    def __init__(
        self, module: BoundModel, experiments: list[Experiment], parameters: Any, settings: dict[str, Any]
    ) -> None:
        self.module, self.experiments, self.settings = module, experiments, settings
        start = dict(parameters) if isinstance(parameters, Mapping) else {}
        self.names = tuple(start) if start else read_names("parameters", parameters)
        layout = module.layout
        self.states = (*layout.q, *layout.v, *layout.loops, *layout.loop_rates)
        allowed = (*module.p_names, *module.u_names, *self.states)
        for name in self.names:
            if name not in allowed:
                raise unknown("parameter, input, coordinate or rate", name, allowed)
        if len(set(self.names)) < len(self.names) or not self.names:
            raise incomplete("parameters must name what is to be found, each once")
        self.initial_names = tuple(name for name in self.names if name in self.states)
        self.sigma: dict[str, float] = {}
        self._check_starts()
        self.start = np.array([read_number(name, start[name]) if start else self._bound(name) for name in self.names])

    def _check_starts(self) -> None:
        for one in self.experiments:
            if self.initial_names and not (one.initial is None or isinstance(one.initial, Mapping)):
                raise incomplete("initial must be given by name where initial values are to be found")
            if one.inputs is not None:
                require_mapping("inputs", one.inputs)
            for name in self.names:
                if one.inputs and name in one.inputs:
                    raise at_odds(f"input {name} is given, and cannot be found too; leave it out of one of them")

    def tell_fixed(self) -> None:
        """Warn, once for all runs, of initial values that are not given and cannot follow from the parameters."""
        module, layout = self.module, self.module.layout
        p = np.where([name in self.names for name in module.p_names], np.nan, module.p)  # whatever they will be
        by_name = [one.initial or () for one in self.experiments if isinstance(one.initial, Mapping | None)]
        declared = [name for name in (*layout.initial, *layout.initial_outputs) if name not in self.initial_names]
        tell_fixed(layout, p, [name for name in declared if any(name not in given for given in by_name)])

    def _bound(self, name: str) -> float:
        """The value that holds now."""
        module = self.module
        if name in module.p_names:
            return float(module.p[module.p_names.index(name)])
        if name in module.u_names:
            return float(module.u[module.u_names.index(name)])
        given = self.experiments[0].initial or {}
        if name in given:
            return read_number(name, given[name])
        x = module.x0(given, t=float(self.experiments[0].t[0]))
        if name in module.x_names:
            return float(x[module.x_names.index(name)])
        raise incomplete(f"give a value to start from for {name}: parameters={{{name!r}: ...}}")

    def arguments(self, values: Array, one: Experiment) -> dict[str, Any]:
        """What ``simulate`` takes for an experiment."""
        table = dict(zip(self.names, map(float, values), strict=True))
        module = self.module
        initial: Any = one.initial
        if self.initial_names:
            initial = {**(one.initial or {}), **{name: table[name] for name in self.initial_names}}
        inputs = {**(one.inputs or {}), **{name: x for name, x in table.items() if name in module.u_names}}
        return {
            "span": (float(one.t[0]), float(one.t[-1])),
            "initial": initial,
            "parameters": {name: x for name, x in table.items() if name in module.p_names} or None,
            "inputs": inputs or None,
            "t_eval": one.t,
            **self.settings,
        }

    def run(self, values: Array, one: Experiment) -> Trajectory:
        """The run of an experiment."""
        from ..simulation.simulate import simulate

        with fixed_told():
            return simulate(self.module, **self.arguments(values, one))

    def residuals(self, values: Array, told: bool = False) -> Array:
        """(run - data) / sigma where something was measured; infinite where there is no run, unless that is told."""
        parts = []
        for one in self.experiments:
            try:
                run = self.run(values, one)
                complete = len(run.t) == len(one.t)
            except (SimulationError, ParameterError):
                if told:
                    raise
                complete = False
            for name, measured in one.columns.items():
                there = np.isfinite(measured)
                if not complete:
                    if told:
                        raise SimulationError("the run ends at an event before the last measured time", code="EG-EVENT")
                    parts.append(np.full(int(there.sum()), np.inf))
                else:
                    parts.append((run[name][there] - measured[there]) / self.sigma[name])
        return np.concatenate(parts)

    def jacobian(self, values: Array) -> Array:
        """Derivatives of the residuals by the values."""
        from ..simulation.sensitivities import sensitivities

        parts = []
        for one in self.experiments:
            arguments = self.arguments(values, one)
            with fixed_told():
                slopes = run_slopes(self.module, self.names, tuple(one.columns), arguments)
                if slopes is None:
                    found = sensitivities(self.module, self.names, **arguments)
                    slopes = {name: np.array([found[name, of] for of in self.names]).T for name in one.columns}
            for name, measured in one.columns.items():
                parts.append(slopes[name][np.isfinite(measured)] / self.sigma[name])
        return np.vstack(parts)

    def spread(self, name: str) -> float:
        """Half the range of what was measured of a column."""
        values = np.concatenate([one.columns[name] for one in self.experiments if name in one.columns])
        return float(np.nanmax(values) - np.nanmin(values)) / 2.0 or max(1.0, float(np.nanmax(np.abs(values))))

    def noise(self, values: Array, name: str) -> float:
        """Standard deviation of a column's residuals, as many of the unknowns taken off as its share of the values."""
        total = own = 0
        squares = 0.0
        for one in self.experiments:
            run = self.run(values, one)
            for column, measured in one.columns.items():
                there = np.isfinite(measured)
                total += int(there.sum())
                if column == name:
                    own += int(there.sum())
                    squares += float(((run[column][there] - measured[there]) ** 2).sum())
        free = own * (1.0 - len(self.names) / total)
        return max(float(np.sqrt(squares / free)), MEASURED * self.spread(name))


def _bounds(problem: _Problem, given: Mapping[str, Any] | None) -> tuple[Array, Array]:
    low, high = np.full(len(problem.names), -np.inf), np.full(len(problem.names), np.inf)
    for name, pair in bounds_of(problem.module.metadata).items():  # outside of which there is no run
        if name in problem.names:
            low[problem.names.index(name)], high[problem.names.index(name)] = pair
    if given is not None:
        require_mapping("bounds", given)
    for name, pair in (given or {}).items():
        if name not in problem.names:
            raise unknown("parameter that is to be found", name, problem.names)
        k = problem.names.index(name)
        try:
            low[k], high[k] = (float(x) for x in pair)
        except (TypeError, ValueError):
            raise ill_typed(f"bounds of {name} must be (low, high), not {pair!r}") from None
        if not low[k] < high[k]:
            raise off_range(f"bounds of {name}: {low[k]:g} is not less than {high[k]:g}")
        if not low[k] <= problem.start[k] <= high[k]:
            raise off_range(
                f"{name} starts at {problem.start[k]:g}, outside its bounds {low[k]:g} .. {high[k]:g}; "
                f"give a value to start from: parameters={{{name!r}: ...}}"
            )
    return low, high
