"""A block of runs -> RunBlock, what became of them, and what is kept of it: states, samples, statistics, files.

Blocks run in compiled code on threads, or one by one in Python.
"""

from __future__ import annotations

import functools
import io
import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.algebra import Array, Indices
from ...base.files import as_path, open_plain, remove_parts, write_whole
from ...base.texts import quote
from ...errors import EomgenError, MissingDependencyError, UsageError, bad_data, bad_file, cannot, ill_typed, no_choice
from ..inputs import Forcing
from ..kernels import eager
from ..runs.events import WAIT, Events
from ..runs.integrate import MESSAGES, RESET_FAILED, STOPPED, TERMINAL, TOO_SMALL, ZENO
from ..runs.run_arguments import stepper_options
from ..runs.simulate import simulate
from ..storage import BROKEN, read_arrays, sealed
from .variations import Variations, assemble_states

if TYPE_CHECKING:
    from ..bound_model import BoundModel

Integers = np.ndarray[Any, np.dtype[Any]]

TOO_SMALL_STEP, TOO_MANY_STEPS, BAD_PARAMETERS, UNASSEMBLED, FAILED, LOST = -100, -104, -110, -111, -112, -113
EVENT = 1  #: SciPy's
#: What a status means; 0 is the end of the span.
MEANING = {
    0: "the end was reached",
    EVENT: MESSAGES[TERMINAL],
    STOPPED: "not run: the ensemble was interrupted",
    TOO_SMALL_STEP: TOO_SMALL,
    TOO_MANY_STEPS: "more than max_steps steps",
    BAD_PARAMETERS: "the constants that follow from the parameters cannot be computed",
    UNASSEMBLED: "the initial values cannot be assembled",
    FAILED: "the integration failed",
    ZENO: "events that reset the state follow each other faster and faster (Zeno), or a reset repeats without an end",
    RESET_FAILED: MESSAGES[RESET_FAILED],
    LOST: "the worker that ran it failed",
}
EVERY = 0.05  #: seconds between looks at threads at work
COUNTS = ("steps", "rejected", "evaluations", "noted")


@dataclass(frozen=True)
class Plan:
    """What all runs have in common."""

    span: tuple[float, float]
    method: str
    options: dict[str, Any]  #: rtol, atol, max_step, first_step, as steppers take them
    max_steps: int
    t_eval: Array | None  #: (m,)
    inputs: dict[str, Any]  #: inputs that vary over time: name -> (times, values), Signal or expression
    events: Any  #: as a user gives them, without functions
    keep_events: int  #: of each run
    constants: tuple[str, ...] = ()  #: inputs given as constants, in place of signals that the model may declare


@dataclass(frozen=True)
class Runs:
    """Many runs of a module: what differs between them, and what they have in common."""

    module: BoundModel
    varied: Variations
    plan: Plan

    @property
    def count(self) -> int:
        """How many there are."""
        return self.varied.count

    def part(self, start: int, stop: int) -> Runs:
        """The runs from `start` to before `stop`."""
        return replace(self, varied=self.varied.part(start, stop))

    @property
    def events(self) -> Events:
        """The events that are watched."""
        events = Events(self.module.layout, self.plan.events)
        for event in (*events.functions, *(event for event in events.model if event.action == WAIT)):
            what = "is an impact" if event.action == WAIT else "is a function"
            raise cannot(
                f"event {event.name} of simulate_many {what}, which needs Python; "
                "give an expression as text, a reset, or run simulate for each case"
            )
        return events

    @property
    def forcing(self) -> Forcing:
        """The inputs of all runs; those that are constant count as 0 here."""
        forcing = Forcing(self.module.layout, {**dict.fromkeys(self.plan.constants, 0.0), **self.plan.inputs})
        forcing.unsettled = frozenset(self.plan.constants)
        return forcing

    def forcing_of(self, k: int) -> Forcing:
        """The inputs of run k."""
        forcing, bound = self.forcing, self.module
        with suppress(UsageError):  # where these parameters cannot be bound, the run does not begin
            bound = bound.bind(**self.varied.column(k))
        forcing.attach(bound)
        forcing.unsettled = frozenset()
        forcing.begin(*self.plan.span)
        return forcing

    def inputs_at(self, t: Array, x: Array) -> Array:
        """Inputs (n_u, k) of every run at times (k,) and states (n_x, k)."""
        varied, forcing = self.varied, self.forcing
        u = np.array(
            np.broadcast_to(varied.u if varied.u.ndim > 1 else varied.u[:, None], (len(varied.u), varied.count))
        )
        for i, signal in forcing.varying.items():
            u[i] = signal(t, x)  # type: ignore[arg-type]
        for i, formula in forcing.formulas.items():
            for k in range(varied.count):
                u[i, k] = formula.function(varied.column(k)["p"])(float(t[k]), x[:, k])
        return u

    @property
    def names(self) -> tuple[str, ...]:
        """States, then the outputs that do not repeat a coordinate."""
        module = self.module
        return (*module.x_names, *(name for name in module.y_names if name not in module.x_names))

    def with_outputs(self, x: Array, t: Array) -> Array:
        """States (n_x, k) at times (k,) with their outputs, as ``names`` has them; NaN where one has no value."""
        module, varied = self.module, self.varied
        further = [i for i, name in enumerate(module.y_names) if name not in module.x_names]
        good = np.flatnonzero(np.isfinite(x).all(axis=0))
        y = np.full((module.n_y, x.shape[1]), np.nan)
        if further and good.size:
            outputs, u = module.kernels.kernel("outputs", nan=True), self.inputs_at(t, x)
            y[:, good] = outputs(t[good], x[:, good], p=varied.column(good).get("p"), u=u[:, good])
        return np.concatenate([x, y[further]]) if further else x


@dataclass(frozen=True)
class RunBlock:
    """What became of the runs of a block.

    Attributes
    ----------
    x : (n_x, k) array
        Last states, projected; NaN where a run was not begun.
    t : (k,) array
        Their times.
    samples : (n_x, m, k) array or None
        Projected states at the times requested; NaN where a run did not get to.
    status : (k,) int array
        See ``MEANING``; a failed evaluation's code is in `failure`.
    failure, failure_time, steps, rejected, evaluations : (k,) arrays
    noted : (k,) int array
        Number of events.
    notes : (2 + n_x, m, k) array or None
        Number, time and state of the first m events of each run; NaN where there were fewer.
    texts : dict of int to str
        What more there is to say about a run.
    """

    x: Array
    t: Array
    samples: Array | None
    status: Integers
    failure: Integers
    failure_time: Array
    steps: Integers
    rejected: Integers
    evaluations: Integers
    noted: Integers
    notes: Array | None = None
    texts: dict[int, str] = field(default_factory=dict)

    @classmethod
    def blank(cls, runs: Runs, count: int, status: int = 0) -> RunBlock:
        """So many of the runs, none of which has begun."""
        n, plan = runs.module.n_x, runs.plan
        numbers: dict[str, Any] = {name: np.zeros(count, dtype=np.int64) for name in ("failure", *COUNTS)}
        samples = None if plan.t_eval is None else np.full((n, len(plan.t_eval), count), np.nan)
        notes = np.full((2 + n, plan.keep_events, count), np.nan) if runs.events.names else None
        x, t, when = np.full((n, count), np.nan), np.full(count, plan.span[0]), np.zeros(count)
        states = np.full(count, status, dtype=np.intc)
        return cls(x=x, t=t, samples=samples, status=states, failure_time=when, notes=notes, **numbers)


def run_block(runs: Runs, threads: int = 1, watch: Callable[[int], None] | None = None) -> RunBlock:
    """Run all of a block on threads, whose number changes no result; ``watch`` takes how many runs have ended."""
    varied, plan, count = runs.varied, runs.plan, runs.count
    if varied.refused:
        good = _others(count, varied.refused)
        allowed = run_block(replace(runs, varied=varied.chosen(good, len(good), {})), threads, watch)
        return _spread(allowed, runs, varied.refused, BAD_PARAMETERS)
    x0, reasons = assemble_states(runs.module, varied, plan.span[0], runs.forcing_of)
    core: Any = eager(runs.module.core)
    run = _run_compiled if plan.method in core.methods else _run_python
    some: Any = _others(count, reasons) if reasons else slice(None)
    p, u = (a if a.ndim == 1 else a[:, some].T for a in (varied.p, varied.u))
    block = run(runs, x0[:, some].T, p, u, threads, watch)
    if reasons:
        block = _spread(block, runs, reasons, UNASSEMBLED)
    project(runs, block)
    return block


def _run_compiled(runs: Runs, x0: Array, p: Array, u: Array, threads: int, watch: Any) -> RunBlock:
    module, plan, forcing = runs.module, runs.plan, runs.forcing
    core: Any = eager(module.core)
    forcing.attach(module)
    nodes = [plan.span[0], *forcing.corners(*plan.span, every_jump=True), plan.span[1]]
    settings = stepper_options(module.n_x, plan.options)
    ensemble = core.ensemble(
        plan.method, nodes, x0, p, u, max_steps=plan.max_steps, t_eval=plan.t_eval,
        signals=forcing.encode(), events=runs.events.encode(), keep=plan.keep_events, **settings,
    )  # fmt: skip
    work(ensemble, min(threads, max(len(x0), 1)), watch)
    samples, notes = (None if x is None else x.transpose(2, 1, 0) for x in (ensemble.samples, ensemble.notes))
    numbers = {name: getattr(ensemble, name) for name in ("t", "status", "failure", "failure_time", *COUNTS)}
    return RunBlock(x=ensemble.x.T, samples=samples, notes=notes, **numbers)


def work(ensemble: Any, threads: int, watch: Callable[[int], None] | None) -> None:
    """Let threads run the trajectories of an ensemble; an interrupt ends them within a few steps."""
    from threading import Thread

    raised: list[BaseException] = []

    def run() -> None:
        try:
            ensemble.work()
        except BaseException as error:
            raised.append(error)
            ensemble.stop()

    workers = [Thread(target=run, daemon=True) for _ in range(threads)]
    try:
        for worker in workers:
            worker.start()
        for worker in workers:
            while worker.is_alive():
                worker.join(EVERY)
                if watch is not None:
                    watch(ensemble.done)
    except BaseException:
        ensemble.stop()
        for worker in workers:
            if worker.ident is not None:
                worker.join()
        raise
    if raised:
        raise raised[0]


def _run_python(runs: Runs, x0: Array, p: Array, u: Array, threads: int, watch: Any) -> RunBlock:
    """The same through ``simulate``, one run after the other: by SciPy's methods."""
    module, plan = runs.module, runs.plan
    block = RunBlock.blank(runs, len(x0))
    status, samples = block.status, block.samples
    for k in range(len(x0)):
        try:
            own_p, own_u = (a if a.ndim == 1 else a[k] for a in (p, u))
            bound = module.rebound(own_p, own_u)
        except UsageError as error:
            status[k], block.texts[k] = BAD_PARAMETERS, str(error)
            continue
        constants = {name: float(bound.u[module.u_names.index(name)]) for name in plan.constants}
        try:
            run = simulate(
                bound, plan.span, x0[k], inputs={**constants, **plan.inputs}, method=plan.method, progress=False,
                events=plan.events, dense_output=samples is not None, **plan.options,
            )  # fmt: skip
            if samples is not None and plan.t_eval is not None:
                sign = 1.0 if plan.span[1] >= plan.span[0] else -1.0
                there = sign * (plan.t_eval - run.t[-1]) <= 0.0
                samples[:, there, k] = run.at(plan.t_eval[there]).x
        except (UsageError, MissingDependencyError):
            raise
        except EomgenError as error:
            status[k], block.texts[k] = FAILED, str(error)
            continue
        block.x[:, k], block.t[k], block.evaluations[k] = run.x[:, -1], run.t[-1], run.nfev
        block.steps[k] = len(run.t) - 1
        status[k] = run.status if block.steps[k] <= plan.max_steps else TOO_MANY_STEPS
        if block.notes is not None:
            _take_notes(block.notes[:, :, k], run.t_events, run.x_events)
            block.noted[k] = sum(map(len, run.t_events))
        if watch is not None:
            watch(k + 1)
    return block


def _take_notes(notes: Array, t_events: list[Array], x_events: list[Array]) -> None:
    """Put the events of a run in order into rows (2 + n, m)."""
    numbers = np.concatenate([np.full(len(t), float(i)) for i, t in enumerate(t_events)])
    result = np.vstack([numbers, np.concatenate(t_events), np.concatenate(x_events, axis=1)])
    order = np.argsort(result[1], kind="stable")[: notes.shape[1]]
    notes[:, : len(order)] = result[:, order]


def _others(count: int, reasons: Mapping[int, str]) -> Indices:
    """The runs that begin, of so many."""
    return np.array([k for k in range(count) if k not in reasons], dtype=np.intp)


def _spread(result: RunBlock, runs: Runs, reasons: dict[int, str], status: int) -> RunBlock:
    """The block of all runs, with the result of those that began, and of the others the status and the reason."""
    block, good = RunBlock.blank(runs, runs.count, status), _others(runs.count, reasons)
    for name, value in vars(result).items():
        if isinstance(value, np.ndarray):
            getattr(block, name)[..., good] = value
    block.texts.update(reasons | {int(good[k]): text for k, text in result.texts.items()})
    return block


def project(runs: Runs, block: RunBlock) -> None:
    """Bring the stored states onto the constraints, as ``simulate`` does; a state that cannot be becomes NaN."""
    module, plan = runs.module, runs.plan
    if not module.n_rows and not module.layout.space:
        return
    _project_columns(runs, block, block.x[:, None, :], block.t[None])
    if block.samples is not None and plan.t_eval is not None:
        _project_columns(runs, block, block.samples, np.repeat(plan.t_eval[:, None], runs.count, axis=1))
    if block.notes is not None:
        _project_columns(runs, block, block.notes[2:], block.notes[1])


def _project_columns(runs: Runs, block: RunBlock, states: Array, times: Array) -> None:
    """Project states (n_x, m, k) at times (m, k) where they are."""
    constrained = runs.forcing.constrained

    def bring(columns: list[int]) -> None:
        part, at, raw = states[:, :, columns], times[:, columns], runs.varied.column(columns[0])
        good = np.asarray(np.isfinite(part).all(axis=0))
        if not good.any():
            return
        if constrained:
            raw["u"] = runs.forcing_of(columns[0]).sample(at[good], part[:, good])
        part[:, good] = runs.module.project(part[:, good], t=at[good], **raw)
        states[:, :, columns] = part

    for k, reason in runs.varied.in_groups(runs.module.layout, [*range(runs.count)], constrained, bring).items():
        block.status[k], block.texts[k], states[:, :, k] = FAILED, reason, np.nan


# -- reductions --------------------------------------------------------------------------------------------------------

# A reduction turns a block into named arrays and joins those of all blocks in the order of the runs, so that the result
# does not depend on which was ready first.


Arrays = dict[str, Any]
GRAIN = 256  #: runs summarized at a time; fixed, so that rounding does not depend on blocks, threads or workers


class Reduction:
    """How blocks are reduced, and what is left of them joined; this one keeps arrays of them by name.

    Parameters
    ----------
    kept : sequence of str
        Of the last states ``x``, the ``samples`` where times were requested, and the events, ``notes``.
    """

    def __init__(self, kept: Sequence[str] = ("x", "samples", "notes")) -> None:
        self.kept = tuple(kept)

    def reduce(self, runs: Runs, block: RunBlock) -> Arrays:
        """x (n_x, k), samples (n_x, m, k), notes (2 + n_x, m, k)."""
        return {name: getattr(block, name) for name in self.kept if getattr(block, name) is not None}

    def join(self, parts: Sequence[Arrays]) -> Arrays:
        """Side by side."""
        return {name: np.concatenate([part[name] for part in parts], axis=-1) for name in parts[0]}


class Statistics(Reduction):
    """Count, mean, variance, least and greatest of every state and output over the runs that got there.

    Means and variances of blocks are merged as in T. F. Chan, G. H. Golub, R. J. LeVeque, Algorithms for computing the
    sample variance, The American Statistician 37 (1983).
    """

    def reduce(self, runs: Runs, block: RunBlock) -> Arrays:
        """count, mean, squares, least, greatest (g, n, m) of each grain; m is 1 without t_eval."""
        times = runs.plan.t_eval
        if times is None or block.samples is None:
            ended = (block.status == 0) | (block.status == EVENT)
            states, when = np.where(ended, block.x, np.nan)[:, None, :], block.t[None]
        else:
            states, when = block.samples, np.repeat(times[:, None], runs.count, axis=1)
        grains = []
        values = [runs.with_outputs(states[:, j], t) for j, t in enumerate(when)]
        for start in range(0, max(runs.count, 1), GRAIN):
            parts = [summarize(x[:, start : start + GRAIN]) for x in values]
            grains.append(stacked(parts, -1))
        return stacked(grains, 0)

    def join(self, parts: Sequence[Arrays]) -> Arrays:
        """One grain after the other, and the variance at the end."""
        grains = [{name: rows[g] for name, rows in part.items()} for part in parts for g in range(len(part["count"]))]
        total = functools.reduce(merge, grains)
        count, squares = total["count"], total.pop("squares")
        with np.errstate(invalid="ignore", divide="ignore"):
            return total | {"variance": np.where(count > 1, squares / (count - 1.0), np.nan)}


class Custom(Reduction):
    """What a user's ``function(block)`` makes of each :class:`RunBlock`, a mapping of names to arrays."""

    def __init__(self, function: Callable[[RunBlock], Mapping[str, Any]]) -> None:
        super().__init__(())
        self.function = function

    def reduce(self, runs: Runs, block: RunBlock) -> Arrays:
        """As the function says."""
        made = self.function(block)
        if not isinstance(made, Mapping) or not all(isinstance(name, str) for name in made):
            raise ill_typed(f"the function of reduce must return a mapping of names to arrays, not {made!r}")
        return {f"made_{name}": np.asarray(value) for name, value in made.items()}

    def join(self, parts: Sequence[Arrays]) -> Arrays:
        """A list of what was made of each block, for each name."""
        names = dict.fromkeys(name for part in parts for name in part)
        return {name.removeprefix("made_"): [part[name] for part in parts if name in part] for name in names}


WANTED = "reduce must be 'states', 'statistics', 'events' or a function of a block"


def choose_reduction(reduce: Any) -> Reduction:
    """The reduction that a user names: None or 'states', 'statistics', 'events', or a function of a block."""
    if callable(reduce):
        return Custom(reduce)
    if reduce is not None and not isinstance(reduce, str):
        raise ill_typed(f"{WANTED}, not {quote(reduce)}")
    if reduce in (None, "states"):
        return Reduction()
    if reduce == "events":
        return Reduction(["notes"])
    if reduce == "statistics":
        return Statistics()
    raise no_choice(f"{WANTED}, not {reduce!r}")


def summarize(values: Array) -> Arrays:
    """Count, mean, sum of squared deviations, least and greatest (n,) over what is finite in each row."""
    finite = np.isfinite(values)
    count = finite.sum(axis=1)
    some = count > 0
    mean = np.where(some, np.where(finite, values, 0.0).sum(axis=1) / np.maximum(count, 1), np.nan)
    squares = (np.where(finite, values - np.where(some, mean, 0.0)[:, None], 0.0) ** 2).sum(axis=1)
    least = np.where(finite, values, np.inf).min(axis=1, initial=np.inf)
    greatest = np.where(finite, values, -np.inf).max(axis=1, initial=-np.inf)
    extremes = {"least": np.where(some, least, np.nan), "greatest": np.where(some, greatest, np.nan)}
    return {"count": count, "mean": mean, "squares": np.where(some, squares, np.nan), **extremes}


def stacked(parts: Sequence[Arrays], axis: int) -> Arrays:
    """Arrays of the same names along a new axis."""
    return {name: np.stack([part[name] for part in parts], axis=axis) for name in parts[0]}


def merge(one: Arrays, other: Arrays) -> Arrays:
    """Both together."""
    a, b = one["count"], other["count"]
    total = np.maximum(a + b, 1)
    gap = other["mean"] - one["mean"]
    mean, squares = one["mean"] + gap * (b / total), one["squares"] + other["squares"] + gap**2 * (a * b / total)
    return {
        "count": a + b,
        "mean": np.where(a == 0, other["mean"], np.where(b == 0, one["mean"], mean)),
        "squares": np.where(a == 0, other["squares"], np.where(b == 0, one["squares"], squares)),
        "least": np.fmin(one["least"], other["least"]),
        "greatest": np.fmax(one["greatest"], other["greatest"]),
    }


# -- finished blocks in files ------------------------------------------------------------------------------------------


FORMAT = "eomgen ensemble 2"


class Store:
    """A folder with a file for each finished block and a manifest that says which ensemble they belong to.

    The folder is made if it is not there; ``identity`` is what the results depend on, JSON-like.
    """

    def __init__(self, folder: str | Path, identity: dict[str, Any]) -> None:
        self.folder = as_path("store", folder)
        manifest = self.folder / "manifest.json"
        self._identity = json.dumps({"format": FORMAT, **identity})
        wanted = json.loads(self._identity)
        if manifest.is_file():
            result = _read_manifest(self.folder)
            if differing := sorted(name for name in {*wanted, *result} if wanted.get(name) != result.get(name)):
                raise bad_data(
                    f"store {self.folder} belongs to another ensemble: {', '.join(differing)} differ; "
                    "name another folder or remove this one"
                )
            return
        remove_parts(manifest)  # of a call that was killed before the manifest was there
        if self.folder.is_dir() and any(self.folder.iterdir()):
            raise bad_file(f"store {self.folder} is not empty and does not contain an ensemble; name another folder")
        self.folder.mkdir(parents=True, exist_ok=True)
        write_whole(manifest, json.dumps(wanted, indent=1).encode())

    def _path(self, index: int) -> Path:
        return self.folder / f"block_{index:06d}.npz"

    def _key(self, index: int) -> str:
        """What the seal of a block covers besides its numbers: one of another place or ensemble is none of these."""
        return f"{index} {self._identity}"

    def save(self, index: int, arrays: dict[str, Any], texts: dict[int, str]) -> None:
        """Keep the arrays of a block; complete or not there."""
        buffer = io.BytesIO()
        messages = np.array(json.dumps({str(k): text for k, text in texts.items()}))
        np.savez(buffer, **sealed({**arrays, "words": messages}, self._key(index)))
        write_whole(self._path(index), buffer.getvalue())

    def load(self, index: int) -> tuple[dict[str, Any], dict[int, str]] | None:
        """The arrays of a block, or None if it was not finished."""
        remove_parts(self._path(index))
        try:
            arrays = read_arrays(self._path(index), compressed=False, key=self._key(index))
            texts = json.loads(str(arrays.pop("words")))
            return arrays, {int(k): str(text) for k, text in texts.items()}
        except FileNotFoundError:
            return None
        except BROKEN as error:
            path = self._path(index)
            raise bad_data(f"{path} cannot be read: {error}; remove it to run its block again") from None


def _read_manifest(folder: Path) -> dict[str, Any]:
    """Which ensemble a folder holds; nothing where it holds none, or what cannot be read."""
    try:
        with open_plain(folder / "manifest.json") as file:
            result = json.load(file)
    except (OSError, ValueError, RecursionError):
        return {}
    return result if isinstance(result, dict) else {}


def stored_length(folder: str | Path) -> int | None:
    """Runs of a block of the ensemble that a folder holds; None if it holds none."""
    result = _read_manifest(as_path("store", folder)).get("block")
    return result if type(result) is int and 0 < result <= LARGEST else None


# -- blocks ------------------------------------------------------------------------------------------------------------


LARGEST = 16 * GRAIN  #: runs of a block at most
SAMPLE_BYTES = 2**26  #: bytes of samples of a block, roughly
RUNS = ("t", "status", "failure", "failure_time", *COUNTS)

#: What is kept of a block, and what is to be said about its runs.
Kept = tuple[Arrays, dict[int, str]]


def keep(runs: Runs, reduction: Reduction, block: RunBlock) -> Kept:
    """What a reduction makes of a block, and the numbers of each run under ``runs_``."""
    numbers = {f"runs_{name}": getattr(block, name).copy() for name in RUNS}  # a user's function may change the block
    return {**reduction.reduce(runs, block), **numbers}, block.texts


def choose_size(count: int, bytes_of_a_run: int, workers: int = 1) -> int:
    """Runs of a block: several blocks for each of several workers, in whole grains, within the room."""
    shared = -(-count // (4 * workers)) if workers > 1 else count
    whole = min(max(-(-shared // GRAIN), 1) * GRAIN, LARGEST)
    fitting = max(SAMPLE_BYTES // max(bytes_of_a_run, 1), 1)
    return whole if whole <= fitting else max(fitting // GRAIN * GRAIN, min(fitting, GRAIN))


def split(count: int, size: int) -> list[tuple[int, int]]:
    """First and last + 1 of every block; one empty block where there are no runs."""
    return [(start, min(start + size, count)) for start in range(0, max(count, 1), size)]
