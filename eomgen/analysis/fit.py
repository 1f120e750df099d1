"""Parameters, inputs and initial values of a module that reproduce measured motions best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.analyses import IDENTIFIED, MEASURED, QUADRATURE, ROUNDS
from ..base.limits.runs import SENSITIVITY_ATOL, SENSITIVITY_RTOL
from ..base.results import Result, ResultTable, same_keys
from ..errors import ParameterError, SimulationError, at_odds, ill_shaped, ill_typed, incomplete, no_choice, off_range
from ..runtime.argument_checks import check_names, read_names, read_number, require, require_mapping, unknown
from ..runtime.inputs import Forcing, Table
from ..runtime.layout import bounds_of, silent, start_slopes, warn_of_fixed
from ..runtime.refusals import require_support
from ..runtime.runs.simulate import simulate
from ..runtime.tapes import Expression
from .experiments import Experiment, read_experiments, read_sigma

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.trajectory import Trajectory

# -- derivatives of a run ----------------------------------------------------------------------------------------------

# S' = J S + df/dp is linear, so it needs no steps of its own: along those of the compiled run, on each the four nodes
# of Gauss's formula of order 8 (E. Hairer, S. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 1993,
# section II.7), all Jacobians come from one call and all steps from one set of linear systems. The same formula applied
# to the run itself tells whether the steps are short enough; where they are not, and for loops, events and laws of
# inputs that depend on the state, :mod:`.sensitivities` integrates the derivatives beside the motion.


#: Nodes and weights of Gauss's formula with four nodes on [0, 1], its matrix by the conditions C(4):
#: sum_j a_ij c_j^(k-1) = c_i^k / k.
NODES, WEIGHTS = (0.5 * (np.polynomial.legendre.leggauss(4)[0] + 1.0), 0.5 * np.polynomial.legendre.leggauss(4)[1])
POWERS = np.arange(1, 5)
#: Of the tolerances of the run whose steps are taken: a law that bends within a step, such as smoothed friction, weighs
#: more in the derivatives than in the run.
TIGHTER = 0.1
MATRIX = algebra.solve(NODES[None, :] ** (POWERS[:, None] - 1), (NODES[None, :] ** POWERS[:, None]) / POWERS[:, None]).T


def run_slopes(
    module: BoundModel, names: Sequence[str], columns: Sequence[str], arguments: Mapping[str, Any]
) -> dict[str, Array] | None:
    """The derivatives of the run that ``simulate(module, **arguments)`` makes; None where this way does not serve.

    Parameters
    ----------
    module : BoundModel
    names : sequence of str
        Parameters, inputs (a constant added) and initial values.
    columns : sequence of str
        States and outputs whose derivatives are wanted.
    arguments : mapping
        Of ``simulate``, ``span`` and ``t_eval`` among them.

    Returns
    -------
    dict of str to (n_t, names) array, or None
    """
    layout, initial = module.layout, arguments["initial"]
    if layout.n_c or layout.quaternion_slots or layout.n_events or layout.given_rates or layout.initial_outputs:
        return None
    if not (isinstance(initial, Mapping) and initial.keys() <= set(layout.x)):
        return None
    forcing = Forcing(layout, arguments["inputs"])
    if not _of_time_alone(forcing):
        return None
    bound = module.bind(arguments["parameters"], forcing.constants)
    forcing.attach(bound)
    start, stop = arguments["span"]
    measured = np.asarray(arguments["t_eval"], dtype=float)
    plain = {key: value for key, value in arguments.items() if key != "t_eval"}
    plain |= {name: TIGHTER * np.asarray(arguments[name]) for name in ("rtol", "atol")}
    steps = simulate(module, **plain).t
    grid = np.unique(np.concatenate([steps, measured, forcing.corners(start, stop)]))
    h = np.diff(grid)
    t = (grid[:-1, None] + h[:, None] * NODES).ravel()
    run = simulate(module, **plain, t_eval=np.unique(np.concatenate([t, grid])))
    at, ends = np.searchsorted(run.t, t), np.searchsorted(run.t, grid)
    x, u = run.x[:, at], _inputs(forcing, bound, t)
    rate = np.asarray(bound.rhs(t, x, u=u)).reshape(layout.n_x, len(h), -1)
    missed = run.x[:, ends[:-1]] + h * (rate @ WEIGHTS) - run.x[:, ends[1:]]
    if not np.abs(missed).max() <= QUADRATURE * np.abs(run.x).max():
        return None
    S = _linear(h, *_slopes(bound, names, t, x, u), _start(bound, names, initial))
    wanted = np.searchsorted(grid, measured)
    found = {name: S[wanted, k] for k, name in enumerate(layout.x)}
    if not set(columns) <= found.keys():
        outputs = _outputs(bound, names, forcing, measured, run.x[:, ends[wanted]], S[wanted])
        found |= {name: outputs[:, k] for k, name in enumerate(layout.y) if name not in found}
    return {name: found[name] for name in columns}


def _of_time_alone(forcing: Forcing) -> bool:
    """Whether no input is a Python function, has conditions, or depends on state or parameters."""
    for index, signal in forcing.varying.items():
        if index not in forcing.formulas and not isinstance(signal, Table):
            return False
    return not any(_depends(formula) for formula in forcing.formulas.values())


def _depends(formula: Expression) -> bool:
    return formula.branches or any(operation in ("x", "p") for operation, *_ in formula.tape[0])


def _inputs(forcing: Forcing, module: BoundModel, t: Array) -> Array:
    """u (n_u, k) at times."""
    return forcing.sample(t, np.zeros((module.n_x, len(t))))


def _start(module: BoundModel, names: Sequence[str], given: Mapping[str, float]) -> Array:
    """S (n_x, k) of the initial state: one for a state that is to be found; declared values follow from parameters."""
    S = np.array([[float(name == state) for name in names] for state in module.x_names])
    for state, by_p in start_slopes(module.layout, module.kernels.context.p).items():
        if state not in given:
            S[module.x_names.index(state)] += [
                by_p[module.p_names.index(name)] if name in module.p_names else 0.0 for name in names
            ]
    return S


def _slopes(module: BoundModel, names: Sequence[str], t: Array, x: Array, u: Array) -> tuple[Array, Array]:
    """J (k, n_x, n_x) and df/d(names) (k, n_x, names) at nodes."""
    kernels = module.kernels
    J = np.moveaxis(np.asarray(kernels.jacobian(t, x, u=u)), -1, 0)
    by = np.zeros((len(t), module.n_x, len(names)))
    for kernel, known in (("parameter_jacobian", module.p_names), ("input_jacobian", module.u_names)):
        there = [(column, known.index(name)) for column, name in enumerate(names) if name in known]
        if there:
            values = np.moveaxis(np.asarray(kernels.kernel(kernel)(t, x, u=u)), -1, 0)
            for column, index in there:
                by[:, :, column] = values[:, :, index]
    return J, by


def _linear(h: Array, J: Array, by: Array, start: Array) -> Array:
    """S (steps + 1, n, k) of S' = J S + by, J and by at the nodes of all steps.

    Slopes K_i = J_i (S + h sum_j a_ij K_j) + by_i: of each step one system in all K_i, with S and by on its right side.
    """
    count, n, s = len(h), start.shape[0], len(NODES)
    J, by = J.reshape(count, s, n, n), by.reshape(count, s, n, -1)
    system = -np.einsum("m,ij,mipq->mipjq", h, MATRIX, J).reshape(count, s * n, s * n)
    system[:, range(s * n), range(s * n)] += 1.0
    right = np.concatenate([J, by], axis=-1).reshape(count, s * n, -1)
    K = algebra.solve(system, right).reshape(count, s, n, -1)
    gain = h[:, None, None] * np.einsum("i,mipq->mpq", WEIGHTS, K)
    found = np.empty((count + 1, *start.shape))
    found[0] = start
    for m in range(count):
        found[m + 1] = found[m] + gain[m, :, :n] @ found[m] + gain[m, :, n:]
    return found


def _outputs(module: BoundModel, names: Sequence[str], forcing: Forcing, t: Array, x: Array, S: Array) -> Array:
    """Derivatives (n_t, n_y, k) of the outputs."""
    layout = module.layout
    result = np.empty((len(t), layout.n_y, len(names)))
    u = _inputs(forcing, module, t)
    J, by = _slopes(module, names, t, x, u)
    rates = np.asarray(module.rhs(t, x, u=u))
    n_q, n_x, n_v = layout.n_q, layout.n_x, layout.n_v
    of = [layout.n_u + module.p_names.index(name) if name in module.p_names else
          module.u_names.index(name) if name in module.u_names else -1 for name in names]  # fmt: skip
    for j, time in enumerate(t):
        Y = module.bind(u=u[:, j]).kernels.output_derivatives(x[:n_q, j], x[n_q:, j], rates[n_q:, j], t=float(time))
        here = S[j]
        result[j] = Y[:, :n_x] @ here + Y[:, n_x : n_x + n_v] @ (J[j] @ here + by[j])[n_q:]
        for column, place in enumerate(of):
            if place >= 0:
                result[j, :, column] += Y[:, n_x + n_v + place]
    return result


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
        self, problem: Any, values: Array, jacobian: Array, limits: tuple[Array, Array], found: Any, known: bool
    ) -> None:
        self._problem, self._values, self._jacobian = problem, values, jacobian
        self.names: tuple[str, ...] = problem.names
        self.values = dict(zip(self.names, map(float, values), strict=True))
        self.sigma: dict[str, float] = dict(problem.sigma)
        self.sigma_given = known
        self.residuals: Array = problem.residuals(values)
        self.cost = 0.5 * float(self.residuals @ self.residuals)
        self.degrees_of_freedom = len(self.residuals) - len(self.names)
        self.evaluations, self.success, self.message = int(found.nfev), bool(found.success), str(found.message)
        active = np.asarray(found.active_mask, dtype=int) != 0
        self.at_bounds = tuple(name for name, at in zip(self.names, active, strict=True) if at)
        self._low, self._high = limits
        self.covariance, self.undetermined = self._certainty(active)
        with np.errstate(invalid="ignore"):
            spread = np.sqrt(np.diag(self.covariance))
            self.correlation = self.covariance / np.outer(spread, spread)
        told = {name for direction in self.undetermined for name in direction}
        self.errors = {
            name: float("inf") if name in told else float(error) for name, error in zip(self.names, spread, strict=True)
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
                told = "at its bound"
            elif not np.isfinite(error):
                told = "not determined by the data"
            else:
                part = f" ({100.0 * error / abs(value):.2g} %)" if value else ""
                told = f"+- {error:.2g}{part}"
            rows.append((name, f"{value:.7g}  {told}"))
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

# Weighted least squares by SciPy's ``least_squares``; the derivatives of the motions are those of :mod:`.fit`,
# or of :mod:`.sensitivities` for loops, events and inputs that depend on the state. Covariance of the
# estimates: (J^T J)^-1 of the weighted residuals (Y. Bard, Nonlinear Parameter Estimation, 1974, section 7.5).


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

    def warn_of_fixed(self) -> None:
        """Warn, once for all runs, of initial values that are not given and cannot follow from the parameters."""
        module, layout = self.module, self.module.layout
        p = np.where([name in self.names for name in module.p_names], np.nan, module.p)  # whatever they will be
        by_name = [one.initial or () for one in self.experiments if isinstance(one.initial, Mapping | None)]
        declared = [name for name in (*layout.initial, *layout.initial_outputs) if name not in self.initial_names]
        warn_of_fixed(layout, p, [name for name in declared if any(name not in given for given in by_name)])

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
        with silent():
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
        from .sensitivities import sensitivities

        parts = []
        for one in self.experiments:
            arguments = self.arguments(values, one)
            with silent():
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
    for name, pair in bounds_of(problem.module.info).items():  # outside of which there is no run
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
