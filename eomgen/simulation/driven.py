"""A Module that drivers move entirely -> Trajectory over a span of time, without integration or forces."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..errors import SimulationError, cannot, no_such
from ..runtime.inputs import Forcing
from ..runtime.trajectory import Span, Start
from .events import Events
from .followed_path import DrivenCoordinates, DrivenPath, FollowedPath
from .integrate import MESSAGES, TERMINAL, integrate
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
    stored = None if t_eval is None else ordered_times(t_eval, start, end)
    given = {key: value for key, value in options.items() if value is not None}
    return simulate_driven(bound, (start, end), initial, forcing, stored, watched, given)


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
    events: Events,
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
    events : Events
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
    message, status = (MESSAGES[TERMINAL], 1) if last is not None else ("The end was reached.", 0)
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
        {"status": status, "message": message, "span": ends, "event_names": list(events.names)},
    )


class _DrivenRun:
    """Samples of one followed path as states."""

    def __init__(self, followed: FollowedPath, forcing: Forcing, start: float, sense: float) -> None:
        self.followed, self.forcing, self.start, self.sense = followed, forcing, start, sense
        self.known: dict[float, tuple[Array, Array, Array]] = {}

    def find(self, events: Events, grid: Array) -> tuple[list[Array], list[Array], float | None]:
        """Times and states of events, and where a terminal one ends the run, with the grid as steps."""
        if not len(events):
            return [], [], None
        module, end = self.followed.driven.module, self.start + self.sense * self.followed.end
        times, motion = self.start + self.sense * grid, self.followed.motion(grid, None)
        self.known = dict(zip(times.tolist(), zip(*(part.T for part in motion), strict=True), strict=True))
        found, _, raised = integrate(
            module, self.forcing, [self.start, end], self.state(self.start), partial(_Steps, self), np.empty(0), False,
            {}, events, rates=self.rates,
        )  # fmt: skip
        if raised is not None:
            raise raised
        last = self.sense * (found.ends[1] - self.start) if found.status == 1 else None
        return found.t_events, found.x_events, last

    def at(self, t: float) -> tuple[Array, Array, Array]:
        """Position, velocities and accelerations at a time."""
        if t in self.known:
            return self.known[t]
        q, v, a = self.followed.motion(np.array([self.sense * (t - self.start)]), None)
        return q[:, 0], v[:, 0], a[:, 0]

    def state(self, t: float) -> Array:
        """x (n_x,)."""
        return np.concatenate(self.at(t)[:2])

    def rates(self, t: float, x: Array) -> Array:
        """x' (n_x,)."""
        q, v, a = self.at(t)
        space = self.followed.driven.layout.space
        return np.concatenate([v if space is None else space.rates(q, v), a])

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


class _Steps:
    """Steps along a followed path, with the calls of SciPy's OdeSolver."""

    def __init__(self, run: _DrivenRun, _: Any, t: float, x: Array, end: float) -> None:
        self.run, self.t_old, self.t, self.y, self.t_bound, self.status = run, t, t, x, end, "running"
        self.left = iter([at for at in run.known if run.sense * (at - t) > 0.0])

    def step(self) -> None:
        """To the next point."""
        self.t_old, self.t = self.t, next(self.left)
        self.y = self.run.state(self.t)
        self.status = "finished" if self.t == self.t_bound else "running"

    def dense_output(self) -> Callable[[float], Array]:
        """The state at a time."""
        return self.run.state
