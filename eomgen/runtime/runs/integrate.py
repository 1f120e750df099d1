"""Right-hand side, method, corners of the inputs -> times, states and events, by the loop in C.

The steps are those of the module's own steppers, in C too, or of a class with the calls of SciPy's OdeSolver.  The rest
is one text for all (eomgen/native/steppers/loop.c): no step passes over a corner of tabulated inputs, events are zeros
within a step, and a run goes on from what a reset made of its state.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import nullcontext
from functools import partial
from math import inf
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...base.algebra import Array
from ...errors import SimulationError, calls_within, ill_shaped, no_choice
from ..argument_checks import check_names, require, unknown
from ..inputs import Forcing
from ..layout import Layout
from ..trajectory import Columns, Trajectory, describe, project, units_of_layout
from .events import is_inner_run, warn_of_unknown

if TYPE_CHECKING:
    from ..bound_model import BoundModel
    from .bound_run import Progress
    from .events import Events

KEPT = 10**7  #: numbers at most of the steps that are kept besides what t_eval asks for
METHODS = ("RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA")
NAMES = (*METHODS, "Taylor", "RK4", "moreau", "kinematic")  #: all that simulate knows


class Solution(NamedTuple):
    """What an integration came to."""

    t: Array  #: (n_t,)
    x: Array  #: (n_x, n_t)
    t_events: list[Array]
    x_events: list[Array]  #: (n_x, k) for each event
    dense: Callable[[Array], Array] | None
    status: int  #: SciPy's: 0 end reached, 1 terminal event, -1 failed
    message: str
    counts: dict[str, int]
    ends: tuple[float, float]  #: first and last time reached
    steps: tuple[Array, Array] | None = None  #: (k,), (n_x, k) of every step, where others are stored; k = 0: too many
    finite: bool = False  #: whether the states are known to be finite


class Joined:
    """Dense output of a run: that of each step, up to where the next one goes on."""

    def __init__(self, pieces: Sequence[tuple[float, Callable[[Array], Array]]], forward: bool) -> None:
        self.ends = np.array([end for end, _ in pieces])
        self.parts = [part for _, part in pieces]
        self.sign = 1.0 if forward else -1.0

    def __call__(self, t: Array) -> Array:
        """States (n_x, k) at times (k,)."""
        at = np.asarray(t, dtype=float)
        which = np.minimum(np.searchsorted(self.sign * self.ends, self.sign * at), len(self.parts) - 1)
        order = np.argsort(which, kind="stable")
        result: Array | None = None
        for places in np.split(order, np.flatnonzero(np.diff(which[order])) + 1):
            block = np.asarray(self.parts[int(which[places[0]])](at[places]))
            result = np.empty((block.shape[0], len(at))) if result is None else result
            result[:, places] = block
        return np.empty((0, 0)) if result is None else result


def choose_solver(method: Any, purpose: str = "simulate") -> Any:
    """SciPy's class for a name, or the OdeSolver subclass itself."""
    scipy = require("scipy.integrate", "scipy", purpose)
    if isinstance(method, str):
        if method not in METHODS:
            raise unknown("method", method, NAMES)
        return getattr(scipy, method)
    if isinstance(method, type) and issubclass(method, scipy.OdeSolver):
        return method
    raise no_choice(f"method must be one of {', '.join(METHODS)}, or a subclass of OdeSolver, not {method!r}")


def check_options(solver: Any, options: Collection[str], known: Collection[str]) -> None:
    """Refuse options that one of SciPy's own methods would only warn about; ``known`` are those of ``simulate``, to
    suggest.
    """
    from inspect import signature

    if not solver.__module__.startswith("scipy."):
        return
    taken = [*signature(solver.__init__).parameters]
    allowed = [name for name in taken if name not in ("self", "fun", "t0", "y0", "t_bound", "extraneous")]
    check_names(f"option of simulate with {solver.__name__}", options, allowed, known)


def takes_jacobian(solver: Any) -> bool:
    """Whether a solver class has an argument ``jac``."""
    from inspect import signature

    return "jac" in signature(solver.__init__).parameters


ENDED, TERMINAL, WAITING, ZENO, STOPPED, RESET_FAILED = 1, 2, 3, -102, -101, -103  #: as in eomgen_steppers.h
STATUS = {ENDED: 0, TERMINAL: 1}  #: SciPy's
LOUD = nullcontext()
TOO_SMALL = "Required step size is less than spacing between numbers."
MESSAGES = {
    ENDED: "The solver successfully reached the end of the integration interval.",
    TERMINAL: "A termination event occurred.",
    STOPPED: "The run was interrupted.",
    RESET_FAILED: "The state after an event cannot be evaluated, or cannot be brought onto the constraints.",
}


def integrate(
    module: BoundModel,
    forcing: Forcing,
    nodes: Sequence[float],
    x0: Array,
    method: Any,
    t_eval: Array | None,
    dense: bool,
    options: Mapping[str, Any],
    events: Events | None = None,
    watch: Progress | None = None,
    look: Callable[[float, Array, int], None] | None = None,
    rates: Callable[[float, Array], Array] | None = None,
) -> tuple[Solution, tuple[int, float, Array] | None, BaseException | None]:
    """Integrate from the first of the `nodes` to the last, not stepping over the others (corners of the inputs).

    The method is one of the module's own by name, or a class with the calls of SciPy's OdeSolver, to which ``rates`` is
    f(t, x) and whose state (n,) may go on after that of the module.  ``look`` takes time, state and the number of
    further steps.

    Returns the solution; (status, t, x) of the last evaluation that failed, of the module's own methods; and what
    stopped the run from outside: an interrupt, a function of the user's, or steps that lead nowhere.
    """
    core: Any = module.core
    start, end = nodes[0], nodes[-1]
    events = events if events is not None and len(events) else None
    plan: dict[str, Any] = {
        "nodes": nodes[1:], "t_eval": t_eval, "dense": dense, "events": events.encode() if events else None,
        "trail": KEPT if module.layout.rank else 0, "watch": None if watch is None else watch.look, "stall_check": look,
    }  # fmt: skip
    if isinstance(method, str):
        rtol, atol = require_one(options["rtol"]), options["atol"]
        steps = options.get("max_step", inf), options.get("first_step", 0.0)
        run = core.run(method, module.kernels.context, start, x0, end, rtol, atol, *steps, forcing.encode(), plan)
    else:
        plan |= {"make": partial(_make, method, rates, forcing, nodes, dict(options)), "rates": rates}
        plan["inputs"] = forcing if forcing else None
        run = core.called("called", module.kernels.context, start, x0, end, 0.0, 0.0, inf, 0.0, (), plan)
    status, raised = 0, None
    quiet = LOUD if isinstance(method, str) else np.errstate(all="ignore")  # NaN of a failure shortens a step
    try:
        with quiet:
            status = run.proceed()
            while status in (WAITING, RESET_FAILED) and events is not None:
                later = (k for k, at in enumerate(nodes[1:-1]) if (at - run.t) * (end - start) >= 0.0)
                k = next(later, len(nodes) - 2)
                forcing.enter(nodes[k], nodes[k + 1])  # as the loop has it
                after = events.reset(module, forcing, run.t, run.state(), run.fired())
                if status == RESET_FAILED:  # in C; here it fails too as a rule, and tells why
                    break
                jumped = run.jump(after)
                status = TERMINAL if events.over else jumped or run.proceed()
    except KeyboardInterrupt as interrupt:  # in a reset
        status, raised = STOPPED, interrupt
    finally:
        if forcing:
            forcing.enter(start, end)  # who asks for inputs from here on asks for those of the whole run
    times, states, notes = run.outcome()
    raised = run.raised if raised is None else raised
    if events is not None and raised is None:
        warn_of_unknown([events.names[i] for i in run.unknown()])
    if status == ZENO and events is not None:
        raise events.crowded(run.t, run.resets)
    t_events, x_events = [], []
    if events is not None:
        which = notes[:, 0]
        t_events = [notes[which == i, 1] for i in range(len(events))]
        x_events = [np.ascontiguousarray(notes[which == i, 2:].T) for i in range(len(events))]
    counts = {"nfev": run.evaluations, "njev": run.differentiations, "nlu": run.factorizations}
    trail = None if (trail := run.trail()) is None else (trail[:, 0], np.ascontiguousarray(trail[:, 1:].T))
    between: Any = run.dense() if dense else None
    if between and not isinstance(method, str):
        between = Joined(between, end >= start)
    message = MESSAGES.get(status, getattr(run, "message", "") or TOO_SMALL)
    solution = Solution(
        times, states, t_events, x_events, between or None, STATUS.get(status, -1), message, counts,
        (start, run.t), trail, run.finite,
    )  # fmt: skip
    return solution, run.failure, raised


def _make(
    solver: Any, rates: Any, forcing: Forcing, nodes: Sequence[float], options: dict[str, Any], t: float, x: Array,
    end: float,
) -> Any:  # fmt: skip
    """A solver from a state to the next node."""
    k = [*nodes].index(end, 1)
    forcing.enter(nodes[k - 1], nodes[k])
    if options.get("first_step") is not None:
        options = {**options, "first_step": min(options["first_step"], abs(end - t))}
    if callable(jac := options.get("jac")):
        # both the function and the solver may change the state that they are given
        options = {**options, "jac": lambda t, x: jac(t, x.copy())}
    made = solver(rates, t, x.copy(), end, **options)
    if np.isnan(getattr(made, "h_abs", 0.0)):  # with atol = 0 and a state of 0; SciPy would divide it for ever
        options = {**options, "first_step": min(abs(end - t), options.get("max_step", np.inf))}
        made = solver(rates, t, x.copy(), end, **options)
    return made


def require_one(rtol: Any) -> float:
    """A relative tolerance as compiled methods take it, or a UsageError."""
    if not isinstance(rtol, float):
        raise ill_shaped(f"rtol must be one number for a compiled method, not of shape {rtol.shape}")
    return rtol


def require_end(solution: Solution, end: float) -> None:
    """Refuse a run that tells of its end without having come there; no run may end early in silence."""
    if solution.status == 0 and solution.ends[1] != end:
        raise SimulationError(
            f"the integrator reports the end, t = {end:.6g} s, but stopped at t = {solution.ends[1]:.6g} s; this is "
            "a fault of the integrator (of eomgen, unless the method is your own); run in parts, or use another method"
        )


# -- trajectories ------------------------------------------------------------------------------------------------------


PLAIN = frozenset((float,))  #: types of options that nobody changes afterwards


def record(
    module: BoundModel,
    forcing: Forcing,
    solution: Solution,
    method: str,
    options: dict[str, Any],
    event_names: Sequence[str] = (),
    again: Callable[[], Trajectory] | None = None,
) -> Trajectory:
    """Project the solution and put the trajectory together; ``again`` makes the same run with dense output.

    Raises
    ------
    ProjectionError
        A stored state cannot be brought onto the constraints.
    """
    residuals, x = project(module, solution.t, solution.x, forcing)
    described: Callable[[], dict[str, Any]] = partial(_described, module, forcing, options)
    result = solution[5:9]  # status, message, counts and ends: not the states before projection, which take much memory
    header: Any = partial(header_of, module.layout, method, options, event_names, residuals, *result)
    varies = bool(forcing.values)
    if varies or not PLAIN.issuperset(map(type, options.values())):  # the user may change them
        described, header = described().copy, header()
    walked = (solution.t, x) if solution.steps is None else solution.steps

    def steps() -> tuple[Array, Array, Array]:
        return *walked, forcing.sample(*walked)

    sampled = forcing.sample(solution.t, x) if varies else partial(forcing.sample, solution.t, x)
    columns = Columns(module, solution.t, x, sampled, None if solution.steps is None else steps)
    events: list[Array] = []
    if solution.t_events:
        happened = zip(solution.t_events, solution.x_events, strict=True)
        events += [project(module, t, result, forcing)[1] for t, result in happened]
    sample: Callable[[Array], Trajectory] | None = None
    if (dense := solution.dense) is not None:

        def sample(t: Array) -> Trajectory:
            result, states = project(module, t, dense(t), forcing)
            head = described() | (header() if callable(header) else header) | {"residuals": result}
            return Trajectory(t, states, Columns(module, t, states, forcing.sample(t, states), steps), head)

    return Trajectory(solution.t, x, columns, header, solution.t_events, events, sample, described, again)


def header_of(
    layout: Any, title: Any, options: Any, names: Any, residuals: Any, status: int, message: str, counts: Any, ends: Any
) -> dict[str, Any]:  # fmt: skip
    """What a trajectory tells of its run."""
    return {
        "method": title, "rtol": _plain(options.get("rtol")), "atol": _plain(options.get("atol")), "span": list(ends),
        "status": status, "message": message, **counts, "residuals": residuals, "event_names": list(names),
        "units": units_of_layout(layout),
    }  # fmt: skip


def _described(module: BoundModel, forcing: Forcing, options: dict[str, Any]) -> dict[str, Any]:
    """The model, options and inputs as they were given."""
    from ..identity import inputs_of, plain

    raw = {name: plain(value) for name, value in options.items() if name != "jac"}
    return {**describe(module), "options": raw, "inputs": inputs_of(module, forcing)}


def _plain(value: Any) -> Any:
    return None if value is None else np.asarray(value).tolist()


# -- limits of joints --------------------------------------------------------------------------------------------------


LISTED = 4  #: limits that a warning names


class LimitWarning(UserWarning):
    """A run passed a limit of a joint, at which nothing stops it."""


def passed_limits(trajectory: Trajectory, layout: Layout, rtol: float, atol: float) -> list[str]:
    """What a run passes: each limit of position or speed, when first and how far.

    A coordinate that rests at its limit may be beyond it by what the tolerances of the run leave of it.
    """
    result: list[str] = []
    for name, limits in layout.limits.items() if layout.info.limits_told else ():
        for key in ("lower", "upper", "velocity"):
            limit = limits.get(key)
            column = name if key != "velocity" else f"{name}_dot"
            if limit is None or not np.isfinite(limit) or column not in trajectory:
                continue
            values = trajectory[column]
            beyond = limit - values if key == "lower" else (np.abs(values) if key == "velocity" else values) - limit
            passed = np.flatnonzero(beyond > 10.0 * (atol + rtol * (1.0 + abs(limit))))
            if passed.size:
                first, worst = int(passed[0]), int(np.nanargmax(beyond))
                result.append(f"{column} {key} {limit:g} at t = {trajectory.t[first]:.4g} s (to {values[worst]:.4g})")
    return result


def warn_of_limits(trajectory: Trajectory, layout: Layout, rtol: float, atol: float) -> None:
    """Tell the line of the user's that called of limits that a run passes."""
    passed = [] if is_inner_run() else passed_limits(trajectory, layout, rtol, atol)
    if passed:
        more = f", and {len(passed) - LISTED} more" if len(passed) > LISTED else ""
        warnings.warn(
            f"the run passes limits of joints: {'; '.join(passed[:LISTED])}{more}. Joint limits are not enforced: load "
            "a robot with limits='stop', or add forces of type stop to a model; limits: off turns this warning off",
            LimitWarning,
            stacklevel=calls_within() + 1,
        )
