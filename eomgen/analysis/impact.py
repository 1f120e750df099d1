"""Analysis: a state at an impact, or at which coordinates are locked -> the state after it, impulses, energy lost.

M (v+ - v-) + C_q^T i = sum n g, C_q v+ = C_q v-, with the normals n = d(gap)/dt by v.  Frictionless impacts obey
Newton's law of restitution, gap'+ = -e gap'-, wherever their impulse pushes (Pfeiffer and Glocker, Multibody Dynamics
with Unilateral Contacts, ch. 8; Moreau 1988): 0 <= g, 0 <= gap'+ + e gap'-, and one of the two is 0.  Locked
coordinates keep rate 0 (an impact with e = 0 whose impulse may pull).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import UsageError
from ..numeric.rank_limits import STATE as RANK
from ..numeric.scales import Array
from ..runtime.layout import Layout
from .constrained import States, free_motions, prepare, solve_multipliers
from .linear import output_derivatives
from .tables import as_text

if TYPE_CHECKING:
    from ..runtime.module import Module

MOST_GAPS = 12  #: gaps that can meet at one instant
TOUCHING = 1e-8  #: gaps at most this open, in lengths of the model or rad, take part in an impact
SLACK = 1e-10  #: relative, of impulses and rates that count as 0


@dataclass(frozen=True)
class Impact:
    """What an impact does.

    Attributes
    ----------
    x : (n_x,) array
        The state right after it.
    before : (n_x,) array
        The state right before it, on the constraints.
    names : tuple of str
        Gaps, then locked coordinates.
    impulses : (n,) array
        N s, or N m s: along the gap, positive where it pushes; on a locked coordinate.
    rates_before, rates_after : (n,) arrays
        Of the gaps and locked coordinates.
    constraint_impulses : (n_rows,) array
        Of all constraint rows, with the sign of ``multipliers``.
    energy_lost : float
        Kinetic energy before less that after (J).
    """

    x: Array
    before: Array
    names: tuple[str, ...]
    impulses: Array
    rates_before: Array
    rates_after: Array
    constraint_impulses: Array
    energy_lost: float

    def __getitem__(self, name: str) -> float:
        if name not in self.names:
            raise UsageError(f"no gap or locked coordinate {name!r}; there are {', '.join(self.names)}")
        return float(self.impulses[self.names.index(name)])

    def __repr__(self) -> str:
        facts = [
            (name, f"impulse {g:.6g}, rate {before:.6g} -> {after:.6g}")
            for name, g, before, after in zip(
                self.names, self.impulses, self.rates_before, self.rates_after, strict=True
            )
        ]
        return as_text("Impact", [*facts, ("energy lost", f"{self.energy_lost:.6g} J")])


def strike(
    module: Module,
    t: float,
    x: ArrayLike,
    gaps: Mapping[str, float] | None = None,
    *,
    lock: Sequence[str] = (),
    p: Any = None,
    u: Any = None,
) -> Impact:
    """See :meth:`~..runtime.analyses.Analyses.impact`."""
    module = module if p is None and u is None else module.bind(p, u)
    gaps = dict(gaps or {})
    locked = (lock,) if isinstance(lock, str) else tuple(lock)
    check_gaps(module.layout, gaps, locked)
    return _strike(module, t, x, gaps, locked, _normals)


def strike_events(
    module: Module, t: float, x: Array, events: Sequence[Mapping[str, Any]], fired: Sequence[int], u: Array
) -> Array:
    """The state (n_x,) after the impacts of the model's own events, those that happened and any gap that is closed.

    Parameters
    ----------
    module : Module
    t : float
    x : (n_x,) array
    events : sequence of mappings
        As in the metadata; those with a restitution are gaps.
    fired : sequence of int
        Events that happened.
    u : (n_u,) array

    Raises
    ------
    UsageError
        A gap depends on velocities, or no impulses obey the constraints and the laws of restitution.
    """
    values = module.kernels.timed("events")(t, x, u=u)
    near = TOUCHING * max(1.0, module.layout.length)
    gaps = {
        i: float(event["restitution"])
        for i, event in enumerate(events)
        if event.get("restitution") is not None and (i in fired or abs(values[i]) <= near)
    }
    slopes = module.kernels.timed("event_slopes")(t, x, u=u)

    def normals(states: States, names: Sequence[int]) -> tuple[Array, Array]:
        layout, q, v = module.layout, states.q[:, 0], states.v[:, 0]
        for i in names:
            if np.abs(slopes[i, layout.n_q :]).max(initial=0.0) > 0.0:
                raise UsageError(f"event {events[i]['name']}: a gap is a function of positions, not of velocities")
        rows = np.array([_by_velocity(layout, q, slopes[i, : layout.n_q]) for i in names])
        return rows, rows @ v

    return _strike(module, t, x, gaps, (), normals).x


def _strike(
    module: Module,
    t: float,
    x: ArrayLike,
    gaps: Mapping[Any, float],
    locked: tuple[str, ...],
    normals: Callable[[States, Sequence[Any]], tuple[Array, Array]],
) -> Impact:
    layout = module.layout
    states = prepare(module, float(t), x)
    if not states.single:
        raise UsageError(f"x must be one state ({layout.n_x},)")
    q, v = states.q[:, 0], states.v[:, 0]
    C_q = states.jacobian()
    M = states.evaluate(module.mass_matrix, states.q)[..., 0]
    rows, rates = normals(states, (*gaps, *locked))
    B = free_motions(C_q[0], layout.scales)
    factor = np.linalg.cholesky(B.T @ M @ B) if B.shape[1] else np.zeros((0, 0))
    half = np.linalg.solve(factor, B.T @ rows.T) if B.shape[1] else np.zeros((0, len(rows)))
    A = half.T @ half  # rates of the gaps by impulses
    e = np.array([*gaps.values(), *(0.0 for _ in locked)])
    impulses = _restitute(A, (1.0 + e) * rates, len(gaps))
    change = B @ np.linalg.solve(factor.T, half @ impulses) if B.shape[1] else np.zeros_like(v)
    after = np.concatenate([q, v + change])
    held = solve_multipliers(C_q, (M @ change - rows.T @ impulses)[:, None], layout.scales)[:, 0]
    lost = -float(change @ M @ (v + 0.5 * change))
    before = np.ascontiguousarray(states.x[:, 0])
    return Impact(after, before, (*gaps, *locked), impulses, rates, rates + rows @ change, held, lost)


def check_gaps(layout: Layout, gaps: Mapping[str, float], locked: Sequence[str]) -> None:
    """Refuse unknown names and restitutions outside 0 .. 1.

    Raises
    ------
    UsageError
    """
    if not gaps and not locked:
        raise UsageError("an impact needs gaps={name: restitution} or lock=[coordinates]")
    if len(gaps) > MOST_GAPS:
        raise UsageError(f"at most {MOST_GAPS} gaps can meet at one instant, not {len(gaps)}")
    if layout.given_rates:
        raise UsageError("impacts need q' = v; the rates of this model's coordinates are given")
    coordinates = [*layout.freedoms, *layout.loops]
    for what, names, allowed in (("gaps", gaps, [*coordinates, *layout.y]), ("lock", locked, coordinates)):
        for name in names:
            if name not in allowed:
                near = get_close_matches(name, allowed, 1)
                hint = f"; did you mean {near[0]!r}?" if near else ""
                raise UsageError(f"{what}: no coordinate or output {name!r}{hint}; there are {', '.join(allowed)}")
    for name, e in gaps.items():
        if not 0.0 <= float(e) <= 1.0:
            raise UsageError(f"gaps: the restitution of {name} is between 0 and 1, not {e}")


def _normals(states: States, names: Sequence[str]) -> tuple[Array, Array]:
    """Rates of coordinates and outputs: by v (n, n_v), and as they are (n,)."""
    module, layout = states.module, states.module.layout
    rows = np.zeros((len(names), layout.n_v))
    q, v, t = states.q[:, 0], states.v[:, 0], float(states.t[0])
    slopes: Array | None = None
    for i, name in enumerate(names):
        if name in layout.freedoms:
            rows[i, layout.freedoms.index(name)] = 1.0
        elif name in layout.loops:
            every = states.evaluate(module.kernels.state("loop_coordinate_jacobian"), states.q)
            rows[i] = every[layout.loops.index(name), :, 0]
        else:
            if slopes is None:
                slopes = output_derivatives(module, t, states.x[:, 0], states.accelerations()[:, 0])
            own = slopes[layout.y.index(name)]
            if np.abs(own[layout.n_q : layout.n_x + layout.n_v]).max(initial=0.0) > 0.0:
                raise UsageError(f"gaps: output {name!r} depends on velocities; a gap is a function of positions")
            rows[i] = _by_velocity(layout, q, own[: layout.n_q])
    return rows, rows @ v


def _by_velocity(layout: Layout, q: Array, slope: Array) -> Array:
    """Derivative of a rate by v from that of the value by q: N^T slope."""
    if layout.space is None:
        return slope
    return np.array([slope @ layout.space.rates(q, e) for e in np.eye(layout.n_v)])


def _restitute(A: Array, b: Array, gaps: int) -> Array:
    """g with 0 <= g, 0 <= A g + b, g (A g + b) = 0 for the gaps, and A g + b = 0 for what is locked."""
    size = max(np.abs(b).max(initial=0.0), 1e-300)
    locked = list(range(gaps, len(b)))
    order = sorted(range(gaps), key=lambda i: b[i])
    for count in range(gaps + 1):
        for chosen in combinations(order, count):
            active = [*sorted(chosen), *locked]
            g = np.zeros(len(b))
            if active:
                block = A[np.ix_(active, active)]
                g[active] = np.linalg.lstsq(block, -b[active], rcond=RANK)[0]
            rest = A @ g + b
            push = g[:gaps] * np.diag(A)[:gaps]
            if (
                (push >= -SLACK * size).all()
                and (rest[:gaps] >= -SLACK * size).all()
                and (np.abs(rest[active]) <= 1e-8 * size).all()
            ):
                return g
    stuck = "the locked coordinates cannot all stop" if locked else "these gaps cannot open together"
    raise UsageError(f"no impulses obey the constraints and the laws of restitution: {stuck}")
