"""When shapes of contacts meet -> steps that pass over none, and a warning where they start deep inside."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.runs import SUNK, UNHURRIED
from ..errors import EvaluationError, calls_within
from .events import is_told_by_the_caller

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from .bound_run import Run


class PenetrationWarning(UserWarning):
    """A run starts with shapes of contacts deep in each other, which stiff contacts drive apart at high speed."""


def deep_start(module: BoundModel, t: float, x: Array, u: Any) -> str | None:
    """The two shapes of contacts between groups that are deepest in each other, if they are deeper than they should."""
    if "meeting_time" not in module.kernels.core.names:
        return None
    q, v = np.array(x[: module.n_q]), np.array(x[module.n_q :])
    try:
        found = module.kernels.motion("meeting_time")(q, v, np.zeros_like(v), u=u, t=t)
    except EvaluationError:
        return None  # the run tells of it
    _, depth, thickness, first, second = (float(number) for number in found)
    if depth <= SUNK * thickness:
        return None
    (name, one), (_, other) = (module.metadata["contact_shapes"][int(k)] for k in (first, second))
    return f"contacts {name!r}: {one} and {other} are {depth:.3g} m deep in each other"


def warn_of_depth(module: BoundModel, t: float, x: Array, u: Any) -> None:
    """Tell the line of the user's that called of a start inside each other."""
    found = None if is_told_by_the_caller() else deep_start(module, t, x, u)
    if found is not None:
        warnings.warn(
            f"{module.name} starts with shapes inside each other; {found}. Stiff contacts drive them apart at once, "
            "and a bed of soil bears what is deep in it as if it had sunk there: change the initial values, or put "
            "only shapes into groups that are apart",
            PenetrationWarning,
            stacklevel=calls_within() + 1,
        )


def begin(run: Run, solver: Any, span: tuple[float, float], x: Array) -> Any:
    """What a run with contacts begins with: a warning, and its solver with steps that pass over none; None for None."""
    start, end = span
    warn_of_depth(run.module, start, x, run.forcing(start, x) if run.forcing else None)
    return None if solver is None else limited(run, solver, end >= start)


def limited(run: Run, solver: Any, forward: bool) -> Any:
    """The class of one of SciPy's solvers with steps that pass over no contact, or itself without contacts of groups.

    More numbers may follow the state.  The end of the solver's interval is what every method keeps to: some read the
    longest step only where they begin.  Backwards in time velocities are opposite, accelerations are not.
    """
    module, kernels = run.module, run.module.kernels
    if "meeting_time" not in kernels.core.names:
        return solver
    n_q, n_x, way = module.n_q, module.n_x, 1.0 if forward else -1.0
    meeting = kernels.motion("meeting_time")

    def longest(t: float, x: Array, rates: Any) -> float:
        state = np.array(x[:n_x])
        u = run.forcing(t, state) if run.forcing else None
        change = run.kernel(t, state, u=u) if rates is None else np.array(rates[:n_x])
        try:
            found = float(meeting(state[:n_q], way * state[n_q:], change[n_q:], u=u, t=t)[0])
        except EvaluationError:
            return np.inf
        return max(found, UNHURRIED * 10.0 * float(np.spacing(abs(t))))

    class Limited(solver):  # type: ignore[misc]
        """The solver."""

        status: str

        def step(self) -> Any:
            end = self.t_bound
            size = longest(float(self.t), self.y, getattr(self, "f", None))
            if size < abs(end - self.t):
                _set_bound(self, self.t + way * size)
            message = super().step()
            if self.t_bound != end:
                _set_bound(self, end)
                if self.status == "finished" and self.t != end:
                    self.status = "running"
            return message

    Limited.__name__, Limited.__qualname__, Limited.__module__ = solver.__name__, solver.__qualname__, solver.__module__
    return Limited


def _set_bound(solver: Any, bound: float) -> None:
    """Where a solver must not go beyond; LSODA keeps a copy."""
    solver.t_bound = bound
    inner = getattr(getattr(solver, "_lsoda_solver", None), "_integrator", None)
    if inner is not None:
        inner.rwork[0] = bound
