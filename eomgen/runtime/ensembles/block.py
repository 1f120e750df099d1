"""A block of cases -> RunBlock, what became of its runs: in compiled code on threads, or one by one in Python."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.algebra import Array
from ...errors import EomgenError, MissingDependencyError, UsageError, cannot
from ..inputs import Forcing
from ..late import eager
from ..runs.compiled import stepper_options
from ..runs.events import WAIT, Events
from ..runs.integrate import MESSAGES, RESET_FAILED, STOPPED, TERMINAL, TOO_SMALL, ZENO
from ..runs.simulate import simulate
from .given_cases import UNASSEMBLED, Cases, assemble_states

if TYPE_CHECKING:
    from ..bound_model import BoundModel

Integers = np.ndarray[Any, np.dtype[Any]]

TOO_SMALL_STEP, TOO_MANY_STEPS, BAD_PARAMETERS, FAILED, LOST = -100, -104, -110, -112, -113
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
    cases: Cases
    plan: Plan

    @property
    def count(self) -> int:
        """How many there are."""
        return self.cases.count

    def part(self, start: int, stop: int) -> Runs:
        """The runs from `start` to before `stop`."""
        return replace(self, cases=self.cases.part(start, stop))

    @property
    def events(self) -> Events:
        """The events that are watched.

        Raises
        ------
        UsageError
            One that only a single run can watch.
        """
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
            bound = bound.bind(**self.cases.column(k))
        forcing.attach(bound)
        forcing.unsettled = frozenset()
        forcing.begin(*self.plan.span)
        return forcing

    def inputs_at(self, t: Array, x: Array) -> Array:
        """Inputs (n_u, k) of every run at times (k,) and states (n_x, k)."""
        cases, forcing = self.cases, self.forcing
        u = np.array(np.broadcast_to(cases.u if cases.u.ndim > 1 else cases.u[:, None], (len(cases.u), cases.count)))
        for i, signal in forcing.varying.items():
            u[i] = signal(t, x)  # type: ignore[arg-type]
        for i, formula in forcing.formulas.items():
            for k in range(cases.count):
                u[i, k] = formula.function(cases.column(k)["p"])(float(t[k]), x[:, k])
        return u

    @property
    def names(self) -> tuple[str, ...]:
        """States, then the outputs that do not repeat a coordinate."""
        module = self.module
        return (*module.x_names, *(name for name in module.y_names if name not in module.x_names))

    def with_outputs(self, x: Array, t: Array) -> Array:
        """States (n_x, k) at times (k,) with their outputs, as ``names`` has them; NaN where one has no value."""
        module, cases = self.module, self.cases
        further = [i for i, name in enumerate(module.y_names) if name not in module.x_names]
        good = np.flatnonzero(np.isfinite(x).all(axis=0))
        y = np.full((module.n_y, x.shape[1]), np.nan)
        if further and good.size:
            outputs, u = module.kernels.timed("outputs", nan=True), self.inputs_at(t, x)
            if cases.p.ndim == 1:
                y[:, good] = outputs(t[good], x[:, good], p=cases.p, u=np.ascontiguousarray(u[:, good]))
            else:
                for k in good:
                    y[:, k] = outputs(float(t[k]), x[:, k], p=cases.column(int(k))["p"], u=u[:, k])
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
        Projected states at the times asked for; NaN where a run did not get to.
    status : (k,) int array
        See ``MEANING``; a failed evaluation's code is in `failure`.
    failure, failure_time, steps, rejected, evaluations : (k,) arrays
    noted : (k,) int array
        Number of events.
    notes : (2 + n_x, m, k) array or None
        Number, time and state of the first m events of each run; NaN where there were fewer.
    words : dict of int to str
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
    words: dict[int, str] = field(default_factory=dict)

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
    """Run all of a block.

    Parameters
    ----------
    runs : Runs
    threads : int
        Runs at a time; the results do not depend on it.
    watch : callable, optional
        Told now and then how many runs have ended.
    """
    cases, plan, count = runs.cases, runs.plan, runs.count
    x0, failed, words = assemble_states(runs.module, cases, plan.span[0], runs.forcing_of)
    core: Any = eager(runs.module.core)
    run = _run_compiled if plan.method in core.methods else _run_python
    good = np.flatnonzero(~failed)
    some: Any = good if good.size < count else slice(None)
    p, u = (a if a.ndim == 1 else a[:, some].T for a in (cases.p, cases.u))
    block = run(runs, x0[:, some].T, p, u, threads, watch)
    if good.size < count:
        block = _spread(block, good, RunBlock.blank(runs, count, UNASSEMBLED))
        block.words.update(zip(np.flatnonzero(failed).tolist(), words, strict=True))
    project(runs, block)
    return block


def _run_compiled(runs: Runs, x0: Array, p: Array, u: Array, threads: int, watch: Any) -> RunBlock:
    module, plan, forcing = runs.module, runs.plan, runs.forcing
    core: Any = eager(module.core)
    forcing.attach(module)
    nodes = [plan.span[0], *forcing.corners(*plan.span, every_jump=True), plan.span[1]]
    settings = stepper_options(module.n_x, abs(plan.span[1] - plan.span[0]), plan.options)
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
            bound = module.bind(*(a if a.ndim == 1 else a[k] for a in (p, u)))
        except UsageError as error:
            status[k], block.words[k] = BAD_PARAMETERS, str(error)
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
            status[k], block.words[k] = FAILED, str(error)
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
    found = np.vstack([numbers, np.concatenate(t_events), np.concatenate(x_events, axis=1)])
    order = np.argsort(found[1], kind="stable")[: notes.shape[1]]
    notes[:, : len(order)] = found[:, order]


def _spread(found: RunBlock, good: Integers, block: RunBlock) -> RunBlock:
    """The block with the runs that could be begun in their places."""
    for name, value in vars(found).items():
        if isinstance(value, np.ndarray):
            getattr(block, name)[..., good] = value
    block.words.update({int(good[k]): text for k, text in found.words.items()})
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
    led = runs.forcing.constrained

    def bring(columns: list[int]) -> None:
        part, at, given = states[:, :, columns], times[:, columns], runs.cases.column(columns[0])
        good = np.asarray(np.isfinite(part).all(axis=0))
        if not good.any():
            return
        try:
            if led:
                given["u"] = runs.forcing_of(columns[0]).sample(at[good], part[:, good])
            part[:, good] = runs.module.project(part[:, good], t=at[good], **given)
            states[:, :, columns] = part
        except EomgenError as error:
            if len(columns) == 1:
                block.status[columns[0]], block.words[columns[0]] = FAILED, str(error)
                states[:, :, columns[0]] = np.nan
            for k in columns if len(columns) > 1 else ():  # some cannot be: find out which
                bring([k])

    for columns in [[k] for k in range(runs.count)] if led else runs.cases.alike(runs.module.layout):
        bring(columns)
