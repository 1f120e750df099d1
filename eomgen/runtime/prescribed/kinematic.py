"""A Module, times and prescribed coordinates -> positions, velocities and accelerations over the range, without forces.

Masses and forces play no part.  The range is followed from the initial position, so that the mechanism stays on its
branch; positions between the points of the continuation are then solved from cubic guesses.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.algebra import Array
from ...base.assembly import close
from ...base.limits.constraints import CONTRADICTION, UNMOVED
from ...base.limits.positions import SINGULAR, SLACK
from ...base.scales import largest
from ...errors import (
    TO_BE_FINITE,
    AssemblyError,
    PartitionError,
    SimulationError,
    cannot,
    ill_chosen,
    ill_placed,
    ill_shaped,
    no_such,
)
from ..argument_checks import read_number, read_numbers
from ..inputs import Forcing
from ..kernels import place
from ..refusals import not_driven
from ..runs.events import Events
from ..runs.integrate import header_of, integrate
from ..runs.run_arguments import ordered_times, set_up
from ..trajectory import Columns, Residuals, Span, Start, Trajectory, describe, last_state
from .followed_path import DrivenCoordinates, DrivenPath, FollowedPath, Singular

if TYPE_CHECKING:
    from ..bound_model import BoundModel
    from ..initial import Initial


# -- the result --------------------------------------------------------------------------------------------------------


METHOD = "kinematic"


class MotionColumns(Columns):
    """Columns of a motion whose accelerations are known, and come from no force.  NaN where it is not defined."""

    def __init__(
        self, module: BoundModel, t: Array, x: Array, u: Array, a: Array, passed: tuple[Any, ...] | None = None
    ) -> None:
        super().__init__(module, t, x, u)
        self.a, self._between = a, passed

    def _passed(self) -> Any:
        return self._between

    @cached_property
    def slopes(self) -> Array:
        """x' (n_x, n_t)."""
        n_q = self.module.n_q
        q, v = self.x[:n_q], self.x[n_q:]
        space = self.module.layout.space
        return np.concatenate([v if space is None else space.rates(q, v), self.a])

    def _outputs(self) -> Array:
        module, n_q = self.module, self.module.n_q
        if not module.info.output_accelerations:
            kernel = module.kernels.kernel("outputs", nan=True)
            return kernel(self.t, self.x, u=self._varying())
        motion = module.kernels.motion_outputs
        return motion(self.x[:n_q], self.x[n_q:], self.a, u=self._varying(), t=self.t)

    @cached_property
    def energies(self) -> Array:
        """Kinetic, potential and total energy (3, n_t)."""
        T, V = self.module.kernels.kernel("energy", nan=True)(self.x, u=self._varying(), t=self.t)
        return np.array([T, V, T + V])


class KinematicAnalysis(Trajectory):
    """The motion over a range of time or of prescribed coordinates, as a :class:`~..trajectory.Trajectory`.

    Attributes
    ----------
    q, v, a : (n_q, n_t), (n_v, n_t), (n_v, n_t) arrays
        Velocities and accelerations are NaN where the prescribed coordinates do not determine them.
    led : tuple of str
        The prescribed coordinates; none if drivers alone move the mechanism.
    singular : list of Singular
        Singular positions met, in order.
    stop : Singular or None
        Where the range ended early.
    complete : bool
        Whether the whole range was reached.
    """

    BESIDES = ("a", "singular", "stop", "led")
    a: Array
    singular: list[Singular]
    stop: Singular | None
    led: tuple[str, ...]

    @property
    def complete(self) -> bool:
        """Whether the whole range was reached."""
        return self.stop is None

    def turning_points(self, name: str) -> list[tuple[float, float]]:
        """Dead centres of a coordinate: (time, value) where its rate changes sign.

        Between two points of the range the coordinate is taken as the cubic through its values and rates there.

        Parameters
        ----------
        name : str
            A column that has a rate, ``name_dot``.

        Raises
        ------
        UsageError
            The time is constant in the range, or the column has no rate.
        """
        if name + "_dot" not in self.names:
            raise cannot(f"{name!r} has no rate among the columns")
        if len(self.t) < 2 or not np.diff(self.t).any():
            raise cannot("the time is constant in this range, so there are no rates; give t together with the values")
        y, rate, result = self[name], self[name + "_dot"], []
        for k in np.flatnonzero((rate[:-1] * rate[1:] < 0.0) | (rate[:-1] == 0.0)):
            h = self.t[k + 1] - self.t[k]  # 0 where a time stands twice
            d0, d1, dy = rate[k] * h, rate[k + 1] * h, y[k + 1] - y[k]
            cubic = np.array([d0 + d1 - 2 * dy, 3 * dy - 2 * d0 - d1, d0, y[k]])
            roots = np.roots(np.polyder(cubic)) if cubic[:3].any() else np.zeros(1)
            inside = [
                float(r.real) for r in np.atleast_1d(roots) if abs(r.imag) < SLACK and -SLACK <= r.real <= 1 + SLACK
            ]
            if inside:
                x = min(inside, key=lambda r: abs(r - d0 / (d0 - d1)) if d0 != d1 else r)
                result.append((float(self.t[k] + x * h), float(np.polyval(cubic, x))))
        return list(dict.fromkeys(result))

    def __repr__(self) -> str:
        over = (
            f"of {', '.join(self.led)}"
            if self.led
            else f"t = {self.t[0]:.6g} .. {self.t[-1]:.6g} s"
            if self.t.size
            else ""
        )
        end = "" if self.stop is None else f", ends early: {self.stop}"
        return f"<KinematicAnalysis of {self.name}: {len(self)} points {over}{end}>"


def keep(
    driven: DrivenCoordinates,
    t: Array,
    parts: Sequence[tuple[Array, Array, Array]],
    result: Sequence[Singular],
    stop: Singular | None,
    requested: int,
    names: tuple[str, ...],
    *,
    u: Array | None = None,
    header: Mapping[str, Any] | None = None,
    passed: tuple[Any, ...] | None = None,
    rest: tuple[Any, ...] = (),
) -> KinematicAnalysis:
    """Put an analysis together from its pieces; ``requested`` points were requested.

    ``u`` (n_u, n_t) are inputs that vary; ``header`` has metadata that comes first, ``passed`` what was
    passed besides these points, as columns take it, ``rest`` what a Trajectory takes after its header.
    """
    module = driven.module
    q, v, a = (np.concatenate([part[i] for part in parts], axis=1) for i in range(3))
    x = np.concatenate([q, v])
    if u is None:
        u = np.repeat(module.u[:, None], len(t), axis=1)
    columns = MotionColumns(module, t, x, u, a, passed)
    span = [float(t[0]), float(t[-1])] if t.size else []
    status, message = (0, "the whole range") if stop is None else (-1, f"{len(t)} of {requested} points: {stop}")
    more = {"led": list(names), "singular": [str(s) for s in result]}
    known = header_of(module.layout, METHOD, {}, (), residuals(module, t, x), status, message, more, span)
    complete = {**describe(module), **known, **(header or {})}
    return KinematicAnalysis.of((t, x, columns, complete, *rest), a, list(result), stop, names)


def residuals(module: BoundModel, t: Array, x: Array) -> Residuals:
    """How well the constraints are kept, all rows, where the motion is defined."""
    n = module.n_q
    if not module.n_rows or not t.size:
        return Residuals()
    position = largest(module.kernels.constraints(x[:n], t=t))
    fine = np.isfinite(x).all(axis=0)
    rate = module.kernels.velocity_constraints(x[:, fine], t=t[fine]) if fine.any() else np.empty(0)
    return Residuals(position, largest(rate), position, largest(rate))


# -- where the loops do not close --------------------------------------------------------------------------------------


def describe_gap(driven: DrivenCoordinates, t: float, y: Array, near: Array) -> str:
    """The largest gap that is left when all equations are met as well as they can be.

    y (n_led,) are the values of the driven coordinates, ``near`` (n_q,) a closed position beside it.
    """
    layout, scales = driven.layout, driven.scales
    system, values = driven.system.at(t), dict(zip(driven.led, y.tolist(), strict=True))
    with np.errstate(all="ignore"):  # coordinates of the tree are held exactly, so that the gap opens at a joint
        q, _ = close(system.closure(values), system.with_values(near, values))
    position = system.position
    C = position(q)[0]
    if not C.size:
        return "beyond it, all joints close"
    gaps = np.abs(scales.residual(C))
    undefined = ~np.isfinite(position(np.array(near))[0])  # whatever the position, by the time
    if undefined.any():
        owners = dict.fromkeys(layout.constraint_labels[i].partition(".")[0] for i in np.flatnonzero(undefined))
        what = f"no finite value: {TO_BE_FINITE}"
        return f"beyond it, at t = {t:.6g} s, {', '.join(owners)} has {what}"
    where = place(driven.led, y)[2:] or f"t = {t:.6g} s"
    if not gaps.max() > CONTRADICTION:
        return f"beyond it, at {where}, the loops close again: a driver's value jumps, or is out of reach in between"
    joints = [k for k, label in enumerate(layout.constraint_labels[: len(C)]) if not label.endswith(".motion")]
    if joints and gaps[joints].max() > CONTRADICTION:  # rather than the driver
        worst = joints[int(np.argmax(gaps[joints]))]
    else:
        worst = int(np.argmax(gaps))
    unit = "m" if layout.info.constraint_kinds[worst] == "length" else "rad"
    return f"beyond it, at {where}, {layout.constraint_labels[worst]} stays open by {abs(C[worst]):.3g} {unit}"


# -- the analysis ------------------------------------------------------------------------------------------------------


def start_from(module: BoundModel, initial: Start, t0: float) -> tuple[float, Array]:
    """A closed position and its time: as given, or the declared one at t = 0."""
    from ..initial import Initial

    layout = module.layout
    if initial is None:
        first = Initial(module.kernels, 0.0)
        try:
            return 0.0, first.assembled({})
        except AssemblyError:
            if not t0:
                raise
            return t0, Initial(module.kernels, t0).assembled({})
    here = Initial(module.kernels, t0)
    if isinstance(initial, Mapping):
        raw = here.sort({name: read_number(name, value) for name, value in initial.items()})
        if raw.rates:
            raise ill_placed(f"initial takes positions only, not {', '.join(raw.rates)}")
        return t0, here.assembled(raw.positions)
    q = np.array(read_numbers("initial", last_state(initial, module.x_names)))
    if q.shape == (layout.n_x,):
        q = q[: layout.n_q]
    if q.shape != (layout.n_q,):
        raise ill_shaped(f"initial must name values or have shape ({layout.n_q},) or ({layout.n_x},), not {q.shape}")
    return t0, here.system.close(q, {}).q if layout.n_h else q


def complete(module: BoundModel, q: Array, t: float, names: Sequence[str]) -> tuple[str, ...]:
    """The led coordinates, and those of the independent ones that stand still besides."""
    from ..initial import Initial

    layout = module.layout
    initial: Initial = Initial(module.kernels, t)
    if len(names) > layout.n_dof:
        raise ill_chosen(
            f"{', '.join(names)} cannot {'all ' * (len(names) > 1)}be prescribed: {_freedom(module, q, t)}"
        )
    free = [layout.velocity_labels[i] for i in layout.independent if layout.velocity_labels[i] in layout.q]
    others = [name for name in [*free, *layout.q] if name not in names]
    values = dict.fromkeys(list(dict.fromkeys(others)), 0.0)
    fine = initial.compatible(q, (), dict.fromkeys(names, 0.0))
    for name in names:
        if name not in fine:
            raise PartitionError(
                f"{name} cannot be prescribed from the initial position ({place(layout.q, q)[2:]}): the coordinate "
                "cannot move there, or branches meet there; give a slightly different initial position",
                t,
                q,
            )
    fixed = list(initial.compatible(q, names, values))[: layout.n_dof - len(names)]
    if len(names) + len(fixed) < layout.n_dof:
        module.layout.require_minimal_form()
        plural = "s" * (layout.n_dof != 1)
        raise ill_chosen(
            f"{layout.n_dof} degree{plural} of freedom, but fewer coordinates can be prescribed at this position"
        )
    result = (*names, *fixed)
    Q = DrivenCoordinates(module, result).tangent(t, q, 0.0, np.zeros(len(result))).quality
    if Q < SINGULAR:
        where = place(layout.q, q)[2:]
        raise PartitionError(
            f"the initial position is singular ({where}): branches meet there; give a slightly different one", t, q
        )
    return result


def _freedom(module: BoundModel, q: Array, t: float) -> str:
    """Why no more coordinates can be led."""
    n = module.n_dof
    if n:
        return f"{n} degree{'s' * (n > 1)} of freedom, at most {n}"
    gaps = [module.constraints(q, t=t + step, rows="all") for step in (0.0, 0.0137, 0.377, 1.0)]
    if any((gap != gaps[0]).any() for gap in gaps):
        return "0 degrees of freedom: the drivers determine the whole motion; give t"
    return (
        "0 degrees of freedom: the mechanism is locked, and no driver moves it; remove a constraint, or replace a "
        "joint by one with more freedom"
    )


def follow_to_start(
    driven: DrivenCoordinates, q: Array, start: tuple[float, Array], first: tuple[float, Array]
) -> Array:
    """From the initial position to the first point of the range."""
    (t, y), (t0, y0) = start, first
    length = largest(np.concatenate([(y0 - y) / driven.led_scales, [t0 - t]]))
    if length <= UNMOVED:
        return q
    followed = FollowedPath(DrivenPath(driven, t, y, (t0 - t) / length, (y0 - y) / length), q, length)
    if followed.stop is not None:
        raise PartitionError(
            f"the path from the initial position to the first point is blocked: {followed.stop}; give initial={{...}} "
            "nearer to the first point",
            t0,
            q,
        )
    return followed.position(length)


# -- runs of mechanisms that drivers move entirely ---------------------------------------------------------------------


FEWEST = 201  #: points stored where none are requested


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
    """The motion of a mechanism that its drivers move entirely: solved, not integrated; None for any other."""
    if not is_driven(module) or _moved_by_inputs(module, inputs, method):
        if method is not None:
            raise not_driven(module.layout)
        return None
    bound, forcing, start, end = set_up(module, span, parameters, inputs)
    watched = Events(module.layout, events)
    if watched.resets:
        raise cannot(f"{module.name} has no degree of freedom: its drivers move it, and no event can reset its state")
    stored = None if t_eval is None else ordered_times(t_eval, start, end)
    for name, value in options.items():
        if value is not None and name not in ("rtol", "atol", "max_step", "first_step"):  # of no meaning here
            raise no_such(
                f"a mechanism without degrees of freedom is moved by its drivers alone, or not at all: its run has no "
                f"option {name!r}; give method= too to integrate it"
            )
    motion = _follow(bound, initial, forcing, start, end)
    result, _, raised = integrate(
        bound, forcing, [start, end], motion.state(start), partial(_Steps, motion), stored, False, {}, watched,
        rates=motion.rates,
    )  # fmt: skip
    if raised is not None:
        raise raised
    ends = [start, float(result.t[-1]) if result.t.size else start]
    header = {"status": result.status, "message": result.message, "span": ends, "event_names": list(watched.names)}
    return motion.keep(result.t, result.t_events, result.x_events, header)


def _moved_by_inputs(module: BoundModel, inputs: Mapping[str, Any] | None, method: Any) -> bool:
    """Whether inputs that vary move the mechanism: it is integrated then; UsageError for method kinematic."""
    constrained = Forcing(module.layout, inputs).constrained
    if constrained and method == "kinematic":
        names = ", ".join(module.u_names[i] for i in module.layout.constraint_inputs)
        raise cannot(
            f"method 'kinematic' needs drivers that are expressions of t, but the inputs {names} move {module.name}; "
            "leave method= out to integrate it"
        )
    return constrained


def _follow(module: BoundModel, initial: Start, forcing: Forcing, start: float, end: float) -> _Motion:
    """The motion over a span."""
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
    nodes = followed.nodes[followed.nodes < followed.end]
    if len(nodes) < FEWEST - 1:
        nodes = np.unique(np.concatenate([nodes, np.linspace(0.0, followed.end, FEWEST)[:-1]]))
    times = np.append(start + sense * nodes, end)
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
            rest=(t_events, x_events, sample),
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
