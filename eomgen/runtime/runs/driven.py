"""A Module that drivers move entirely -> Trajectory over a span of time, without integration or forces."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.algebra import Array
from ...errors import SimulationError, cannot, no_such
from ..inputs import Forcing
from ..trajectory import Span, Start
from .events import Events
from .followed_path import DrivenCoordinates, DrivenPath, FollowedPath
from .integrate import integrate
from .kinematic import KinematicAnalysis, complete, describe_gap, follow_to_start, keep, start_from
from .run_arguments import ordered_times, set_up

if TYPE_CHECKING:
    from ..bound_model import BoundModel

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
    bound, forcing, start, end = set_up(module, span, parameters, inputs)
    watched = Events(module.layout, events)
    if watched.resets:
        raise cannot(f"{module.name} has no degree of freedom: its drivers move it, and no event can reset its state")
    stored = None if t_eval is None else ordered_times(t_eval, start, end)
    for name, value in options.items():
        if value is not None and name not in ("rtol", "atol", "max_step", "first_step"):  # of no meaning here
            raise no_such(
                f"a run of a mechanism that drivers move entirely has no option {name!r}; give method= "
                "too to integrate it"
            )
    motion = _follow(bound, initial, forcing, start, end)
    found, _, raised = integrate(
        bound, forcing, [start, end], motion.state(start), partial(_Steps, motion), stored, False, {}, watched,
        rates=motion.rates,
    )  # fmt: skip
    if raised is not None:
        raise raised
    ends = [start, float(found.t[-1]) if found.t.size else start]
    header = {"status": found.status, "message": found.message, "span": ends, "event_names": list(watched.names)}
    return motion.keep(found.t, found.t_events, found.x_events, header)


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


def _follow(module: BoundModel, initial: Start, forcing: Forcing, start: float, end: float) -> _Motion:
    """The motion over a span.

    Raises
    ------
    PartitionError
        The start is a singular position.
    SimulationError
        The drivers come to a position from which they cannot go on.
    """
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
    own = followed.nodes[followed.nodes < followed.end]
    if len(own) < FEWEST - 1:
        own = np.unique(np.concatenate([own, np.linspace(0.0, followed.end, FEWEST)[:-1]]))
    times = np.append(start + sense * own, end)
    return _Motion(followed, forcing, start, sense, times)


class _Motion:
    """A followed path as a motion over time, known at some times."""

    def __init__(self, followed: FollowedPath, forcing: Forcing, start: float, sense: float, times: Array) -> None:
        self.followed, self.forcing, self.start, self.sense = followed, forcing, start, sense
        self.known: dict[float, tuple[Array, Array, Array]] = {}
        self.known = dict(zip(times.tolist(), zip(*(part.T for part in self.over(times)), strict=True), strict=True))

    def over(self, t: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities and accelerations (n, k) at times (k,)."""
        return self.followed.motion(self.sense * (t - self.start), None)

    def at(self, t: float) -> tuple[Array, Array, Array]:
        """The same at one time."""
        if t in self.known:
            return self.known[t]
        q, v, a = (part[:, 0] for part in self.over(np.array([t])))
        return q, v, a

    def state(self, t: float) -> Array:
        """x (n_x,)."""
        return np.concatenate(self.at(t)[:2])

    def rates(self, t: float, x: Array) -> Array:
        """x' (n_x,)."""
        q, v, a = self.at(t)
        space = self.followed.driven.layout.space
        return np.concatenate([v if space is None else space.rates(q, v), a])

    def keep(
        self, t: Array, t_events: Sequence[Array], x_events: Sequence[Array], header: dict[str, Any]
    ) -> KinematicAnalysis:
        """The trajectory at times (k,)."""
        motion = self.over(t)
        sample = partial(self.keep, t_events=(), x_events=(), header=header)
        u = self.forcing.sample(t, np.concatenate(motion[:2]))
        return keep(
            self.followed.driven, t, [motion], self.followed.singular, None, len(t), (), u=u, header=header,
            t_events=t_events, x_events=x_events, sample=sample,
        )  # fmt: skip


class _Steps:
    """Steps along a followed path, with the calls of SciPy's OdeSolver."""

    def __init__(self, run: _Motion, _: Any, t: float, x: Array, end: float) -> None:
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
