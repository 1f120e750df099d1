"""Simulation: right-hand side, corners of the inputs -> times and states, through the module's own steppers.

The whole loop runs in C, events and inputs included; Python looks in every few milliseconds, for the progress line and
for an interrupt.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.runs import SCIPY_ATOL, SCIPY_RTOL
from ..errors import cannot, ill_shaped
from ..runtime.inputs import Forcing
from ..runtime.near_names import check_names
from .events import Events, warn_of_unknown
from .integrate import KEPT, Solution
from .integrate import MESSAGES as WORDS
from .run_arguments import check_tolerances

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from .progress import Progress

OPTIONS = ("rtol", "atol", "max_step", "first_step")
ENDED, TERMINAL, WAITING, ZENO, STOPPED, RESET_FAILED = 1, 2, 3, -102, -101, -103  #: as in eomgen_loop.h
STATUS = {ENDED: 0, TERMINAL: 1}  #: SciPy's
TOO_SMALL = "Required step size is less than spacing between numbers."
MESSAGES = {
    ENDED: WORDS[0],
    TERMINAL: WORDS[1],
    STOPPED: "The run was interrupted.",
    RESET_FAILED: "The state after an event cannot be evaluated, or cannot be brought onto the constraints.",
}


def can_run(module: BoundModel, method: Any, forcing: Forcing) -> bool:
    """Whether a run needs nothing but the module's own steppers.

    Raises
    ------
    UsageError
        Method Taylor where it cannot be: nobody else has it.
    """
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
    why = module.metadata.get("no_series", "its module was compiled without one, as with target='numpy'")
    return (
        f"{module.name} has no Taylor series: {why}; the method works for open chains of bodies whose equations are "
        "smooth and not too long; use DOP853"
    )


def stepper_options(n: int, span: float, options: Mapping[str, Any], checked: bool = False) -> dict[str, Any]:
    """Tolerances and step limits as steppers take them.

    Parameters
    ----------
    n : int
        Number of states.
    span : float
        Length of the run (s), the longest first step.
    options : mapping
        rtol, atol (a number or n of them), max_step, first_step.
    checked : bool
        Whether they have been checked and completed already.

    Raises
    ------
    UsageError
        An unknown option or a value that cannot be.
    """
    check_names("option of simulate", options, OPTIONS)
    given = options if checked else check_tolerances(n, span, {"rtol": SCIPY_RTOL, "atol": SCIPY_ATOL, **options})
    limits = {"max_step": given.get("max_step", inf), "first_step": given.get("first_step", 0.0)}
    atol = np.empty(n)
    atol[:] = given["atol"]
    return {"rtol": require_one(given["rtol"]), "atol": atol, **limits}


def require_one(rtol: Any) -> float:
    """A relative tolerance as compiled methods take it, or a UsageError."""
    if not isinstance(rtol, float):
        raise ill_shaped(f"rtol must be one number for a compiled method, not of shape {rtol.shape}")
    return rtol


def integrate_compiled(
    module: BoundModel,
    forcing: Forcing,
    nodes: Sequence[float],
    x0: Array,
    method: str,
    t_eval: Array | None,
    dense: bool,
    options: dict[str, Any],
    watch: Progress | None,
    look: Callable[[float, Array, int], None] | None = None,
    events: Events | None = None,
) -> tuple[Solution, tuple[int, float, Array] | None, BaseException | None]:
    """Integrate from the first of the `nodes` to the last, not stepping over the others (corners of the inputs).

    Returns
    -------
    Solution
    (status, t, x) or None
        The last evaluation that failed.
    exception or None
        What stopped the run from outside: an interrupt, a function of the user's, or steps that lead nowhere.
    """
    core: Any = module.core  # one with steppers
    start, end = nodes[0], nodes[-1]
    events = events if events is not None and len(events) else None
    plan = {
        "nodes": nodes[1:], "t_eval": t_eval, "dense": dense, "events": events.encode() if events else None,
        "trail": KEPT if module.layout.rank else 0,
        "watch": None if watch is None else watch.look,
        "stall_check": look,
    }  # fmt: skip
    steps = require_one(options["rtol"]), options["atol"], options.get("max_step", inf), options.get("first_step", 0.0)
    journey = core.journey(method, module.kernels.context, start, x0, end, *steps, forcing.encode(), plan)
    status = journey.travel()
    while status in (WAITING, RESET_FAILED) and events is not None:
        k = next((k for k, node in enumerate(nodes[1:-1]) if (node - journey.t) * (end - start) >= 0.0), len(nodes) - 2)
        forcing.enter(nodes[k], nodes[k + 1])  # as the compiled loop has it
        after = events.reset(module, forcing, journey.t, journey.state(), journey.fired())
        if status == RESET_FAILED:  # in C; here it fails too as a rule, and tells why
            break
        status = journey.jump(after) or journey.travel()
    if forcing:
        forcing.enter(start, end)  # who asks for inputs from here on asks for those of the whole run
    times, states, notes = journey.outcome()
    if events is not None and journey.raised is None:
        warn_of_unknown([events.names[i] for i in journey.unknown()])
    if status == ZENO and events is not None:
        raise events.crowded(journey.t, journey.resets)
    t_events, x_events = [], []
    if events is not None:
        which = notes[:, 0]
        t_events = [notes[which == i, 1] for i in range(len(events))]
        x_events = [np.ascontiguousarray(notes[which == i, 2:].T) for i in range(len(events))]
    counts = {"nfev": journey.evaluations, "njev": journey.differentiations, "nlu": journey.factorizations}
    trail = None if (trail := journey.trail()) is None else (trail[:, 0], np.ascontiguousarray(trail[:, 1:].T))
    solution = Solution(
        times, states, t_events, x_events, journey.dense() if dense else None, STATUS.get(status, -1),
        MESSAGES.get(status, TOO_SMALL), counts, (start, journey.t), trail, journey.finite,
    )  # fmt: skip
    return solution, journey.failure, journey.raised
