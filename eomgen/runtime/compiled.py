"""Stage runtime: right-hand side, corners of the inputs -> times and states, through the module's own steppers.

The whole loop runs in C; Python looks in every few milliseconds, for the progress line and for an interrupt.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UsageError
from ..numeric.scales import Array
from .integrate import Joined, Solution
from .names import check_names
from .signals import Forcing, Table
from .tolerances import check_tolerances

if TYPE_CHECKING:
    from .module import Module
    from .progress import Progress

OPTIONS = ("rtol", "atol", "max_step", "first_step")
PATIENCE = 0.02  #: seconds in C before Python looks in
TOO_SMALL = "Required step size is less than spacing between numbers."


def can_run(module: Module, method: Any, forcing: Forcing, events: Sequence[Any]) -> bool:
    """Whether a run needs nothing but the module's own steppers."""
    return method in getattr(module.core, "methods", ()) and not forcing.feedback and not events


def stepper_options(n: int, span: float, options: Mapping[str, Any]) -> dict[str, Any]:
    """Tolerances and step limits as steppers take them.

    Parameters
    ----------
    n : int
        Number of states.
    span : float
        Length of the run (s), the longest first step.
    options : mapping
        rtol, atol (a number or n of them), max_step, first_step.

    Raises
    ------
    UsageError
        An unknown option or a value that cannot be.
    """
    check_names("option of simulate", options, OPTIONS)
    checked = check_tolerances(n, span, {"rtol": 1e-3, "atol": 1e-6, **options})
    if not isinstance(checked["rtol"], float):
        raise UsageError(f"rtol must be one number for a compiled method, not of shape {checked['rtol'].shape}")
    limits = {"max_step": checked.get("max_step", np.inf), "first_step": checked.get("first_step", 0.0)}
    return {"rtol": checked["rtol"], "atol": np.broadcast_to(checked["atol"], (n,)).copy(), **limits}


def integrate_compiled(
    module: Module,
    forcing: Forcing,
    nodes: Sequence[float],
    x0: Array,
    method: str,
    t_eval: Array | None,
    dense: bool,
    options: dict[str, Any],
    watch: Progress | None,
) -> tuple[Solution, tuple[int, float, Array] | None]:
    """Integrate over the parts between `nodes` (start, corners, end); also the last evaluation that failed."""
    core: Any = module.core  # one with steppers
    context = module.kernels.context
    signals = [(i, 1, s.times, s.values) for i, s in forcing.varying.items() if isinstance(s, Table)]
    settings = stepper_options(len(x0), abs(nodes[-1] - nodes[0]), options)
    times, states = [], []
    pieces: list[Callable[[Array], Array]] = []
    failure = None
    evaluations, status, x = 0, 1, x0
    if t_eval is None:
        times.append(np.array([nodes[0]]))
        states.append(x0[None])
    reached = nodes[0]
    for start, end in pairwise(nodes):
        first = {**settings, "first_step": min(settings["first_step"], abs(end - start))}
        stepper = core.stepper(method, context, start, x, end, signals=signals, closed=True, **first)
        asked = None if t_eval is None else _part(t_eval, start, end, end == nodes[-1])
        if asked is not None and asked.size and asked[0] == start:
            times.append(asked[:1])
            states.append(np.array(x)[None])
            asked = asked[1:]
        status, steps, done = 0, 1 if dense else 64, 0
        while status == 0:
            begun = perf_counter()
            status, t, rows = stepper.advance(steps, asked, done)
            done += len(t)
            times.append(t)
            states.append(rows)
            if dense and status >= 0 and stepper.t != stepper.t_old:
                pieces.append(stepper.interpolant())
            elif perf_counter() - begun < PATIENCE:
                steps = min(2 * steps, 100_000)
            if watch is not None:
                watch.look(stepper.t)
        evaluations += stepper.evaluations
        failure = stepper.failure or failure
        reached, x = stepper.t, stepper.state()
        if status < 0:
            break
    t_all = np.concatenate(times) if times else np.empty(0)
    x_all = np.ascontiguousarray(np.concatenate(states).T) if states else np.empty((len(x0), 0))
    ends = [piece.t for piece in pieces[:-1]]  # type: ignore[attr-defined]
    return Solution(
        t_all,
        x_all,
        [],
        [],
        Joined(pieces, ends) if pieces else None,
        0 if status == 1 else -1,
        "The solver successfully reached the end of the integration interval." if status == 1 else TOO_SMALL,
        {"nfev": evaluations, "njev": 0, "nlu": 0},
        (nodes[0], reached),
    ), failure


def _part(t_eval: Array, start: float, end: float, last: bool) -> Array:
    """Those of the times from start to before end, the end itself in the last part."""
    sign = 1.0 if end >= start else -1.0
    ahead = sign * (t_eval - start) >= 0.0
    before = sign * (end - t_eval) >= 0.0 if last else sign * (end - t_eval) > 0.0
    return np.asarray(t_eval[ahead & before])
