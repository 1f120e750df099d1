"""A Module, a state and gaps that close -> impulses and the state after the impact.

M (v+ - v-) + C_q^T i = sum n g, C_q v+ = C_q v-, with the normals n = d(gap)/dt by v; C_q has rows of what is closed of
constraints that close and open, too.  The laws that give the impulses g, with friction and without it, are in
:mod:`.impact_equations`.  Locked coordinates keep rate 0 (their impulses may pull).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ...base import algebra
from ...base.algebra import Array, definite_factor
from ...base.limits.impacts import BEYOND, ELSEWHERE, FIXED, ROUNDED, TOUCHING
from ...base.results import Result, plain, same_keys
from ...errors import (
    cannot,
    ill_placed,
    ill_shaped,
    no_such,
    untrue,
)
from ..argument_checks import read_numbers
from ..constrained import ProjectedStates, conditioned_motions, prepare, solve_multipliers, with_closed_rows
from ..inputs import Expression, derive, drift, moving_inputs, rate_pairs
from ..kernels import eager
from ..layout import Layout
from .impact_equations import Sliding, collide, require_distances, strike

if TYPE_CHECKING:
    from ..bound_model import BoundModel
    from ..inputs import Forcing


# -- gaps --------------------------------------------------------------------------------------------------------------


class Gaps:
    """Coordinates and outputs of a bound module that are followed as gaps; ``forcing`` has the inputs that vary."""

    def __init__(self, module: BoundModel, names: Sequence[str], forcing: Forcing | None = None) -> None:
        self.module, self.layout, self.names, self.forcing = module, module.layout, tuple(names), forcing
        layout = module.layout
        self.outputs = [(i, layout.y.index(n)) for i, n in enumerate(names) if n not in layout.q + layout.loops]
        self.loops = [(i, layout.loops.index(n)) for i, n in enumerate(names) if n in layout.loops]
        self.tree = [(i, layout.q.index(n)) for i, n in enumerate(names) if n in layout.q]
        self._kernel = cache(module.kernels.kernel)

    def inputs(self, t: float, x: Array) -> Array | None:
        """u (n_u,) at a state; None for the module's own."""
        return self.forcing(t, x) if self.forcing else None

    def values(self, t: Any, x: Array) -> Array:
        """Of one state (n,), or of states (n_x, k) at times (k,): (n, k)."""
        q, v = np.ascontiguousarray(x[: self.layout.n_q]), np.ascontiguousarray(x[self.layout.n_q :])
        result = np.empty((len(self.names), *x.shape[1:]))
        for i, j in self.tree:
            result[i] = q[j]
        if self.loops or self.outputs:
            u = None if not self.forcing else self.forcing(t, x) if x.ndim == 1 else self.forcing.sample(t, x)
            if self.loops:
                values = self._kernel("loop_coordinates")(q, v, np.zeros_like(v), t=t, u=u)
                for i, j in self.loops:
                    result[i] = values[0, j]
            if self.outputs:
                values = self._kernel("motion_outputs")(q, v, np.zeros_like(v), t=t, u=u)
                for i, j in self.outputs:
                    result[i] = values[j]
        return result

    def normals(self, t: float, x: Array) -> Array:
        """Derivatives of the rates by v, (n, n_v)."""
        layout, u = self.layout, self.inputs(t, x)
        q, v = np.ascontiguousarray(x[: layout.n_q]), np.ascontiguousarray(x[layout.n_q :])
        rows = np.zeros((len(self.names), layout.n_v))
        for i, _ in self.tree:
            rows[i, layout.velocity_labels.index(self.names[i])] = 1.0
        if self.loops:
            every = self.module.kernels.loop_coordinate_jacobian(q, t=t, u=u)
            for i, j in self.loops:
                rows[i] = every[j]
        if self.outputs:
            slopes = self._kernel("output_derivatives")(q, v, np.zeros_like(v), t=t, u=u)
            for i, j in self.outputs:
                if np.abs(slopes[j, layout.n_q : layout.n_x + layout.n_v]).max(initial=0.0) > 0.0:
                    raise cannot(
                        f"gap {self.names[i]}: this output depends on velocities; a gap must depend on positions only"
                    )
                rows[i] = slopes[j, : layout.n_q] @ layout.scales.rates(q, np.eye(layout.n_v))
        return rows

    def rates(self, t: float, x: Array, rows: Array | None = None) -> Array:
        """Of one state, (n,): along v, and by themselves in time."""
        rows = self.normals(t, x) if rows is None else rows
        v = x[self.layout.n_q :]
        rates = rows @ v
        if self.outputs:
            each = Gaps(self.module.bind(None, self.inputs(t, x)), self.names)  # with inputs that stand still
            rates += drift(lambda time: each.values(time, x), t)
            for i, j in self.outputs if self.layout.n_u else ():
                rates[i] += self._pushed(t, x, j)
        if self.loops:
            q = np.ascontiguousarray(x[: self.layout.n_q])
            values = self._kernel("loop_coordinates")(
                q, np.ascontiguousarray(v), np.zeros_like(v), t=t, u=self.inputs(t, x)
            )
            for i, j in self.loops:
                rates[i] = values[1, j]
        return np.asarray(rates)

    def _pushed(self, t: float, x: Array, output: int) -> float:
        """What the rates of inputs add to the rate of an output; those of inputs that are held are 0."""
        layout, n, u = self.layout, self.layout.n_x + self.layout.n_v, self.inputs(t, x)
        q, v = np.ascontiguousarray(x[: layout.n_q]), np.ascontiguousarray(x[layout.n_q :])
        slopes = self._kernel("output_derivatives")(q, v, np.zeros_like(v), t=t, u=u)[output, n : n + layout.n_u]
        rates = moving_inputs(layout, self.module.u if u is None else u)
        for index in np.flatnonzero(slopes):
            if self.forcing is not None and index in self.forcing.varying:
                rates[index] = _rate_of_input(self.forcing, int(index), t, x)
        return float(slopes @ rates)


def _rate_of_input(forcing: Forcing, index: int, t: float, x: Array) -> float:
    """The rate of an input that varies, by its place in u."""
    name, value = forcing.names[index], forcing.formulas.get(index, forcing.varying[index])
    message = f"input {name} depends on the state, and so does its rate, which an impact changes"
    if getattr(value, "depends_on_state", False):
        raise cannot(message)
    known = value.rate if isinstance(value, Expression) else getattr(value, "derivative", lambda: None)()
    if known is not None:
        rate = derive(name, dict(rate_pairs(forcing.layout)).get(name, f"d/dt {name}"), value)
        rate = rate.function(forcing.parameters) if isinstance(rate, Expression) else rate
        return float(rate(t, x) if callable(rate) else rate)
    if any(forcing(t, x + move)[index] != forcing(t, x)[index] for move in ELSEWHERE * np.eye(len(x))):
        raise cannot(message)
    return float(drift(lambda time: forcing(time, x)[[index]], t)[0])


def allowance(layout: Layout, names: Sequence[str], tolerance: float) -> Array:
    """Sizes (n,) at which gaps count as 0: a part of the model's length, or of 1 for angles."""
    return np.array([tolerance * (1.0 if layout.unit(name) == "rad" else layout.length) for name in names])


# -- coefficients of friction ------------------------------------------------------------------------------------------


#: Units of gaps and sliding velocities whose impulses are in N s or N m s.
Rough = Mapping[str, tuple[float, tuple[str, ...]]]
RATES = ("m/s", "m*s^-1", "m s^-1", "rad/s", "1/s")
SI = ("", "m", "rad", *RATES)


def _is_velocity(layout: Layout, output: str) -> bool:
    """Whether an output is a velocity by how it is written or by its unit, though perhaps no velocity moves it."""
    return output in layout.info.velocity_outputs or layout.unit(output) in RATES


def find_sliding(
    module: BoundModel, rough: Rough, gaps: Sequence[str], t: float, x: Array, forcing: Forcing | None = None
) -> Sliding:
    """The sliding velocities of gaps, all those of the impact, at a state x (n_x,) of a bound module.

    ``rough`` gives a gap its coefficient and the names of its sliding velocities; ``forcing`` has the inputs that vary.
    """
    layout, n_q = module.layout, module.layout.n_q
    names = [name for gap in gaps if gap in rough for name in rough[gap][1]]
    owner = np.array([i for i, gap in enumerate(gaps) if gap in rough for _ in rough[gap][1]], dtype=np.int64)
    mu = np.array([rough[gap][0] if gap in rough else 0.0 for gap in gaps])
    rows, rates = np.zeros((len(names), layout.n_v)), np.zeros(len(names))
    q, v = np.ascontiguousarray(x[:n_q]), np.ascontiguousarray(x[n_q:])
    still = np.zeros_like(v)
    outputs = any(name in layout.y for name in names)
    slopes, rest, values = np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0)
    if outputs:
        slopes, rest = (module.kernels.output_derivatives(q, w, still, t=t) for w in (v, still))
        values = module.kernels.motion_outputs(q, v, still, t=t)
    for k, name in enumerate(names):
        j = layout.y.index(name) if name in layout.y else -1
        if j < 0 or not (_is_velocity(layout, name) or slopes[j, n_q : layout.n_x].any()):  # a place, whose rate it is
            this_gap = Gaps(module, (name,), forcing)
            rows[k], rates[k] = this_gap.normals(t, x)[0], this_gap.rates(t, x)[0]
            continue
        by_v = slopes[j, n_q : layout.n_x]
        uneven = np.abs(by_v - rest[j, n_q : layout.n_x]) > ROUNDED * np.abs(by_v)
        if uneven.any() or np.abs(slopes[j, layout.n_x : layout.n_x + layout.n_v]).max(initial=0.0) > 0.0:
            raise ill_placed(
                f"output {name} cannot be the sliding velocity of {gaps[owner[k]]}: it must be linear in the "
                "velocities and know no accelerations, as vx(rod.tip)"
            )
        rows[k], rates[k] = by_v, values[j]
    return Sliding(tuple(names), owner, mu, rows, rates)


# -- the impact --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, repr=False)
class Impact(Result):
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

    KEYS = same_keys("names", "impulses", "energy_lost", "rates_before", "rates_after", "constraint_impulses")
    title = "Impact"

    def to_dict(self) -> dict[str, Any]:
        sliding = same_keys("friction", "sliding_before", "sliding_after") if self.friction else ()
        return super().to_dict() | {key: plain(getattr(self, key)) for key in sliding}

    @property
    def facts(self) -> list[tuple[str, str]]:
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
        return [*facts, ("energy lost", f"{self.energy_lost:.6g} J")]


def describe_negative_gaps(
    module: BoundModel, t: float, x: Array, events: Sequence[Mapping[str, Any]], forcing: Forcing
) -> str:
    """Says which gaps of a model's events are negative where a run begins, where bodies go on through each other."""
    values = module.kernels.kernel("events", nan=True)(t, x, u=forcing(t, x) if forcing else None)
    limit = BEYOND * max(1.0, module.layout.length)
    result = [
        f"{event['name']} is {value:.6g}"
        for event, value in zip(events, values.tolist(), strict=True)
        if event.get("restitution") is not None and value < -limit
    ]
    if not result:
        return ""
    return (
        f"the gap of event {', '.join(result)} at the start: an impact comes where it falls to 0 from above, so until "
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
    """The state (n_x,) after the impacts of the model's own events, those that ``fired`` and any gap that is closed.

    Events are as in the metadata; those with a restitution are gaps.
    """
    layout, u = module.layout, forcing(t, x)
    module = module.bind(None, u)
    kernel = module.kernels.kernel("events", nan=True)
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
    by_state = np.ix_([*gaps], range(layout.n_x))
    slopes = dict(zip(gaps, module.kernels.rows("event_derivatives", by_state, t, x, u), strict=True))
    states = one_state(module, t, x)
    q, v = states.q[:, 0], states.v[:, 0]
    for i in gaps:
        if np.abs(slopes[i][layout.n_q :]).max(initial=0.0) > 0.0:
            raise cannot(f"event {events[i]['name']}: a gap must depend on positions only, not on velocities")
    N = layout.scales.rates(q, np.eye(layout.n_v))
    rows = np.array([slopes[i][: layout.n_q] @ N for i in gaps])
    moved = moving_inputs(layout, u)
    rates = rows @ v + drift(lambda time: kernel(time, x, u=u + (time - t) * moved), t)[[*gaps]]
    names = [str(events[i]["name"]) for i in gaps]
    rough = {
        str(events[i]["name"]): (float(events[i]["friction"]), tuple(events[i]["slip"]))
        for i in gaps
        if events[i].get("friction") is not None
    }
    sliding = find_sliding(module, rough, names, t, states.x[:, 0], forcing)
    return apply(states, rows, rates, np.array([*gaps.values()]), names, sliding).x


def one_state(module: BoundModel, t: float, x: ArrayLike) -> ProjectedStates:
    """A state on the constraints, or a UsageError where there are several."""
    states = prepare(module, t, x)
    if not states.single:
        raise ill_shaped(f"x must be one state ({module.layout.n_x},)")
    return states


def apply(
    states: ProjectedStates, rows: Array, rates: Array, e: Array, names: Sequence[str], sliding: Sliding
) -> Impact:
    """Solve for the impact of gaps, then of locked coordinates, with their normals (n, n_v) and rates (n,)."""
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
            core: Any = eager(states.module.core)
            impulses, z = strike(core.solve_contacts, H, free, e, rest, sliding.coefficients, sliding.owner, names)
        else:
            impulses, z = collide(H, free, e, rest, names)
        change = B @ algebra.solve(factor.T, z)
    else:
        impulses, change = np.zeros(len(rates)), np.zeros_like(v)
    after = np.concatenate([states.q[:, 0], v + change])
    reactions = solve_multipliers(C_q[None], (M @ change - rows.T @ impulses)[:, None], scales)[: layout.n_c, 0]
    lost = 0.0 - float(change @ M @ (v + 0.5 * change))
    before = np.ascontiguousarray(states.x[:, 0])
    final = rates + rows @ change
    rubbed = [
        {names[i]: x[count:][sliding.owner == i] for i in sliding.owner.tolist()} for x in (impulses, rates, final)
    ]
    return Impact(after, before, tuple(names), impulses[:count], rates[:count], final[:count], reactions, lost, *rubbed)


def _rounding(rows: Array, v: Array, B: Array, condition: float, layout: Layout) -> tuple[Array, Array]:
    """Sizes of rates (n,) that are rounding, and which rates (n,) no impulse can change."""
    s = layout.scales.q
    lengths = np.linalg.norm(rows * s, axis=1)
    fast = float(np.linalg.norm(v / s))
    rest = ROUNDED * (np.abs(rows) @ np.abs(v) + condition * lengths * fast)
    part = np.linalg.norm((rows @ B), axis=1)
    fixed = part <= max(FIXED, ROUNDED * condition) * lengths
    rest[fixed] += FIXED * lengths[fixed] * fast
    return rest, fixed
