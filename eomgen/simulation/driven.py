"""A Module that drivers move entirely -> Trajectory over a span of time, without integration or forces."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..errors import SimulationError, cannot, no_such
from ..numeric.roots import find_root
from ..runtime.inputs import Forcing
from ..runtime.trajectory import Span, Start
from .events import UNWATCHED, Events, RunEvent
from .followed_path import DrivenCoordinates, DrivenPath, FollowedPath
from .kinematic import KinematicAnalysis, complete, describe_gap, follow_to_start, keep, start_from
from .run_arguments import find_span, ordered_times

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

FEWEST = 201  #: points stored where none are asked for


def is_driven(module: BoundModel) -> bool:
    """Whether the positions follow from the time alone."""
    layout = module.layout
    return layout.n_dof == 0 and layout.n_q > 0 and layout.n_h == layout.n_c


def follow_drivers(
    module: BoundModel,
    span: Span,
    initial: Start,
    parameters: Any,
    inputs: Mapping[str, Any] | None,
    t_eval: ArrayLike | None,
    events: Any,
    method: Any,
    options: Mapping[str, Any],
) -> KinematicAnalysis | None:
    """The motion of a mechanism that its drivers move entirely: solved, not integrated; None for any other.

    Raises
    ------
    UsageError
        Method kinematic for another mechanism, or what only a run that integrates can do.
    """
    if not is_driven(module) or _led_by_inputs(module, inputs, method):
        if method is not None:
            raise cannot(
                f"method 'kinematic' is for mechanisms without degrees of freedom; {module.name} has {module.n_dof}"
            )
        return None
    forcing = Forcing(module.layout, inputs)
    start, end = find_span(span, float(module.metadata.get("simulation", {}).get("end") or 10.0))
    bound = module.bind(parameters, forcing.constants) if parameters is not None or forcing.constants else module
    forcing.attach(bound)
    watched = Events(module.layout, events)
    if watched.resets:
        raise cannot(f"{module.name} has no degree of freedom: its drivers move it, and no event can reset its state")
    listed = [event for event in watched.listed(bound, forcing) if event.direction != UNWATCHED]
    stored = None if t_eval is None else ordered_times(t_eval, start, end)
    given = {key: value for key, value in options.items() if value is not None}
    return simulate_driven(bound, (start, end), initial, forcing, stored, listed, given)


def _led_by_inputs(module: BoundModel, inputs: Mapping[str, Any] | None, method: Any) -> bool:
    """Whether inputs that vary move the mechanism: it is integrated then; UsageError for method kinematic."""
    led = Forcing(module.layout, inputs).constrained
    if led and method == "kinematic":
        names = ", ".join(module.u_names[i] for i in module.layout.constraint_inputs)
        raise cannot(
            f"method 'kinematic' needs drivers that are expressions of t, but the inputs {names} move {module.name}; "
            "leave method= out to integrate it"
        )
    return led


def simulate_driven(
    module: BoundModel,
    span: tuple[float, float],
    initial: Start,
    forcing: Forcing,
    t_eval: Array | None,
    events: Sequence[RunEvent],
    given: Mapping[str, Any],
) -> KinematicAnalysis:
    """The motion over a span; see :func:`~.simulate.simulate`.

    Parameters
    ----------
    module : BoundModel
        With the parameters and constant inputs of the run bound.
    span : (float, float)
    t_eval : (n_t,) array, optional
        Within the span, in order.
    events : sequence of RunEvent
    given : mapping
        Options meant for an integrator; tolerances and steps have no meaning here.

    Raises
    ------
    PartitionError
        The start is a singular position.
    SimulationError
        The drivers come to a position from which they cannot go on.
    """
    for name in given:
        if name not in ("rtol", "atol", "max_step", "first_step"):
            raise no_such(
                f"a run of a mechanism that drivers move entirely has no option {name!r}; give method= "
                "too to integrate it"
            )
    start, end = span
    nothing = np.empty(0)
    if initial is None:
        t0, q = start_from(module, None, start)
        module.x0(t=t0)  # declared rates that contradict the drivers are told here
    elif isinstance(initial, Mapping):
        t0, q = start, module.x0(initial, t=start)[: module.n_q]
    else:
        t0, q = start_from(module, initial, start)
    driven = DrivenCoordinates(module, complete(module, q, t0, ()))
    q = follow_to_start(driven, q, (t0, nothing), (start, nothing))
    sense = 1.0 if end >= start else -1.0
    followed = FollowedPath(DrivenPath(driven, start, nothing, sense, nothing), q, abs(end - start))
    if followed.stop is not None:
        beyond = 0.9 * followed.reached + 0.1 * followed.end
        gap = describe_gap(driven, *followed.path.at(beyond), followed.stop.q)
        raise SimulationError(
            f"the drivers cannot move further at t = {followed.stop.t:.6g} s of {end:.6g} s: {followed.stop}; {gap}; "
            "change the drivers' values, or the dimensions"
        )
    own = followed.nodes[followed.nodes <= followed.end]
    if t_eval is None:
        s = np.unique(
            np.concatenate([own, np.linspace(0.0, followed.end, FEWEST)]) if len(own) < FEWEST else [*own, followed.end]
        )
        t = start + sense * s
    else:
        t = t_eval
        s = sense * (t - start)
    run = _DrivenRun(followed, forcing, start, sense)
    t_events, x_events, last = run.find(events, np.unique(np.concatenate([own, s, [followed.end]])))
    message, status = ("A termination event occurred.", 1) if last is not None else ("The end was reached.", 0)
    if last is not None:
        kept = s < last
        s, t = s[kept], t[kept]
        if t_eval is None:
            s, t = np.append(s, last), np.append(t, start + sense * last)
    ends = [start, float(t[-1]) if t.size else start]
    return run.keep(
        t,
        s,
        t_events,
        x_events,
        {"status": status, "message": message, "span": ends, "event_names": [event.name for event in events]},
    )


class _DrivenRun:
    """Samples of one followed path as states."""

    def __init__(self, followed: FollowedPath, forcing: Forcing, start: float, sense: float) -> None:
        self.followed, self.forcing, self.start, self.sense = followed, forcing, start, sense

    def state(self, s: float) -> Array:
        q, v, _ = self.followed.motion(np.array([s]), None)
        return np.concatenate([q[:, 0], v[:, 0]])

    def _value(self, event: RunEvent, s: float) -> float:
        return event(self.start + self.sense * s, self.state(s))

    def find(self, events: Sequence[RunEvent], grid: Array) -> tuple[list[Array], list[Array], float | None]:
        """Times and states of events, and where a terminal one ends the run."""
        found: list[list[float]] = [[] for _ in events]
        if events:
            q, v, _ = self.followed.motion(grid, None)
            states = np.concatenate([q, v])
        last: float | None = None
        for event, places in zip(events, found, strict=True):
            values = [event(self.start + self.sense * s, x) for s, x in zip(grid, states.T, strict=True)]
            for k in range(len(grid) - 1):
                if k and values[k] == 0.0:
                    continue  # found where the interval before ends
                up, down = values[k] <= 0.0 <= values[k + 1], values[k] >= 0.0 >= values[k + 1]
                if (up and event.direction >= 0) or (down and event.direction <= 0):
                    low, high = float(grid[k]), float(grid[k + 1])
                    places.append(find_root(partial(self._value, event), low, high, values[k], values[k + 1]))
            if event.terminal and len(places) >= event.terminal:
                ends = places[int(event.terminal) - 1]
                last = ends if last is None else min(last, ends)
        kept = [np.array([s for s in places if last is None or s <= last]) for places in found]
        times = [self.start + self.sense * s for s in kept]
        width = self.followed.driven.layout.n_x
        states_at = [np.array([self.state(float(s)) for s in places]).reshape(-1, width).T for places in kept]
        return times, states_at, last

    def keep(
        self, t: Array, s: Array, t_events: list[Array], x_events: list[Array], header: dict[str, Any]
    ) -> KinematicAnalysis:
        """The trajectory at parameters s."""
        motion = self.followed.motion(s, None)
        sample: Callable[[Array], KinematicAnalysis] = lambda times: self.keep(  # noqa: E731
            times, self.sense * (times - self.start), [], [], header
        )
        u = self.forcing.sample(t, np.concatenate(motion[:2]))
        return keep(
            self.followed.driven,
            t,
            [motion],
            self.followed.singular,
            None,
            len(t),
            (),
            u=u,
            header=header,
            t_events=t_events,
            x_events=x_events,
            sample=sample,
        )
