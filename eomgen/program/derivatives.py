"""Stage program: SystemTerms -> derivatives that analyses ask for, by states, inputs and parameters, row-major."""

from __future__ import annotations

from collections.abc import Sequence

from ..graph.core import Expr
from ..graph.differentiate import jacobian, jvp
from .terms import SystemTerms


def derivatives(terms: SystemTerms, rows: Sequence[Expr], names: Sequence[str]) -> list[Expr]:
    """All derivatives of rows by symbols."""
    graph = terms.graph
    entries = jacobian(rows, [graph.symbol(name) for name in names])
    return [entries.get((i, k), graph.zero) for i in range(len(rows)) for k in range(len(names))]


def by_everything(terms: SystemTerms, rows: Sequence[Expr]) -> list[Expr]:
    """Derivatives by coordinates, velocities, time, inputs and parameters."""
    return derivatives(terms, rows, (*terms.q, *terms.v, terms.t, *terms.u, *terms.p))


def assembly_jacobian(terms: SystemTerms, n_loop_coordinates: int) -> list[Expr]:
    """Constraints, their rates, and the n_loop_coordinates coordinates of cut joints with theirs, by q, v, u and p."""
    rows = [*terms.constraints, *terms.velocity_constraints, *terms.loop_coordinates[: 2 * n_loop_coordinates]]
    return derivatives(terms, rows, (*terms.q, *terms.v, *terms.u, *terms.p))


def output_derivatives(terms: SystemTerms) -> list[Expr]:
    """Outputs by q, v, a, u and p, each at fixed others."""
    return derivatives(terms, terms.outputs, (*terms.q, *terms.v, *terms.a, *terms.u, *terms.p))


def strike_rows(terms: SystemTerms, impulses: Sequence[str], of_held: Sequence[str]) -> list[Expr]:
    """What rules velocities at an instant, a being their change.

    The momentum balance with impulses l of constraints, g of gaps with normals n, and those of constraints that close
    and open; the least scaled change; constraints of velocities; the events' rates; those of what is closed.  Impulses
    are given by their symbols.
    """
    graph = terms.graph
    v, a, l = ([graph.symbol(name) for name in names] for names in (terms.v, terms.a, terms.multipliers))
    q = [graph.symbol(name) for name in terms.q]
    rates = jvp(terms.events, dict(zip(q, terms.q_dot, strict=True)))
    moving = {graph.symbol(u): graph.symbol(rate) for u, rate in terms.input_rates}
    drift = jvp(terms.events, {graph.symbol(terms.t): graph.one} | moving)
    normals = jacobian(rates, v)
    change = jvp(terms.inverse_dynamics, {x: x for x in a})
    least = [x / (s * s) for x, s in zip(a, terms.coordinate_scales, strict=True)]
    for row, one in zip(terms.constraint_jacobian, l, strict=True):
        change = [x + c * one for x, c in zip(change, row, strict=True)]
        least = [x + c * one for x, c in zip(least, row, strict=True)]
    for i, g in enumerate(map(graph.symbol, impulses)):
        change = [x - normals.get((i, k), graph.zero) * g for k, x in enumerate(change)]
    held = terms.held_errors[1::2]
    by_held = jacobian(held, v[: terms.n_v - terms.n_states])
    for (i, k), slope in by_held.items():
        change[k] = change[k] + slope * graph.symbol(of_held[i])
    moved = [x + y for x, y in zip(rates, drift, strict=True)]
    return [*change, *least, *terms.velocity_constraints, *moved, *held]
