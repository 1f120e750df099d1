"""What many runs came to, by name; its picture, HTML and xarray Dataset."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...base.algebra import Array
from ...base.files import whole_file
from ...base.results import Result, ResultTable, picture_html, side_by_side
from ...base.results import plain as plain_values
from ...base.texts import TIME, html_table, label
from ...base.value_rules import read_count
from ...errors import UsageError, cannot, off_range
from ..argument_checks import require, unknown
from ..identity import origin, plain, spell_input
from ..plotting import printed_names
from ..runs.simulate import simulate
from ..storage import attributes, free, table_path
from .block import EVENT, MEANING, Custom, Reduction, Runs, Statistics, summarise

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes

    from ..trajectory import Trajectory


PANELS = 3  #: columns that a notebook draws
ROWS = 12  #: columns whose numbers it lists
FAILURES = 5  #: runs that it names
NAMED = 6  #: values of a run that its failure names
STATISTICS = ("count", "mean", "variance", "least", "greatest")
#: Of each run, and what it is.
COLUMNS_DOC = {
    "status": "0 where the end was reached",
    "t_end": "how far the run came (s)",
    "steps": "steps that were taken",
}


class Failure(NamedTuple):
    """A run that did not reach the end."""

    run: int
    status: int
    t: float  #: how far it came (s)
    message: str
    values: dict[str, float]  #: of what differs between the runs, as ``varied()`` calls it

    def __str__(self) -> str:
        values = ", ".join(f"{name} = {x:.6g}" for name, x in [*self.values.items()][:NAMED])
        more = ", ..." * (len(self.values) > NAMED)
        return f"run {self.run}{f' ({values}{more})' * bool(values)} ended at t = {self.t:.6g} s: {self.message}"


class Ensemble(Result):
    """The results of many runs, from :meth:`~...module.Module.simulate_many`.

    ``ens["theta"]`` is the column (k,) at the end of the runs, or (m, k) at the times ``t_eval``: coordinates,
    velocities and outputs.  Runs that failed hold NaN; ``reached`` has the states they came to.

    Attributes
    ----------
    count : int
        Number of runs, k.
    x, reached : (n_x, k) array or None
        Last states, projected onto the constraints; None where a reduction kept none.
    samples : (n_x, m, k) array or None
        States at ``t``.
    t : (m,) array
        Times asked for; the end of the span where none were.
    t_end : (k,) array
        How far each run came (s).
    status : (k,) int array
        0 where the end was reached; ``failures`` says more.
    steps, rejected, evaluations : (k,) int arrays
    event_names : tuple of str
    event_counts : (k,) int array
        Events of each run, all kinds together.
    reduced : dict
        What a reduction kept: ``count``, ``mean``, ``variance``, ``least``, ``greatest`` (n_x + n_y, m) of the
        statistics, in the order of ``names``; lists of arrays, one a block, of a function.
    names : tuple of str
        Names of states and outputs.
    grid : dict of str to array
        Values of each name of a grid, of which there was a run for every combination, the last name fastest; else
        empty.
    """

    def __init__(
        self, runs: Runs, numbers: dict[str, Any], kept: dict[str, Any], messages: dict[int, str], reduction: Reduction
    ) -> None:
        self._runs, self._messages = runs, messages
        self._module, self._variations, self._plan = runs.module, runs.varied, runs.plan
        self.count, self.names, plan = runs.count, runs.names, runs.plan
        self.grid: dict[str, Array] = {}
        self.t = np.array([plan.span[1]]) if plan.t_eval is None else plan.t_eval
        self.t_end, self.status = numbers["t"], numbers["status"]
        self.steps, self.rejected, self.evaluations = numbers["steps"], numbers["rejected"], numbers["evaluations"]
        self.event_names, self.event_counts = tuple(runs.events.names), numbers["noted"]
        self._failure, self._failure_time = numbers["failure"], numbers["failure_time"]
        self._statistics = isinstance(reduction, Statistics)
        self.reduced = kept if isinstance(reduction, Statistics | Custom) else {}
        result = {} if self.reduced else kept
        self.reached, self.samples, self._notes = result.get("x"), result.get("samples"), result.get("notes")
        self.x = None if self.reached is None else np.where(self.ok, self.reached, np.nan)

    @property
    def ok(self) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """(k,) which runs reached the end, or an event that ends them."""
        return np.asarray((self.status == 0) | (self.status == EVENT))

    def failures(self) -> list[Failure]:
        """The runs that did not reach the end, with what stopped them."""
        varied = self.varied()
        return [self._describe(int(k), varied) for k in np.flatnonzero(~self.ok)]

    def _describe(self, k: int, varied: dict[str, Array]) -> Failure:
        status, code = int(self.status[k]), int(self._failure[k])
        message = self._messages.get(k) or MEANING.get(status, f"status {status}")
        if code and k not in self._messages:
            from ..failure import WORDS

            reason = WORDS.get(code, (f"status {code}",))[0]
            message += f"; last failure near t = {self._failure_time[k]:.6g} s: {reason}"
        return Failure(k, status, float(self.t_end[k]), message, {name: float(row[k]) for name, row in varied.items()})

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, name: str) -> Array:
        name = self._module.layout.plain(name)
        if name not in self.names:
            raise unknown("column", name, self.names)
        row = self.names.index(name)
        if self._statistics:
            return np.asarray(self.reduced["mean"][row])
        if self.x is None:
            raise cannot(f"{self._kept_only}, not {name!r}; run it with reduce='states'")
        states = self.x[:, None] if self.samples is None else self.samples
        if row < len(self.x):
            result = states[row]
        elif self.samples is None:
            result = self._runs.with_outputs(self.x, self.t_end)[None, row]
        else:
            times = np.repeat(self.t[:, None], self.count, axis=1)
            result = np.stack([self._runs.with_outputs(states[:, j], t)[row] for j, t in enumerate(times)])
        return np.asarray(result[0] if self.samples is None else result)

    @property
    def _kept_only(self) -> str:
        return f"this ensemble kept only the results of its reduction ({', '.join(self.reduced)})"

    def events(self, name: str) -> tuple[Array, Array]:
        """Times (m, k) of an event in each run, and the projected states (n_x, m, k) there; NaN where it was not."""
        name = self._module.layout.plain(name)
        if name not in self.event_names:
            raise unknown("event", name, self.event_names)
        if self._notes is None:
            raise cannot("this ensemble kept no events; give reduce='states' or 'events'")
        mine = self._notes[0] == self.event_names.index(name)
        most = int(mine.sum(axis=0).max(initial=0))
        order = np.argsort(~mine, axis=0, kind="stable")[:most]
        result = np.take_along_axis(np.where(mine, self._notes[1:], np.nan), order[None], axis=1)
        return result[0], result[1:]

    def summary(self) -> dict[str, dict[str, float]]:
        """Mean, deviation, least and greatest of every state and output at the end, over the runs that got there."""
        if self._statistics:
            rows = [self.reduced[key][:, -1] for key in ("mean", "variance", "least", "greatest")]
        elif self.x is None:
            raise cannot("this ensemble kept no states to summarise; run it with reduce='states' or 'statistics'")
        else:
            parts = summarise(self._runs.with_outputs(self.x, self.t_end))
            spread = parts["squares"] / np.maximum(parts["count"] - 1.0, 1.0)
            rows = [parts["mean"], spread, parts["least"], parts["greatest"]]
        keys = ("mean", "deviation", "least", "greatest")
        values = np.array([rows[0], np.sqrt(rows[1]), *rows[2:]]).T.tolist()
        return {name: dict(zip(keys, row, strict=True)) for name, row in zip(self.names, values, strict=True)}

    def case(self, k: int) -> dict[str, Any]:
        """The arguments that make ``Module.simulate`` repeat run k: initial, parameters, inputs, events."""
        if not -self.count <= k < self.count:
            raise off_range(f"there are runs 0 to {self.count - 1}, not {k}")
        varied, column = self._variations, self._variations.column(k)
        if varied.states is not None:
            initial: Any = varied.states[:, k]
        else:
            initial = {name: float(x[k] if np.ndim(x) else x) for name, x in varied.values.items()} or None
        declared = set(self._module.layout.signals)
        constants = dict(zip(self._module.u_names, column["u"].tolist(), strict=True))
        rates = self._module.layout.input_rates
        declared |= {rate for name in self._plan.inputs for rate, _ in rates.get(name, ())}
        declared -= set(self._plan.constants)
        inputs = {name: value for name, value in constants.items() if name not in declared} | self._plan.inputs
        watched = {} if self._plan.events is None else {"events": self._plan.events}
        return {"initial": initial, "parameters": column["p"], "inputs": inputs, **watched}

    def trajectory(self, k: int, **options: Any) -> Trajectory:
        """Run case k again and keep all its steps; options as for ``Module.simulate``."""
        plan = self._plan
        settings = {"method": plan.method, **plan.options, **options}
        return simulate(self._module, plan.span, **self.case(k), **settings)

    def to_pandas(self, samples: bool = False) -> pandas.DataFrame:
        """A table of the runs: what varies between them, and the columns at the end or at all kept times.

        Parameters
        ----------
        samples : bool
            A row for each run and time of ``t_eval``, with the columns ``run`` and ``t``, instead of a row for each
            run at its end.

        Returns
        -------
        pandas.DataFrame
            Initial values that vary are called ``initial_theta``; parameters, inputs and columns have their own names.

        Raises
        ------
        UsageError
            ``samples`` of an ensemble that kept none: it had no ``t_eval``, or a reduction.
        """
        pd = require("pandas", "pandas", "to_pandas")
        columns: dict[str, Any] = {"status": self.status, "t_end": self.t_end, "steps": self.steps} | self.varied()
        if samples:
            if self.samples is None:
                raise cannot("this ensemble kept no samples; give t_eval (on the command line --samples)")
            times = len(self.t)
            columns = {"run": np.arange(self.count), **columns}
            columns = {name: np.repeat(row, times) for name, row in columns.items()}
            columns |= {"t": np.tile(self.t, self.count)}
            columns |= {name: np.asarray(self[name]).T.ravel() for name in self.names}
        elif self.x is not None:
            end = self._runs.with_outputs(self.x, self.t_end)
            columns |= dict(zip(self.names, end, strict=True))
        return pd.DataFrame(columns)

    def to_xarray(self) -> xarray.Dataset:
        """The runs as one Dataset: dimensions ``run``, or those of the grid, and ``t`` where times were kept.

        Columns are variables; parameters, inputs and initial values that vary are coordinates of the runs, initial
        values as ``initial_theta``.  Statistics are over ``statistic`` and ``t``; a variance has the squared unit.

        Raises
        ------
        UsageError
            A reduction kept neither states nor statistics.
        MissingDependencyError
            xarray is not installed.
        """
        xr = require("xarray", "xarray", "to_xarray")
        variables, coordinates = self._statistics_to_xarray() if self._statistics else self._runs_to_xarray()
        coordinates["t"] = ("t", self.t, {"units": "s", "long_name": "time"})
        metadata = self.metadata
        messages = {"model": metadata["name"], "metadata": json.dumps(metadata)}
        made: xarray.Dataset = xr.Dataset(variables, coordinates, messages)
        return made

    def _attributes(self, name: str) -> dict[str, str]:
        return attributes(name, {name: self.unit(name)}, self._module.metadata)

    def _statistics_to_xarray(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """Variables over statistics and times."""
        label = free("statistic", set(self.names))
        variables = {}
        for row, name in enumerate(self.names):
            values = np.array([self.reduced[key][row] for key in STATISTICS], dtype=float)
            variables[name] = ((label, "t"), values, self._attributes(name))
        return variables, {label: (label, list(STATISTICS))}

    def _runs_to_xarray(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """Variables over the runs, and times where some were kept; coordinates of the runs."""
        if self.x is None:
            raise cannot(f"{self._kept_only}; run it with reduce='states' or 'statistics'")
        varied = self.varied()
        # an initial value of the grid is called as in `varied`, so that it does not hide the column of its name
        own = {*self._module.p_names, *self._module.u_names}
        labels = {name: name if name in own else f"initial_{name}" for name in self.grid}
        run = free("run", {*self.names, *varied})
        dimensions = tuple(labels.values()) or (run,)
        shape = tuple(map(len, self.grid.values())) or (self.count,)
        coordinates: dict[str, Any] = {
            labels[name]: (labels[name], values, self._attributes(name)) for name, values in self.grid.items()
        } or {run: (run, np.arange(self.count), {"long_name": "number of the run"})}
        for name, row in varied.items():
            messages = self._attributes(name.removeprefix("initial_"))
            coordinates.setdefault(name, (dimensions, row.reshape(shape), messages))
        variables: dict[str, Any] = {}
        for name in self.names:
            values = np.asarray(self[name])
            if self.samples is None:
                variables[name] = (dimensions, values.reshape(shape), self._attributes(name))
            else:
                variables[name] = ((*dimensions, "t"), values.T.reshape(*shape, len(self.t)), self._attributes(name))
        for name, what in COLUMNS_DOC.items():
            variable = free(name, {*variables, *coordinates})
            variables[variable] = (dimensions, getattr(self, name).reshape(shape), {"long_name": what})
        return variables, coordinates

    def varied(self) -> dict[str, Array]:
        """The parameters, inputs and initial values (k,) that differ between the runs."""
        varied, module = self._variations, self._module
        result: dict[str, Array] = {}
        for names, rows in ((module.p_names, varied.p), (module.u_names, varied.u)):
            result |= dict(zip(names, rows, strict=True)) if rows.ndim > 1 else {}
        starts = varied.values if varied.states is None else dict(zip(module.x_names, varied.states, strict=True))
        result |= {f"initial_{name}": np.asarray(row) for name, row in starts.items() if np.ndim(row)}
        return {name: row for name, row in result.items() if row.size and np.ptp(row)}

    @property
    def metadata(self) -> dict[str, Any]:
        """Metadata of all runs, as in a trajectory's ``metadata``; ``values`` is a digest of what differs."""
        plan, varied = self._plan, self._variations
        rows = varied.p if varied.p.ndim > 1 else varied.p[:, None]
        shared = zip(self._module.p_names, rows, strict=True)
        return {
            "name": self._module.name,
            "model_method": self._module.info.method,
            "origin": origin(self._module),
            "count": self.count,
            "span": list(plan.span),
            "method": plan.method,
            "options": {name: plain(value) for name, value in plan.options.items()},
            "inputs": {name: spell_input(value) for name, value in self._runs.forcing.values.items()},
            "parameters": {name: float(row[0]) for name, row in shared if row.size and np.ptp(row) == 0.0},
            "values": varied.digest(),
        }

    def save(self, path: str | Path) -> Path:
        """Write the arrays to an .npz file that NumPy alone reads; ``header`` in it is ``metadata`` as JSON."""
        target = table_path(path, "an ensemble (for tables see to_pandas().to_csv) is", (".npz",))
        arrays: dict[str, Any] = {
            name: np.asarray(value) for name, value in self.reduced.items() if not isinstance(value, list)
        }
        for name in ("x", "samples"):
            if getattr(self, name) is not None:
                arrays[name] = getattr(self, name)
        runs = {name: getattr(self, name) for name in ("t", "t_end", "status", "steps", "rejected", "evaluations")}
        header = np.array(json.dumps(self.metadata))
        with whole_file(target) as file:
            np.savez_compressed(file, names=np.array(self.names), header=header, **runs, **arrays)
        return target

    def plot(self, name: str, ax: Axes | None = None, limit: int = 200) -> Axes:
        """Lines of a column over time, mean and spread for statistics, a histogram where there are last states only.

        Parameters
        ----------
        name : str
        ax : matplotlib Axes, optional
        limit : int
            Draw at most this number of runs, evenly chosen.
        """
        values, limit = self[name], read_count("limit, of the runs drawn,", limit, 1)
        if ax is None:
            plt: Any = require("matplotlib.pyplot", "matplotlib", "plot")
            ax = plt.subplots(figsize=(7, 4), layout="constrained")[1]
        assert ax is not None
        printed = label(printed_names(self._module.metadata)(name), self.unit(name))
        if not self._statistics and values.ndim == 1:
            ax.hist(values[np.isfinite(values)], bins="auto")
            ax.set_xlabel(f"{printed} at $t$ = {self.t[0]:.6g} s")
            ax.set_ylabel("runs")
            return ax
        if self._statistics:
            row = self.names.index(self._module.layout.plain(name))
            spread = np.sqrt(self.reduced["variance"][row])
            ax.fill_between(self.t, values - spread, values + spread, alpha=0.3, label="mean ± deviation")
            ax.plot(self.t, values, label="mean")
            ax.plot(self.t, self.reduced["least"][row], "k:", lw=0.8, label="least, greatest")
            ax.plot(self.t, self.reduced["greatest"][row], "k:", lw=0.8)
            ax.legend(frameon=False)
        else:
            chosen = np.unique(np.linspace(0, self.count - 1, min(limit, self.count)).astype(int))
            ax.plot(self.t, values[:, chosen], color="C0", lw=0.8, alpha=max(0.08, min(1.0, 10 / len(chosen))))
        ax.set_xlabel(TIME)
        ax.set_ylabel(printed)
        return ax

    def _figure(self) -> Any:
        names = self.names[:PANELS]
        figure = require("matplotlib.figure", "matplotlib", "a picture").Figure
        made = figure(figsize=(5.6, 0.6 + 1.7 * len(names)), layout="constrained")
        for k, name in enumerate(names):
            self.plot(name, made.add_subplot(len(names), 1, k + 1))
        return made

    def unit(self, name: str) -> str:
        """The unit of a column."""
        return self._module.layout.unit(name)

    def to_dict(self) -> dict[str, Any]:
        """Sizes, failures and the summary, as ``--json`` prints them."""
        facts = {"count": self.count, "steps": int(self.steps.sum()), "failures": self.failures()}
        made: dict[str, Any] = plain_values(facts | {"summary": self.summary()})
        return made

    @property
    def title(self) -> str:
        return f"Ensemble of {self._module.name}"

    @property
    def facts(self) -> list[tuple[str, str]]:
        failed = self.failures()
        facts = [("runs", f"{self.count}" + (f", {len(failed)} of which failed" if failed else ""))]
        facts += [("times", f"{len(self.t)}"), ("end", f"{self.t[-1]:.6g} s")]
        return facts + [("failed", str(one)) for one in failed[:FAILURES]]

    @property
    def tables(self) -> list[ResultTable]:
        """Mean, deviation, least and greatest of every column at the end."""
        rows = [[name, *values.values()] for name, values in self.summary().items()]
        return [ResultTable(["at the end", "mean", "deviation", "least", "greatest"], rows)]

    def __repr__(self) -> str:
        failed = int((~self.ok).sum())
        lost = f", {failed} failed" if failed else ""
        return f"<{self.title}: {self.count} runs to t = {self._plan.span[1]:.6g} s{lost}>"

    def _repr_html_(self) -> str:
        text = html_table(self.title, self.facts)
        try:
            (table,) = self.tables
        except UsageError:  # a reduction of the user's own kept something else
            return text
        text += table._replace(rows=table.rows[:ROWS]).to_html(digits=5)
        if len(table.rows) > ROWS:
            text += f"<p>and {len(table.rows) - ROWS} more: summary()</p>"
        return side_by_side(picture_html(self._figure), text)
