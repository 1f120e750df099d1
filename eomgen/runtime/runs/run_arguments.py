"""What a user asks of a run -> its span, times, tolerances, method, step and first state."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from math import inf, isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ...base import algebra
from ...base.algebra import Array
from ...base.limits.constraints import ALIKE
from ...base.limits.runs import ATOL, LEAST_RTOL, RTOL, SUNK
from ...base.texts import quote
from ...errors import (
    AssemblyError,
    EvaluationError,
    calls_within,
    cannot,
    ill_shaped,
    ill_typed,
    incomplete,
    no_choice,
    no_number,
    off_range,
)
from ..argument_checks import (
    as_real,
    read_flag,
    read_number,
    read_numbers,
    read_times,
    require_steps,
    unknown,
)
from ..initial import Initial
from ..inputs import Forcing
from ..trajectory import Span, Start, last_state
from .events import at_next_samples, is_inner_run
from .integrate import NAMES, require_one

if TYPE_CHECKING:
    from ..bound_model import BoundModel
    from ..inputs import Forcing
    from ..layout import Layout

# -- states that fit inputs --------------------------------------------------------------------------------------------


#: Assemblies in turn, by secant steps, with inputs that depend on the state.
ROUNDS = 50


def assemble_with_inputs(layout: Layout, forcing: Forcing, t: float, assembled: Callable[[Array], Array]) -> Array:
    """The state (n_x,) that is ``assembled(u)`` with the inputs u (n_u,) that it gives itself."""
    places = layout.constraint_inputs

    def assemble(u: Array) -> tuple[Array, Array]:
        """The state at inputs u, and the inputs at this state."""
        x = assembled(u)
        result = forcing(t, x)
        forcing.require_finite()
        return x, result

    u = forcing(t, np.concatenate([layout.q_reference, np.zeros(layout.n_v)]))
    forcing.require_finite()
    secant, before = -np.eye(len(places)), None  # with this first guess of the slope a step takes what was found
    for _ in range(ROUNDS):
        x, result = assemble(u)
        gap = (result - u)[places]
        if np.all(np.abs(gap) <= ALIKE * (1.0 + np.abs(u[places]))):
            return x
        if before is not None:  # Broyden's update: the slope that explains the last step
            move, change = before
            secant += np.outer(gap - change - secant @ move, move) / (move @ move)
        move = algebra.lstsq(secant, -gap, rcond=None)
        if not np.isfinite(move).all() or not move.any():
            break
        before, u = (move, gap), result.copy()
        u[places] = result[places] - gap + move
    names = ", ".join(layout.u[i] for i in places)
    raw, gives = (", ".join(f"{value:.6g}" for value in values[places]) for values in (u, forcing(t, x)))
    raise AssemblyError(
        f"the inputs {names} depend on the state, and no state that satisfies them and the constraints was found at "
        f"t = {t:.6g} s: the last state was assembled with {raw}, but there the inputs are {gives}; "
        "give initial values nearer to such a state, or write the inputs in t",
        [],
        code="EG-CONTRADICTION",
    )


# -- tolerances and limits of steps ------------------------------------------------------------------------------------


IMPLICIT = ("jac", "jac_sparsity")  #: options of SciPy's implicit methods: the Jacobian, if not the model's own


def check_tolerances(n: int, span: float, options: Mapping[str, Any]) -> dict[str, Any]:
    """The options with every tolerance and limit checked, for n states and a run of ``span`` seconds.

    rtol and atol are a float or (n,), rtol at least 100 times the spacing of floating-point numbers; steps are floats,
    those that are None left out.  Other options are left as they are.
    """
    checked = {name: value for name, value in options.items() if value is not None or not name.endswith("_step")}
    for name in ("rtol", "atol"):
        if name in checked:
            checked[name] = _tolerance(name, checked[name], n)
    if "rtol" in checked:
        rtol = checked["rtol"]
        checked["rtol"] = max(rtol, LEAST_RTOL) if isinstance(rtol, float) else np.maximum(rtol, LEAST_RTOL)
    for name in ("max_step", "first_step"):
        if name in checked:
            checked[name] = check_step(name, checked[name])
    if "vectorized" in checked:
        checked["vectorized"] = read_flag("vectorized", checked["vectorized"])
    if "min_step" in checked:
        checked["min_step"] = read_number("min_step", checked["min_step"])
        if checked["min_step"] < 0.0:
            raise off_range(f"min_step must not be negative, not {checked['min_step']:.6g}")
    check_first_step(checked, span)
    return checked


def check_first_step(options: Mapping[str, Any], span: float) -> None:
    """Refuse a first step that is longer than the run (s)."""
    if options.get("first_step", 0.0) > span:
        raise off_range(f"first_step must not exceed the span of {span:.6g} s, not {options['first_step']:.6g}")


def _tolerance(name: str, raw: Any, n: int) -> Any:
    if type(raw) is float and 0.0 <= raw < np.inf:
        return raw
    values = as_real(read_number(name, raw) if isinstance(raw, str) else raw)
    if values is None:
        raise no_number(f"{name} must be a number, or one for each of the {n} states, not {quote(raw)}")
    if values.shape not in ((), (n,)):
        raise ill_shaped(f"{name} must be a number or have shape ({n},), one for each state, not {values.shape}")
    if not (np.isfinite(values).all() and (values >= 0.0).all()):
        raise off_range(f"{name} must not be negative and must be finite, not {quote(raw)}")
    return values if values.ndim else float(values)


def check_step(name: str, raw: Any) -> float:
    """A length of steps (s), or a UsageError that names it."""
    if type(raw) is float and 0.0 < raw < np.inf:
        return raw
    result = as_real(read_number(name, raw) if isinstance(raw, str) else raw)
    if result is None or result.ndim:
        raise no_number(f"{name} must be a number of seconds, not {quote(raw)}")
    value = float(result)
    if not value > 0.0 or (name == "first_step" and not np.isfinite(value)):
        raise off_range(f"{name} must be greater than 0 s{' and finite' * (name == 'first_step')}, not {raw}")
    return value


# -- the module's own steppers -----------------------------------------------------------------------------------------


STEPS = ("rtol", "atol", "max_step", "first_step")


def can_run(module: BoundModel, method: Any, forcing: Forcing) -> bool:
    """Whether a run needs nothing but the module's own steppers."""
    core: Any = module.core
    there = isinstance(method, str) and method in core.methods
    if isinstance(method, str) and method == "Taylor":
        if not there:
            raise cannot(no_series(module))
        if not forcing.stepwise:
            raise cannot(
                "method Taylor takes only inputs that are constant between corners: numbers, and tables with "
                'interpolation "zero-order"; for other inputs use DOP853'
            )
    return there and not forcing.foreign


def no_series(module: BoundModel) -> str:
    """Why a module has no Taylor method."""
    why = module.info.no_series
    return (
        f"{module.name} has no Taylor series: {why}; the method works for open chains of bodies whose equations are "
        "smooth and not too long; use DOP853"
    )


def stepper_options(n: int, options: Mapping[str, Any]) -> dict[str, Any]:
    """Checked tolerances and limits of steps as steppers of n states take them."""
    limits = {"max_step": options.get("max_step", inf), "first_step": options.get("first_step", 0.0)}
    atol = np.empty(n)
    atol[:] = options["atol"]
    return {"rtol": require_one(options["rtol"]), "atol": atol, **limits}


# -- span, times, method, first state ----------------------------------------------------------------------------------


PLAIN = frozenset((float, int))
STIFF = ("Radau", "BDF", "LSODA")  #: implicit methods
HUGE = 1e300  #: less than the largest number
DEFAULTS = {"method": "DOP853", "rtol": RTOL, "atol": ATOL, "end": 10.0}


def find_span(span: Span, declared: float) -> tuple[float, float]:
    """Start and end (s) of what a user gives as the span of a run."""
    if span is None or (type(span) is float and isfinite(span)):
        return 0.0, declared if span is None else span
    ends: Any = span
    if isinstance(ends, (tuple, list)):
        start, end = ends if len(ends) == 2 else (HUGE, HUGE)
        if type(start) in PLAIN and type(end) in PLAIN and abs(start) < HUGE > abs(end):
            return float(start), float(end)
        what = "span must be (start, end) in seconds: an end"
        ends = [read_number(what, end) if isinstance(end, str) else end for end in ends]
    pair = as_real(ends)
    if isinstance(span, str) or (pair is not None and not pair.ndim):
        return 0.0, read_number("the end of the span", span)
    if pair is None or pair.shape != (2,) or not np.isfinite(pair).all():
        raise ill_typed(f"span must be (start, end) in seconds, not {quote(span)}; t_eval= chooses times to keep")
    return float(pair[0]), float(pair[1])


def declare(module: BoundModel) -> dict[str, Any]:
    """What holds for a run where nothing is said: what the model says, or the defaults."""
    return {**DEFAULTS, **{k: v for k, v in module.info.simulation.items() if v is not None}}


def set_up(
    module: BoundModel, span: Span, parameters: Any, inputs: Mapping[str, Any] | None
) -> tuple[BoundModel, Forcing, float, float]:
    """The module with the values of a run bound, its inputs over time, start and end (s)."""
    forcing = Forcing(module.layout, inputs)
    start, end = find_span(span, float(declare(module)["end"]))
    bound = module.bind(parameters, forcing.constants or None)
    forcing.attach(bound)
    return bound, forcing, start, end


def longest_step(module: BoundModel, method: Any) -> dict[str, float]:
    """The model's own ``max_step`` (s), which implicit methods do not need; empty without."""
    declared = module.info.simulation.get("max_step")
    return {} if declared is None or (isinstance(method, str) and method in STIFF) else {"max_step": declared}


def declared_step(module: BoundModel, method: Any, step: Any) -> tuple[Any, Any]:
    """Method and step of a run: the model's own where it has steps of one size and nothing else is given."""
    size, named = map(module.info.simulation.get, ("step", "method"))
    if size is None or not module.layout.n_dof or not (method is None or (isinstance(method, str) and method == named)):
        return method, step
    return named, size if step is None else step


def check_method(method: Any, step: Any) -> float | None:
    """The size of the steps of RK4 (s), or None for another method; a UsageError if they do not go together."""
    if method is not None and not isinstance(method, (str, type)):
        raise no_choice(f"method must be a name or a subclass of OdeSolver, not {quote(method)}")
    if isinstance(method, str) and method not in NAMES:
        raise unknown("method", method, NAMES)
    if (isinstance(method, str) and method == "RK4") != (step is not None):
        raise incomplete("method RK4 needs step=, the size of its steps (s), and no other method takes it but moreau")
    return None if step is None else check_step("step", step)


def steps_of(
    module: BoundModel, span: tuple[float, float], method: str, step: Any, options: Mapping[str, Any]
) -> dict[str, Any]:
    """Tolerances and limits of the steps of many runs, checked: those given, else the model's own."""
    size, declared = check_method(method, step), declare(module)
    if size is not None:
        require_steps("step", size, *span)
        options = {**options, "max_step": size, "first_step": size}
    raw = {name: value for name, value in options.items() if value is not None}
    wanted = {name: declared[name] for name in ("rtol", "atol")} | longest_step(module, method)
    result = check_tolerances(module.n_x, abs(span[1] - span[0]), wanted | raw)
    require_steps("max_step", float(result.get("max_step", np.inf)), *span)
    return result


def ordered_times(t_eval: ArrayLike, start: float, end: float, n: int = 1) -> Array:
    """The times wanted, in order and within the span, or a UsageError; n numbers are kept for each."""
    times = read_times("t_eval", t_eval, 1 + n)
    first, last = (0, -1) if end >= start else (-1, 0)
    if (
        times.ndim != 1
        or not times.size
        or not min(start, end) <= times[first] <= times[last] <= max(start, end)
        or not (times[1:] > times[:-1] if end >= start else times[1:] < times[:-1]).all()
    ):
        raise off_range(f"t_eval must be times in order within the span ({start:.6g}, {end:.6g})")
    return times


def find_state(module: BoundModel, initial: Start, t: float, forcing: Forcing | None = None) -> Array:
    """The state (n_x,) of what a user gives as initial: named values, or a state (a run: its last), which is projected.

    Raises
    ------
    AssemblyError
        The loops do not close, or the inputs on which they depend change with the state that they give.
    """
    if module.info.clocks or module.layout.switches:
        span = None if forcing is None else forcing.span
        return at_next_samples(module, t, _find_state(module, initial, t, forcing), span, initial)
    return _find_state(module, initial, t, forcing)


def _find_state(module: BoundModel, initial: Start, t: float, forcing: Forcing | None) -> Array:
    if forcing is not None and forcing.constrained:
        return assemble_with_inputs(
            module.layout, forcing, t, lambda u: _find_state(module.bind(None, u), initial, t, None)
        )
    if initial is None:
        return module.x0(t=t) if t else module._declared_start.copy()
    if isinstance(initial, Mapping):
        return module.x0(initial, t=t)
    x = np.array(read_numbers("initial", last_state(initial, module.x_names)))
    if x.shape != (module.n_x,):
        names = ", ".join(module.x_names)
        raise ill_shaped(f"initial must name values or have shape ({module.n_x},) [{names}], not {x.shape}")
    x = module.project(x, t=t)
    if module.layout.rank:
        Initial(module.kernels, t).on_branch(x[: module.n_q], x[module.n_q :], module.layout.v)
    return x


# -- shapes that are deep in each other at the start -------------------------------------------------------------------


class PenetrationWarning(UserWarning):
    """A run starts with shapes of contacts deep in each other, which stiff contacts drive apart at high speed."""


def deep_start(module: BoundModel, t: float, x: Array, u: Any) -> str | None:
    """The two shapes of contacts between groups that are deepest in each other, if they are deeper than they should."""
    if "meeting_time" not in module.kernels.core.names:
        return None
    q, v = np.array(x[: module.n_q]), np.array(x[module.n_q :])
    try:
        result = module.kernels.meeting_time(q, v, np.zeros_like(v), u=u, t=t)
    except EvaluationError:
        return None  # the run tells of it
    _, depth, thickness, first, second = (float(number) for number in result)
    if depth <= SUNK * thickness:
        return None
    (name, one), (_, other) = (module.info.contact_shapes[int(k)] for k in (first, second))
    return f"contacts {name!r}: {one} and {other} are {depth:.3g} m deep in each other"


def warn_of_depth(module: BoundModel, t: float, x: Array, u: Any) -> None:
    """Tell the line of the user's that called of a start inside each other."""
    result = None if is_inner_run() else deep_start(module, t, x, u)
    if result is not None:
        warnings.warn(
            f"{module.name} starts with shapes inside each other; {result}. Stiff contacts drive them apart at once, "
            "and a bed of soil carries shapes deep in it as if they had sunk there: change the initial values, or put "
            "only shapes that are apart into groups",
            PenetrationWarning,
            stacklevel=calls_within() + 1,
        )
