"""A run that stops at every closing gap, applies the impact and goes on -> a trajectory with impacts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base.algebra import Array
from ..base.limits.impacts import BEYOND, FOUND, MOMENT, RESTING, STARTED, STILL, TOUCHING
from ..base.limits.runs import INSTANT
from ..base.value_rules import read_count
from ..errors import SimulationError, cannot, no_such, off_range
from ..numeric.roots import carry_out, find_root, search_least
from ..runtime.columns import Columns, Residuals, describe, units_of
from ..runtime.inputs import Forcing
from ..runtime.refusals import refuse_rigid
from ..runtime.trajectory import Span, Start, Trajectory
from .impact import Gaps, Impact, Rough, allowance, check_friction, check_gaps, strike_run
from .run_arguments import find_span, find_state
from .simulate import simulate

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.protocols import Source


# -- the trajectory ----------------------------------------------------------------------------------------------------


class ImpactRun(Trajectory):
    """A motion with impacts: a :class:`~..runtime.trajectory.Trajectory` that has two points at each impact.

    Attributes
    ----------
    t : (n_t,) array
        Times (s); each impact has two, the same one before and after.
    x : (n_x, n_t) array
    impacts : list of (float, Impact)
    t_events, x_events : lists
        Times and states before the impacts of each gap, also by name: ``run.t_events["gap"]``.
    ended : {'end', 'impacts', 'rest', 'event'}
        Why it ended: the span is over; as many impacts as allowed; a gap that is pressed together and no longer opens
        (bodies that stay in contact need a joint or a contact force); an event of the model that ends runs.
    """

    impacts: list[tuple[float, Impact]]
    breaks: list[int]
    ended: str

    @classmethod
    def of(
        cls, parts: tuple[Any, ...], impacts: Sequence[tuple[float, Impact]], breaks: Sequence[int], ended: str
    ) -> ImpactRun:
        """Make the run from the parts of a Trajectory and the impacts."""
        run = cls(*parts)
        run.impacts, run.breaks, run.ended = list(impacts), list(breaks), ended
        return run

    def __repr__(self) -> str:
        return (
            f"<ImpactRun of {self.name}: {len(self.t)} points, t = {self.t[0]:.6g} .. {self.t[-1]:.6g} s, {self.count}>"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        _, parts = super().__reduce__()
        return type(self).of, (parts, self.impacts, self.breaks, self.ended)

    @property
    def count(self) -> str:
        """The number of impacts and the reason for the end, as a text."""
        reasons = {
            "end": "",
            "impacts": "; as many as allowed (most=)",
            "rest": "; a gap stays closed",
            "event": "; an event ended it",
        }
        return f"{len(self.impacts)} impact{'s' * (len(self.impacts) != 1)}{reasons[self.ended]}"

    @property
    def pieces(self) -> list[Trajectory]:
        """The trajectories between impacts."""
        ends = [0, *self.breaks, len(self.t)]
        found = []
        for a, b in pairwise(ends):
            header = self.metadata | {"span": [float(self.t[a]), float(self.t[b - 1])], "event_names": []}
            found.append(Trajectory(self.t[a:b], self.x[:, a:b], TrajectoryPart(self.columns, a, b), header))
        return found


class TrajectoryPart:
    """Columns from one point of a run to another."""

    def __init__(self, whole: Source, first: int, last: int) -> None:
        self.whole, self.names, self.range = whole, whole.names, slice(first, last)

    def __getitem__(self, name: str) -> Array:
        return self.whole[name][self.range]

    @property
    def has_energies(self) -> bool:
        return self.whole.has_energies

    @property
    def energies(self) -> Array:
        return self.whole.energies[:, self.range]


# -- gaps as events ----------------------------------------------------------------------------------------------------


AT_REST = 0.1  #: the same for one that does not open
SAMPLES = 8  #: places in each step of the solver at which gaps are looked at afterwards
CHUNK = 4096  #: steps at a time


class Watch:
    """When gaps close that may be closed at the beginning.

    A gap that begins at 0 and opens, g = r (t - t0), is watched from its first positive value on: what is watched is
    g + d (1 - (t - t0) r / (2 d)) until the second term is 0, with d a rounding above -g.  It is positive from the
    beginning, and g itself by the time g can be 0 again, unless it opens by less than d.

    Parameters
    ----------
    gaps : Gaps
    t : float
    x : (n_x,) array
    rates : (n,) array
        Of the gaps, at the beginning.
    limits : (n,) array
        Sizes at which gaps count as closed.
    """

    def __init__(self, gaps: Gaps, t: float, x: Array, rates: Array, limits: Array) -> None:
        values = gaps.values(t, x)
        self.gaps, self.start, self.limits = gaps, t, limits
        still = rates <= 0.0
        self.lift = np.where(values <= STARTED * limits, STARTED * limits - np.minimum(values, 0.0), 0.0)
        resting = still & (values <= AT_REST * limits)
        self.lift[resting] = (AT_REST * limits - np.minimum(values, 0.0))[resting]
        self._key, self._last = (np.nan, b""), values
        self.fall = np.where(resting, 0.0, np.maximum(0.5 * rates, 0.0))

    def values(self, t: Any, x: Array) -> Array:
        """What is watched, (n,) or (n, k)."""
        lift, fall = (self.lift, self.fall) if x.ndim == 1 else (self.lift[:, None], self.fall[:, None])
        return np.asarray(self.gaps.values(t, x) + np.maximum(lift - fall * (t - self.start), 0.0))

    def events(self) -> list[Callable[[float, Array], float]]:
        """Functions f(t, x) that end a run where they fall through 0, in the order of the gaps."""
        found: list[Callable[[float, Array], float]] = []
        for i, name in enumerate(self.gaps.names):

            def closing(t: float, x: Array, i: int = i) -> float:
                key = (t, x.tobytes())
                if key != self._key:  # all gaps are asked for in turn
                    self._key, self._last = key, self.values(t, x)
                return float(self._last[i])

            closing.terminal, closing.direction, closing.__name__ = True, -1.0, name  # type: ignore[attr-defined]
            found.append(closing)
        return found


def first_missed(watch: Watch, piece: Trajectory) -> tuple[float, NDArray[np.bool_]] | None:
    """The first closing of a gap before the end of a piece, and which gaps (n,) close there; None if there is none.

    The solver looks at the ends of its steps; a gap may close and open again in between.

    Parameters
    ----------
    watch : Watch
    piece : Trajectory
        With dense output.
    """
    if len(piece.t) < 2:
        return None
    for a in range(0, len(piece.t) - 1, CHUNK):
        ends = piece.t[a : a + CHUNK + 2]  # one step more than is needed, for dips at its end
        steps = np.diff(ends)
        inner = ends[:-1, None] + steps[:, None] * np.arange(SAMPLES) / SAMPLES
        times = np.append(inner.ravel(), ends[-1])
        values = watch.values(times, piece.at(times).x)
        found = [
            (at, i) for i in range(len(values)) if (at := _first_zero(watch, piece, i, times, values[i])) is not None
        ]
        if found:
            first = min(at for at, _ in found)
            fired = np.zeros(len(values), dtype=bool)
            for at, i in found:
                fired[i] = at <= first + INSTANT * max(abs(first), 1.0)
            return first, fired
    return None


def _first_zero(watch: Watch, piece: Trajectory, i: int, times: Array, values: Array) -> float | None:
    def value(t: float) -> float:
        return float(watch.values(t, piece.at(t).x[:, 0])[i])

    bend = values[:-2] - 2.0 * values[1:-1] + values[2:]
    dips = (values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:]) & (values[1:-1] < bend)
    below = np.flatnonzero(values < 0.0)
    stop = int(below[0]) if below.size else len(values)
    for k in np.flatnonzero(dips) + 1:
        if k >= stop:
            break
        left, middle, right = times[k - 1 : k + 2].tolist()
        search = search_least(left, middle, right, float(values[k]), FOUND * (right - left), below=True)
        low, at = carry_out(search, value)
        if low < 0.0:
            return find_root(value, float(times[k - 1]), at, float(values[k - 1]), low)
    if stop in (0, len(values)) or times[stop] == piece.t[-1]:  # at the end the solver has found it
        return None
    return find_root(value, float(times[stop - 1]), float(times[stop]), float(values[stop - 1]), float(values[stop]))


# -- the run -----------------------------------------------------------------------------------------------------------


IDLE = 50  #: closings in a row that bring neither an impact nor time


def simulate_impacts(
    module: BoundModel,
    /,
    span: Span,
    gaps: Mapping[str, float],
    initial: Start = None,
    parameters: Any = None,
    inputs: Mapping[str, Any] | None = None,
    *,
    friction: Mapping[str, tuple[float, str | Sequence[str]]] | None = None,
    most: int = 1000,
    **options: Any,
) -> ImpactRun:
    """Integrate the equations of motion, with an impact whenever a gap closes.

    Parameters
    ----------
    span : (float, float) or float
        Start and end (s), forward in time.
    gaps : mapping of str to float
        As for :meth:`impact`.
    initial, parameters, inputs : optional
        As for ``simulate``.
    friction : mapping, optional
        As for :meth:`impact`.
    most : int
        Number of impacts after which the run ends: impacts accumulate as a body comes to rest.
    **options
        method, rtol, atol, max_step, first_step, as for ``simulate``.

    Returns
    -------
    ImpactRun
        A trajectory (``run["theta"]``, ``run.at(t)``, ``run.save(path)`` ...) with both states at each impact, and
        ``impacts`` (time, Impact), ``pieces``, the trajectories between impacts, and ``ended``: 'end'; 'rest', a
        closed gap is pressed together; 'impacts', there were ``most``; 'event', an event of the model.

    Raises
    ------
    UsageError
        A gap is negative at the start, a name is unknown, or the mechanism has no degree of freedom.
    SimulationError, AssemblyError, MissingDependencyError
        As for ``simulate``; also where a gap is found negative without an impact before.
    """
    refuse_rigid(module.layout, "simulate_impacts")
    for key in ("events", "t_eval", "dense_output"):
        if key in options:
            raise no_such(
                f"simulate_impacts has no {key}=; use t_events of the run that it returns, and at(t) for any times"
            )
    most = read_count("most, the number of impacts,", most, 1)
    found, _ = check_gaps(module.layout, gaps)
    rough = check_friction(module.layout, friction, found)
    if not module.layout.n_dof:
        raise cannot(
            f"{module.name} has no degree of freedom: its drivers determine the motion, and no impact can change it"
        )
    start, end = find_span(span, float(module.metadata.get("simulation", {}).get("end") or 10.0))
    if end < start:
        raise cannot(f"a run with impacts goes forward in time, not from {start:.6g} s to {end:.6g} s")
    forcing = Forcing(module.layout, inputs)
    bound = module.bind(parameters, forcing.constants) if parameters is not None or forcing.constants else module
    forcing.attach(bound)
    forcing.begin(start, end)
    run = _ImpactRun(bound, found, rough, forcing, inputs, end, most, options)
    return run.finish(run.travel(start, find_state(bound, initial, start, forcing)))


def _ending(module: BoundModel) -> list[str]:
    """The model's events that end a run."""
    declared = module.layout.metadata.get("events") or []
    for event in declared:
        if int(event.get("terminal") or 0) > 1:
            raise cannot(
                f"event {event['name']} ends a run after {event['terminal']} times, and simulate_impacts cannot "
                "count them; give the gaps as events with restitution, and use simulate"
            )
    return [str(event["name"]) for event in declared if event.get("terminal")]


class _ImpactRun:
    """A run on its way."""

    def __init__(
        self,
        module: BoundModel,
        restitutions: dict[str, float],
        rough: Rough,
        forcing: Forcing,
        inputs: Mapping[str, Any] | None,
        end: float,
        most: int,
        options: dict[str, Any],
    ) -> None:
        self.module, self.forcing, self.inputs, self.end, self.most = module, forcing, inputs, end, most
        self.options, self.restitutions, self.rough = options, restitutions, rough
        self.gaps = Gaps(module, tuple(restitutions), forcing if forcing else None)
        self.limits = allowance(module.layout, self.gaps.names, TOUCHING)
        self.ends = _ending(module)
        self.times: list[Array] = []
        self.states: list[Array] = []
        self.samples: list[tuple[float, Trajectory]] = []  # ends, and what has dense output
        self.impacts: list[tuple[float, Impact]] = []
        self.breaks: list[int] = []
        self.fastest, self._struck = 0.0, False

    def travel(self, t: float, x: Array) -> str:
        """Go on from a state until the run ends, and tell why."""
        values = self.gaps.values(t, x)
        low = values < -np.maximum(self.limits, allowance(self.module.layout, self.gaps.names, BEYOND))
        for i in np.flatnonzero(low):
            raise off_range(f"gaps: {self.gaps.names[i]} is {values[i]:.3g} at the start; a gap must be 0 or positive")
        fired, idle = np.zeros(len(values), dtype=bool), 0
        while True:
            closed = fired | (self.gaps.values(t, x) <= self.limits)
            rates = self.gaps.rates(t, x)
            if closed.any():
                if not self.times:  # before an impact at the start
                    self._store(np.array([t]), x[:, None])
                after = self._strike(t, x, closed)
                if after is not None:
                    x, rates = after, self.gaps.rates(t, after)
            ended = "rest" if self._rests(t, x, closed, rates) else ""
            ended = ended or ("impacts" if len(self.impacts) >= self.most else "end" if t >= self.end else "")
            if ended:
                self._store(np.array([t]), x[:, None])
                return ended
            began = t
            t, x, fired = self._go_on(t, x, rates)
            if not fired.any():
                return "event" if t < self.end else "end"
            idle = idle + 1 if t - began <= INSTANT * max(abs(t), 1.0) else 0
            if idle > IDLE:
                names = ", ".join(name for name, one in zip(self.gaps.names, fired, strict=True) if one)
                raise SimulationError(
                    f"the gap {names} closes again and again at t = {t:.6g} s without an impact", code="EG-EVENT"
                )

    def _store(self, t: Array, x: Array) -> None:
        if self.times and self.impacts and self.impacts[-1][0] == t[0] and self._struck:
            self.breaks.append(sum(map(len, self.times)))
        elif self.times:  # goes on where it was
            t, x = t[1:], x[:, 1:]
        self._struck = False
        self.times.append(t)
        self.states.append(x)

    def _strike(self, t: float, x: Array, closed: NDArray[np.bool_]) -> Array | None:
        """The state after an impact of closed gaps, if one closes."""
        chosen = {name: e for (name, e), one in zip(self.restitutions.items(), closed, strict=True) if one}
        impact = strike_run(self.gaps, t, x, chosen, {name: self.rough[name] for name in chosen if name in self.rough})
        if not (impact.impulses > 0.0).any():
            return None
        self.impacts.append((t, impact))
        self.fastest = max(self.fastest, float(np.abs(impact.rates_before).max()))
        self._struck = True
        return impact.x

    def _rests(self, t: float, x: Array, closed: NDArray[np.bool_], rates: Array) -> bool:
        """Whether a closed gap no longer opens and is pressed together, so that it would not stay 0 by itself."""
        slow = closed & (rates <= max(RESTING * self.fastest, STILL * self._speed(x)))
        if not slow.any() or t >= self.end:
            return False
        x_rate = self.module.rhs(t, x, u=self.gaps.inputs(t, x))
        ahead, behind = (self.gaps.rates(t + h, x + h * x_rate) for h in (MOMENT, -MOMENT))
        pressed = (ahead - behind) / (2.0 * MOMENT)
        return bool((slow & (0.5 * pressed * (self.end - t) ** 2 < -self.limits)).any())

    def _speed(self, x: Array) -> float:
        layout = self.module.layout
        return layout.scales.speed(x[layout.n_q :]) * max(1.0, layout.length)

    def _go_on(self, t: float, x: Array, rates: Array) -> tuple[float, Array, NDArray[np.bool_]]:
        """Integrate to the next closing gap: the time and state there, and which gaps close."""
        n = len(self.limits)
        watch = Watch(self.gaps, t, x, rates, self.limits)
        piece = simulate(
            self.module,
            (t, self.end),
            x,
            None,
            self.inputs,
            events=[*self.ends, *watch.events()],
            dense_output=True,
            **self.options,
        )
        fired = np.array([len(times) > 0 for times in [*piece.t_events][-n:]])
        times, states = piece.t, piece.x
        missed = first_missed(watch, piece)
        if missed is not None:
            at, fired = missed
            kept = times < at
            times, states = np.append(times[kept], at), np.hstack([states[:, kept], piece.at(at).x])
        self._store(times, states)
        self.samples.append((float(times[-1]), piece))
        return float(times[-1]), np.array(states[:, -1]), fired

    def finish(self, ended: str) -> ImpactRun:
        """All of it as one trajectory."""
        t, x = np.concatenate(self.times), np.concatenate(self.states, axis=1)
        self._check(t, x)
        columns = Columns(self.module, t, x, self.forcing.sample(t, x))
        pieces = [piece for _, piece in self.samples]
        off = np.max([[*piece.residuals] for piece in pieces] or [[*Residuals()]], axis=0)
        header: dict[str, Any] = {
            **describe(self.module),
            **({key: pieces[-1].metadata[key] for key in ("method", "rtol", "atol")} if pieces else {}),
            "span": [float(t[0]), float(t[-1])],
            "status": 0 if ended == "end" else 1,
            **{key: sum(getattr(piece, key) for piece in pieces) for key in ("nfev", "njev", "nlu")},
            "residuals": dict(zip(Residuals._fields, off.tolist(), strict=True)),
            "event_names": list(self.gaps.names),
            "units": units_of(self.module, columns.names),
        }
        hits: dict[str, list[tuple[float, Array]]] = {name: [] for name in self.gaps.names}
        for time, impact in self.impacts:
            for name, impulse in zip(impact.names, impact.impulses, strict=True):
                if impulse > 0.0:
                    hits[name].append((time, impact.before))
        t_events = [np.array([time for time, _ in of]) for of in hits.values()]
        x_events = [np.array([before for _, before in of]).reshape(-1, len(x)).T for of in hits.values()]
        ends = np.array([end for end, _ in self.samples])
        only = x[:, :1]

        def sample(times: Array) -> Trajectory:
            which = np.searchsorted(ends, times)
            states = np.repeat(only, len(times), axis=1)
            for k in np.unique(which[which < len(pieces)]):
                states[:, which == k] = pieces[k].at(times[which == k]).x
            return Trajectory(
                times, states, Columns(self.module, times, states, self.forcing.sample(times, states)), header
            )

        parts = (t, x, columns, header, t_events, x_events, sample)
        run = ImpactRun.of(parts, self.impacts, self.breaks, ended)
        run.message = run.count
        return run

    def _check(self, t: Array, x: Array) -> None:
        """Refuse to hand out states beyond a wall."""
        values = self.gaps.values(t, x)
        beyond = values < -allowance(self.module.layout, self.gaps.names, BEYOND)[:, None]
        if beyond.any():
            k = int(np.flatnonzero(beyond.any(axis=0))[0])
            i = int(np.flatnonzero(beyond[:, k])[0])
            raise SimulationError(
                f"the gap {self.gaps.names[i]} is {values[i, k]:.6g} at t = {t[k]:.6g} s without an impact before: "
                "it jumps there, or it closes and opens within one step; give max_step",
                code="EG-EVENT",
            )
