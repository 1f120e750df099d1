"""Simulation: what a user asks of a run -> its span, times, method, step and first state."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..base.limits.runs import ATOL, RTOL
from ..base.texts import shown
from ..errors import ill_shaped, ill_typed, incomplete, no_choice, off_range
from ..runtime.given_start import Span, Start, last_state
from ..runtime.initial import Initial
from ..runtime.near_names import unknown
from ..runtime.room import as_real, read_number, read_numbers, read_times
from ..runtime.signals import Forcing
from .integrate import NAMES
from .tolerances import check_step

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

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
        raise ill_typed(f"span must be (start, end) in seconds, not {shown(span)}; t_eval= chooses times to keep")
    return float(pair[0]), float(pair[1])


def declare(module: BoundModel) -> dict[str, Any]:
    """What holds for a run where nothing is said: what the model says, or the defaults."""
    return {**DEFAULTS, **{k: v for k, v in module.metadata.get("simulation", {}).items() if v is not None}}


def longest_step(module: BoundModel, method: Any) -> dict[str, float]:
    """The model's own ``max_step`` (s), which implicit methods do not need; empty without."""
    own = module.metadata.get("simulation", {}).get("max_step")
    return {} if own is None or (isinstance(method, str) and method in STIFF) else {"max_step": own}


def own_step(module: BoundModel, method: Any, step: Any) -> tuple[Any, Any]:
    """Method and step of a run: the model's own where it has steps of one size and nothing else is given."""
    own, named = map(module.metadata.get("simulation", {}).get, ("step", "method"))
    if own is None or not module.layout.n_dof or not (method is None or (isinstance(method, str) and method == named)):
        return method, step
    return named, own if step is None else step


def check_method(method: Any, step: Any) -> float | None:
    """The size of the steps of RK4 (s), or None for another method; a UsageError if they do not go together."""
    if method is not None and not isinstance(method, (str, type)):
        raise no_choice(f"method must be a name or a subclass of OdeSolver, not {shown(method)}")
    if isinstance(method, str) and method not in NAMES:
        raise unknown("method", method, NAMES)
    if (isinstance(method, str) and method == "RK4") != (step is not None):
        raise incomplete("method RK4 needs step=, the size of its steps (s), and no other method takes it but moreau")
    return None if step is None else check_step("step", step)


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
    if module.metadata.get("clocks") or module.metadata.get("switched"):
        from .clocks import at_next_samples

        span = None if forcing is None else forcing.span
        return at_next_samples(module, t, _find_state(module, initial, t, forcing), span, initial)
    return _find_state(module, initial, t, forcing)


def _find_state(module: BoundModel, initial: Start, t: float, forcing: Forcing | None) -> Array:
    if forcing is not None and forcing.constrained:
        from .led_state import find_led_state

        return find_led_state(module.layout, forcing, t, lambda u: _find_state(module.bind(None, u), initial, t, None))
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
