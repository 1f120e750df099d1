"""A right-hand side by articulated bodies with multipliers -> its derivatives along directions.

Implicit differentiation of r1 = M a + h + C_q^T l = 0 and r2 = C_q a + gamma = 0 at the projected state: the changes
(da, dl) along a direction solve the same system as (a, l) do, so that the pivots of bodies and of rows are used again
and a column costs a sweep over the bodies (A. Sathya and J. Carpentier, IEEE Trans. Robotics 41 (2025), 430-449; the
derivatives of forces: J. Carpentier, N. Mansard, RSS 2018).

What depends on the state alone is computed once (``loop_slopes``); ``slopes_by_position`` and ``slopes_by_velocity``
read it as coefficients and are linear in the direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

from ..contact.pairs import list_operands
from ..expr.core import Expr, reachable, substitute
from ..expr.differentiate import jacobian, jvp
from ..expr.tensors import dot, total
from .loop_systems import BodyLoops
from .program import Block, Port

Outputs = list[Expr]

#: Blocks of the state, and of a direction of q and of v.
BY_BODIES = ("loop_slopes", "slopes_by_position", "slopes_by_velocity")


class LoopSlopes:
    """The blocks behind the Jacobian of a mechanism with loops, which has a motion by articulated bodies."""

    def __init__(self, loops: BodyLoops) -> None:
        self.loops, terms = loops, loops.terms
        self.terms = terms
        self.dq, self.dv, self.q, self.v, self.a = (
            terms.symbols(terms.ports[name]) for name in ("dq", "dv", "q", "v", "a")
        )

    # -- directions -----------------------------------------------------------------------------------------------
    def _positions(self) -> list[Expr]:
        """The change of the projected q; Euler parameters keep their part along themselves."""
        loops, terms = self.loops, self.terms
        rates = list(terms.q_dot)
        N = jacobian(rates, self.v)
        z = [self.dq[k] if k >= 0 else terms.graph.zero for k in terms.coordinate_of]
        for i, j in terms.quaternion_slots:
            e, de = self.q[i : i + 4], self.dq[i : i + 4]
            factor = 4.0 / (e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3])
            for c in range(3):
                z[j + c] = total([N[i + m, j + c] * factor * de[m] for m in range(4) if (i + m, j + c) in N])
        if loops.h:
            z = loops.nearest(z, [terms.graph.zero] * loops.h, loops.h, *loops.holonomic)
        moved = substitute(rates, dict(zip(self.v, z, strict=True)))
        for i, _ in terms.quaternion_slots:
            e, de = self.q[i : i + 4], self.dq[i : i + 4]
            along = dot(e, de) / dot(e, e)
            moved[i : i + 4] = [x + y * along for x, y in zip(moved[i : i + 4], e, strict=True)]
        return moved

    def _velocities(self, dq: Sequence[Expr], dv: list[Expr]) -> list[Expr]:
        """The change of the projected v, q changing by dq."""
        turned = jvp(self.terms.velocity_constraints, dict(zip(self.q, dq, strict=True)))
        r = self.loops.scaled(turned)
        return self.loops.nearest(dv, r, len(r), *self.loops.of_velocities)

    # -- accelerations --------------------------------------------------------------------------------------------
    def _changed(self, r1: Sequence[Expr], r2: Sequence[Expr]) -> list[Expr]:
        """da of the change of both residuals."""
        rest = self.loops.scaled(r2)
        solved, _ = self.loops.move(rest, [-x for x in r1])
        return self.loops.nearest(solved.accelerations, rest, len(rest), self.loops.solver[0], 1)

    def _along(self, dq: Sequence[Expr], dv: Sequence[Expr]) -> Outputs:
        """dq' and da along a projected direction."""
        terms, motion = self.terms, self.loops.motion
        assert motion is not None
        l = self.terms.symbols(terms.multipliers)
        r1, r2 = terms.force_residual, terms.acceleration_residual
        seeds = dict(zip((*self.q, *self.v), (*dq, *dv), strict=True))
        changes = jvp([*terms.q_dot, *r1, *r2], seeds)
        n_q, n = len(self.q), terms.n_v
        da = self._changed(changes[n_q : n_q + n], changes[n_q + n :])
        multipliers = self.loops.scaled(self.loops.multipliers)
        here = dict(zip((*self.a, *l), (*motion.accelerations, *multipliers), strict=True))
        return substitute(substitute([*changes[:n_q], *da], here), dict(zip(self.v, self.loops.moved, strict=True)))

    @cached_property
    def _columns(self) -> tuple[Outputs, Outputs]:
        zero, dq = self.terms.graph.zero, self._positions()
        by_position = self._along(dq, self._velocities(dq, [zero] * len(self.v)))
        rows = len(self.loops.J)
        still = self.loops.nearest(list(self.dv), [zero] * rows, rows, *self.loops.of_velocities)
        return by_position, self._along([zero] * len(self.q), still)

    # -- stages ---------------------------------------------------------------------------------------------------
    @cached_property
    def coefficients(self) -> list[Expr]:
        """What columns take from the state, parameters apart."""
        graph = self.terms.graph
        parameters = set(self.terms.p)
        directions = {x.id for x in (*self.dq, *self.dv)}
        fixed: set[int] = set()
        turning: set[int] = set()
        found: dict[int, None] = {}
        both = [y.id for column in self._columns for y in column]
        for i in reachable(graph, both):
            kind, *args = graph.nodes[i]
            if kind == "const" or (kind == "sym" and args[0] in parameters):
                fixed.add(i)
            elif i in directions:
                turning.add(i)
            elif kind != "sym":
                if not turning.isdisjoint(args):
                    turning.add(i)
                    needed = [j for k in args if k not in turning for j in list_operands(graph, k)]
                    found.update(dict.fromkeys(k for k in needed if k not in fixed))
                elif fixed.issuperset(args):
                    fixed.add(i)
        found.update(dict.fromkeys(i for i in both if i not in turning and i not in fixed))
        return [Expr(graph, i) for i in found]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Symbols of the coefficients."""
        return tuple(f"coefficient[{k}]" for k in range(len(self.coefficients)))

    def block(self, name: str, ports: Sequence[Port], checks: Sequence[Expr]) -> Block:
        """A block of :data:`BY_BODIES` with the ports of q, v, dq, dv.

        ``loop_slopes``: projected velocities (n,), whether all is sound, whether no change point can be near, then the
        coefficients.  The others: the changes of [q'; v'] along dq and along dv, of the coefficients.
        """
        if name == BY_BODIES[0]:
            outputs, more = self.loops.dynamics()
            n = self.terms.n_v
            every = (*outputs[:n], *outputs[2 * n :], *self.coefficients)
            return Block(name, tuple(ports[:2]), every, (len(every),), (*checks, *more), public=False)
        mapping = dict(zip(self.coefficients, self.terms.symbols(self.names), strict=True))
        which = BY_BODIES.index(name) - 1
        changes = substitute(self._columns[which], mapping)
        given = (Port("coefficients", self.names), ports[2 + which])
        return Block(name, given, tuple(changes), (len(changes),), public=False)
