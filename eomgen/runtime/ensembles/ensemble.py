"""Module, many initial values, parameters and inputs -> Ensemble, what the runs came to; its picture and Dataset."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ...base.algebra import Array
from ...base.files import whole_file
from ...base.results import Result, ResultTable, picture_html, side_by_side
from ...base.results import plain as plain_values
from ...base.texts import TIME, html_table, label
from ...base.value_rules import read_count
from ...errors import UsageError, bad_data, cannot, ill_typed, no_choice, off_range, untrue
from ..argument_checks import check_names, require, require_size, unknown, without_dots
from ..identity import code_digest, digest, origin, plain, spell_input
from ..inputs import Forcing, Signal, fill_rates, rate_pairs
from ..kernels import CAUSES, place
from ..plotting import printed_names
from ..refusals import refuse_moreau, require_support
from ..runs.bound_run import Progress, wanted
from ..runs.events import require_forward
from ..runs.run_arguments import STEPS, can_run, declare, declared_step, find_span, ordered_times, steps_of
from ..runs.simulate import simulate
from ..storage import attributes, free, table_path
from ..trajectory import Span
from .block import (
    BAD_PARAMETERS,
    EVENT,
    GRAIN,
    LOST,
    MEANING,
    RUNS,
    UNASSEMBLED,
    Custom,
    Kept,
    Plan,
    Reduction,
    Runs,
    Statistics,
    Store,
    choose_reduction,
    choose_size,
    keep,
    run_block,
    split,
    stored_length,
    summarize,
)
from .variations import collect_variations, grid_axes, spread_grid

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes

    from ..bound_model import BoundModel
    from ..layout import Layout
    from ..protocols import Number, StepOptions
    from ..trajectory import Trajectory


PANELS = 3  #: columns that a notebook draws
ROWS = 12  #: columns whose numbers it lists
FAILURES = 5  #: runs that it names
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
        values = place([*self.values], np.array([*self.values.values()])).removeprefix(", ")
        how = "did not begin" if self.status in (BAD_PARAMETERS, UNASSEMBLED) else f"ended at t = {self.t:.6g} s"
        return f"run {self.run}{f' ({values})' * bool(values)} {how}: {self.message}"


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
        Times requested; the end of the span where none were.
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
            reason = CAUSES.get(code, (f"status {code}",))[0]
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
            raise cannot("this ensemble kept no states to summarize; run it with reduce='states' or 'statistics'")
        else:
            parts = summarize(self._runs.with_outputs(self.x, self.t_end))
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
        names = {*self._module.p_names, *self._module.u_names}
        labels = {name: name if name in names else f"initial_{name}" for name in self.grid}
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


# -- the call ----------------------------------------------------------------------------------------------------------


STORED = 64  #: blocks at least that a store keeps of a large ensemble
WIDEST = 8  #: runs side by side in one thread, at most


def simulate_many(
    module: BoundModel,
    /,
    span: Span = None,
    initial: Mapping[str, Any] | ArrayLike | None = None,
    parameters: Mapping[str, Any] | ArrayLike | None = None,
    inputs: Mapping[str, Any] | ArrayLike | None = None,
    *,
    grid: Mapping[str, Any] | None = None,
    count: int | None = None,
    method: str | None = None,
    t_eval: ArrayLike | None = None,
    events: Any = None,
    keep_events: int = 16,
    reduce: Any = None,
    threads: int | None = None,
    cluster: Any = None,
    store: str | Path | None = None,
    block: int | None = None,
    max_steps: int = 1_000_000,
    step: Number | None = None,
    progress: bool | None = None,
    **options: Unpack[StepOptions],
) -> Ensemble:
    """Integrate the equations of motion for many initial values, parameters and inputs.

    Every run has steps of its own.  The results do not depend, to the last bit, on how threads, workers and blocks are
    chosen; they agree with ``simulate`` within the tolerance.  A run that fails is marked, and the others go on.

    Parameters
    ----------
    span : (float, float) or float, optional
        As for ``simulate``.
    initial : mapping of str to float or (k,) array, or (n_x,) or (n_x, k) array, optional
        Named values, held exactly, or states, a column each, which are projected onto the constraints.
    parameters, inputs : mapping of str to float or (k,) array, or (n,) or (n, k) array, optional
        An input may also vary over time, the same for all runs: a table (times, values), a Signal, or an expression as
        text; (k,) inputs are constant.
    grid : mapping of str to list or (low, high, count), optional
        Values of parameters, inputs, coordinates and rates: a run for every combination, the last name fastest.
    count : int, optional
        Number of runs, needed if no array gives it.
    method : str, optional
        DOP853, RK45, RK4, Radau and Taylor run in compiled code; other methods of ``simulate`` one run after the other.
    t_eval : (m,) array, optional
        Times to store; the end alone by default.
    events : str, list of str, or mapping of names to expressions, optional
        As for ``simulate``, without functions; those of the model by default.
    keep_events : int
        Number of events to keep of each run, the first ones.
    reduce : {'states', 'statistics', 'events'} or callable, optional
        What to keep: every run's last state, its states at t_eval and its events (default); its events alone; or count,
        mean, variance, least and greatest of states and outputs over the runs; or what ``reduce(block)`` returns for
        each :class:`~.block.RunBlock`, a mapping of names to arrays.  Only what is kept takes memory.
    threads : int, optional
        Runs at a time; all processors by default.
    cluster : True, int, str or dask Client, optional
        Run on the workers of dask.distributed: a local cluster, with so many workers; the address of a scheduler; a
        client.  A worker loads the module's code if its file is there, and else builds it.
    store : str or Path, optional
        Folder that keeps finished blocks: the same call again goes on where it stopped.
    block : int, optional
        Runs handled together; chosen by default.
    max_steps : int
        Give up a run that takes more.
    step : float, optional
        Size of the steps of RK4 (s), and only of it.
    progress : bool, optional
        Show progress on stderr; by default for long runs on a terminal.
    **options
        rtol, atol, max_step, first_step; defaults as for ``simulate``.

    Returns
    -------
    Ensemble

    Raises
    ------
    UsageError
        Unknown names, wrong shapes, lengths that differ; a store of another ensemble.
    MissingDependencyError
        dask.distributed is not installed.
    """
    require_support(module.layout, "simulate_many")
    check_names("option of simulate_many", options, STEPS)
    if grid is not None:
        initial, parameters, inputs = spread_grid(module, grid, (initial, parameters, inputs))
    tables, constants = _separate(module.layout, inputs)
    varied = collect_variations(module, initial, parameters, constants, count)
    reduction = choose_reduction(reduce)
    named = tuple(constants) if isinstance(constants, Mapping) else () if constants is None else module.u_names
    plan = _plan(module, span, method, t_eval, tables, named, max_steps, step, {**options}, (events, keep_events))
    runs = Runs(module, varied, plan)
    threads = (os.cpu_count() or 1) if threads is None else read_count("threads", threads, 1)
    watch = Progress(0.0, float(varied.count), 0.0 if progress else 2.0, "{:.0f} runs") if wanted(progress) else None
    each = module.n_x * (1 if plan.t_eval is None else len(plan.t_eval))
    watched = bool(runs.events.names)
    each += plan.keep_events * (2 + module.n_x) if watched else 0
    whole = varied.count * (len(RUNS) + 2 * module.n_x) + each * (
        varied.count if reduce in (None, "states", "events") else 1
    )
    fewer = "give fewer runs, fewer t_eval, fewer keep_events, or reduce='statistics'"
    require_size(f"simulate_many with {varied.count} runs", whole, fewer)
    with ExitStack() as stack:
        if watch is not None:
            stack.callback(watch.close)
        client = workers = None
        if cluster is not None and cluster is not False:
            from .cluster import count_workers, open_client

            client = stack.enter_context(open_client(cluster))
            workers = count_workers(client)
        length = choose_size(varied.count, 8 * each, workers or 1) if block is None else read_count("block", block, 1)
        if store is not None and block is None:
            lanes = 1 if watched else WIDEST
            length = stored_length(store) or min(length, max(lanes * threads, -(-varied.count // STORED)))
        if reduce == "statistics":  # whole grains, so that rounding does not depend on blocks
            length = -(-length // GRAIN) * GRAIN
        parts = split(varied.count, length)
        store_of = None if store is None else _open_store(store, runs, reduce, parts)
        kept: dict[int, Kept] = {}
        if store_of is not None:
            result = {index: store_of.load(index) for index in range(len(parts))}
            kept = {index: value for index, value in result.items() if value is not None}
        missing = [index for index in range(len(parts)) if index not in kept]
        look = None if watch is None else watch.look
        for index, value in _run(runs, reduction, parts, missing, threads, client, look):
            kept[index] = value
            if store_of is not None and not (value[0]["runs_status"] == LOST).any():
                store_of.save(index, *value)
    try:
        ensemble = _gather(runs, reduction, parts, kept)
        ensemble.grid = {} if grid is None else grid_axes(without_dots(grid, module.layout.instances))
        return ensemble
    except (KeyError, ValueError, TypeError, IndexError) as error:
        if store_of is None:
            raise
        raise bad_data(f"the blocks in store {store} do not belong together: {error}; name another folder") from error


def _run(
    runs: Runs, reduction: Reduction, parts: list[tuple[int, int]], missing: list[int], threads: int, client: Any,
    watch: Callable[[float], None] | None,
) -> Iterator[tuple[int, Kept]]:  # fmt: skip
    """The missing blocks: one after the other, each on all threads, or on the workers of a cluster."""
    if client is not None:
        from .cluster import run_on_workers

        yield from run_on_workers(client, runs, reduction, parts, missing, watch)
        return
    before = 0
    for index in missing:
        start, stop = parts[index]
        look = None if watch is None else lambda done, before=before: watch(before + done)
        part = runs.part(start, stop)
        yield index, keep(part, reduction, run_block(part, threads, look))
        before += stop - start


def _gather(runs: Runs, reduction: Reduction, parts: list[tuple[int, int]], kept: dict[int, Kept]) -> Ensemble:
    ordered = [kept[index] for index in range(len(parts))]
    numbers = {name: np.concatenate([arrays[f"runs_{name}"] for arrays, _ in ordered]) for name in RUNS}
    made = [{name: x for name, x in arrays.items() if not name.startswith("runs_")} for arrays, _ in ordered]
    messages = {
        start + k: text for (start, _), (_, texts) in zip(parts, ordered, strict=True) for k, text in texts.items()
    }
    return Ensemble(runs, numbers, reduction.join(made), messages, reduction)


def _plan(
    module: BoundModel, span: Any, method: Any, t_eval: Any, tables: dict[str, Any],
    constants: tuple[str, ...], max_steps: int, step: Number | None, options: dict[str, Any], watched: tuple[Any, int],
) -> Plan:  # fmt: skip
    declared = declare(module)
    start, end = find_span(span, float(declared["end"]))
    require_forward(module, start, end)
    method, step = declared_step(module, declared["method"] if method is None else method, step)
    refuse_moreau(method, "simulate_many")
    if not isinstance(method, str):
        raise no_choice(f"method of simulate_many must be the name of a method, not {method!r}")
    forcing = Forcing(module.layout, tables)
    forcing.require_finite()
    can_run(module, method, forcing)  # refuses what no other method stands in for
    chosen = steps_of(module, (start, end), method, step, options)
    times = None if t_eval is None else ordered_times(t_eval, start, end, module.n_x)
    most, kept = read_count("max_steps", max_steps, 1), read_count("keep_events", watched[1], 1)
    return Plan((start, end), method, chosen, most, times, tables, watched[0], kept, constants)


def _separate(layout: Layout, inputs: Any) -> tuple[dict[str, Any], Any]:
    """Inputs that are tables over time, and the others with their rates, which are 0."""
    if not isinstance(inputs, Mapping):
        return {}, inputs
    tables = {
        name: x for name, x in inputs.items()
        if isinstance(x, (Signal, str)) or (isinstance(x, (tuple, list)) and len(x) == 2 and np.ndim(x[0]) == 1)
    }  # fmt: skip
    for name, value in inputs.items():
        if callable(value) and name not in tables:
            raise ill_typed(
                f"input {name} of simulate_many must be a number, (k,) numbers or a table (times, values), "
                "a Signal or an expression as text, not a function"
            )
    only = {name for name in layout.input_rates if name not in layout.u}
    rest = {name: x for name, x in inputs.items() if name not in tables}
    still = fill_rates(layout, inputs, lambda name, rate, value: 0.0)
    for name, rate in rate_pairs(layout):
        if name in rest and rate in rest and np.any(np.asarray(rest[rate], dtype=float) != 0.0):
            raise untrue(f"input {rate} is not the rate of {name}, which is a number in each run; give {rate} as 0")
    fixed = {rate: 0.0 for rate, (name, _, _) in still.items() if name in rest}
    return tables, {**{name: x for name, x in rest.items() if name not in only}, **fixed} or None


def _open_store(folder: str | Path, runs: Runs, reduce: Any, parts: list[tuple[int, int]]) -> Store:
    """The store of an ensemble, whose identity is all that its results depend on."""
    module, varied, plan = runs.module, runs.varied, runs.plan

    def _plain(x: Any) -> Any:
        if isinstance(x, Signal):
            return [x.interpolation, x.corners, x.times.tolist(), x.values.tolist()]
        return x if isinstance(x, str) else np.asarray(x).tolist()

    identity = {
        "model": module.name, "model_digest": module.info.model_digest, "code": code_digest(module),
        "runs": varied.count, "values": varied.digest(), "span": list(plan.span),
        "method": plan.method, "options": {name: np.asarray(x).tolist() for name, x in plan.options.items()},
        "max_steps": plan.max_steps, "t_eval": None if plan.t_eval is None else plan.t_eval.tolist(),
        "inputs": {name: _plain(x) for name, x in plan.inputs.items()}, "events": plan.events,
        "keep_events": plan.keep_events, "constants": list(plan.constants),
        "reduce": digest(reduce) if callable(reduce) else str(reduce or "states"),
        "block": parts[0][1],
    }  # fmt: skip
    return Store(folder, identity)
