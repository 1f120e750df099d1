"""Module, span, initial values, parameters, inputs -> Trajectory, through SciPy's integrators."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import inf
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack, cast

import numpy as np
from numpy.typing import ArrayLike

from ...errors import EvaluationError, SimulationError, SimulationInterrupted, calls_within, cannot
from ..argument_checks import check_names, read_flag, require_size, require_steps
from ..inputs import Forcing
from ..refusals import not_driven, require_rigid_contacts
from ..trajectory import Span, Start
from .bound_run import Crawling, Run, watch_run
from .events import WAIT, Events, inner_run, is_inner_run
from .integrate import (
    Solution,
    check_options,
    choose_solver,
    integrate,
    record,
    require_end,
    takes_jacobian,
    warn_of_limits,
)
from .run_arguments import (
    IMPLICIT,
    can_run,
    check_first_step,
    check_method,
    check_tolerances,
    declare,
    declared_step,
    find_span,
    find_state,
    longest_step,
    ordered_times,
)

if TYPE_CHECKING:
    from ..bound_model import BoundModel
    from ..protocols import Number, SolverOptions
    from ..trajectory import Trajectory

OPTIONS = (
    *("span", "initial", "parameters", "inputs", "method", "rtol", "atol", "t_eval", "events", "dense_output"),
    *("max_step", "first_step", "progress", "step", "controllers"),
)


# -- plans -------------------------------------------------------------------------------------------------------------

# What holds before values are bound.  That of a run over a span, with no inputs, events, steps or options of its own,
# is kept with the module for the next one.


MANY = 16  #: plans that are kept for a module
SIMPLE = frozenset((str, float, type(None)))  #: types of the arguments by which a plan is found again
FEWEST = 2  #: settings of every run: rtol and atol


class Plan(NamedTuple):
    """How a run is made; no run changes it."""

    forcing: Forcing
    events: Events
    solver: Any  #: a class as SciPy has them; None in compiled code
    title: str  #: the method
    end: float  #: by default (s)
    size: float | None  #: of the steps of RK4 (s)
    settings: dict[str, Any]  #: tolerances, steps and options of the method, checked but for the length of the run
    kept: bool  #: whether another run can have it
    shared: bool  #: whether runs that bind no values change nothing of the forcing: no rates, no sampled states


def plan_run(
    module: BoundModel,
    method: Any,
    step: Any,
    inputs: Mapping[str, Any] | None,
    events: Any,
    controllers: Mapping[str, Any] | None,
    limits: Mapping[str, Any],
    options: Mapping[str, Any],
) -> Plan:
    """Read the method, its tolerances and steps (``limits``) and options, inputs and events of a run."""
    size, declared, layout = check_method(method, step), declare(module), module.layout
    method = declared["method"] if method is None else method
    watched = events if isinstance(events, Events) else Events(layout, events, controllers)
    forcing = Forcing(layout, inputs)
    compiled = can_run(module, method, forcing) and options.keys().isdisjoint(IMPLICIT)
    if method == "RK4" and not compiled:
        raise cannot("method RK4 takes no input that is a function; give an expression or a table")
    solver = None if compiled else choose_solver(method)
    if solver is None:
        check_names("option of simulate", options, (), OPTIONS)
    else:
        check_options(solver, options, OPTIONS)
    raw = {name: value for name, value in limits.items() if value is not None}
    settings = {name: declared[name] for name in ("rtol", "atol")} | longest_step(module, method) | raw | {**options}
    if solver is None or solver.__module__.startswith("scipy."):  # another's solver may take anything
        settings = check_tolerances(module.n_x, inf, settings)
    title = str(method) if solver is None else solver.__name__
    kept = solver is None and size is None and not forcing.values
    shared = not (layout.input_rates or layout.info.clocks or layout.switches)
    return Plan(forcing, watched, solver, title, float(declared["end"]), size, settings, kept, shared)


# -- runs --------------------------------------------------------------------------------------------------------------


def simulate(
    module: BoundModel,
    /,
    span: Span = None,
    initial: Start = None,
    parameters: Any = None,
    inputs: Mapping[str, Any] | None = None,
    *,
    method: Any = None,
    rtol: Number | ArrayLike | None = None,
    atol: Number | ArrayLike | None = None,
    t_eval: ArrayLike | None = None,
    events: Any = None,
    controllers: Mapping[str, Callable[[float, Any], Any]] | None = None,
    dense_output: bool = False,
    max_step: Number | None = None,
    first_step: Number | None = None,
    progress: bool | None = None,
    step: Number | None = None,
    **options: Unpack[SolverOptions],
) -> Trajectory:
    """Integrate the equations of motion.

    Parameters
    ----------
    span : (float, float) or float, optional
        Start and end (s); the end alone for a start at 0; the model's own end by default.
    initial : mapping of str to float, (n_x,) array, or Trajectory, optional
        Named values as for ``Module.x0``, held exactly, or a state, which is projected onto the constraints; of a
        run, its last state.  Here, in `span` and in `parameters` a text is an expression of numbers: ``"deg(30)"``.
    parameters : mapping of str to float, or (n_p,) array, optional
        Those not named keep their bound values.
    inputs : mapping of str to number, (times, values), Signal, expression or callable f(t, x), optional
        Tables are linear in between (a :class:`~..inputs.Signal` may hold the last value, or be a cubic
        spline) and constant outside; steps end exactly at their corners.  An expression is a text as in model
        files, of t, coordinates, velocities and parameters.
        Rates of an input that the equations need (``u_dot``, ``u_ddot`` among ``u_names``) are derived from it; for a
        function without a method ``derivative`` they must be given too.
    method : str or OdeSolver subclass, optional
        A method of SciPy: DOP853 (default), RK45, Radau (stiff), RK23, BDF, LSODA.  The first three run in compiled
        code with SciPy's steps unless there are inputs that are functions; in large mechanisms with loops (more than 8
        velocities) each step of the first two starts on the constraints where the last came near
        them.  Implicit ones get the exact Jacobian.  In compiled code only: RK4, which takes steps of one size, and
        Taylor, of orders up to 23, for smooth trees of a few bodies at tight tolerances.  moreau takes contacts between
        groups as rigid, with Coulomb's friction, in steps of one size.
    rtol, atol : float, optional
        The model's own, or 1e-8 and 1e-10.
    t_eval : (n_t,) array, optional
        Times to store; the solver's steps by default.
    events : str, callable f(t, x), list of these, or mapping of names to them, optional
        Names of the model's events (all by default; those that reset the state are watched in any case), expressions
        as text, or functions with SciPy's attributes ``terminal`` and ``direction``.  In a mapping also
        ``{"expression": text, "terminal": times, "direction": 1}``.
    controllers : mapping of str to callable f(t, x), optional
        Functions that give the new values of sampled states for which the model has no law; x is the state right
        before, in which the sampled states with a law have their new values already.
    dense_output : bool
        Keep a continuous solution for ``Trajectory.at``, which otherwise makes the run again.
    max_step, first_step : float, optional
    step : float, optional
        Size of the steps of RK4 and of moreau (s), and only of these.
    progress : bool, optional
        Show progress on stderr; by default for runs of more than two seconds on a terminal.
    **options
        Passed on to the solver; unknown ones are an error for SciPy's methods.  Of moreau ``contact_tolerance``, the
        residual of the contact laws (m/s) divided by the largest velocity in the contacts of a step,
        ``contact_iterations`` and ``contact_forces``, True to keep the force of each contact.

    Returns
    -------
    Trajectory

    Raises
    ------
    ZenoError
        Events that reset the state follow each other ever faster.
    SimulationInterrupted
        Ctrl-C; ``trajectory`` of the exception has the run up to there.
    SimulationError
        The integration ended early, met a state that is not finite, or took steps that lead nowhere; its cause is the
        last failure of a kernel, or the singularity or jump at which it gave up.
    AssemblyError
        The initial values do not fit the loops.
    EvaluationError
        The right-hand side cannot be evaluated at the initial state.
    UsageError
        Unknown names, wrong shapes.
    MissingDependencyError
        The run needs SciPy, which is not installed.
    """
    again = None
    if dense_output is False and controllers is None:
        copies = [value if value is None else _copied(value) for value in (initial, parameters, inputs)]
        again = partial(
            _again, module, span, *copies, events=events, method=method, rtol=rtol, atol=atol,
            dense_output=True, max_step=max_step, first_step=first_step, progress=progress, step=step, **options,
        )  # fmt: skip
    others: dict[str, Any] = {**options}
    key = (method, rtol, atol)
    plain = inputs is None and events is None and controllers is None and not others
    plain = plain and max_step is None and first_step is None and step is None and SIMPLE.issuperset(map(type, key))
    plan: Plan | None = module._plans.get(key) if plain else None
    if plan is None:
        method, step = declared_step(module, method, step)
        limits = {"rtol": rtol, "atol": atol, "max_step": max_step, "first_step": first_step}
        if (isinstance(method, str) and method == "kinematic") or (method is None and not module.layout.n_dof):
            if module.layout.n_dof:
                raise not_driven(module.layout)
            from ..prescribed.kinematic import follow_drivers

            requested = {**limits, **others}
            motion = follow_drivers(module, span, initial, parameters, inputs, t_eval, events, method, requested)
            if motion is not None:
                return motion
        if (isinstance(method, str) and method == "moreau") or module.info.rigid_only:
            require_rigid_contacts(module.layout)
            from ..impacts.moreau import step_rigidly

            requested = {**limits, "dense_output": dense_output, "controllers": controllers, **others}
            raw = (module, span, initial, parameters, inputs, method, step, t_eval, events, progress, requested)
            return step_rigidly(*raw)
        plan = plan_run(module, method, step, inputs, events, controllers, limits, others)
        if plain and plan.kept:
            plan.forcing.attach(module)
            if len(module._plans) >= MANY:
                module._plans.clear()
            module._plans[key] = plan
    if dense_output is not False:
        dense_output = read_flag("dense_output", dense_output)
    kept = plain and plan.kept
    shared = kept and plan.shared and parameters is None
    forcing, watched, solver, title = plan.forcing if shared else plan.forcing.again(), *plan[1:4]
    compiled, settings = solver is None, plan.settings
    start, end = find_span(span, plan.end)
    if plan.size is not None:
        require_steps("step", plan.size, start, end)
        settings = {**settings, "max_step": plan.size, "first_step": min(plan.size, abs(end - start))}
    elif len(settings) > FEWEST and (compiled or solver.__module__.startswith("scipy.")):
        check_first_step(settings, abs(end - start))
        require_steps("max_step", float(settings.get("max_step", inf)), start, end)
    bound = module.bind(parameters, forcing.constants) if parameters is not None or forcing.constants else module
    if not kept or bound is not module:
        forcing.attach(bound)
    nodes = [start, end] if shared else [start, *forcing.corners(start, end, compiled), end]
    varies = not shared and bool(forcing)
    if varies:
        forcing.enter(*nodes[:2])
    if shared and initial is None and not start:
        x0 = bound._running_start.copy()
    else:
        x0 = find_state(bound, initial, start, forcing)
        u0 = forcing(start, x0) if varies else None
        forcing.require_finite()
        bound.rhs(start, x0, u=u0)  # a failure here is the user's state, not the integration
    run = Run(bound, forcing)
    if watched.model and any(event.action == WAIT for event in watched.model) and not is_inner_run():
        from ..impacts.impact import describe_negative_gaps

        if message := describe_negative_gaps(bound, start, x0, watched.declared, forcing):
            warnings.warn(message, stacklevel=calls_within() + 1)
    if bound.info.contact_shapes:
        from .run_arguments import warn_of_depth

        warn_of_depth(bound, start, x0, forcing(start, x0) if forcing else None)
    if not compiled and takes_jacobian(solver):
        if solver in (choose_solver("BDF"), choose_solver("Radau")):
            run.sparse = None  # where the first Jacobian is worth it
        settings = {"jac": run.jacobian, **settings}
    watch = watch_run(start, end, progress)
    stored = None if t_eval is None else ordered_times(t_eval, start, end, module.n_x)
    if again is not None and stored is not None:
        again = partial(again, t_eval=stored.copy())
    longest = float(settings.get("max_step", inf))
    numbers = (1 + module.n_x) * ((stored is None) + 8 * dense_output)  # of each step
    many = abs(end - start) / longest if longest > 0.0 else 0.0  # a solver of another refuses what it does not take
    if many:
        require_size(f"a run of {many:.3g} steps", many * numbers, "give the times to store, t_eval, or run in parts")
    run.begin(start, end, x0, longest, numbers)
    steps = partial(
        integrate, bound, forcing, nodes, x0, title if compiled else solver, stored, dense_output, settings, watched,
        watch, run.look, None if compiled else run.watched(watch),
    )  # fmt: skip
    try:
        solution = complete(run, steps, (start, end), title, settings, watched)
    finally:
        if watch is not None:
            watch.close()
    try:
        made = record(bound, forcing, solution, title, settings, watched.names, again)
    except EvaluationError as error:
        where = "?" if error.time is None else f"{error.time:.6g}"
        raise SimulationError(f"the solution at t = {where} s is not a valid state: {error}; tighten rtol") from error
    if bound.layout.limits:
        atol = float(np.max(settings.get("atol", 0.0)))
        warn_of_limits(made, bound.layout, float(settings.get("rtol", 0.0)), atol)
    return made


_again = inner_run()(simulate)  # without the warnings that the first run gave


def _copied(value: Any) -> Any:
    """A copy of what the user may change later."""
    if isinstance(value, dict):
        return {name: _copied(part) for name, part in value.items()}
    parts = [_copied(part) for part in value] if isinstance(value, list | tuple) else value
    return parts.copy() if isinstance(parts, np.ndarray) else parts


def complete(
    run: Run, steps: Callable[[], Any], span: Sequence[float], method: str, settings: dict[str, Any], watched: Events
) -> Solution:
    """The solution that the steps of a run over a span come to, or the error that says what ended it before."""
    start, end = span
    try:
        solution, failure, raised = steps()
        if failure is not None:
            run.last = ("rhs", *failure)
        if isinstance(raised, KeyboardInterrupt):
            raise SimulationInterrupted(
                f"interrupted at t = {solution.ends[1]:.6g} s of {end:.6g} s",
                lambda: record(run.module, run.forcing, solution, method, settings, watched.names),
            ) from raised
        if raised is not None:
            raise raised
    except EvaluationError as error:  # of a reset
        event, watched.last = watched.last, ""
        raise SimulationError(f"{method} stopped{event}: {error}") from error
    except Crawling as crawl:
        raise run.gave_up(crawl, end, method, settings) from None
    except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
        if run.last is None:
            raise
        raise run.ended(start, end, method, str(error)) from run.cause()
    if not solution.finite and not np.isfinite(solution.x).all():
        finite = np.isfinite(solution.x).all(axis=0)
        first = int(np.flatnonzero(~finite)[0])
        raise run.ended(float(solution.t[first]), end, method, "the state is not finite.") from run.cause()
    if solution.status < 0:
        reached, last = (float(solution.t[-1]), solution.x[:, -1]) if solution.t.size else (start, None)
        raise run.ended(reached, end, method, solution.message, last) from run.cause()
    require_end(solution, end)
    return cast("Solution", solution)
