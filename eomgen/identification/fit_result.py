"""Identification: the values that a fit found, how sure they are, and how well the runs agree."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.analyses import IDENTIFIED
from ..base.texts import aligned_rows, as_html
from ..runtime.near_names import require

if TYPE_CHECKING:
    from ..runtime.trajectory import Trajectory


class Fit:
    """Values that make a module's runs agree best with measured ones.

    Attributes
    ----------
    names : tuple of str
        What was to be found.
    values, errors : dict of str to float
        Estimates, and their standard errors; an error is NaN at a bound and infinite where the data do not tell.
    covariance, correlation : (k, k) arrays
        In the order of ``names``; NaN in rows of values at a bound or that the data do not tell.
    sigma : dict of str to float
        Standard deviation of each column's noise, as given, or as found from the residuals.
    cost : float
        Half the sum of the squared residuals over their standard deviations.
    residuals : (n,) array
        (run - data) / sigma, experiment by experiment, column by column.
    degrees_of_freedom : int
        Number of residuals less that of unknowns.
    undetermined : list of dict of str to float
        Directions of the values, relative to their sizes, that the data do not tell; empty if they tell all.
    at_bounds : tuple of str
    evaluations : int
        Trial values of the last round.
    success : bool
    message : str
        SciPy's reason for the end.
    """

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

    def _facts(self) -> list[tuple[str, str]]:
        rows = []
        for name, value in self.values.items():
            error = self.errors[name]
            if name in self.at_bounds:
                told = "at its bound"
            elif not np.isfinite(error):
                told = "not told by the data"
            else:
                part = f" ({100.0 * error / abs(value):.2g} %)" if value else ""
                told = f"+- {error:.2g}{part}"
            rows.append((name, f"{value:.7g}  {told}"))
        noise = ", ".join(f"{name} {x:.3g}" for name, x in self.sigma.items())
        rows.append(("noise" if self.sigma_given else "noise found", noise))
        rows.append(("residuals", f"{len(self.residuals)}, chi^2 per degree of freedom {self.reduced_chi_squared:.4g}"))
        for direction in self.undetermined:
            change = ", ".join(f"{name} {x:+.3g}" for name, x in direction.items())
            rows.append(("not told apart", f"relative changes {change} change no measured value"))
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

    def __repr__(self) -> str:
        return "\n".join([f"fit of {self._problem.module.name}", *aligned_rows(self._facts())])

    def _repr_html_(self) -> str:
        return as_html(f"fit of {self._problem.module.name}", self._facts())
