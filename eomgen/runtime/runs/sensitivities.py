"""A run -> the run and its derivatives by parameters, inputs and initial values.

Forward sensitivities: S' = J S + df/dp beside x' = f (E. Hairer, S. Norsett, G. Wanner, Solving Ordinary Differential
Equations I, 1993, section I.14), S(0) from the assembly of the initial state.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ...base.algebra import Array, Indices
from ...base.limits.analyses import SINGULAR
from ...base.limits.runs import SENSITIVITY_ATOL, SENSITIVITY_RTOL
from ...errors import NoDerivativeError, SimulationError
from ..argument_checks import check_names, read_names, read_number, require_steps, unknown
from ..change_points import singular_values
from ..failure import place
from ..inputs import Forcing
from ..layout import start_slopes
from ..refusals import require_support
from ..trajectory import Span, Start
from .bound_run import Crawling, StallCheck, describe_crawl
from .events import Events, told_by_the_caller
from .integrate import Solution, choose_solver, integrate, record, require_end
from .run_arguments import check_tolerances, find_state, longest_step, ordered_times, set_up
from .saltation import Saltation, Variational
from .sensitivity_start import (
    Sensitivities,
    held_names,
    refuse_lost_branches,
    split_columns,
    start_sensitivity,
)
from .simulate import simulate

if TYPE_CHECKING:
    from ..bound_model import BoundModel
    from ..option_types import Number, ReducedOptions
    from ..trajectory import Trajectory

OPTIONS = ("max_step", "first_step", "min_step")  #: of solvers, besides tolerances


def sensitivities(
    module: BoundModel,
    /,
    names: Sequence[str],
    span: Span = None,
    initial: Start = None,
    parameters: Any = None,
    inputs: Mapping[str, Any] | None = None,
    *,
    hold: Sequence[str] | None = None,
    method: Any = "DOP853",
    rtol: Number = SENSITIVITY_RTOL,
    atol: Number | ArrayLike = SENSITIVITY_ATOL,
    t_eval: ArrayLike | None = None,
    events: Any = None,
    **options: Unpack[ReducedOptions],
) -> Sensitivities:
    """Integrate a run together with its derivatives by parameters, inputs and initial values.

    Parameters
    ----------
    names : sequence of str
        What to differentiate by: parameters, inputs (a constant added to each) and initial values that are held.
    span, initial, parameters, inputs : optional
        As for ``simulate``.
    hold : sequence of str, optional
        Coordinates and rates that keep their initial values when something else changes; the constraints give the
        rest, by the smallest change where they leave a choice.  By default those given in ``initial``, then the
        declared ones, then the independent ones, while they leave each other room; declared ones that are
        expressions of parameters follow these then, as a run with other parameters does.
    method : str or OdeSolver subclass, optional
        Of SciPy.
    rtol, atol, t_eval, events : optional
        As for ``simulate``.
    **options
        max_step, first_step, as for ``simulate``.

    Returns
    -------
    Sensitivities
        ``s["theta", "k"]``, ``s.dx`` (n_x, k, n_t), ``s.dy`` (n_y, k, n_t), ``s.trajectory``.

    Raises
    ------
    UsageError
        An unknown name, or one that is not held.
    SimulationError, AssemblyError, MissingDependencyError
        As for ``simulate``.
    """
    require_support(module.layout, "sensitivities")
    check_names("option of sensitivities", options, OPTIONS, ("method", "rtol", "atol", "t_eval", "events"))
    bound, forcing, start, stop = set_up(module, span, parameters, inputs)
    layout = bound.layout
    corners = forcing.corners(start, stop)
    nodes = [start, *corners, stop]
    forcing.enter(*nodes[:2])
    x0 = find_state(bound, initial, start, forcing)
    here = bound.bind(u=forcing(start, x0))
    given = {n: read_number(n, x) for n, x in initial.items()} if isinstance(initial, Mapping) else None
    held = held_names(here, start, x0, given) if hold is None else _checked(bound, hold)
    columns = split_columns(layout, read_names("names", names), held)
    run = Variational(bound, forcing, columns)
    watched = Events(layout, events)
    chosen = longest_step(bound, method) | {name: value for name, value in options.items() if value is not None}
    settings = check_tolerances(layout.n_x, abs(stop - start), {"rtol": rtol, "atol": atol, **chosen})
    require_steps("max_step", float(settings.get("max_step", np.inf)), start, stop)
    alone = None
    if watched:
        with told_by_the_caller():
            alone = simulate(bound, (start, stop), x0, None, inputs, events=events, method=method, **settings)
    bound.rhs(start, x0, u=forcing(start, x0))  # a failure here is the user's state, not the integration
    follows = start_slopes(layout, bound.kernels.context.p) if initial is None or given is not None else {}
    follows = {} if hold is not None else {name: by_p for name, by_p in follows.items() if name not in (given or ())}
    S0 = start_sensitivity(here, start, x0, held, columns, run.input_slopes(start, x0), follows)
    solver = choose_solver(method)
    width = layout.n_x * (1 + len(columns.names))
    if np.ndim(settings["atol"]):  # of each state, and of its derivatives alike
        settings["atol"] = np.concatenate([settings["atol"], np.repeat(settings["atol"], len(columns.names))])
    times = None if t_eval is None else ordered_times(t_eval, start, stop, width)
    z0 = run.joined(x0, S0)
    salts = Saltation(run, watched, (start, stop), (settings["rtol"], settings["atol"]), corners)
    fail, title = bound.kernels.fail, solver.__name__
    longest = float(settings.get("max_step", np.inf))
    numbers = len(z0) if times is None else 0
    troubled = lambda t, x: fail.trouble(x, t) is not None  # noqa: E731
    rates = lambda t, x: bound.rhs(t, x, u=forcing(t, x))  # noqa: E731
    stall_check = StallCheck(start, stop, x0, layout.n_q, longest, troubled, rates, numbers)
    try:
        solution, _, raised = integrate(
            bound, forcing, nodes, z0, solver, times, False, settings, salts, None, stall_check.look, run
        )
        if raised is not None:
            raise raised
    except Crawling as crawl:
        _refuse_change_point(bound, forcing, crawl.t, crawl.x)
        trouble = "; ".join(fail.trouble(crawl.x, crawl.t) or ())
        raise SimulationError(describe_crawl(crawl, layout.x, stop, title, trouble)) from None
    if solution.status < 0 or not np.isfinite(solution.x).all():
        failure = run.rhs.failure or run.tangent.failure
        cause = None if failure is None else bound.kernels.fail.exception("rhs", *failure)
        raise SimulationError(f"{title} stopped: {solution.message} {cause or ''}".strip()) from cause
    require_end(solution, stop)
    if solution.status == 1:
        _note_end(salts, solution)
    n, k = layout.n_x, len(columns.names)
    kept = _distinct(solution)
    steps = None if solution.steps is None else (solution.steps[0], solution.steps[1][:n])
    states = solution._replace(
        t=solution.t[kept], x=solution.x[:n, kept], x_events=[found[:n] for found in solution.x_events], steps=steps
    )
    raw = solution.x[n:, kept].reshape(n, k, -1) / run.weights[:, None]
    trajectory = record(bound, forcing, states, title, settings, watched.names)
    if alone is not None:
        _require_same(trajectory, alone)
    refuse_lost_branches(bound, forcing, trajectory, columns)
    dx, dy = np.empty_like(raw), np.empty((layout.n_y, k, raw.shape[2]))
    for j, time in enumerate(trajectory.t):
        t, x = float(time), trajectory.x[:, j]
        dx[..., j] = run.consistent(t, x, raw[..., j])
        if layout.n_y:
            dy[..., j] = run.outputs(t, x, dx[..., j])
    return Sensitivities(trajectory, columns.names, dx, dy, held, salts.found)


def _refuse_change_point(module: BoundModel, forcing: Forcing, t: float, x: Array) -> None:
    """Tell of a loss of rank at the state where the derivatives grow without bound.

    Raises
    ------
    NoDerivativeError
    """
    if not module.layout.rank:
        return
    u = forcing(t, x)[:, None] if module.layout.constraint_inputs else None
    if singular_values(module, np.array([t]), x[:, None], u)[0, module.layout.rank - 1] < SINGULAR:
        raise NoDerivativeError(
            f"the run passes a change point at t = {t:.6g} s{place(module.layout.x, x)}: the mobility changes there, "
            "and a small change of a parameter can close or open the branch, so there is no derivative; end the run "
            "before it"
        )


def _require_same(found: Trajectory, alone: Trajectory) -> None:
    """Refuse a run that passes over events which the run by itself finds."""
    for name, ours, theirs in zip(found.t_events.names, found.t_events, alone.t_events, strict=True):
        if len(ours) != len(theirs):
            raise SimulationError(
                f"event {name} is found {len(theirs)} times by simulate, but {len(ours)} times together with the "
                "derivatives, because it comes and goes within one step of the solver; give max_step",
                code="EG-EVENT",
            )


def _note_end(salts: Saltation, solution: Solution) -> None:
    """Note the event that ended the run, the last one that can."""
    ending = [k for k, event in enumerate(salts.every) if event.terminal and len(solution.t_events[k])]
    last = max(ending, key=lambda k: abs(float(solution.t_events[k][-1] - solution.ends[0])))
    salts.stop(float(solution.t_events[last][-1]), solution.x_events[last][:, -1], last)


def _distinct(solution: Solution) -> Indices:
    """Points other than those that repeat the one before, as where an event changes nothing."""
    same = (np.diff(solution.t) == 0.0) & (np.diff(solution.x, axis=1) == 0.0).all(axis=0)
    return np.flatnonzero(np.concatenate([[True], ~same]))


def _checked(module: BoundModel, hold: Sequence[str]) -> list[str]:
    layout = module.layout
    allowed = (*layout.q, *layout.v, *layout.loops, *layout.loop_rates)
    names = read_names("hold", hold)
    for name in names:
        if name not in allowed:
            raise unknown("coordinate or rate", name, allowed)
    return list(names)
