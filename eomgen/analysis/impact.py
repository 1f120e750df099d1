"""Analysis: a state at an impact, or at which coordinates are locked -> the state after it, impulses, energy lost.

M (v+ - v-) + C_q^T i = sum n g, C_q v+ = C_q v-, with the normals n = d(gap)/dt by v; C_q has rows of what is closed of
constraints that close and open, too.  The law that gives the impulses g is in :mod:`.impact_law`, that of gaps with
friction in :mod:`.impact_friction`.  Locked coordinates keep rate 0 (their impulses may pull).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base import algebra
from ..base.algebra import Array, definite_factor
from ..base.limits.constraints import MEASURED
from ..base.limits.impacts import BEYOND, HELD, ROUNDED, TOUCHING
from ..errors import UsageError, at_odds, cannot, ill_shaped, no_such, untrue
from ..runtime.layout import Layout
from ..runtime.room import read_flag, read_number, read_numbers
from ..runtime.signal_rates import drift, moving_inputs
from .closed_rows import with_closed_rows
from .constrained import ProjectedStates, conditioned_motions, prepare, solve_multipliers
from .impact_friction import Sliding, strike
from .impact_gaps import Gaps, allowance, by_velocity, check_gaps
from .impact_law import collide
from .impact_sliding import Rough, check_friction, find_sliding
from .tables import as_text
from .true_distances import require_distances

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.signals import Forcing


@dataclass(frozen=True)
class Impact:
    """The result of an impact: states before and after it, impulses and the energy lost.

    Attributes
    ----------
    x : (n_x,) array
        The state right after it.
    before : (n_x,) array
        The state right before it, on the constraints.
    names : tuple of str
        Gaps, then locked coordinates: ``hit["gap"]`` is an impulse.
    impulses : (n,) array
        N s, or N m s: along the gap, positive where it pushes; on a locked coordinate.
    rates_before, rates_after : (n,) arrays
        Of the gaps and locked coordinates; of gaps that move by themselves in time, this included.
    constraint_impulses : (n_rows,) array
        Of all constraint rows, with the sign of ``multipliers``.
    energy_lost : float
        Kinetic energy before less that after (J).  Negative only where what moves by itself brings energy in: a gap
        that moves in time, or a belt, whose speed is part of the sliding velocity.
    friction : dict of str to (d,) array
        By gap with friction, the impulses along its sliding velocities.
    sliding_before, sliding_after : dicts of str to (d,) array
        These velocities.
    """

    x: Array
    before: Array
    names: tuple[str, ...]
    impulses: Array
    rates_before: Array
    rates_after: Array
    constraint_impulses: Array
    energy_lost: float
    friction: dict[str, Array] = field(default_factory=dict)
    sliding_before: dict[str, Array] = field(default_factory=dict)
    sliding_after: dict[str, Array] = field(default_factory=dict)

    def __getitem__(self, name: str) -> float:
        if name not in self.names:
            raise no_such(f"no gap or locked coordinate {name!r}; there are {', '.join(self.names)}")
        return float(self.impulses[self.names.index(name)])

    def __repr__(self) -> str:
        facts = [
            (name, f"impulse {g:.6g}, rate {before:.6g} -> {after:.6g}")
            for name, g, before, after in zip(
                self.names, self.impulses, self.rates_before, self.rates_after, strict=True
            )
        ]
        for name, impulses in self.friction.items():
            before, after = self.sliding_before[name], self.sliding_after[name]
            texts = (", ".join(f"{x:.6g}" for x in row) for row in (impulses, before, after))
            facts.append((f"friction of {name}", "impulse {}, sliding {} -> {}".format(*texts)))
        return as_text("Impact", [*facts, ("energy lost", f"{self.energy_lost:.6g} J")])


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
    module = module if p is None and u is None else module.bind(p, u)
    found, locked = check_gaps(module.layout, gaps, lock)
    rough = check_friction(module.layout, friction, found)
    if rough and locked:
        raise at_odds("an impact has friction= or lock=, not both: lock the coordinates in a call before or after it")
    states = _one_state(module, read_number("t", t), x)
    watched = Gaps(module, tuple(found))
    rows = watched.normals(float(states.t[0]), states.x[:, 0])
    if not read_flag("closed", closed):
        _require_closed(watched, states)
    return _strike_gaps(states, watched, rows, found, locked, rough)


def strike_run(gaps: Gaps, t: float, x: Array, restitutions: Mapping[str, float], rough: Rough) -> Impact:
    """The impact of some gaps of a run, with inputs as they are then."""
    u = gaps.inputs(t, x)
    module = gaps.module if u is None else gaps.module.bind(None, u)
    own, states = Gaps(module, tuple(restitutions), gaps.forcing), _one_state(module, t, x)
    return _strike_gaps(states, own, own.normals(t, states.x[:, 0]), restitutions, (), rough)


def describe_negative_gaps(
    module: BoundModel, t: float, x: Array, events: Sequence[Mapping[str, Any]], forcing: Forcing
) -> str:
    """Says which gaps of a model's events are negative where a run begins, where bodies go on through each other."""
    values = module.kernels.timed("events", nan=True)(t, x, u=forcing(t, x) if forcing else None)
    limit = BEYOND * max(1.0, module.layout.length)
    found = [
        f"{event['name']} is {value:.6g}"
        for event, value in zip(events, values.tolist(), strict=True)
        if event.get("restitution") is not None and value < -limit
    ]
    if not found:
        return ""
    return (
        f"the gap of event {', '.join(found)} at the start: an impact comes where it falls to 0 from above, so until "
        "it has been positive the bodies move through each other; give a start where the gap is open"
    )


def strike_events(
    module: BoundModel,
    t: float,
    x: Array,
    events: Sequence[Mapping[str, Any]],
    fired: Sequence[int],
    forcing: Forcing,
) -> Array:
    """The state (n_x,) after the impacts of the model's own events, those that happened and any gap that is closed.

    Parameters
    ----------
    module : BoundModel
    t : float
    x : (n_x,) array
    events : sequence of mappings
        As in the metadata; those with a restitution are gaps.
    fired : sequence of int
        Events that happened.
    forcing : Forcing
        Inputs of the run.

    Raises
    ------
    UsageError
        A gap depends on velocities or on such an input, or no impulses obey the constraints and the laws.
    """
    layout, u = module.layout, forcing(t, x)
    module = module.bind(None, u)
    kernel = module.kernels.timed("events", nan=True)
    values = kernel(t, x, u=u)
    near = TOUCHING * max(1.0, layout.length)
    gaps = {
        i: float(event["restitution"])
        for i, event in enumerate(events)
        if event.get("restitution") is not None and (i in fired or abs(values[i]) <= near)
    }
    for k in forcing.state_dependent:
        change = kernel(t, x, u=u + np.eye(layout.n_u)[k]) - values
        for i in gaps:
            if change[i] != 0.0:
                raise cannot(
                    f"event {events[i]['name']}: the gap depends on the input {layout.u[k]}, which depends on the "
                    "state, so an impact would change its rate; write the gap in coordinates instead"
                )
    slopes = dict(zip(gaps, module.kernels.rows("event_slopes", [*gaps], t, x, u), strict=True))
    states = _one_state(module, t, x)
    q, v = states.q[:, 0], states.v[:, 0]
    for i in gaps:
        if np.abs(slopes[i][layout.n_q :]).max(initial=0.0) > 0.0:
            raise cannot(f"event {events[i]['name']}: a gap must depend on positions only, not on velocities")
    rows = np.array([by_velocity(layout, q, slopes[i][: layout.n_q]) for i in gaps])
    moved = moving_inputs(layout, u)
    rates = rows @ v + drift(lambda time: kernel(time, x, u=u + (time - t) * moved), t)[[*gaps]]
    names = [str(events[i]["name"]) for i in gaps]
    rough = {
        str(events[i]["name"]): (float(events[i]["friction"]), tuple(events[i]["slip"]))
        for i in gaps
        if events[i].get("friction") is not None
    }
    sliding = find_sliding(module, rough, names, t, states.x[:, 0], forcing)
    return _apply(states, rows, rates, np.array([*gaps.values()]), names, sliding).x


def _one_state(module: BoundModel, t: float, x: ArrayLike) -> ProjectedStates:
    states = prepare(module, t, x)
    if not states.single:
        raise ill_shaped(f"x must be one state ({module.layout.n_x},)")
    return states


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
        held = _locks(states, locked)
        rows, rates = np.vstack([rows, held]), np.concatenate([rates, held @ states.v[:, 0]])
    return _apply(states, rows, rates, np.array([*restitutions.values()]), (*gaps.names, *locked), sliding)


def _locks(states: ProjectedStates, names: Sequence[str]) -> Array:
    layout = states.module.layout
    rows = np.zeros((len(names), layout.n_v))
    for i, name in enumerate(names):
        if name in layout.velocity_labels:
            rows[i, layout.velocity_labels.index(name)] = 1.0
        else:
            every = states.evaluate(states.module.kernels.state("loop_coordinate_jacobian"), states.q)
            rows[i] = every[layout.loops.index(name), :, 0]
    return rows


def _apply(
    states: ProjectedStates, rows: Array, rates: Array, e: Array, names: Sequence[str], sliding: Sliding
) -> Impact:
    layout, v = states.module.layout, states.v[:, 0]
    C_q, scales = with_closed_rows(states.module, float(states.t[0]), states.x[:, 0], states.jacobian()[0])
    M = states.evaluate(states.module.kernels.mass_matrix, states.q)[..., 0]
    B, condition = conditioned_motions(C_q, scales)
    count = len(names)
    rows = np.vstack([rows.reshape(-1, layout.n_v), sliding.rows])
    rates = np.concatenate([read_numbers("rates", rates), sliding.rates])
    rest, fixed = _rounding(rows, v, B, condition, layout)
    for i in np.flatnonzero(fixed[:count]).tolist():
        if rates[i] < -rest[i] or (i >= len(e) and rates[i] > rest[i]):
            what = f"gap {names[i]} closes" if i < len(e) else f"lock: {names[i]} moves"
            raise untrue(
                f"{what} at the rate {rates[i]:.6g}, which drivers or constraints prescribe: no impulse can change it"
            )
    if B.shape[1]:
        factor = definite_factor(B.T @ M @ B, "an impact")
        H = np.where(fixed, 0.0, algebra.solve(factor, B.T @ rows.T))
        free = np.where(fixed[: len(rates)], 0.0, rates)
        free[count:] = rates[count:]  # a body may slide as a driver or a belt moves it
        if sliding.names:
            require_distances(states.module, float(states.t[0]), states.q[:, 0], rows[:count], names, sliding)
            impulses, z = strike(H, free, e, rest, sliding.coefficients, sliding.owner, names)
        else:
            impulses, z = collide(H, free, e, rest, names)
        change = B @ algebra.solve(factor.T, z)
    else:
        impulses, change = np.zeros(len(rates)), np.zeros_like(v)
    after = np.concatenate([states.q[:, 0], v + change])
    held = solve_multipliers(C_q[None], (M @ change - rows.T @ impulses)[:, None], scales)[: layout.n_c, 0]
    lost = 0.0 - float(change @ M @ (v + 0.5 * change))
    before = np.ascontiguousarray(states.x[:, 0])
    final = rates + rows @ change
    rubbed = [
        {names[i]: x[count:][sliding.owner == i] for i in sliding.owner.tolist()} for x in (impulses, rates, final)
    ]
    return Impact(after, before, tuple(names), impulses[:count], rates[:count], final[:count], held, lost, *rubbed)


def _rounding(rows: Array, v: Array, B: Array, condition: float, layout: Layout) -> tuple[Array, Array]:
    """Sizes of rates (n,) that are rounding, and which rates (n,) no impulse can change."""
    s = layout.scales.q
    lengths = np.linalg.norm(rows * s, axis=1)
    fast = float(np.linalg.norm(v / s))
    rest = ROUNDED * (np.abs(rows) @ np.abs(v) + condition * lengths * fast)
    part = np.linalg.norm((rows @ B), axis=1)
    fixed = part <= max(HELD, ROUNDED * condition) * lengths
    rest[fixed] += HELD * lengths[fixed] * fast
    return rest, fixed
