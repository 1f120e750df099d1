"""What an integrator found -> Trajectory, with a warning where it passes limits of joints."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.algebra import Array
from ...errors import calls_within
from ..columns import Columns, describe, project, units_of_layout
from ..inputs import Forcing
from ..layout import Layout
from ..trajectory import Trajectory
from .events import is_told_by_the_caller
from .integrate import Solution

if TYPE_CHECKING:
    from ..bound_model import BoundModel


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
    found = solution[5:9]  # status, message, counts and ends: not the states before projection, which take much memory
    header: Any = partial(header_of, module.layout, method, options, event_names, residuals, *found)
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
        events += [project(module, t, found, forcing)[1] for t, found in happened]
    sample: Callable[[Array], Trajectory] | None = None
    if (dense := solution.dense) is not None:

        def sample(t: Array) -> Trajectory:
            found, states = project(module, t, dense(t), forcing)
            head = described() | (header() if callable(header) else header) | {"residuals": found}
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

    given = {name: plain(value) for name, value in options.items() if name != "jac"}
    return {**describe(module), "options": given, "inputs": inputs_of(module, forcing)}


def _plain(value: Any) -> Any:
    return None if value is None else np.asarray(value).tolist()


# -- limits of joints --------------------------------------------------------------------------------------------------


SHOWN = 4  #: limits that a warning names


class LimitWarning(UserWarning):
    """A run passed a limit of a joint, at which nothing stops it."""


def passed_limits(trajectory: Trajectory, layout: Layout, rtol: float, atol: float) -> list[str]:
    """What a run passes: each limit of position or speed, when first and how far.

    A coordinate that rests at its limit may be beyond it by what the tolerances of the run leave of it.
    """
    found: list[str] = []
    for name, limits in layout.limits.items() if layout.metadata.get("limits_told", True) else ():
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
                found.append(f"{column} {key} {limit:g} at t = {trajectory.t[first]:.4g} s (to {values[worst]:.4g})")
    return found


def warn_of_limits(trajectory: Trajectory, layout: Layout, rtol: float, atol: float) -> None:
    """Tell the line of the user's that called of limits that a run passes."""
    found = [] if is_told_by_the_caller() else passed_limits(trajectory, layout, rtol, atol)
    if found:
        more = f", and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
        warnings.warn(
            f"the run passes limits of joints: {'; '.join(found[:SHOWN])}{more}. Limits alone stop nothing: load a "
            "robot with limits='stop', or add forces of type stop to a model; limits: off turns this warning off",
            LimitWarning,
            stacklevel=calls_within() + 1,
        )
