"""Simulation: what an integrator found -> Trajectory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..runtime.columns import Columns, describe, project, units_of_layout
from ..runtime.signals import Forcing
from ..runtime.trajectory import Trajectory
from .integrate import Solution

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

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
    header: Any = partial(_header, module.layout, method, options, event_names, residuals, *found)
    varies = bool(forcing.values)
    if varies or not PLAIN.issuperset(map(type, options.values())):  # the user may change them
        described, header = described().copy, header()
    steps: Callable[[], tuple[Array, Array, Array]] | None = None
    if solution.steps is not None:
        walked = solution.steps
        steps = lambda: (*walked, forcing.sample(*walked))  # noqa: E731
    sampled = forcing.sample(solution.t, x) if varies else partial(forcing.sample, solution.t, x)
    columns = Columns(module, solution.t, x, sampled, steps)
    events: list[Array] = []
    if solution.t_events:
        happened = zip(solution.t_events, solution.x_events, strict=True)
        events += [project(module, t, found, forcing)[1] for t, found in happened]
    sample: Callable[[Array], Trajectory] | None = None
    if (dense := solution.dense) is not None:

        def sample(t: Array) -> Trajectory:
            found, states = project(module, t, dense(t), forcing)
            head = described() | (header() if callable(header) else header) | {"residuals": found}
            return Trajectory(t, states, Columns(module, t, states, forcing.sample(t, states)), head)

    return Trajectory(solution.t, x, columns, header, solution.t_events, events, sample, described, again)


def _header(
    layout: Any, title: str, options: Any, names: Any, residuals: Any, status: int, message: str, counts: Any, ends: Any
) -> dict[str, Any]:  # fmt: skip
    """What a trajectory tells of its run."""
    return {
        "method": title, "rtol": _plain(options.get("rtol")), "atol": _plain(options.get("atol")), "span": list(ends),
        "status": status, "message": message, **counts, "residuals": residuals, "event_names": list(names),
        "units": units_of_layout(layout),
    }  # fmt: skip


def _described(module: BoundModel, forcing: Forcing, options: dict[str, Any]) -> dict[str, Any]:
    """The model, options and inputs as they were given."""
    from ..runtime.origin import inputs_of, plain

    given = {name: plain(value) for name, value in options.items() if name != "jac"}
    return {**describe(module), "options": given, "inputs": inputs_of(module, forcing)}


def _plain(value: Any) -> Any:
    return None if value is None else np.asarray(value).tolist()
