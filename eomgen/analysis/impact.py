"""A Module, a state and gaps that close -> impulses and the state after; runs in which closing gaps are impacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.algebra import Array
from ..base.limits.constraints import MEASURED
from ..base.limits.impacts import BEYOND, MOMENT, RESTING, STARTED, STILL, TOUCHING
from ..base.limits.runs import CROWDED
from ..base.value_rules import read_count
from ..errors import (
    SimulationError,
    UsageError,
    at_odds,
    cannot,
    ill_typed,
    incomplete,
    no_such,
    off_range,
)
from ..runtime.argument_checks import check_names, read_flag, read_number, without_dots
from ..runtime.constrained import ProjectedStates
from ..runtime.impacts.impact import SI, Gaps, Impact, Rough, allowance, apply, find_sliding, one_state
from ..runtime.inputs import Forcing
from ..runtime.layout import Layout
from ..runtime.refusals import require_support
from ..runtime.runs.events import WAIT, Events, RunEvent
from ..runtime.runs.integrate import header_of
from ..runtime.runs.run_arguments import find_state, set_up
from ..runtime.runs.simulate import simulate
from ..runtime.storage import Stored
from ..runtime.trajectory import Columns, Residuals, Span, Start, Trajectory, describe
from .drive import coordinate_slopes

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.inputs import Forcing

# -- what is given -----------------------------------------------------------------------------------------------------


def check_gaps(
    layout: Layout, gaps: Any = None, lock: Any = (), keys: tuple[str, str] = ("gaps", "lock")
) -> tuple[dict[str, float], tuple[str, ...]]:
    """Gaps with their restitutions and the names that are locked, if all of them are there and can be.

    Parameters
    ----------
    gaps, lock
        As a user gives them.
    keys : (str, str)
        What these are called where the user gives them.
    """
    word, other = keys
    if gaps is not None and not isinstance(gaps, Mapping):
        raise ill_typed(f"{word} must be a mapping of names to restitutions, {{name: 0.5}}, not {gaps!r}")
    locked = (lock,) if isinstance(lock, str) else lock
    if not isinstance(locked, Sequence) or not all(isinstance(name, str) for name in locked):
        raise ill_typed(f"{other} must be a list of coordinates, not {lock!r}")
    if not gaps and not locked:
        raise incomplete("an impact needs gaps={name: restitution} or lock=[coordinates]")
    if layout.general_rates:
        raise cannot("impacts need a model with q' = v, and the rates of this model's coordinates are given")
    gaps, locked = without_dots(gaps or {}, layout.instances), [layout.plain(name) for name in locked]
    coordinates = [*layout.velocity_labels, *layout.loops]
    placed = [name for name in coordinates if name in layout.q + layout.loops]
    check_names("coordinate or output", gaps, [*placed, *layout.y], place=word)
    check_names("coordinate", locked, coordinates, place=other)
    result: dict[str, float] = {}
    for name, e in (gaps or {}).items():
        result[name] = read_number(f"{word}: the restitution of {name}", e)
        if not 0.0 <= result[name] <= 1.0:
            raise off_range(f"{word}: the restitution of {name} must be between 0 and 1, not {e}")
    return result, tuple(locked)


def check_friction(layout: Layout, friction: Any, gaps: Mapping[str, float], word: str = "friction") -> Rough:
    """Coefficients of friction of gaps and what slides there, if all of it is there and can be.

    Parameters
    ----------
    friction
        As a user gives it: {gap: (coefficient, name or two names)}.
    gaps : mapping of str to float
        The gaps of the call.
    word : str
        What it is called where the user gives it.
    """
    if friction is None:
        return {}
    if not isinstance(friction, Mapping):
        raise ill_typed(f"{word} must be a mapping {{gap: (coefficient, sliding velocity)}}, not {friction!r}")
    result: dict[str, tuple[float, tuple[str, ...]]] = {}
    placed = [name for name in (*layout.velocity_labels, *layout.loops) if name in layout.q + layout.loops]
    allowed = [*placed, *layout.y]
    friction = without_dots(friction, layout.instances)
    check_names("gap", friction, gaps, place=word)
    for gap, raw in friction.items():
        if isinstance(raw, str) or not isinstance(raw, Sequence) or len(raw) != 2:
            raise ill_typed(
                f"{word}: of gap {gap} give the coefficient and the output that is its sliding velocity, "
                f"(0.3, 'slide'), not {raw!r}"
            )
        mu = read_number(f"{word}: the coefficient of {gap}", raw[0])
        if not mu >= 0.0:
            raise off_range(f"{word}: the coefficient of {gap} must be 0 or greater, not {raw[0]}")
        names = (raw[1],) if isinstance(raw[1], str) else tuple(raw[1])
        if not 1 <= len(names) <= 2 or not all(isinstance(name, str) for name in names):
            raise ill_typed(
                f"{word}: of gap {gap} give one sliding velocity, or two at right angles in space, not {raw[1]!r}"
            )
        names = tuple(layout.plain(name) for name in names)
        check_names(f"coordinate or output for the sliding of {gap}:", names, allowed, place=word)
        for name in (gap, *names):
            if layout.unit(name) not in SI:
                raise UsageError(
                    f"{word}: the output {name} is in {layout.unit(name)}, and friction at {gap} needs SI units: give "
                    "another output without a unit",
                    code="EG-UNIT",
                )
        result[gap] = mu, names
    return result


# -- one impact --------------------------------------------------------------------------------------------------------


@np.errstate(all="ignore")
def impact(
    module: BoundModel,
    /,
    t: float,
    x: ArrayLike,
    gaps: Mapping[str, float] | None = None,
    *,
    lock: Sequence[str] = (),
    closed: bool = False,
    friction: Mapping[str, tuple[float, str | Sequence[str]]] | None = None,
    p: Any = None,
    u: Any = None,
) -> Impact:
    """Compute the state after an impact, or after coordinates are locked suddenly.

    Parameters
    ----------
    t : float
    x : (n_x,) array
        The state right before; projected onto the constraints first.
    gaps : mapping of str to float
        Gaps and their coefficients of restitution, 0 to 1.  A gap is a coordinate or an output (a function of
        positions) that is 0 now and must not become negative.  Gaps that open have no impact.
    lock : sequence of str
        Coordinates that stop (plastic, whatever the sign of the impulse).
    closed : bool
        Treat the gaps as closed at any value, as for a stop that is placed where a coordinate is now.
    friction : mapping of str to (float, str or two str), optional
        Coulomb friction of gaps: the coefficient, and the output or coordinate that is the sliding velocity, linear in
        the velocities (of a place its rate counts); in space two of them, at right angles.
    p, u : optional
        As for ``bind``.

    Returns
    -------
    Impact
        ``x`` after it, ``impulses`` by name, ``rates_before``, ``rates_after``, ``constraint_impulses``,
        ``energy_lost``.

    Raises
    ------
    UsageError
        A name is unknown; a gap is not 0 (within 1e-6 lengths of the model, or rad); no impulses satisfy the laws;
        drivers close a gap; or friction is given beside lock.

    Notes
    -----
    Without friction: Newton's law of restitution with complementarity, for all gaps at once that close or are at
    rest: each impulse is 0 or positive, rate+ + e min(rate-, 0) too, and one of the two is 0 (Moreau 1988; Pfeiffer and
    Glocker, Multibody Dynamics with Unilateral Contacts, ch. 8; Brogliato, Nonsmooth Mechanics, ch. 5).  A gap that was
    opening and is closing after that makes a further impact at the same instant.  No energy is ever gained, but
    from gaps that move in time and, with friction, from belts.  Springs, dampers and other finite forces have no
    part in it.  Velocities after the impact are unique; impulses are not where gaps depend on each other, and the law
    itself is a choice: momentum and energy alone do not determine what several bodies that touch do.

    With friction, one gap with one sliding velocity follows Routh's method with Poisson's restitution: sliding,
    sticking and sliding back within the impact are exact (Wang and Mason 1992).  In space, and where gaps that move
    each other are closed together, impulses obey Newton's and Coulomb's laws for the velocities after the impact; where
    that would bring in energy, restitutions are multiplied by the largest factor with which it does not.
    """
    module = module.bind(p, u)
    result, locked = check_gaps(module.layout, gaps, lock)
    rough = check_friction(module.layout, friction, result)
    if rough and locked:
        raise at_odds("an impact has friction= or lock=, not both: lock the coordinates in a call before or after it")
    states = one_state(module, read_number("t", t), x)
    watched = Gaps(module, tuple(result))
    rows = watched.normals(float(states.t[0]), states.x[:, 0])
    if not read_flag("closed", closed):
        _require_closed(watched, states)
    return _strike_gaps(states, watched, rows, result, locked, rough)


def strike_run(gaps: Gaps, t: float, x: Array, restitutions: Mapping[str, float], rough: Rough) -> Impact:
    """The impact of some gaps of a run, with inputs as they are then."""
    u = gaps.inputs(t, x)
    module = gaps.module if u is None else gaps.module.bind(None, u)
    striking, states = Gaps(module, tuple(restitutions), gaps.forcing), one_state(module, t, x)
    return _strike_gaps(states, striking, striking.normals(t, states.x[:, 0]), restitutions, (), rough)


def _require_closed(gaps: Gaps, states: ProjectedStates) -> None:
    values = gaps.values(float(states.t[0]), states.x[:, 0])
    for name, value, limit in zip(gaps.names, values, allowance(gaps.layout, gaps.names, MEASURED), strict=True):
        if abs(value) > limit:
            how = "open" if value > 0.0 else "closed too far"
            unit = gaps.layout.unit(name)
            raise UsageError(
                f"gap {name} is {value:.6g}{' ' * bool(unit)}{unit} ({how}); an impact needs a gap of 0, up to "
                f"{limit:.2g}; give a state where the gap is 0, or treat any gap as closed (closed=True, --closed)",
                code="EG-EVENT",
            )


def _strike_gaps(
    states: ProjectedStates,
    gaps: Gaps,
    rows: Array,
    restitutions: Mapping[str, float],
    locked: tuple[str, ...],
    rough: Rough,
) -> Impact:
    t, x = float(states.t[0]), states.x[:, 0]
    rates = gaps.rates(t, x, rows)
    sliding = find_sliding(gaps.module, rough, gaps.names, t, x, gaps.forcing)
    if locked:
        locks = np.array([coordinate_slopes(states, name)[:, 0] for name in locked])
        rows, rates = np.vstack([rows, locks]), np.concatenate([rates, locks @ states.v[:, 0]])
    return apply(states, rows, rates, np.array([*restitutions.values()]), (*gaps.names, *locked), sliding)


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

    BESIDES = ("impacts", "breaks", "ended")
    impacts: list[tuple[float, Impact]]
    breaks: list[int]
    ended: str

    def __repr__(self) -> str:
        return (
            f"<ImpactRun of {self.name}: {len(self.t)} points, t = {self.t[0]:.6g} .. {self.t[-1]:.6g} s, {self.count}>"
        )

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
        ends, result, values = [0, *self.breaks, len(self.t)], [], self.to_numpy()
        energies = self.energies if self.has_energies else None
        for a, b in pairwise(ends):
            header = self.metadata | {"span": [float(self.t[a]), float(self.t[b - 1])], "event_names": []}
            columns = Stored(self.names, values[:, a:b], None if energies is None else energies[:, a:b])
            result.append(Trajectory(self.t[a:b], self.x[:, a:b], columns, header))
        return result


# -- gaps as events ----------------------------------------------------------------------------------------------------


AT_REST = 0.1  #: part of the size at which gaps count as closed by which one that stays closed may fall
NO_IMPACTS = 50  #: closings of gaps in a row, each right after the one before, without an impact
ENDLESS = 2**31 - 1  #: resets in a row for the loop, whose count is an int in C


class GapEvents(Events):
    """The events of one run: those of the model that end it or reset its state, and gaps that fall to 0.

    Parameters
    ----------
    restitutions : mapping of str to float
    rough : mapping
        As from :func:`check_friction`.
    most : int
        Impacts after which the run ends.
    end : float
        Of the run (s).
    controllers : mapping or None
        As for ``simulate``.

    Attributes
    ----------
    impacts : list of (float, Impact)
    ended : str
        Why the run is over; empty while it is not.
    """

    def __init__(
        self, gaps: Gaps, restitutions: Mapping[str, float], rough: Rough, most: int, end: float, controllers: Any
    ) -> None:
        super().__init__(gaps.layout, _ending(gaps.module), controllers)
        self.gaps, self.restitutions, self.rough, self.most, self.end = gaps, restitutions, rough, most, end
        self.limits = allowance(gaps.layout, gaps.names, TOUCHING)
        self.impacts: list[tuple[float, Impact]] = []
        self.fastest, self.ended = 0.0, ""
        self._first, self._known, self._values = len(self.names), (np.nan, b""), np.zeros(len(gaps.names))
        for i, name in enumerate(gaps.names):
            self.functions.append(RunEvent(partial(self._value, i), name, 0, -1, WAIT))
            self.names.append(name)
        self._lift = np.zeros(len(gaps.names))
        self._last, self._no_impacts = np.nan, 0

    def begin(self, t: float, x: Array) -> Array:
        """The state (n_x,) at the start, after an impact of gaps that are closed there."""
        self._start, values = t, self.gaps.values(t, x)
        low = values < -np.maximum(self.limits, allowance(self.gaps.layout, self.gaps.names, BEYOND))
        for i in np.flatnonzero(low):
            raise off_range(f"gaps: {self.gaps.names[i]} is {values[i]:.3g} at the start; a gap must be 0 or positive")
        return self._impact_of(t, x, values <= self.limits)

    def arm(self, t: float, x: Array) -> None:
        """Begin at a state: gaps that are closed there close again when they have opened, or fall further."""
        values, allowed = self.gaps.values(t, x), AT_REST * self.limits
        resting = (values <= allowed) & (self.gaps.rates(t, x) <= 0.0)
        self._lift = np.where(values < STARTED * self.limits, values, 0.0)
        self._lift[resting] = (values - allowed)[resting]
        self._known = np.nan, b""

    def encode(self) -> dict[str, Any]:
        """As the loop takes them; impacts may follow each other as fast as they do."""
        return {**(super().encode() or {}), "crowd": ENDLESS}

    def _value(self, i: int, t: float, x: Array) -> float:
        """A gap; all of them are requested in turn."""
        key = (t, x.tobytes())
        if key != self._known:
            self._known, self._values = key, self.gaps.values(t, x) - self._lift
        return float(self._values[i])

    def reset(self, module: BoundModel, forcing: Forcing, t: float, x: Array, fired: Sequence[int]) -> Array:
        gaps, known = [i for i in fired if i < self._first], len(self.impacts)
        x = super().reset(module, forcing, t, x, [i for i in gaps if self.model[i].action != WAIT])
        closed = self.gaps.values(t, x) <= self.limits
        closed[[i - self._first for i in fired if i >= self._first]] = True
        x = self._impact_of(t, x, closed)  # before the model's own impact of the same gap, which then finds it opening
        x = super().reset(module, forcing, t, x, [i for i in gaps if self.model[i].action == WAIT])
        if len(gaps) < len(fired):
            soon = t - self._last < CROWDED * (self.end - self._start) and len(self.impacts) == known
            self._last, self._no_impacts = t, self._no_impacts + 1 if soon else 0
            if self._no_impacts > NO_IMPACTS:
                raise self.crowded(t, self._no_impacts)
        if self.stays:
            self.arm(t, x)
        return x

    def crowded(self, t: float, count: int) -> SimulationError:
        return SimulationError(
            f"the gap {', '.join(self.gaps.names)} closes again and again at t = {t:.6g} s without an impact",
            code="EG-EVENT",
        )

    def _impact_of(self, t: float, x: Array, closed: NDArray[np.bool_]) -> Array:
        """The state after an impact of closed gaps, if one closes."""
        if closed.any():
            chosen = {name: e for (name, e), one in zip(self.restitutions.items(), closed, strict=True) if one}
            rough = {name: self.rough[name] for name in chosen if name in self.rough}
            impact = strike_run(self.gaps, t, x, chosen, rough)
            if (impact.impulses > 0.0).any():
                self.impacts.append((t, impact))
                self.fastest = max(self.fastest, float(np.abs(impact.rates_before).max()))
                x = impact.x
        slow = self._slow(t, x, closed)
        if slow.any() and self._pressed(t, x, slow):
            self.ended = "rest"
        elif len(self.impacts) >= self.most:
            self.ended = "impacts"
        self.over, self.stays = bool(self.ended), bool(slow.any())
        return x

    def _slow(self, t: float, x: Array, closed: NDArray[np.bool_]) -> NDArray[np.bool_]:
        if not closed.any() or t >= self.end:
            return np.zeros_like(closed)
        layout = self.gaps.layout
        speed = layout.scales.speed(x[layout.n_q :]) * max(1.0, layout.length)
        return np.asarray(closed & (self.gaps.rates(t, x) <= max(RESTING * self.fastest, STILL * speed)))

    def _pressed(self, t: float, x: Array, slow: NDArray[np.bool_]) -> bool:
        """Whether one of these gaps is pressed together, so that it would not stay 0 by itself."""
        x_rate = self.gaps.module.rhs(t, x, u=self.gaps.inputs(t, x))
        ahead, behind = (self.gaps.rates(t + h, x + h * x_rate) for h in (MOMENT, -MOMENT))
        pressed = (ahead - behind) / (2.0 * MOMENT)
        return bool((slow & (0.5 * pressed * (self.end - t) ** 2 < -self.limits)).any())


def _ending(module: BoundModel) -> list[str]:
    """The model's events that end a run."""
    declared = module.layout.info.events
    for event in declared:
        if int(event.get("terminal") or 0) > 1:
            raise cannot(
                f"event {event['name']} ends a run after {event['terminal']} times, and simulate_impacts cannot "
                "count them; give the gaps as events with restitution, and use simulate"
            )
    return [str(event["name"]) for event in declared if event.get("terminal")]


# -- the run -----------------------------------------------------------------------------------------------------------


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
        method, rtol, atol, max_step, first_step, controllers, as for ``simulate``.

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
    require_support(module.layout, "simulate_impacts")
    for key in ("events", "t_eval", "dense_output"):
        if key in options:
            raise no_such(
                f"simulate_impacts has no {key}=; use t_events of the run that it returns, and at(t) for any times"
            )
    most = read_count("most, the number of impacts,", most, 1)
    result, _ = check_gaps(module.layout, gaps)
    rough = check_friction(module.layout, friction, result)
    if not module.layout.n_dof:
        raise cannot(
            f"{module.name} has no degree of freedom: its drivers determine the motion, and no impact can change it"
        )
    bound, forcing, start, end = set_up(module, span, parameters, inputs)
    if end < start:
        raise cannot(f"a run with impacts goes forward in time, not from {start:.6g} s to {end:.6g} s")
    forcing.begin(start, end)
    watched, controllers = Gaps(bound, tuple(result), forcing if forcing else None), options.pop("controllers", None)
    events = GapEvents(watched, result, rough, most, end, controllers)
    before = find_state(bound, initial, start, forcing)
    first = events.begin(start, before)
    events.arm(start, first)
    run = None
    t, x = np.array([start]), first[:, None]
    if not events.ended and start < end:
        run = simulate(bound, (start, end), first, None, inputs, events=events, dense_output=True, **options)
        fresh = np.append(True, (np.diff(run.t) != 0.0) | (np.diff(run.x, axis=1) != 0.0).any(axis=0))
        t, x = run.t[fresh], run.x[:, fresh]
    if events.impacts and events.impacts[0][0] == start:
        t, x = np.append(start, t), np.hstack([before[:, None], x])
    return _record(bound, forcing, events, t, x, run, events.ended or ("event" if t[-1] < end else "end"))


def _record(
    module: BoundModel, forcing: Forcing, events: GapEvents, t: Array, x: Array, run: Trajectory | None, ended: str
) -> ImpactRun:
    """All of it as one trajectory; without a run where it ends at once."""
    gaps = events.gaps
    _refuse_beyond(gaps, t, x)
    columns = Columns(module, t, x, forcing.sample(t, x))
    options = {} if run is None else run.metadata
    counts = {key: 0 if run is None else getattr(run, key) for key in ("nfev", "njev", "nlu")}
    status, ends_at = 0 if ended == "end" else 1, (float(t[0]), float(t[-1]))
    residuals = Residuals() if run is None else run.residuals
    known = header_of(module.layout, options.get("method"), options, gaps.names, residuals, status, "", counts, ends_at)
    header = {**describe(module), **known}
    hits: dict[str, list[tuple[float, Array]]] = {name: [] for name in gaps.names}
    for time, impact in events.impacts:
        for name, impulse in zip(impact.names, impact.impulses, strict=True):
            if impulse > 0.0:
                hits[name].append((time, impact.before))
    t_events = [np.array([time for time, _ in of]) for of in hits.values()]
    x_events = [np.array([before for _, before in of]).reshape(-1, len(x)).T for of in hits.values()]
    times = {time for time, _ in events.impacts}
    breaks = [k for k in range(1, len(t)) if t[k] == t[k - 1] and float(t[k]) in times]
    only = x[:, :1]

    def sample(times: Array) -> Trajectory:
        states = np.repeat(only, len(times), axis=1) if run is None else run.at(times).x
        return Trajectory(times, states, Columns(module, times, states, forcing.sample(times, states)), header)

    made = ImpactRun.of((t, x, columns, header, t_events, x_events, sample), events.impacts, breaks, ended)
    header["message"] = made.count
    return made


def _refuse_beyond(gaps: Gaps, t: Array, x: Array) -> None:
    values = gaps.values(t, x)
    beyond = values < -allowance(gaps.layout, gaps.names, BEYOND)[:, None]
    if beyond.any():
        k = int(np.flatnonzero(beyond.any(axis=0))[0])
        i = int(np.flatnonzero(beyond[:, k])[0])
        raise SimulationError(
            f"the gap {gaps.names[i]} is {values[i, k]:.6g} at t = {t[k]:.6g} s without an impact before: "
            "it jumps there, or it closes and opens within one step; give max_step",
            code="EG-EVENT",
        )
