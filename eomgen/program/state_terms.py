"""Stage program: SystemTerms of a mechanism and the rates of its first-order states -> SystemTerms of both.

States stand after the velocities and are treated like these: s' = f is (unit inertia) s' - f = 0, with no part in any
constraint, no coordinate and no energy.  Derivatives, projections and factorisations then hold for the whole of
x = [q; v; s] without further rules.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from ..equations.articulated import ConstraintRow, TreeMotion
from ..equations.tree_equations import LinearSystem
from ..graph.core import Expr
from ..kinematics.state import acceleration_name
from .terms import Row, SystemTerms


def with_states(terms: SystemTerms, names: Sequence[str], rates: Sequence[Expr]) -> SystemTerms:
    """The terms with states of these names and rates (n_s,), of (t, q, v, s, u); as they are without states."""
    if not names:
        return terms
    graph, n, count = terms.graph, terms.n_v, len(names)
    nothing: Row = (graph.zero,) * count
    accelerations = tuple(graph.symbol(acceleration_name(name)) for name in names)
    unit = tuple((graph.zero,) * (n + k) + (graph.one,) + (graph.zero,) * (count - 1 - k) for k in range(count))
    pairs = list(zip(accelerations, rates, strict=True))
    opposed, left = tuple(-f for f in graph.marked(rates)), tuple(a - f for a, f in graph.marked(pairs))
    mass = tuple((*row, *nothing) for row in terms.mass_matrix) + (unit if terms.mass_matrix or not n else ())
    return replace(
        terms,
        v=(*terms.v, *names),
        a=(*terms.a, *map(acceleration_name, names)),
        mass_matrix=mass,
        bias=(*terms.bias, *opposed),
        inverse_dynamics=(*terms.inverse_dynamics, *left),
        constraint_jacobian=tuple((*row, *nothing) for row in terms.constraint_jacobian),
        loop_coordinate_jacobian=tuple((*row, *nothing) for row in terms.loop_coordinate_jacobian),
        coordinate_scales=(*terms.coordinate_scales, *(graph.one,) * count),
        n_dof=terms.n_dof + count,
        preferred=(*terms.preferred, *range(n, n + count)),
        parent=(*terms.parent, *(-1,) * count),
        motion_axes=(*terms.motion_axes, *[graph.zero] * (6 * count if terms.motion_axes else 0)),
        rates=terms.q_dot,
        centroidal=_centroidal(terms.centroidal, n, nothing),
        accelerations=None if terms.accelerations is None else (*terms.accelerations, *rates),
        pivots=(*terms.pivots, *(graph.one,) * count) if terms.accelerations is not None else (),
        system=None if terms.system is None else _system(terms.system, rates),
        slopes=None,
        turned=None,
        constrained=None if terms.constrained is None else partial(_constrained, terms.constrained, n, tuple(rates)),
        n_states=count,
    )


def _centroidal(given: Row, n: int, nothing: Row) -> Row:
    """Centre (3), its Jacobian (3, n) with columns for the states, and what follows."""
    if not given:
        return ()
    rows = (given[3 + k * n : 3 + (k + 1) * n] for k in range(3))
    return (*given[:3], *(x for row in rows for x in (*row, *nothing)), *given[3 + 3 * n :])


def _constrained(
    solve: Callable[..., TreeMotion],
    n: int,
    rates: Sequence[Expr],
    rows: Sequence[ConstraintRow] = (),
    term: float = 0.0,
    loaded: bool = True,
    forces: Sequence[Expr] | None = None,
) -> TreeMotion:
    """The accelerations by articulated bodies and the rates of the states, which no constraint holds."""
    moving = [replace(row, entries={k: x for k, x in row.entries.items() if k < n}) for row in rows]
    found = solve(moving, term, loaded=loaded, forces=None if forces is None else forces[:n])
    graph = rates[0].graph
    unloaded = [graph.zero] * len(rates) if forces is None else forces[n:]
    return found._replace(
        accelerations=(*found.accelerations, *(rates if loaded else unloaded)),
        pivots=(*found.pivots, *(graph.one,) * len(rates)),
    )


def _system(system: LinearSystem, rates: Sequence[Expr]) -> LinearSystem:
    """The linear system of a method: the rates of the states are no unknowns of it."""
    return replace(system, accelerations=(*system.accelerations, *rates))
