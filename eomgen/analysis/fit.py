"""Parameters, inputs and initial values of a module that reproduce measured motions best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.runs import SENSITIVITY_ATOL, SENSITIVITY_RTOL
from ..base.results import Result, ResultTable, same_keys
from ..errors import ParameterError, SimulationError, at_odds, ill_shaped, ill_typed, incomplete, no_choice, off_range
from ..runtime.argument_checks import check_names, read_names, read_number, require, require_mapping
from ..runtime.layout import bounds_of, silent, warn_of_fixed
from ..runtime.refusals import require_support
from ..runtime.runs.simulate import simulate
from .experiments import Experiment, read_experiments, read_sigma
from .limits import IDENTIFIED, MEASURED, ROUNDS
from .sensitivities import sensitivities

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.trajectory import Trajectory

# -- the result --------------------------------------------------------------------------------------------------------


class Fit(Result):
    """Values that make a module's runs agree best with measured ones.

    Attributes
    ----------
    names : tuple of str
        What was to be found.
    values, errors : dict of str to float
        Estimates, and their standard errors: NaN at a bound, infinite where the data do not determine a value.
    covariance, correlation : (k, k) arrays
        In the order of ``names``; NaN in rows of values at a bound or that the data do not determine them.
    sigma : dict of str to float
        Standard deviation of each column's noise, as given, or as found from the residuals.
    cost : float
        Half the sum of the squared residuals over their standard deviations.
    residuals : (n,) array
        (run - data) / sigma, experiment by experiment, column by column.
    degrees_of_freedom : int
        Number of residuals less that of unknowns.
    undetermined : list of dict of str to float
        Directions of the values, relative to their sizes, that the data do not determine; empty if they determine all.
    at_bounds : tuple of str
    evaluations : int
        Trial values of the last round.
    success : bool
    message : str
        SciPy's reason for the end.
    """

    KEYS = same_keys(
        *("values", "errors", "covariance", "sigma", "cost", "degrees_of_freedom", "undetermined", "at_bounds"),
        *("evaluations", "success", "message"),
    )

    def __init__(
        self, problem: Any, values: Array, jacobian: Array, limits: tuple[Array, Array], result: Any, known: bool
    ) -> None:
        self._problem, self._values, self._jacobian = problem, values, jacobian
        self.names: tuple[str, ...] = problem.names
        self.values = dict(zip(self.names, map(float, values), strict=True))
        self.sigma: dict[str, float] = dict(problem.sigma)
        self.sigma_given = known
        self.residuals: Array = problem.residuals(values)
        self.cost = 0.5 * float(self.residuals @ self.residuals)
        self.degrees_of_freedom = len(self.residuals) - len(self.names)
        self.evaluations, self.success, self.message = int(result.nfev), bool(result.success), str(result.message)
        active = np.asarray(result.active_mask, dtype=int) != 0
        self.at_bounds = tuple(name for name, at in zip(self.names, active, strict=True) if at)
        self._low, self._high = limits
        self.covariance, self.undetermined = self._certainty(active)
        with np.errstate(invalid="ignore"):
            spread = np.sqrt(np.diag(self.covariance))
            self.correlation = self.covariance / np.outer(spread, spread)
        free = {name for direction in self.undetermined for name in direction}
        self.errors = {
            name: float("inf") if name in free else float(error) for name, error in zip(self.names, spread, strict=True)
        }

    def _certainty(self, active: np.ndarray[Any, np.dtype[np.bool_]]) -> tuple[Array, list[dict[str, float]]]:
        """(J^T J)^-1 of the values that the data tell, and directions that they do not."""
        k = len(self.names)
        covariance = np.full((k, k), np.nan)
        free = np.flatnonzero(~active)
        if not len(free):
            return covariance, []
        J = self._jacobian[:, free]
        size = np.sqrt((J * J).sum(axis=0))
        scale = np.where(size > 0.0, size, 1.0)
        _, s, Vt = algebra.svd(J / scale, full_matrices=False)
        weak = s <= IDENTIFIED * s[0] if s[0] > 0.0 else np.ones(len(s), dtype=bool)
        directions, touched = [], np.zeros(len(free), dtype=bool)
        for row in Vt[weak]:
            step = row / scale
            relative = step / np.maximum(np.abs(self._values[free]), np.finfo(float).tiny)
            relative = relative / np.abs(relative).max()
            taken = np.abs(row) > np.sqrt(IDENTIFIED)
            touched |= taken
            directions.append({self.names[free[i]]: float(relative[i]) for i in np.flatnonzero(taken)})
        inverse = (Vt[~weak].T / s[~weak] ** 2) @ Vt[~weak] / np.outer(scale, scale)
        inverse[touched], inverse[:, touched] = np.nan, np.nan
        covariance[np.ix_(free, free)] = inverse
        return covariance, directions

    @property
    def parameters(self) -> dict[str, float]:
        """The parameters among the values, as ``simulate`` and ``bind`` take them."""
        return {name: x for name, x in self.values.items() if name in self._problem.module.p_names}

    @property
    def initial(self) -> dict[str, float]:
        """The initial values among the values."""
        return {name: self.values[name] for name in self._problem.initial_names}

    @cached_property
    def trajectories(self) -> list[Trajectory]:
        """The run of each experiment with the values found, at the times that were measured."""
        return [self._problem.run(self._values, one) for one in self._problem.experiments]

    @property
    def reduced_chi_squared(self) -> float:
        """Sum of the squared residuals over the degrees of freedom: near 1 where the noise is as ``sigma`` says."""
        return 2.0 * self.cost / self.degrees_of_freedom

    def plot(self, *columns: str, experiment: int = 0) -> Any:
        """Draw what was measured as points and the run as a line, a panel for each column.

        Parameters
        ----------
        *columns : str
            All measured ones by default.
        experiment : int

        Returns
        -------
        matplotlib Figure
        """
        plt = require("matplotlib.pyplot", "matplotlib", "plot")
        one, run = self._problem.experiments[experiment], self.trajectories[experiment]
        chosen = columns or tuple(one.columns)
        figure, panels = plt.subplots(
            len(chosen), 1, sharex=True, squeeze=False, figsize=(7.0, 1.0 + 1.6 * len(chosen)), layout="constrained"
        )
        for panel, name in zip(panels[:, 0], chosen, strict=True):
            unit = run.units.get(name, "")
            panel.plot(one.t, one.columns[name], ".", color="0.6", markersize=3, label="measured")
            panel.plot(run.t, run[name], color="C0", label="fitted run")
            panel.set_ylabel(f"{name} ({unit})" if unit else name)
            panel.grid(alpha=0.3)
        panels[0, 0].legend(loc="upper right", fontsize="small")
        panels[-1, 0].set_xlabel("t (s)")
        return figure

    @property
    def title(self) -> str:
        return f"fit of {self._problem.module.name}"

    @property
    def tables(self) -> list[ResultTable]:
        """What was found, and how sure it is."""
        return [ResultTable(["", "value", "error"], [[n, x, self.errors[n]] for n, x in self.values.items()])]

    @property
    def facts(self) -> list[tuple[str, str]]:
        rows = []
        for name, value in self.values.items():
            error = self.errors[name]
            if name in self.at_bounds:
                note = "at its bound"
            elif not np.isfinite(error):
                note = "not determined by the data"
            else:
                part = f" ({100.0 * error / abs(value):.2g} %)" if value else ""
                note = f"+- {error:.2g}{part}"
            rows.append((name, f"{value:.7g}  {note}"))
        noise = ", ".join(f"{name} {x:.3g}" for name, x in self.sigma.items())
        rows.append(("noise" if self.sigma_given else "noise found", noise))
        rows.append(("residuals", f"{len(self.residuals)}, chi^2 per degree of freedom {self.reduced_chi_squared:.4g}"))
        for direction in self.undetermined:
            change = ", ".join(f"{name} {x:+.3g}" for name, x in direction.items())
            rows.append(("not distinguished", f"relative changes {change} change no measured value"))
        strong = [
            f"{a} and {b} {self.correlation[i, j]:+.3f}"
            for i, a in enumerate(self.names)
            for j, b in enumerate(self.names)
            if i < j and abs(self.correlation[i, j]) > 0.95
        ]
        if strong:
            rows.append(("correlated", ", ".join(strong)))
        rows.append(("ended", f"{self.message} ({self.evaluations} trials)"))
        return rows


# -- the fit -----------------------------------------------------------------------------------------------------------

# Weighted least squares by SciPy's ``least_squares``; the derivatives of the motions are those of
# :mod:`.sensitivities`.  Covariance of the estimates: (J^T J)^-1 of the weighted residuals (Y. Bard, Nonlinear
# Parameter Estimation, 1974, section 7.5).


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
        Those of ``sensitivities``, or differences of runs, which give fewer digits, and take less time where
        ``sensitivities`` integrates beside the motion.
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
    require_support(module.layout, "fit")
    least_squares: Any = require("scipy.optimize", "scipy", "fit").least_squares
    check_names("option of fit", options, ("loss", "f_scale", "ftol", "xtol", "gtol", "max_nfev"), ("derivatives",))
    if derivatives not in DERIVATIVES:
        raise no_choice(f"derivatives must be {' or '.join(DERIVATIVES)}, not {derivatives!r}")
    experiments = read_experiments(module, data, initial, inputs)
    problem = _Problem(module, experiments, parameters, {"method": method, "rtol": rtol, "atol": atol})
    problem.warn_of_fixed()
    limits = _bounds(problem, bounds)
    columns = list(dict.fromkeys(name for one in experiments for name in one.columns))
    known = read_sigma(sigma, columns)
    count = sum(int(np.isfinite(values).sum()) for one in experiments for values in one.columns.values())
    if count <= len(problem.names):
        raise ill_shaped(f"there are {count} measured values, and {len(problem.names)} unknowns; give more data")
    values: Array = problem.start
    result: Any = None
    problem.sigma = known or {name: problem.spread(name) for name in columns}
    problem.residuals(values, warn=True)
    for _ in range(1 if known else ROUNDS):
        if result is not None:
            problem.sigma = {name: problem.noise(values, name) for name in columns}
        jac = problem.jacobian if derivatives == "exact" else "2-point"
        result = least_squares(problem.residuals, values, jac=jac, bounds=limits, x_scale="jac", **options)
        values = result.x
    if options.get("loss", "linear") != "linear":  # SciPy weights its derivatives by what the loss takes off
        return Fit(problem, values, np.asarray(result.jac), limits, result, known is not None)
    if not known:
        problem.sigma = {name: problem.noise(values, name) for name in columns}
    return Fit(problem, values, problem.jacobian(values), limits, result, known is not None)


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
        check_names(
            "parameter, input, coordinate or rate", self.names, (*module.p_names, *module.u_names, *self.states)
        )
        if len(set(self.names)) < len(self.names) or not self.names:
            raise incomplete("parameters must name the unknowns, each once")
        self.initial_names = tuple(name for name in self.names if name in self.states)
        self.sigma: dict[str, float] = {}
        self._check_starts()
        self.start = np.array([read_number(name, start[name]) if start else self._bound(name) for name in self.names])

    def _check_starts(self) -> None:
        for one in self.experiments:
            if self.initial_names and not (one.initial is None or isinstance(one.initial, Mapping)):
                raise incomplete("give initial by name if initial values are unknowns")
            if one.inputs is not None:
                require_mapping("inputs", one.inputs)
            for name in self.names:
                if one.inputs and name in one.inputs:
                    raise at_odds(f"input {name} has a value and is an unknown too; leave it out of one of them")

    def warn_of_fixed(self) -> None:
        """Warn, once for all runs, of initial values that are not given and cannot follow from the parameters."""
        module, layout = self.module, self.module.layout
        p = np.where([name in self.names for name in module.p_names], np.nan, module.p)  # whatever they will be
        by_name = [one.initial or () for one in self.experiments if isinstance(one.initial, Mapping | None)]
        declared = [name for name in (*layout.initial, *layout.initial_outputs) if name not in self.initial_names]
        warn_of_fixed(layout, p, [name for name in declared if any(name not in raw for raw in by_name)])

    def _bound(self, name: str) -> float:
        module = self.module
        if name in module.p_names:
            return float(module.p[module.p_names.index(name)])
        if name in module.u_names:
            return float(module.u[module.u_names.index(name)])
        raw = self.experiments[0].initial or {}
        if name in raw:
            return read_number(name, raw[name])
        x = module.x0(raw, t=float(self.experiments[0].t[0]))
        if name in module.x_names:
            return float(x[module.x_names.index(name)])
        raise incomplete(f"give a value to start from for {name}: parameters={{{name!r}: ...}}")

    def arguments(self, values: Array, one: Experiment) -> dict[str, Any]:
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
        with silent():
            return simulate(self.module, **self.arguments(values, one))

    def residuals(self, values: Array, warn: bool = False) -> Array:
        """(run - data) / sigma where something was measured; infinite where there is no run, unless that is told."""
        parts = []
        for one in self.experiments:
            try:
                run = self.run(values, one)
                complete = len(run.t) == len(one.t)
            except (SimulationError, ParameterError):
                if warn:
                    raise
                complete = False
            for name, measured in one.columns.items():
                there = np.isfinite(measured)
                if not complete:
                    if warn:
                        raise SimulationError("the run ends at an event before the last measured time", code="EG-EVENT")
                    parts.append(np.full(int(there.sum()), np.inf))
                else:
                    parts.append((run[name][there] - measured[there]) / self.sigma[name])
        return np.concatenate(parts)

    def jacobian(self, values: Array) -> Array:
        parts = []
        for one in self.experiments:
            with silent():
                result = sensitivities(self.module, self.names, **self.arguments(values, one))
            for name, measured in one.columns.items():
                slopes = np.array([result[name, of] for of in self.names]).T
                parts.append(slopes[np.isfinite(measured)] / self.sigma[name])
        return np.vstack(parts)

    def spread(self, name: str) -> float:
        """Half the range of what was measured of a column."""
        values = np.concatenate([one.columns[name] for one in self.experiments if name in one.columns])
        return float(np.nanmax(values) - np.nanmin(values)) / 2.0 or max(1.0, float(np.nanmax(np.abs(values))))

    def noise(self, values: Array, name: str) -> float:
        """Standard deviation of a column's residuals, as many of the unknowns taken off as its share of the values."""
        total = of_run = 0
        squares = 0.0
        for one in self.experiments:
            run = self.run(values, one)
            for column, measured in one.columns.items():
                there = np.isfinite(measured)
                total += int(there.sum())
                if column == name:
                    of_run += int(there.sum())
                    squares += float(((run[column][there] - measured[there]) ** 2).sum())
        free = of_run * (1.0 - len(self.names) / total)
        return max(float(np.sqrt(squares / free)), MEASURED * self.spread(name))


def _bounds(problem: _Problem, raw: Mapping[str, Any] | None) -> tuple[Array, Array]:
    low, high = np.full(len(problem.names), -np.inf), np.full(len(problem.names), np.inf)
    for name, pair in bounds_of(problem.module.info).items():  # outside of which there is no run
        if name in problem.names:
            low[problem.names.index(name)], high[problem.names.index(name)] = pair
    if raw is not None:
        require_mapping("bounds", raw)
    check_names("fitted parameter", raw or (), problem.names)
    for name, pair in (raw or {}).items():
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
