"""Module, many initial values, parameters and inputs -> Ensemble."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ...base.value_rules import read_count
from ...errors import bad_data, ill_typed, no_choice, untrue
from ..argument_checks import check_names, require_size, without_dots
from ..identity import code_digest, digest
from ..inputs import Forcing, Signal, fill_rates, rate_pairs
from ..refusals import refuse_moreau, require_support
from ..runs.bound_run import Progress, wanted
from ..runs.compiled import can_run
from ..runs.events import require_forward
from ..runs.run_arguments import declare, declared_step, find_span, ordered_times, steps_of
from ..trajectory import Span
from .block import (
    GRAIN,
    LOST,
    RUNS,
    Kept,
    Plan,
    Reduction,
    Runs,
    Store,
    choose_reduction,
    choose_size,
    keep,
    run_block,
    split,
    stored_length,
)
from .ensemble import Ensemble
from .variations import collect_variations, grid_axes, spread_grid

if TYPE_CHECKING:
    from ..bound_model import BoundModel
    from ..layout import Layout
    from ..protocols import Number, StepOptions

STORED = 64  #: blocks at least that a store keeps of a large ensemble
WIDEST = 8  #: runs side by side in one thread, at most
OPTIONS = ("rtol", "atol", "max_step", "first_step")


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
    check_names("option of simulate_many", options, OPTIONS)
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
    held = {rate: 0.0 for rate, (name, _, _) in still.items() if name in rest}
    return tables, {**{name: x for name, x in rest.items() if name not in only}, **held} or None


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
