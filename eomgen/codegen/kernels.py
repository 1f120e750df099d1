"""SystemTerms -> blocks: the expressions of every kernel, and of what drivers call.

A kernel is a row of :mod:`~eomgen.base.kernel_table`, and here a row of :data:`EXPRESSIONS` where it is straight-line
code of every model.  The rest are straight-line code of some, of others drivers over blocks (:class:`BlockMaker`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

from ..base.kernel_table import DAE, NAMED
from ..contact.pairs import pairs_of_bodies, without_pairs
from ..expr.core import Expr, reachable, substitute, symbols_of
from ..expr.differentiate import jacobian, jvp
from ..expr.schedule import count
from ..mechanics.wrenches import inertial_terms
from .jacobian_blocks import Entries, LoopSlopes, ResidualSlopes, solve_tree, unrolled_jacobian, unrolled_shift
from .linear_algebra import articulated_positivity, is_unrolled
from .loop_motions import MotionLoops, motion_loops
from .loop_systems import BodyLoops, LoopBlocks, straight_loops
from .program import (
    ALONG,
    BY_BODIES,
    BY_MOTIONS,
    BY_SYSTEM,
    COLUMNS,
    COMPOSED,
    RATES,
    SHIFTS,
    Block,
    Limits,
    Port,
    flat,
)
from .terms import SystemTerms

if TYPE_CHECKING:
    from .contact_columns import ContactColumns


# -- expressions of kernels ---------------------------------------------------------------------------------------
def _derivatives(terms: SystemTerms, rows: Sequence[Expr], names: Sequence[str]) -> list[Expr]:
    entries = jacobian(rows, terms.symbols(names))
    return [entries.get((i, k), terms.graph.zero) for i in range(len(rows)) for k in range(len(names))]


def _by_everything(terms: SystemTerms, rows: Sequence[Expr]) -> list[Expr]:
    """Derivatives by coordinates, velocities, time, inputs and parameters."""
    return _derivatives(terms, rows, (*terms.q, *terms.v, terms.t, *terms.u, *terms.p))


def _assembly_jacobian(terms: SystemTerms) -> list[Expr]:
    """Constraints, their rates, and the coordinates of cut joints with theirs, by q, v, u and p."""
    measured = terms.loop_coordinates[: 2 * terms.sizes.n_loop_coordinates]
    rows = [*terms.constraints, *terms.velocity_constraints, *measured]
    return _derivatives(terms, rows, (*terms.q, *terms.v, *terms.u, *terms.p))


def _strike_rows(terms: SystemTerms) -> list[Expr]:
    """Equations of the velocities at an instant, a being their change.

    The momentum balance with impulses l of constraints, g of gaps with normals n, and those of constraints that close
    and open; the least scaled change; constraints of velocities; the events' rates; those of what is closed.
    """
    graph, ports = terms.graph, terms.ports
    v, a, l, q = (terms.symbols(ports[name]) for name in ("v", "a", "multipliers", "q"))
    rates = jvp(terms.events, dict(zip(q, terms.q_dot, strict=True)))
    moving = {graph.symbol(u): graph.symbol(rate) for u, rate in terms.input_rates}
    drift = jvp(terms.events, {graph.symbol(terms.t): graph.one} | moving)
    normals = jacobian(rates, v)
    change = jvp(terms.inverse_dynamics, {x: x for x in a})
    least = [x / (s * s) for x, s in zip(a, terms.coordinate_scales, strict=True)]
    for row, one in zip(terms.constraint_jacobian, l, strict=True):
        change = [x + c * one for x, c in zip(change, row, strict=True)]
        least = [x + c * one for x, c in zip(least, row, strict=True)]
    for i, g in enumerate(map(graph.symbol, ports["impulses"])):
        change = [x - normals.get((i, k), graph.zero) * g for k, x in enumerate(change)]
    closed = terms.held_errors[1::2]
    for (i, k), slope in jacobian(closed, v[: terms.n_v - terms.n_states]).items():
        change[k] = change[k] + slope * graph.symbol(ports["held_impulses"][i])
    moved = [x + y for x, y in zip(rates, drift, strict=True)]
    return [*change, *least, *terms.velocity_constraints, *moved, *closed]


def _dae_residual(terms: SystemTerms) -> list[Expr]:
    """Kinematics with corrections, q' - N (v - S^2 C_q^T mu) (C. W. Gear, B. Leimkuhler, G. K. Gupta, 1985), r1, C, C'.

    There is a correction mu for each holonomic row.
    """
    rest = [*terms.force_residual, *terms.constraints, *terms.velocity_constraints]
    moved = v = terms.symbols(terms.v)
    corrections = map(terms.graph.symbol, terms.ports["corrections"])
    for row, mu in zip(terms.constraint_jacobian, corrections, strict=False):
        moved = [x - s * s * c * mu for x, s, c in zip(moved, terms.coordinate_scales, row, strict=True)]
    flow = substitute(terms.q_dot, dict(zip(v, moved, strict=True)))
    rates = map(terms.graph.symbol, terms.ports["q_rate"])
    return [*(rate - f for rate, f in zip(rates, flow, strict=True)), *rest]


def _squares(terms: SystemTerms) -> list[Expr]:
    """|e|^2 of each set of Euler parameters, as rotations have it."""
    sets = (terms.symbols(terms.q[i : i + 4]) for i, _ in terms.quaternion_slots)
    return [e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3] for e in sets]


def _normalized(terms: SystemTerms) -> list[Expr]:
    """q with Euler parameters of length 1, and v."""
    q = terms.symbols(terms.q)
    for (i, _), square in zip(terms.quaternion_slots, _squares(terms), strict=True):
        length = terms.graph.apply("sqrt", square)
        q[i : i + 4] = [x / length for x in q[i : i + 4]]
    return [*q, *terms.symbols(terms.v)]


Expressions = Callable[[SystemTerms], Sequence[Expr]]

#: Kernels that are straight-line code of every model.
EXPRESSIONS: Mapping[str, Expressions] = {
    "mass_matrix": lambda s: flat(s.mass_matrix),
    "bias": lambda s: s.bias,
    "inverse_dynamics": lambda s: s.inverse_dynamics,
    "energy": lambda s: (s.kinetic, s.potential),
    "centroidal": lambda s: s.centroidal,
    "constraints": lambda s: s.constraints,
    "constraint_jacobian": lambda s: flat(s.constraint_jacobian),
    "coordinate_slopes": lambda s: flat(s.coordinate_slopes),
    "velocity_constraints": lambda s: s.velocity_constraints,
    "poses": lambda s: s.poses,
    "loop_coordinates": lambda s: s.loop_coordinates,
    "loop_coordinate_jacobian": lambda s: flat(s.loop_coordinate_jacobian),
    "alignment": lambda s: s.alignment,
    "motion_outputs": lambda s: s.outputs,
    "canonical": lambda s: s.canonical,
    "dae_residual": _dae_residual,
    "finite_forces": lambda s: s.finite_forces,
    "meeting_time": lambda s: s.meeting_times,
    "near_pairs": lambda s: s.near_pairs,
    "bias_apart": lambda s: without_pairs(s.bias, s.near_pairs),
    "motion_axes": lambda s: s.motion_axes,
    "events": lambda s: s.events,
    "resets": lambda s: s.resets,
    "held_errors": lambda s: s.held_errors,
    "event_derivatives": lambda s: _by_everything(s, [*s.events, *s.resets]),
    "strike_derivatives": lambda s: _by_everything(s, _strike_rows(s)),
    "assembly_jacobian": _assembly_jacobian,
    "output_derivatives": lambda s: _derivatives(s, s.outputs, (*s.q, *s.v, *s.a, *s.u, *s.p)),
    "needed_wrenches": lambda s: s.wrenches.needed if s.wrenches else (),
    "wrench_geometry": lambda s: s.wrenches.geometry if s.wrenches else (),
    "inertial_terms": lambda s: inertial_terms(s.kinematics),
    "scales": lambda s: (*s.coordinate_scales, *s.constraint_scales),
}
#: Kernels that are straight-line code of every tree.
OF_TREES: Mapping[str, Expressions] = {
    "project": _normalized,
    "embedded_mass_matrix": lambda s: [s.mass_matrix[i][k] for i in s.preferred for k in s.preferred],
    "kinematics": lambda s: s.symbols((*s.q, *s.v, *s.a)),
}


class BlockMaker:
    """Makes the blocks of one system, each when it is requested."""

    def __init__(self, terms: SystemTerms, limits: Limits) -> None:
        self.terms, self.limits = terms, limits
        self.has_loops = terms.n_c > 0  #: whether there are constraint rows

    # -- choices --------------------------------------------------------------------------------------------------
    @property
    def unrolled(self) -> bool:
        """Whether the right-hand side is straight-line code."""
        terms, short = self.terms, is_unrolled(self.terms.parent, self.limits.unrolled)
        return not self.has_loops and terms.system is None and (terms.accelerations is not None or short)

    @cached_property
    def _loops(self) -> LoopBlocks | None:
        """The straight-line form of a right-hand side with loops, if it is not too long."""
        return straight_loops(self.terms, self.limits.unrolled_loops) if self.limits.unrolled_loops else None

    @cached_property
    def _by_motions(self) -> MotionLoops | None:
        """The shorter form that is tried before that one."""
        return motion_loops(self._loops, self.limits.unrolled_loops)

    @cached_property
    def _loop_slopes(self) -> LoopSlopes | None:
        """The derivatives of that form along directions, if it goes by articulated bodies."""
        return LoopSlopes(self._loops) if isinstance(self._loops, BodyLoops) else None

    @cached_property
    def outputs_need_accelerations(self) -> bool:
        """Whether an output depends on an acceleration."""
        return not symbols_of(self.terms.outputs).isdisjoint(self.terms.a)

    @cached_property
    def by_direction(self) -> bool:
        """Whether the Jacobian of the residuals is too large to be written out."""
        if self._touching:
            return True
        if not self.has_loops and self.slopes.recursive and self.slopes.operations <= self.limits.jacobian_recursive:
            return False
        nodes = len(reachable(self.terms.graph, (r.id for r in self._residuals)))
        return self.terms.sizes.n_x * nodes > self.limits.jacobian_nodes

    @cached_property
    def _touching(self) -> bool:
        """Whether contacts between groups couple too many pairs of bodies for their derivatives to be written out."""
        return pairs_of_bodies(self.terms.graph) > self.limits.jacobian_pairs

    @cached_property
    def contacts(self) -> ContactColumns | None:
        """The columns of states of contacts, where the Jacobian of a tree is made direction by direction."""
        plain = self.limits.unrolled_loops > 0 and not self.has_loops  # drivers over arrays take all terms
        if not (plain and self.by_direction):
            return None
        from .contact_columns import contact_columns

        return contact_columns(self.terms)

    @cached_property
    def slopes(self) -> ResidualSlopes:
        """The derivatives of the residuals."""
        return ResidualSlopes(self.terms, self.limits)

    # -- shared expressions ---------------------------------------------------------------------------------------
    @cached_property
    def _accelerations(self) -> tuple[list[Expr], list[Expr]]:
        """v' of a tree in terms of (q, v), and the conditions for it to exist."""
        terms = self.terms
        if terms.accelerations is not None and terms.pivots:
            checks = articulated_positivity(terms.pivots, terms.coordinate_scales, terms.parent)
            return list(terms.accelerations), [*self._turned, *checks]
        mass, bias = terms.turned.system if terms.turned else (terms.mass_matrix, terms.bias)
        _, a, checks = solve_tree(terms, mass, bias)
        return (terms.turned.accelerations(a) if terms.turned else a), [*self._turned, *checks]

    @property
    def _residuals(self) -> list[Expr]:
        """r1, r2, r3."""
        terms = self.terms
        return [*terms.force_residual, *terms.acceleration_residual, *terms.velocity_constraints]

    @property
    def _turned(self) -> list[Expr]:
        """Conditions: no set of Euler parameters is zero, which no result need show where no rotation matters."""
        graph = self.terms.graph
        return [graph.apply("lt", graph.zero, square) for square in _squares(self.terms)]

    def _seeds(self, *names: str) -> dict[Expr, Expr]:
        """What changes, of q, v, a, u, p -> the symbol of its change."""
        terms, seeds = self.terms, dict[Expr, Expr]()
        for name in names:
            symbols, changes = terms.symbols(getattr(terms, name)), terms.symbols(terms.ports[f"d{name}"])
            seeds |= dict(zip(symbols, changes, strict=True))
        return seeds

    # -- blocks ---------------------------------------------------------------------------------------------------
    @cached_property
    def _ports(self) -> Mapping[str, tuple[str, ...]]:
        return {**self.terms.ports, **({"loads": self.contacts.loads} if self.contacts else {})}

    def port(self, name: str) -> Port:
        """The symbols behind the name of a port."""
        return Port(name, self._ports[name])

    def _internal(
        self, name: str, ports: str, outputs: Sequence[Expr], checks: Sequence[Expr] = (), guards: Sequence[Expr] = ()
    ) -> Block:
        inputs = tuple(map(self.port, ports.split()))
        return Block(name, inputs, tuple(outputs), (len(outputs),), tuple(checks), tuple(guards), public=False)

    def public(self, name: str) -> Block | None:
        """The public kernel of this name if it is straight-line code for this system, else None."""
        result = self._straight(name)
        if result is None:
            return None
        outputs, checks = result
        kernel = NAMED[name]
        ports = tuple(map(self.port, kernel.inputs))
        return Block(name, ports, tuple(outputs), kernel.shape(self.terms.sizes), tuple(checks))

    def _straight(self, name: str) -> tuple[Sequence[Expr], Sequence[Expr]] | None:
        """Outputs and checks of a kernel; None if a driver makes it."""
        terms = self.terms
        if terms.by_columns and name in ("mass_matrix", "embedded_mass_matrix"):
            return None
        if name in EXPRESSIONS:
            return EXPRESSIONS[name](terms), self._turned if name == "bias" else ()  # drivers of large trees go by it
        if name in OF_TREES and not self.has_loops:
            return OF_TREES[name](terms), ()
        if name == "rhs" and self.unrolled:
            accelerations, checks = self._accelerations
            return [*terms.q_dot, *accelerations], checks
        if (result := self._written_derivative(name)) is not None:
            return result[0], [*self._turned, *result[1]]
        if name == "outputs" and not self.has_loops and not self.outputs_need_accelerations:
            return terms.outputs, ()
        if name == "outputs" and self.unrolled:
            accelerations, checks = self._accelerations
            return substitute(terms.outputs, dict(zip(terms.symbols(terms.a), accelerations, strict=True))), checks
        return None

    def _written_derivative(self, name: str) -> tuple[list[Expr], list[Expr]] | None:
        """A derivative of the inverse dynamics, or of a small tree's right-hand side, and checks of its mass matrix."""
        if self._touching and name not in SHIFTS:
            return None
        if name == "inverse_dynamics_derivatives":
            result = self._inverse_slopes()
            return None if result is None else (result, [])
        if not self.unrolled or name not in ("jacobian", *SHIFTS):
            return None
        if name == "jacobian":
            return unrolled_jacobian(self.terms, self.slopes)
        return unrolled_shift(self.terms, self.slopes, self.terms.u if SHIFTS[name] == "input" else self.terms.p)

    def _inverse_slopes(self) -> list[Expr] | None:
        """(n, n_q + 2 n) row-major; None if written out it would be too long.

        By recursion over composite bodies, whose mass matrix comes along, or by differentiating the formula.
        """
        terms, slopes, result = self.terms, self.slopes, list[Entries]()
        width = len(terms.q) + terms.n_v
        if slopes.forces is not None:
            mass = {(i, width + k): x for i, row in enumerate(slopes.forces.mass_matrix) for k, x in enumerate(row)}
            result.append(slopes.by_recursion | mass)
        symbols = terms.symbols((*terms.q, *terms.v, *terms.a))
        nodes = len(reachable(terms.graph, (x.id for x in terms.inverse_dynamics)))
        if len(symbols) * nodes <= self.limits.jacobian_recursive:
            result.append(jacobian(list(terms.inverse_dynamics), symbols))
        if not result:
            return None
        entries = min(result, key=lambda one: count(list(one.values())).total)
        return [entries.get((i, k), terms.graph.zero) for i in range(terms.n_v) for k in range(width + terms.n_v)]

    def drivers_need(self, name: str) -> tuple[str, ...]:
        """Names of the blocks behind a public kernel that is not straight-line code."""
        more = (*RATES, *(("coordinate_slopes",) if self.terms.coordinate_slopes else ()))
        return (*self._behind(name), *(more if self.terms.general_rates else ()))

    def _behind(self, name: str) -> tuple[str, ...]:
        if name in ALONG:
            return (ALONG[name],)
        residual = "residual_tangent" if self.by_direction else "residual_jacobian"
        shift = SHIFTS.get(name)
        if shift and self.terms.by_columns and not self.has_loops:
            return (f"{shift}_acceleration",)
        if shift and not self.has_loops:
            return ("mass_matrix", "bias", "scales", f"{shift}_shift")
        formed = COMPOSED if self.terms.by_columns else ("terms",)
        if shift:
            return ("scales", "position", "rate", *formed, residual, f"{shift}_shift")
        if self.terms.by_columns and (not self.has_loops or name == "mass_matrix"):
            if name != "jacobian":
                return ("mass_times",)
            return ("acceleration_tangent",) if self.by_direction else ("terms", "scales", "residual_jacobian")
        if self.terms.system and (name in ("rhs", "outputs") or (name == "jacobian" and not self.terms.projects)):
            return self._system_needs(name, residual)
        if not self.has_loops:  # their terms are put together from two blocks, which share next to nothing
            terms = ("mass_matrix", "bias", "scales")
            return {
                "rhs": terms,
                "jacobian": (*terms, residual) if self.contacts is None else ("scales", residual, *COLUMNS),
                "outputs": (*terms, "accelerated_outputs"),
            }[name]
        project = ("scales", "position", "rate")
        accelerate = formed if self.outputs_need_accelerations else ()
        mass = "mass_times" if self.terms.by_columns else "mass_matrix"
        direct = (*BY_SYSTEM, *(BY_MOTIONS if self._by_motions else ())) if self._loops is not None else ()
        along = (*direct, *BY_BODIES) if self._loop_slopes is not None else ()
        return {
            "rhs": (*project, *formed, *direct),
            "jacobian": (*project, *formed, residual, *along),
            "embedded_mass_matrix": ("scales", "position", mass),
            "project": project,
            "outputs": (*project, *accelerate, "accelerated_outputs"),
            "kinematics": (*project, *formed),
        }[name]

    def _system_needs(self, name: str, residual: str) -> tuple[str, ...]:
        """What drivers need that solve the linear system of a method."""
        closing = self.has_loops and (self.terms.projects or name == "outputs")
        project = ("scales", "position", "rate") if closing else ()
        if name == "outputs":
            accelerate = ("system", "joint_accelerations") if self.outputs_need_accelerations else ()
            return (*project, *accelerate, "accelerated_outputs")
        return (*project, "system", "joint_accelerations", *((residual,) if name == "jacobian" else ()))

    def internal(self, name: str) -> Block:
        """A block that only drivers call; layouts in the generated source."""
        terms, block = self.terms, self._internal
        match name:
            case "terms":  # M lower packed, h, C_q, gamma
                mass = terms.mass_matrix
                if terms.by_columns:
                    assert self.slopes.forces is not None
                    mass = self.slopes.forces.mass_matrix
                lower = [mass[i][k] for i in range(terms.n_v) for k in range(i + 1)]
                every = [*lower, *terms.bias, *flat(terms.constraint_jacobian), *terms.gamma]
                return block(name, "q v", every, self._turned)
            case "position":  # C, C_q
                return block(name, "q", [*terms.constraints, *flat(terms.constraint_jacobian)])
            case "closing" | "dynamics" | "short_closing" | "short_dynamics":
                form = self._loops if name in BY_SYSTEM else self._by_motions
                assert form is not None
                if name.endswith("closing"):  # a Newton step
                    return block(name, "q", form.closing(), guards=form.guards)
                outputs, checks = form.dynamics()  # v, a, whether these are sound
                return block(name, "q v", outputs, [*self._turned, *checks])
            case "loop_slopes" | "slopes_by_position" | "slopes_by_velocity":
                assert self._loop_slopes is not None
                return self._loop_slopes.block(name, list(map(self.port, ("q", "v", "dq", "dv"))), self._turned)
            case "gamma":
                return block(name, "q v", terms.gamma)
            case "rate":  # C_t
                return block(name, "q", terms.constraint_rate)
            case "system":  # entries of K, then r, then sizes of equations and of unknowns
                assert terms.system is not None
                return block(name, "q v", [*terms.system.entries, *terms.system.right, *terms.system.sizes])
            case "joint_accelerations":
                assert terms.system is not None
                return block(name, "q v z", terms.system.accelerations)
            case "accelerated_outputs":
                return block(name, "q v a", terms.outputs)
            case "residual_jacobian":  # r1_q, r1_v, r2_q, r2_v, r3_q
                return block(name, "q v a multipliers", self.slopes.packed())
            case "contact_terms" | "contact_operands" | "contact_loads":
                assert self.contacts is not None
                ports, results = self.contacts.block(name, terms)
                return block(name, ports, results, self._turned if name == "contact_terms" else ())
            case "dae_tangent":  # dF along (dy, dy')
                named = [self.port(port) for port in DAE]
                y = [symbol for port in named for symbol in port.symbols]
                along = Port("directions", tuple(f"d({symbol})" for symbol in y))
                seeds = dict(zip(terms.symbols(y), terms.symbols(along.symbols), strict=True))
                results = jvp(_dae_residual(terms), seeds)
                return Block(name, (*named, along), tuple(results), (len(results),), public=False)
            case "inverse_tangent":  # d(M a + h) along (dq, dv, da)
                seeds = self._seeds("q", "v", "a")
                return block(name, "q v a dq dv da", jvp(terms.inverse_dynamics, seeds))
            case "mass_times":  # M a
                return block(name, "q a", jvp(terms.inverse_dynamics, {a: a for a in terms.symbols(terms.a)}))
            case "rates":  # q'
                return block(name, "q v", terms.rates)
            case "moved" | "rates_along":  # N dv; dq' along (dq, dv)
                fixed = dict.fromkeys(terms.symbols(terms.q), terms.graph.zero) if name == "moved" else {}
                return block(name, "q v a multipliers dq dv", jvp(terms.rates, self._seeds("q", "v") | fixed))
            case "acceleration_tangent":  # dv' along (dq, dv)
                accelerations, checks = self._accelerations
                return block(name, "q v dq dv", jvp(accelerations, self._seeds("q", "v")), checks)
            case "residual_tangent":  # dr1, dr2, dr3 along (dq, dv)
                return block(name, "q v a multipliers dq dv", jvp(self._residuals, self._seeds("q", "v")))
            case "input_shift" | "parameter_shift":  # dC, dr1, dr2, dr3 along du or dp
                of = name[0].replace("i", "u")
                changes = jvp([*terms.constraints, *self._residuals], self._seeds(of))
                return block(name, f"q v a multipliers d{of}", changes)
            case "input_acceleration" | "parameter_acceleration":  # dv' along du or dp
                accelerations, checks = self._accelerations
                of = name[0].replace("i", "u")
                return block(name, f"q v d{of}", jvp(accelerations, self._seeds(of)), checks)
        raise KeyError(name)
